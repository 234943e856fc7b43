//! The preview: 8-bit sRGB with a fixed exposure. For looking at, never for measuring.

use super::atomic::{FileError, write_atomic};
use std::io::{self, Write as _};
use std::path::Path;

/// The sRGB encoding of a linear value, as a byte (IEC 61966-2-1). Out of range is cut, not-a-number is black.
#[must_use]
pub fn srgb_byte(linear: f64) -> u8 {
    let encoded = if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    };
    // the cast saturates and makes 0 of not-a-number
    (encoded * 255.0).round() as u8
}

/// Writes interleaved XYZ values (rows from the top) as a PNG image, brightened by 2^`exposure_ev`. `to_linear_srgb` takes
/// XYZ (D65) to linear sRGB.
///
/// # Errors
/// The file cannot be written, or `xyz` has not three values per pixel.
pub fn write_preview(
    path: &Path,
    width: u32,
    height: u32,
    xyz: &[f64],
    exposure_ev: f64,
    to_linear_srgb: impl Fn([f64; 3]) -> [f64; 3],
) -> Result<(), FileError> {
    write_atomic(path, |file| {
        file.write_all(&preview_bytes(
            (width, height),
            xyz,
            exposure_ev,
            to_linear_srgb,
        )?)
    })
}

/// The same as bytes.
///
/// # Errors
/// `xyz` has not three values per pixel.
pub fn preview_bytes(
    (width, height): (u32, u32),
    xyz: &[f64],
    exposure_ev: f64,
    to_linear_srgb: impl Fn([f64; 3]) -> [f64; 3],
) -> io::Result<Vec<u8>> {
    let gain = exposure_ev.exp2();
    let (pixels, _) = xyz.as_chunks::<3>();
    let bytes: Vec<u8> = pixels
        .iter()
        .flat_map(|p| to_linear_srgb(p.map(|v| v * gain)).map(srgb_byte))
        .collect();
    png_bytes(width, height, &bytes)
}

/// A PNG image of 8-bit RGB pixels, rows from the top.
///
/// # Errors
/// `rgb` has not three bytes per pixel.
pub fn png_bytes(width: u32, height: u32, rgb: &[u8]) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header().map_err(io::Error::from)?;
    writer.write_image_data(rgb).map_err(io::Error::from)?;
    writer.finish().map_err(io::Error::from)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoding_of_the_standard() {
        for (linear, byte) in [
            (0.0, 0),
            (1.0, 255),
            (0.5, 188),
            (0.003_130_8, 10),
            (0.18, 118),
            (-3.0, 0),
            (7.0, 255),
            (f64::NAN, 0),
        ] {
            assert_eq!(srgb_byte(linear), byte, "{linear}");
        }
    }

    #[test]
    fn exposure_doubles_per_stop() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("a.png");
        write_preview(
            &path,
            2,
            1,
            &[0.09, 0.09, 0.09, 0.25, 0.25, 0.25],
            1.0,
            |xyz| xyz,
        )
        .expect("writes");
        let decoder = png::Decoder::new(io::BufReader::new(
            std::fs::File::open(&path).expect("there"),
        ));
        let mut reader = decoder.read_info().expect("valid");
        let mut pixels = [0; 6];
        reader.next_frame(&mut pixels).expect("valid");
        assert_eq!(pixels, [118, 118, 118, 188, 188, 188]);
        assert!(
            write_preview(&path, 3, 1, &[0.0; 6], 0.0, |xyz| xyz).is_err(),
            "too few pixels"
        );
    }
}
