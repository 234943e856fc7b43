//! Findings in sentences: each says whether a difference is more than noise.

use super::Outcome;
use super::matrix::BASE;
use super::measure::{Spread, Summary, TARGETS, TimeTo};
use crate::report::readable::{duration, percent};

/// Standard errors that a difference must exceed to be more than noise.
const SIGNIFICANT: f64 = 2.0;

/// When an error is reached.
#[must_use]
pub fn time_to(time: TimeTo) -> String {
    match time {
        TimeTo::Measured { cpu_seconds } => duration(cpu_seconds),
        TimeTo::Extrapolated { cpu_seconds } => format!("about {}", duration(cpu_seconds)),
        TimeTo::NotClaimed => "not claimed".to_owned(),
        TimeTo::Unsteady => "unsteady".to_owned(),
    }
}

/// Ratio of two means and its standard error; `None` for the error where a seed stands alone.
fn ratio(a: Spread, b: Spread) -> (f64, Option<f64>) {
    let relative = |s: Spread| Some(s.error? / s.mean);
    let ratio = a.mean / b.mean;
    let error = relative(a).zip(relative(b));
    (ratio, error.map(|(x, y)| ratio * x.hypot(y)))
}

/// Two significant digits or so.
fn digits(v: f64) -> String {
    match v.abs() {
        a if a >= 10.0 => format!("{v:.0}"),
        a if a >= 1.0 => format!("{v:.1}"),
        a if a >= 0.1 => format!("{v:.2}"),
        a if a >= 0.01 => format!("{v:.3}"),
        _ => format!("{v:.1e}"),
    }
}

/// A measure against another, as words that say whether the difference is more than noise.
#[must_use]
pub fn times(a: Spread, b: Spread) -> String {
    let (ratio, error) = ratio(a, b);
    match error {
        _ if !ratio.is_finite() || ratio <= 0.0 => "cannot be compared".to_owned(),
        None => format!("{} times (one seed: its noise is not known)", digits(ratio)),
        Some(e) if (ratio - 1.0).abs() <= SIGNIFICANT * e => {
            format!("the same within noise ({} ± {})", digits(ratio), digits(e))
        }
        Some(e) => format!("{} ± {} times", digits(ratio), digits(e)),
    }
}

/// The difference to the reference that is no noise.
#[must_use]
pub fn remains(summary: &Summary) -> String {
    if summary.bias_noise > summary.bias.max(1.0) {
        "hidden by noise".to_owned()
    } else if summary.bias <= summary.bias_noise {
        format!("below {}", percent(summary.bias_noise))
    } else {
        percent(summary.bias)
    }
}

/// Findings on each variant, against the scene as it is.
#[must_use]
pub fn sentences(results: &[Outcome], reference_variance: Option<f64>) -> Vec<String> {
    // what is not found at all comes before what it costs to find the rest
    let misses = |r: &Outcome| {
        let words = r.missed.as_ref()?.words();
        (!words.is_empty()).then(|| format!("{} {words}.", r.label))
    };
    let mut out: Vec<String> = results.iter().filter_map(misses).collect();
    out.push(match reference_variance {
        Some(v) => format!(
            "The reference has a relative error of {} itself (from its halves); errors below it are not claimed.",
            percent(v.sqrt())
        ),
        None => "The error of the reference is not known: what is measured against it includes it."
            .to_owned(),
    });
    let Some(base) = results.iter().find(|r| r.id == BASE) else {
        return out;
    };
    for result in results {
        let s = &result.summary;
        let mut text = format!("{}: ", result.label);
        if result.id == BASE {
            let targets: Vec<String> = TARGETS
                .iter()
                .zip(&s.time_to)
                .map(|(t, time)| format!("{}: {}", percent(*t), time_to(*time)))
                .collect();
            text += &format!(
                "relative error {} at the end; CPU time to {}",
                percent(s.final_error.mean),
                targets.join(", ")
            );
        } else {
            let b = &base.summary;
            text += &format!(
                "time per sample {}; time to equal noise {}",
                times(s.pass_seconds, b.pass_seconds),
                times(s.unit_variance_seconds, b.unit_variance_seconds)
            );
        }
        text += &if s.bias_noise > s.bias.max(1.0) {
            "; its noise hides any bias".to_owned()
        } else if s.bias <= s.bias_noise {
            format!("; no bias above {}", percent(s.bias_noise))
        } else {
            format!(
                "; its difference to the reference is {} beyond noise (mean of the image {:+.1} %)",
                percent(s.bias),
                100.0 * (s.mean_ratio - 1.0)
            )
        };
        text.push('.');
        out.push(text);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_within_noise_is_called_so() {
        let spread = |mean, error| Spread { mean, error };
        let text = times;
        let base = spread(1.0, Some(0.1));
        assert!(text(spread(1.2, Some(0.1)), base).contains("within noise"));
        assert_eq!(text(spread(3.0, Some(0.1)), base), "3.0 ± 0.32 times");
        assert!(text(spread(3.0, None), base).contains("not known"));
    }
}
