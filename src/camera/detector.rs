//! A real receiving surface that measures irradiance.
//!
//! The detector is a rectangle of the scene, the image of the square -1..1 in the plane z = 0 (the shape `Quad`) under
//! its transform. Columns run along u (+x, to the right), rows from the top down v (+y, up); it receives on the side of
//! u × v, so a picture is seen the right way round from there. `W_e` = 1/A and directions are drawn by the cosine.

use super::{CameraSample, Resolution, SensorConnection};
use crate::geometry::{
    DirectionalDensity, EndPoint, InstanceId, SurfaceId, SurfacePoint, Transform,
};
use crate::math::{frame::Frame, sampling};
use glam::{DAffine3, DVec2, DVec3};
use std::f64::consts::PI;

/// A rectangular detector.
#[derive(Clone, Debug, PartialEq)]
pub struct Detector {
    /// From the square -1..1 in the plane z = 0 to the world: also the transform of its `Quad` instance.
    pub transform: Transform,
    /// Pixels; the pitch follows from the size.
    pub resolution: Resolution,
    /// Whether light goes on unchanged after it is measured. Otherwise the detector absorbs it, on both sides.
    pub transparent: bool,
    /// Its surface in the scene, set when the scene is built.
    pub instance: Option<InstanceId>,
}

/// The rectangle at one moment.
struct Rectangle {
    center: DVec3,
    /// From the centre to the middle of the right side.
    u: DVec3,
    /// From the centre to the middle of the upper side.
    v: DVec3,
    /// Unit normal of the receiving side.
    n: DVec3,
    area: f64,
}

impl Detector {
    /// An absorbing detector of `width_m` × `height_m` metres (> 0) at rest: centred on the origin of the rigid motion
    /// `pose`, u along its x axis and v along its y axis.
    #[must_use]
    pub fn new(pose: DAffine3, width_m: f64, height_m: f64, resolution: Resolution) -> Self {
        let scale = DVec3::new(0.5 * width_m, 0.5 * height_m, 1.0);
        let transform = Transform::fixed(pose * DAffine3::from_scale(scale));
        Self {
            transform,
            resolution,
            transparent: false,
            instance: None,
        }
    }

    /// Area in m² at `time`.
    #[must_use]
    pub fn area(&self, time: f64) -> f64 {
        self.rectangle(time).area
    }

    fn rectangle(&self, time: f64) -> Rectangle {
        let map = self.transform.at(time).to_world;
        let (u, v) = (map.matrix3.x_axis, map.matrix3.y_axis);
        let cross = u.cross(v);
        Rectangle {
            center: map.translation,
            u,
            v,
            n: cross.normalize(),
            area: 4.0 * cross.length(),
        }
    }

    fn end_point(&self, rectangle: &Rectangle, on_film: DVec2) -> EndPoint {
        EndPoint {
            n: rectangle.n,
            surface: self
                .instance
                .map(|instance| SurfaceId { instance, prim: 0 }),
            ..EndPoint::at(rectangle.center + on_film.x * rectangle.u + on_film.y * rectangle.v)
        }
    }

    pub(super) fn sample_ray(&self, raster: DVec2, u_lens: DVec2, time: f64) -> CameraSample {
        let rectangle = self.rectangle(time);
        let local = sampling::cosine_hemisphere(u_lens.into());
        let direction = Frame::from_z(rectangle.n).to_outer(local).normalize();
        let pdf_direction = sampling::cosine_hemisphere_pdf(rectangle.n.dot(direction));
        CameraSample {
            xk: self.end_point(&rectangle, self.resolution.raster_to_unit(raster)),
            direction,
            pdf_xk: 1.0 / rectangle.area,
            pdf_direction: DirectionalDensity::SolidAngle(pdf_direction),
            weight: PI,
        }
    }

    pub(super) fn sample_connection(
        &self,
        x: DVec3,
        u_lens: DVec2,
        time: f64,
    ) -> Option<SensorConnection> {
        let rectangle = self.rectangle(time);
        let raster = u_lens * self.resolution.size();
        let xk = self.end_point(&rectangle, self.resolution.raster_to_unit(raster));
        let distance = xk.p.distance(x);
        let cos = rectangle.n.dot(x - xk.p) / distance;
        (distance > 0.0 && cos > 0.0).then(|| SensorConnection {
            xk,
            toward: (xk.p - x) / distance,
            distance,
            pdf_xk: 1.0 / rectangle.area,
            raster,
            // W_e cosθ/(d² pdf): the area cancels
            importance: cos / (distance * distance),
        })
    }

    pub(super) fn density(&self, direction: DVec3, time: f64) -> (f64, DirectionalDensity) {
        let rectangle = self.rectangle(time);
        let pdf = sampling::cosine_hemisphere_pdf(rectangle.n.dot(direction));
        (1.0 / rectangle.area, DirectionalDensity::SolidAngle(pdf))
    }

    pub(super) fn arrive(
        &self,
        point: &SurfacePoint,
        toward_scene: DVec3,
        time: f64,
    ) -> Option<(DVec2, f64)> {
        if self
            .instance
            .is_some_and(|instance| instance != point.id.instance)
        {
            return None;
        }
        let rectangle = self.rectangle(time);
        let local = self.transform.at(time).to_object.transform_point3(point.p);
        (rectangle.n.dot(toward_scene) > 0.0).then(|| {
            (
                self.resolution.unit_to_raster(local.truncate()),
                1.0 / rectangle.area,
            )
        })
    }
}
