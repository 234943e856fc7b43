//! How a scene is rendered: what the `[render]` table and the command line set.

use std::collections::BTreeSet;

/// The algorithm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntegratorKind {
    /// Paths from the camera, with direct connections to lights.
    Path,
    /// Paths from the lights, connected to the sensor.
    Light,
    /// Both, with every connection, weighted together.
    Bdpt,
}

/// How strategies are weighted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heuristic {
    /// In proportion to their densities (Veach and Guibas 1995).
    Balance,
    /// In proportion to the squares.
    Power2,
}

/// Render settings of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The algorithm.
    pub integrator: IntegratorKind,
    /// Passes: one sample per pixel each.
    pub spp: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Wavelengths per path: 1, 4 or 8.
    pub lanes: usize,
    /// Scattering vertices of the whole path, at most; `None`: no limit but Russian roulette.
    pub max_depth: Option<u32>,
    /// Weighting of strategies.
    pub heuristic: Heuristic,
    /// Probability of trying a connection between two inner vertices (s, t >= 2), 0 < p <= 1.
    pub pair_probability: f64,
    /// Strategies (s, t) never executed: for tests and studies.
    pub disabled: BTreeSet<(u32, u32)>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            integrator: IntegratorKind::Bdpt,
            spp: 64,
            seed: 0,
            lanes: 4,
            max_depth: None,
            heuristic: Heuristic::Balance,
            pair_probability: 0.25,
            disabled: BTreeSet::new(),
        }
    }
}
