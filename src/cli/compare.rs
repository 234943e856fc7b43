//! `abbe compare`: how far an image is from a reference.

use super::args::CompareOptions;
use super::{CliError, Outcome, print};
use crate::io::exr;
use crate::math::image_error::{ImageError, image_error};
use serde_json::json;
use std::path::Path;

const CHANNELS: [&str; 3] = ["X", "Y", "Z"];

/// Runs the command.
pub fn run(options: &CompareOptions) -> Result<Outcome, CliError> {
    let (image, image_xyz) = read(&options.image)?;
    let (reference, reference_xyz) = read(&options.reference)?;
    let size = |i: &exr::ExrImage| (i.crop.x1 - i.crop.x0, i.crop.y1 - i.crop.y0);
    let ((w, h), (rw, rh)) = (size(&image), size(&reference));
    if (w, h) != (rw, rh) {
        return Err(CliError::file(
            &options.image,
            format!("is {w} x {h}, the reference {rw} x {rh} pixels"),
        ));
    }
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
