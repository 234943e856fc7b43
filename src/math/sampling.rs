//! Warps of the unit square to other domains, with their densities and, where useful, their
//! inverses.
//!
//! Invariant: each density is that of the warp beside it in the measure named; a warp and its
//! inverse are inverse to each other but for rounding. Directions have their pole at +z.

use super::angle::{sin_cos_eighth, sin_cos_turns};
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_1_PI, FRAC_PI_4, TAU};

/// Density of [`disk`] per area: 1/π inside the unit disk.
pub const DISK_PDF: f64 = FRAC_1_PI;

/// Density of [`uniform_sphere`] per solid angle: 1/4π.
pub const UNIFORM_SPHERE_PDF: f64 = 0.25 * FRAC_1_PI;

/// A uniform point of the unit disk (Shirley and Chiu 1997: concentric, hence of low distortion).
#[must_use]
pub fn disk(u: [f64; 2]) -> DVec2 {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if a == 0.0 && b == 0.0 {
        return DVec2::ZERO;
    }
    if a.abs() > b.abs() {
        let (sin, cos) = sin_cos_eighth(FRAC_PI_4 * (b / a));
        DVec2::new(a * cos, a * sin)
    } else {
        let (sin, cos) = sin_cos_eighth(FRAC_PI_4 * (a / b));
        DVec2::new(b * sin, b * cos)
    }
}

/// The point of the unit square that [`disk`] sends to `p`.
#[must_use]
pub fn disk_inverse(p: DVec2) -> [f64; 2] {
    let r = p.length();
    let (a, b) = if p.x.abs() > p.y.abs() {
        let r = r.copysign(p.x);
        (r, r * (p.y / p.x).atan() / FRAC_PI_4)
    } else if r > 0.0 {
        let r = r.copysign(p.y);
        (r * (p.x / p.y).atan() / FRAC_PI_4, r)
    } else {
        (0.0, 0.0)
    };
    [0.5 * (a + 1.0), 0.5 * (b + 1.0)]
}

/// A direction of the upper hemisphere with density cos θ / π per solid angle (Malley's method).
#[must_use]
pub fn cosine_hemisphere(u: [f64; 2]) -> DVec3 {
    let p = disk(u);
    p.extend((1.0 - p.length_squared()).max(0.0).sqrt())
}

/// Density of [`cosine_hemisphere`] per solid angle, from the signed cosine (0 below).
#[must_use]
pub fn cosine_hemisphere_pdf(cos_theta: f64) -> f64 {
    cos_theta.max(0.0) * FRAC_1_PI
}

/// The point of the unit square that [`cosine_hemisphere`] sends to `w`.
#[must_use]
pub fn cosine_hemisphere_inverse(w: DVec3) -> [f64; 2] {
    disk_inverse(w.truncate())
}

/// A uniform direction.
#[must_use]
pub fn uniform_sphere(u: [f64; 2]) -> DVec3 {
    uniform_cone(u, 2.0)
}

/// The point of the unit square that [`uniform_sphere`] sends to `w`.
#[must_use]
pub fn uniform_sphere_inverse(w: DVec3) -> [f64; 2] {
    uniform_cone_inverse(w, 2.0)
}

/// A uniform direction of the cone around +z whose half-angle ε is given as `1 - cos ε = 2
/// sin²(ε/2)`.
///
/// The parameter keeps its digits for narrow cones, where the cosine has none left.
#[must_use]
pub fn uniform_cone(u: [f64; 2], one_minus_cos: f64) -> DVec3 {
    let below_pole = u[0] * one_minus_cos;
    let sin = (below_pole * (2.0 - below_pole)).max(0.0).sqrt();
    let (sin_phi, cos_phi) = sin_cos_turns(u[1]);
    DVec3::new(sin * cos_phi, sin * sin_phi, 1.0 - below_pole)
}

/// 1 − cos of the angle between unit vectors, as |a − b|²/2: exact where they are near.
#[must_use]
pub fn one_minus_cos(a: DVec3, b: DVec3) -> f64 {
    0.5 * (a - b).length_squared()
}

/// Density of [`uniform_cone`] per solid angle, inside the cone.
#[must_use]
pub fn uniform_cone_pdf(one_minus_cos: f64) -> f64 {
    1.0 / (TAU * one_minus_cos)
}

