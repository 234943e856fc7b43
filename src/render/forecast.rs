//! Price of the next digit: the estimated error of a render at doubling numbers of passes, and the
//! time to a smaller one.

use super::ErrorEstimate;
use crate::math::convergence::{Point, Trend, trend};
use std::time::Duration;

/// Pixels that must carry the error for a forecast: the square of the error, and so the time, is
/// then known to 12 %.
const LEAST_EFFECTIVE_PIXELS: f64 = 50.0;
/// Passes before the estimate of the error is worth keeping.
const LEAST_PASSES: u64 = 4;

/// Rates of the long run: 1/2 for independent samples, 1/3 where the noise is that of cones that
/// shrink with the passes (variance in proportion to N^-1 ε^-2, ε to N^(-1/6)). What falls faster
/// has filled strata, and will not go on so.
const RATES: [f64; 2] = [1.0 / 3.0, 0.5];

/// Errors of a render as its passes double.
#[derive(Clone, Debug, Default)]
pub struct ErrorHistory {
    points: Vec<Point>,
}

/// Knowledge of the time to a smaller error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Forecast {
    /// Too few passes.
    Unknown,
    /// The error does not fall steadily.
    Unsteady,
    /// Time that it takes in all.
    Takes {
        /// Passes.
        passes: f64,
        /// Their time.
        time: Duration,
    },
}

impl ErrorHistory {
    /// After a pass, `passes` in all: keeps the error where their number has doubled. `error` is
    /// asked for only then.
    pub fn after_pass(&mut self, passes: u64, error: impl FnOnce() -> Option<f64>) {
        if passes < LEAST_PASSES || !passes.is_power_of_two() {
            return;
        }
        if let Some(error) = error() {
            self.points.push(Point {
                work: passes as f64,
                error,
            });
        }
    }

    /// Time that an error of `target` takes, for a render that has the error `error` after `passes`
    /// passes of the mean length `per_pass`.
    #[must_use]
    pub fn forecast(
        &self,
        passes: u64,
        error: &ErrorEstimate,
        per_pass: Duration,
        target: f64,
    ) -> Forecast {
        match trend(&self.points) {
            Trend::Unknown => Forecast::Unknown,
            Trend::Unsteady => Forecast::Unsteady,
            Trend::Steady { .. } if error.effective_pixels < LEAST_EFFECTIVE_PIXELS => {
                Forecast::Unsteady
            }
            Trend::Steady { rate } => {
                let rate = rate.clamp(RATES[0], RATES[1]);
                let passes = passes as f64 * (error.relative / target).powf(1.0 / rate);
                Duration::try_from_secs_f64(passes * per_pass.as_secs_f64())
                    .map_or(Forecast::Unknown, |time| Forecast::Takes { passes, time })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn history(error: impl Fn(u64) -> f64) -> ErrorHistory {
        let mut history = ErrorHistory::default();
        for passes in 1..=100 {
            history.after_pass(passes, || Some(error(passes)));
        }
        history
    }

    fn estimate(relative: f64, effective_pixels: f64) -> ErrorEstimate {
        ErrorEstimate {
            relative,
            of_all_pixels: relative,
            effective_pixels,
        }
    }

    #[test]
    fn half_the_error_takes_four_times_as_long() {
        let history = history(|p| 0.08 / (p as f64).sqrt());
        assert_eq!(history.points.len(), 5, "4, 8, 16, 32, 64");
        let per_pass = Duration::from_millis(480);
        let forecast = history.forecast(100, &estimate(0.008, 1000.0), per_pass, 0.004);
        let Forecast::Takes { passes, time } = forecast else {
            panic!("steady");
        };
        assert!((passes - 400.0).abs() < 1e-6 && (time.as_secs_f64() - 192.0).abs() < 1e-6);
        // the same from a handful of pixels
        let few = history.forecast(100, &estimate(0.008, 9.0), per_pass, 0.004);
        assert_eq!(few, Forecast::Unsteady);
    }

    #[test]
    fn fireflies_are_unsteady() {
        let history = history(|p| {
            if p >= 32 {
                0.5
            } else {
                0.08 / (p as f64).sqrt()
            }
        });
        let (error, second) = (estimate(0.5, 1000.0), Duration::from_secs(1));
        let forecast = history.forecast(100, &error, second, 0.25);
        assert_eq!(forecast, Forecast::Unsteady);
        let few = ErrorHistory::default().forecast(2, &error, second, 0.25);
        assert_eq!(few, Forecast::Unknown);
    }
}
