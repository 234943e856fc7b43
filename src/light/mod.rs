//! Light sources: where sub-paths of light begin and where camera paths may end.
//!
//! Values are in basic radiance units as `transport` needs them; the probability of choosing a
//! light is not in here (see [`selection`]). Numbers for sampling are passed in. Lights with a
//! direction shine along the +z axis of their own space, the side to which flat shapes emit and
//! detectors receive.
//!
//! The modules of the kinds describe geometry alone, for unit emission; [`Light`] multiplies by the
//! spectrum. Densities and values follow Veach 1997, chapters 8 and 10.

pub mod area;
pub mod beam;
pub mod casters;
pub mod directional;
mod emission;
pub mod environment;
pub mod environment_image;
pub mod point;
pub mod selection;
pub mod spot;

use crate::geometry::{
    AccelAt, DirectionalDensity, EndPoint, Link, Placement, Shutter, SurfacePoint, Transform,
};
use crate::math::{frame::Frame, sampling};
use crate::spectrum::{Emission, SampledSpectrum, SampledWavelengths};
use crate::texture::Image;
use area::AreaLight;
use beam::{BeamLight, BeamProfile};
use directional::DirectionalLight;
use environment::EnvironmentLight;
use environment_image::EnvironmentImage;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use point::PointLight;
use spot::SpotLight;
use std::borrow::Cow;
use std::sync::Arc;

/// Index of a light in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LightId(pub u32);

/// The start of a light sub-path with its first direction.
#[derive(Clone, Copy, Debug)]
pub struct EmissionSample {
    /// x₀.
    pub x0: EndPoint,
    /// A point the first ray starts from (x₀ itself, or on the far disc for lights at infinity).
    pub origin: DVec3,
    /// Unit direction in which light leaves.
    pub direction: DVec3,
    /// Density of x₀: per area; discrete (1) for delta positions and directional/beam lights; per
    /// solid angle of its direction for the environment. Without the selection probability.
    pub pdf_x0: f64,
    /// Density of the direction (or of the parallel ray), which gives the area density of x₁.
    pub pdf_direction: DirectionalDensity,
    /// Throughput after the first direction: emitted basic radiance × η² cosθ₀ / (pdf_x0 ·
    /// pdf_direction), i.e. `L_e cosθ₀/(..)`, `I/p_ω`, `E_⊥ π R_s²`, ... : the index cancels.
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
    /// Density of x₀ under this sampling (measure of `EmissionSample::pdf_x0`), without the
    /// selection probability.
    pub pdf: f64,
    /// `L_e cosθ₀/(d² pdf)` (area), `I/d²` (point, spot), `E_⊥` (directional, beam), `L/pdf`
    /// (environment): everything of the connection but |cosθ₁|, the kernel at x₁, the selection
    /// probability, visibility and absorption.
    pub value: SampledSpectrum,
}

/// The measure in which x₀ has its density, which says how a camera path's density of hitting it is
/// expressed.
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
pub struct Light {
    /// Spectrum of the emission, in the unit of its kind.
    pub emission: Emission,
    /// Placement over the shutter; `None`: its own space is the world, or it is a surface, whose
    /// instance has it. An environment has one where something turns its image.
    pub transform: Option<Transform>,
    /// The way it emits.
    pub kind: LightKind,
}

/// The kinds of lights.
#[derive(Clone, Debug)]
pub enum LightKind {
    /// An emitting instance of any shape.
    Area(AreaLight),
    /// Isotropic point.
    Point(PointLight),
    /// Point with a cone.
    Spot(SpotLight),
    /// Parallel light over the whole scene.
    Directional(DirectionalLight),
    /// Parallel light of finite aperture.
    Beam(BeamLight),
    /// From everywhere: the same radiance, or that of an image.
    Environment(EnvironmentLight),
}

impl LightKind {
    /// Name in messages.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Area(_) => "area",
            Self::Point(_) => "point",
            Self::Spot(_) => "spot",
            Self::Directional(_) => "directional",
            Self::Beam(_) => "beam",
            Self::Environment(_) => "environment",
        }
    }
}

impl Light {
    /// The light of a surface that emits `radiance`.
    #[must_use]
    pub fn area(radiance: Emission, area: AreaLight) -> Self {
        Self {
            emission: radiance,
            transform: None,
            kind: LightKind::Area(area),
        }
    }

