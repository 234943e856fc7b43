//! `abbe compare`: how far an image is from a reference, and how much of its error is in bands. Of two tables of path classes:
//! see `class_tables`.

use super::args::{ColorLines, CompareOptions};
use super::{CliError, Outcome, class_tables, print};
use crate::film::Crop;
use crate::io::exr;
use crate::math::banding::{Banding, banding};
use crate::math::image_error::{ImageError, image_error};
use serde_json::json;
use std::path::Path;

const CHANNELS: [&str; 3] = ["X", "Y", "Z"];

/// Runs the command.
pub fn run(options: &CompareOptions) -> Result<Outcome, CliError> {
    if let Some(reference) = &options.reference
        && class_tables::is_table(&options.image)
        && class_tables::is_table(reference)
    {
        return class_tables::run(&options.image, reference, options.json);
    }
    let (image, image_xyz) = read(&options.image)?;
    let size = |i: &exr::ExrImage| (i.crop.x1 - i.crop.x0, i.crop.y1 - i.crop.y0);
    let (w, h) = size(&image);
    let mut reference_xyz = None;
    if let Some(path) = &options.reference {
        let (reference, xyz) = read(path)?;
        let (rw, rh) = size(&reference);
        if (w, h) != (rw, rh) {
            return Err(CliError::file(
                &options.image,
                format!("is {w} x {h}, the reference {rw} x {rh} pixels"),
            ));
        }
        reference_xyz = Some(xyz);
    }
    if options.banding {
        let found = bands(&image_xyz, reference_xyz.as_deref(), (w, h), &options.lines)?;
        print(&if options.json {
            format!("{:#}\n", bands_json(&found))
        } else {
            bands_table(&found)
        });
        return Ok(Outcome::Done);
    }
    // the parser asks for one
    let reference_xyz = reference_xyz.unwrap_or_default();
    let errors: Vec<ImageError> = (0..3)
        .map(|c| {
            let channel =
                |xyz: &[f64]| -> Vec<f64> { xyz.iter().skip(c).step_by(3).copied().collect() };
            image_error(&channel(&image_xyz), &channel(&reference_xyz), w as usize)
        })
        .collect();
    print(&if options.json {
        json_text(&errors)
    } else {
        table(&errors)
    });
    Ok(Outcome::Done)
}

/// The part of an image whose bands are measured.
///
/// # Errors
/// Where it reaches beyond the image.
pub fn region(lines: &ColorLines, (width, height): (u32, u32)) -> Result<Crop, CliError> {
    let region = lines.region.unwrap_or(Crop::whole(width, height));
    if region.x1 > width || region.y1 > height {
        return Err(CliError::Usage(format!(
            "region {},{},{},{} reaches beyond an image of {width} x {height} pixels",
            region.x0, region.y0, region.x1, region.y1
        )));
    }
    Ok(region)
}

/// Bands of X, Y and Z.
///
/// # Errors
/// Where the region reaches beyond the image or is too small to have bands.
pub fn bands(
    image: &[f64],
    reference: Option<&[f64]>,
    (width, height): (u32, u32),
    lines: &ColorLines,
) -> Result<[Banding; 3], CliError> {
    let region = region(lines, (width, height))?;
    let range = |a: u32, b: u32| a as usize..b as usize;
    let area = (range(region.x0, region.x1), range(region.y0, region.y1));
    let channel =
        |xyz: &[f64], c: usize| -> Vec<f64> { xyz.iter().skip(c).step_by(3).copied().collect() };
    let mut found = Vec::new();
    for c in 0..3 {
        let reference = reference.map(|r| channel(r, c));
        let image = channel(image, c);
        let width = width as usize;
        let of_channel = banding(
            &image,
            reference.as_deref(),
            width,
            area.clone(),
            lines.axis,
        );
        found.extend(of_channel);
    }
    found.try_into().map_err(|_| {
        CliError::Failed(
            "the region has fewer than three lines of color, or no noise at all".to_owned(),
        )
    })
}

/// Bands for reading.
fn bands_table(bands: &[Banding; 3]) -> String {
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
pub fn bands_json(bands: &[Banding; 3]) -> serde_json::Value {
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

fn read(path: &Path) -> Result<(exr::ExrImage, Vec<f64>), CliError> {
    let (image, xyz) = exr::read_xyz(path)?;
    let bad = xyz
        .chunks(3)
        .filter(|p| p.iter().any(|v| !v.is_finite()))
        .count();
    if bad > 0 {
        return Err(CliError::file(path, format!("{bad} pixels are not finite")));
    }
    Ok((image, xyz))
}

fn table(errors: &[ImageError]) -> String {
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

fn json_text(errors: &[ImageError]) -> String {
    let y = &errors[1];
    let ratio: serde_json::Map<_, _> = CHANNELS
        .iter()
        .zip(errors)
        .map(|(c, e)| ((*c).to_owned(), json!(e.mean_ratio)))
        .collect();
    let value = json!({
        "rel_mse": y.rel_mse,
        "rel_mse_trimmed": y.trimmed_rel_mse,
        "rmse": y.rmse,
        "log_rmse": y.log_rmse,
        "fireflies": y.fireflies,
        "mean_ratio": ratio,
    });
    format!("{value:#}\n")
}
