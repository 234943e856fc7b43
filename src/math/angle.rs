//! Sine and cosine for angles that samples are made of: faster than those of a system's library,
//! and the same on every system.
//!
//! The polynomials are those of fdlibm's `__kernel_sin` and `__kernel_cos` (Sun Microsystems 1993),
//! within 2^-57 on [-π/4, π/4].

use std::f64::consts::TAU;

/// Sine and cosine of an angle of at most an eighth of a turn: `radians` in [-π/4, π/4]. Each
/// within one unit in the last place.
#[must_use]
pub fn sin_cos_eighth(radians: f64) -> (f64, f64) {
    let x = radians;
    let z = x * x;
    let s = -2.505_076_025_340_686_3e-8 + z * 1.589_690_995_211_55e-10;
    let s = -1.984_126_982_985_795e-4 + z * (2.755_731_370_707_006_8e-6 + z * s);
    let s = -1.666_666_666_666_663_2e-1 + z * (8.333_333_333_322_49e-3 + z * s);
    let c = 2.087_572_321_298_175e-9 + z * -1.135_964_755_778_819_5e-11;
    let c = 2.480_158_728_947_673e-5 + z * (-2.755_731_435_139_066_3e-7 + z * c);
    let c = 4.166_666_666_666_66e-2 + z * (-1.388_888_888_887_411e-3 + z * c);
    let half = 0.5 * z;
    let w = 1.0 - half;
    (x + x * z * s, w + (((1.0 - w) - half) + z * z * c))
}

/// Sine and cosine of an angle in turns, of magnitude below 2^50. Each within two units in the last
/// place of the larger of the two.
#[must_use]
pub fn sin_cos_turns(turns: f64) -> (f64, f64) {
    let quarters = (4.0 * turns).round();
    // exact: what is left is at most an eighth
    let (sin, cos) = sin_cos_eighth(TAU * (turns - 0.25 * quarters));
    match quarters as i64 & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::{random_bits, unit_f64};
    use std::f64::consts::FRAC_PI_4;

    #[test]
    fn they_are_those_of_the_library() {
        for i in 0..1_000_000 {
            let u = 2.0 * unit_f64(random_bits(7, i)) - 1.0;
            let x = FRAC_PI_4 * u;
            let (sin, cos) = sin_cos_eighth(x);
            assert!((sin - x.sin()).abs() <= f64::EPSILON * x.sin().abs(), "{x}");
            assert!((cos - x.cos()).abs() <= 0.5 * f64::EPSILON, "{x}");
            let (sin, cos) = sin_cos_turns(u);
            let (s, c) = (TAU * u).sin_cos();
            // the angle in radians is rounded itself
            let error = f64::EPSILON * (1.0 + TAU * u.abs());
            assert!((sin - s).abs() <= error && (cos - c).abs() <= error, "{u}");
        }
    }

    #[test]
    fn quarters_are_exact() {
        for (turns, expected) in [
            (0.0, (0.0, 1.0)),
            (0.25, (1.0, 0.0)),
            (0.5, (0.0, -1.0)),
            (0.75, (-1.0, 0.0)),
            (1.0, (0.0, 1.0)),
            (-0.25, (-1.0, 0.0)),
        ] {
            let (sin, cos) = sin_cos_turns(turns);
            assert!(sin == expected.0 && cos == expected.1, "{turns}");
        }
    }
}
