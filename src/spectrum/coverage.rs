//! Tables against the range of wavelengths that a scene works in.
//!
//! Beyond its ends a table holds its end values (CIE 15): 380..780 and 400..700 nm are everyday
//! data. Where values that are only held would decide the result, the table does not describe what
//! is rendered.

use super::{Curve, cie, integrate};
use thiserror::Error;

/// The largest share of the working range, by x + y + z, in which values other than 0 may be held.
const MOST_HELD: f64 = 0.1;
/// No spectrum that matters to light begins below this, nanometers; one in micrometers ends there.
const LEAST_NM: f64 = 100.0;

/// Why a table does not do for a range of wavelengths (nanometers).
#[derive(Clone, Debug, PartialEq, Error)]
pub enum CoverageError {
    /// Not one of its values lies in the range.
    #[error(
        "the table has values for {}..{} nm only, none within the working range of {}..{} nm{}",
        .table_nm[0], .table_nm[1], .range_nm[0], .range_nm[1], looks_like_micrometers(*.table_nm)
    )]
    Elsewhere {
        /// Ends of the table.
        table_nm: [f64; 2],
        /// The working range.
        range_nm: [f64; 2],
    },
    /// Too much of the range would be its end values.
    #[error(
        "the table has values for {}..{} nm only; the end values held beyond would be {:.0} % of the working range of {}..{} nm \
         (allowed: at most {:.0} %, or extrapolate = true)",
        .table_nm[0], .table_nm[1], 100.0 * .share, .range_nm[0], .range_nm[1], 100.0 * MOST_HELD
    )]
    Held {
        /// Ends of the table.
        table_nm: [f64; 2],
        /// The working range.
        range_nm: [f64; 2],
        /// Share of the range with held values other than 0, by its weight.
        share: f64,
    },
}

fn looks_like_micrometers([_, last]: [f64; 2]) -> &'static str {
    if last < LEAST_NM {
        " (wavelengths are in nanometers: is it in micrometers?)"
    } else {
        ""
    }
}

/// The stretches of `range_nm` (increasing) beyond the ends of the tables in `curve`, where values
/// are held: none, one below, one above. With `extrapolate`, any share may be held.
///
/// # Errors
/// No value of a table lies in the range, or held values other than 0 make up more than a tenth of
/// it: by x + y + z, and by wavelength where the range is invisible.
pub fn held_stretches(
    curve: &Curve,
    range_nm: [f64; 2],
    extrapolate: bool,
) -> Result<Vec<[f64; 2]>, CoverageError> {
    let Some(table_nm) = curve.table_range_nm() else {
        return Ok(Vec::new());
    };
    let ([low, high], [first, last]) = (range_nm, table_nm);
    if (last < low || high < first) && !extrapolate {
        return Err(CoverageError::Elsewhere { table_nm, range_nm });
    }
    let below = (low < first).then(|| [low, high.min(first)]);
    let above = (last < high).then(|| [low.max(last), high]);
    let stretches: Vec<[f64; 2]> = below.into_iter().chain(above).collect();
    let seen = weight(range_nm, cie::cmf_sum);
    let response = |l: f64| if seen > 0.0 { cie::cmf_sum(l) } else { 1.0 };
    let total = weight(range_nm, response);
    let held = |&[a, b]: &[f64; 2]| {
        if curve.eval(0.5 * (a + b)) == 0.0 {
            0.0
        } else {
            weight([a, b], response)
        }
    };
    let share = stretches.iter().map(held).sum::<f64>() / total;
    if share > MOST_HELD && !extrapolate {
        return Err(CoverageError::Held {
            table_nm,
            range_nm,
            share,
        });
    }
    Ok(stretches)
}

fn weight(range_nm: [f64; 2], response: impl Fn(f64) -> f64) -> f64 {
    let ends = [cie::FIRST_NM, cie::LAST_NM];
    integrate(range_nm, &ends, |l| [response(l)])[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    const VISIBLE: [f64; 2] = [360.0, 830.0];

    fn table(ends: [f64; 2], value: f64) -> Curve {
        Curve::table(&ends, &[value; 2])
    }

    #[test]
    fn everyday_data_pass_and_name_what_is_held() {
        for ends in [[380.0, 780.0], [400.0, 700.0]] {
            let held = held_stretches(&table(ends, 0.5), VISIBLE, false).unwrap();
            assert_eq!(held, [[360.0, ends[0]], [ends[1], 830.0]]);
        }
        assert!(
            held_stretches(&Curve::Constant(1.0), VISIBLE, false)
                .unwrap()
                .is_empty()
        );
    }

    #[test]
    fn held_values_do_not_decide() {
        let green = table([500.0, 600.0], 0.5);
        let error = held_stretches(&green, VISIBLE, false).unwrap_err();
        assert!(matches!(error, CoverageError::Held { share, .. } if share > 0.4 && share < 0.6));
        assert_eq!(held_stretches(&green, VISIBLE, true).unwrap().len(), 2);
        // a laser's table that ends in zeros is right as it is
        let laser = Curve::table(&[531.0, 532.0, 533.0], &[0.0, 1.0, 0.0]);
        assert_eq!(held_stretches(&laser, VISIBLE, false).unwrap().len(), 2);
    }

    #[test]
    fn tables_elsewhere_say_so() {
        let micrometers = held_stretches(&table([0.3, 2.5], 0.5), VISIBLE, false).unwrap_err();
        assert!(
            micrometers.to_string().ends_with("is it in micrometers?)"),
            "{micrometers}"
        );
        let infrared = held_stretches(&table([900.0, 1100.0], 0.5), VISIBLE, false).unwrap_err();
        assert_eq!(
            infrared.to_string(),
            "the table has values for 900..1100 nm only, none within the working range of 360..830 nm"
        );
        // where nothing is visible, wavelengths count alike
        let half = held_stretches(&table([900.0, 1000.0], 0.5), [900.0, 1100.0], false);
        assert!(
            matches!(half, Err(CoverageError::Held { share, .. }) if (share - 0.5).abs() < 1e-12)
        );
    }
}
