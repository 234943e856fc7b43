//! The illuminant that colors of images and lights are relative to.

use super::embedded::embedded_columns;
use super::{Curve, xyz};
use std::sync::LazyLock;

static D65: LazyLock<Curve> = LazyLock::new(|| {
    let columns = embedded_columns("cie/D65.csv");
    columns
        .into_iter()
        .next()
        .expect("invariant: D65 has a column")
        .1
});
static D65_UNIT_FACTOR: LazyLock<f64> = LazyLock::new(|| 1.0 / xyz::curve_to_xyz(&D65)[1]);

/// CIE illuminant D65, 100 at 560 nm.
#[must_use]
pub fn d65() -> &'static Curve {
    &D65
}

/// The factor that gives [`d65`] Y = 1.
#[must_use]
pub fn d65_unit_factor() -> f64 {
    *D65_UNIT_FACTOR
}
