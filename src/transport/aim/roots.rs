//! Roots of functions of one number, by bracketed Newton steps.

use arrayvec::ArrayVec;
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

/// Appends the real roots of c_0 + c_1 x + c_2 x², in order. A double root may be missed.
fn quadratic_roots(c: &[f64; 3], out: &mut ArrayVec<f64, 4>) {
    let square = 0.25 * c[1] * c[1] - c[2] * c[0];
    let far = -0.5 * c[1] - square.sqrt().copysign(c[1]);
    if square > 0.0 {
        let (a, b) = (far / c[2], c[0] / far);
        out.extend([a.min(b), a.max(b)]);
    }
}

/// Appends the real roots of Σ c_i x^i, in order, between the roots `turns` of its derivative,
/// where it is monotone; the last coefficient is not 0.
fn roots_between<const N: usize>(c: &[f64; N], turns: &[f64], out: &mut ArrayVec<f64, 4>) {
    let lead = c[N - 1];
    // Cauchy's bound
    let largest = c[..N - 1].iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let bound = 1.0 + largest / lead.abs();
    let f = |x: f64| {
        let (mut value, mut slope) = (lead, 0.0);
        for i in (0..N - 1).rev() {
            slope = slope * x + value;
            value = value * x + c[i];
        }
        (value, slope)
    };
    let mut low = -bound;
    for high in turns.iter().copied().chain([bound]) {
        out.extend(root(f, low, high));
        low = high;
    }
}

/// The real roots of Σ c_i x^i with `c[4]` not 0, in order. A double root may be missed.
pub(super) fn quartic_roots(c: &[f64; 5]) -> ArrayVec<f64, 4> {
    let slope = [c[1], 2.0 * c[2], 3.0 * c[3], 4.0 * c[4]];
    let curvature = [slope[1], 2.0 * slope[2], 3.0 * slope[3]];
    let (mut bends, mut turns, mut roots) = (ArrayVec::new(), ArrayVec::new(), ArrayVec::new());
    quadratic_roots(&curvature, &mut bends);
    roots_between(&slope, &bends, &mut turns);
    roots_between(c, &turns, &mut roots);
    roots
}
