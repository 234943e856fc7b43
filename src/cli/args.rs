//! The options of every command. Values are checked as they are parsed, so that wrong ones are usage errors that say what is
//! allowed.

use super::overrides::{Moment, Overrides};
use crate::film::Crop;
use crate::math::banding::Axis;
use clap::{Args, Parser, Subcommand, ValueEnum};
use regex::Regex;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::LazyLock;

/// Version of the program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Version, target and profile.
fn long_version() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| {
        let profile = if cfg!(debug_assertions) {
            "debug"
        } else {
            "release"
        };
        format!(
            "{VERSION} ({} {}, {profile})",
            std::env::consts::ARCH,
            std::env::consts::OS
        )
    });
    &TEXT
}

/// Spectral bidirectional path tracer for dispersive glass and correct color.
#[derive(Debug, Parser)]
#[command(name = "abbe", version = long_version(), disable_help_subcommand = true)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Renders a scene to an EXR image of XYZ with a PNG preview beside it
    Render(Box<RenderOptions>),
    /// Says what a scene holds and calls for, and why
    Info(InfoOptions),
    /// Shows what accuracy costs in time: renders a scene by several methods and reports error against time
    Cost(Box<CostOptions>),
    /// Measures how far an image is from a reference
    Compare(CompareOptions),
    /// Shows the refractive index of a glass
    Glass(GlassOptions),
    /// Adds up part files of disjoint passes
    Merge(MergeOptions),
    /// Shows what sharing wavelengths and times in a pass does: photon merging beside bidirectional path tracing
    Banding(BandingOptions),
    /// Writes an editable scene file that refers to a model
    Convert(ConvertOptions),
}

/// Names of integrators.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum IntegratorName {
    /// Paths from the camera
    Path,
    /// Paths from the lights
    Light,
    /// Both, weighted together
    Bdpt,
    /// Both, and photon merging, weighted together
    Vcm,
    /// Photon merging at every vertex that scatters diffusely or glossily
    Bpm,
    /// Photon merging at the first such vertex from the camera
    Ppm,
}

/// Names of weightings.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum HeuristicName {
    /// In proportion to the densities
    Balance,
    /// In proportion to their squares
    Power2,
}

/// Names of the modes of regularization.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum RegularizeName {
    /// As mis for image cameras in scenes with mirrors or smooth glass, else off
    Auto,
    /// Never
    Off,
    /// Only for paths that nothing else makes, by one strategy
    Single,
    /// By every strategy, weighted with all others
    Mis,
}

/// What the paths of a pass share where photons are merged.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum SharingName {
    /// One wavelength set and time, one of the set as everybody's hero
    Hero,
    /// One set and time; the set's wavelengths take turns as heroes over the pixels
    Set,
    /// As hero, with sets and times of successive passes kept apart
    Stratified,
}

/// Names of filters.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum FilterName {
    /// The pixel itself
    Box,
    /// A product of triangles
    Tent,
    /// A Gaussian
    Gaussian,
}

/// One extra layer of the image.
#[derive(Clone, Debug)]
pub enum Aov {
    /// Standard error of Y.
    Error,
    /// One image per strategy (s, t).
    Strategies,
    /// Distance of the first hit.
    Depth,
    /// Shading normal of the first hit.
    Normal,
    /// Reflectance of the first hit.
    Albedo,
    /// Contributions joined at specular vertices.
    Regularized,
    /// All other contributions.
    Unbiased,
    /// Difference of the halves of a render with `bias_estimate`, as a bias.
    Bias,
    /// Paths of one class.
    Class(Regex),
}