    /// A point at rest with `intensity` in all directions.
    #[must_use]
    pub fn point(position: DVec3, intensity: Emission) -> Self {
        Self {
            emission: intensity,
            transform: Some(Transform::fixed(DAffine3::from_translation(position))),
            kind: LightKind::Point(PointLight),
        }
    }

    /// A point at rest that shines along `direction` (any non-zero length) with `intensity` on the
    /// axis.
    #[must_use]
    pub fn spot(position: DVec3, direction: DVec3, intensity: Emission, cone: SpotLight) -> Self {
        Self {
            emission: intensity,
            transform: Some(posed(position, direction).into()),
            kind: LightKind::Spot(cone),
        }
    }

    /// Parallel light at rest that travels along `direction` (any non-zero length).
    #[must_use]
    pub fn directional(direction: DVec3, irradiance: Emission) -> Self {
        Self {
            emission: irradiance,
            transform: Some(posed(DVec3::ZERO, direction).into()),
            kind: LightKind::Directional(DirectionalLight),
        }
    }

    /// A beam at rest whose aperture of radius `radius_m` is centred on `position` and which
    /// travels along `direction` (any non-zero length).
    #[must_use]
    pub fn beam(position: DVec3, direction: DVec3, irradiance: Emission, radius_m: f64) -> Self {
        Self {
            emission: irradiance,
            transform: Some(posed(position, direction).into()),
            kind: LightKind::Beam(BeamLight {
                radius_m,
                profile: BeamProfile::Uniform,
            }),
        }
    }

    /// The same beam with an irradiance that falls to 1/e² at `waist_m` from the axis, where it is
    /// as given; any other light as it is.
    #[must_use]
    pub fn with_waist(self, waist_m: f64) -> Self {
        self.with_profile(BeamProfile::Gaussian { waist_m })
    }

    /// The same beam with another profile, made for its aperture; any other light as it is.
    #[must_use]
    pub fn with_profile(mut self, profile: BeamProfile) -> Self {
        if let LightKind::Beam(beam) = &mut self.kind {
            beam.profile = profile;
        }
        self
    }

    /// Flux per unit of the spectrum of a point, spot or beam: sr, or m²; `None` for other lights.
    #[must_use]
    pub fn own_flux_factor(&self) -> Option<f64> {
        match &self.kind {
            LightKind::Point(_) => Some(PointLight::FLUX_FACTOR),
            LightKind::Spot(light) => Some(light.flux_factor()),
            LightKind::Beam(light) => Some(light.flux_factor()),
            _ => None,
        }
    }

    /// An environment, the same from everywhere or with the factors of `image`.
    #[must_use]
    pub fn environment(radiance: Emission, image: Option<Arc<EnvironmentImage>>) -> Self {
        Self {
            emission: radiance,
            transform: None,
            kind: LightKind::Environment(EnvironmentLight { image }),
        }
    }

    /// The surface that emits, if it is one.
    #[must_use]
    pub fn as_area(&self) -> Option<&AreaLight> {
        match &self.kind {
            LightKind::Area(light) => Some(light),
            _ => None,
        }
    }

    /// The environment, if it is one.
    #[must_use]
    pub fn as_environment(&self) -> Option<&EnvironmentLight> {
        match &self.kind {
            LightKind::Environment(light) => Some(light),
            _ => None,
        }
    }

    /// The same light inside a hierarchy of moving `parents` (the outermost first; without scale)
    /// over `shutter`.
    #[must_use]
    pub fn under(mut self, parents: &[Link], shutter: Shutter) -> Self {
        let is_fixed = match &self.kind {
            LightKind::Area(_) => true,
            // without an image it is the same however it turns
            LightKind::Environment(light) => light.image.is_none(),
            _ => false,
        };
        if !is_fixed {
            let rest = || Transform::fixed(DAffine3::IDENTITY);
            let transform = self.transform.take().unwrap_or_else(rest);
            self.transform = Some(transform.under(parents, shutter));
        }
        self
    }

