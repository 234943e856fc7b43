//! Roots of functions of one number, by bracketed Newton steps.

use std::f64::consts::{FRAC_PI_2, TAU};

/// Halvings and steps until a bracket is as narrow as rounding.
const MOST_STEPS: usize = 200;

/// The root in `[low, high]` of a function with values of opposite signs there (or 0); `f` gives
/// value and derivative. Newton's step where it stays inside the bracket and shrinks, else the
/// middle. `None` where the signs agree.
pub(super) fn root(f: impl Fn(f64) -> (f64, f64), low: f64, high: f64) -> Option<f64> {
    let (mut a, mut b) = (low, high);
    let (fa, fb) = (f(a).0, f(b).0);
    if fa == 0.0 {
        return Some(a);
    }
    if fb == 0.0 {
        return Some(b);
    }
    if fa.signum() == fb.signum() || !(fa.is_finite() && fb.is_finite()) {
        return None;
    }
    let rises = fb > 0.0;
    let mut x = 0.5 * (a + b);
    let mut step = b - a;
    for _ in 0..MOST_STEPS {
        let (value, slope) = f(x);
        if value == 0.0 {
            return Some(x);
        }
        if (value > 0.0) == rises {
            b = x;
        } else {
            a = x;
        }
        let newton = x - value / slope;
        let next = if newton > a && newton < b && (newton - x).abs() < 0.5 * step {
            newton
        } else {
            0.5 * (a + b)
        };
        step = (next - x).abs();
        x = next;
        if step <= 0.5 * f64::EPSILON * x.abs() || !(a < x && x < b) {
            break;
        }
    }
    Some(x)
}

/// Calls `found(side, x)` for every x in [0, π/2] at which an angle is `side` γ (1 or −1), up to
/// whole turns; `angle` gives value and derivative, and is monotone up to `lowest` and from there.
pub(super) fn turned_to(
    gamma: f64,
    lowest: f64,
    angle: impl Fn(f64) -> (f64, f64),
    mut found: impl FnMut(f64, f64),
) {
    for (low, high) in [(0.0, lowest), (lowest, FRAC_PI_2)] {
        if low == high {
            continue;
        }
        let (one, two) = (angle(low).0, angle(high).0);
        let (least, most) = (one.min(two), one.max(two));
        for side in [1.0, -1.0] {
            let wanted = side * gamma;
            let first = ((least - wanted) / TAU).ceil() as i32;
            let last = ((most - wanted) / TAU).floor() as i32;
            for turns in first..=last {
                let target = wanted + TAU * f64::from(turns);
                let f = |x| {
                    let (value, slope) = angle(x);
                    (value - target, slope)
                };
                if let Some(x) = root(f, low, high) {
                    found(side, x);
                }
            }
        }
    }
}

/// Appends the real roots of Σ c_i x^i, of degree up to 4 with `c[degree]` not 0, in order. Between
/// the roots of the derivative the polynomial is monotone. A double root may be missed.
pub(super) fn polynomial_roots(c: &[f64], out: &mut arrayvec::ArrayVec<f64, 4>) {
    let degree = c.len() - 1;
    if degree == 0 {
        return;
    }
    let lead = c[degree];
    if degree == 1 {
        out.push(-c[0] / lead);
        return;
    }
    if degree == 2 {
        let square = 0.25 * c[1] * c[1] - lead * c[0];
        let far = -0.5 * c[1] - square.sqrt().copysign(c[1]);
        if square > 0.0 {
            let (a, b) = (far / lead, c[0] / far);
            out.extend([a.min(b), a.max(b)]);
        }
        return;
    }
    let derivative: arrayvec::ArrayVec<f64, 4> = c
        .iter()
        .enumerate()
        .skip(1)
        .map(|(i, v)| i as f64 * v)
        .collect();
    let mut turns = arrayvec::ArrayVec::new();
    polynomial_roots(&derivative, &mut turns);
    // Cauchy's bound
    let bound = 1.0
        + c[..degree]
            .iter()
            .fold(0.0, |m: f64, v| m.max((v / lead).abs()));
    let f = |x: f64| {
        c.iter()
            .rev()
            .fold((0.0, 0.0), |(v, d), &k| (v * x + k, d * x + v))
    };
    let mut low = -bound;
    for high in turns.into_iter().chain([bound]) {
        if let Some(x) = root(f, low, high) {
            out.push(x);
        }
        low = high;
    }
}