/// Options of `abbe render`.
#[derive(Debug, Args)]
pub struct RenderOptions {
    /// The scene file, or a model (.gltf, .glb, .obj, .ply)
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The image to write; NAME.exr (NAME.SENSOR.exr with several sensors) in the working directory otherwise
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// The algorithm
    #[arg(long, value_enum, value_name = "NAME")]
    pub integrator: Option<IntegratorName>,
    /// Passes, one sample per pixel each
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), conflicts_with = "passes")]
    pub spp: Option<u32>,
    /// The passes A, A+1, ..., B-1
    #[arg(long, value_name = "A..B", value_parser = passes)]
    pub passes: Option<Range<u32>>,
    /// Stops after the pass in which this much time is used up, per sensor; without --spp or --passes there is no other limit
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_negative_numbers = true)]
    pub time: Option<f64>,
    /// Stops when the estimated relative error of the image is below R
    #[arg(long, value_name = "R", value_parser = positive, allow_negative_numbers = true)]
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
    pub heuristic: Option<HeuristicName>,
    /// Whether mirrors and smooth glass are connectible within a small cone
    #[arg(long, value_enum, value_name = "MODE")]
    pub regularize: Option<RegularizeName>,
    /// Half-aperture of that cone in the first pass in radians, or auto
    #[arg(long, value_name = "RAD", value_parser = epsilon)]
    pub epsilon: Option<String>,
    /// What the paths of a pass share where photons are merged
    #[arg(long, value_enum, value_name = "NAME")]
    pub sharing: Option<SharingName>,
    /// Scattering vertices of the whole path, at most
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16))]
    pub max_depth: Option<u16>,
    /// Reconstruction filter
    #[arg(long, value_enum, value_name = "NAME")]
    pub filter: Option<FilterName>,
    /// Wavelengths to draw: scene, uniform, visible, a range A..B, or a list of lines such as 486.1,587.6 (nm)
    #[arg(long, value_name = "SPEC", value_parser = wavelengths)]
    pub wavelengths: Option<String>,
    #[command(flatten)]
    pub moment: Moment,
    #[command(flatten)]
    pub overrides: Overrides,
    /// Renders only this sensor
    #[arg(long, value_name = "NAME")]
    pub sensor: Option<String>,
    /// Renders only the pixels X0 <= x < X1, Y0 <= y < Y1
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = crop)]
    pub crop: Option<Crop>,
    /// Exposure of the preview in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, value_parser = finite, allow_negative_numbers = true)]
    pub exposure: f64,
    /// Writes no PNG preview
    #[arg(long)]
    pub no_preview: bool,
    /// Extra layers: error, strategies, regularized, unbiased, bias, depth, normal, albedo, class:REGEX (such as class:^LS+DE$), separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = aov)]
    pub aov: Vec<Aov>,
    /// Also writes NAME.spectral.exr, with BINS channels over the range of wavelengths and one for each emission line
    #[arg(long, value_name = "BINS", num_args = 0..=1, default_missing_value = "47", value_parser = clap::value_parser!(u16).range(1..=4096))]
    pub spectral: Option<u16>,
    /// Writes the exact sums of the passes, for `abbe merge` and --resume
    #[arg(long, value_name = "FILE", conflicts_with_all = ["aov", "spectral"])]
    pub part: Option<PathBuf>,
    /// Continues with the passes that the file given by --part does not hold yet
    #[arg(long, requires = "part")]
    pub resume: bool,
    /// Writes statistics as JSON, with the table of path classes and strategies
    #[arg(long, value_name = "FILE")]
    pub stats: Option<PathBuf>,
    /// Refuses to start where films, meshes, textures and photons need more memory than SIZE, such as 500M or 2G
    #[arg(long, value_name = "SIZE", value_parser = size)]
    pub max_memory: Option<u64>,
    /// Prints nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
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

/// Parts of the matrix of `abbe cost`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CostGroup {
    /// Integrators and modes of regularization
    Methods,
    /// The scene without one of its effects each
    Effects,
    /// Other values of one setting each
    Settings,
}

/// Options of `abbe cost`.
#[derive(Debug, Args)]
pub struct CostOptions {
    /// The scene file
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The image to measure errors against; one is rendered by another estimator otherwise
    #[arg(long, value_name = "FILE")]
    pub reference: Option<PathBuf>,
    /// Time for each variant and seed, such as 10s or 2m (the reference has eight times as much)
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = seconds)]
    pub budget: f64,
    /// Seeds per variant, for the spread
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub seeds: u32,
    /// The folder for report, tables and images; NAME.cost in the working directory otherwise
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
    /// What is varied
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',', default_values = ["methods", "effects", "settings"])]
    pub vary: Vec<CostGroup>,
    /// Also plots the value of this pixel against time
    #[arg(long, value_name = "X,Y", value_parser = pixel)]
    pub probe: Option<[u32; 2]>,
    /// Measures this sensor; the first otherwise
    #[arg(long, value_name = "NAME")]
    pub sensor: Option<String>,
    /// Threads; all cores otherwise
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    #[command(flatten)]
    pub overrides: Overrides,
    /// Prints nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// Options of `abbe compare`.
#[derive(Debug, Args)]
pub struct CompareOptions {
    /// The image (EXR with channels X, Y, Z)
    #[arg(value_name = "IMAGE")]
    pub image: PathBuf,
    /// What it should be; without it only bands are measured
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
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = crop)]
    pub region: Option<Crop>,
    /// Where color (or the moment) changes: along x, along y, or with the distance from the pixel X,Y
    #[arg(long, value_name = "x | y | X,Y", default_value = "x", value_parser = axis, allow_negative_numbers = true)]
    pub axis: Axis,
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
    #[arg(long, value_name = "EV", default_value_t = 0.0, value_parser = finite, allow_negative_numbers = true)]
    pub exposure: f64,
    /// Prints nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// Options of `abbe glass`.