    /// Whether it moves while the shutter is open, other than with its surface.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.transform.as_ref().is_some_and(Transform::is_moving)
    }

    /// Placement at the moment of `geometry`, where the light has one.
    fn turn<'a>(&'a self, geometry: &AccelAt<'a>) -> Option<Cow<'a, Placement>> {
        let transform = self.transform.as_ref()?;
        Some(transform.at(geometry.moment()))
    }

    /// Placement at the moment of `geometry`; a light without one rests in the world.
    #[must_use]
    pub fn placement<'a>(&'a self, geometry: &AccelAt<'a>) -> Cow<'a, Placement> {
        let rest = || Cow::Borrowed(&Placement::IDENTITY);
        self.turn(geometry).unwrap_or_else(rest)
    }

    /// Whether it is infinitely far away.
    #[must_use]
    pub fn is_infinite(&self) -> bool {
        matches!(
            self.kind,
            LightKind::Directional(_) | LightKind::Environment(_)
        )
    }

    /// Flux per unit emission that can reach the scene.
    #[must_use]
    pub fn flux_factor(&self, geometry: &AccelAt) -> f64 {
        match &self.kind {
            LightKind::Area(light) => light.flux_factor(geometry),
            LightKind::Point(_) => PointLight::FLUX_FACTOR,
            LightKind::Spot(light) => light.flux_factor(),
            LightKind::Directional(_) => DirectionalLight::flux_factor(geometry),
            LightKind::Beam(light) => light.flux_factor(),
            LightKind::Environment(light) => light.flux_factor(geometry),
        }
    }

    /// Roughly the angular radius in radians under which the light is seen from `p`; 0 for lights
    /// without extent and for the environment.
    #[must_use]
    pub fn angular_radius(&self, geometry: &AccelAt, p: DVec3) -> f64 {
        let Some(light) = self.as_area() else {
            return 0.0;
        };
        let instance = geometry.accel().instance(light.instance);
        let center = light.sample(geometry, 0.5, DVec2::splat(0.5)).point.p;
        let radius = (instance.area(geometry.moment()) / std::f64::consts::PI).sqrt();
        radius.atan2(center.distance(p))
    }

    /// The factor on the emission at x₀, where it varies over the light.
    #[inline]
    fn pattern_at(
        &self,
        geometry: &AccelAt,
        x0: &EndPoint,
        wavelengths: &SampledWavelengths,
    ) -> Option<SampledSpectrum> {
        match &self.kind {
            LightKind::Area(light) => {
                let (pattern, face) = (light.pattern.as_ref()?, x0.surface?);
                let uv = geometry.texture_coordinates(face, x0.p);
                Some(pattern.sample(uv, wavelengths))
            }
            LightKind::Environment(light) => {
                light.factor(self.turn(geometry).as_deref(), x0.n, wavelengths)
            }
            _ => None,
        }
    }

    /// Whether the radiance of an area light depends on the texture coordinates of the point.
    #[must_use]
    pub fn has_pattern(&self) -> bool {
        self.as_area().is_some_and(|light| light.pattern.is_some())
    }

    /// Appends the images behind it.
    pub fn append_images(&self, out: &mut Vec<Arc<Image>>) {
        match &self.kind {
            LightKind::Area(light) => {
                if let Some(pattern) = &light.pattern {
                    pattern.append_images(out);
                }
            }
            LightKind::Environment(light) => {
                out.extend(light.image.iter().map(|i| i.image().clone()));
            }
            _ => {}
        }
    }

    /// Connects `x1` to the light. `None` where no light can arrive (behind, outside the cone or
    /// the aperture).
    #[must_use]
    #[inline]
    pub fn sample_direct(
        &self,
        geometry: &AccelAt,
        wavelengths: &SampledWavelengths,
        x1: DVec3,
        u_face: f64,
        u: DVec2,
    ) -> Option<DirectSample> {
        // before the rest is there, which then need not wait in memory
        let emission = self.emission.sample(wavelengths);
        let mut sample = self.connect(geometry, x1, u_face, u)?;
        sample.value *= emission;
        if let Some(pattern) = self.pattern_at(geometry, &sample.x0, wavelengths) {
            sample.value *= pattern;
        }
        Some(sample)
    }

    /// `sample_direct` for unit emission.
    #[inline]
    fn connect(
        &self,
        geometry: &AccelAt,
        x1: DVec3,
        u_face: f64,
        u: DVec2,
    ) -> Option<DirectSample> {
        let place = self.placement(geometry);
        match &self.kind {
            LightKind::Area(light) => light.sample_direct(geometry, x1, u_face, u),
            LightKind::Point(_) => PointLight::sample_direct(&place, x1),
            LightKind::Spot(light) => light.sample_direct(&place, x1),
            LightKind::Directional(_) => Some(DirectionalLight::sample_direct(&place)),
            LightKind::Beam(light) => light.sample_direct(&place, x1),
            LightKind::Environment(light) => {
                light.sample_direct(self.turn(geometry).as_deref(), u_face, u)
            }
        }
    }

    /// Density with which `sample_direct` from `x1` generates `x0`. 0 where `sample_direct` would
    /// give `None`.
    #[must_use]
    pub fn direct_density(&self, geometry: &AccelAt, x1: DVec3, x0: &EndPoint) -> f64 {
        match &self.kind {
            LightKind::Area(light) => light.direct_density(geometry, x1, x0),
            LightKind::Environment(light) => {
                light.direction_pdf(self.turn(geometry).as_deref(), x0.n)
            }
            // the end point is the only one there is
            _ => self
                .connect(geometry, x1, 0.0, DVec2::ZERO)
                .map_or(0.0, |sample| sample.pdf),
        }
    }

    /// Whether and how a camera path can hit the light.
    #[must_use]
    pub fn hit_measure(&self) -> HitMeasure {
        match &self.kind {
            LightKind::Area(_) => HitMeasure::Area,
            LightKind::Environment(_) => HitMeasure::SolidAngle,
            LightKind::Point(_)
            | LightKind::Spot(_)
            | LightKind::Directional(_)
            | LightKind::Beam(_) => HitMeasure::Never,
        }
    }

    /// Emitted radiance of an area light from `point` in unit `direction` (away from the light): 0
    /// on a dark side.
    #[must_use]
    pub fn radiance(
        &self,
        point: &SurfacePoint,
        direction: DVec3,
        wavelengths: &SampledWavelengths,
    ) -> SampledSpectrum {
        match &self.kind {
            LightKind::Area(light) if light.emitting_cos(point.ng, direction) > 0.0 => {
                let radiance = self.emission.sample(wavelengths);
                match &light.pattern {
                    None => radiance,
                    Some(pattern) => radiance * pattern.sample(point.uv, wavelengths),
                }
            }
            _ => SampledSpectrum::ZERO,
        }
    }

    /// Radiance that arrives from infinity along a ray that travels in unit `direction` (away from
    /// the eye). 0 unless an environment.
    #[must_use]
    pub fn escaped_radiance(
        &self,
        geometry: &AccelAt,
        direction: DVec3,
        wavelengths: &SampledWavelengths,
    ) -> SampledSpectrum {
        match &self.kind {
            LightKind::Environment(light) => {
                let radiance = self.emission.sample(wavelengths);
                match light.factor(self.turn(geometry).as_deref(), -direction, wavelengths) {
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

/// Unit direction and distance; `None` where the points coincide.
fn unit_from_to(from: DVec3, to: DVec3) -> Option<(DVec3, f64)> {
    let distance = from.distance(to);
    (distance > 0.0).then(|| ((to - from) * (1.0 / distance), distance))
}

/// The rigid motion that takes the origin to `position` and +z to `direction`.
fn posed(position: DVec3, direction: DVec3) -> Placement {
    let frame = Frame::from_z(direction.normalize());
    let rotation = DMat3::from_cols(frame.x, frame.y, frame.z);
    Placement::new(DAffine3::from_mat3_translation(rotation, position))
}

/// The +z axis of a placed light as a unit vector.
fn placed_axis(place: &Placement) -> DVec3 {
    place.to_world.matrix3.z_axis.normalize()
}

/// A point of the disc of the bounding sphere's radius, one radius before the centre, normal to
/// `direction`.
fn far_disk_origin(geometry: &AccelAt, direction: DVec3, u: DVec2) -> DVec3 {
    let disk = sampling::disk(u.into()).extend(-1.0);
    geometry.accel().center() + geometry.accel().radius() * Frame::from_z(direction).to_outer(disk)
}

#[cfg(test)]
mod tests;
