//! Colors of other primaries as linear sRGB.
//!
//! A color space is given by the chromaticities of its red, green, blue and white (SMPTE RP 177:
//! the three are scaled so that they add up to the white). Another white is adapted to D65 by the
//! Bradford transform (ICC.1:2022, annex E).

use glam::{DMat3, DVec3};

/// Chromaticities x, y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Primaries {
    pub red: [f64; 2],
    pub green: [f64; 2],
    pub blue: [f64; 2],
    pub white: [f64; 2],
}

/// Those of sRGB (IEC 61966-2-1) and BT.709.
pub const SRGB: Primaries = Primaries {
    red: [0.64, 0.33],
    green: [0.30, 0.60],
    blue: [0.15, 0.06],
    white: [0.3127, 0.3290],
};

/// Closer than this, chromaticities are the same: files round them to three digits.
const SAME: f64 = 1e-3;

fn xyz([x, y]: [f64; 2]) -> DVec3 {
    DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
}

impl Primaries {
    fn is(self, other: Self) -> bool {
        let near = |a: [f64; 2], b: [f64; 2]| (0..2).all(|i| (a[i] - b[i]).abs() <= SAME);
        near(self.red, other.red)
            && near(self.green, other.green)
            && near(self.blue, other.blue)
            && near(self.white, other.white)
    }

    fn to_xyz(self) -> Option<DMat3> {
        let columns = [self.red, self.green, self.blue].map(|[x, y]| DVec3::new(x, y, 1.0 - x - y));
        let matrix = DMat3::from_cols(columns[0], columns[1], columns[2]);
        if matrix.determinant().abs() < 1e-6 || self.white[1] < 1e-3 {
            return None;
        }
        let scale = matrix.inverse() * xyz(self.white);
        let matrix = matrix * DMat3::from_diagonal(scale);
        matrix.is_finite().then_some(matrix)
    }

    /// From colors of these primaries to linear sRGB, a change of nothing left out (`Ok(None)`).
    ///
    /// # Errors
    /// The chromaticities span no triangle.
    pub fn to_linear_srgb(self) -> Result<Option<DMat3>, String> {
        if self.is(SRGB) {
            return Ok(None);
        }
        let degenerate = || "its chromaticities are those of no color space".to_owned();
        let from = self.to_xyz().ok_or_else(degenerate)?;
        let to = xyz_to_linear_srgb();
        let map = to * adaptation(xyz(self.white), xyz(SRGB.white)) * from;
        if map.is_finite() {
            Ok(Some(map))
        } else {
            Err(degenerate())
        }
    }
}

/// From X, Y, Z to linear sRGB, white (1, 1, 1) at Y = 1 of D65.
pub fn xyz_to_linear_srgb() -> DMat3 {
    let from = SRGB
        .to_xyz()
        .expect("invariant: the primaries of sRGB span a triangle");
    from.inverse()
}

/// The Bradford transform from one white to another.
fn adaptation(from: DVec3, to: DVec3) -> DMat3 {
    let cones = DMat3::from_cols_array(&[
        0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296,
    ]);
    cones.inverse() * DMat3::from_diagonal((cones * to) / (cones * from)) * cones
}

#[cfg(test)]
mod tests {
    use super::*;

    const P3: Primaries = Primaries {
        red: [0.680, 0.320],
        green: [0.265, 0.690],
        blue: [0.150, 0.060],
        white: [0.3127, 0.3290],
    };

    #[test]
    fn srgb_needs_no_change_and_others_keep_white() {
        assert_eq!(SRGB.to_linear_srgb(), Ok(None));
        let e = Primaries {
            white: [1.0 / 3.0; 2],
            ..P3
        };
        for primaries in [P3, e] {
            let map = primaries.to_linear_srgb().expect("valid").expect("differs");
            assert!((map * DVec3::ONE - DVec3::ONE).length() < 1e-9);
        }
    }

    #[test]
    fn display_p3_by_the_published_matrix() {
        // the rows of P3-D65 to sRGB as CSS Color 4 has them
        let map = P3.to_linear_srgb().expect("valid").expect("differs");
        let red = map * DVec3::X;
        assert!(
            (red - DVec3::new(1.2249, -0.0420, -0.0197)).length() < 2e-4,
            "{red}"
        );
    }

    #[test]
    fn no_triangle_is_an_error() {
        let flat = Primaries {
            green: SRGB.red,
            ..SRGB
        };
        assert!(flat.to_linear_srgb().is_err());
        let black = Primaries {
            white: [0.0, 0.0],
            ..P3
        };
        assert!(black.to_linear_srgb().is_err());
    }
}
