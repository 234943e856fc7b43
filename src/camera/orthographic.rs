//! Parallel projection.
//!
//! The camera looks along the -z axis of its own space, +x to the right and +y up. Rays leave a
//! film of real size in the plane z = 0; things behind it are not seen.

use super::{CameraSample, Resolution, SensorConnection};
use crate::geometry::{DirectionalDensity, EndPoint, Placement};
use glam::{DVec2, DVec3};

/// Parallel projection onto a film of real size.
#[derive(Clone, Debug, PartialEq)]
pub struct Orthographic {
    /// Half width and half height of the film in meters.
    half_film_m: DVec2,
}

impl Orthographic {
    pub(super) fn new(resolution: Resolution, width_m: f64) -> Self {
        let half_film_m = 0.5 * DVec2::new(width_m, width_m / resolution.aspect());
        Self { half_film_m }
    }

    /// Whether the film has a finite extent.
    pub(super) fn has_extent(&self) -> bool {
        self.half_film_m.is_finite() && self.half_film_m.min_element() > 0.0
    }

    /// Density per area of the parallel ray, equal to `W_e`.
    fn ray_density(&self) -> f64 {
        1.0 / (4.0 * self.half_film_m.x * self.half_film_m.y)
    }

    pub(super) fn sample_ray(
        &self,
        placement: &Placement,
        resolution: Resolution,
        raster: DVec2,
    ) -> CameraSample {
        let on_film = resolution.raster_to_unit(raster) * self.half_film_m;
        CameraSample {
            xk: end_point(placement, on_film),
            direction: axis(placement),
            pdf_xk: 1.0,
            pdf_direction: DirectionalDensity::Perpendicular(self.ray_density()),
            weight: 1.0,
        }
    }

    pub(super) fn sample_connection(
        &self,
        placement: &Placement,
        resolution: Resolution,
        x: DVec3,
        margin: f64,
    ) -> Option<SensorConnection> {
        let local = placement.to_object.transform_point3(x);
        let raster = resolution.unit_to_raster(local.truncate() / self.half_film_m);
        let seen = local.z < 0.0 && resolution.contains(raster, margin);
        seen.then(|| SensorConnection {
            xk: end_point(placement, local.truncate()),
            toward: -axis(placement),
            distance: -local.z,
            pdf_xk: 1.0,
            raster,
            importance: self.ray_density(),
        })
    }

    pub(super) fn density(&self) -> (f64, DirectionalDensity) {
        (1.0, DirectionalDensity::Perpendicular(self.ray_density()))
    }
}

fn end_point(placement: &Placement, on_film: DVec2) -> EndPoint {
    EndPoint::at(placement.to_world.transform_point3(on_film.extend(0.0)))
}

/// The direction of view, a unit vector.
pub(super) fn axis(placement: &Placement) -> DVec3 {
    let axis = placement.to_world.transform_vector3(DVec3::NEG_Z);
    axis.normalize()
}
