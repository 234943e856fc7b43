//! Development: from XYZ to a picture on a display.
//!
//! In this order: chromatic adaptation of the white ([`White`]), exposure ([`Exposure`]), the tone
//! curve ([`ToneCurve`]), gamut mapping at constant Oklab hue and lightness, and the encoding of
//! the display ([`Display`]). A picture is for looking at; measures are taken from XYZ.

mod exposure;
mod gamut;
mod tone;
mod white;

pub use exposure::Exposure;
pub use gamut::into_gamut;
pub use tone::ToneCurve;
pub use white::White;

use crate::math::named::named;
use crate::spectrum::xyz::{xyz_to_linear_p3, xyz_to_linear_srgb};

named! {
    /// Displays, all with white D65 and the transfer function of sRGB (IEC 61966-2-1).
    pub enum Display {
        /// Primaries of BT.709.
        Srgb = "srgb": "Primaries of sRGB",
        /// Primaries of DCI P3.
        P3 = "p3": "Primaries of Display P3, a wider gamut",
    }
}

impl Display {
    /// XYZ (relative to D65, Y = 1 for white) to linear red, green and blue, each 0 to 1 within the
    /// gamut.
    #[must_use]
    pub fn linear(self, xyz: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Srgb => xyz_to_linear_srgb(xyz),
            Self::P3 => xyz_to_linear_p3(xyz),
        }
    }
}

/// The way from XYZ to a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Development {
    /// Brightness.
    pub exposure: Exposure,
    /// The curve from scene to display luminance.
    pub tone: ToneCurve,
    /// Color that appears white.
    pub white: White,
    /// The display.
    pub display: Display,
}

impl Development {
    /// Of cameras: exposure by the picture itself, filmic curve, sRGB.
    pub const PHOTOGRAPH: Self = Self {
        exposure: Exposure::Auto,
        tone: ToneCurve::Filmic,
        white: White::Unadapted,
        display: Display::Srgb,
    };

    /// Of detectors: the largest value is white, values in proportion.
    pub const MEASUREMENT: Self = Self {
        exposure: Exposure::Peak,
        tone: ToneCurve::Linear,
        ..Self::PHOTOGRAPH
    };

    /// Values in proportion, brightened by 2^`ev`.
    #[must_use]
    pub const fn linear(ev: f64) -> Self {
        Self {
            exposure: Exposure::Stops(ev),
            ..Self::MEASUREMENT
        }
    }

    /// The picture of interleaved XYZ values; what is not finite is black.
    #[must_use]
    pub fn develop(&self, xyz: &[f64]) -> Picture {
        let (pixels, _) = xyz.as_chunks::<3>();
        let finite = |p: &[f64; 3]| p.iter().all(|v| v.is_finite());
        let pixels = || pixels.iter().map(|p| if finite(p) { *p } else { [0.0; 3] });
        let adaptation = self.white.adaptation(pixels());
        let adapted = || pixels().map(|p| adaptation.apply(p));
        let stops = self.exposure.stops(adapted().map(|p| p[1]));
        let gain = stops.exp2();
        let mut clipped = 0;
        let mut words = Vec::with_capacity(xyz.len());
        for pixel in adapted() {
            let exposed = pixel.map(|v| v * gain);
            clipped += usize::from(self.tone.clips(exposed[1]));
            let shown = into_gamut(self.tone.apply(exposed), self.display);
            // the cast saturates
            words.extend(shown.map(|v| (encode(v) * 65_535.0).round() as u16));
        }
        Picture {
            stops,
            clipped: clipped as f64 / pixels().len().max(1) as f64,
            words,
        }
    }
}

/// A picture for a display.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Exposure in stops: values were multiplied by 2 to this power.
    pub stops: f64,
    /// Share of the pixels that are brighter than the tone curve can show, 0 to 1.
    pub clipped: f64,
    /// Encoded red, green and blue of each pixel, 65535 for 1.
    pub words: Vec<u16>,
}

impl Picture {
    /// Values in 8 bits.
    #[must_use]
    pub fn bytes_8(&self) -> Vec<u8> {
        let quantize = |&v: &u16| ((u32::from(v) + 128) / 257) as u8;
        self.words.iter().map(quantize).collect()
    }

