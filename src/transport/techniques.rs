//! Which strategies are executed, and how many samples each takes.

use crate::scene::settings::{Heuristic, IntegratorKind, Settings};
use std::collections::BTreeSet;

/// The sampling techniques of a render: what enters the weights besides the path itself.
#[derive(Clone, Debug)]
pub struct Techniques {
    /// Which family of strategies is executed.
    pub kind: IntegratorKind,
    /// Balance or power heuristic.
    pub heuristic: Heuristic,
    /// `n_s` of splatting strategies (t <= 1): light sub-paths per pass / pixels of the full film.
    pub splat_samples: f64,
    /// Probability with which a pair s, t >= 2 is tried.
    pub pair_probability: f64,
    /// The sensor can be hit by light paths (a detector).
    pub hittable_sensor: bool,
    /// Solid angle A of the regularization cone; `None`: specular vertices are not connectible.
    pub cone_area: Option<f64>,
    /// Strategies (s, t) that are never executed.
    pub disabled: BTreeSet<(u32, u32)>,
}

impl Techniques {
    /// From the settings of a render, for one sensor.
    #[must_use]
    pub fn new(settings: &Settings, splat_samples: f64, hittable_sensor: bool) -> Self {
        Self {
            kind: settings.integrator,
            heuristic: settings.heuristic,
            splat_samples,
            pair_probability: settings.pair_probability,
            hittable_sensor,
            cone_area: None,
            disabled: settings.disabled.clone(),
        }
    }

    /// Expected number of times strategy (s, t) is executed per pixel and pass, whatever the path: 0 if never.
    ///
    /// Strategy (1, 1) is a direct connection from the sensor to a light where the sensor is a detector; image cameras splat
    /// the start of a light sub-path.
    #[must_use]
    pub fn samples(&self, s: usize, t: usize) -> f64 {
        if !self.disabled.is_empty() && self.disabled.contains(&(s as u32, t as u32)) {
            return 0.0;
        }
        let from_camera = t >= 2 || (self.hittable_sensor && s == 1 && t == 1);
        let executed = match self.kind {
            IntegratorKind::Path => from_camera && s <= 1,
            IntegratorKind::Light => !from_camera,
            IntegratorKind::Bdpt => true,
        } && (t > 0 || self.hittable_sensor);
        if !executed {
            0.0
        } else if !from_camera {
            self.splat_samples
        } else if s >= 2 {
            self.pair_probability
        } else {
            1.0
        }
    }
}
