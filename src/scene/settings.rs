//! How a scene is rendered: what the `[render]` table and the command line set.

use crate::math::named::named;
use std::collections::BTreeSet;

named! {
    /// The algorithm.
    pub enum IntegratorKind {
        /// Paths from the camera, with direct connections to lights.
        Path = "path": "Paths from the camera",
        /// Paths from the lights, connected to the sensor.
        Light = "light": "Paths from the lights",
        /// Both, with every connection, weighted together.
        Bdpt = "bdpt": "Both, weighted together",
        /// Both, with every connection and photon merging at every non-specular vertex (Georgiev et
        /// al. 2012).
        Vcm = "vcm": "Both, and photon merging, weighted together",
        /// Photon merging alone, at every non-specular vertex; paths without one as they are hit.
        Bpm = "bpm": "Photon merging at every vertex that scatters diffusely or glossily",
        /// Photon merging at the first non-specular vertex from the camera (Hachisuka et al. 2008);
        /// paths without one as they are hit.
        Ppm = "ppm": "Photon merging at the first such vertex from the camera",
        /// The samples of [`IntegratorKind::Bdpt`], drawn by Markov chains in proportion to their
        /// brightness (Kelemen et al. 2002).
        Pssmlt = "pssmlt": "As bdpt, by Metropolis sampling",
    }
}

impl IntegratorKind {
    /// Whether camera sub-paths gather the photons of their pass.
    #[must_use]
    pub fn merges(self) -> bool {
        matches!(self, Self::Vcm | Self::Bpm | Self::Ppm)
    }

    /// Whether Markov chains draw the samples.
    #[must_use]
    pub fn runs_chains(self) -> bool {
        self == Self::Pssmlt
    }

    /// Whether inner vertices of two sub-paths are connected.
    #[must_use]
    pub fn connects_pairs(self) -> bool {
        matches!(self, Self::Bdpt | Self::Vcm | Self::Pssmlt)
    }

    /// Whether paths with a non-specular vertex are made by merging alone.
    #[must_use]
    pub fn only_merges(self) -> bool {
        matches!(self, Self::Bpm | Self::Ppm)
    }
}

named! {
    /// Wavelengths and time that the paths of a pass share where they are merged.
    pub enum Sharing {
        /// One set of wavelengths and one time, drawn anew for each pass; one of the set is
        /// everybody's hero.
        Hero = "hero": "One wavelength set and time, one of the set as everybody's hero",
        /// One set and one time, but its wavelengths take turns as heroes over the pixels. Only
        /// paths of one hero are merged.
        Set = "set": "One set and time; the set's wavelengths take turns as heroes over the pixels",
        /// As [`Sharing::Hero`], but sets and times of successive passes keep apart (golden-ratio
        /// sequence).
        Stratified = "stratified": "As hero, with sets and times of successive passes kept apart",
    }
}

named! {
    /// Which chains of mirrors and smooth glass are solved for.
    pub enum Aiming {
        /// None.
        Off = "off": "None",
        /// With bidirectional paths, where no other strategy makes them well; the other integrators
        /// stay what their names say.
        Auto = "auto": "With `bdpt` and `pssmlt`, where no other strategy makes their paths well",
        /// All that the scene has, with every integrator that does not merge.
        All = "all": "All that the scene has, also with `path` and `light`",
    }
}

/// Photon merging.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Merging {
    /// Radius of the first pass in meters; `None`: found from the scene.
    pub radius: Option<f64>,
    /// α in (0, 1]: the radius of pass i = 1, 2, ... is that of the first times i^(−(1−α)/2).
    pub alpha: f64,
    /// Wavelengths and time that the paths of a pass share.
    pub sharing: Sharing,
}

impl Default for Merging {
    fn default() -> Self {
        Self {
            radius: None,
            alpha: 2.0 / 3.0,
            sharing: Sharing::Hero,
        }
    }
}

/// Metropolis sampling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metropolis {
    /// Mutations of a chain, at least 1.
    pub mutations: u32,
    /// Share of a pass's samples that are ordinary ones, one in each pixel, in (0, 1); the chains
    /// take the others.
    pub uniform: f64,
}

impl Default for Metropolis {
    fn default() -> Self {
        Self {
            mutations: 256,
            uniform: 0.25,
        }
    }
}

named! {
    /// How strategies are weighted.
    pub enum Heuristic {
        /// In proportion to densities times the quotient of second moment and variance, as found
        /// before the first pass; as [`Heuristic::Balance`] where photons are merged and where
        /// sub-paths of one kind are not traced.
        VarianceAware = "variance-aware": "As balance, and strategies that scatter less than others count more",
        /// In proportion to their densities (Veach and Guibas 1995).
        Balance = "balance": "In proportion to the densities",
        /// In proportion to the squares.
        Power2 = "power2": "In proportion to their squares",
    }
}

