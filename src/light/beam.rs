//! A collimated beam: parallel light through a round aperture.
//!
//! The aperture plane is where the light starts; nothing behind it is lit.

use super::{DirectSample, EmissionSample, factor, placed_axis};
use crate::geometry::{DirectionalDensity, EndPoint, Placement};
use crate::math::sampling;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// Irradiance across a beam that starts on a disk in the plane z = 0 of its own space and travels
/// along +z: W/(m² nm), and W/m² per line.
#[derive(Clone, Debug, PartialEq)]
pub struct BeamLight {
    /// Radius of the aperture in metres, > 0.
    pub radius_m: f64,
}

impl BeamLight {
    /// Area of the aperture, m²: the flux per unit irradiance.
    pub(super) fn area(&self) -> f64 {
        PI * self.radius_m * self.radius_m
    }

    pub(super) fn density(&self) -> DirectionalDensity {
        DirectionalDensity::Perpendicular(1.0 / self.area())
    }

    pub(super) fn sample_emission(&self, place: &Placement, u_pos: DVec2) -> EmissionSample {
        let local = (self.radius_m * sampling::disk(u_pos.into())).extend(0.0);
        let origin = place.to_world.transform_point3(local);
        EmissionSample {
            x0: EndPoint::at(origin),
            origin,
            direction: placed_axis(place),
            pdf_x0: 1.0,
            pdf_direction: self.density(),
            weight: factor(self.area()),
        }
    }

    /// Projects `x1` back along the beam onto the aperture.
    pub(super) fn sample_direct(&self, place: &Placement, x1: DVec3) -> Option<DirectSample> {
        let local = place.to_object.transform_point3(x1);
        let foot = local.truncate();
        let lit = local.z > 0.0 && foot.length_squared() <= self.radius_m * self.radius_m;
        lit.then(|| DirectSample {
            x0: EndPoint::at(place.to_world.transform_point3(foot.extend(0.0))),
            toward: -placed_axis(place),
            distance: local.z,
            pdf: 1.0,
            value: factor(1.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::posed;
    use super::*;

    #[test]
    fn emitted_rays_are_found_again_by_connection() {
        let position = DVec3::new(1.0, -2.0, 0.5);
        let direction = DVec3::new(0.2, 0.9, -0.4);
        let (light, place) = (BeamLight { radius_m: 0.01 }, posed(position, direction));
        for i in 0..100 {
            let u = DVec2::new(f64::from(i) / 100.0, f64::from(i) * 0.618 % 1.0);
            let s = light.sample_emission(&place, u);
            assert!((s.origin - position).length() <= 0.01 + 1e-15);
            assert!((s.origin - position).dot(s.direction).abs() < 1e-15);
            assert_eq!(
                s.pdf_direction,
                DirectionalDensity::Perpendicular(1.0 / light.area())
            );
            let direct = light
                .sample_direct(&place, s.origin + 3.0 * s.direction)
                .unwrap();
            assert!((direct.x0.p - s.origin).length() < 1e-14);
            assert!((direct.distance - 3.0).abs() < 1e-14);
            assert_eq!(direct.value[0], 1.0);
            assert_eq!(direct.x0.cos(s.direction), 1.0);
            // behind the aperture it is dark
            assert!(
                light
                    .sample_direct(&place, s.origin - 1e-3 * s.direction)
                    .is_none()
            );
        }
    }

    #[test]
    fn dark_beside_the_aperture() {
        let (light, place) = (BeamLight { radius_m: 0.5 }, Placement::IDENTITY);
        assert!(
            light
                .sample_direct(&place, DVec3::new(0.0, 0.51, 1.0))
                .is_none()
        );
        assert!(
            light
                .sample_direct(&place, DVec3::new(0.0, 0.49, 1.0))
                .is_some()
        );
        let s = light.sample_emission(&place, DVec2::new(0.3, 0.4));
        assert!((f64::from(s.weight[0]) - PI * 0.25).abs() < 1e-6);
    }
}
