//! Integrals over wavelength that keep the points of the tables in them.
//!
//! Tables are linear between their points and the observer between whole nanometers. Simpson's rule
//! on the cells between all these points is therefore exact for a table, for a table seen by the
//! observer, and for a product of three tables: a peak narrower than a nanometer has its energy.

/// The cells of a range of wavelengths (nanometers, increasing): broken at `breaks` and at every
/// whole nanometer.
pub(super) fn cells(range_nm: [f64; 2], breaks: &[f64]) -> impl Iterator<Item = (f64, f64)> {
    let [low, high] = range_nm;
    let whole = (low.ceil() as i64..=high.floor() as i64).map(|l| l as f64);
    let mut ends: Vec<f64> = whole
        .chain(breaks.iter().copied())
        .filter(|l| low < *l && *l < high)
        .chain([low, high])
        .collect();
    ends.sort_by(f64::total_cmp);
    ends.dedup();
    (1..ends.len()).map(move |i| (ends[i - 1], ends[i]))
}

/// The integral of `f` over one cell by Simpson's rule, its ends taken inside the cell: `f` may
/// jump there.
pub(super) fn over_cell<const N: usize>(
    (low, high): (f64, f64),
    f: impl Fn(f64) -> [f64; N],
) -> [f64; N] {
    let (a, m, b) = (f(low.next_up()), f(0.5 * (low + high)), f(high.next_down()));
    std::array::from_fn(|c| (high - low) * (a[c] + b[c] + 4.0 * m[c]) / 6.0)
}

/// The integral of `f` over `range_nm` (nanometers), where `knots_nm` are the points of the tables
/// in `f`.
#[must_use]
pub fn integrate<const N: usize>(
    range_nm: [f64; 2],
    knots_nm: &[f64],
    f: impl Fn(f64) -> [f64; N],
) -> [f64; N] {
    let mut total = [0.0; N];
    for cell in cells(range_nm, knots_nm) {
        for (sum, part) in total.iter_mut().zip(over_cell(cell, &f)) {
            *sum += part;
        }
    }
    total
}

#[cfg(test)]
mod tests {
    use super::super::Curve;
    use super::*;

    #[test]
    fn products_of_three_tables_are_exact() {
        // (x - 500)^3 over 500..502 with a knot off the grid, and a triangle of base 0.2 nm
        let [cube] = integrate([500.0, 502.0], &[500.3], |l| [(l - 500.0).powi(3)]);
        assert!((cube - 4.0).abs() < 1e-9, "{cube}");
        let peak = Curve::table(&[531.9, 532.0, 532.1], &[0.0, 10.0, 0.0]);
        let mut knots = Vec::new();
        peak.append_knots_nm(&mut knots);
        let [energy] = integrate([360.0, 830.0], &knots, |l| [peak.eval(l)]);
        assert!((energy - 1.0).abs() < 1e-9, "{energy}");
    }

    #[test]
    fn jumps_at_knots_are_kept() {
        let step = |l: f64| {
            [if (500.25..500.75).contains(&l) {
                2.0
            } else {
                0.0
            }]
        };
        let [area] = integrate([400.0, 700.0], &[500.25, 500.75], step);
        assert!((area - 1.0).abs() < 1e-12, "{area}");
    }
}
