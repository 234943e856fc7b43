//! A point that shines into a cone with a soft edge.
//!
//! Intensity is full within `falloff_start_rad` of the axis and falls by a smooth step in the
//! cosine, or its square, to 0 at `cone_rad`. Directions are drawn exactly in proportion to it, so
//! every emitted path has the same weight.

use super::{DirectSample, EmissionSample, factor, placed_axis, unit_from_to};
use crate::geometry::{DirectionalDensity, EndPoint, Placement};
use crate::math::angle::sin_cos_turns;
use crate::math::frame::Frame;
use crate::math::sampling::one_minus_cos;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// How intensity falls at the edge: a function of t, which falls from 1 to 0 in proportion to the
/// cosine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Falloff {
    /// 3t² − 2t³.
    #[default]
    SmoothStep,
    /// t² (what the glTF extension KHR_lights_punctual recommends).
    Square,
}

impl Falloff {
    fn at(self, t: f64) -> f64 {
        match self {
            Self::SmoothStep => t * t * (3.0 - 2.0 * t),
            Self::Square => t * t,
        }
    }

    /// Mean over t.
    fn mean(self) -> f64 {
        match self {
            Self::SmoothStep => 0.5,
            Self::Square => 1.0 / 3.0,
        }
    }

    /// The t below which lies the part `u` of its integral.
    fn invert(self, u: f64) -> f64 {
        match self {
            Self::SmoothStep => invert_smooth_step(u),
            Self::Square => u.cbrt().clamp(0.0, 1.0),
        }
    }
}

/// Radiant intensity on the axis of a cone, from the origin of its own space around its +z axis:
/// W/(sr nm), and W/sr per line.
#[derive(Clone, Debug, PartialEq)]
pub struct SpotLight {
    /// Half-angle of the cone in radians, 0 < `cone_rad` <= π.
    pub cone_rad: f64,
    /// Half-angle of full intensity in radians, 0 <= `falloff_start_rad` <= `cone_rad`.
    pub falloff_start_rad: f64,
    /// How it falls between.
    pub falloff: Falloff,
}

/// 1 − cos without cancellation.
fn versine(angle_rad: f64) -> f64 {
    let s = (0.5 * angle_rad).sin();
    2.0 * s * s
}

/// Inverse of `2t³ − t⁴`, the distribution function of the smooth step `3t² − 2t³` on [0, 1].
fn invert_smooth_step(u: f64) -> f64 {
    // t = (u/(2 − t))^(1/3) contracts by at least 3 per step; Newton's method then doubles the
    // digits
    let mut t = 0.5 * u;
    for _ in 0..4 {
        t = (u / (2.0 - t)).cbrt();
    }
    for _ in 0..3 {
        let slope = 2.0 * t * t * (3.0 - 2.0 * t);
        if slope > 0.0 {
            t -= (t * t * t * (2.0 - t) - u) / slope;
        }
    }
    t.clamp(0.0, 1.0)
}

impl SpotLight {
    /// Extent of the falloff in the cosine.
    fn soft_width(&self) -> f64 {
        versine(self.cone_rad) - versine(self.falloff_start_rad)
    }

    /// Cosine of the half-angle beyond which it sends nothing; `None` where that is more than a
    /// right one.
    pub(super) fn cone_cos(&self) -> Option<f64> {
        Some(1.0 - versine(self.cone_rad)).filter(|cos| *cos >= 0.0)
    }

    /// Flux per unit intensity: the integral of the falloff over directions.
    #[must_use]
    pub fn flux_factor(&self) -> f64 {
        TAU * (versine(self.falloff_start_rad) + self.falloff.mean() * self.soft_width())
    }

    /// Intensity relative to the axis, from `v` = 1 − cos of the angle to the axis.
    fn falloff(&self, v: f64) -> f64 {
        if v <= versine(self.falloff_start_rad) {
            return 1.0;
        }
        let t = (versine(self.cone_rad) - v) / self.soft_width();
        if t > 0.0 { self.falloff.at(t) } else { 0.0 }
    }

    fn falloff_along(&self, place: &Placement, direction: DVec3) -> f64 {
        self.falloff(one_minus_cos(direction, placed_axis(place)))
    }

    /// Density per solid angle of the emitted direction.
    pub(super) fn direction_density(&self, place: &Placement, direction: DVec3) -> f64 {
        self.falloff_along(place, direction) / self.flux_factor()
    }

