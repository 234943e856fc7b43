//! An image with its preview.

use super::CliError;
use crate::io::exr::ExrImage;
use crate::io::{exr, png};
use crate::spectrum::xyz::xyz_to_linear_srgb;
use std::path::{Path, PathBuf};

/// Writes an XYZ image and, where a path is given, its preview.
///
/// # Errors
/// Where a file cannot be written; the other is then untouched or new.
pub fn write_image(
    path: &Path,
    image: &ExrImage,
    preview: Option<&Path>,
    exposure_ev: f64,
) -> Result<(), CliError> {
    exr::write(path, image)?;
    let Some(preview) = preview else {
        return Ok(());
    };
    let xyz = image.xyz().unwrap_or_default();
    let size = (image.crop.x1 - image.crop.x0, image.crop.y1 - image.crop.y0);
    Ok(png::write_preview(
        preview,
        size.0,
        size.1,
        &xyz,
        exposure_ev,
        xyz_to_linear_srgb,
    )?)
}

/// Refuses a name that promises another format than OpenEXR.
///
/// # Errors
/// It does not end in `.exr`.
pub fn check_ending(path: &Path) -> Result<(), CliError> {
    if path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("exr"))
    {
        return Ok(());
    }
    Err(CliError::Usage(format!(
        "{}: images are OpenEXR files (allowed: a name that ends in .exr; a PNG preview is written beside it)",
        path.display()
    )))
}

/// The preview beside an image.
#[must_use]
pub fn preview_path(image: &Path) -> PathBuf {
    image.with_extension("png")
}
