//! Tone curves: from the luminance of a scene to that of a display.

use crate::math::named::named;
use crate::spectrum::xyz::{linear_srgb_to_xyz, xyz_to_linear_srgb};
use glam::{DMat3, DVec3};
use std::sync::LazyLock;

named! {
    /// Curves from exposed values (middle gray 0.18) to what the display shows (0 to 1).
    pub enum ToneCurve {
        /// Luminance in proportion, cut at white.
        Linear = "linear": "In proportion, cut at white",
        /// Of luminance alone, so that hues stay (Lottes 2016, "Advanced techniques and
        /// optimization of VDR color pipelines"): keeps middle gray, rolls off towards white four
        /// and a half stops above it.
        Filmic = "filmic": "Rolls off towards white; hues stay",
        /// Per channel in inset primaries over 16.5 stops, after Sobotka's AgX: bright saturated
        /// colors turn towards white on the way, as film does.
        Agx = "agx": "Per channel over 16.5 stops; bright colors turn towards white",
    }
}

/// Contrast and shoulder of the filmic curve, the gray it keeps, and the luminance it shows as
/// white.
const CONTRAST: f64 = 1.2;
const SHOULDER: f64 = 0.97;
const MIDDLE: f64 = 0.18;
const WHITE: f64 = 4.0;

/// `b` and `c` of `y^a / (y^(a d) b + c)`, by which 0.18 stays and [`WHITE`] becomes 1.
static FILMIC: LazyLock<[f64; 2]> = LazyLock::new(|| {
    let (a, d) = (CONTRAST, SHOULDER);
    // y^a = shown (y^(a d) b + c) at both points: two linear equations
    let row = |y: f64, shown: f64| [y.powf(a * d), 1.0, y.powf(a) / shown];
    let ([p, q, r], [s, t, u]) = (row(MIDDLE, MIDDLE), row(WHITE, 1.0));
    let determinant = p * t - q * s;
    [(r * t - q * u) / determinant, (p * u - r * s) / determinant]
});

fn filmic(y: f64) -> f64 {
    let [b, c] = *FILMIC;
    let y = y.clamp(0.0, WHITE);
    y.powf(CONTRAST) / (y.powf(CONTRAST * SHOULDER) * b + c)
}

/// Stops of AgX's curve below and above 1.
const AGX_EV: [f64; 2] = [-12.473_93, 4.026_069];

/// AgX's primaries as linear sRGB has them: each is inset towards the others.
static AGX_INSET: LazyLock<[DMat3; 2]> = LazyLock::new(|| {
    let inset = DMat3::from_cols_array_2d(&[
        [
            0.842_479_062_253_094,
            0.042_328_242_261_012_3,
            0.042_375_654_905_705_1,
        ],
        [0.078_433_599_999_999_2, 0.878_468_636_469_772, 0.078_433_6],
        [
            0.079_223_745_147_764_3,
            0.079_166_127_460_543_3,
            0.879_142_973_793_104,
        ],
    ]);
    [inset, inset.inverse()]
});

/// AgX's default contrast over the logarithm in 0..1, as a polynomial (Wrensch 2023, "Minimal AgX
/// implementation": error below 4e-4), decoded by the power 2.2.
fn agx_contrast(x: f64) -> f64 {
    let coefficients = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.002_32];
    let encoded = coefficients.into_iter().fold(0.0, |sum, c| sum * x + c);
    encoded.clamp(0.0, 1.0).powf(2.2)
}

fn agx(xyz: [f64; 3]) -> [f64; 3] {
    let [inset, outset] = &*AGX_INSET;
    let [low, high] = AGX_EV;
    let curve = |v: f64| {
        let stops = v.max(low.exp2()).log2();
        agx_contrast(((stops - low) / (high - low)).clamp(0.0, 1.0))
    };
    let channels = *inset * DVec3::from_array(xyz_to_linear_srgb(xyz));
    linear_srgb_to_xyz((*outset * DVec3::from_array(channels.to_array().map(curve))).to_array())
}

impl ToneCurve {
    /// Display color of exposed XYZ: Y at most 1, the color not yet within a gamut.
    #[must_use]
    pub fn apply(self, xyz: [f64; 3]) -> [f64; 3] {
        let y = xyz[1];
        let shown = match self {
            Self::Linear => y.min(1.0),
            Self::Filmic => filmic(y),
            Self::Agx => return agx(xyz),
        };
        if y > 0.0 {
            xyz.map(|v| v * shown / y)
        } else {
            [0.0; 3]
        }
    }

    /// Whether the curve shows a luminance as it shows all brighter ones.
    #[must_use]
    pub fn clips(self, y: f64) -> bool {
        y > match self {
            Self::Linear => 1.0,
            Self::Filmic => WHITE,
            Self::Agx => AGX_EV[1].exp2(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_rise_from_black_to_white() {
        for tone in <ToneCurve as crate::math::named::Named>::ALL {
            let shown = |y: f64| tone.apply(linear_srgb_to_xyz([y; 3]))[1];
            let mut last = shown(0.0);
            assert!(last.abs() < 1e-4, "{tone}: {last}");
            for i in 0..400 {
                let y = (-13.0 + 0.05 * f64::from(i)).exp2();
                let next = shown(y);
                // the polynomial of AgX dips by less than its error at its ends
                assert!(
                    next > last - 1e-4 && next < 1.0 + 1e-6,
                    "{tone} at {y}: {last} {next}"
                );
                last = next;
            }
            assert!(last > 0.97, "{tone}: {last}");
        }
    }

    #[test]
    fn middle_gray_stays_and_slope_there_is_the_contrast() {
        assert!((filmic(0.18) - 0.18).abs() < 1e-12);
        assert!((filmic(4.0) - 1.0).abs() < 1e-12);
        let slope = (filmic(0.181) / filmic(0.179)).ln() / (0.181_f64 / 0.179).ln();
        assert!((0.9..1.2).contains(&slope), "{slope}");
        // AgX shows middle gray a quarter of a stop brighter
        let gray = ToneCurve::Agx.apply(linear_srgb_to_xyz([0.18; 3]))[1];
        assert!((gray - 0.214).abs() < 0.002, "{gray}");
    }

    #[test]
    fn luminance_curves_keep_chromaticity() {
        let xyz = [0.4, 0.9, 0.1];
        for tone in [ToneCurve::Linear, ToneCurve::Filmic] {
            let shown = tone.apply(xyz.map(|v| 3.0 * v));
            assert!((shown[0] / shown[1] - 0.4 / 0.9).abs() < 1e-12);
        }
    }
}
