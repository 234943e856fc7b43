//! Reflections off mirrors whose cross-section is a circle; of one, Alhazen's problem.
//!
//! On the unit circle, with the ends A and B as complex numbers, P = e^{iφ} reflects A to B (or
//! lies on a straight line between them) where Im((A − P)(B − P) P̄²) = 0. That is Im(AB e^{−2iφ} −
//! (A + B) e^{−iφ}) = 0, a quartic in tan(φ/2) with at most four roots. An end at infinity in
//! direction a leaves Im(aB e^{−2iφ} − a e^{−iφ}). Off the outside the angle of reflection θ alone
//! decides: what both ends turn by, θ − asin(sin θ/|A|), rises with it.

use super::ball::lean;
use super::roots::{quartic_roots, root};
use super::surface::Surface;
use super::{Bounce, Far, MAX_CHAIN, Points, around};
use arrayvec::ArrayVec;
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

/// Product of complex numbers.
fn times(a: DVec2, b: DVec2) -> DVec2 {
    DVec2::new(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x)
}

/// `e^{iφ}`.
fn turn(phi: f64) -> DVec2 {
    DVec2::from_angle(phi)
}

/// `e^{iφ}` at eight places, evenly spaced from 1 on.
const EIGHTHS: [DVec2; 8] = {
    const H: f64 = FRAC_1_SQRT_2;
    [
        DVec2::X,
        DVec2::new(H, H),
        DVec2::Y,
        DVec2::new(-H, H),
        DVec2::NEG_X,
        DVec2::new(-H, -H),
        DVec2::NEG_Y,
        DVec2::new(H, -H),
    ]
};

/// Vertices on the unit circle, from the light to the sensor.
pub(super) type Circular = ArrayVec<DVec2, MAX_CHAIN>;

/// An end in the plane of the unit circle.
#[derive(Clone, Copy)]
pub(super) struct FlatEnd {
    /// Where; a direction (of any length) if infinitely far away.
    pub at: DVec2,
    pub is_infinite: bool,
}

impl FlatEnd {
    /// Sine of the angle at point `p` of the circle between its normal and the end, and the
    /// derivative by the angle of `p`.
    fn sine(self, p: DVec2) -> (f64, f64) {
        let t = p.perp();
        if self.is_infinite {
            let u = self.at.normalize();
            return (p.perp_dot(u), t.perp_dot(u));
        }
        let v = self.at - p;
        let length = v.length();
        let sine = p.perp_dot(v) / length;
        (
            sine,
            (t.perp_dot(self.at) + sine * t.dot(v) / length) / length,
        )
    }

    /// k = 1/distance and 1 − k².
    fn inverse(self) -> (f64, f64) {
        if self.is_infinite {
            return (0.0, 1.0);
        }
        let a = self.at.length();
        (1.0 / a, (a - 1.0) * (a + 1.0) / (a * a))
    }
}

/// The reflection off the outside of the unit circle.
fn outside(far: FlatEnd, to: DVec2) -> Option<DVec2> {
    let to = FlatEnd {
        at: to,
        is_infinite: false,
    };
    let ((k_a, rest_a), (k_b, rest_b)) = (far.inverse(), to.inverse());
    if rest_a <= 0.0 || rest_b <= 0.0 {
        return None;
    }
    let gamma = far.at.perp_dot(to.at).atan2(far.at.dot(to.at));
    let f = |theta: f64| {
        let at = theta.sin_cos();
        let (a, b) = (lean(at, k_a, rest_a), lean(at, k_b, rest_b));
        (a.0 + b.0 - gamma.abs(), a.1 + b.1)
    };
    let theta = root(f, 0.0, FRAC_PI_2)?;
    let angle = lean(theta.sin_cos(), k_a, rest_a).0;
    Some(far.at.normalize().rotate(turn(angle * gamma.signum())))
}

