//! The options of `abbe render`, `info` and `convert`.

use super::overrides::{Moment, Overrides};
use super::values;
use crate::film::Crop;
use crate::io::layers::Layer;
use crate::scene::settings::{Aiming, FilterKind, Heuristic, IntegratorKind, Regularize, Sharing};
use clap::Args;
use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;

/// Options of `abbe render`.
#[derive(Debug, Args)]
pub struct RenderOptions {
    /// The scene file, or a model (.gltf, .glb, .obj, .ply)
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The image to write; NAME.exr (NAME.SENSOR.exr with several sensors) in the working directory
    /// otherwise
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// The algorithm
    #[arg(long, value_enum, value_name = "NAME")]
    pub integrator: Option<IntegratorKind>,
    /// Passes, one sample per pixel each
    #[arg(long, value_name = "N", value_parser = values::count, conflicts_with = "passes")]
    pub spp: Option<u32>,
    /// The passes A, A+1, ..., B-1
    #[arg(long, value_name = "A..B", value_parser = values::passes)]
    pub passes: Option<Range<u32>>,
    /// Stops after the pass in which this much time is used up, such as 90s or 2m, per sensor;
    /// without --spp or --passes there is no other limit
    #[arg(long, value_name = "TIME", value_parser = values::seconds, allow_negative_numbers = true)]
    pub time: Option<f64>,
    /// Stops when the estimated relative error of the image is below R
    #[arg(long, value_name = "R", value_parser = values::positive, allow_negative_numbers = true)]
    pub target_error: Option<f64>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub seed: Option<u64>,
    /// Threads; all cores otherwise
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Wavelengths per path
    #[arg(long, value_name = "N", value_parser = ["1", "4", "8"])]
    pub lanes: Option<String>,
    /// Weighting of strategies
    #[arg(long, value_enum, value_name = "NAME")]
    pub heuristic: Option<Heuristic>,
    /// Whether mirrors and smooth glass are connectible within a small cone
    #[arg(long, value_enum, value_name = "MODE")]
    pub regularize: Option<Regularize>,
    /// Which chains of mirrors and smooth glass are solved for
    #[arg(long, value_enum, value_name = "WHICH")]
    pub aim: Option<Aiming>,
    /// Half-aperture of that cone in the first pass in radians, or auto
    #[arg(long, value_name = "RAD", value_parser = values::epsilon)]
    pub epsilon: Option<String>,
    /// Wavelengths and time that the paths of a pass share where photons are merged
    #[arg(long, value_enum, value_name = "NAME")]
    pub sharing: Option<Sharing>,
    /// Scattering vertices of the whole path, at most
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16))]
    pub max_depth: Option<u16>,
    /// Reconstruction filter
    #[arg(long, value_enum, value_name = "NAME")]
    pub filter: Option<FilterKind>,
    /// Wavelengths to draw: scene, uniform, visible, even, a range A..B, or a list of lines such as
    /// 486.1,587.6 (nm)
    #[arg(long, value_name = "SPEC", value_parser = values::wavelengths)]
    pub wavelengths: Option<String>,
    /// Holds all paths to a sequence of smooth surfaces, such as 'L T(1) R(2) R(1) T(2) E'
    /// (may be given several times), or to ghosts: all of two reflections of the only lens
    #[arg(long, value_name = "SEQUENCE", value_parser = values::sequence)]
    pub sequence: Vec<String>,
    #[command(flatten)]
    pub moment: Moment,
    #[command(flatten)]
    pub overrides: Overrides,
    /// Renders only this sensor
    #[arg(long, value_name = "NAME")]
    pub sensor: Option<String>,
    /// Fills all detectors by one set of light sub-paths (with the integrator light): five planes
    /// cost one render. The pixels of the largest say how many a pass has
    #[arg(long, conflicts_with_all = ["sensor", "crop"])]
    pub together: bool,
    /// Renders only the pixels X0 <= x < X1, Y0 <= y < Y1
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = values::crop)]
    pub crop: Option<Crop>,
    /// Exposure of the preview in stops; by the picture itself otherwise
    #[arg(long, value_name = "EV", value_parser = values::stops, allow_negative_numbers = true)]
    pub exposure: Option<f64>,
    /// Writes no PNG preview
    #[arg(long)]
    pub no_preview: bool,
    /// Extra layers: error, noise, strategies, regularized, unbiased, bias, depth, normal, albedo,
    /// direct, ghosts, class:REGEX (such as class:^LS+DE$ or class:'^L T(1) R(2) R(1) T(2) E$'),
    /// separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = Layer::from_str)]
    pub aov: Vec<Layer>,
    /// Also writes NAME.spectral.exr, with BINS channels over the range of wavelengths and one for
    /// each emission line
    #[arg(long, value_name = "BINS", num_args = 0..=1, default_missing_value = "47", value_parser = clap::value_parser!(u16).range(1..=4096))]
    pub spectral: Option<u16>,
    /// Writes the exact sums of the passes, for `abbe merge` and --resume
    #[arg(long, value_name = "FILE", conflicts_with = "aov")]
    pub part: Option<PathBuf>,
    /// Continues with the passes that the file given by --part does not hold yet
    #[arg(long, requires = "part")]
    pub resume: bool,
    /// Begins the file given by --part anew, even where it holds passes
    #[arg(long, requires = "part", conflicts_with = "resume")]
    pub overwrite: bool,
    /// Writes statistics as JSON, with the table of path classes and strategies
    #[arg(long, value_name = "FILE")]
    pub stats: Option<PathBuf>,
    /// Shows the picture while it renders in the image viewer tev that listens there, such as
    /// 127.0.0.1:14158
    #[arg(long, value_name = "HOST:PORT", value_parser = values::host_and_port)]
    pub tev: Option<String>,
    /// Shows the picture while it renders in the browser, as `abbe view` does
    #[cfg(feature = "view")]
    #[arg(long)]
    pub view: bool,
    /// Refuses to load or render what needs more memory than SIZE in all, such as 500M or 2G; what
    /// the machine has otherwise
    #[arg(long, value_name = "SIZE", value_parser = values::size)]
    pub max_memory: Option<u64>,
    /// Tells what the scene calls for, how it is rendered, what it takes, and why
    #[arg(short, long, conflicts_with = "quiet")]
    pub verbose: bool,
    /// Prints nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

