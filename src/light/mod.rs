//! Light sources: where sub-paths of light begin and where camera paths may end.
//!
//! Values are in basic radiance units as `transport` needs them; the probability of choosing a light is not in here (see
//! [`selection`]). Numbers for sampling are passed in.

pub mod area;
pub mod beam;
pub mod directional;
pub mod environment;
pub mod point;
pub mod selection;
pub mod spot;

use crate::geometry::{Accel, DirectionalDensity, EndPoint, SurfacePoint};
use crate::spectrum::{Emission, SampledSpectrum, SampledWavelengths};
use glam::{DVec2, DVec3};

/// Index of a light in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LightId(pub u32);

/// What lights need to know of the scene.
#[derive(Clone, Copy, Debug)]
pub struct LightContext<'a> {
    /// The geometry (area lights sample and measure their instance through it).
    pub accel: &'a Accel,
    /// Centre of the scene's bounding sphere.
    pub center: DVec3,
    /// Radius `R_s` of the scene's bounding sphere.
    pub radius: f64,
    /// Moment as a fraction of the shutter.
    pub time: f64,
}

/// The start of a light sub-path with its first direction.
#[derive(Clone, Copy, Debug)]
pub struct EmissionSample {
    /// x₀.
    pub x0: EndPoint,
    /// A point the first ray starts from (x₀ itself, or on the far disc for lights at infinity).
    pub origin: DVec3,
    /// Unit direction in which light leaves.
    pub direction: DVec3,
    /// Density of x₀: per area; discrete (1) for delta positions and directional/beam lights; per solid angle of its
    /// direction for the environment. Without the selection probability.
    pub pdf_x0: f64,
    /// Density of the direction (or of the parallel ray), which gives the area density of x₁.
    pub pdf_direction: DirectionalDensity,
    /// Throughput after the first direction: emitted basic radiance × η² cosθ₀ / (pdf_x0 · pdf_direction), i.e.
    /// `L_e cosθ₀/(..)`, `I/p_ω`, `E_⊥ π R_s²`, ... : the index cancels.
    pub weight: SampledSpectrum,
}

/// A direct connection (s = 1) from a scattering point to a light.
#[derive(Clone, Copy, Debug)]
pub struct DirectSample {
    /// x₀.
    pub x0: EndPoint,
    /// Unit direction from x₁ towards the light.
    pub toward: DVec3,
    /// Distance to x₀; infinite for lights at infinity.
    pub distance: f64,
    /// Density of x₀ under this sampling (measure of `EmissionSample::pdf_x0`), without the selection probability.
    pub pdf: f64,
    /// `L_e cosθ₀/(d² pdf)` (area), `I/d²` (point, spot), `E_⊥` (directional, beam), `L/pdf` (environment): everything of the
    /// connection but |cosθ₁|, the kernel at x₁, the selection probability, visibility and absorption.
    pub value: SampledSpectrum,
}

/// The measure in which x₀ has its density, which says how a camera path's density of hitting it is expressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HitMeasure {
    /// Per area: the light can be hit.
    Area,
    /// Per solid angle at x₁: the environment.
    SolidAngle,
    /// Cannot be hit.
    Never,
}

/// A light source.
#[derive(Clone, Debug)]
pub enum Light {
    /// An emitting instance of any shape.
    Area(area::AreaLight),
    /// Isotropic point.
    Point(point::PointLight),
    /// Point with a cone.
    Spot(spot::SpotLight),
    /// Parallel light over the whole scene.
    Directional(directional::DirectionalLight),
    /// Parallel light of finite aperture.
    Beam(beam::BeamLight),
    /// The same radiance from everywhere.
    Environment(environment::EnvironmentLight),
}

#[allow(unused_variables)]
impl Light {
    /// The emission spectrum.
    #[must_use]
    pub fn emission(&self) -> &Emission {
        todo!()
    }

    /// Emitted power weighted by visibility (any common unit): for choosing lights.
    #[must_use]
    pub fn power(&self, context: &LightContext) -> f64 {
        todo!()
    }

    /// Starts a light sub-path. `u_face` picks a face or triangle, `u_pos` the position, `u_dir` the direction. `None` where
    /// nothing leaves (zero density).
    #[must_use]
    pub fn sample_emission(
        &self,
        context: &LightContext,
        wavelengths: &SampledWavelengths,
        u_face: f64,
        u_pos: DVec2,
        u_dir: DVec2,
    ) -> Option<EmissionSample> {
        todo!()
    }

    /// Density of `x0` (as `EmissionSample::pdf_x0`) and of leaving it in `direction` (unit, away from the light).
    #[must_use]
    pub fn emission_density(&self, context: &LightContext, x0: &EndPoint, direction: DVec3) -> (f64, DirectionalDensity) {
        todo!()
    }

    /// Connects `x1` to the light. `None` where no light can arrive (behind, outside the cone or the aperture).
    #[must_use]
    pub fn sample_direct(
        &self,
        context: &LightContext,
        wavelengths: &SampledWavelengths,
        x1: DVec3,
        u_face: f64,
        u: DVec2,
    ) -> Option<DirectSample> {
        todo!()
    }

    /// Density with which `sample_direct` from `x1` generates `x0`. 0 where `sample_direct` would give `None`.
    #[must_use]
    pub fn direct_density(&self, context: &LightContext, x1: DVec3, x0: &EndPoint) -> f64 {
        todo!()
    }

    /// Whether and how a camera path can hit the light.
    #[must_use]
    pub fn hit_measure(&self) -> HitMeasure {
        todo!()
    }

    /// Emitted radiance of an area light from `point` in unit `direction` (away from the light): 0 on a dark side.
    #[must_use]
    pub fn radiance(&self, point: &SurfacePoint, direction: DVec3, wavelengths: &SampledWavelengths) -> SampledSpectrum {
        todo!()
    }

    /// Radiance that arrives from infinity along a ray that travels in unit `direction` (away from the eye). 0 unless an
    /// environment.
    #[must_use]
    pub fn escaped_radiance(&self, direction: DVec3, wavelengths: &SampledWavelengths) -> SampledSpectrum {
        todo!()
    }

    /// Whether only light paths can find its light at all (no s = 0; delta).
    #[must_use]
    pub fn is_delta(&self) -> bool {
        self.hit_measure() == HitMeasure::Never
    }
}
