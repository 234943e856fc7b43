//! Which strategies are executed, and how many samples each takes.

use super::AskedDensities;
use super::aim::tries::{Origin, Tries};
use super::factors::Factors;
use super::mis::Technique;
use super::regularize::Cone;
use crate::scene::settings::{Heuristic, SingleRule};
use std::collections::BTreeSet;

/// At which vertices of a camera sub-path photons are merged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MergeRule {
    /// At every non-specular vertex.
    Every,
    /// At the first non-specular vertex from the sensor.
    FirstFromSensor,
}

/// Photon merging.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Merge {
    /// π r² N_L, with N_L light sub-paths among whose photons a camera sub-path gathers; 0 in a
    /// pass without photons.
    pub samples: f64,
    /// Where.
    pub rule: MergeRule,
    /// Paths with a non-specular vertex are made by merging alone.
    pub alone: bool,
}

/// Which chains are solved for, and from where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Aims {
    /// Camera vertices aim at lights.
    pub light: bool,
    /// Light vertices aim at the sensor.
    pub sensor: bool,
    /// Starts on lights aim at the sensor.
    pub through: bool,
    /// At lights also from vertices that the sensor sees directly: else only through what is
    /// specular.
    pub light_everywhere: bool,
    /// At the sensor also from vertices that light reaches directly.
    pub sensor_everywhere: bool,
}

impl Aims {
    /// None at all.
    pub const NONE: Self = Self {
        light: false,
        sensor: false,
        through: false,
        light_everywhere: false,
        sensor_everywhere: false,
    };

    /// Whether any are made.
    #[must_use]
    pub fn any(&self) -> bool {
        self.light || self.sensor || self.through
    }
}

/// The strategies of a pass: what enters the weights besides the path itself.
#[derive(Clone, Copy, Debug)]
pub struct StrategySet<'a> {
    /// s = 0: camera sub-paths hit lights.
    pub hits: bool,
    /// s = 1, t >= 2: camera vertices are connected to lights.
    pub direct: bool,
    /// (1, 1) of a detector: its point is connected to a light.
    pub direct_to_detector: bool,
    /// t = 1: light vertices, and starts for image cameras, are connected to the sensor.
    pub splats: bool,
    /// t = 0: light sub-paths hit a detector.
    pub arrivals: bool,
    /// s, t >= 2: probability with which a pair of non-specular ends is tried; 0: never, those with
    /// a specular end neither.
    pub pairs: f64,
    /// Photon merging; `None`: never.
    pub merge: Option<Merge>,
    /// Power of the densities.
    pub heuristic: Heuristic,
    /// Variance factors; `None`: all are 1.
    pub factors: Option<&'a Factors>,
    /// Light sub-paths per camera sub-path; a fraction is the probability of one more.
    pub light_paths: f64,
    /// `n_s` of t <= 1: light sub-paths per pass / pixels of the full film.
    pub splat_samples: f64,
    /// The sensor can be hit by light paths (a detector).
    pub hittable_sensor: bool,
    /// The regularization cone; `None`: specular vertices are not connectible.
    pub cone: Option<Cone>,
    /// Regularized strategies make only paths that no other makes, by this rule; `None`: they share
    /// all paths.
    pub single: Option<SingleRule>,
    /// β per regularized vertex on the weight, for paths that also have unbiased strategies.
    pub bias_weight: f64,
    /// Chains solved for.
    pub aims: Aims,
    /// Camera sub-paths go on with all lanes from the first rough vertex behind dispersion.
    pub fans: bool,
    /// How often each kind of them is tried; `None`: always.
    pub tries: Option<&'a Tries>,
    /// Strategies (s, t) that are never executed.
    pub disabled: &'a BTreeSet<(u32, u32)>,
}