impl RenderOptions {
    /// The overrides of the scene file: the options that have a key in it, then those of `--set`.
    #[must_use]
    pub fn scene_overrides(&self) -> Vec<(String, String)> {
        let options = [
            ("integrator", self.integrator.map(|v| v.to_string())),
            ("spp", self.spp.map(|v| v.to_string())),
            ("seed", self.moment.seed(self.seed).map(|v| v.to_string())),
            ("lanes", self.lanes.clone()),
            ("weights", self.heuristic.map(|v| v.to_string())),
            ("aim", self.aim.map(|v| v.to_string())),
            ("regularize", self.regularize.map(|v| v.to_string())),
            ("epsilon", self.epsilon.clone()),
            ("sharing", self.sharing.map(|v| v.to_string())),
            ("max_depth", self.max_depth.map(|v| v.to_string())),
            ("filter", self.filter.map(|v| v.to_string())),
            ("wavelengths", self.wavelengths.clone()),
            ("sequences", values::sequences(&self.sequence)),
        ];
        let options = options
            .into_iter()
            .filter_map(|(key, value)| Some((format!("render.{key}"), value?)));
        options
            .chain(self.moment.overrides())
            .chain(self.overrides.set.iter().cloned())
            .collect()
    }
}

/// Options of `abbe info`.
#[derive(Debug, Args)]
pub struct InfoOptions {
    /// The scene file, or a model (.gltf, .glb, .obj, .ply)
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    #[command(flatten)]
    pub overrides: Overrides,
    /// Prints JSON
    #[arg(long)]
    pub json: bool,
}

/// Options of `abbe convert`.
#[derive(Debug, Args)]
pub struct ConvertOptions {
    /// The model: glTF (.gltf, .glb), OBJ or PLY
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// The scene file to write, in the model's folder or above it
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Takes the place of a scene file that is there
    #[arg(long)]
    pub overwrite: bool,
    /// Prints nothing but warnings and errors
    #[arg(short, long)]
    pub quiet: bool,
}