#[derive(Debug, Args)]
pub struct GlassOptions {
    /// The glass, such as schott:N-SF11 or N-SF11
    #[arg(value_name = "NAME", required_unless_present = "list")]
    pub name: Option<String>,
    /// Lists the names of all glasses
    #[arg(long, conflicts_with = "name")]
    pub list: bool,
    /// Prints JSON
    #[arg(long)]
    pub json: bool,
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
    /// Exposure of the preview in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, value_parser = finite, allow_negative_numbers = true)]
    pub exposure: f64,
    /// Writes no PNG preview
    #[arg(long)]
    pub no_preview: bool,
    /// Prints nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
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
    /// Prints nothing but warnings and errors
    #[arg(short, long)]
    pub quiet: bool,
}

impl RenderOptions {
    /// The overrides of the scene file: the options that have a key in it, then those of `--set`.
    #[must_use]
    pub fn scene_overrides(&self) -> Vec<(String, String)> {
        let named =
            |value: Option<clap::builder::PossibleValue>| value.map(|v| v.get_name().to_owned());
        let options = [
            (
                "integrator",
                named(self.integrator.and_then(|v| v.to_possible_value())),
            ),
            ("spp", self.spp.map(|v| v.to_string())),
            ("seed", self.seed.map(|v| v.to_string())),
            ("lanes", self.lanes.clone()),
            (
                "heuristic",
                named(self.heuristic.and_then(|v| v.to_possible_value())),
            ),
            (
                "regularize",
                named(self.regularize.and_then(|v| v.to_possible_value())),
            ),
            ("epsilon", self.epsilon.clone()),
            (
                "sharing",
                named(self.sharing.and_then(|v| v.to_possible_value())),
            ),
            ("max_depth", self.max_depth.map(|v| v.to_string())),
            (
                "filter",
                named(self.filter.and_then(|v| v.to_possible_value())),
            ),
            ("wavelengths", self.wavelengths.clone()),
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

fn passes(text: &str) -> Result<Range<u32>, String> {
    let parsed = text
        .split_once("..")
        .and_then(|(a, b)| Some(a.parse().ok()?..b.parse().ok()?));
    // the last index is the pilot's
    parsed
        .filter(|r: &Range<u32>| r.start < r.end && r.end < u32::MAX)
        .ok_or_else(|| "expected A..B with 0 <= A < B: the passes A, A+1, ..., B-1".to_owned())
}

fn crop(text: &str) -> Result<Crop, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x0, y0, x1, y1]) if x0 < x1 && y0 < y1 => Ok(Crop { x0, y0, x1, y1 }),
        _ => Err(
            "expected X0,Y0,X1,Y1 with X0 < X1 and Y0 < Y1, in pixels from the top left".to_owned(),
        ),
    }
}

fn axis(text: &str) -> Result<Axis, String> {
    let point = || {
        let (x, y) = text.split_once(',')?;
        Some(Axis::Distance([finite(x).ok()?, finite(y).ok()?]))
    };
    match text {
        "x" => Ok(Axis::X),
        "y" => Ok(Axis::Y),
        _ => point().ok_or_else(|| "expected x, y, or a pixel X,Y".to_owned()),
    }
}

pub(super) fn finite(text: &str) -> Result<f64, String> {
    text.trim()
        .parse()
        .ok()
        .filter(|v: &f64| v.is_finite())
        .ok_or_else(|| "expected a number".to_owned())
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    finite(text)
        .ok()
        .filter(|&v| v > 0.0)
        .ok_or_else(|| "expected a number above 0".to_owned())
}

/// A time with an optional unit.
fn seconds(text: &str) -> Result<f64, String> {
    let number = text.trim_end_matches(['s', 'm', 'h']);
    let unit = match &text[number.len()..] {
        "" | "s" => 1.0,
        "m" => 60.0,
        "h" => 3600.0,
        _ => f64::NAN,
    };
    positive(number)
        .map(|n| n * unit)
        .ok()
        .filter(|s| s.is_finite())
        .ok_or_else(|| "expected a time above 0 such as 10s, 2m or 1h".to_owned())
}

fn pixel(text: &str) -> Result<[u32; 2], String> {
    text.split_once(',')
        .and_then(|(x, y)| Some([x.trim().parse().ok()?, y.trim().parse().ok()?]))
        .ok_or_else(|| "expected X,Y: a pixel, from the top left".to_owned())
}

/// The value of `render.epsilon` that says the same.
fn epsilon(text: &str) -> Result<String, String> {
    if text == "auto" {
        return Ok(text.to_owned());
    }
    positive(text)
        .map(|v| format!("{v:?}"))
        .map_err(|_| "expected an angle in radians above 0, or auto".to_owned())
}

