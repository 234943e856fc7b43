//! Errors of an image against a reference, channel by channel, and how much of an error is in
//! bands.

use super::ReportError;
use crate::film::Crop;
use crate::io::exr::{self, MetadataValue};
use crate::math::banding::{Axis, Banding, banding};
use crate::math::image_error::{ImageError, image_error};
use serde_json::{Value, json};
use std::path::Path;

const CHANNELS: [&str; 3] = ["X", "Y", "Z"];

/// Where lines of one color run.
#[derive(Clone, Debug)]
pub struct ColorLines {
    /// The part of the image whose bands are measured; `None`: all of it.
    pub region: Option<Crop>,
    /// The direction in which color changes.
    pub axis: Axis,
}

impl ColorLines {
    /// The part of an image whose bands are measured.
    ///
    /// # Errors
    /// Where it reaches beyond the image.
    pub fn region(&self, (width, height): (u32, u32)) -> Result<Crop, ReportError> {
        let region = self.region.unwrap_or(Crop::whole(width, height));
        if region.x1 > width || region.y1 > height {
            return Err(ReportError::Region {
                region,
                width,
                height,
            });
        }
        Ok(region)
    }
}

/// An image, interleaved, and its size.
#[derive(Clone, Debug)]
pub struct Xyz {
    /// Columns and rows.
    pub size: (u32, u32),
    /// X, Y and Z of each pixel.
    pub values: Vec<f64>,
    /// Hash of the scene and name of the sensor, where the file says them.
    pub of: [Option<String>; 2],
}

impl Xyz {
    /// Reads an image whose values are all finite.
    ///
    /// # Errors
    /// Where the file cannot be read, lacks a channel, or has pixels that are not finite.
    pub fn read(path: &Path) -> Result<Self, ReportError> {
        let (image, values) = exr::read_xyz(path)?;
        let (pixels, _) = values.as_chunks::<3>();
        let is_bad = |p: &&[f64; 3]| p.iter().any(|v| !v.is_finite());
        let bad = pixels.iter().filter(is_bad).count();
        if bad > 0 {
            let message = format!("{bad} pixels are not finite");
            return Err(ReportError::file(path, message));
        }
        let size = (image.crop.width(), image.crop.height());
        let of = ["sceneHash", "sensor"].map(|name| match image.metadata.get(name) {
            Some(MetadataValue::Text(text)) => Some(text.clone()),
            _ => None,
        });
        Ok(Self { size, values, of })
    }

    /// Reads an image and its reference.
    ///
    /// # Errors
    /// As [`Xyz::read`], or where they differ in size.
    pub fn read_pair(image: &Path, reference: &Path) -> Result<[Self; 2], ReportError> {
        let pair = [Self::read(image)?, Self::read(reference)?];
        check_size(image, pair[0].size, pair[1].size)?;
        Ok(pair)
    }

    /// Whether two images say that they show different scenes, or one by different sensors.
    #[must_use]
    pub fn shows_another(&self, other: &Self) -> bool {
        let differ =
            |(a, b): (&Option<String>, &Option<String>)| a.is_some() && b.is_some() && a != b;
        self.of.iter().zip(&other.of).any(differ)
    }

    /// One of X, Y, Z.
    #[must_use]
    pub fn channel(&self, channel: usize) -> Vec<f64> {
        let (pixels, _) = self.values.as_chunks::<3>();
        pixels.iter().map(|p| p[channel]).collect()
    }
}

/// Refuses an image whose size is not that of the reference.
pub(super) fn check_size(
    path: &Path,
    (w, h): (u32, u32),
    (rw, rh): (u32, u32),
) -> Result<(), ReportError> {
    if (w, h) == (rw, rh) {
        return Ok(());
    }
    let message = format!("is {w} x {h}, the reference {rw} x {rh} pixels");
    Err(ReportError::file(path, message))
}

