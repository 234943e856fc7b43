//! PNG images, with the chunks that say what their colors are (PNG, third edition, 4.3: cICP before
//! iCCP before sRGB before gAMA and cHRM).

use super::color::{Raster, Statement, Transfer, Values};
use super::primaries::{Primaries, SRGB};
use super::{Decoded, Encoding, Limits, check_size};
use png::{BitDepth, ColorType, DecodeOptions, Decoder, Info, Transformations};
use std::io::Cursor;

/// The gAMA chunk that writers put beside sRGB, or in its place.
const GAMMA_OF_SRGB: u32 = 45455;

pub fn decode(bytes: &[u8], encoding: Encoding, limits: Limits) -> Result<Decoded, String> {
    let text = |e: png::DecodingError| {
        let reason = named_chunks(&e.to_string());
        format!("not a readable PNG image ({reason})")
    };
    let mut options = DecodeOptions::default();
    options.set_ignore_checksums(false);
    options.set_skip_ancillary_crc_failures(false);
    let mut decoder = Decoder::new_with_options(Cursor::new(bytes), options);
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(text)?;
    let (width, height) = reader.info().size();
    check_size(width.into(), height.into(), bytes.len(), limits)?;
    let size = reader
        .output_buffer_size()
        .ok_or_else(|| "too large a PNG image".to_owned())?;
    let mut buffer = vec![0; size];
    let frame = reader.next_frame(&mut buffer).map_err(text)?;
    // a file that is cut behind its texels is cut short as well
    reader.finish().map_err(text)?;
    if let Some(key) = transparent_gray(reader.info()) {
        for texel in buffer.as_chunks_mut::<2>().0 {
            texel[1] = if texel[0] == key { 0 } else { u8::MAX };
        }
    }
    let statement = match encoding {
        Encoding::Stated => statement(reader.info())?,
        Encoding::Srgb | Encoding::Linear => Statement::Srgb,
    };
    let samples = frame.color_type.samples();
    let values = if frame.bit_depth == BitDepth::Sixteen {
        let words: Vec<u16> = (buffer.as_chunks::<2>().0.iter())
            .map(|&b| u16::from_be_bytes(b))
            .collect();
        Values::Words(texels(&words, samples, u16::MAX))
    } else {
        Values::Bytes(texels(&buffer, samples, u8::MAX))
    };
    let gray = samples < 3;
    Raster {
        width,
        height,
        values,
        gray,
        statement,
    }
    .image(encoding)
}

/// Reason of the decoder, with the name of each chunk in place of all that it knows of it.
fn named_chunks(reason: &str) -> String {
    let mut pieces = reason.split("ChunkType { type: ");
    let first = pieces.next().unwrap_or_default().to_owned();
    pieces.fold(first, |text, piece| {
        let (name, rest) = piece.split_once(" }").unwrap_or((piece, ""));
        text + name.split(',').next().unwrap_or_default() + rest
    })
}

/// The transparent gray of an image of less than 8 bits, as [`Transformations::EXPAND`] scales it.
/// Of the 16 bits that the tRNS chunk has for it, those of the depth count (PNG, third edition,
/// 11.3.1.1); the decoder compares 8.
fn transparent_gray(info: &Info) -> Option<u8> {
    let depth = info.bit_depth as u32;
    let key = *info.trns.as_deref()?.last()?;
    let largest = 1_u8.checked_shl(depth)? - 1;
    (info.color_type == ColorType::Grayscale).then(|| (key & largest) * (u8::MAX / largest))
}

fn texels<T: Copy + Default>(values: &[T], samples: usize, opaque: T) -> Vec<[T; 4]> {
    values
        .chunks_exact(samples)
        .map(|t| match *t {
            [v] => [v, v, v, opaque],
            [v, a] => [v, v, v, a],
            [r, g, b] => [r, g, b, opaque],
            [r, g, b, a, ..] => [r, g, b, a],
            [] => [T::default(); 4],
        })
        .collect()
}

