//! The options of `abbe view`.

use super::Overrides;
use super::values;
use crate::io::layers::Layer;
use clap::Args;
use std::path::PathBuf;
use std::str::FromStr as _;

/// Options of `abbe view`.
#[derive(Debug, Args)]
pub struct ViewOptions {
    /// The scene file or model to render and look at, or an image (EXR with channels X, Y, Z),
    /// part, or folder of a job
    #[arg(value_name = "SCENE")]
    pub path: PathBuf,
    /// Passes, one sample per pixel each
    #[arg(long, value_name = "N", value_parser = values::count)]
    pub spp: Option<u32>,
    #[command(flatten)]
    pub overrides: Overrides,
    /// The sensor; the first otherwise
    #[arg(long, value_name = "NAME")]
    pub sensor: Option<String>,
    /// Layers to look at beside the picture, as those of `abbe render --aov`, separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = Layer::from_str)]
    pub aov: Vec<Layer>,
    /// An image or part of the same size to hold the picture against, left of a line
    #[arg(long, value_name = "IMAGE")]
    pub against: Option<PathBuf>,
    /// Threads; all cores otherwise
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Port of the page on 127.0.0.1; a free one otherwise
    #[arg(long, value_name = "PORT", value_parser = clap::value_parser!(u16).range(1..))]
    pub port: Option<u16>,
}

impl ViewOptions {
    /// The overrides of the scene file.
    #[must_use]
    pub fn scene_overrides(&self) -> Vec<(String, String)> {
        let spp = self.spp.map(|n| ("render.spp".to_owned(), n.to_string()));
        let all = spp.into_iter();
        all.chain(self.overrides.set.iter().cloned()).collect()
    }
}
