//! The options of `abbe compare`, `spot`, `banding` and `merge`.

use super::Overrides;
use super::values;
use crate::film::Crop;
use crate::math::banding::Axis;
use crate::report::compare;
use clap::Args;
use std::path::PathBuf;

/// Options of `abbe compare`.
#[derive(Debug, Args)]
pub struct CompareOptions {
    /// The image (EXR with channels X, Y, Z), or statistics of a render (JSON of --stats)
    #[arg(value_name = "IMAGE")]
    pub image: PathBuf,
    /// Reference (statistics beside statistics); without it only bands are measured
    #[arg(value_name = "REFERENCE", required_unless_present = "banding")]
    pub reference: Option<PathBuf>,
    /// Measures bands instead: errors that are the same all along a line of one color
    #[arg(long)]
    pub banding: bool,
    #[command(flatten)]
    pub lines: ColorLines,
    /// Prints JSON
    #[arg(long)]
    pub json: bool,
}

/// Where lines of one color run.
#[derive(Debug, Args)]
pub struct ColorLines {
    /// The part of the image whose bands are measured: X0 <= x < X1, Y0 <= y < Y1
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = values::crop)]
    pub region: Option<Crop>,
    /// Where color (or the moment) changes: along x, along y, or with the distance from the pixel
    /// X,Y
    #[arg(long, value_name = "x | y | X,Y", default_value = "x", value_parser = values::axis, allow_negative_numbers = true)]
    pub axis: Axis,
}

impl ColorLines {
    /// As studies take it.
    #[must_use]
    pub fn to_lines(&self) -> compare::ColorLines {
        compare::ColorLines {
            region: self.region,
            axis: self.axis,
        }
    }
}

/// Options of `abbe spot`.
#[derive(Debug, Args)]
pub struct SpotOptions {
    /// The image of a detector: EXR of a render, or NAME.spectral.exr for each line by itself
    #[arg(value_name = "IMAGE")]
    pub image: PathBuf,
    /// Pixels that are measured, X0 <= x < X1, Y0 <= y < Y1; all otherwise
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = values::crop)]
    pub window: Option<Crop>,
    /// Takes the mean of the outermost pixels of the window from all of it
    #[arg(long)]
    pub background: bool,
    /// Spatial frequencies of the modulation transfer in cycles per millimeter; ten up to half the
    /// sampling frequency otherwise
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::positive, allow_negative_numbers = true)]
    pub frequencies: Vec<f64>,
    /// Draws encircled energy and modulation transfer
    #[arg(long, value_name = "SVG")]
    pub drawing: Option<PathBuf>,
    /// Prints JSON
    #[arg(long)]
    pub json: bool,
}

/// Options of `abbe banding`.
#[derive(Debug, Args)]
pub struct BandingOptions {
    /// The scene file
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The page to write; NAME.json and NAME.png go beside it
    #[arg(short, long, value_name = "FILE", default_value = "banding.html")]
    pub output: PathBuf,
    /// Passes of each render
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "2,8,32", value_parser = clap::value_parser!(u32).range(1..))]
    pub passes: Vec<u32>,
    /// Passes of the bdpt reference
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u32).range(1..))]
    pub reference_passes: u32,
    /// Renders of each method, whose means and standard errors are told
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub seeds: u32,
    #[command(flatten)]
    pub lines: ColorLines,
    #[command(flatten)]
    pub overrides: Overrides,
    /// Renders only this sensor; the first otherwise
    #[arg(long, value_name = "NAME")]
    pub sensor: Option<String>,
    /// Threads; all cores otherwise
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Exposure of the pictures in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, value_parser = values::finite, allow_negative_numbers = true)]
    pub exposure: f64,
    /// Prints nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// Options of `abbe merge`.
#[derive(Debug, Args)]
pub struct MergeOptions {
    /// Part files of the same scene, settings and seed
    #[arg(value_name = "PART", required = true)]
    pub parts: Vec<PathBuf>,
    /// The image to write
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Also writes the sum as a part file
    #[arg(long, value_name = "FILE")]
    pub part: Option<PathBuf>,
    /// Exposure of the preview in stops; by the picture itself otherwise
    #[arg(long, value_name = "EV", value_parser = values::stops, allow_negative_numbers = true)]
    pub exposure: Option<f64>,
    /// Writes no PNG preview
    #[arg(long)]
    pub no_preview: bool,
    /// Prints nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}
