//! Running moments and the p-values of the usual tests.
//!
//! Welford's update and Chan, Golub and LeVeque's merge (1983) for the moments. The tail
//! probabilities come from the incomplete gamma and beta functions (series and continued fractions,
//! Abramowitz and Stegun 6.5.29, 6.5.31, 26.5.8).

/// Mean and variance of a stream of numbers; mergeable, numerically stable.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// How many numbers were pushed.
    pub count: u64,
    /// Their mean (0 when there is none).
    pub mean: f64,
    /// Sum of squared deviations from the mean.
    m2: f64,
}

impl Moments {
    /// Adds one number.
    pub fn push(&mut self, x: f64) {
        self.count += 1;
        let delta = x - self.mean;
        self.mean += delta / self.count as f64;
        self.m2 += delta * (x - self.mean);
    }

    /// Adds all numbers of another accumulator.
    pub fn merge(&mut self, other: &Self) {
        if other.count == 0 {
            return;
        }
        let (a, b) = (self.count as f64, other.count as f64);
        let delta = other.mean - self.mean;
        self.count += other.count;
        self.mean += delta * b / (a + b);
        self.m2 += other.m2 + delta * delta * a * b / (a + b);
    }

    /// Unbiased sample variance; infinite with fewer than two numbers.
    #[must_use]
    pub fn variance(&self) -> f64 {
        if self.count < 2 {
            f64::INFINITY
        } else {
            self.m2 / (self.count - 1) as f64
        }
    }

    /// Standard error of the mean; infinite with fewer than two numbers.
    #[must_use]
    pub fn standard_error(&self) -> f64 {
        (self.variance() / self.count.max(1) as f64).sqrt()
    }
}

/// Probability that a standard normal number lies farther from 0 than `z`.
#[must_use]
pub fn normal_p_value(z: f64) -> f64 {
    gamma_q(0.5, 0.5 * z * z)
}

/// Probability that Student's t with `dof` degrees of freedom lies farther from 0 than `t`.
#[must_use]
pub fn student_t_p_value(t: f64, dof: f64) -> f64 {
    beta_i(0.5 * dof, 0.5, dof / (dof + t * t))
}

/// Probability that chi-square with `dof` degrees of freedom exceeds `statistic`.
#[must_use]
pub fn chi_square_p_value(statistic: f64, dof: f64) -> f64 {
    gamma_q(0.5 * dof, 0.5 * statistic)
}

/// Pearson's test of counts against expectations of equal sum: the p-value. Cells expected to hold
/// fewer than five are merged; one degree of freedom is lost to the sum. A count where nothing was
/// expected gives 0.
#[must_use]
pub fn chi_square_test(observed: &[f64], expected: &[f64]) -> f64 {
    let mut cells: Vec<(f64, f64)> = expected
        .iter()
        .copied()
        .zip(observed.iter().copied())
        .collect();
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut statistic, mut used) = (0.0, 0_u32);
    let (mut want, mut got) = (0.0, 0.0);
    for (e, o) in cells {
        // a cell that cannot be hit is not merged away; expectations come from quadrature, hence
        // the tolerance
        if e <= 1e-9 && o > 0.0 {
            return 0.0;
        }
        want += e;
        got += o;
        if want >= 5.0 {
            statistic += (got - want) * (got - want) / want;
            used += 1;
            (want, got) = (0.0, 0.0);
        }
    }
    if used < 2 {
        return 1.0;
    }
    chi_square_p_value(statistic, f64::from(used - 1))
}

/// Level of each of `tests` independent tests that together have level `alpha` (Šidák).
#[must_use]
pub fn sidak(alpha: f64, tests: usize) -> f64 {
    1.0 - (1.0 - alpha).powf(1.0 / tests as f64)
}

/// Logarithm of Γ(x) for x > 0: Stirling's series after shifting the argument above 10.
fn ln_gamma(mut x: f64) -> f64 {
    let mut shift = 1.0;
    while x < 10.0 {
        shift *= x;
        x += 1.0;
    }
    let r = 1.0 / (x * x);
    let series =
        (1.0 / 12.0 - r * (1.0 / 360.0 - r * (1.0 / 1260.0 - r * (1.0 / 1680.0 - r / 1188.0)))) / x;
    (x - 0.5) * x.ln() - x + 0.5 * std::f64::consts::TAU.ln() + series - shift.ln()
}