/// A number of bytes with an optional suffix K, M, G or T (powers of 1024).
fn size(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(['K', 'M', 'G', 'T']);
    let shift = match &text[digits.len()..] {
        "" => 0,
        "K" => 10,
        "M" => 20,
        "G" => 30,
        "T" => 40,
        _ => 64,
    };
    let bytes = digits
        .parse::<u64>()
        .ok()
        .and_then(|n| n.checked_mul(1_u64.checked_shl(shift)?));
    bytes
        .filter(|&b| b > 0)
        .ok_or_else(|| "expected a number of bytes such as 500M or 2G".to_owned())
}

/// The value of `render.wavelengths` that says the same.
fn wavelengths(text: &str) -> Result<String, String> {
    if ["scene", "uniform", "visible"].contains(&text) {
        return Ok(text.to_owned());
    }
    if let Some((a, b)) = text.split_once("..")
        && let (Ok(a), Ok(b)) = (finite(a), finite(b))
    {
        return Ok(format!("{{ range_nm = [{a:?}, {b:?}] }}"));
    }
    let lines: Result<Vec<f64>, String> = text.split(',').map(finite).collect();
    let wrong =
        |_| "expected scene, uniform, visible, A..B or a list of wavelengths in nm".to_owned();
    lines
        .map(|lines| format!("{{ lines_nm = {lines:?} }}"))
        .map_err(wrong)
}

fn aov(text: &str) -> Result<Aov, String> {
    Ok(match text {
        "error" => Aov::Error,
        "strategies" => Aov::Strategies,
        "depth" => Aov::Depth,
        "normal" => Aov::Normal,
        "albedo" => Aov::Albedo,
        "regularized" => Aov::Regularized,
        "unbiased" => Aov::Unbiased,
        "bias" => Aov::Bias,
        _ => {
            let expression = text
                .strip_prefix("class:")
                .ok_or("expected error, strategies, regularized, unbiased, bias, depth, normal, albedo or class:REGEX")?;
            let wrong = |e: regex::Error| {
                e.to_string()
                    .lines()
                    .last()
                    .unwrap_or("not a regular expression")
                    .to_owned()
            };
            Aov::Class(Regex::new(expression).map_err(wrong)?)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn render(arguments: &[&str]) -> Result<Box<RenderOptions>, clap::Error> {
        let all = ["abbe", "render", "scene.toml"].iter().chain(arguments);
        match Arguments::try_parse_from(all)?.command {
            Command::Render(options) => Ok(options),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn definitions_are_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn options_become_overrides_and_set_comes_last() {
        let options = render(&[
            "--spp",
            "3",
            "--integrator",
            "light",
            "--wavelengths",
            "486.1,600",
            "--set",
            "render.spp = 5",
        ]);
        let overrides = options.unwrap().scene_overrides();
        let as_text: Vec<String> = overrides.iter().map(|(k, v)| format!("{k}={v}")).collect();
        let expected = [
            "render.integrator=light",
            "render.spp=3",
            "render.wavelengths={ lines_nm = [486.1, 600.0] }",
            "render.spp=5",
        ];
        assert_eq!(as_text, expected);
    }

    #[test]
    fn ranges_and_crops_are_checked() {
        assert_eq!(passes("3..8"), Ok(3..8));
        for wrong in ["3", "3..3", "8..3", "-1..3", "a..b", "0..4294967295"] {
            assert!(passes(wrong).is_err(), "{wrong}");
        }
        assert_eq!(
            crop("1,2,3,4"),
            Ok(Crop {
                x0: 1,
                y0: 2,
                x1: 3,
                y1: 4
            })
        );
        for wrong in ["1,2,3", "1,2,1,4", "1,2,3,2", "1,2,3,4,5", "a,b,c,d", ""] {
            assert!(crop(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn sizes_have_suffixes() {
        assert_eq!(size("500"), Ok(500));
        assert_eq!(size("2G"), Ok(2 << 30));
        for wrong in ["0", "G", "2GM", "2g", "-1", "99999999999T"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn layers_are_named_or_classes() {
        let options = render(&["--aov", "error,class:^LS+DE$,depth"]).unwrap();
        assert!(
            matches!(&options.aov[..], [Aov::Error, Aov::Class(r), Aov::Depth] if r.is_match("LSSDE"))
        );
        assert!(render(&["--aov", "noise"]).is_err());
        assert!(render(&["--aov", "class:("]).is_err());
    }

    #[test]
    fn spectral_has_a_default_number_of_bins() {
        assert_eq!(render(&["--spectral"]).unwrap().spectral, Some(47));
        assert_eq!(render(&["--spectral", "5"]).unwrap().spectral, Some(5));
        assert_eq!(render(&[]).unwrap().spectral, None);
    }
}
