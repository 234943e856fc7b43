//! Short runs before the first pass, for what all passes must agree on.

use crate::film::Crop;
use crate::integrator::{SensorJob, Workspace, sample_pixel};
use crate::spectrum::SensorResponse;
use crate::transport::{Cone, PassSettings};
use std::iter;

/// Samples of a pilot.
pub(super) const SAMPLES: u32 = 1024;
/// Pass index of the pilot, which no render reaches.
pub(super) const PASS: u32 = u32::MAX;
/// Share of the mean contribution of a sample below which contributions meet roulette before their
/// shadow ray.
const SHARE: f64 = 0.05;

/// Regions along each side of the crop, whose brightness errors are relative to, and the share of
/// the mean brightness that is added to it.
const REGIONS: u32 = 12;
const DARK: f64 = 0.1;

/// Regions of a crop, with the light that samples found in each.
#[derive(Clone)]
pub(super) struct Regions {
    crop: Crop,
    light: Vec<f64>,
    samples: Vec<f64>,
}

impl Regions {
    pub(super) fn new(crop: Crop) -> Self {
        let zeros = vec![0.0; (REGIONS * REGIONS) as usize];
        Self {
            crop,
            light: zeros.clone(),
            samples: zeros,
        }
    }

    /// The region that a raster position is in, or the nearest.
    pub(super) fn at(&self, x: f64, y: f64) -> usize {
        let along = |x: f64, first: u32, size: u32| {
            let share = (x - f64::from(first)) / f64::from(size);
            (share * f64::from(REGIONS)).clamp(0.0, f64::from(REGIONS - 1)) as usize
        };
        let Crop { x0, y0, .. } = self.crop;
        along(y, y0, self.crop.height()) * REGIONS as usize + along(x, x0, self.crop.width())
    }

    pub(super) fn add_samples(&mut self, region: usize, count: u32) {
        self.samples[region] += f64::from(count);
    }

    pub(super) fn add_light(&mut self, region: usize, value: f64) {
        self.light[region] += value;
    }

    /// Region by region, one over its squared brightness per sample.
    pub(super) fn scale(&self) -> Vec<f64> {
        let count = self.samples.iter().sum::<f64>().max(1.0);
        let mean = self.light.iter().sum::<f64>() / count;
        iter::zip(&self.light, &self.samples)
            .map(|(light, samples)| {
                let here = if *samples > 0.0 {
                    light / samples
                } else {
                    mean
                };
                1.0 / (here * here + (DARK * mean).powi(2)).max(f64::MIN_POSITIVE)
            })
            .collect()
    }
}

/// As many pixels, spread over the crop.
pub(super) fn lattice(crop: &Crop) -> impl Iterator<Item = (u32, u32)> {
    spread(crop).take(SAMPLES as usize)
}

/// Pixels without end, of which any number from the first on are spread over the crop (the R2
/// lattice).
pub(super) fn spread(crop: &Crop) -> impl Iterator<Item = (u32, u32)> {
    let (x0, y0, width, height) = (crop.x0, crop.y0, crop.width(), crop.height());
    (0u32..).map(move |i| {
        let u = (f64::from(i) * 0.754_877_666_246_692_8 + 0.5).fract();
        let v = (f64::from(i) * 0.569_840_290_998_053_3 + 0.5).fract();
        (
            x0 + (u * f64::from(width)) as u32,
            y0 + (v * f64::from(height)) as u32,
        )
    })
}

/// The roulette threshold: a share of the mean indirect value of a sample. A function of scene,
/// settings and seed alone, so that renders of different passes agree.
#[must_use]
pub fn roulette_threshold(frame: &SensorJob, cone: Option<Cone>, response: SensorResponse) -> f64 {
    let pass = PassSettings {
        index: PASS,
        cone,
        ..PassSettings::default()
    };
    let mut workspace = Workspace::default();
    let mut sum = 0.0;
    for pixel in lattice(&frame.scene.sensors[frame.sensor].whole_film()) {
        let response = sample_pixel(frame, &pass, pixel, response, &mut workspace);
        for contribution in workspace.contributions.iter().filter(|c| c.s + c.t > 2) {
            sum += response.brightness(&contribution.lanes);
        }
    }
    let mean = sum / f64::from(SAMPLES);
    if mean.is_finite() { SHARE * mean } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lattice_stays_in_the_crop() {
        let crop = Crop {
            x0: 3,
            y0: 5,
            x1: 10,
            y1: 7,
        };
        assert!(lattice(&crop).all(|(x, y)| crop.contains(x, y)));
        assert_eq!(lattice(&crop).count(), SAMPLES as usize);
    }
}
