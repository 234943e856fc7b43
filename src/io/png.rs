//! PNG pictures: for looking at, never for measuring.

use crate::develop::{Development, Display, Picture};
use std::io;

/// Bits per channel of a PNG picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// 8 bits.
    Eight,
    /// 16 bits.
    Sixteen,
}

/// Code points of Display P3 for the chunk cICP (ITU-T H.273): primaries of P3 with white D65, the
/// transfer function of sRGB, red, green and blue over their full range.
const P3_CODE_POINTS: [u8; 4] = [12, 13, 0, 1];

/// A developed picture as PNG, with the chunk that names its colors.
///
/// # Errors
/// The picture has not `width` × `height` pixels.
pub fn picture_bytes(
    (width, height): (u32, u32),
    picture: &Picture,
    display: Display,
    depth: Depth,
) -> io::Result<Vec<u8>> {
    let (bits, data) = match depth {
        Depth::Eight => (png::BitDepth::Eight, picture.bytes_8()),
        Depth::Sixteen => (png::BitDepth::Sixteen, picture.bytes_16()),
    };
    encode((width, height), bits, display, &data)
}

/// Interleaved XYZ values (rows from the top), developed, as PNG of 8 bits.
///
/// # Errors
/// `xyz` has not three values per pixel.
pub fn developed_bytes(
    size: (u32, u32),
    xyz: &[f64],
    development: &Development,
) -> io::Result<Vec<u8>> {
    let picture = development.develop(xyz);
    picture_bytes(size, &picture, development.display, Depth::Eight)
}

/// A PNG image of 8-bit sRGB pixels, rows from the top.
///
/// # Errors
/// `rgb` has not three bytes per pixel.
pub fn png_bytes(width: u32, height: u32, rgb: &[u8]) -> io::Result<Vec<u8>> {
    encode((width, height), png::BitDepth::Eight, Display::Srgb, rgb)
}

fn encode(
    (width, height): (u32, u32),
    bits: png::BitDepth,
    display: Display,
    data: &[u8],
) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(bits);
    if display == Display::Srgb {
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    }
    let mut writer = encoder.write_header().map_err(io::Error::from)?;
    if display == Display::P3 {
        writer
            .write_chunk(png::chunk::cICP, &P3_CODE_POINTS)
            .map_err(io::Error::from)?;
    }
    writer.write_image_data(data).map_err(io::Error::from)?;
    writer.finish().map_err(io::Error::from)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_say_their_colors_and_depth() {
        let xyz = [0.3, 0.4, 0.2, 0.1, 0.1, 0.1];
        for (display, depth) in [
            (Display::Srgb, Depth::Eight),
            (Display::P3, Depth::Eight),
            (Display::P3, Depth::Sixteen),
        ] {
            let development = Development {
                display,
                ..Development::linear(0.0)
            };
            let picture = development.develop(&xyz);
            let bytes = picture_bytes((2, 1), &picture, display, depth).expect("two pixels");
            let mut reader = png::Decoder::new(io::Cursor::new(bytes))
                .read_info()
                .expect("valid");
            let points = reader.info().coding_independent_code_points;
            assert_eq!(points.is_some(), display == Display::P3);
            assert!(points.is_none_or(|p| p.color_primaries == 12 && p.transfer_function == 13));
            assert_eq!(reader.info().srgb.is_some(), display == Display::Srgb);
            let mut pixels = vec![0; reader.output_buffer_size().expect("small")];
            reader.next_frame(&mut pixels).expect("valid");
            let expected = match depth {
                Depth::Eight => picture.bytes_8(),
                Depth::Sixteen => picture.bytes_16(),
            };
            assert_eq!(pixels, expected);
            assert!(
                picture_bytes((3, 1), &picture, display, depth).is_err(),
                "too few pixels"
            );
        }
    }
}
