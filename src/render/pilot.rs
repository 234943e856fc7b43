//! Short runs before the first pass, for what all passes must agree on.

use crate::film::Crop;
use crate::integrator::{SensorJob, Workspace, sample_pixel};
use crate::spectrum::SensorResponse;
use crate::transport::{Cone, PassSettings};

/// Samples of a pilot.
pub(super) const SAMPLES: u32 = 1024;
/// Pass index of the pilot, which no render reaches.
pub(super) const PASS: u32 = u32::MAX;
/// Share of the mean contribution of a sample below which contributions meet roulette before their
/// shadow ray.
const SHARE: f64 = 0.05;

/// As many pixels, spread over the crop (the R2 lattice).
pub(super) fn lattice(crop: &Crop) -> impl Iterator<Item = (u32, u32)> {
    let (x0, y0, width, height) = (crop.x0, crop.y0, crop.width(), crop.height());
    (0..SAMPLES).map(move |i| {
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
