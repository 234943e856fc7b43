//! Texels of 8 or 16 bits a channel, with what their file says about their colors.

use super::primaries::Primaries;
use super::{Decoded, Encoding, icc, texels};
use crate::texture::Image;
use glam::DVec3;

/// How encoded values become linear ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transfer {
    /// IEC 61966-2-1.
    Srgb,
    /// The power function with this exponent.
    Power(f64),
    /// ITU-R BT.709 and BT.2020: inverse of the camera's curve.
    Bt709,
}

impl Transfer {
    fn linear(self, v: f64) -> f64 {
        match self {
            Self::Srgb if v <= 0.04045 => v / 12.92,
            Self::Srgb => ((v + 0.055) / 1.055).powf(2.4),
            Self::Power(exponent) => v.powf(exponent),
            // ITU-R BT.709-6, 1.2
            Self::Bt709 if v < 0.081 => v / 4.5,
            Self::Bt709 => ((v + 0.099) / 1.099).powf(1.0 / 0.45),
        }
    }
}

/// Statements of a file about its colors.
#[derive(Clone, Debug, PartialEq)]
pub enum Statement {
    /// Nothing, or that they are sRGB.
    Srgb,
    /// Their curve and primaries.
    Space(Transfer, Primaries),
    /// An ICC profile.
    Profile(Vec<u8>),
}

/// Red, green, blue and coverage of each texel.
#[derive(Clone, Debug)]
pub enum Values {
    Bytes(Vec<[u8; 4]>),
    Words(Vec<[u16; 4]>),
}

impl Values {
    pub fn to_words(&self) -> Vec<[u16; 4]> {
        match self {
            Self::Bytes(values) => values
                .iter()
                .map(|t| t.map(|v| u16::from(v) * 257))
                .collect(),
            Self::Words(values) => values.clone(),
        }
    }
}

/// Decoded texels.
#[derive(Clone, Debug)]
pub struct Raster {
    pub width: u32,
    pub height: u32,
    pub values: Values,
    /// Whether red, green and blue are one gray.
    pub gray: bool,
    pub statement: Statement,
}

impl Raster {
    /// The image, its colors in sRGB.
    pub fn image(self, encoding: Encoding) -> Result<Decoded, String> {
        let Self { width, height, .. } = self;
        let mut notes = Vec::new();
        let values = match (encoding, &self.statement) {
            (Encoding::Linear | Encoding::Srgb, _) | (_, Statement::Srgb) => self.values,
            (_, Statement::Space(transfer, primaries)) => {
                let (values, clipped) = to_srgb(&self.values, *transfer, *primaries)?;
                if let Some((count, first)) = clipped {
                    notes.push(format!(
                        "{} of colors outside sRGB: clipped to its edge",
                        texels(count, first, width)
                    ));
                }
                values
            }
            (_, Statement::Profile(profile)) => icc::to_srgb(&self.values, profile, self.gray)?,
        };
        let srgb = encoding != Encoding::Linear;
        match values {
            Values::Bytes(values) => Image::from_bytes(width, height, values, srgb),
            Values::Words(values) => Image::from_words(width, height, values, srgb),
        }
        .map(|image| Decoded { image, notes })
        .map_err(|e| e.to_string())
    }
}

fn srgb_word(linear: f64) -> u16 {
    let encoded = if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    };
    // the cast saturates
    (encoded * 65535.0).round() as u16
}

/// How many texels left sRGB by more than rounding, and the first.
type Clipped = Option<(usize, usize)>;

fn to_srgb(
    values: &Values,
    transfer: Transfer,
    primaries: Primaries,
) -> Result<(Values, Clipped), String> {
    let map = primaries.to_linear_srgb()?;
    if map.is_none() && transfer == Transfer::Srgb {
        return Ok((values.clone(), None));
    }
    let table: Vec<f64> = match values {
        Values::Bytes(_) => (0..256)
            .map(|i| transfer.linear(f64::from(i) / 255.0))
            .collect(),
        Values::Words(_) => (0..65536)
            .map(|i| transfer.linear(f64::from(i) / 65535.0))
            .collect(),
    };
    let mut clipped: Clipped = None;
    let mut texel = |i: usize, rgb: [usize; 3], a: u16| {
        let mut linear = DVec3::from(rgb.map(|v| table[v]));
        if let Some(map) = map {
            linear = map * linear;
            if linear.min_element() < -1e-3 || linear.max_element() > 1.001 {
                clipped = Some(clipped.map_or((1, i), |(n, first)| (n + 1, first)));
            }
        }
        let [r, g, b] = linear.to_array().map(srgb_word);
        [r, g, b, a]
    };
    let words = match values {
        Values::Bytes(values) => (values.iter().enumerate())
            .map(|(i, &[r, g, b, a])| texel(i, [r, g, b].map(usize::from), u16::from(a) * 257))
            .collect(),
        Values::Words(values) => (values.iter().enumerate())
            .map(|(i, &[r, g, b, a])| texel(i, [r, g, b].map(usize::from), a))
            .collect(),
    };
    Ok((Values::Words(words), clipped))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::image_file::primaries::SRGB;

    #[test]
    fn a_power_curve_becomes_srgb() {
        let raster = Raster {
            width: 1,
            height: 1,
            values: Values::Bytes(vec![[128, 0, 255, 51]]),
            gray: false,
            statement: Statement::Space(Transfer::Power(1.0), SRGB),
        };
        let decoded = raster.clone().image(Encoding::Stated).expect("valid");
        let [r, g, b, a] = decoded.image.texel(0, 0, 0);
        assert!(
            (r - 128.0 / 255.0).abs() < 2e-5 && g == 0.0 && b == 1.0,
            "{r}"
        );
        assert!((a - 0.2).abs() < 1e-6 && decoded.notes.is_empty());
        // where the numbers are no colors, and in glTF, the statement does not count
        let linear = raster.clone().image(Encoding::Linear).expect("valid");
        assert!((linear.image.texel(0, 0, 0)[0] - 128.0 / 255.0).abs() < 1e-6);
        let srgb = raster.image(Encoding::Srgb).expect("valid");
        assert!((srgb.image.texel(0, 0, 0)[0] - 0.2159).abs() < 1e-4);
    }

    #[test]
    fn colors_outside_srgb_are_counted() {
        let p3 = Primaries {
            red: [0.680, 0.320],
            green: [0.265, 0.690],
            ..SRGB
        };
        let raster = Raster {
            width: 2,
            height: 1,
            values: Values::Bytes(vec![[99, 99, 99, 255], [255, 0, 0, 255]]),
            gray: false,
            statement: Statement::Space(Transfer::Srgb, p3),
        };
        let decoded = raster.image(Encoding::Stated).expect("valid");
        assert_eq!(
            decoded.notes,
            ["1 texel, at column 1, row 0 of colors outside sRGB: clipped to its edge"]
        );
        assert_eq!(decoded.image.texel(0, 1, 0), [1.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn camera_curve_is_continuous() {
        for v in [0.081, 1.0] {
            let [low, high] = [v - 1e-9, v].map(|v| Transfer::Bt709.linear(v));
            assert!((low - high).abs() < 1e-4);
        }
    }
}
