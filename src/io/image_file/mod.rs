//! Images for textures and environments: PNG, JPEG, OpenEXR, Radiance.
//!
//! The kind is told by the first bytes, not by the name. Sizes are checked against a limit, and
//! against what so few bytes can hold, before anything of that size is allocated. What a file says
//! about its colors is followed, or the file is refused; what cannot be kept is said in a note.

mod color;
mod floats;
mod icc;
mod jpeg;
mod open_exr;
mod png;
mod primaries;
mod radiance;

use crate::texture::{Image, MAX_TEXELS};

/// Largest image file.
pub const MAX_IMAGE_BYTES: u64 = 1 << 30;
/// No PNG or JPEG describes more texels by a byte (deflate packs at most 1032 to 1; two bits of a
/// JPEG say 64), and no OpenEXR file more samples.
const MAX_TEXELS_PER_BYTE: u64 = 8192;
/// Most samples of an OpenEXR image.
const MAX_SAMPLES: u64 = 1 << 29;

/// Meaning of the numbers of an image. OpenEXR and Radiance hold linear numbers in any case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Colors, encoded as the file says; sRGB where it says nothing.
    Stated,
    /// Colors in sRGB, whatever the file says (glTF 2.0, 3.8.2, has it so).
    Srgb,
    /// Numbers, such as roughness or normals: taken as they are.
    Linear,
}

/// An image, and what its reader has to say about it.
#[derive(Clone, Debug)]
pub struct Decoded {
    /// The image.
    pub image: Image,
    /// Notes on what was not kept, one line each.
    pub notes: Vec<String>,
}

/// The most that a decoder allocates.
#[derive(Clone, Copy, Debug)]
struct Limits {
    texels: u64,
    /// Of OpenEXR, over all channels.
    samples: u64,
}

/// An image from the bytes of a file.
///
/// # Errors
/// Fault, in words, without the file's name.
pub fn decode(bytes: &[u8], encoding: Encoding) -> Result<Decoded, String> {
    let limits = Limits {
        texels: MAX_TEXELS,
        samples: MAX_SAMPLES,
    };
    decode_limited(bytes, encoding, limits)
}

fn decode_limited(bytes: &[u8], encoding: Encoding, limits: Limits) -> Result<Decoded, String> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => self::png::decode(bytes, encoding, limits),
        [0xff, 0xd8, ..] => jpeg::decode(bytes, encoding, limits),
        [0x76, 0x2f, 0x31, 0x01, ..] => open_exr::decode(bytes, encoding, limits),
        [b'#', b'?', ..] => radiance::decode(bytes, encoding, limits),
        [] => Err("the file is empty".to_owned()),
        _ => Err("not an image (allowed: PNG, JPEG, OpenEXR, Radiance HDR)".to_owned()),
    }
}

/// Decodes any bytes: must not panic, nor allocate more than some megabytes.
pub fn fuzz_image(bytes: &[u8]) {
    let limits = Limits {
        texels: 1 << 20,
        samples: 1 << 20,
    };
    // the outcome does not matter
    _ = decode_limited(bytes, Encoding::Stated, limits);
}

fn check_size(width: u64, height: u64, bytes: usize, limits: Limits) -> Result<(), String> {
    let limit = limits.texels;
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

/// How many texels are meant, and the first of them by column and row: "3 texels, the first at
/// column 2, row 0".
fn texels(count: usize, first: usize, width: u32) -> String {
    let (column, row) = (first % width.max(1) as usize, first / width.max(1) as usize);
    match count {
        1 => format!("1 texel, at column {column}, row {row}"),
        _ => format!("{count} texels, the first at column {column}, row {row}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_image_is_an_error() {
        for (bytes, message) in [
            (&b"GIF89a"[..], "not an image"),
            (b"", "the file is empty"),
            (b"\x89PNG\r\n\x1a\n", "not a readable PNG"),
            (b"\xff\xd8\xff", "not a readable JPEG"),
            (b"\x76\x2f\x31\x01", "not a readable OpenEXR"),
            (b"#?RADIANCE\n\n", "not a readable Radiance"),
        ] {
            let error = decode(bytes, Encoding::Stated).expect_err("damaged");
            assert!(error.starts_with(message), "{error}");
        }
    }
}
