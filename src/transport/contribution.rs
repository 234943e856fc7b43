//! Contributions: weighted values of paths and the pixels they land on.

use super::aim::tries::Origin;
use super::class::PathClass;
use crate::light::LightId;
use crate::spectrum::MAX_LANES;
use glam::DVec2;

/// Where a contribution lands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// The pixel whose camera sub-path this is.
    OwnPixel,
    /// A raster position.
    Splat(DVec2),
}

/// The bridge that made a contribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aimed {
    /// Kind of its chain, by index.
    pub kind: u32,
    /// Where it was solved from.
    pub origin: Origin,
    /// Weight of the contribution in the sum of all strategies, in [0, 1].
    pub weight: f32,
}

/// One weighted contribution to a pixel's value.
#[derive(Clone, Copy, Debug)]
pub struct Contribution {
    /// Where it lands.
    pub target: Target,
    /// `C_j` per lane: to be multiplied by the response at λ_j over the density of λ_j and summed.
    pub lanes: [f64; MAX_LANES],
    /// The same had its strategy been the only one: the raw estimate.
    pub raw: [f64; MAX_LANES],
    /// Share that strategies of camera sub-paths alone have in the weights of the path, where raw
    /// estimates are computed; else 0. Of merged paths 0.
    pub camera_share: f32,
    /// Vertices from the light.
    pub s: u32,
    /// Vertices from the sensor.
    pub t: u32,
    /// Specular vertices at which the strategy joined: 0, 1 or 2.
    pub regularized: u8,
    /// Made by photon merging: one vertex counts for both sides, s + t is one more than the
    /// vertices of the path.
    pub merged: bool,
    /// Brought by a camera sub-path to where another wavelength than its hero's is seen; such sums
    /// have no number of vertices where nothing is kept by class.
    pub beside: bool,
    /// Chain solved for, between the `s` vertices from the light and the `t` from the sensor, if a
    /// bridge made this.
    pub aimed: Option<Aimed>,
    /// The light of x₀; of merged paths any.
    pub emitter: LightId,
    /// Labels of the vertices; empty where nothing is kept by class.
    pub class: PathClass,
    /// Scattering vertices from the light on: first and one past the last among the events of
    /// the sample. None of merged paths, and where nothing is kept by class.
    pub events: [u32; 2],
}

impl Contribution {
    /// Sum of several paths.
    #[must_use]
    pub fn sum(target: Target, lanes: [f64; MAX_LANES]) -> Self {
        Self {
            target,
            lanes,
            raw: [0.0; MAX_LANES],
            camera_share: 0.0,
            s: 0,
            t: 0,
            regularized: 0,
            merged: false,
            beside: false,
            aimed: None,
            emitter: LightId(0),
            class: PathClass::default(),
            events: [0; 2],
        }
    }

    /// Letter that sets techniques of the same (s, t) apart in names of layers: none for joins.
    #[must_use]
    pub fn mark(&self) -> &'static str {
        if self.merged {
            "merged"
        } else if self.aimed.is_some() {
            "aimed"
        } else {
            ""
        }
    }
}
