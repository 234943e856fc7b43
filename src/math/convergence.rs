//! How an error falls as work is added: the power law through a curve of errors, whether it is
//! steady, and what it promises.
//!
//! Errors of Monte Carlo estimates fall as (work)^(-1/2), of stratified ones a little faster, of
//! regularized ones whose cones shrink a little slower. A curve that is dominated by rare large
//! values falls by jumps: it is not steady and promises nothing.

/// Rates between neighbors on a curve that count as steady.
const STEADY_RATES: std::ops::RangeInclusive<f64> = 0.2..=1.0;
/// Points, the last ones, that a fit looks at: a factor of 8 in work where each doubles it.
const FIT_POINTS: usize = 4;
/// Points without which nothing can be said.
const LEAST_POINTS: usize = 3;

/// One point of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Seconds, passes, or any other measure of work; > 0.
    pub work: f64,
    /// The error reached with it; > 0.
    pub error: f64,
}

/// Verdict of a curve on its future.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trend {
    /// Too few points.
    Unknown,
    /// The error does not fall steadily.
    Unsteady,
    /// The error falls as work^(-rate).
    Steady {
        /// Exponent, > 0.
        rate: f64,
    },
}

/// The trend of the end of a curve, points in order of work.
#[must_use]
pub fn trend(points: &[Point]) -> Trend {
    let valid = |p: &&Point| p.work > 0.0 && p.error > 0.0 && p.error.is_finite();
    let points: Vec<(f64, f64)> = points
        .iter()
        .filter(valid)
        .map(|p| (p.work.ln(), p.error.ln()))
        .collect();
    let last = &points[points.len().saturating_sub(FIT_POINTS)..];
    if last.len() < LEAST_POINTS {
        return Trend::Unknown;
    }
    let rate = |w: &[(f64, f64)]| (w[0].1 - w[1].1) / (w[1].0 - w[0].0);
    if last.windows(2).any(|w| !STEADY_RATES.contains(&rate(w))) {
        return Trend::Unsteady;
    }
    // least squares through the logarithms
    let n = last.len() as f64;
    let mean = |f: fn(&(f64, f64)) -> f64| last.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let (mut xx, mut xy) = (0.0, 0.0);
    for p in last {
        xx += (p.0 - x).powi(2);
        xy += (p.0 - x) * (p.1 - y);
    }
    Trend::Steady { rate: -xy / xx }
}

/// The work at which a curve reaches a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reach {
    /// Between two points of the curve, or before its first (its work is then an upper bound).
    Within(f64),
    /// Beyond its end, if it goes on at its rate.
    Beyond(f64),
    /// The curve does not tell.
    Unknown,
}

/// Where a curve falls to `target` for good.
#[must_use]
pub fn reach(points: &[Point], target: f64) -> Reach {
    let Some(last) = points.last() else {
        return Reach::Unknown;
    };
    if last.error > target {
        return match trend(points) {
            Trend::Steady { rate } => {
                Reach::Beyond(last.work * (last.error / target).powf(1.0 / rate))
            }
            _ => Reach::Unknown,
        };
    }
    match points.iter().rposition(|p| p.error > target) {
        None => Reach::Within(points[0].work),
        Some(i) => {
            let (a, b) = (points[i], points[i + 1]);
            let share = (a.error / target).ln() / (a.error / b.error).ln();
            // an error of 0 is reached at its point
            let share = if share.is_finite() && b.error > 0.0 {
                share
            } else {
                1.0
            };
            Reach::Within(a.work * (b.work / a.work).powf(share))
        }
    }
}

/// The error after some work, between the points of a curve; beyond its ends that of the end.
/// `None` without points.
#[must_use]
pub fn error_at(points: &[Point], work: f64) -> Option<f64> {
    let after = points.iter().position(|p| p.work >= work);
    match after {
        None => points.last().map(|p| p.error),
        Some(0) => Some(points[0].error),
        Some(i) => {
            let (a, b) = (points[i - 1], points[i]);
            let share = (work / a.work).ln() / (b.work / a.work).ln();
            Some(a.error * (b.error / a.error).powf(share))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(error: impl Fn(f64) -> f64) -> Vec<Point> {
        (0..7)
            .map(|i| {
                let work = f64::from(1 << i);
                Point {
                    work,
                    error: error(work),
                }
            })
            .collect()
    }

    #[test]
    fn a_power_law_is_found_and_continued() {
        for rate in [0.33, 0.5, 0.7] {
            let points = curve(|w| 0.3 * w.powf(-rate));
            let Trend::Steady { rate: found } = trend(&points) else {
                panic!("steady at {rate}");
            };
            assert!((found - rate).abs() < 1e-12);
            let Reach::Beyond(work) = reach(&points, 0.01) else {
                panic!("beyond the end");
            };
            assert!((work / 30_f64.powf(1.0 / rate) - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn jumps_are_unsteady_and_promise_nothing() {
        let points = curve(|w| if w == 16.0 { 0.5 } else { w.powf(-0.5) });
        assert_eq!(trend(&points), Trend::Unsteady);
        assert_eq!(reach(&points, 1e-3), Reach::Unknown);
        assert_eq!(trend(&curve(|_| 0.1)), Trend::Unsteady);
        assert_eq!(trend(&points[..2]), Trend::Unknown);
        assert_eq!(reach(&[], 0.1), Reach::Unknown);
    }

    #[test]
    fn errors_between_points_lie_on_the_line() {
        let points = curve(|w| 0.3 * w.powf(-0.5));
        let error = error_at(&points, 11.0).unwrap();
        assert!((error - 0.3 / 11_f64.sqrt()).abs() < 1e-12);
        assert_eq!(error_at(&points, 0.1), Some(0.3));
        assert_eq!(error_at(&points, 1e3), Some(0.3 / 8.0));
        assert_eq!(error_at(&[], 1.0), None);
    }

    #[test]
    fn within_the_curve_points_are_joined() {
        let points = curve(|w| w.powf(-0.5));
        let Reach::Within(work) = reach(&points, 0.3) else {
            panic!("within");
        };
        assert!((work - 1.0 / 0.09).abs() < 1e-9);
        assert_eq!(reach(&points, 2.0), Reach::Within(1.0));
        // what rises again has not been reached for good
        let rising = curve(|w| if w == 16.0 { 0.9 } else { w.powf(-0.5) });
        let Reach::Within(work) = reach(&rising, 0.3) else {
            panic!("within");
        };
        assert!(work > 16.0);
    }
}
