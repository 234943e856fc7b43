//! JPEG images (ITU-T T.81): sequential and progressive Huffman code of 8 bits, any order of scans.
//!
//! The inverse transform, the interpolation of chroma and the color conversion follow the
//! arithmetic that libjpeg made the custom (the integer transform of Loeffler, Ligtenberg and
//! Moschytz with 13-bit constants, triangle filters, 16-bit fixed point), so that texels are those
//! that other programs show. What is damaged is an error; what is not read (arithmetic code,
//! lossless, 12 bits) is refused by name.

mod bits;
mod planes;
mod scan;
mod segments;
mod transform;

use segments::{Adobe, Segments};

/// Decoded pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Jpeg {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Red, green and blue of each pixel, rows from the top, as the file encodes them (sRGB by
    /// custom).
    pub rgb: Vec<[u8; 3]>,
    /// Whether the file has one component.
    pub gray: bool,
    /// The ICC profile, where there is one.
    pub profile: Option<Vec<u8>>,
}

/// Samples of one component in the file.
#[derive(Clone, Debug)]
struct Component {
    id: u8,
    /// Sampling factors, 1 to 4.
    h: usize,
    v: usize,
    /// Which quantization table.
    table: usize,
    /// Blocks across and down that hold pixels: what a scan of this component alone has.
    own_blocks: [usize; 2],
    /// Blocks across in memory: whole units of all components.
    stride: usize,
    /// Coefficients in natural order.
    blocks: Vec<[i16; 64]>,
    /// Dequantization, fixed by the first scan.
    quantization: Option<[u16; 64]>,
    /// Bits of each coefficient (zigzag order) that are still to come; -1: not seen.
    missing_bits: [i8; 64],
}

/// Contents of a frame header.
#[derive(Clone, Debug)]
struct Frame {
    progressive: bool,
    width: usize,
    height: usize,
    /// Largest sampling factors.
    h_max: usize,
    v_max: usize,
    components: Vec<Component>,
}

/// How three or four components make a color.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ColorModel {
    Gray,
    Ycc,
    Rgb,
    Cmyk,
    Ycck,
}

/// Decodes a file. `accept` is asked for width and height before anything of that size is
/// allocated.
///
/// # Errors
/// Fault, in words.
pub fn decode(
    bytes: &[u8],
    accept: impl Fn(u64, u64) -> Result<(), String>,
) -> Result<Jpeg, String> {
    let segments = Segments::read(bytes, accept)?;
    let frame = segments.frame.ok_or_else(|| "it has no frame".to_owned())?;
    for component in &frame.components {
        if component.missing_bits[0] < 0 {
            return Err(format!("component {} has no scan", component.id));
        }
        if component.missing_bits.iter().any(|&b| b != 0) {
            return Err("its last scans are missing".to_owned());
        }
    }
    let model = model(&frame.components, segments.jfif, segments.adobe)?;
    let profile = segments.profile.assemble()?;
    Ok(Jpeg {
        width: frame.width as u32,
        height: frame.height as u32,
        gray: model == ColorModel::Gray,
        rgb: planes::colors(&frame, model)?,
        profile,
    })
}

/// The color model by the markers of applications, or else by the names of the components.
fn model(components: &[Component], jfif: bool, adobe: Option<Adobe>) -> Result<ColorModel, String> {
    let ids: Vec<u8> = components.iter().map(|c| c.id).collect();
    Ok(match (ids.len(), adobe) {
        (1, _) => ColorModel::Gray,
        (3, _) if jfif => ColorModel::Ycc,
        (3, Some(Adobe { transform: 0 })) => ColorModel::Rgb,
        (3, None) if ids == *b"RGB" => ColorModel::Rgb,
        (3, _) => ColorModel::Ycc,
        (4, Some(Adobe { transform: 0 }) | None) => ColorModel::Cmyk,
        (4, Some(_)) => ColorModel::Ycck,
        (n, _) => return Err(format!("{n} components (allowed: 1, 3, 4)")),
    })
}
