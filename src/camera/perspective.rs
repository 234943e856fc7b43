//! Pinhole and thin-lens cameras.
//!
//! The camera looks along the -z axis of its own space, +x to the right and +y up. The film is
//! measured on the plane at unit distance, where it has area `A_film`. A thin lens of focus
//! distance f sends a raster position from every lens point through one point of the plane at
//! distance f; the film's image there has area f² `A_film`, and the lens point sees it at distance
//! f/cosθ. So the density of directions is 1/(`A_film` cos³θ) for both, with θ the angle of the ray
//! itself, and `W_e` = 1/(`A_film` `A_lens` cos⁴θ) gives every camera path weight 1.

use super::orthographic::axis;
use super::{CameraSample, Resolution, SensorConnection};
use crate::geometry::{DirectionalDensity, EndPoint, Placement};
use crate::math::frame::normalized;
use crate::math::sampling;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// A lens of finite aperture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinLens {
    /// Radius of the aperture in meters, > 0.
    pub radius_m: f64,
    /// Distance of the plane in focus along the axis, meters, > 0.
    pub focus_distance_m: f64,
}

/// Projection through a pinhole or a thin lens.
#[derive(Clone, Debug, PartialEq)]
pub struct Perspective {
    /// Half width and half height of the film at unit distance.
    half_film: DVec2,
    lens: Option<ThinLens>,
}

impl Perspective {
    pub(super) fn new(resolution: Resolution, fov_y_rad: f64, lens: Option<ThinLens>) -> Self {
        let half_height = (0.5 * fov_y_rad).tan();
        let half_film = DVec2::new(half_height * resolution.aspect(), half_height);
        Self { half_film, lens }
    }

    /// The lens, if it is not a pinhole.
    #[must_use]
    pub fn lens(&self) -> Option<ThinLens> {
        self.lens
    }

    /// Whether the film has a finite extent.
    pub(super) fn has_extent(&self) -> bool {
        self.half_film.is_finite() && self.half_film.min_element() > 0.0
    }

    /// Area of the film at unit distance.
    fn film_area(&self) -> f64 {
        4.0 * self.half_film.x * self.half_film.y
    }

    /// Density of a lens point: per area, or 1 for a pinhole.
    fn lens_density(&self) -> f64 {
        self.lens
            .map_or(1.0, |lens| 1.0 / (PI * lens.radius_m * lens.radius_m))
    }

    fn lens_point(&self, u: DVec2) -> DVec2 {
        self.lens
            .map_or(DVec2::ZERO, |lens| lens.radius_m * sampling::disk(u.into()))
    }

    fn focus_distance(&self) -> f64 {
        // a pinhole has everything in focus
        self.lens.map_or(1.0, |lens| lens.focus_distance_m)
    }

    fn end_point(&self, placement: &Placement, lens_point: DVec2) -> EndPoint {
        let n = if self.lens.is_some() {
            axis(placement)
        } else {
            DVec3::ZERO
        };
        let p = placement.to_world.transform_point3(lens_point.extend(0.0));
        EndPoint {
            n,
            ..EndPoint::at(p)
        }
    }

    fn direction_density(&self, cos: f64) -> f64 {
        if cos > 0.0 {
            1.0 / (self.film_area() * cos * cos * cos)
        } else {
            0.0
        }
    }

    pub(super) fn sample_ray(
        &self,
        placement: &Placement,
        resolution: Resolution,
        raster: DVec2,
        u_lens: DVec2,
    ) -> CameraSample {
        let on_film = resolution.raster_to_unit(raster) * self.half_film;
        let lens_point = self.lens_point(u_lens);
        let local =
            (on_film.extend(-1.0) * self.focus_distance() - lens_point.extend(0.0)).normalize();
        CameraSample {
            xk: self.end_point(placement, lens_point),
            direction: normalized(placement.to_world.transform_vector3(local)),
            pdf_xk: self.lens_density(),
            pdf_direction: DirectionalDensity::SolidAngle(self.direction_density(-local.z)),
            weight: 1.0,
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
        let lens_point = self.lens_point(u_lens);
        let local = placement.to_object.transform_point3(x) - lens_point.extend(0.0);
        if local.z >= 0.0 {
            return None;
        }
        let on_film = (lens_point + local.truncate() * (self.focus_distance() / -local.z))
            / self.focus_distance();
        let raster = resolution.unit_to_raster(on_film / self.half_film);
        if !resolution.contains(raster, margin) {
            return None;
        }
        let xk = self.end_point(placement, lens_point);
        let distance = xk.p.distance(x);
        let cos = -local.z / local.length();
        Some(SensorConnection {
            xk,
            toward: (xk.p - x) / distance,
            distance,
            pdf_xk: self.lens_density(),
            raster,
            // W_e cosθ/(d² pdf): the lens area cancels
            importance: self.direction_density(cos) / (distance * distance),
        })
    }

    pub(super) fn density(
        &self,
        placement: &Placement,
        direction: DVec3,
    ) -> (f64, DirectionalDensity) {
        let pdf = self.direction_density(axis(placement).dot(direction));
        (self.lens_density(), DirectionalDensity::SolidAngle(pdf))
    }
}
