//! Variance factors of a render: which strategies of the pixel's own scatter less than their second moments say.
//!
//! Invariant: a function of scene, sensor, crop and settings without the seed, so that all parts of a render agree.

use crate::film::Crop;
use crate::integrator::SensorJob;
use crate::light::LightId;
use crate::scene::settings::Heuristic;
use crate::transport::class::PathClass;
use crate::transport::factors::{Cells, FactorKey, Factors};

/// Factor of direct light on what a camera sees directly, where nothing is measured.
const DIRECT: f32 = 16.0;

/// Whether the weights of a render have variance factors: not where its strategies are all of one kind, and not where photons
/// are merged. [theory (2.7)]
#[must_use]
pub fn has_factors(frame: &SensorJob) -> bool {
    let strategies = &frame.strategies;
    frame.settings.heuristic == Heuristic::VarianceAware
        && strategies.merge.is_none()
        && strategies.splats
        && strategies.direct
}

/// Factors by rule: what an image camera sees directly and lights reach directly (LDE) is made by next-event estimation and by
/// hits, which scatter little; splats of it are grain. A detector sees nothing directly.
#[must_use]
pub fn by_rule(frame: &SensorJob, crop: Crop) -> Factors {
    let size = [crop.width(), crop.height()];
    let mut factors = Factors::new(Cells {
        first: [crop.x0, crop.y0],
        size,
        side: size[0].max(size[1]),
    });
    if !frame.strategies.hittable_sensor {
        let mut class = PathClass::new();
        class.push(false);
        for light in 0..frame.scene.lights.len() {
            if let Some(key) = FactorKey::new(LightId(light as u32), class) {
                // s = 0 and 1 are the pixel's own, 2 is a splat
                factors
                    .insert(key, &[DIRECT, DIRECT, 1.0])
                    .expect("invariant: one cell, three strategies");
            }
        }
    }
    factors
}
