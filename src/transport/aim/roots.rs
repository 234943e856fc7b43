//! Roots of functions of one number, by bracketed Newton steps.

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
