//! The GGX distribution of micro-normals with Smith's height-correlated masking-shadowing.
//!
//! Walter, Marschner, Li, Torrance 2007 (distribution); Heitz 2014 (anisotropy, correlation); Dupuy
//! and Benyoub 2023 (visible normals as a spherical cap). Only squares of components enter, so both
//! sides of the surface are treated alike. Quotients by cosines are kept together: all functions
//! stay finite at grazing angles.

use crate::math::angle::sin_cos_turns;
use glam::DVec3;
use std::f64::consts::FRAC_1_PI;

/// GGX with roughness along the two tangents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    /// Roughness along x and y, in (0, 1].
    pub alpha: [f64; 2],
}

impl Ggx {
    /// Density of micro-normals per area and solid angle: ∫ D |m.z| dm = 1 over a hemisphere.
    #[must_use]
    pub fn d(&self, m: DVec3) -> f64 {
        let [ax, ay] = self.alpha;
        let (x, y) = (m.x / ax, m.y / ay);
        let e = x * x + y * y + m.z * m.z;
        FRAC_1_PI / (ax * ay * e * e)
    }

    /// Length of the direction in the space where the surface is a hemisphere of roughness 1:
    /// `|w.z| (1 + 2 Λ(w))`.
    fn stretched(&self, w: DVec3) -> f64 {
        let (x, y) = (self.alpha[0] * w.x, self.alpha[1] * w.y);
        (x * x + y * y + w.z * w.z).sqrt()
    }

    /// `G₂ / (|a.z| |b.z|)` with G₂ = 1/(1 + Λ(a) + Λ(b)). The same form serves transmission.
    #[must_use]
    pub fn g2_over_cosines(&self, a: DVec3, b: DVec3) -> f64 {
        2.0 / (self.stretched(a) * b.z.abs() + self.stretched(b) * a.z.abs())
    }

    /// `G₂/G₁(given)`: of the light of `given` that facets send to `w`, on either side, the share
    /// that no other facet is in the way of.
    #[must_use]
    pub fn unmasked(&self, given: DVec3, w: DVec3) -> f64 {
        let first = given.z.abs() + self.stretched(given);
        0.5 * first * w.z.abs() * self.g2_over_cosines(given, w)
    }

    /// Density per solid angle of the micro-normals visible from `w`: `G₁(w) D(m) |w·m| / |w.z|`.
    /// The caller sees to it that `m` faces `w`.
    #[must_use]
    pub fn visible_pdf(&self, w: DVec3, m: DVec3) -> f64 {
        self.d(m) * w.dot(m).abs() * 2.0 / (w.z.abs() + self.stretched(w))
    }

    /// A micro-normal visible from `w` (w.z > 0), with density [`Ggx::visible_pdf`].
    #[must_use]
    pub fn sample_visible(&self, w: DVec3, u: [f64; 2]) -> DVec3 {
        let [ax, ay] = self.alpha;
        let hemisphere_w = DVec3::new(ax * w.x, ay * w.y, w.z).normalize();
        let z = (1.0 - u[1]) * (1.0 + hemisphere_w.z) - hemisphere_w.z;
        let sin = (1.0 - z * z).max(0.0).sqrt();
        let (sin_phi, cos_phi) = sin_cos_turns(u[0]);
        let h = DVec3::new(sin * cos_phi, sin * sin_phi, z) + hemisphere_w;
        DVec3::new(ax * h.x, ay * h.y, h.z.max(0.0)).normalize_or(DVec3::Z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::chi_square::{integrate_cells, sphere_p_value};
    use crate::math::stats::sidak;

    #[test]
    fn projected_area_is_one() {
        for alpha in [[0.1, 0.1], [0.5, 0.5], [1.0, 1.0], [0.2, 0.7]] {
            let ggx = Ggx { alpha };
            let area: f64 = integrate_cells(&|m| ggx.d(m) * m.z.max(0.0)).iter().sum();
            assert!((area - 1.0).abs() < 1e-4, "{alpha:?} {area}");
        }
    }

    #[test]
    fn visible_normals_have_their_density() {
        let alphas = [[0.1, 0.1], [0.6, 0.6], [0.15, 0.8]];
        let angles = [0.0_f64, 45.0, 87.0];
        let level = sidak(0.01, alphas.len() * angles.len());
        for alpha in alphas {
            for angle in angles {
                let (sin, cos) = angle.to_radians().sin_cos();
                let w = DVec3::new(0.8 * sin, -0.6 * sin, cos);
                let ggx = Ggx { alpha };
                let pdf = |m: DVec3| {
                    if m.z > 0.0 && w.dot(m) > 0.0 {
                        ggx.visible_pdf(w, m)
                    } else {
                        0.0
                    }
                };
                let p = sphere_p_value(
                    7,
                    20_000,
                    |u| Some(ggx.sample_visible(w, [u[0], u[1]])),
                    &pdf,
                );
                assert!(p > level, "{alpha:?} {angle}: p = {p}");
            }
        }
    }
}
