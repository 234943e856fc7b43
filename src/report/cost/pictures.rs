//! The pictures of a report: images whose bytes keep four stops above white, and signed maps of the
//! error, as data URLs.

use super::Reference;
use crate::io::exr;
use crate::io::png::png_bytes;
use crate::report::ReportError;
use crate::report::html::png_url;
use crate::spectrum::xyz::xyz_to_linear_srgb;
use serde::Serialize;
use std::path::Path;

/// The brightest linear value that a byte stands for; bytes are fourth roots of shares of it.
pub const BRIGHTEST: f64 = 16.0;
/// Relative error that is fully red (too bright) or blue (too dark) in a map.
pub const FULL_ERROR: f64 = 0.5;
/// Pixels above which pictures are left out of the page (their EXR files are there all the same).
const MOST_PIXELS: usize = 1 << 21;

/// A picture of a variant.
#[derive(Clone, Debug, Serialize)]
pub struct Picture {
    /// The variant, or `reference`.
    pub id: String,
    /// Name for readers.
    pub label: String,
    /// The image.
    pub image: String,
    /// The error map; the reference has none.
    pub error: Option<String>,
}

/// The picture of an image file; `None` where it is too large or has no color.
///
/// # Errors
/// Where the file cannot be read.
pub fn picture(
    id: &str,
    label: &str,
    path: &Path,
    exposure: f64,
    reference: Option<&Reference>,
) -> Result<Option<Picture>, ReportError> {
    let image = exr::read(path)?;
    let Some(xyz) = image.xyz() else {
        return Ok(None);
    };
    let (width, height) = (image.crop.width(), image.crop.height());
    if xyz.len() / 3 > MOST_PIXELS {
        return Ok(None);
    }
    let (pixels, _) = xyz.as_chunks::<3>();
    let bytes: Vec<u8> = pixels
        .iter()
        .flat_map(|p| xyz_to_linear_srgb(p.map(|v| v * exposure)).map(root_byte))
        .collect();
    let url = |rgb: &[u8]| {
        png_bytes(width, height, rgb)
            .map(|png| png_url(&png))
            .map_err(|e| ReportError::file(path, e.to_string()))
    };
    let map = |reference: &Reference| {
        let pairs = pixels.iter().zip(&reference.image.y);
        let bytes: Vec<u8> = pairs.flat_map(|(p, r)| error_color(p[1], *r)).collect();
        url(&bytes)
    };
    Ok(Some(Picture {
        id: id.to_owned(),
        label: label.to_owned(),
        image: url(&bytes)?,
        error: reference.map(map).transpose()?,
    }))
}

/// Factor that brings the mean luminance of the reference to a middle gray.
#[must_use]
pub fn exposure(reference: &Reference) -> f64 {
    let y = &reference.image.y;
    // the mean of what is not brighter than ten times the median, so that a lamp in the picture
    // does not darken it
    let mut sorted = y.clone();
    sorted.sort_by(f64::total_cmp);
    let limit = 10.0 * sorted[sorted.len() / 2].max(1e-9);
    let mean = y.iter().map(|v| v.min(limit)).sum::<f64>() / y.len() as f64;
    if mean > 0.0 { 0.25 / mean } else { 1.0 }
}

fn root_byte(linear: f64) -> u8 {
    // the cast saturates and makes 0 of not-a-number
    (255.0 * (linear.max(0.0) / BRIGHTEST).powf(0.25)).round() as u8
}

/// White where there is no error, red where the image is too bright, blue where too dark.
fn error_color(value: f64, reference: f64) -> [u8; 3] {
    let error = (value - reference) / (reference * reference + 0.01).sqrt() / FULL_ERROR;
    let rest = (255.0 * (1.0 - error.abs().min(1.0))).round() as u8;
    if error > 0.0 {
        [255, rest, rest]
    } else {
        [rest, rest, 255]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_and_colors() {
        assert_eq!(
            [0.0, 1.0, 16.0, 99.0, -1.0, f64::NAN].map(root_byte),
            [0, 128, 255, 255, 0, 0]
        );
        assert_eq!(error_color(1.0, 1.0), [255, 255, 255]);
        assert_eq!(error_color(9.0, 1.0), [255, 0, 0]);
        assert_eq!(error_color(0.0, 1.0), [0, 0, 255]);
    }
}
