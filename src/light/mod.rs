//! Light sources: where sub-paths of light begin and where camera paths may end.
//!
//! Values are in basic radiance units as `transport` needs them; the probability of choosing a light is not in here (see
//! [`selection`]). Numbers for sampling are passed in. Lights with a direction shine along the +z axis of their own
//! space, the side to which flat shapes emit and detectors receive.
//!
//! The modules of the kinds describe geometry alone, for unit emission; [`Light`] multiplies by the spectrum.
//! Densities and values follow Veach 1997, chapters 8 and 10.

pub mod area;
pub mod beam;
pub mod directional;
pub mod environment;
pub mod environment_image;
pub mod point;
pub mod selection;
pub mod spot;

use crate::geometry::{
    Accel, DirectionalDensity, EndPoint, Link, Shutter, SurfacePoint, Transform,
};
use crate::math::{frame::Frame, sampling};
use crate::spectrum::{Emission, SampledSpectrum, SampledWavelengths};
use crate::texture::Image;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::sync::Arc;

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
    /// Moment in seconds.
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
    /// From everywhere: the same radiance, or that of an image.
    Environment(environment::EnvironmentLight),
}

impl Light {
    /// The emission spectrum.
    #[must_use]
    pub fn emission(&self) -> &Emission {
        match self {
            Self::Area(light) => &light.radiance,
            Self::Point(light) => &light.intensity,
            Self::Spot(light) => &light.intensity,
            Self::Directional(light) => &light.irradiance,
            Self::Beam(light) => &light.irradiance,
            Self::Environment(light) => &light.radiance,
        }
    }

    /// The same light with another emission spectrum.
    #[must_use]
    pub fn map_emission(mut self, f: impl FnOnce(Emission) -> Emission) -> Self {
        let emission = match &mut self {
            Self::Area(light) => &mut light.radiance,
            Self::Point(light) => &mut light.intensity,
            Self::Spot(light) => &mut light.intensity,
            Self::Directional(light) => &mut light.irradiance,
            Self::Beam(light) => &mut light.irradiance,
            Self::Environment(light) => &mut light.radiance,
        };
        *emission = f(std::mem::take(emission));
        self
    }

    /// Where a light that is not a surface is over the shutter; `None` for area lights (their instance has it) and for an
    /// environment that does not turn.
    #[must_use]
    pub fn transform(&self) -> Option<&Transform> {
        match self {
            Self::Area(_) => None,
            Self::Environment(light) => light.motion.as_deref(),
            Self::Point(light) => Some(&light.transform),
            Self::Spot(light) => Some(&light.transform),
            Self::Directional(light) => Some(&light.transform),
            Self::Beam(light) => Some(&light.transform),
        }
    }

    /// The same light inside a hierarchy of moving `parents` (the outermost first; without scale) over `shutter`.
    #[must_use]
    pub fn under(mut self, parents: &[Link], shutter: Shutter) -> Self {
        let transform = match &mut self {
            Self::Area(_) => return self,
            // without an image it is the same however it turns
            Self::Environment(light) if light.image.is_none() => return self,
            Self::Environment(light) => light
                .motion
                .get_or_insert_with(|| Box::new(Transform::fixed(DAffine3::IDENTITY))),
            Self::Point(light) => &mut light.transform,
            Self::Spot(light) => &mut light.transform,
            Self::Directional(light) => &mut light.transform,
            Self::Beam(light) => &mut light.transform,
        };
        *transform = transform.under(parents, shutter);
        self
    }

    /// Whether it is infinitely far away.
    #[must_use]
    pub fn is_infinite(&self) -> bool {
        matches!(self, Self::Directional(_) | Self::Environment(_))
    }

    /// Flux per unit emission that can reach the scene.
    #[must_use]
    pub fn flux_factor(&self, context: &LightContext) -> f64 {
        match self {
            Self::Area(light) => light.flux_factor(context),
            Self::Point(_) => point::PointLight::FLUX_FACTOR,
            Self::Spot(light) => light.flux_factor(),
            Self::Directional(_) => directional::DirectionalLight::flux_factor(context),
            Self::Beam(light) => light.area(),
            Self::Environment(light) => light.flux_factor(context),
        }
    }

