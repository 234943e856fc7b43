//! A real receiving surface that measures irradiance, or intensity by direction.
//!
//! The detector is a rectangle of the scene, the image of the square -1..1 in the plane z = 0 (the
//! shape `Quad`) under its transform. Columns run along u (+x, to the right), rows from the top
//! down v (+y, up); it receives on the side of u × v, so a picture is seen the right way round from
//! there, and the wrong way round where it is `flipped`. `W_e` = 1/A and directions are drawn by
//! the cosine, or most of them toward a disk or an exit pupil.
//!
//! With a [`FarField`] its film is over directions: `W_e` is one over the solid angle per share of
//! the film, x_k is anywhere on the rectangle, and where a path lands follows from its direction
//! there, so that a path by the point of the camera sub-path lands on no pixel of its own.
//!
//! A [`Curved`] one has its points before or behind those of the rectangle, and `W_e` = 1/A with
//! the area of the surface per share of the film there.

use super::curved::{Curved, normal};
use super::far_field::FarField;
use super::{CameraSample, Resolution, SensorConnection};
use crate::geometry::{
    DirectionalDensity, EndPoint, InstanceId, Placement, SurfaceId, SurfacePoint,
};
use crate::math::{frame::Frame, sampling};
use crate::optics::ExitPupil;
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// Share of the directions that are drawn toward the disk of an [`Aim`].
const AIMED: f64 = 0.9;
/// Shares that are drawn toward the exit pupil of a lens, and toward its whole rear element, by
/// which ghosts and the rays between the cells of the table come.
const TO_PUPIL: f64 = 0.8;
const TO_ELEMENT: f64 = 0.15;

/// A disk at rest that most light comes through, such as the rear element of the lens before a
/// film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// Center.
    pub center: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Radius in meters, > 0.
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

/// Where most camera sub-paths of a detector go.
#[derive(Clone, Debug, PartialEq)]
pub enum Toward {
    /// A disk.
    Disk(Aim),
    /// The exit pupil of the lens before it, in meters, along u, v and the normal of the detector.
    Pupil(Arc<ExitPupil>),
}

/// A rectangular detector.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Detector {
    /// Whether light goes on unchanged after it is measured. Otherwise the detector absorbs it, on
    /// both sides.
    pub transparent: bool,
    /// Where most camera sub-paths go.
    pub aim: Option<Toward>,
    /// Whether columns run against u: what is measured is seen from behind.
    pub flipped: bool,
    /// Half angle of the cone about the normal that light is accepted from, radians in (0, π/2);
    /// `None`: from all of the side.
    pub acceptance_rad: Option<f64>,
    /// Directions of the film, where it is not over places.
    pub far_field: Option<FarField>,
    /// The surface, where it is no plane.
    pub curved: Option<Arc<Curved>>,
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

    /// Unit vectors along u and v, and the normal.
    fn axes(&self) -> DMat3 {
        DMat3::from_cols(self.u.normalize(), self.v.normalize(), self.n)
    }

    /// The rectangle tilted to have another normal: that of the surface at a point.
    fn with_normal(&self, n: DVec3) -> Self {
        Self { n, ..*self }
    }

    /// Place of a point of it along u and v, meters from the middle.
    fn film(&self, p: DVec3) -> DVec2 {
        let off = p - self.center;
        DVec2::new(off.dot(self.u.normalize()), off.dot(self.v.normalize()))
    }

    /// The rear element of the lens before it.
    fn element(&self, pupil: &ExitPupil) -> Aim {
        let axis = self.axes() * (-pupil.shift()).extend(pupil.distance());
        Aim {
            center: self.center + axis,
            normal: self.n,
            radius_m: pupil.radius(),
        }
    }
}

impl Detector {
    /// Area in m².
    pub(super) fn area(placement: &Placement) -> f64 {
        Rectangle::new(placement).area
    }

    /// Square of the sine of the half angle of acceptance.
    fn accepted_sin_squared(&self) -> f64 {
        self.acceptance_rad.map_or(1.0, |rad| rad.sin().powi(2))
    }

    /// Whether light at this cosine to the normal is measured.
    fn accepts(&self, cos: f64) -> bool {
        cos > 0.0 && self.acceptance_rad.is_none_or(|rad| cos >= rad.cos())
    }

