//! Parallel projection.
//!
//! The camera looks along the -z axis of its own space, +x to the right and +y up. Rays leave a film of real size in
//! the plane z = 0; things behind it are not seen.

use super::{CameraSample, Resolution, SensorConnection};
use crate::geometry::{DirectionalDensity, EndPoint, Transform};
use glam::{DVec2, DVec3};

/// An orthographic camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Orthographic {
    transform: Transform,
    resolution: Resolution,
    /// Half width and half height of the film in metres.
    half_film_m: DVec2,
}

impl Orthographic {
    /// A camera with a film `width_m` metres wide (> 0), placed by a rigid motion; square pixels.
    #[must_use]
    pub fn new(transform: Transform, resolution: Resolution, width_m: f64) -> Self {
        let half_film_m = 0.5 * DVec2::new(width_m, width_m / resolution.aspect());
        Self {
            transform,
            resolution,
            half_film_m,
        }
    }

    pub(super) fn resolution(&self) -> Resolution {
        self.resolution
    }

    pub(super) fn transform(&self) -> &Transform {
        &self.transform
    }

    pub(super) fn transform_mut(&mut self) -> &mut Transform {
        &mut self.transform
    }

    /// Density per area of the parallel ray, equal to `W_e`.
    fn ray_density(&self) -> f64 {
        1.0 / (4.0 * self.half_film_m.x * self.half_film_m.y)
    }

    fn end_point(&self, on_film: DVec2, time: f64) -> EndPoint {
        let p = self
            .transform
            .at(time)
            .to_world
            .transform_point3(on_film.extend(0.0));
        EndPoint::at(p)
    }

    fn axis(&self, time: f64) -> DVec3 {
        self.transform
            .at(time)
            .to_world
            .transform_vector3(DVec3::NEG_Z)
            .normalize()
    }

    pub(super) fn sample_ray(&self, raster: DVec2, time: f64) -> CameraSample {
        CameraSample {
            xk: self.end_point(
                self.resolution.raster_to_unit(raster) * self.half_film_m,
                time,
            ),
            direction: self.axis(time),
            pdf_xk: 1.0,
            pdf_direction: DirectionalDensity::Perpendicular(self.ray_density()),
            weight: 1.0,
        }
    }

    pub(super) fn sample_connection(
        &self,
        x: DVec3,
        time: f64,
        margin: f64,
    ) -> Option<SensorConnection> {
        let local = self.transform.at(time).to_object.transform_point3(x);
        let raster = self
            .resolution
            .unit_to_raster(local.truncate() / self.half_film_m);
        let seen = local.z < 0.0 && self.resolution.contains(raster, margin);
        seen.then(|| SensorConnection {
            xk: self.end_point(local.truncate(), time),
            toward: -self.axis(time),
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