    /// Roughly the angular radius in radians under which the light is seen from `p`; 0 for lights without extent and for the
    /// environment.
    #[must_use]
    pub fn angular_radius(&self, context: &LightContext, p: DVec3) -> f64 {
        let Self::Area(light) = self else { return 0.0 };
        let instance = &context.accel.instances()[light.instance.0 as usize];
        let center = instance
            .sample_area(light.instance, context.time, 0.5, DVec2::splat(0.5))
            .point
            .p;
        let radius = (instance.area(context.time) / std::f64::consts::PI).sqrt();
        radius.atan2(center.distance(p))
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
        let mut sample = self.start(context, u_face, u_pos, u_dir)?;
        sample.weight *= self.emission().sample(wavelengths);
        if let Some(pattern) = self.pattern_at(context, &sample.x0, wavelengths) {
            sample.weight *= pattern;
        }
        Some(sample)
    }

    /// The factor on the emission at x₀, where it varies over the light.
    fn pattern_at(
        &self,
        context: &LightContext,
        x0: &EndPoint,
        wavelengths: &SampledWavelengths,
    ) -> Option<SampledSpectrum> {
        match self {
            Self::Area(light) => {
                let (pattern, face) = (light.pattern.as_ref()?, x0.surface?);
                let uv = context.accel.texture_coordinates(face, x0.p, context.time);
                Some(pattern.sample(uv, wavelengths))
            }
            Self::Environment(light) => light.factor(x0.n, context.time, wavelengths),
            _ => None,
        }
    }

    /// Whether the radiance of an area light depends on the texture coordinates of the point.
    #[must_use]
    pub fn has_pattern(&self) -> bool {
        matches!(self, Self::Area(light) if light.pattern.is_some())
    }

    /// Appends the images behind it.
    pub fn append_images(&self, out: &mut Vec<Arc<Image>>) {
        match self {
            Self::Area(light) => {
                if let Some(pattern) = &light.pattern {
                    pattern.append_images(out);
                }
            }
            Self::Environment(light) => {
                out.extend(light.image.iter().map(|i| i.image().clone()));
            }
            _ => {}
        }
    }

    /// `sample_emission` for unit emission.
    fn start(
        &self,
        context: &LightContext,
        u_face: f64,
        u_pos: DVec2,
        u_dir: DVec2,
    ) -> Option<EmissionSample> {
        match self {
            Self::Area(light) => light.sample_emission(context, u_face, u_pos, u_dir),
            Self::Point(light) => Some(light.sample_emission(context.time, u_dir)),
            Self::Spot(light) => light.sample_emission(context.time, u_dir),
            Self::Directional(light) => light.sample_emission(context, u_pos),
            Self::Beam(light) => Some(light.sample_emission(context.time, u_pos)),
            Self::Environment(light) => light.sample_emission(context, u_face, u_pos, u_dir),
        }
    }

    /// Density of `x0` (as `EmissionSample::pdf_x0`) and of leaving it in `direction` (unit, away from the light).
    #[must_use]
    pub fn emission_density(
        &self,
        context: &LightContext,
        x0: &EndPoint,
        direction: DVec3,
    ) -> (f64, DirectionalDensity) {
        use DirectionalDensity::{Perpendicular, SolidAngle};
        match self {
            Self::Area(light) => light.emission_density(context, x0, direction),
            Self::Point(_) => (1.0, SolidAngle(point::PointLight::DIRECTION_PDF)),
            Self::Spot(light) => (
                1.0,
                SolidAngle(light.direction_density(context.time, direction)),
            ),
            Self::Directional(_) => (
                1.0,
                Perpendicular(1.0 / directional::DirectionalLight::flux_factor(context)),
            ),
            Self::Beam(light) => (1.0, light.density()),
            Self::Environment(light) => (
                light.direction_pdf(direction, context.time),
                environment::EnvironmentLight::disk_density(context),
            ),
        }
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
        let mut sample = self.connect(context, x1, u_face, u)?;
        sample.value *= self.emission().sample(wavelengths);
        if let Some(pattern) = self.pattern_at(context, &sample.x0, wavelengths) {
            sample.value *= pattern;
        }
        Some(sample)
    }

    /// `sample_direct` for unit emission.
    fn connect(
        &self,
        context: &LightContext,
        x1: DVec3,
        u_face: f64,
        u: DVec2,
    ) -> Option<DirectSample> {
        match self {
            Self::Area(light) => light.sample_direct(context, x1, u_face, u),
            Self::Point(light) => light.sample_direct(context.time, x1),
            Self::Spot(light) => light.sample_direct(context.time, x1),
            Self::Directional(light) => Some(light.sample_direct(context.time)),
            Self::Beam(light) => light.sample_direct(context.time, x1),
            Self::Environment(light) => light.sample_direct(u_face, u, context.time),
        }
    }

