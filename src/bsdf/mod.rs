//! Scattering at a surface point, in units of basic radiance (L/η²): one symmetric kernel, no transport mode.
//!
//! Directions are unit vectors in the local shading frame (z = shading normal), pointing away from the surface.
//! ω⁻ points towards the light side of the path, ω⁺ towards the camera side. `g = f / η₊²` is symmetric.

pub mod conductor;
pub mod dielectric;
pub mod diffuse;
pub mod fresnel;
pub mod microfacet;
pub mod rough_dielectric;
pub mod thin;

use crate::spectrum::{MAX_LANES, SampledSpectrum};
use arrayvec::ArrayVec;
use glam::DVec3;

/// What happened at an interior vertex of a path. A path is a list of vertices *and* labels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Label {
    /// Any non-specular scattering (diffuse, glossy, rough transmission).
    NonSpecular,
    /// Exact mirror reflection.
    SpecularReflect,
    /// Exact refraction, or straight passage through a thin sheet.
    SpecularTransmit,
}

impl Label {
    /// Whether the label is one of the two specular ones.
    #[must_use]
    pub fn is_specular(self) -> bool {
        self != Self::NonSpecular
    }
}

/// Which end of the path a sampled direction leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// ω⁻ is generated (camera sub-paths).
    Light,
    /// ω⁺ is generated (light sub-paths).
    Camera,
}

/// Refractive indices on the two sides of a surface, per lane.
#[derive(Clone, Copy, Debug)]
pub struct Interface {
    /// On the side the normal points to.
    pub eta_above: [f64; MAX_LANES],
    /// On the other side.
    pub eta_below: [f64; MAX_LANES],
    /// Lanes in use.
    pub count: usize,
    /// The ratio of the two indices differs between wavelengths.
    pub dispersive: bool,
}

/// A density that may depend on the lane (rough dispersive transmission only; then it is per-lane).
///
/// For everything else all lanes have the hero's density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneDensity {
    /// The density of each lane; [0] is the hero's.
    pub lanes: [f64; MAX_LANES],
}

/// Value and densities of the non-specular label for one pair of directions.
#[derive(Clone, Copy, Debug)]
pub struct BsdfEval {
    /// `g = f / η₊²`, per lane.
    pub g: SampledSpectrum,
    /// Hero's solid-angle density of generating ω⁺ given ω⁻ (the D→ of a light walk), label probability included.
    pub pdf_camera: f64,
    /// Hero's solid-angle density of generating ω⁻ given ω⁺ (the D← of a camera walk), label probability included.
    pub pdf_light: f64,
    /// Per-lane versions of (`pdf_camera`, `pdf_light`) where they differ from the hero's.
    pub columns: Option<(LaneDensity, LaneDensity)>,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// The direction, local frame.
    pub w: DVec3,
    /// The label drawn.
    pub label: Label,
    /// Throughput factor in basic units, per lane: `g η² |cos θ| / pdf` for the non-specular label (cos and η² of the
    /// generated side, hero's pdf), `R/q` or `T/q` for a specular one. A dispersive transmission leaves only the hero
    /// and lanes of exactly its wavelength alive (the caller does that, from `dispersive`).
    pub weight: SampledSpectrum,
    /// Density of the generated direction: per solid angle for the non-specular label, the label's probability `q` for
    /// a specular one (its delta is left out).
    pub pdf: f64,
    /// The same with the roles of the two directions exchanged.
    pub pdf_reverse: f64,
    /// A specular transmission whose direction depends on the wavelength.
    pub dispersive: bool,
    /// Per-lane versions of (`pdf`, `pdf_reverse`) where they differ from the hero's.
    pub columns: Option<(LaneDensity, LaneDensity)>,
}

/// One scattering lobe with its parameters at a point and at the path's wavelengths.
#[derive(Clone, Copy, Debug)]
pub enum Lobe {
    /// Lambertian reflection.
    Diffuse(diffuse::Diffuse),
    /// Perfect mirror (reflectance per lane) or smooth conductor.
    Mirror(conductor::Mirror),
    /// GGX conductor.
    Conductor(conductor::Conductor),
    /// Smooth dielectric interface between the two media of the surface.
    Dielectric(dielectric::Dielectric),
    /// GGX dielectric interface.
    RoughDielectric(rough_dielectric::RoughDielectric),
    /// Thin sheet: reflects and passes straight, between equal media.
    Thin(thin::Thin),
}

/// A mixture of weighted lobes between two media. Weights are at most 1 in sum; what is missing is absorbed.
#[derive(Clone, Debug)]
pub struct Bsdf {
    /// (weight, lobe); the selection probability of a lobe is its weight over the sum.
    pub lobes: ArrayVec<(f32, Lobe), 4>,
    /// Refractive indices of the two sides.
    pub interface: Interface,
}

#[allow(unused_variables)]
impl Bsdf {
    /// The bsdf that absorbs everything.
    #[must_use]
    pub fn black(interface: Interface) -> Self {
        Self { lobes: ArrayVec::new(), interface }
    }

    /// Whether there is any non-specular lobe: the vertex can be connected.
    #[must_use]
    pub fn has_non_specular(&self) -> bool {
        todo!()
    }

    /// Whether there is any specular lobe.
    #[must_use]
    pub fn has_specular(&self) -> bool {
        todo!()
    }

    /// The non-specular label for given directions. Both densities come with the value: they cannot disagree.
    #[must_use]
    pub fn eval(&self, w_light: DVec3, w_camera: DVec3) -> BsdfEval {
        todo!()
    }

    /// Generates the direction of side `generate` from the `given` one. `u`: label/lobe choice, then two for the direction.
    /// `None` when the sample fails (GGX below the surface, nothing to scatter).
    #[must_use]
    pub fn sample(&self, given: DVec3, generate: Side, u: [f64; 3]) -> Option<BsdfSample> {
        todo!()
    }

    /// Albedo-like colour for the preview AOV: mean reflectance per lane at normal incidence.
    #[must_use]
    pub fn albedo(&self) -> SampledSpectrum {
        todo!()
    }
}
