//! Flux through a detector: its film, summed up.
//!
//! The standard error takes pixels as independent and is the root of the sum of their squared
//! errors, each known from the two halves of the passes: with n pixels it is itself known to about
//! 1/√(2n).

use super::Outputs;
use crate::film::Film;
use std::fmt;

/// A sum over a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Total {
    /// The sum.
    pub value: f64,
    /// Standard error; `None` before both halves of the passes have one.
    pub error: Option<f64>,
}

impl Total {
    /// Sum of a channel over a film whose halves hold so many passes, times `scale`.
    #[must_use]
    pub fn of(film: &Film, channel: usize, scale: f64, [even, odd]: [u64; 2]) -> Self {
        let image = film.image(even + odd);
        let values = image.iter().skip(channel).step_by(film.channels());
        let noise = film.noise(channel, even, odd);
        Self {
            value: scale * values.sum::<f64>(),
            error: noise.map(|noise| scale * noise.iter().map(|v| v * v).sum::<f64>().sqrt()),
        }
    }
}

impl fmt::Display for Total {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.error {
            Some(error) => write!(f, "{:.6e} ± {error:.1e}", self.value),
            None => write!(f, "{:.6e}", self.value),
        }
    }
}

/// Flux through a detector.
#[derive(Clone, Debug, PartialEq)]
pub struct Flux {
    /// Luminous flux, lumens.
    pub luminous_lm: Total,
    /// Wavelength in nanometers and radiant flux in watts of each emission line, where the spectral
    /// image is kept.
    pub lines_w: Vec<(f64, Total)>,
    /// The radiant flux besides the lines, in watts, where the spectral image is kept and has bins.
    pub continuum_w: Option<Total>,
    /// Luminous flux of the paths of each expression over classes that is kept, lumens.
    pub classes_lm: Vec<(String, Total)>,
}

impl Flux {
    /// Sums of the films of a detector whose pixels have an area of `pixel_m2`.
    #[must_use]
    pub fn new(outputs: &Outputs, pixel_m2: f64, passes: [u64; 2]) -> Self {
        let lumens = pixel_m2 * outputs.response.photometric_unit();
        let mut flux = Self {
            luminous_lm: Total::of(&outputs.image, 1, lumens, passes),
            lines_w: Vec::new(),
            continuum_w: None,
            classes_lm: (outputs.classes.iter())
                .map(|(class, film)| {
                    let total = Total::of(film, 1, lumens, passes);
                    (class.source().to_owned(), total)
                })
                .collect(),
        };
        let Some((channels, film)) = &outputs.spectral else {
            return flux;
        };
        let lines = channels.lines_nm();
        let bins = channels.count() - lines.len();
        let total = |channel, scale| Total::of(film, channel, scale, passes);
        let of_line = |(i, &nm)| (nm, total(bins + i, pixel_m2));
        flux.lines_w = lines.iter().enumerate().map(of_line).collect();
        // bins of one path share its wavelengths, but not their noise
        flux.continuum_w = (0..bins)
            .map(|bin| total(bin, pixel_m2 * channels.bin_width_nm()))
            .reduce(|sum, bin| Total {
                value: sum.value + bin.value,
                error: sum.error.zip(bin.error).map(|(a, b)| a.hypot(b)),
            });
        flux
    }

    /// The same, of pixels whose errors are not independent.
    #[must_use]
    pub fn without_errors(mut self) -> Self {
        let lines = self.lines_w.iter_mut().map(|line| &mut line.1);
        let classes = self.classes_lm.iter_mut().map(|class| &mut class.1);
        let totals = lines.chain(classes).chain(&mut self.continuum_w);
        totals.for_each(|total| total.error = None);
        self.luminous_lm.error = None;
        self
    }
}