    /// Density with which `sample_direct` from `x1` generates `x0`. 0 where `sample_direct` would give `None`.
    #[must_use]
    pub fn direct_density(&self, context: &LightContext, x1: DVec3, x0: &EndPoint) -> f64 {
        match self {
            Self::Area(light) => light.direct_density(context, x1, x0),
            Self::Environment(light) => light.direction_pdf(x0.n, context.time),
            // the end point is the only one there is
            _ => self
                .connect(context, x1, 0.0, DVec2::ZERO)
                .map_or(0.0, |sample| sample.pdf),
        }
    }

    /// Whether and how a camera path can hit the light.
    #[must_use]
    pub fn hit_measure(&self) -> HitMeasure {
        match self {
            Self::Area(_) => HitMeasure::Area,
            Self::Environment(_) => HitMeasure::SolidAngle,
            Self::Point(_) | Self::Spot(_) | Self::Directional(_) | Self::Beam(_) => {
                HitMeasure::Never
            }
        }
    }

    /// Emitted radiance of an area light from `point` in unit `direction` (away from the light): 0 on a dark side.
    #[must_use]
    pub fn radiance(
        &self,
        point: &SurfacePoint,
        direction: DVec3,
        wavelengths: &SampledWavelengths,
    ) -> SampledSpectrum {
        match self {
            Self::Area(light) if light.emitting_cos(point.ng, direction) > 0.0 => {
                let radiance = light.radiance.sample(wavelengths);
                match &light.pattern {
                    None => radiance,
                    Some(pattern) => radiance * pattern.sample(point.uv, wavelengths),
                }
            }
            _ => SampledSpectrum::ZERO,
        }
    }

    /// Radiance that arrives from infinity at `time` along a ray that travels in unit `direction` (away from the eye). 0
    /// unless an environment.
    #[must_use]
    pub fn escaped_radiance(
        &self,
        direction: DVec3,
        time: f64,
        wavelengths: &SampledWavelengths,
    ) -> SampledSpectrum {
        match self {
            Self::Environment(light) => {
                let radiance = light.radiance.sample(wavelengths);
                match light.factor(-direction, time, wavelengths) {
                    None => radiance,
                    Some(factor) => radiance * factor,
                }
            }
            _ => SampledSpectrum::ZERO,
        }
    }

    /// Whether only light paths can find its light at all (no s = 0; delta).
    #[must_use]
    pub fn is_delta(&self) -> bool {
        self.hit_measure() == HitMeasure::Never
    }
}

/// The same number in every lane: a weight or value for unit emission.
fn factor(value: f64) -> SampledSpectrum {
    SampledSpectrum::splat(value as f32)
}

/// A point without extent.
fn point_end(p: DVec3) -> EndPoint {
    EndPoint {
        p,
        n: DVec3::ZERO,
        surface: None,
        infinite: false,
    }
}

/// Unit direction and distance; `None` where the points coincide.
fn unit_from_to(from: DVec3, to: DVec3) -> Option<(DVec3, f64)> {
    let distance = from.distance(to);
    (distance > 0.0).then(|| ((to - from) / distance, distance))
}

/// The rigid motion that takes the origin to `position` and +z to `direction`.
fn posed(position: DVec3, direction: DVec3) -> Transform {
    let frame = Frame::from_z(direction.normalize());
    let rotation = DMat3::from_cols(frame.x, frame.y, frame.z);
    Transform::fixed(DAffine3::from_mat3_translation(rotation, position))
}

/// The +z axis of a placed light as a unit vector.
fn placed_axis(transform: &Transform, time: f64) -> DVec3 {
    transform.at(time).to_world.matrix3.z_axis.normalize()
}

/// A point of the disc of the bounding sphere's radius, one radius before the centre, normal to `direction`.
fn far_disk_origin(context: &LightContext, direction: DVec3, u: DVec2) -> DVec3 {
    let disk = sampling::disk(u.into()).extend(-1.0);
    context.center + context.radius * Frame::from_z(direction).to_outer(disk)
}

#[cfg(test)]
mod tests;
