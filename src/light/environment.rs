//! Light from every direction: the same radiance everywhere, or that of an image.
//!
//! x₀ is a direction, measured in solid angle in every strategy. Emission draws the direction
//! (evenly, or by the image), then a point of the disc of the bounding sphere's radius, outside the
//! scene and normal to it.

use super::environment_image::EnvironmentImage;
use super::{DirectSample, EmissionSample, factor, far_disk_origin};
use crate::geometry::{AccelAt, DirectionalDensity, EndPoint, Placement};
use crate::math::sampling;
use crate::spectrum::{SampledSpectrum, SampledWavelengths};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// Radiance from every direction: W/(m² sr nm), and W/(m² sr) per line.
#[derive(Clone, Debug, Default)]
pub struct EnvironmentLight {
    /// Factor on the radiance by direction; `None`: 1.
    pub image: Option<Arc<EnvironmentImage>>,
}

/// Placement of a thing that turns the image beyond its own place; `None`: nothing does. Only the
/// rotation matters.
type Turn<'a> = Option<&'a Placement>;

impl EnvironmentLight {
    /// A direction in the world as one around the image at rest.
    fn at_rest(turn: Turn, direction: DVec3) -> DVec3 {
        turn.map_or(direction, |p| p.to_object.transform_vector3(direction))
    }

    /// A direction around the image at rest as one in the world.
    fn in_world(turn: Turn, direction: DVec3) -> DVec3 {
        turn.map_or(direction, |p| p.to_world.transform_vector3(direction))
    }

    /// Factor on the radiance for light that travels along `direction`; `None`: 1.
    pub(super) fn factor(
        &self,
        turn: Turn,
        direction: DVec3,
        wavelengths: &SampledWavelengths,
    ) -> Option<SampledSpectrum> {
        let image = self.image.as_ref()?;
        Some(image.factor(Self::at_rest(turn, direction), wavelengths))
    }

    /// Density per solid angle of the direction in which the light travels, for emission and
    /// connection alike.
    pub(super) fn direction_pdf(&self, turn: Turn, direction: DVec3) -> f64 {
        self.image
            .as_ref()
            .map_or(sampling::UNIFORM_SPHERE_PDF, |image| {
                image.pdf(Self::at_rest(turn, direction))
            })
    }

    /// A direction in which light travels, and its density.
    fn sample_direction(&self, turn: Turn, u_texel: f64, u: DVec2) -> (DVec3, f64) {
        match &self.image {
            None => (
                sampling::uniform_sphere(u.into()),
                sampling::UNIFORM_SPHERE_PDF,
            ),
            Some(image) => {
                let (direction, pdf) = image.sample(u_texel, u);
                (Self::in_world(turn, direction), pdf)
            }
        }
    }

    /// Density per area normal to the direction.
    pub(super) fn disk_density(geometry: &AccelAt) -> DirectionalDensity {
        DirectionalDensity::Perpendicular(
            1.0 / (PI * geometry.accel().radius() * geometry.accel().radius()),
        )
    }

    /// Flux into the scene's bounding sphere per unit radiance.
    pub(super) fn flux_factor(&self, geometry: &AccelAt) -> f64 {
        let mean = self.image.as_ref().map_or(1.0, |image| image.mean());
        PI * geometry.accel().radius() * geometry.accel().radius() / sampling::UNIFORM_SPHERE_PDF
            * mean
    }

    pub(super) fn sample_emission(
        &self,
        geometry: &AccelAt,
        turn: Turn,
        u_texel: f64,
        u_pos: DVec2,
        u_dir: DVec2,
    ) -> Option<EmissionSample> {
        let (direction, pdf) = self.sample_direction(turn, u_texel, u_dir);
        (geometry.accel().radius() > 0.0 && pdf > 0.0).then(|| EmissionSample {
            x0: EndPoint::toward_infinity(direction),
            origin: far_disk_origin(geometry, direction, u_pos),
            direction,
            pdf_x0: pdf,
            pdf_direction: Self::disk_density(geometry),
            weight: factor(PI * geometry.accel().radius() * geometry.accel().radius() / pdf),
        })
    }

    pub(super) fn sample_direct(&self, turn: Turn, u_texel: f64, u: DVec2) -> Option<DirectSample> {
        let (toward, pdf) = match &self.image {
            None => (
                sampling::uniform_sphere(u.into()),
                sampling::UNIFORM_SPHERE_PDF,
            ),
            Some(image) => {
                let (direction, pdf) = image.sample(u_texel, u);
                (-Self::in_world(turn, direction), pdf)
            }
        };
        (pdf > 0.0).then(|| DirectSample {
            x0: EndPoint::toward_infinity(-toward),
            toward,
            distance: f64::INFINITY,
            pdf,
            value: factor(1.0 / pdf),
        })
    }
}
