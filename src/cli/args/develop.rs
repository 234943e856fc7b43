//! The options of `abbe develop`.

use super::values;
use crate::develop::{Display, ToneCurve, White};
use clap::Args;
use std::path::PathBuf;
use std::str::FromStr;

/// Options of `abbe develop`.
#[derive(Debug, Args)]
pub struct DevelopOptions {
    /// Images (EXR with channels X, Y, Z) or parts
    #[arg(value_name = "IMAGE", required = true)]
    pub images: Vec<PathBuf>,
    /// The picture to write; NAME.png in the working directory otherwise. NAME.svg is a figure: the
    /// picture with its scale (mm of a detector), values along a row and a column in cd/m2 or lx,
    /// and the flux through a detector
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Exposure in stops; by the picture itself otherwise (of detectors: the largest value is
    /// white)
    #[arg(long, value_name = "EV", value_parser = values::stops, allow_negative_numbers = true)]
    pub exposure: Option<f64>,
    /// Tone curve; filmic otherwise, of detectors linear
    #[arg(long, value_enum, value_name = "NAME")]
    pub tone: Option<ToneCurve>,
    /// The color that is to be white: none (D65), scene (the mean of the picture), R,G,B, a
    /// temperature such as 3200K, or a spectrum such as D50
    #[arg(long, value_name = "COLOR", default_value = "none", value_parser = White::from_str)]
    pub white: White,
    /// The display
    #[arg(long, value_enum, value_name = "NAME", default_value_t = Display::Srgb)]
    pub display: Display,
    /// Bits per channel
    #[arg(long, value_name = "BITS", default_value = "8", value_parser = ["8", "16"])]
    pub depth: String,
    /// The pixel whose row and column a figure shows; the centroid of the light otherwise
    #[arg(long, value_name = "X,Y", value_parser = values::pixel)]
    pub at: Option<[u32; 2]>,
    /// A layer of the image, such as regularized; the picture itself otherwise
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
    /// Prints nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}