    /// From raster coordinates to those of the square -1..1.
    fn on_film(&self, resolution: Resolution, raster: DVec2) -> DVec2 {
        self.flip(resolution.raster_to_unit(raster))
    }

    fn flip(&self, unit: DVec2) -> DVec2 {
        if self.flipped {
            DVec2::new(-unit.x, unit.y)
        } else {
            unit
        }
    }

    /// Raster position of light that travels along a unit vector, and the solid angle per share of
    /// the film there.
    fn landing(
        &self,
        rectangle: &Rectangle,
        field: &FarField,
        resolution: Resolution,
        travel: DVec3,
    ) -> Option<(DVec2, f64)> {
        let place = field.place(rectangle.axes().transpose() * travel)?;
        let raster = resolution.unit_to_raster(self.flip(place));
        Some((raster, field.solid_angle(place)))
    }

    fn end_point(&self, rectangle: &Rectangle, on_film: DVec2) -> EndPoint {
        let flat = rectangle.center + on_film.x * rectangle.u + on_film.y * rectangle.v;
        let (p, n) = match &self.curved {
            None => (flat, rectangle.n),
            Some(curved) => {
                let (sag, _) = curved.at(rectangle.film(flat));
                (flat + sag * rectangle.n, self.normal_at(rectangle, flat))
            }
        };
        EndPoint {
            n,
            surface: self
                .instance
                .map(|instance| SurfaceId { instance, prim: 0 }),
            ..EndPoint::at(p)
        }
    }

    /// Unit normal of the side that measures at a point, or before or behind it.
    fn normal_at(&self, rectangle: &Rectangle, p: DVec3) -> DVec3 {
        let Some(curved) = &self.curved else {
            return rectangle.n;
        };
        let (_, slopes) = curved.at(rectangle.film(p));
        let axes = rectangle.axes();
        normal([axes.x_axis, axes.y_axis, axes.z_axis], slopes)
    }