/// The smallest step of a continued fraction that still counts, and the most terms it is given.
const STEP: f64 = 1e-15;
const TERMS: usize = 10_000;

/// `b0 + a1/(b1 + a2/(b2 + ...))` by the modified Lentz method; `term(i)` is `(a_i, b_i)`, i = 1,
/// 2, ...
fn continued_fraction(b0: f64, term: impl Fn(f64) -> (f64, f64)) -> f64 {
    let nonzero = |x: f64| if x == 0.0 { 1e-300 } else { x };
    let mut value = nonzero(b0);
    let (mut c, mut d) = (value, 0.0);
    for i in 1..TERMS {
        let (a, b) = term(i as f64);
        d = 1.0 / nonzero(b + a * d);
        c = nonzero(b + a / c);
        value *= c * d;
        if (c * d - 1.0).abs() < STEP {
            break;
        }
    }
    value
}

/// Regularized upper incomplete gamma function Q(a, x).
fn gamma_q(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > STEP * sum {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        1.0 - front * sum
    } else {
        front / continued_fraction(x + 1.0 - a, |i| (-i * (i - a), x + 2.0 * i + 1.0 - a))
    }
}

/// Regularized incomplete beta function I_x(a, b).
fn beta_i(a: f64, b: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if x >= 1.0 {
        return 1.0;
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - beta_i(b, a, 1.0 - x);
    }
    let ln_front =
        a * x.ln() + b * (-x).ln_1p() + ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) - a.ln();
    let fraction = continued_fraction(1.0, |i| {
        let m = (0.5 * i).floor();
        let numerator = if i % 2.0 == 0.0 {
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
        } else {
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
        };
        (numerator, 1.0)
    });
    ln_front.exp() / fraction
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

    #[test]
    fn moments_match_two_passes_and_merge() {
        let xs: Vec<f64> = (0..1000)
            .map(|i| 1e6 + f64::from(i * 7919 % 1000))
            .collect();
        let mean = xs.iter().sum::<f64>() / 1000.0;
        let variance = xs.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 999.0;
        let (mut all, mut a, mut b) = (Moments::default(), Moments::default(), Moments::default());
        for (i, &x) in xs.iter().enumerate() {
            all.push(x);
            if i < 300 { a.push(x) } else { b.push(x) }
        }
        a.merge(&b);
        for m in [all, a] {
            assert!((m.mean - mean).abs() < 1e-8 && (m.variance() - variance).abs() < 1e-5);
        }
        assert!((all.standard_error() - (variance / 1000.0).sqrt()).abs() < 1e-9);
        assert_eq!(Moments::default().variance(), f64::INFINITY);
    }

    #[test]
    fn p_values_match_a_reference() {
        for dof in [1.0, 2.0, 7.0, 30.0, 500.0] {
            for x in [0.1, 0.9, 1.0, 1.3, 3.0, 9.0] {
                let chi = ChiSquared::new(dof).unwrap();
                let got = chi_square_p_value(x * dof, dof);
                assert!((got - chi.sf(x * dof)).abs() < 1e-9, "chi2 {dof} {x} {got}");
                let t = StudentsT::new(0.0, 1.0, dof).unwrap();
                let got = student_t_p_value(x, dof);
                assert!((got - 2.0 * t.sf(x)).abs() < 1e-9, "t {dof} {x} {got}");
            }
        }
        assert!((normal_p_value(1.959_963_984_540_054) - 0.05).abs() < 1e-12);
        assert!((normal_p_value(6.0) / 1.973_175_290_075_396e-9 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn chi_square_test_merges_and_rejects() {
        assert!(chi_square_test(&[10.0, 10.0, 0.0, 1.0], &[10.0, 10.0, 0.4, 0.6]) > 0.9);
        assert!(chi_square_test(&[90.0, 110.0], &[100.0, 100.0]) > 0.1);
        assert!(chi_square_test(&[60.0, 140.0], &[100.0, 100.0]) < 1e-6);
        assert_eq!(
            chi_square_test(&[100.0, 100.0, 1.0], &[100.5, 100.5, 0.0]),
            0.0
        );
        assert!((sidak(0.01, 10) - 0.001_004_5).abs() < 1e-7);
    }
}
