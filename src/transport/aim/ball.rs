//! Refraction by a sphere of one index in another.
//!
//! A chain lies in the plane of its ends and the center. There the impact parameter decides it, and
//! the angle at the center that it turns by is a sum of arc sines, with one minimum at most (their
//! derivatives, times √(r² − h²), rise).

use super::roots::{root, turned_to};
use super::{Far, Points};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub center: DVec3,
    pub radius: f64,
}

/// Plane of a chain: the unit direction of one end, a perpendicular one, and the angle in [0, π] of
/// the other end from the first.
struct ChainPlane {
    x: DVec3,
    y: DVec3,
    gamma: f64,
}

impl ChainPlane {
    /// `None` where the ends are on a common axis: there a circle of chains is possible, a set of
    /// measure 0.
    fn new(first: DVec3, second: DVec3) -> Option<Self> {
        let x = first.try_normalize()?;
        let y = second.reject_from_normalized(x).try_normalize()?;
        // of near-parallel ends the first leaves few digits
        let y = y.reject_from_normalized(x).normalize();
        Some(Self {
            x,
            y,
            gamma: second.dot(y).atan2(second.dot(x)),
        })
    }

    /// The unit direction at an angle from the first end.
    fn direction(&self, angle: f64) -> DVec3 {
        self.x * angle.cos() + self.y * angle.sin()
    }
}

/// θ − asin(k sin θ) for 0 <= k <= 1 from sine and cosine of θ in [0, π/2], and its derivative by
/// θ. `rest` is 1 − k². Without the difference of near-equal angles that an end near the surface
/// would make of it.
pub(super) fn lean((s, c): (f64, f64), k: f64, rest: f64) -> (f64, f64) {
    let cos = (rest + k * k * c * c).sqrt();
    let sine = s * rest / (cos + k * c);
    (sine.min(1.0).asin(), 1.0 - k * c / cos)
}

impl Ball {
    /// From the center, in radii: direction (of any length) of an end, k = 1/distance, and 1 − k².
    fn relative(&self, far: &Far) -> (DVec3, f64, f64) {
        match *far {
            Far::Point(p) => {
                let v = p - self.center;
                let (a, r) = (v.length(), self.radius);
                (v, r / a, (a - r) * (a + r) / (a * a))
            }
            Far::Direction(w) => (w, 0.0, 1.0),
        }
    }

    /// Every chain that enters the ball of relative index `n` > 1, crosses it in `chords` chords
    /// (with a reflection between two) and leaves it. Both ends are outside.
    pub fn across(
        &self,
        n: f64,
        chords: usize,
        far: &Far,
        to: DVec3,
        mut found: impl FnMut(&Points),
    ) {
        let (v_a, k_a, rest_a) = self.relative(far);
        let (v_b, k_b, rest_b) = self.relative(&Far::Point(to));
        let outside = rest_a > 0.0 && rest_b > 0.0;
        let Some(plane) = ChainPlane::new(v_a, v_b).filter(|_| outside && n > 1.0) else {
            return;
        };
        let kappa = chords as f64;
        // by the angle of incidence: what the end x_a and a chord turn by
        let of_end = |theta: f64| lean(theta.sin_cos(), k_a, rest_a);
        let chord = |theta: f64| PI - 2.0 * (theta.sin() / n).asin();
        let turned = |theta: f64| {
            let at = theta.sin_cos();
            let (a, b) = (of_end(theta), lean(at, k_b, rest_b));
            let inner = ((n - 1.0) * (n + 1.0) + at.1 * at.1).sqrt();
            let slope = a.1 + b.1 - 2.0 * kappa * at.1 / inner;
            (a.0 + b.0 + kappa * chord(theta), slope)
        };
        // by the cosine, which is all that it depends on
        let slope = |c: f64| {
            let end = |k: f64, rest: f64| k * c / (rest + k * k * c * c).sqrt();
            let inner = ((n - 1.0) * (n + 1.0) + c * c).sqrt();
            2.0 - end(k_a, rest_a) - end(k_b, rest_b) - 2.0 * kappa * c / inner
        };
        let lowest = if slope(1.0) < 0.0 {
            2.0 * (0.5 * bisect(|x| slope(1.0 - x), 0.0, 1.0)).sqrt().asin()
        } else {
            0.0
        };
        turned_to(plane.gamma, lowest, turned, |side, theta| {
            let (first, chord) = (of_end(theta).0, chord(theta));
            let points = (0..=chords).map(|i| {
                let angle = first + i as f64 * chord;
                self.center + self.radius * plane.direction(side * angle)
            });
            found(&points.collect());
        });
    }