/// The point of the unit square that [`uniform_cone`] sends to `w`.
#[must_use]
pub fn uniform_cone_inverse(w: DVec3, one_minus_cos: f64) -> [f64; 2] {
    // 1 - cos from the sine where the cosine has lost its digits
    let sin2 = w.x * w.x + w.y * w.y;
    let below_pole = if w.z > 0.0 {
        sin2 / (1.0 + w.z)
    } else {
        1.0 - w.z
    };
    let turn = w.y.atan2(w.x) / TAU;
    [
        below_pole / one_minus_cos,
        if turn < 0.0 { turn + 1.0 } else { turn },
    ]
}

/// Uniform barycentric coordinates of the first two corners of a triangle (Heitz 2019: no square
/// root, low distortion). The density per area is one over the triangle's area.
#[must_use]
pub fn triangle(u: [f64; 2]) -> [f64; 2] {
    if u[1] > u[0] {
        let b = 0.5 * u[0];
        [b, u[1] - b]
    } else {
        let b = 0.5 * u[1];
        [u[0] - b, b]
    }
}

/// The point of the unit square that [`triangle`] sends to the barycentric coordinates `b`.
#[must_use]
pub fn triangle_inverse(b: [f64; 2]) -> [f64; 2] {
    if b[1] > b[0] {
        [2.0 * b[0], b[0] + b[1]]
    } else {
        [b[0] + b[1], 2.0 * b[1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::chi_square::sphere_p_value;
    use proptest::prelude::*;

    fn close(a: [f64; 2], b: [f64; 2]) -> bool {
        (a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9
    }

    proptest! {
        #[test]
        fn warps_and_inverses_agree(x in 1e-6..0.999_999_f64, y in 1e-6..0.999_999_f64) {
            let u = [x, y];
            prop_assert!(close(disk_inverse(disk(u)), u));
            prop_assert!(close(cosine_hemisphere_inverse(cosine_hemisphere(u)), u));
            prop_assert!(close(uniform_sphere_inverse(uniform_sphere(u)), u));
            prop_assert!(close(uniform_cone_inverse(uniform_cone(u, 1e-12), 1e-12), u));
            prop_assert!(close(triangle_inverse(triangle(u)), u));
            let b = triangle(u);
            prop_assert!(b[0] >= 0.0 && b[1] >= 0.0 && b[0] + b[1] <= 1.0);
            prop_assert!((uniform_cone(u, 0.3).length() - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn directions_have_their_densities() {
        let p = |sample: &dyn Fn([f64; 2]) -> DVec3, pdf: &dyn Fn(DVec3) -> f64| {
            sphere_p_value(1, 40_000, |u| Some(sample([u[1], u[2]])), pdf)
        };
        let cosine = p(&cosine_hemisphere, &|w| cosine_hemisphere_pdf(w.z));
        let sphere = p(&uniform_sphere, &|_| UNIFORM_SPHERE_PDF);
        // alpha 0.01 over four tests
        assert!(cosine > 0.0025 && sphere > 0.0025, "{cosine} {sphere}");
        let half = |w: DVec3| {
            if w.z > 0.0 {
                uniform_cone_pdf(1.0)
            } else {
                0.0
            }
        };
        let cone = p(&|u| uniform_cone(u, 1.0), &half);
        assert!(cone > 0.0025, "{cone}");
        let wrong = p(&cosine_hemisphere, &half);
        assert!(wrong < 1e-9, "{wrong}");
    }

    #[test]
    fn triangle_is_uniform() {
        // the first moments of the uniform distribution: E b0 = 1/3, E b0 b1 = 1/12; midpoint grid,
        // error O(1/n)
        let n = 400;
        let (mut first, mut mixed) = (0.0, 0.0);
        for i in 0..n * n {
            let u = [
                (f64::from(i % n) + 0.5) / f64::from(n),
                (f64::from(i / n) + 0.5) / f64::from(n),
            ];
            let b = triangle(u);
            first += b[0];
            mixed += b[0] * b[1];
        }
        let cells = f64::from(n * n);
        assert!((first / cells - 1.0 / 3.0).abs() < 1e-3);
        assert!((mixed / cells - 1.0 / 12.0).abs() < 1e-3);
    }
}