impl Heuristic {
    /// Power to which densities count in weights.
    #[must_use]
    pub fn power(self, density: f64) -> f64 {
        match self {
            Self::VarianceAware | Self::Balance => density,
            Self::Power2 => density * density,
        }
    }
}

named! {
    /// Whether and how specular vertices are connectible.
    pub enum Regularize {
        /// As [`Regularize::Mis`] for image cameras in scenes with specular surfaces, as
        /// [`Regularize::Off`] otherwise and where photons are merged.
        Auto = "auto": "As mis for image cameras where mirrors or smooth glass make paths that no solved chain makes, else off",
        /// Never: unbiased, and blind to paths that only connections at specular vertices make.
        Off = "off": "Never",
        /// Only for paths that no unbiased strategy makes, by the one strategy that the rule
        /// chooses (after Kaplanyan and Dachsbacher 2013).
        Single = "single": "Only for paths that nothing else makes, by one strategy",
        /// By every strategy, weighted with all others (Bouchard et al. 2013).
        Mis = "mis": "By every strategy, weighted with all others",
    }
}

named! {
    /// Which of a path's regularized strategies makes it under [`Regularize::Single`]: among those
    /// with the fewest regularized vertices, the one ...
    pub enum SingleRule {
        /// ... whose connecting edge is shortest: it blurs least.
        ShortestEdge = "shortest-edge": "The strategy whose connecting edge is shortest",
        /// ... that joins nearest to the camera.
        Camera = "camera": "The strategy that joins nearest to the camera",
        /// ... that joins nearest to the light.
        Light = "light": "The strategy that joins nearest to the light",
    }
}

named! {
    /// The kinds of reconstruction filters. None has negative parts, for splats are weighted by
    /// them.
    pub enum FilterKind {
        /// The pixel itself.
        Box = "box": "The pixel itself",
        /// A product of triangles.
        Tent = "tent": "A product of triangles",
        /// A Gaussian that is cut off.
        Gaussian = "gaussian": "A Gaussian",
    }
}

named! {
    /// Scale of the values of an image.
    pub enum OutputUnits {
        /// Unit equal-energy radiance gives Y = 1.
        Radiance = "radiance": "Unit equal-energy radiance gives Y = 1",
        /// Y in cd/m² (683 lm/W).
        Photometric = "photometric": "Y in cd/m²",
    }
}

/// Directional regularization.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regularization {
    /// Whether and how.
    pub mode: Regularize,
    /// The choice of single regularization.
    pub single_rule: SingleRule,
    /// Half-aperture ε₁ of the first pass's cone in radians, in (0, π/2]; `None`: found from the
    /// scene.
    pub epsilon: Option<f64>,
    /// Lower bound of ε in radians.
    pub epsilon_min: f64,
    /// Factor β in (0, 1] per regularized vertex on the weight of strategies, for paths that also
    /// have unbiased ones.
    pub bias_weight: f64,
    /// Odd passes use ε/√2, so that the halves of the passes tell the bias; `None`: where the
    /// sensor is a detector, of which exact numbers are expected.
    pub bias_estimate: Option<bool>,
}

impl Default for Regularization {
    fn default() -> Self {
        Self {
            mode: Regularize::Auto,
            single_rule: SingleRule::ShortestEdge,
            epsilon: None,
            epsilon_min: 0.0,
            bias_weight: 1.0,
            bias_estimate: None,
        }
    }
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
    /// Probability of trying a connection between two inner vertices (s, t >= 2), 0 < p <= 1;
    /// `None`: found from the scene.
    pub pair_probability: Option<f64>,
    /// Light sub-paths per camera sub-path, where photons are not merged; a fraction is the
    /// probability of one more. `None`: found from the scene.
    pub light_paths: Option<f64>,
    /// Connections at specular vertices.
    pub regularization: Regularization,
    /// Chains of specular vertices that are solved for.
    pub aim: Aiming,
    /// Photon merging, where the algorithm does it.
    pub merging: Merging,
    /// Metropolis sampling, where the algorithm does it.
    pub metropolis: Metropolis,
    /// Also shows paths from a light without extent to a pinhole over specular vertices alone:
    /// points of finite flux, which become discs of radius ε.
    pub show_point_lights: bool,
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
            heuristic: Heuristic::VarianceAware,
            pair_probability: None,
            light_paths: None,
            regularization: Regularization::default(),
            aim: Aiming::Auto,
            merging: Merging::default(),
            metropolis: Metropolis::default(),
            show_point_lights: false,
            disabled: BTreeSet::new(),
        }
    }
}
