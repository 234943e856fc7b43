//! The CIE 1931 2 degree standard observer, from its 1 nm table.
//!
//! Linear between the entries and 0 outside 360..830 nm: everything that measures color in this
//! program uses this one function, so that an estimator and a reference sum agree.

use std::sync::LazyLock;

use super::embedded;

/// First wavelength of the observer in nanometers.
pub const FIRST_NM: f64 = 360.0;
/// Last wavelength of the observer in nanometers.
pub const LAST_NM: f64 = 830.0;
/// The 1 nm sum of the y color-matching function: a constant spectrum of 1 has Y = 1 after division
/// by it.
pub const N_Y: f64 = 106.856_917_101_172_03;

static CMF: LazyLock<Vec<[f64; 3]>> = LazyLock::new(|| {
    let columns = embedded::embedded_columns("cie/cmf_1931_2deg.csv");
    (0..=470)
        .map(|i| std::array::from_fn(|c| columns[c].1.eval(FIRST_NM + f64::from(i))))
        .collect()
});

/// The color-matching functions x, y, z at `lambda_nm`; 0 outside 360..830 nm.
#[must_use]
pub fn cmf(lambda_nm: f64) -> [f64; 3] {
    if !(FIRST_NM..=LAST_NM).contains(&lambda_nm) {
        return [0.0; 3];
    }
    let table = &*CMF;
    let x = lambda_nm - FIRST_NM;
    let i = (x as usize).min(table.len() - 2);
    let t = x - i as f64;
    std::array::from_fn(|c| table[i][c] + (table[i + 1][c] - table[i][c]) * t)
}

/// x + y + z at `lambda_nm`: how much a wavelength matters to a picture.
#[must_use]
pub fn cmf_sum(lambda_nm: f64) -> f64 {
    cmf(lambda_nm).iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_standard_one() {
        let sum: f64 = (360..=830).map(|l| cmf(f64::from(l))[1]).sum();
        assert!((sum - N_Y).abs() < 1e-9, "{sum}");
        assert_eq!(cmf(555.0)[1], 1.0);
        assert_eq!(cmf(359.9), [0.0; 3]);
        assert_eq!(cmf(830.1), [0.0; 3]);
        let [half, low, high] = [cmf(500.5), cmf(500.0), cmf(501.0)];
        assert!((0..3).all(|c| (half[c] - 0.5 * (low[c] + high[c])).abs() < 1e-12));
        assert!(cmf(830.0)[0] > 0.0 && cmf(f64::NAN) == [0.0; 3]);
    }
}
