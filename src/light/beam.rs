//! A collimated beam: parallel light through a round aperture, with a profile across it.
//!
//! The aperture plane is where the light starts; nothing behind it is lit. Points of uniform and
//! Gaussian beams are drawn in proportion to the irradiance, so that every path has the same
//! weight; those of other profiles nearly so.

pub mod profile;

use super::{DirectSample, EmissionSample, factor, placed_axis};
use crate::geometry::{DirectionalDensity, EndPoint, Placement};
use crate::math::sampling;
use glam::{DVec2, DVec3};
use profile::RingProfile;
use std::f64::consts::PI;
use std::sync::Arc;

/// Irradiance across a beam over that on its axis (or per unit of a table).
#[derive(Clone, Debug, PartialEq)]
pub enum BeamProfile {
    /// The same everywhere.
    Uniform,
    /// `exp(-2 (r / waist)²)`.
    Gaussian {
        /// Distance from the axis in meters, > 0, at which it is 1/e².
        waist_m: f64,
    },
    /// Any other, as far as the aperture reaches.
    Rings(Arc<RingProfile>),
}

/// Irradiance across a beam that starts on a disk in the plane z = 0 of its own space and travels
/// along +z: W/(m² nm), and W/m² per line.
#[derive(Clone, Debug, PartialEq)]
pub struct BeamLight {
    /// Radius of the aperture in meters, > 0.
    pub radius_m: f64,
    /// Profile within it.
    pub profile: BeamProfile,
}

impl BeamLight {
    /// Flux per unit irradiance on the axis (of a table: of its values), m².
    #[must_use]
    pub fn flux_factor(&self) -> f64 {
        let square = self.radius_m * self.radius_m;
        match &self.profile {
            BeamProfile::Uniform => PI * self.radius_m * self.radius_m,
            BeamProfile::Gaussian { waist_m: waist } => {
                0.5 * PI * waist * waist * -(-2.0 * square / (waist * waist)).exp_m1()
            }
            BeamProfile::Rings(rings) => rings.flux(),
        }
    }

    /// Irradiance relative to the axis at a squared distance from it, within the aperture.
    fn profile(&self, square: f64) -> f64 {
        match &self.profile {
            BeamProfile::Uniform => 1.0,
            BeamProfile::Gaussian { waist_m: waist } => (-2.0 * square / (waist * waist)).exp(),
            BeamProfile::Rings(rings) => rings.at(square),
        }
    }

    /// Density per area with which points at a squared distance from the axis are drawn.
    fn drawn(&self, square: f64) -> f64 {
        match &self.profile {
            BeamProfile::Rings(rings) => rings.density(square),
            _ => self.profile(square) / self.flux_factor(),
        }
    }

    /// Point of the aperture plane in its own space.
    fn foot(place: &Placement, p: DVec3) -> DVec2 {
        place.to_object.transform_point3(p).truncate()
    }

    /// Density across the beam at a point of its aperture.
    pub(super) fn density(&self, place: &Placement, p: DVec3) -> DirectionalDensity {
        let square = Self::foot(place, p).length_squared();
        DirectionalDensity::Perpendicular(self.drawn(square))
    }

    /// Point of the aperture by two numbers in [0, 1).
    fn draw(&self, u: DVec2) -> DVec2 {
        let unit = sampling::disk(u.into());
        if self.profile == BeamProfile::Uniform {
            return self.radius_m * unit;
        }
        // the squared distance of a uniform point of the unit disk is uniform itself
        let share = unit.length_squared();
        if share == 0.0 {
            return DVec2::ZERO;
        }
        let square = match &self.profile {
            BeamProfile::Uniform => share * self.radius_m * self.radius_m,
            BeamProfile::Gaussian { waist_m: waist } => {
                let most = -2.0 * (self.radius_m / waist).powi(2);
                -0.5 * waist * waist * (share * most.exp_m1()).ln_1p()
            }
            BeamProfile::Rings(rings) => rings.draw(share),
        };
        // rounding must not lead beyond the aperture
        unit * (square.min(self.radius_m * self.radius_m) / share).sqrt()
    }