    /// Area of the surface per share of the film where it has this normal.
    fn area_per_share(&self, rectangle: &Rectangle, n: DVec3) -> f64 {
        if self.curved.is_some() {
            rectangle.area / n.dot(rectangle.n)
        } else {
            rectangle.area
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
        if let Some(field) = &self.far_field {
            let xk = self.end_point(&rectangle, 2.0 * u_lens - 1.0);
            let place = self.on_film(resolution, raster);
            let travel = field.travel(place);
            let direction = travel.map_or(-rectangle.n, |travel| rectangle.axes() * -travel);
            return CameraSample {
                xk,
                direction,
                pdf_xk: 1.0 / rectangle.area,
                pdf_direction: DirectionalDensity::SolidAngle(1.0 / field.solid_angle(place)),
                // the solid angle cancels; nothing arrives from behind
                weight: rectangle.area * direction.dot(rectangle.n).max(0.0),
            };
        }
        let xk = self.end_point(&rectangle, self.on_film(resolution, raster));
        let here = rectangle.with_normal(xk.n);
        let (direction, weight) = self.draw_direction(&here, xk.p, u_lens);
        let pdf_direction = self.direction_density(&here, xk.p, direction);
        CameraSample {
            xk,
            direction,
            pdf_xk: 1.0 / self.area_per_share(&rectangle, xk.n),
            pdf_direction: DirectionalDensity::SolidAngle(pdf_direction),
            weight,
        }
    }

    /// A direction and its weight `W_e cosθ / pdf`.
    fn draw_direction(&self, rectangle: &Rectangle, p: DVec3, u: DVec2) -> (DVec3, f64) {
        let square = self.accepted_sin_squared();
        let by_cosine = |u: DVec2| {
            let mut local = sampling::cosine_hemisphere(u.into());
            if square < 1.0 {
                let flat = local.truncate() * square.sqrt();
                local = flat.extend((1.0 - flat.length_squared()).sqrt());
            }
            Frame::from_z(rectangle.n).to_outer(local).normalize()
        };
        // the part of [0, 1) from `low` on, stretched over all of it
        let part = |low: f64, share: f64| DVec2::new((u.x - low) / share, u.y);
        let direction = match &self.aim {
            None => return (by_cosine(u), PI * square),
            Some(Toward::Disk(aim)) if u.x < AIMED => aim.draw(p, part(0.0, AIMED)),
            Some(Toward::Disk(_)) => by_cosine(part(AIMED, 1.0 - AIMED)),
            Some(Toward::Pupil(pupil)) if u.x < TO_PUPIL => {
                let drawn = pupil.draw(rectangle.film(p), part(0.0, TO_PUPIL));
                match drawn {
                    Some(local) => rectangle.axes() * local,
                    // a place that the lens is dark from
                    None => return (rectangle.n, 0.0),
                }
            }
            Some(Toward::Pupil(pupil)) if u.x < TO_PUPIL + TO_ELEMENT => {
                rectangle.element(pupil).draw(p, part(TO_PUPIL, TO_ELEMENT))
            }
            Some(Toward::Pupil(_)) => {
                let low = TO_PUPIL + TO_ELEMENT;
                by_cosine(part(low, 1.0 - low))
            }
        };
        let cos = rectangle.n.dot(direction);
        let density = self.direction_density(rectangle, p, direction);
        // parts of the disk may be behind the detector, or not accepted
        let weight = if self.accepts(cos) {
            cos / density
        } else {
            0.0
        };
        (direction, weight)
    }

    fn direction_density(&self, rectangle: &Rectangle, p: DVec3, direction: DVec3) -> f64 {
        let cos = rectangle.n.dot(direction);
        let by_cosine = if self.accepts(cos) {
            sampling::cosine_hemisphere_pdf(cos) / self.accepted_sin_squared()
        } else {
            0.0
        };
        match &self.aim {
            Some(Toward::Disk(aim)) if by_cosine > 0.0 => {
                AIMED * aim.density(p, direction) + (1.0 - AIMED) * by_cosine
            }
            Some(Toward::Pupil(pupil)) if by_cosine > 0.0 => {
                let local = rectangle.axes().transpose() * direction;
                TO_PUPIL * pupil.density(rectangle.film(p), local)
                    + TO_ELEMENT * rectangle.element(pupil).density(p, direction)
                    + (1.0 - TO_PUPIL - TO_ELEMENT) * by_cosine
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
        margin: f64,
    ) -> Option<SensorConnection> {
        let rectangle = Rectangle::new(placement);
        if let Some(field) = &self.far_field {
            let xk = self.end_point(&rectangle, 2.0 * u_lens - 1.0);
            let distance = xk.p.distance(x);
            let toward = (xk.p - x) / distance;
            let (raster, per_share) = self.landing(&rectangle, field, resolution, toward)?;
            let is_seen = distance > 0.0 && resolution.contains(raster, margin);
            return is_seen.then(|| SensorConnection {
                xk,
                toward,
                distance,
                pdf_xk: 1.0 / rectangle.area,
                raster,
                importance: rectangle.area * -rectangle.n.dot(toward)
                    / (distance * distance * per_share),
            });
        }
        let raster = u_lens * resolution.size();
        let xk = self.end_point(&rectangle, self.on_film(resolution, raster));
        let distance = xk.p.distance(x);
        let cos = xk.n.dot(x - xk.p) / distance;
        (distance > 0.0 && self.accepts(cos)).then(|| SensorConnection {
            xk,
            toward: (xk.p - x) / distance,
            distance,
            pdf_xk: 1.0 / self.area_per_share(&rectangle, xk.n),
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
        if let Some(field) = &self.far_field {
            let place = field.place(rectangle.axes().transpose() * -direction);
            let pdf = place.map_or(0.0, |place| 1.0 / field.solid_angle(place));
            return (1.0 / rectangle.area, DirectionalDensity::SolidAngle(pdf));
        }
        let n = self.normal_at(&rectangle, p);
        let pdf = self.direction_density(&rectangle.with_normal(n), p, direction);
        let density = 1.0 / self.area_per_share(&rectangle, n);
        (density, DirectionalDensity::SolidAngle(pdf))
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
        if let Some(field) = &self.far_field {
            let (raster, per_share) = self.landing(&rectangle, field, resolution, -toward_scene)?;
            return Some((raster, 1.0 / per_share));
        }
        let local = placement.to_object.transform_point3(point.p);
        let n = self.normal_at(&rectangle, point.p);
        self.accepts(n.dot(toward_scene)).then(|| {
            (
                resolution.unit_to_raster(self.flip(local.truncate())),
                1.0 / self.area_per_share(&rectangle, n),
            )
        })
    }
}
