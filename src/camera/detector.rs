//! A real receiving surface that measures irradiance.
//!
//! The detector is a rectangle of the scene, the image of the square -1..1 in the plane z = 0 (the
//! shape `Quad`) under its transform. Columns run along u (+x, to the right), rows from the top
//! down v (+y, up); it receives on the side of u × v, so a picture is seen the right way round from
//! there. `W_e` = 1/A and directions are drawn by the cosine, or most of them toward a disk.

use super::{CameraSample, Resolution, SensorConnection};
use crate::geometry::{
    DirectionalDensity, EndPoint, InstanceId, Placement, SurfaceId, SurfacePoint,
};
use crate::math::{frame::Frame, sampling};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// Share of the directions that are drawn toward the disk of an [`Aim`].
const AIMED: f64 = 0.9;

/// A disk at rest that most light comes through, such as the rear element of the lens before a
/// film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// Center.
    pub center: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Radius in metres, > 0.
    pub radius_m: f64,
}

impl Aim {
    /// Direction from `p` to a point of the disk, uniform by area.
    fn draw(&self, p: DVec3, u: DVec2) -> DVec3 {
        let flat = self.radius_m * sampling::disk(u.into());
        let on_disk = Frame::from_z(self.normal).to_outer(flat.extend(0.0));
        (self.center + on_disk - p).normalize()
    }

    /// Density of that per solid angle.
    fn density(&self, p: DVec3, direction: DVec3) -> f64 {
        let cos = direction.dot(self.normal);
        let distance = (self.center - p).dot(self.normal) / cos;
        let off = p + direction * distance - self.center;
        let square = self.radius_m * self.radius_m;
        if distance > 0.0 && off.length_squared() <= square {
            distance * distance / (PI * square * cos.abs())
        } else {
            0.0
        }
    }
}

/// A rectangular detector.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Detector {
    /// Whether light goes on unchanged after it is measured. Otherwise the detector absorbs it, on
    /// both sides.
    pub transparent: bool,
    /// Where most camera sub-paths go.
    pub aim: Option<Aim>,
    /// Surface in the scene, set when the scene is built.
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

impl Rectangle {
    fn new(placement: &Placement) -> Self {
        let map = placement.to_world;
        let (u, v) = (map.matrix3.x_axis, map.matrix3.y_axis);
        let cross = u.cross(v);
        Self {
            center: map.translation,
            u,
            v,
            n: cross.normalize(),
            area: 4.0 * cross.length(),
        }
    }
}

impl Detector {
    /// Area in m².
    pub(super) fn area(placement: &Placement) -> f64 {
        Rectangle::new(placement).area
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

    pub(super) fn sample_ray(
        &self,
        placement: &Placement,
        resolution: Resolution,
        raster: DVec2,
        u_lens: DVec2,
    ) -> CameraSample {
        let rectangle = Rectangle::new(placement);
        let xk = self.end_point(&rectangle, resolution.raster_to_unit(raster));
        let (direction, weight) = self.draw_direction(&rectangle, xk.p, u_lens);
        let pdf_direction = self.direction_density(&rectangle, xk.p, direction);
        CameraSample {
            xk,
            direction,
            pdf_xk: 1.0 / rectangle.area,
            pdf_direction: DirectionalDensity::SolidAngle(pdf_direction),
            weight,
        }
    }

    /// A direction and its weight `W_e cosθ / pdf`.
    fn draw_direction(&self, rectangle: &Rectangle, p: DVec3, u: DVec2) -> (DVec3, f64) {
        let by_cosine = |u: DVec2| {
            let local = sampling::cosine_hemisphere(u.into());
            Frame::from_z(rectangle.n).to_outer(local).normalize()
        };
        let Some(aim) = &self.aim else {
            return (by_cosine(u), PI);
        };
        let direction = if u.x < AIMED {
            aim.draw(p, DVec2::new(u.x / AIMED, u.y))
        } else {
            by_cosine(DVec2::new((u.x - AIMED) / (1.0 - AIMED), u.y))
        };
        let cos = rectangle.n.dot(direction);
        let density = self.direction_density(rectangle, p, direction);
        // parts of the disk may be behind the detector
        let weight = if cos > 0.0 { cos / density } else { 0.0 };
        (direction, weight)
    }

    fn direction_density(&self, rectangle: &Rectangle, p: DVec3, direction: DVec3) -> f64 {
        let by_cosine = sampling::cosine_hemisphere_pdf(rectangle.n.dot(direction));
        match &self.aim {
            Some(aim) if by_cosine > 0.0 => {
                AIMED * aim.density(p, direction) + (1.0 - AIMED) * by_cosine
            }
            _ => by_cosine,
        }
    }

    pub(super) fn sample_connection(
        &self,
        placement: &Placement,
        resolution: Resolution,
        x: DVec3,
        u_lens: DVec2,
    ) -> Option<SensorConnection> {
        let rectangle = Rectangle::new(placement);
        let raster = u_lens * resolution.size();
        let xk = self.end_point(&rectangle, resolution.raster_to_unit(raster));
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

    pub(super) fn density(
        &self,
        placement: &Placement,
        p: DVec3,
        direction: DVec3,
    ) -> (f64, DirectionalDensity) {
        let rectangle = Rectangle::new(placement);
        let pdf = self.direction_density(&rectangle, p, direction);
        (1.0 / rectangle.area, DirectionalDensity::SolidAngle(pdf))
    }

    pub(super) fn arrive(
        &self,
        placement: &Placement,
        resolution: Resolution,
        point: &SurfacePoint,
        toward_scene: DVec3,
    ) -> Option<(DVec2, f64)> {
        if self
            .instance
            .is_some_and(|instance| instance != point.id.instance)
        {
            return None;
        }
        let rectangle = Rectangle::new(placement);
        let local = placement.to_object.transform_point3(point.p);
        (rectangle.n.dot(toward_scene) > 0.0).then(|| {
            (
                resolution.unit_to_raster(local.truncate()),
                1.0 / rectangle.area,
            )
        })
    }
}