/// The points of the unit circle at which the normal halves the angle between the ends or is
/// perpendicular to the line between them: those of reflection are among them.
fn stationary(far: FlatEnd, to: DVec2, mut found: impl FnMut(DVec2)) {
    let FlatEnd {
        at: far_at,
        is_infinite,
    } = far;
    let (second, first) = if is_infinite {
        (times(far_at, to), far_at)
    } else {
        (times(far_at, to), far_at + to)
    };
    // times e^{−iφ} with φ = π i/4
    let back = |z: DVec2, i: usize| times(z, EIGHTHS[(8 - i % 8) % 8]);
    let at = |i: usize| back(second, 2 * i).y - back(first, i).y;
    // φ = π + start is where the function is largest of eight, so that no root is near tan(φ/2) = ∞
    let opposite = (0..8)
        .max_by(|&a, &b| at(a).abs().total_cmp(&at(b).abs()))
        .unwrap_or(0);
    let start = (opposite + 4) % 8;
    let (c2, c1) = (back(second, 2 * start), back(first, start));
    let quartic = [
        c2.y - c1.y,
        -4.0 * c2.x + 2.0 * c1.x,
        -6.0 * c2.y,
        4.0 * c2.x + 2.0 * c1.x,
        c2.y + c1.y,
    ];
    if quartic[4] == 0.0 {
        return;
    }
    let near = FlatEnd {
        at: to,
        is_infinite: false,
    };
    for t in quartic_roots(&quartic) {
        let half = DVec2::new(1.0, t).normalize();
        let mut p = times(EIGHTHS[start], times(half, half));
        // coefficients are differences of what is large near the circle
        for _ in 0..2 {
            let (a, b) = (far.sine(p), near.sine(p));
            let step = -(a.0 + b.0) / (a.1 + b.1);
            if step.abs() < 1e-6 {
                p = p.rotate(turn(step)).normalize();
            }
        }
        found(p);
    }
}

/// Calls `found` with every candidate for a chain of `count` reflections off a sphere or cylinder,
/// from outside (one) or inside.
pub(super) fn solve(
    bounce: &Bounce,
    count: usize,
    far: &Far,
    to: DVec3,
    mut found: impl FnMut(&Points),
) {
    let candidates = |far: FlatEnd, to: DVec2, each: &mut dyn FnMut(&Circular)| {
        let mut one = |p: DVec2| each(&Circular::from_iter([p]));
        match (bounce.from_above, count) {
            (true, _) => outside(far, to).into_iter().for_each(one),
            (false, 1) => stationary(far, to, &mut one),
            (false, _) => around::solve(count, far, to, each),
        }
    };
    match bounce.surface {
        Surface::Sphere { center, radius } => {
            let b = (to - center) / radius;
            let (a, is_infinite) = match *far {
                Far::Point(x) => ((x - center) / radius, false),
                Far::Direction(w) => (w, true),
            };
            let (Some(x), across) = (a.try_normalize(), b.reject_from(a)) else {
                return;
            };
            // on a common axis the solutions are a circle, and the two on it a set of measure 0
            let Some(y) = across.try_normalize() else {
                return;
            };
            let y = y.reject_from_normalized(x).normalize();
            let flat = |v: DVec3| DVec2::new(v.dot(x), v.dot(y));
            let end = FlatEnd {
                at: flat(a),
                is_infinite,
            };
            candidates(end, flat(b), &mut |chain| {
                let lift = |p: &DVec2| center + radius * (p.x * x + p.y * y);
                found(&chain.iter().map(lift).collect());
            });
        }
        Surface::Cylinder {
            center,
            axis,
            radius,
            ..
        } => {
            let (x, y) = axis.any_orthonormal_pair();
            let flat = |v: DVec3| DVec2::new(v.dot(x), v.dot(y));
            let b = flat((to - center) / radius);
            let z_b = (to - center).dot(axis);
            let (a, is_infinite) = match *far {
                Far::Point(x) => (flat((x - center) / radius), false),
                Far::Direction(w) => (flat(w), true),
            };
            let end = FlatEnd { at: a, is_infinite };
            candidates(end, b, &mut |chain| {
                // normals have no part along the axis: heights divide as the lengths across it
                let (first, last) = (chain[0], chain[count - 1]);
                let chord = chain.get(1).map_or(0.0, |p| p.distance(first));
                let across = |i: usize| b.distance(last) + (count - 1 - i) as f64 * chord;
                let rise = match *far {
                    Far::Point(x) => {
                        let z_a = (x - center).dot(axis);
                        (z_a - z_b) / (a.distance(first) + across(0))
                    }
                    Far::Direction(w) => w.dot(axis) / a.length() * radius,
                };
                let lift = |(i, p): (usize, &DVec2)| {
                    center + radius * (p.x * x + p.y * y) + axis * (z_b + rise * across(i))
                };
                found(&chain.iter().enumerate().map(lift).collect());
            });
        }
        Surface::Plane { .. } | Surface::Quadric(_) | Surface::Mesh(_) | Surface::Triangle(_) => {}
    }
}
