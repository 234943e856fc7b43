//! Images for textures and environments: PNG and JPEG (8 bits a channel are kept), OpenEXR.
//!
//! The kind is told by the first bytes, not by the name. Sizes are checked against a limit, and against what so few bytes
//! can hold, before anything of that size is allocated.

use super::exr::{ExrImage, decode as decode_exr};
use crate::texture::{Image, MAX_TEXELS};
use std::io::Cursor;
use std::path::Path;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Largest image file.
pub const MAX_IMAGE_BYTES: u64 = 1 << 30;
/// No PNG or JPEG describes more texels by a byte (deflate packs at most 1032 to 1; two bits of a JPEG say 64).
const MAX_TEXELS_PER_BYTE: u64 = 8192;
/// Most samples of an OpenEXR image.
const MAX_SAMPLES: u64 = 1 << 29;

/// An image from the bytes of a file. Bytes are taken as sRGB-encoded where `srgb`, else as linear; OpenEXR is linear.
///
/// # Errors
/// What is wrong, in words, without the file's name.
pub fn decode(bytes: &[u8], srgb: bool) -> Result<Image, String> {
    decode_limited(bytes, srgb, MAX_TEXELS, MAX_SAMPLES)
}

fn decode_limited(bytes: &[u8], srgb: bool, texels: u64, samples: u64) -> Result<Image, String> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => png(bytes, srgb, texels),
        [0xff, 0xd8, ..] => jpeg(bytes, srgb, texels),
        [0x76, 0x2f, 0x31, 0x01, ..] => open_exr(bytes, samples),
        _ => Err("not an image (allowed: PNG, JPEG, OpenEXR)".to_owned()),
    }
}

/// Decodes any bytes: must not panic, nor allocate more than some megabytes.
pub fn fuzz_image(bytes: &[u8]) {
    // the outcome does not matter
    _ = decode_limited(bytes, true, 1 << 20, 1 << 20);
}

fn check_size(width: u64, height: u64, bytes: usize, limit: u64) -> Result<(), String> {
    let texels = width.saturating_mul(height);
    if texels == 0 || texels > limit {
        return Err(format!(
            "{width} x {height} texels (allowed: 1 to {limit} in all)"
        ));
    }
    if texels > (bytes as u64).saturating_mul(MAX_TEXELS_PER_BYTE) {
        return Err(format!(
            "claims {width} x {height} texels in {bytes} bytes: truncated or damaged"
        ));
    }
    Ok(())
}

fn png(bytes: &[u8], srgb: bool, limit: u64) -> Result<Image, String> {
    let text = |e: png::DecodingError| format!("not a readable PNG image ({e})");
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let mut reader = decoder.read_info().map_err(text)?;
    let (width, height) = reader.info().size();
    check_size(width.into(), height.into(), bytes.len(), limit)?;
    let size = reader
        .output_buffer_size()
        .ok_or_else(|| "too large a PNG image".to_owned())?;
    let mut buffer = vec![0; size];
    let frame = reader.next_frame(&mut buffer).map_err(text)?;
    let samples = frame.color_type.samples();
    let values = buffer
        .chunks_exact(samples)
        .map(|t| match *t {
            [v] => [v, v, v, 255],
            [v, a] => [v, v, v, a],
            [r, g, b] => [r, g, b, 255],
            [r, g, b, a, ..] => [r, g, b, a],
            [] => [0; 4],
        })
        .collect();
    Image::from_bytes(width, height, values, srgb).map_err(|e| e.to_string())
}

fn jpeg(bytes: &[u8], srgb: bool, limit: u64) -> Result<Image, String> {
    let text = |e: &dyn std::fmt::Debug| format!("not a readable JPEG image ({e:?})");
    let options = DecoderOptions::default()
        .set_max_width(1 << 16)
        .set_max_height(1 << 16)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| text(&e))?;
    let info = decoder.info().ok_or_else(|| text(&"no image header"))?;
    let (width, height) = (info.width, info.height);
    check_size(width.into(), height.into(), bytes.len(), limit)?;
    let rgb = decoder.decode().map_err(|e| text(&e))?;
    let values = rgb
        .as_chunks::<3>()
        .0
        .iter()
        .map(|&[r, g, b]| [r, g, b, 255])
        .collect();
    Image::from_bytes(width.into(), height.into(), values, srgb).map_err(|e| e.to_string())
}

fn open_exr(bytes: &[u8], samples: u64) -> Result<Image, String> {
    let image = decode_exr(Path::new("image"), bytes, samples)
        .map_err(|e| e.to_string().trim_start_matches("image: ").to_owned())?;
    let channel = |name: &str| image.channels.iter().find(|c| c.name == name);
    let channels = match (channel("R"), channel("G"), channel("B"), channel("Y")) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        (None, None, None, Some(y)) if channel("X").is_none() => [y, y, y],
        _ => return Err("no channels R, G, B".to_owned()),
    };
    let ExrImage { crop, .. } = &image;
    let (width, height) = (crop.x1 - crop.x0, crop.y1 - crop.y0);
    let values = (0..channels[0].values.len())
        // negative values are leftovers of filters or of another gamut
        .map(|i| channels.map(|c| c.values[i].max(0.0)))
        .collect();
    Image::from_floats(width, height, values).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encode(color: png::ColorType, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
        encoder.set_color(color);
        let mut writer = encoder.write_header().expect("header");
        writer.write_image_data(data).expect("data");
        writer.finish().expect("end");
        bytes
    }

    #[test]
    fn png_of_every_kind() {
        let read = |color, data: &[u8]| decode(&encode(color, data), false).expect("valid");
        let gray = read(png::ColorType::Grayscale, &[0, 255]);
        assert_eq!(gray.texel(0, 1, 0), [1.0; 4]);
        let alpha = read(png::ColorType::GrayscaleAlpha, &[0, 0, 255, 51]);
        assert_eq!(alpha.texel(0, 1, 0), [1.0, 1.0, 1.0, 0.2]);
        let rgba = read(png::ColorType::Rgba, &[0, 0, 0, 0, 255, 0, 51, 255]);
        assert_eq!(rgba.texel(0, 1, 0), [1.0, 0.0, 0.2, 1.0]);
    }

    #[test]
    fn what_is_no_image_is_an_error() {
        for (bytes, message) in [
            (&b"GIF89a"[..], "not an image"),
            (b"\x89PNG\r\n\x1a\n", "not a readable PNG"),
            (b"\xff\xd8\xff", "not a readable JPEG"),
            (b"\x76\x2f\x31\x01", "not a readable OpenEXR"),
        ] {
            let error = decode(bytes, true).expect_err("damaged");
            assert!(error.starts_with(message), "{error}");
        }
        let mut huge = encode(png::ColorType::Grayscale, &[0, 255]);
        huge[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
        assert!(decode(&huge, true).is_err());
    }
}
