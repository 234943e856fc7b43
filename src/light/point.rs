//! A point that shines equally in all directions.

use super::{DirectSample, EmissionSample, factor, unit_from_to};
use crate::geometry::{DirectionalDensity, EndPoint, Placement};
use crate::math::sampling;
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// Radiant intensity of a point at the origin of its own space: W/(sr nm), and W/sr per line.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLight;

impl PointLight {
    /// Flux per unit intensity.
    pub const FLUX_FACTOR: f64 = 4.0 * PI;

    /// Density per solid angle of the emitted direction.
    pub(super) const DIRECTION_PDF: f64 = sampling::UNIFORM_SPHERE_PDF;

    pub(super) fn sample_emission(place: &Placement, u_dir: DVec2) -> EmissionSample {
        let p = place.to_world.translation;
        EmissionSample {
            x0: EndPoint::at(p),
            origin: p,
            direction: sampling::uniform_sphere(u_dir.into()),
            pdf_x0: 1.0,
            pdf_direction: DirectionalDensity::SolidAngle(Self::DIRECTION_PDF),
            weight: factor(Self::FLUX_FACTOR),
        }
    }

    pub(super) fn sample_direct(place: &Placement, x1: DVec3) -> Option<DirectSample> {
        let p = place.to_world.translation;
        let (toward, distance) = unit_from_to(x1, p)?;
        let value = factor(1.0 / (distance * distance));
        Some(DirectSample {
            x0: EndPoint::at(p),
            toward,
            distance,
            pdf: 1.0,
            value,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;

    #[test]
    fn irradiance_falls_with_the_square_of_the_distance() {
        let at = DVec3::new(1.0, 2.0, 3.0);
        let place = Placement::new(DAffine3::from_translation(at));
        let sample = PointLight::sample_direct(&place, DVec3::new(1.0, 2.0, 7.0)).unwrap();
        assert_eq!(sample.value[0], 1.0 / 16.0);
        assert_eq!(sample.toward, DVec3::NEG_Z);
        assert_eq!(sample.distance, 4.0);
        assert!(PointLight::sample_direct(&place, at).is_none());
    }

    #[test]
    fn directions_cover_the_sphere_evenly() {
        let n = 64_usize;
        let mut first = DVec3::ZERO;
        let mut second = DVec3::ZERO;
        for i in 0..n * n {
            let u = (DVec2::new((i % n) as f64, (i / n) as f64) + 0.5) / n as f64;
            let sample = PointLight::sample_emission(&Placement::IDENTITY, u);
            assert!((sample.direction.length() - 1.0).abs() < 1e-14);
            first += sample.direction;
            second += sample.direction * sample.direction;
        }
        // stratified midpoints: far better than the 1/n of random numbers
        assert!((first / (n * n) as f64).length() < 1e-3);
        assert!((second / (n * n) as f64 - DVec3::splat(1.0 / 3.0)).length() < 1e-3);
    }
}
