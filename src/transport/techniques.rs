//! Which strategies are executed, and how many samples each takes.

use super::regularize::Cone;
use crate::scene::settings::{Heuristic, IntegratorKind, Settings, SingleRule};
use std::collections::BTreeSet;

/// The sampling techniques of a pass: what enters the weights besides the path itself.
#[derive(Clone, Copy, Debug)]
pub struct Techniques<'a> {
    /// Which family of strategies is executed.
    pub kind: IntegratorKind,
    /// Balance or power heuristic.
    pub heuristic: Heuristic,
    /// `n_s` of splatting strategies (t <= 1): light sub-paths per pass / pixels of the full film.
    pub splat_samples: f64,
    /// Probability with which a pair s, t >= 2 of non-specular ends is tried.
    pub pair_probability: f64,
    /// The sensor can be hit by light paths (a detector).
    pub hittable_sensor: bool,
    /// The regularization cone; `None`: specular vertices are not connectible.
    pub cone: Option<Cone>,
    /// Regularized strategies make only paths that no other makes, by this rule; `None`: they share all paths.
    pub single: Option<SingleRule>,
    /// β per regularized vertex on the weight, for paths that also have unbiased strategies.
    pub bias_weight: f64,
    /// Photon merging: π r² N_L, with N_L light sub-paths among whose photons a camera sub-path gathers; 0: no merging.
    pub merging: f64,
    /// Strategies (s, t) that are never executed.
    pub disabled: &'a BTreeSet<(u32, u32)>,
}

impl<'a> Techniques<'a> {
    /// From the settings of a render, for one sensor, without regularization.
    #[must_use]
    pub fn new(settings: &'a Settings, splat_samples: f64, hittable_sensor: bool) -> Self {
        Self {
            kind: settings.integrator,
            heuristic: settings.heuristic,
            splat_samples,
            pair_probability: settings.pair_probability,
            hittable_sensor,
            cone: None,
            single: None,
            bias_weight: 1.0,
            merging: 0.0,
            disabled: &settings.disabled,
        }
    }

    /// Expected number of times strategy (s, t) is executed per pixel and pass for a path that it joins at specular vertices or not
    /// (`regularized`): 0 if never.
    ///
    /// Strategy (1, 1) is a direct connection from the sensor to a light where the sensor is a detector; image cameras splat
    /// the start of a light sub-path. Pairs with a specular end are always tried, since their cones reject nearly all of them.
    #[must_use]
    #[inline]
    pub fn samples(&self, s: usize, t: usize, regularized: bool) -> f64 {
        if !self.disabled.is_empty() && self.disabled.contains(&(s as u32, t as u32)) {
            return 0.0;
        }
        let from_camera = t >= 2 || (self.hittable_sensor && s == 1 && t == 1);
        let executed = match self.kind {
            IntegratorKind::Path => from_camera && s <= 1,
            IntegratorKind::Light => !from_camera,
            IntegratorKind::Bdpt | IntegratorKind::Vcm => true,
            // what is left of connections: paths that hit, and a detector's view of lights that cannot be hit
            IntegratorKind::Bpm | IntegratorKind::Ppm => {
                s == 0 || t == 0 || self.hittable_sensor && s + t == 2
            }
        } && (t > 0 || self.hittable_sensor);
        if !executed {
            0.0
        } else if !from_camera {
            self.splat_samples
        } else if s >= 2 && !regularized {
            self.pair_probability
        } else {
            1.0
        }
    }
}
