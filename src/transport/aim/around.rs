//! Reflections in a row along the inside of a mirror whose cross-section is a circle.
//!
//! In the unit circle all chords of a chain have one distance h from the center, and each turns by
//! 2 acos h. An end at distance a from the center is on the line of its chord, before its middle or
//! behind it: it turns by acos h ± acos(h/a), + alone where it is outside. With n reflections both
//! ends are apart by 2n acos h ± acos(h/a) ± acos(h/b), up to whole turns, to one side or the
//! other. Times √(1 − h²) the derivative by h is
//! −2n ∓ √((1 − h²)/(a² − h²)) ∓ √((1 − h²)/(b² − h²)), which rises where it is not below 0
//! throughout: there is one minimum at most.

use super::ball::{bisect, lean};
use super::circle::{Circular, FlatEnd};
use super::roots::turned_to;
use glam::DVec2;
use std::f64::consts::FRAC_PI_2;

/// Distance from the center below which an end is in it, where every chord has its middle there.
const CENTER: f64 = 1e-14;

/// An end as chords see it.
#[derive(Clone, Copy)]
struct ChordEnd {
    /// Distance from the center; infinite where the end is.
    distance: f64,
    /// Whether it lies before the middle of its chord, seen from the chain.
    is_near: bool,
}

/// Square r² − h² and the rise of asin(h/r) with ψ, for h = `most` sin ψ <= r and the cosine of ψ.
fn rise(r: f64, most: f64, c: f64) -> (f64, f64) {
    let rest = (r - most) * (r + most) + most * most * c * c;
    let slope = if rest > 0.0 {
        most * c / rest.sqrt()
    } else {
        1.0
    };
    (rest, slope)
}

/// Half the angle of a chord, acos h.
fn half_chord((s, c): (f64, f64), most: f64) -> f64 {
    rise(1.0, most, c).0.sqrt().atan2(most * s)
}

/// Derivative of that by ψ.
fn fall(c: f64, most: f64) -> f64 {
    -rise(1.0, most, c).1
}

impl ChordEnd {
    /// Angle at the center between the end and the vertex next to it, from sine and cosine of ψ and
    /// half the angle of a chord.
    fn turn(self, (s, c): (f64, f64), most: f64, half: f64) -> f64 {
        let a = self.distance;
        if !a.is_finite() {
            return half + FRAC_PI_2;
        }
        let rest = rise(a, most, c).0;
        if self.is_near {
            let end = (most * s / a, rest.sqrt() / a);
            lean(end, a, (1.0 - a) * (1.0 + a)).0
        } else {
            half + rest.sqrt().atan2(most * s)
        }
    }

    /// Derivative of that by ψ.
    fn slope(self, c: f64, most: f64) -> f64 {
        let fall = fall(c, most);
        if !self.distance.is_finite() {
            return fall;
        }
        let slope = rise(self.distance, most, c).1;
        if self.is_near {
            fall + slope
        } else {
            fall - slope
        }
    }
}

/// Calls `found` with every chain of `count` reflections between two ends in the plane of the unit
/// circle.
pub(super) fn solve(count: usize, far: FlatEnd, to: DVec2, mut found: impl FnMut(&Circular)) {
    let a = if far.is_infinite {
        f64::INFINITY
    } else {
        far.at.length()
    };
    let b = to.length();
    // from the center and back to it
    if a.min(b) < CENTER {
        let Some(axis) = if a < b { to } else { far.at }.try_normalize() else {
            return;
        };
        for side in [1.0, -1.0] {
            let vertex = |i: usize| axis * if i.is_multiple_of(2) { side } else { -side };
            found(&(0..count).map(vertex).collect());
        }
        return;
    }
    let most = a.min(b).min(1.0);
    let gamma = far.at.perp_dot(to).atan2(far.at.dot(to));
    let start = far.at.normalize();
    let inner = 2.0 * (count as f64 - 1.0);
    let places = |distance: f64| {
        [false, true]
            .into_iter()
            .filter(move |&is_near| !is_near || distance <= 1.0)
            .map(move |is_near| ChordEnd { distance, is_near })
    };
    for first in places(a) {
        for last in places(b) {
            let slope_at =
                |c: f64| first.slope(c, most) + last.slope(c, most) + inner * fall(c, most);
            let turned = |psi: f64| {
                let at = psi.sin_cos();
                let half = half_chord(at, most);
                let ends = first.turn(at, most, half) + last.turn(at, most, half);
                (ends + inner * half, slope_at(at.1))
            };
            let slope = |psi: f64| slope_at(psi.cos());
            let lowest = if slope(0.0) >= 0.0 {
                0.0
            } else if slope(FRAC_PI_2) <= 0.0 {
                FRAC_PI_2
            } else {
                bisect(slope, 0.0, FRAC_PI_2)
            };
            turned_to(gamma, lowest, turned, |side, psi| {
                let at = psi.sin_cos();
                let half = half_chord(at, most);
                let (angle, chord) = (first.turn(at, most, half), 2.0 * half);
                let vertex = |i: usize| {
                    let angle = side * (angle + i as f64 * chord);
                    start.rotate(DVec2::from_angle(angle))
                };
                found(&(0..count).map(vertex).collect());
            });
        }
    }
}
