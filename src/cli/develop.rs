//! `abbe develop`: pictures of images and parts.

use super::args::DevelopOptions;
use super::ending;
use super::image_output::{preview_path, preview_text};
use super::{CliError, Outcome, print};
use crate::develop::{Development, Exposure};
use crate::io::atomic::write_atomic;
use crate::io::destination::Claims;
use crate::io::exr::ExrImage;
use crate::io::image::{self, development};
use crate::io::png::{Depth, picture_bytes};
use crate::report::figure::figure;
use std::collections::BTreeSet;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Runs the command.
pub fn run(options: &DevelopOptions) -> Result<Outcome, CliError> {
    if options.output.is_some() && options.images.len() > 1 {
        let message = "--output names one picture, and there are several images";
        return Err(CliError::Usage(message.to_owned()));
    }
    if options.at.is_some() && !options.output.as_deref().is_some_and(is_figure) {
        let message =
            "--at chooses a row and a column of a figure (allowed: with --output NAME.svg)";
        return Err(CliError::Usage(message.to_owned()));
    }
    let mut claims = Claims::of_inputs(&options.images);
    for source in &options.images {
        claims.output(&target(options, source))?;
    }
    if let Some(output) = &options.output {
        let written = "pictures are PNG files, or SVG files as figures";
        ending::check(output, written, &["png", "svg"])?;
    }
    for source in &options.images {
        develop(options, source)?;
    }
    Ok(Outcome::Done)
}

/// The picture of an image.
fn target(options: &DevelopOptions, source: &Path) -> PathBuf {
    let beside = || preview_path(Path::new(source.file_name().unwrap_or_default()));
    options.output.clone().unwrap_or_else(beside)
}

/// Whether a figure is asked for, and not a picture alone.
fn is_figure(target: &Path) -> bool {
    let ending = target.extension();
    ending.is_some_and(|e| e.eq_ignore_ascii_case("svg"))
}

fn develop(options: &DevelopOptions, source: &Path) -> Result<(), CliError> {
    let image = image::read(source)?;
    let xyz = match &options.layer {
        None => image.xyz(),
        Some(name) => image.layer_xyz(name),
    };
    let xyz =
        xyz.ok_or_else(|| CliError::file(source, missing(&image, options.layer.as_deref())))?;
    let base = development(&image);
    let development = Development {
        exposure: options.exposure.map_or(base.exposure, Exposure::Stops),
        tone: options.tone.unwrap_or(base.tone),
        white: options.white,
        display: options.display,
    };
    let depth = if options.depth == "16" {
        Depth::Sixteen
    } else {
        Depth::Eight
    };
    let picture = development.develop(&xyz);
    let target = target(options, source);
    let size = (image.crop.width(), image.crop.height());
    let png = picture_bytes(size, &picture, development.display, depth)
        .map_err(|e| CliError::file(&target, e.to_string()))?;
    if is_figure(&target) {
        let title = source.file_name().unwrap_or_default().to_string_lossy();
        let svg = figure(&image, &xyz, &png, &title, options.at)
            .map_err(|message| CliError::file(source, message))?;
        write_atomic(&target, |file| file.write_all(svg.as_bytes()))?;
    } else {
        write_atomic(&target, |file| file.write_all(&png))?;
    }
    if !options.quiet {
        let text = preview_text(&target, picture.stops, picture.clipped);
        print(&format!("{text}, {} curve\n", development.tone))?;
    }
    Ok(())
}

/// The message where channels are missing.
fn missing(image: &ExrImage, layer: Option<&str>) -> String {
    let channels = image.channels.iter();
    let Some(layer) = layer else {
        let names: Vec<&str> = channels.map(|c| c.name.as_str()).collect();
        return format!(
            "has no channels X, Y and Z (channels: {})",
            names.join(", ")
        );
    };
    let names = channels.filter_map(|c| Some(c.name.rsplit_once('.')?.0));
    let names: BTreeSet<&str> = names.collect();
    let there = if names.is_empty() {
        "it has none".to_owned()
    } else {
        let names: Vec<&str> = names.into_iter().collect();
        format!("layers: {}", names.join(", "))
    };
    format!("has no layer \"{layer}\" ({there})")
}