    pub(super) fn sample_emission(
        &self,
        place: &Placement,
        u_dir: DVec2,
    ) -> Option<EmissionSample> {
        let full = versine(self.falloff_start_rad);
        let soft = self.falloff.mean() * self.soft_width();
        let u = u_dir.x * (full + soft);
        let v = if u < full {
            u
        } else {
            versine(self.cone_rad)
                - self.soft_width() * self.falloff.invert(1.0 - (u - full) / soft)
        };
        let sin = (v * (2.0 - v)).max(0.0).sqrt();
        let (y, x) = sin_cos_turns(u_dir.y);
        let axis = Frame::from_z(placed_axis(place));
        let direction = axis
            .to_outer(DVec3::new(sin * x, sin * y, 1.0 - v))
            .normalize();
        let pdf = self.direction_density(place, direction);
        let p = place.to_world.translation;
        (pdf > 0.0).then(|| EmissionSample {
            x0: EndPoint::at(p),
            origin: p,
            direction,
            pdf_x0: 1.0,
            pdf_direction: DirectionalDensity::SolidAngle(pdf),
            weight: factor(self.flux_factor()),
        })
    }

    pub(super) fn sample_direct(&self, place: &Placement, x1: DVec3) -> Option<DirectSample> {
        let p = place.to_world.translation;
        let (toward, distance) = unit_from_to(x1, p)?;
        let falloff = self.falloff_along(place, -toward);
        (falloff > 0.0).then(|| DirectSample {
            x0: EndPoint::at(p),
            toward,
            distance,
            pdf: 1.0,
            value: factor(falloff / (distance * distance)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::posed;
    use super::*;

    const LIGHT: SpotLight = SpotLight {
        cone_rad: 0.6,
        falloff_start_rad: 0.4,
        falloff: Falloff::SmoothStep,
    };

    fn place() -> Placement {
        posed(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.3, -0.5, 0.8))
    }

    #[test]
    fn smooth_step_is_inverted() {
        for i in 0..=1000 {
            let u = f64::from(i) / 1000.0;
            let t = invert_smooth_step(u);
            assert!((t * t * t * (2.0 - t) - u).abs() < 1e-14, "u = {u}");
        }
    }

    #[test]
    fn density_integrates_to_one_and_samples_follow_it() {
        let (light, place) = (LIGHT, place());
        let axis = placed_axis(&place);
        let frame = Frame::from_z(axis);
        // density over the angle to the axis, integrated by the midpoint rule
        let cells = 20_000;
        let at = |v: f64| {
            let sin = (v * (2.0 - v)).sqrt();
            frame.to_outer(DVec3::new(sin, 0.0, 1.0 - v))
        };
        let width = versine(0.7) / f64::from(cells);
        let mut total = 0.0;
        let mut inside = 0.0;
        for i in 0..cells {
            let v = (f64::from(i) + 0.5) * width;
            let p = light.direction_density(&place, at(v)) * TAU * width;
            total += p;
            if v < versine(0.5) {
                inside += p;
            }
        }
        assert!((total - 1.0).abs() < 1e-6, "{total}");
        // the share of stratified samples within 0.5 rad of the axis, to the stratum's width
        let n = 10_000;
        let hits = (0..n)
            .filter_map(|i| {
                let u = DVec2::new((f64::from(i) + 0.5) / f64::from(n), 0.3);
                light.sample_emission(&place, u)
            })
            .filter(|s| 0.5 * (s.direction - axis).length_squared() < versine(0.5))
            .count();
        assert!((hits as f64 / f64::from(n) - inside).abs() < 3e-4);
    }

    #[test]
    fn emission_and_connection_agree() {
        let (light, place) = (LIGHT, place());
        for i in 0..100 {
            let u = DVec2::new((f64::from(i) + 0.5) / 100.0, f64::from(i) * 0.618 % 1.0);
            let s = light.sample_emission(&place, u).unwrap();
            let DirectionalDensity::SolidAngle(pdf) = s.pdf_direction else {
                panic!("measure")
            };
            let direct = light
                .sample_direct(&place, s.origin + 2.0 * s.direction)
                .unwrap();
            // weight × density = intensity = value × d²
            let intensity = f64::from(s.weight[0]) * pdf;
            assert!((intensity - 4.0 * f64::from(direct.value[0])).abs() < 1e-6);
        }
    }

    #[test]
    fn dark_outside_the_cone_and_sharp_edges_work() {
        let place = Placement::IDENTITY;
        let mut light = SpotLight {
            cone_rad: 0.5,
            falloff_start_rad: 0.5,
            falloff: Falloff::SmoothStep,
        };
        assert!(
            light
                .sample_direct(&place, DVec3::new(0.0, 0.0, -1.0))
                .is_none()
        );
        let edge = |a: f64| DVec3::new(a.sin(), 0.0, a.cos());
        assert!(light.sample_direct(&place, edge(0.501)).is_none());
        assert_eq!(
            light.sample_direct(&place, edge(0.499)).unwrap().value[0],
            1.0
        );
        for i in 0..100 {
            let u = DVec2::new(f64::from(i) / 100.0, 0.1);
            assert!(light.sample_emission(&place, u).is_some());
        }
        light.falloff_start_rad = 0.0;
        assert!(light.sample_direct(&place, edge(0.499)).unwrap().value[0] < 1e-3);
    }
}
