//! The same radiance from every direction.
//!
//! x₀ is a direction, measured in solid angle in every strategy. Emission draws the direction evenly, then a point of
//! the disc of the bounding sphere's radius, outside the scene and normal to it.

use super::{DirectSample, EmissionSample, LightContext, factor, far_disk_origin};
use crate::geometry::{DirectionalDensity, EndPoint};
use crate::math::sampling;
use crate::spectrum::Emission;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// A uniform environment.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentLight {
    /// Radiance, W/(m² sr nm) and W/(m² sr) per line.
    pub radiance: Emission,
}

impl EnvironmentLight {
    /// Density per solid angle of the direction, for emission and connection alike.
    pub(super) const DIRECTION_PDF: f64 = sampling::UNIFORM_SPHERE_PDF;

    /// Density per area normal to the direction.
    pub(super) fn disk_density(context: &LightContext) -> DirectionalDensity {
        DirectionalDensity::Perpendicular(1.0 / (PI * context.radius * context.radius))
    }

    /// Flux into the scene's bounding sphere per unit radiance.
    pub(super) fn flux_factor(context: &LightContext) -> f64 {
        PI * context.radius * context.radius / Self::DIRECTION_PDF
    }

    pub(super) fn sample_emission(
        context: &LightContext,
        u_pos: DVec2,
        u_dir: DVec2,
    ) -> Option<EmissionSample> {
        let direction = sampling::uniform_sphere(u_dir.into());
        (context.radius > 0.0).then(|| EmissionSample {
            x0: end(direction),
            origin: far_disk_origin(context, direction, u_pos),
            direction,
            pdf_x0: Self::DIRECTION_PDF,
            pdf_direction: Self::disk_density(context),
            weight: factor(Self::flux_factor(context)),
        })
    }

    pub(super) fn sample_direct(u: DVec2) -> DirectSample {
        let toward = sampling::uniform_sphere(u.into());
        DirectSample {
            x0: end(-toward),
            toward,
            distance: f64::INFINITY,
            pdf: Self::DIRECTION_PDF,
            value: factor(1.0 / Self::DIRECTION_PDF),
        }
    }
}

fn end(direction: DVec3) -> EndPoint {
    EndPoint {
        p: DVec3::ZERO,
        n: direction,
        surface: None,
        infinite: true,
    }
}
