//! Parallel light over the whole scene, as from the sun.
//!
//! Emission starts on a disc of the bounding sphere's radius, outside the scene and normal to the light.

use super::{
    DirectSample, EmissionSample, LightContext, factor, far_disk_origin, placed_axis, posed,
};
use crate::geometry::{DirectionalDensity, EndPoint, Transform};
use crate::spectrum::Emission;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// A light at infinity that travels along the +z axis of its own space.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionalLight {
    /// Its orientation (a rigid motion; the position does not matter).
    pub transform: Transform,
    /// Irradiance on a surface that faces the light, W/(m² nm) and W/m² per line.
    pub irradiance: Emission,
}

impl DirectionalLight {
    /// Light at rest that travels along `direction` (any non-zero length).
    #[must_use]
    pub fn along(direction: DVec3, irradiance: Emission) -> Self {
        Self {
            transform: posed(DVec3::ZERO, direction),
            irradiance,
        }
    }

    fn end(&self, time: f64) -> EndPoint {
        EndPoint::toward_infinity(placed_axis(&self.transform, time))
    }

    /// Flux through the scene's bounding sphere per unit irradiance.
    pub(super) fn flux_factor(context: &LightContext) -> f64 {
        PI * context.radius * context.radius
    }

    pub(super) fn sample_emission(
        &self,
        context: &LightContext,
        u_pos: DVec2,
    ) -> Option<EmissionSample> {
        let x0 = self.end(context.time);
        let area = Self::flux_factor(context);
        (area > 0.0).then(|| EmissionSample {
            x0,
            origin: far_disk_origin(context, x0.n, u_pos),
            direction: x0.n,
            pdf_x0: 1.0,
            pdf_direction: DirectionalDensity::Perpendicular(1.0 / area),
            weight: factor(area),
        })
    }

    pub(super) fn sample_direct(&self, time: f64) -> DirectSample {
        let x0 = self.end(time);
        DirectSample {
            x0,
            toward: -x0.n,
            distance: f64::INFINITY,
            pdf: 1.0,
            value: factor(1.0),
        }
    }
}
