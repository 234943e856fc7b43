//! Flux through a detector: its film, summed up.
//!
//! The standard error takes pixels as independent and is the root of the sum of their squared
//! errors, each known from the two halves of the passes: with n pixels it is itself known to about
//! 1/√(2n).

use super::Outputs;
use crate::camera::Camera;
use crate::film::{Crop, Film};
use crate::geometry::Moment;
use crate::spectrum::SpectralChannels;
use std::fmt;

/// A sum over a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Total {
    /// The sum.
    pub value: f64,
    /// Standard error; `None` before both halves of the passes have one.
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
    /// Of a detector over part of its film; `None` for cameras.
    #[must_use]
    pub fn of(camera: &Camera, crop: &Crop, moment: Moment) -> Option<Self> {
        let area = camera.detector_area(moment)?;
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

impl Total {
    /// Sum of a channel over the pixels of a film whose halves hold so many passes, times `scale`.
    #[must_use]
    pub fn of(
        film: &Film,
        channel: usize,
        pixels: &PixelMeasure,
        scale: f64,
        [even, odd]: [u64; 2],
    ) -> Self {
        let image = film.image(even + odd);
        let values = image.iter().skip(channel).step_by(film.channels());
        let noise = film.noise(channel, even, odd);
        let root = |squares: f64| squares.sqrt();
        match pixels {
            PixelMeasure::Uniform(measure) => {
                let scale = scale * measure;
                Self {
                    value: scale * values.sum::<f64>(),
                    error: noise.map(|noise| scale * root(noise.iter().map(|v| v * v).sum())),
                }
            }
            PixelMeasure::Each(measures) => {
                let values = values.zip(measures).map(|(v, m)| v * m);
                let noise = noise.map(|noise| {
                    let each = noise.iter().zip(measures).map(|(v, m)| v * m);
                    scale * root(each.map(|v| v * v).sum())
                });
                Self {
                    value: scale * values.sum::<f64>(),
                    error: noise,
                }
            }
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
        let total = |channel, scale| Total::of(film, channel, pixels, scale, passes);
        let of_line = |(i, &nm)| (nm, total(bins + i, 1.0));
        Self {
            lines_w: lines.iter().enumerate().map(of_line).collect(),
            // bins of one path share its wavelengths, but not their noise
            continuum_w: (0..bins)
                .map(|bin| total(bin, channels.bin_width_nm()))
                .reduce(|sum, bin| Total {
                    value: sum.value + bin.value,
                    error: sum.error.zip(bin.error).map(|(a, b)| a.hypot(b)),
                }),
        }
    }

    /// The same, of pixels whose errors are not independent.
    #[must_use]
    pub fn without_errors(mut self) -> Self {
        let lines = self.lines_w.iter_mut().map(|line| &mut line.1);
        let totals = lines.chain(&mut self.continuum_w);
        totals.for_each(|total| total.error = None);
        self
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
            luminous_lm: Total::of(&outputs.image, 1, pixels, lumens, passes),
            lines_w: Vec::new(),
            continuum_w: None,
            classes_lm: (outputs.classes.iter())
                .map(|(class, film)| {
                    let total = Total::of(film, 1, pixels, lumens, passes);
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