    /// Every chain that leaves the ball of relative index `n` once, between a point inside and an
    /// end outside.
    pub fn through(&self, n: f64, inside: DVec3, outside: &Far, mut found: impl FnMut(&Points)) {
        let (v_b, k_b, rest_b) = self.relative(outside);
        let v_a = inside - self.center;
        let (length, r) = (v_a.length(), self.radius);
        let (a, rest_a) = (length / r, (r - length) * (r + length) / (r * r));
        if rest_a <= 0.0 || rest_b <= 0.0 {
            return;
        }
        // from the center straight out
        let Some(plane) = ChainPlane::new(v_a, v_b) else {
            if a < 1e-14 {
                let p = self.center + self.radius * v_b.normalize();
                found(&Points::from_iter([p]));
            }
            return;
        };
        // total reflection beyond
        let most = if n * a <= 1.0 {
            FRAC_PI_2
        } else {
            (1.0 / (n * a)).asin()
        };
        // `beta`: between the ray at the inner point and the radius there, outward or (`back`)
        // inward
        let inner = |beta: f64, back: bool| {
            let (s, c) = beta.sin_cos();
            if back {
                // π − β − asin(a sin β)
                let cos = (rest_a + a * a * c * c).sqrt();
                let (sine, cosine) = (s * (cos + a * c), a * s * s - c * cos);
                (sine.atan2(cosine), -1.0 - a * c / cos)
            } else {
                lean((s, c), a, rest_a)
            }
        };
        let bent = |beta: f64, back: bool| {
            let (s, c) = beta.sin_cos();
            let sine = (n * a * s).min(1.0);
            let cos = ((1.0 - sine) * (1.0 + sine)).sqrt();
            let (first, outer) = (inner(beta, back), lean((sine, cos), k_b, rest_b));
            (first.0 + outer.0, first.1 + outer.1 * n * a * c / cos)
        };
        let slope = |beta: f64| bent(beta, true).1;
        let lowest = if n * a > 1.0 && slope(0.0) < 0.0 {
            bisect(slope, 0.0, most)
        } else {
            most
        };
        for (low, high, back) in [
            (0.0, most, false),
            (0.0, lowest, true),
            (lowest, most, true),
        ] {
            if low == high {
                continue;
            }
            for (side, target) in [(1.0, plane.gamma), (-1.0, TAU - plane.gamma)] {
                let f = |beta| {
                    let (value, slope) = bent(beta, back);
                    (value - target, slope)
                };
                let Some(beta) = root(f, low, high) else {
                    continue;
                };
                let angle = inner(beta, back).0;
                let p = self.center + self.radius * plane.direction(side * angle);
                found(&Points::from_iter([p]));
            }
        }
    }
}

/// Where a function that is below 0 at `low` stops to be, once.
pub(super) fn bisect(f: impl Fn(f64) -> f64, low: f64, high: f64) -> f64 {
    let (mut a, mut b) = (low, high);
    // the value there is off by the square of this
    for _ in 0..32 {
        let middle = 0.5 * (a + b);
        if f(middle) < 0.0 {
            a = middle;
        } else {
            b = middle;
        }
    }
    0.5 * (a + b)
}