    /// Values in 16 bits, big-endian as PNG has them.
    #[must_use]
    pub fn bytes_16(&self) -> Vec<u8> {
        self.words.iter().flat_map(|v| v.to_be_bytes()).collect()
    }
}

/// The encoding of sRGB and Display P3 (IEC 61966-2-1) of a linear value in 0..1.
#[must_use]
pub fn encode(linear: f64) -> f64 {
    if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::xyz::{cmf, linear_srgb_to_xyz, xyz_to_oklab};

    #[test]
    fn a_linear_picture_is_that_of_the_standard() {
        let gray = |v: f64| linear_srgb_to_xyz([v; 3]);
        let xyz: Vec<f64> = [0.0, 0.999, 0.5, 0.18, 7.0]
            .into_iter()
            .flat_map(gray)
            .collect();
        let picture = Development::linear(0.0).develop(&xyz);
        let first: Vec<u8> = picture.bytes_8().into_iter().step_by(3).collect();
        assert_eq!(first, [0, 255, 188, 118, 255]);
        assert_eq!(picture.clipped, 0.2);
        let brighter = Development::linear(1.0).develop(&gray(0.09));
        assert_eq!(brighter.bytes_8(), [118; 3]);
        assert_eq!(brighter.bytes_16().len(), 6);
    }

    #[test]
    fn values_that_are_not_finite_are_black() {
        let xyz = [f64::NAN, 1.0, 1.0, f64::INFINITY, 1.0, 1.0, 0.95, 1.0, 1.09];
        let picture = Development::PHOTOGRAPH.develop(&xyz);
        assert_eq!(picture.bytes_8()[..6], [0; 6]);
        assert!(picture.stops.is_finite());
    }

    /// Hue of encoded sRGB in radians.
    fn hue(encoded: &[f64]) -> f64 {
        let decode = |v: f64| {
            if v <= 0.040_45 {
                v / 12.92
            } else {
                ((v + 0.055) / 1.055).powf(2.4)
            }
        };
        let [_, a, b] = xyz_to_oklab(linear_srgb_to_xyz(
            [encoded[0], encoded[1], encoded[2]].map(decode),
        ));
        b.atan2(a)
    }

    #[test]
    fn a_spectrum_is_a_rainbow_without_steps() {
        for tone in [ToneCurve::Linear, ToneCurve::Filmic] {
            let development = Development {
                exposure: Exposure::Peak,
                tone,
                ..Development::PHOTOGRAPH
            };
            let nm = |i: usize| 430.0 + 0.5 * i as f64;
            let xyz: Vec<f64> = (0..=420).flat_map(|i| cmf(nm(i))).collect();
            let picture = development.develop(&xyz);
            let encoded: Vec<f64> = picture
                .words
                .iter()
                .map(|&v| f64::from(v) / 65_535.0)
                .collect();
            let (pixels, _) = encoded.as_chunks::<3>();
            let mut turned = 0.0;
            let mut steps = Vec::new();
            for (i, pair) in pixels.windows(2).enumerate() {
                let [_, a, b] = xyz_to_oklab(cmf(nm(i)));
                let difference = hue(&pair[0]) - b.atan2(a);
                let difference = difference
                    - std::f64::consts::TAU * (difference / std::f64::consts::TAU).round();
                assert!(
                    difference.abs() < 3_f64.to_radians(),
                    "{} nm: {difference}",
                    nm(i)
                );
                let turn = hue(&pair[1]) - hue(&pair[0]);
                let turn = turn - std::f64::consts::TAU * (turn / std::f64::consts::TAU).round();
                // 16 bits of dark pixels tell hues apart to about 1e-3
                assert!(turn < 2e-3, "{} nm: {turn}", nm(i));
                turned += turn;
                let step = |c: usize| (pair[1][c] - pair[0][c]).powi(2);
                steps.push((0..3).map(step).sum::<f64>().sqrt());
            }
            assert!(turned < -3.0, "from blue over green to red: {turned}");
            let largest = steps.iter().copied().fold(0.0, f64::max);
            let mean = steps.iter().sum::<f64>() / steps.len() as f64;
            // linear: green at the peak turns to white and back
            let most = if tone == ToneCurve::Linear { 3.0 } else { 2.0 };
            assert!(
                largest < most * mean,
                "{tone}: {largest} with a mean of {mean}"
            );
        }
    }
}
