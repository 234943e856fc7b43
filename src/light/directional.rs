//! Parallel light over the whole scene, as from the sun.
//!
//! Emission starts on a disc of the bounding sphere's radius, outside the scene and normal to the
//! light.

use super::{DirectSample, EmissionSample, factor, far_disk_origin, placed_axis};
use crate::geometry::{AccelAt, DirectionalDensity, EndPoint, Placement};
use glam::DVec2;
use std::f64::consts::PI;

/// Irradiance on a surface that faces a light at infinity, which travels along the +z axis of its
/// own space (the position does not matter): W/(m² nm), and W/m² per line.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionalLight;

impl DirectionalLight {
    fn end(place: &Placement) -> EndPoint {
        EndPoint::toward_infinity(placed_axis(place))
    }

    /// Flux through the scene's bounding sphere per unit irradiance.
    pub(super) fn flux_factor(geometry: &AccelAt) -> f64 {
        let radius = geometry.accel().radius();
        PI * radius * radius
    }

    pub(super) fn sample_emission(
        geometry: &AccelAt,
        place: &Placement,
        u_pos: DVec2,
    ) -> Option<EmissionSample> {
        let x0 = Self::end(place);
        let area = Self::flux_factor(geometry);
        (area > 0.0).then(|| EmissionSample {
            x0,
            origin: far_disk_origin(geometry, x0.n, u_pos),
            direction: x0.n,
            pdf_x0: 1.0,
            pdf_direction: DirectionalDensity::Perpendicular(1.0 / area),
            weight: factor(area),
        })
    }

    pub(super) fn sample_direct(place: &Placement) -> DirectSample {
        let x0 = Self::end(place);
        DirectSample {
            x0,
            toward: -x0.n,
            distance: f64::INFINITY,
            pdf: 1.0,
            value: factor(1.0),
        }
    }
}
