//! Light from every direction: the same radiance everywhere, or that of an image.
//!
//! x₀ is a direction, measured in solid angle in every strategy. Emission draws the direction (evenly, or by the image),
//! then a point of the disc of the bounding sphere's radius, outside the scene and normal to it.

use super::environment_image::EnvironmentImage;
use super::{DirectSample, EmissionSample, LightContext, factor, far_disk_origin};
use crate::geometry::{DirectionalDensity, EndPoint, Transform};
use crate::math::sampling;
use crate::spectrum::{Emission, SampledSpectrum, SampledWavelengths};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// An environment.
#[derive(Clone, Debug)]
pub struct EnvironmentLight {
    /// Radiance, W/(m² sr nm) and W/(m² sr) per line.
    pub radiance: Emission,
    /// Factor on the radiance by direction; `None`: 1.
    pub image: Option<Arc<EnvironmentImage>>,
    /// What turns the image over the shutter, beyond its own place; `None`: nothing. Only the rotation matters.
    pub motion: Option<Box<Transform>>,
}

impl EnvironmentLight {
    /// The same radiance from everywhere.
    #[must_use]
    pub fn uniform(radiance: Emission) -> Self {
        Self {
            radiance,
            image: None,
            motion: None,
        }
    }

    /// A direction in the world as one around the image at rest.
    fn at_rest(&self, direction: DVec3, time: f64) -> DVec3 {
        match &self.motion {
            None => direction,
            Some(motion) => motion.at(time).to_object.transform_vector3(direction),
        }
    }

    /// A direction around the image at rest as one in the world.
    fn in_world(&self, direction: DVec3, time: f64) -> DVec3 {
        match &self.motion {
            None => direction,
            Some(motion) => motion.at(time).to_world.transform_vector3(direction),
        }
    }

    /// Factor on the radiance for light that travels along `direction`; `None`: 1.
    pub(super) fn factor(
        &self,
        direction: DVec3,
        time: f64,
        wavelengths: &SampledWavelengths,
    ) -> Option<SampledSpectrum> {
        let image = self.image.as_ref()?;
        Some(image.factor(self.at_rest(direction, time), wavelengths))
    }

    /// Density per solid angle of the direction in which the light travels, for emission and connection alike.
    pub(super) fn direction_pdf(&self, direction: DVec3, time: f64) -> f64 {
        self.image
            .as_ref()
            .map_or(sampling::UNIFORM_SPHERE_PDF, |image| {
                image.pdf(self.at_rest(direction, time))
            })
    }

    /// A direction in which light travels, and its density.
    fn sample_direction(&self, u_texel: f64, u: DVec2, time: f64) -> (DVec3, f64) {
        match &self.image {
            None => (
                sampling::uniform_sphere(u.into()),
                sampling::UNIFORM_SPHERE_PDF,
            ),
            Some(image) => {
                let (direction, pdf) = image.sample(u_texel, u);
                (self.in_world(direction, time), pdf)
            }
        }
    }

    /// Density per area normal to the direction.
    pub(super) fn disk_density(context: &LightContext) -> DirectionalDensity {
        DirectionalDensity::Perpendicular(1.0 / (PI * context.radius * context.radius))
    }

    /// Flux into the scene's bounding sphere per unit radiance.
    pub(super) fn flux_factor(&self, context: &LightContext) -> f64 {
        let mean = self.image.as_ref().map_or(1.0, |image| image.mean());
        PI * context.radius * context.radius / sampling::UNIFORM_SPHERE_PDF * mean
    }

    pub(super) fn sample_emission(
        &self,
        context: &LightContext,
        u_texel: f64,
        u_pos: DVec2,
        u_dir: DVec2,
    ) -> Option<EmissionSample> {
        let (direction, pdf) = self.sample_direction(u_texel, u_dir, context.time);
        (context.radius > 0.0 && pdf > 0.0).then(|| EmissionSample {
            x0: EndPoint::toward_infinity(direction),
            origin: far_disk_origin(context, direction, u_pos),
            direction,
            pdf_x0: pdf,
            pdf_direction: Self::disk_density(context),
            weight: factor(PI * context.radius * context.radius / pdf),
        })
    }

    pub(super) fn sample_direct(&self, u_texel: f64, u: DVec2, time: f64) -> Option<DirectSample> {
        let (toward, pdf) = match &self.image {
            None => (
                sampling::uniform_sphere(u.into()),
                sampling::UNIFORM_SPHERE_PDF,
            ),
            Some(image) => {
                let (direction, pdf) = image.sample(u_texel, u);
                (-self.in_world(direction, time), pdf)
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
