//! Flux through a detector: its film, summed up.
//!
//! The standard error is the root of the sum of the squared errors of what blocks of pixels have
//! brought by their samples, wherever it has landed, each known from the two halves of the passes:
//! with n blocks it is itself known to about 1/√(2n).

use super::Outputs;
use crate::film::{Blocks, Crop, Film, Sources};
use crate::scene::Sensor;
use crate::scene::settings::IntegratorKind;
use crate::spectrum::SpectralChannels;
use std::fmt;
use std::ops::Range;

/// A sum over a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Total {
    /// The sum.
    pub value: f64,
    /// Standard error; `None` before both halves of the passes have one, and where samples depend
    /// on each other (Markov chains, photon merging).
    pub error: Option<f64>,
}

/// Area of the pixels of a film in m², or their solid angle in sr.
#[derive(Clone, Debug, PartialEq)]
pub enum PixelMeasure {
    /// The same of all.
    Uniform(f64),
    /// Of each, row by row.
    Each(Vec<f64>),
}

impl PixelMeasure {
    /// Of a detector over part of its film, as it is when the shutter opens; `None` for cameras.
    #[must_use]
    pub fn of(sensor: &Sensor, crop: &Crop) -> Option<Self> {
        let camera = &sensor.camera;
        let area = camera.detector_area(sensor.shutter.open_s.into())?;
        let resolution = camera.resolution();
        Some(match camera.far_field() {
            Some(field) => {
                let Crop { x0, y0, x1, y1 } = *crop;
                Self::Each(field.pixels(resolution, x0..x1, y0..y1))
            }
            None => {
                let pixel = area / (resolution.size().x * resolution.size().y);
                match camera.curved() {
                    None => Self::Uniform(pixel),
                    Some(curved) => {
                        let Crop { x0, y0, x1, y1 } = *crop;
                        let stretches = curved.stretches(resolution, x0..x1, y0..y1);
                        Self::Each(stretches.into_iter().map(|s| s * pixel).collect())
                    }
                }
            }
        })
    }
}

impl PixelMeasure {
    /// Each of them over the mean, where they are not all the same.
    fn relative(&self) -> Option<Vec<f64>> {
        let Self::Each(all) = self else {
            return None;
        };
        let mean = self.mean();
        Some(all.iter().map(|measure| measure / mean).collect())
    }

    fn mean(&self) -> f64 {
        match self {
            Self::Uniform(measure) => *measure,
            Self::Each(all) => all.iter().sum::<f64>() / all.len() as f64,
        }
    }
}

/// How the light of a detector is summed up by the pixels of `sources`, whose samples bring it;
/// `None` for cameras, and where samples of different pixels depend on each other: those of Markov
/// chains, and those that share photons.
pub(super) fn sources(
    sensor: &Sensor,
    integrator: IntegratorKind,
    crop: &Crop,
    sources: &Crop,
) -> Option<Sources> {
    if integrator.runs_chains() || integrator.merges() {
        return None;
    }
    let relative = PixelMeasure::of(sensor, crop)?.relative();
    Some(Sources {
        blocks: Blocks::of(sources),
        measures: relative.map(Into::into),
    })
}

impl Total {
    /// Sum of channels over the pixels of a film whose halves hold so many passes, times `scale`.
    #[must_use]
    pub fn of(
        film: &Film,
        channels: Range<usize>,
        pixels: &PixelMeasure,
        scale: f64,
        passes: [u64; 2],
    ) -> Self {
        let image = film.image(passes[0] + passes[1]);
        let values = image.chunks_exact(film.channels());
        let values = values.map(|pixel| pixel[channels.clone()].iter().sum::<f64>());
        let sum = match pixels {
            PixelMeasure::Uniform(measure) => measure * values.sum::<f64>(),
            PixelMeasure::Each(measures) => values.zip(measures).map(|(v, m)| v * m).sum(),
        };
        let error = film.error_of_total(channels, passes);
        Self {
            value: scale * sum,
            error: error.map(|error| scale * pixels.mean() * error),
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

/// The channel of brightness in films of X, Y and Z.
pub const Y: Range<usize> = 1..2;

/// Radiant flux through a detector, line by line.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralFlux {
    /// Wavelength in nanometers and radiant flux in watts of each emission line.
    pub lines_w: Vec<(f64, Total)>,
    /// The radiant flux besides the lines, in watts, where there are bins.
    pub continuum_w: Option<Total>,
}

impl SpectralFlux {
    /// Sums of a spectral film whose halves hold so many passes.
    #[must_use]
    pub fn new(
        channels: &SpectralChannels,
        film: &Film,
        pixels: &PixelMeasure,
        passes: [u64; 2],
    ) -> Self {
        let lines = channels.lines_nm();
        let bins = channels.count() - lines.len();
        let total = |channels, scale| Total::of(film, channels, pixels, scale, passes);
        let of_line = |(i, &nm)| (nm, total(bins + i..bins + i + 1, 1.0));
        Self {
            lines_w: lines.iter().enumerate().map(of_line).collect(),
            continuum_w: (bins > 0).then(|| total(0..bins, channels.bin_width_nm())),
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
    /// Sums of the films of a detector over its pixels.
    #[must_use]
    pub fn new(outputs: &Outputs, pixels: &PixelMeasure, passes: [u64; 2]) -> Self {
        let lumens = outputs.response.photometric_unit();
        let mut flux = Self {
            luminous_lm: Total::of(&outputs.image, Y, pixels, lumens, passes),
            lines_w: Vec::new(),
            continuum_w: None,
            classes_lm: (outputs.classes.iter())
                .map(|(class, film)| {
                    let total = Total::of(film, Y, pixels, lumens, passes);
                    (class.source().to_owned(), total)
                })
                .collect(),
        };
        if let Some((channels, film)) = &outputs.spectral {
            let spectral = SpectralFlux::new(channels, film, pixels, passes);
            (flux.lines_w, flux.continuum_w) = (spectral.lines_w, spectral.continuum_w);
        }
        flux
    }
}