    pub(super) fn sample_emission(&self, place: &Placement, u_pos: DVec2) -> EmissionSample {
        let local = self.draw(u_pos);
        let origin = place.to_world.transform_point3(local.extend(0.0));
        let square = local.length_squared();
        let density = self.drawn(square);
        let weight = match &self.profile {
            BeamProfile::Rings(rings) if density > 0.0 => rings.at(square) / density,
            BeamProfile::Rings(_) => 0.0,
            _ => self.flux_factor(),
        };
        EmissionSample {
            x0: EndPoint::in_beam(origin, placed_axis(place)),
            origin,
            direction: placed_axis(place),
            pdf_x0: 1.0,
            pdf_direction: DirectionalDensity::Perpendicular(density),
            weight: factor(weight),
        }
    }

    /// Projects `x1` back along the beam onto the aperture.
    pub(super) fn sample_direct(&self, place: &Placement, x1: DVec3) -> Option<DirectSample> {
        let local = place.to_object.transform_point3(x1);
        let foot = local.truncate();
        let lit = local.z > 0.0 && foot.length_squared() <= self.radius_m * self.radius_m;
        let axis = placed_axis(place);
        lit.then(|| DirectSample {
            x0: EndPoint::in_beam(place.to_world.transform_point3(foot.extend(0.0)), axis),
            toward: -axis,
            distance: local.z,
            pdf: 1.0,
            value: factor(self.profile(foot.length_squared())),
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
        let place = posed(position, direction);
        let profiles = [
            BeamProfile::Uniform,
            BeamProfile::Gaussian { waist_m: 0.004 },
            BeamProfile::Rings(Arc::new(RingProfile::super_gaussian(0.01, 0.006, 7.0))),
        ];
        // from 1 on: 0 is the border of the aperture, and of rings
        for (i, profile) in (1..100).flat_map(|i| profiles.clone().map(|p| (i, p))) {
            let light = BeamLight {
                radius_m: 0.01,
                profile,
            };
            let u = DVec2::new(f64::from(i) / 100.0, f64::from(i) * 0.618 % 1.0);
            let s = light.sample_emission(&place, u);
            assert!((s.origin - position).length() <= 0.01 + 2e-15);
            assert!((s.origin - position).dot(s.direction).abs() < 1e-15);
            let DirectionalDensity::Perpendicular(pdf) = s.pdf_direction else {
                panic!("{:?}", s.pdf_direction);
            };
            let DirectionalDensity::Perpendicular(again) = light.density(&place, s.x0.p) else {
                panic!("of another measure");
            };
            assert!((again / pdf - 1.0).abs() < 1e-9, "{again} {pdf}");
            let relative = pdf * f64::from(s.weight[0]);
            let direct = light
                .sample_direct(&place, s.origin + 3.0 * s.direction)
                .unwrap();
            assert!((direct.x0.p - s.origin).length() < 1e-14);
            assert!((direct.distance - 3.0).abs() < 1e-14);
            assert!((f64::from(direct.value[0]) / relative - 1.0).abs() < 1e-5);
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
        let place = Placement::IDENTITY;
        let light = BeamLight {
            radius_m: 0.5,
            profile: BeamProfile::Uniform,
        };
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

    /// Shares of a truncated Gaussian within a radius: of its closed form, and of stratified draws.
    #[test]
    fn gaussian_beams_are_drawn_by_their_irradiance() {
        let (radius_m, waist) = (0.02, 0.015);
        let light = BeamLight {
            radius_m,
            profile: BeamProfile::Gaussian { waist_m: waist },
        };
        let within = |r: f64| 0.5 * PI * waist * waist * (1.0 - (-2.0 * (r / waist).powi(2)).exp());
        assert!((light.flux_factor() / within(radius_m) - 1.0).abs() < 1e-14);
        let n = 300;
        for r in [0.003, 0.008, 0.015] {
            let hits = (0..n * n).filter(|i| {
                let u = DVec2::new(f64::from(i % n) + 0.5, f64::from(i / n) + 0.5) / f64::from(n);
                light.draw(u).length() < r
            });
            let share = hits.count() as f64 / f64::from(n * n);
            let expected = within(r) / within(radius_m);
            // at most the strata that the circle crosses
            assert!(
                (share - expected).abs() < 4.0 / f64::from(n),
                "{r}: {share} {expected}"
            );
        }
        // much wider than the aperture it is uniform
        let wide = BeamLight {
            radius_m,
            profile: BeamProfile::Gaussian { waist_m: 1e6 },
        };
        assert!((wide.flux_factor() / (PI * radius_m * radius_m) - 1.0).abs() < 1e-9);
        let u = DVec2::new(0.3, 0.8);
        let uniform = radius_m * sampling::disk(u.into());
        assert!((wide.draw(u) - uniform).length() < 1e-9 * radius_m);
    }
}