fn statement(info: &Info) -> Result<Statement, String> {
    if let Some(points) = &info.coding_independent_code_points {
        return code_points(points.color_primaries, points.transfer_function);
    }
    if let Some(profile) = &info.icc_profile {
        return Ok(Statement::Profile(profile.to_vec()));
    }
    if info.srgb.is_some() {
        return Ok(Statement::Srgb);
    }
    let transfer = match info.gama_chunk.map(png::ScaledFloat::into_scaled) {
        None | Some(GAMMA_OF_SRGB) => Transfer::Srgb,
        Some(0) => return Err("its gAMA chunk is 0 (allowed: above 0)".to_owned()),
        Some(gamma) => Transfer::Power(100_000.0 / f64::from(gamma)),
    };
    let primaries = info.chrm_chunk.map_or(SRGB, |c| {
        let pair = |(x, y): (png::ScaledFloat, png::ScaledFloat)| {
            [x, y].map(|v| f64::from(v.into_scaled()) / 100_000.0)
        };
        Primaries {
            red: pair(c.red),
            green: pair(c.green),
            blue: pair(c.blue),
            white: pair(c.white),
        }
    });
    Ok(Statement::Space(transfer, primaries))
}

/// The primaries and curves of ITU-T H.273 that a cICP chunk may name, as far as they are pictures
/// for a display.
fn code_points(primaries: u8, transfer: u8) -> Result<Statement, String> {
    let d65 = SRGB.white;
    let (red, green, blue, white) = match primaries {
        1 => (SRGB.red, SRGB.green, SRGB.blue, d65),
        5 => ([0.64, 0.33], [0.29, 0.60], [0.15, 0.06], d65),
        6 | 7 => ([0.630, 0.340], [0.310, 0.595], [0.155, 0.070], d65),
        9 => ([0.708, 0.292], [0.170, 0.797], [0.131, 0.046], d65),
        11 => (
            [0.680, 0.320],
            [0.265, 0.690],
            [0.150, 0.060],
            [0.314, 0.351],
        ),
        12 => ([0.680, 0.320], [0.265, 0.690], [0.150, 0.060], d65),
        other => {
            return Err(format!(
                "its cICP chunk names color primaries {other} (allowed: 1, 5, 6, 7, 9, 11, 12)"
            ));
        }
    };
    let transfer = match transfer {
        1 | 6 | 14 | 15 => Transfer::Bt709,
        4 => Transfer::Power(2.2),
        5 => Transfer::Power(2.8),
        8 => Transfer::Power(1.0),
        13 => Transfer::Srgb,
        other => {
            let name = match other {
                16 => " (PQ)",
                18 => " (HLG)",
                _ => "",
            };
            return Err(format!(
                "its cICP chunk names transfer characteristics {other}{name} (allowed: 1, 4, 5, 6, 8, 13, 14, 15)"
            ));
        }
    };
    let primaries = Primaries {
        red,
        green,
        blue,
        white,
    };
    Ok(Statement::Space(transfer, primaries))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::Image;
    use png::Encoder;

    fn encode(color: ColorType, depth: BitDepth, data: &[u8]) -> Vec<u8> {
        with_chunk(color, depth, data, *b"teST", &[])
    }

    /// An image of 2 x 1 texels with a chunk before its data.
    fn with_chunk(
        color: ColorType,
        depth: BitDepth,
        data: &[u8],
        name: [u8; 4],
        chunk: &[u8],
    ) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = Encoder::new(&mut bytes, 2, 1);
        encoder.set_color(color);
        encoder.set_depth(depth);
        let mut writer = encoder.write_header().expect("header");
        writer
            .write_chunk(png::chunk::ChunkType(name), chunk)
            .expect("chunk");
        writer.write_image_data(data).expect("data");
        writer.finish().expect("end");
        bytes
    }

    fn read(bytes: &[u8], encoding: Encoding) -> Result<Image, String> {
        super::super::decode(bytes, encoding).map(|d| d.image)
    }

    #[test]
    fn every_kind() {
        let read = |color, data: &[u8]| {
            read(&encode(color, BitDepth::Eight, data), Encoding::Linear).expect("valid")
        };
        let gray = read(ColorType::Grayscale, &[0, 255]);
        assert_eq!(gray.texel(0, 1, 0), [1.0; 4]);
        let alpha = read(ColorType::GrayscaleAlpha, &[0, 0, 255, 51]);
        assert_eq!(alpha.texel(0, 1, 0), [1.0, 1.0, 1.0, 0.2]);
        let rgba = read(ColorType::Rgba, &[0, 0, 0, 0, 255, 0, 51, 255]);
        assert_eq!(rgba.texel(0, 1, 0), [1.0, 0.0, 0.2, 1.0]);
    }

    #[test]
    fn a_transparent_gray_has_the_bits_of_the_depth() {
        for (depth, data, key, alpha) in [
            (BitDepth::One, [0x40].as_slice(), [0xa5, 0x5f], [1.0, 0.0]),
            (BitDepth::Two, &[0x70], [0, 0xf1], [0.0, 1.0]),
            (BitDepth::Four, &[0x7c], [0, 0x0c], [1.0, 0.0]),
            (BitDepth::Eight, &[7, 0xfc], [0x33, 0xfc], [1.0, 0.0]),
            (BitDepth::Sixteen, &[1, 2, 3, 4], [1, 2], [0.0, 1.0]),
        ] {
            let bytes = with_chunk(ColorType::Grayscale, depth, data, *b"tRNS", &key);
            let image = read(&bytes, Encoding::Linear).expect("valid");
            let read = [0, 1].map(|x| image.texel(0, x, 0)[3]);
            assert_eq!(read, alpha, "{depth:?}");
        }
    }

    #[test]
    fn sixteen_bits_are_kept() {
        let bytes = encode(ColorType::Grayscale, BitDepth::Sixteen, &[0, 1, 0x80, 0]);
        let image = read(&bytes, Encoding::Linear).expect("valid");
        assert_eq!(image.texel(0, 0, 0)[0], 1.0 / 65535.0);
        assert_eq!(image.texel(0, 1, 0)[0], 32768.0 / 65535.0);
        let image = read(&bytes, Encoding::Stated).expect("valid");
        assert!((image.texel(0, 1, 0)[0] - 0.2140).abs() < 1e-4);
    }

    #[test]
    fn color_chunks_are_followed_or_refused_by_name() {
        let with = |name: &[u8; 4], chunk: &[u8]| {
            let data = [0, 0, 0, 128, 128, 128];
            let bytes = with_chunk(ColorType::Rgb, BitDepth::Eight, &data, *name, chunk);
            read(&bytes, Encoding::Stated).map(|i| i.texel(0, 1, 0)[0])
        };
        let near = |value: Result<f32, String>, expected: f64| {
            let value = f64::from(value.expect("valid"));
            assert!((value - expected).abs() < 3e-5, "{value} {expected}");
        };
        let v = 128.0_f64 / 255.0;
        near(with(b"gAMA", &100_000u32.to_be_bytes()), v);
        near(with(b"gAMA", &35_000u32.to_be_bytes()), v.powf(1.0 / 0.35));
        near(with(b"gAMA", &45_455u32.to_be_bytes()), 0.215_861);
        near(with(b"cICP", &[1, 8, 0, 1]), v);
        near(with(b"cICP", &[9, 13, 0, 1]), 0.215_861);
        for (chunk, message) in [
            (
                [9, 16, 0, 1],
                "its cICP chunk names transfer characteristics 16 (PQ) (allowed: 1, 4, 5, 6, 8, 13, 14, 15)",
            ),
            (
                [2, 13, 0, 1],
                "its cICP chunk names color primaries 2 (allowed: 1, 5, 6, 7, 9, 11, 12)",
            ),
        ] {
            assert_eq!(with(b"cICP", &chunk), Err(message.to_owned()));
        }
    }

    #[test]
    fn sizes_are_looked_at_first_and_damage_is_an_error() {
        let valid = encode(ColorType::Rgb, BitDepth::Eight, &[1, 2, 3, 4, 5, 6]);
        let mut huge = valid.clone();
        huge[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
        assert!(read(&huge, Encoding::Stated).is_err());
        let data = valid.windows(4).position(|w| w == b"IDAT").expect("there");
        let mut flipped = valid.clone();
        flipped[data + 8] ^= 4;
        assert!(read(&flipped, Encoding::Stated).is_err());
        // the checksum of the first chunk
        let mut flipped = valid.clone();
        flipped[29] ^= 4;
        let reason = read(&flipped, Encoding::Stated).expect_err("damaged");
        assert!(reason.ends_with(" while decoding IHDR chunk.)"), "{reason}");
        // also where all texels are there
        for length in 0..valid.len() {
            assert!(
                read(&valid[..length], Encoding::Stated).is_err(),
                "cut to {length}"
            );
        }
    }
}
