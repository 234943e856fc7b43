//! A collimated beam: parallel light through a round aperture.
//!
//! The aperture plane is where the light starts; nothing behind it is lit.

use super::{DirectSample, EmissionSample, factor, placed_axis, posed};
use crate::geometry::{DirectionalDensity, EndPoint, Transform};
use crate::math::sampling;
use crate::spectrum::Emission;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// A beam that starts on the disc of radius `radius_m` in the plane z = 0 of its own space and travels along +z.
#[derive(Clone, Debug, PartialEq)]
pub struct BeamLight {
    /// Where it is and where it points (a rigid motion).
    pub transform: Transform,
    /// Irradiance across the beam, W/(m² nm) and W/m² per line.
    pub irradiance: Emission,
    /// Radius of the aperture in metres, > 0.
    pub radius_m: f64,
}

impl BeamLight {
    /// A beam at rest whose aperture is centred on `position` and which travels along `direction` (any non-zero
    /// length).
    #[must_use]
    pub fn aimed(position: DVec3, direction: DVec3, irradiance: Emission, radius_m: f64) -> Self {
        Self {
            transform: posed(position, direction),
            irradiance,
            radius_m,
        }
    }

    /// Area of the aperture, m²: the flux per unit irradiance.
    pub(super) fn area(&self) -> f64 {
        PI * self.radius_m * self.radius_m
    }

    pub(super) fn density(&self) -> DirectionalDensity {
        DirectionalDensity::Perpendicular(1.0 / self.area())
    }

    pub(super) fn sample_emission(&self, time: f64, u_pos: DVec2) -> EmissionSample {
        let local = (self.radius_m * sampling::disk(u_pos.into())).extend(0.0);
        let origin = self.transform.at(time).to_world.transform_point3(local);
        EmissionSample {
            x0: EndPoint::at(origin),
            origin,
            direction: placed_axis(&self.transform, time),
            pdf_x0: 1.0,
            pdf_direction: self.density(),
            weight: factor(self.area()),
        }
    }

    /// Projects `x1` back along the beam onto the aperture.
    pub(super) fn sample_direct(&self, time: f64, x1: DVec3) -> Option<DirectSample> {
        let placement = self.transform.at(time);
        let local = placement.to_object.transform_point3(x1);
        let foot = local.truncate();
        let lit = local.z > 0.0 && foot.length_squared() <= self.radius_m * self.radius_m;
        lit.then(|| DirectSample {
            x0: EndPoint::at(placement.to_world.transform_point3(foot.extend(0.0))),
            toward: -placed_axis(&self.transform, time),
            distance: local.z,
            pdf: 1.0,
            value: factor(1.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn emitted_rays_are_found_again_by_connection() {
        let position = DVec3::new(1.0, -2.0, 0.5);
        let direction = DVec3::new(0.2, 0.9, -0.4);
        let light = BeamLight::aimed(position, direction, Emission::default(), 0.01);
        for i in 0..100 {
            let u = DVec2::new(f64::from(i) / 100.0, f64::from(i) * 0.618 % 1.0);
            let s = light.sample_emission(0.0, u);
            assert!((s.origin - position).length() <= 0.01 + 1e-15);
            assert!((s.origin - position).dot(s.direction).abs() < 1e-15);
            assert_eq!(
                s.pdf_direction,
                DirectionalDensity::Perpendicular(1.0 / light.area())
            );
            let direct = light
                .sample_direct(0.0, s.origin + 3.0 * s.direction)
                .unwrap();
            assert!((direct.x0.p - s.origin).length() < 1e-14);
            assert!((direct.distance - 3.0).abs() < 1e-14);
            assert_eq!(direct.value[0], 1.0);
            assert_eq!(direct.x0.cos(s.direction), 1.0);
            // behind the aperture it is dark
            assert!(
                light
                    .sample_direct(0.0, s.origin - 1e-3 * s.direction)
                    .is_none()
            );
        }
    }

    #[test]
    fn dark_beside_the_aperture() {
        let light = BeamLight::aimed(DVec3::ZERO, DVec3::Z, Emission::default(), 0.5);
        assert!(
            light
                .sample_direct(0.0, DVec3::new(0.0, 0.51, 1.0))
                .is_none()
        );
        assert!(
            light
                .sample_direct(0.0, DVec3::new(0.0, 0.49, 1.0))
                .is_some()
        );
        let s = light.sample_emission(0.0, DVec2::new(0.3, 0.4));
        assert!((f64::from(s.weight[0]) - PI * 0.25).abs() < 1e-6);
    }
}
