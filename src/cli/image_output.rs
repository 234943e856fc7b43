//! An image with its preview.

use super::CliError;
use crate::develop::Exposure;
use crate::io::atomic::write_atomic;
use crate::io::exr::{self, ExrImage};
use crate::io::image::{self, development};
use crate::io::part::{Part, PartHeader};
use crate::io::png::{Depth, picture_bytes};
use std::ffi::OsStr;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Share of clipped pixels from which on a preview says so.
const CLIPPED: f64 = 0.05;

/// A preview that was written, in words: file, exposure, and what of it is clipped.
#[must_use]
pub fn preview_text(path: &Path, stops: f64, clipped: f64) -> String {
    let mut text = format!("{}, exposure {stops:+.2} EV", path.display());
    if clipped > CLIPPED {
        text += &format!(
            ", {:.0} % of the pixels are clipped (a lower --exposure shows them)",
            100.0 * clipped
        );
    }
    text
}

/// Writes an XYZ image and, where a path is given, its preview, brightened by `exposure` (`None`:
/// as the sensor calls for). Says of the preview what a user should know.
///
/// # Errors
/// Where a file cannot be written; the other is then untouched or new.
pub fn write_image(
    path: &Path,
    image: &ExrImage,
    preview: Option<&Path>,
    exposure: Option<f64>,
) -> Result<Option<String>, CliError> {
    exr::write(path, image)?;
    let Some(preview) = preview else {
        return Ok(None);
    };
    let mut development = development(image);
    if let Some(stops) = exposure {
        development.exposure = Exposure::Stops(stops);
    }
    let xyz = image.xyz().unwrap_or_default();
    let size = (image.crop.width(), image.crop.height());
    let picture = development.develop(&xyz);
    let png = picture_bytes(size, &picture, development.display, Depth::Eight)
        .map_err(|e| CliError::file(preview, e.to_string()))?;
    write_atomic(preview, |file| file.write_all(&png))?;
    Ok(Some(preview_text(preview, picture.stops, picture.clipped)))
}

/// Name of the image of one sensor of several: that of the image, with the sensor before the
/// ending.
#[must_use]
pub fn of_sensor(image: &Path, sensor: &str) -> PathBuf {
    let mut name = image.file_stem().unwrap_or_default().to_owned();
    let extension = image.extension().unwrap_or("exr".as_ref());
    for suffix in [sensor.as_ref(), extension] {
        name.push(".");
        name.push::<&OsStr>(suffix);
    }
    image.with_file_name(name)
}

/// Files of a film of a part.
#[derive(Clone, Debug)]
pub struct FilmTargets {
    /// Image.
    pub image: PathBuf,
    /// Preview, if there is one.
    pub preview: Option<PathBuf>,
    /// Spectral image, where the part has one.
    pub spectral: Option<PathBuf>,
}

impl FilmTargets {
    /// For each film of a part, by the name given for all.
    #[must_use]
    pub fn of(header: &PartHeader, output: &Path, with_previews: bool) -> Vec<Self> {
        let films = header.each();
        let several = films.len() > 1;
        let target = |film: &PartHeader| {
            let image = if several {
                of_sensor(output, &film.sensor)
            } else {
                output.to_owned()
            };
            Self {
                preview: with_previews.then(|| preview_path(&image)),
                spectral: (film.spectral.is_some()).then(|| image.with_extension("spectral.exr")),
                image,
            }
        };
        films.iter().map(target).collect()
    }

    /// All of them.
    pub fn paths(&self) -> impl Iterator<Item = &PathBuf> {
        let others = [self.preview.as_ref(), self.spectral.as_ref()];
        std::iter::once(&self.image).chain(others.into_iter().flatten())
    }

    /// Writes the images of a part that holds one film; says of the preview what a user should
    /// know.
    ///
    /// # Errors
    /// Where the sums do not fit the header, or a file cannot be written.
    pub fn write(&self, film: &Part, exposure: Option<f64>) -> Result<Option<String>, CliError> {
        let image = image::of_part(film)?;
        let preview = write_image(&self.image, &image, self.preview.as_deref(), exposure)?;
        if let Some(path) = &self.spectral
            && let Some(image) = image::spectral_of_part(film, false)?
        {
            write_image(path, &image, None, None)?;
        }
        Ok(preview)
    }
}

/// The preview beside an image.
#[must_use]
pub fn preview_path(image: &Path) -> PathBuf {
    image.with_extension("png")
}
