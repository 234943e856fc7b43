//! A short run before the first pass, for what all passes must agree on.

use crate::film::SensorResponse;
use crate::integrator::{Frame, Workspace, sample_pixel};
use crate::transport::{Cone, PassSettings};

/// Samples of the pilot.
const SAMPLES: u32 = 1024;
/// Its pass index, which no render reaches.
const PASS: u32 = u32::MAX;
/// Share of the mean contribution of a sample below which contributions meet roulette before their shadow ray.
const SHARE: f64 = 0.05;

/// The roulette threshold: a share of the mean indirect value of a sample. A function of scene, settings and seed alone, so that
/// renders of different passes agree.
#[must_use]
pub fn roulette_threshold(frame: &Frame, cone: Option<Cone>, response: &SensorResponse) -> f64 {
    let resolution = frame.scene.sensors[frame.sensor].camera.resolution();
    let pass = PassSettings {
        index: PASS,
        cone,
        ..PassSettings::default()
    };
    let mut workspace = Workspace::default();
    let mut sum = 0.0;
    for i in 0..SAMPLES {
        // a plane lattice (R2) over the film
        let u = (f64::from(i) * 0.754_877_666_246_692_8 + 0.5).fract();
        let v = (f64::from(i) * 0.569_840_290_998_053_3 + 0.5).fract();
        let x = (u * f64::from(resolution.width)) as u32;
        let y = (v * f64::from(resolution.height)) as u32;
        let wavelengths = sample_pixel(frame, &pass, (x, y), response, &mut workspace);
        for contribution in workspace
            .contributions
            .iter()
            .filter(|c| c.class.depth() > 0)
        {
            let mut channels = [0.0; 3];
            response.add(&wavelengths, &contribution.lanes, &mut channels);
            sum += channels.iter().sum::<f64>() / 3.0;
        }
    }
    let mean = sum / f64::from(SAMPLES);
    if mean.is_finite() { SHARE * mean } else { 0.0 }
}