/// Errors of X, Y and Z.
#[must_use]
pub fn errors(image: &Xyz, reference: &Xyz) -> [ImageError; 3] {
    let width = image.size.0 as usize;
    [0, 1, 2].map(|c| image_error(&image.channel(c), &reference.channel(c), width))
}

/// Bands of X, Y and Z.
///
/// # Errors
/// Where the region reaches beyond the image or is too small to have bands.
pub fn bands(
    image: &Xyz,
    reference: Option<&Xyz>,
    lines: &ColorLines,
) -> Result<[Banding; 3], ReportError> {
    let region = lines.region(image.size)?;
    let range = |a: u32, b: u32| a as usize..b as usize;
    let area = (range(region.x0, region.x1), range(region.y0, region.y1));
    let width = image.size.0 as usize;
    let of = |c: usize| {
        let (image, reference) = (image.channel(c), reference.map(|r| r.channel(c)));
        banding(
            &image,
            reference.as_deref(),
            width,
            area.clone(),
            lines.axis,
        )
    };
    match [0, 1, 2].map(of) {
        [Some(x), Some(y), Some(z)] => Ok([x, y, z]),
        _ => Err(ReportError::NoLines),
    }
}

/// Bands as text.
#[must_use]
pub fn bands_text(bands: &[Banding; 3]) -> String {
    let row = |name: &str, of: &dyn Fn(&Banding) -> String| {
        let cells: Vec<String> = CHANNELS
            .iter()
            .zip(bands)
            .map(|(c, b)| format!("{c} {}", of(b)))
            .collect();
        format!("{name:<15} {}\n", cells.join("  "))
    };
    let mut text = row("F-ratio", &|b| format!("{:.3}", b.f_ratio))
        + &row("coherent RMS", &|b| format!("{:.4}", b.coherent_rms));
    if bands[1].participation.is_some() {
        let share = |b: &Banding| format!("{:.3}", b.participation.unwrap_or(f64::NAN));
        text += &row("participation", &share);
    }
    text + &format!("lines           {}\n", bands[1].groups)
}

/// Bands as JSON, by channel.
#[must_use]
pub fn bands_json(bands: &[Banding; 3]) -> Value {
    let of = |b: &Banding| {
        json!({
            "f_ratio": b.f_ratio,
            "coherent_rms": b.coherent_rms,
            "participation": b.participation,
            "lines": b.groups,
        })
    };
    json!({ "X": of(&bands[0]), "Y": of(&bands[1]), "Z": of(&bands[2]) })
}

/// Errors as text.
#[must_use]
pub fn errors_text(errors: &[ImageError; 3]) -> String {
    let y = &errors[1];
    let ratios: Vec<String> = CHANNELS
        .iter()
        .zip(errors)
        .map(|(c, e)| format!("{c} {:.6}", e.mean_ratio))
        .collect();
    format!(
        "relMSE          {:.6e}\n\
         relMSE trimmed  {:.6e}  (without the worst 0.1 % of the pixels)\n\
         RMSE            {:.6e}\n\
         log-RMSE        {:.6e}\n\
         fireflies       {}  (Y above the reference by more than 5 times its largest value around)\n\
         mean ratio      {}\n",
        y.rel_mse,
        y.trimmed_rel_mse,
        y.rmse,
        y.log_rmse,
        y.fireflies,
        ratios.join("  "),
    )
}

/// Errors as JSON.
#[must_use]
pub fn errors_json(errors: &[ImageError; 3]) -> Value {
    let y = &errors[1];
    let ratio: serde_json::Map<_, _> = CHANNELS
        .iter()
        .zip(errors)
        .map(|(c, e)| ((*c).to_owned(), json!(e.mean_ratio)))
        .collect();
    json!({
        "rel_mse": y.rel_mse,
        "rel_mse_trimmed": y.trimmed_rel_mse,
        "rmse": y.rmse,
        "log_rmse": y.log_rmse,
        "fireflies": y.fireflies,
        "mean_ratio": ratio,
    })
}
