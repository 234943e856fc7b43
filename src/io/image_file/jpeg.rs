//! JPEG images as textures.

use super::color::{Raster, Statement, Values};
use super::{Decoded, Encoding, Limits, check_size};
use crate::io::jpeg;

pub fn decode(bytes: &[u8], encoding: Encoding, limits: Limits) -> Result<Decoded, String> {
    let accept = |width, height| check_size(width, height, bytes.len(), limits);
    let jpeg = jpeg::decode(bytes, accept)
        .map_err(|message| format!("not a readable JPEG image ({message})"))?;
    let values = jpeg.rgb.iter().map(|&[r, g, b]| [r, g, b, 255]).collect();
    Raster {
        width: jpeg.width,
        height: jpeg.height,
        values: Values::Bytes(values),
        gray: jpeg.gray,
        statement: jpeg.profile.map_or(Statement::Srgb, Statement::Profile),
    }
    .image(encoding)
}