impl StrategySet<'_> {
    /// Whether any strategy takes vertices of camera sub-paths.
    #[must_use]
    pub fn wants_camera_walk(&self) -> bool {
        self.hits || self.direct || self.pairs > 0.0 || self.merge.is_some()
    }

    /// Whether any strategy takes the point on the sensor that they start from.
    #[must_use]
    pub fn wants_camera_start(&self) -> bool {
        self.wants_camera_walk() || self.direct_to_detector
    }

    /// Whether any strategy takes light sub-paths of the sample itself.
    #[must_use]
    pub fn wants_light_walk(&self) -> bool {
        self.splats || self.pairs > 0.0 || self.arrivals && self.hittable_sensor
    }

    /// Which densities from the other side the weights of these strategies take. Techniques with
    /// two vertices or more from the light ask for those of camera sub-paths, techniques with two
    /// or more from the sensor, or one that is joined to a light, for those of light sub-paths.
    #[must_use]
    pub fn asked(&self) -> AskedDensities {
        let both = self.pairs > 0.0 || self.merge.is_some() || self.aims.any();
        AskedDensities {
            from_light: both || self.splats || self.arrivals,
            from_sensor: both || self.hits || self.direct || self.direct_to_detector,
        }
    }

    /// Whether camera sub-paths that hit a light or are joined to one are all there is, each once
    /// per pixel and pass and with no other factor on it, if these densities are `asked`.
    #[must_use]
    #[inline]
    pub fn has_two_terms(&self, asked: &AskedDensities) -> bool {
        !asked.from_light && self.factors.is_none() && !self.fans && self.disabled.is_empty()
    }

    /// Takes as many light sub-paths per camera sub-path, and tries such a share of the pairs. With
    /// no light sub-paths at all only hits and connections to lights are left, and no chains.
    pub fn set_effort(&mut self, light_paths: f64, pairs: f64) {
        self.pairs = pairs;
        if light_paths == 0.0 {
            (self.splats, self.arrivals, self.pairs) = (false, false, 0.0);
            self.aims = Aims::NONE;
        }
        self.set_light_paths(light_paths);
    }

    /// Takes `count` light sub-paths per camera sub-path.
    pub fn set_light_paths(&mut self, count: f64) {
        self.splat_samples *= count / self.light_paths;
        self.light_paths = count;
    }

    /// Whether camera sub-paths end at their first non-specular vertex: all that goes on from there
    /// is merged.
    #[must_use]
    pub fn ends_at_first_rough(&self) -> bool {
        self.merge
            .is_some_and(|m| m.alone && m.rule == MergeRule::FirstFromSensor)
    }

    /// Whether paths with a non-specular vertex are made by merging alone.
    #[must_use]
    pub fn merges_alone(&self) -> bool {
        self.merge.is_some_and(|m| m.alone)
    }

    /// Probability with which a kind of chains is tried.
    #[must_use]
    pub fn tried(&self, origin: Origin, kind: usize) -> f64 {
        self.tries.map_or(1.0, |tries| tries.share(origin, kind))
    }

    /// π r² N_L, 0 without merging.
    #[must_use]
    pub fn merge_samples(&self) -> f64 {
        self.merge.map_or(0.0, |m| m.samples)
    }

    /// Whether merging is done at the first non-specular vertex from the sensor only.
    #[must_use]
    pub fn merges_first_only(&self) -> bool {
        self.merge
            .is_some_and(|m| m.rule == MergeRule::FirstFromSensor)
    }

    /// Expected number of times a technique is executed per pixel and pass for a path of `n`
    /// vertices that it joins at specular vertices or not (`regularized`): 0 if never. For merging
    /// times π r².
    ///
    /// Strategy (1, 1) is a direct connection from the sensor to a light where the sensor is a
    /// detector; image cameras splat the start of a light sub-path. Pairs with a specular end are
    /// always tried, since their cones reject nearly all of them.
    #[must_use]
    #[inline]
    pub fn samples(&self, technique: Technique, n: usize, regularized: bool) -> f64 {
        let s = match technique {
            Technique::Join(s) => s,
            Technique::Merge(_) => return self.merge_samples(),
            Technique::Bridge(_, b) if b + 1 == n => return self.splat_samples,
            Technique::Bridge(..) => return 1.0,
        };
        let t = n - s;
        if !self.disabled.is_empty() && self.disabled.contains(&(s as u32, t as u32)) {
            return 0.0;
        }
        let per_pixel = |executed: bool| if executed { 1.0 } else { 0.0 };
        let per_light_path = |executed: bool| if executed { self.splat_samples } else { 0.0 };
        match (s, t) {
            (_, 0) => per_light_path(self.arrivals && self.hittable_sensor),
            (0, _) => per_pixel(self.hits),
            (1, 1) if self.hittable_sensor => per_pixel(self.direct_to_detector),
            (_, 1) => per_light_path(self.splats),
            (1, _) => per_pixel(self.direct),
            _ if regularized => per_pixel(self.pairs > 0.0) * self.light_paths,
            _ => self.pairs * self.light_paths,
        }
    }
}
