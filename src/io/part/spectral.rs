//! Channels of the spectral films of a part.

use crate::spectrum::SpectralChannels;
use serde::{Deserialize, Serialize};

/// Most channels.
const MAX_CHANNELS: u64 = 1 << 17;

/// Channels of a spectral film: equal bins, then lines. Wavelengths are texts, so that they come
/// back as they were.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpectralFilm {
    /// Ends of the range of the bins, nm.
    pub range_nm: [String; 2],
    /// Number of bins.
    pub bins: u32,
    /// Lines, nm, ascending.
    pub lines_nm: Vec<String>,
}

impl SpectralFilm {
    /// Of these channels.
    #[must_use]
    pub fn of(channels: &SpectralChannels) -> Self {
        let lines = channels.lines_nm();
        let text = |nm: &f64| format!("{nm:?}");
        Self {
            range_nm: channels.range_nm().map(|nm| text(&nm)),
            bins: (channels.count() - lines.len()) as u32,
            lines_nm: lines.iter().map(text).collect(),
        }
    }

    /// Number of channels.
    #[must_use]
    pub fn count(&self) -> u64 {
        u64::from(self.bins) + self.lines_nm.len() as u64
    }

    /// The channels; `None` where a wavelength is none.
    #[must_use]
    pub fn channels(&self) -> Option<SpectralChannels> {
        let nm = |text: &String| text.parse().ok().filter(|nm: &f64| nm.is_finite());
        let [low, high] = &self.range_nm;
        let range_nm = [nm(low)?, nm(high)?];
        let lines: Option<Vec<f64>> = self.lines_nm.iter().map(nm).collect();
        let channels = SpectralChannels::new(range_nm, self.bins as usize, lines?);
        // an empty range has no bins, lines that are not in order are others
        (Self::of(&channels) == *self).then_some(channels)
    }

    /// Whether they can be those of a part.
    ///
    /// # Errors
    /// Fault, in words.
    pub fn check(&self) -> Result<(), &'static str> {
        if !(1..=MAX_CHANNELS).contains(&self.count()) {
            return Err("the number of spectral channels is not 1 to 131072");
        }
        match self.channels() {
            Some(_) => Ok(()),
            None => Err("the wavelengths of spectral channels are none, or not in order"),
        }
    }
}
