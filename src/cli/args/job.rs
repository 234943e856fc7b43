//! The options of `abbe job new`, `run`, `status` and `collect`.

use super::overrides::{Moment, Overrides};
use super::values;
use crate::film::Crop;
use crate::job::freeze::ChunkLength;
use clap::{Args, Subcommand};
use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;

/// Options of `abbe job`.
#[derive(Debug, Args)]
pub struct JobOptions {
    /// Command to carry out.
    #[command(subcommand)]
    pub command: JobCommand,
}

/// The commands of jobs.
#[derive(Debug, Subcommand)]
pub enum JobCommand {
    /// Makes a job: a folder with all that the scene reads, cut into chunks of passes
    New(NewJobOptions),
    /// Works on a job until no chunk is left
    Run(RunOptions),
    /// Says how far a job is, who works on it, and how long that will take
    Status(StatusOptions),
    /// Makes the image of all chunks that are done
    Collect(CollectOptions),
}

/// Options of `abbe job new`.
#[derive(Debug, Args)]
pub struct NewJobOptions {
    /// The scene file, or a model (.gltf, .glb, .obj, .ply)
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The folder to make
    #[arg(short, long, value_name = "JOB")]
    pub output: PathBuf,
    /// Passes, one sample per pixel each
    #[arg(long, value_name = "N", value_parser = values::count)]
    pub spp: Option<u32>,
    /// No more chunks are begun once the estimated relative error of the image is below R; without
    /// --spp there is no other limit
    #[arg(long, value_name = "R", value_parser = values::positive, allow_negative_numbers = true)]
    pub target_error: Option<f64>,
    /// Length of a chunk: a time on this machine, such as 10m, or a number of passes; 10m otherwise
    #[arg(long, value_name = "TIME | N", value_parser = values::chunk)]
    pub chunk: Option<ChunkLength>,
    /// A worker that has not shown for this long that it lives counts as dead
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = values::lease)]
    pub lease: Duration,
    /// Renders this sensor
    #[arg(long, value_name = "NAME")]
    pub sensor: Option<String>,
    /// Fills all detectors by one set of light sub-paths (with the integrator light)
    #[arg(long, conflicts_with_all = ["sensor", "crop"])]
    pub together: bool,
    /// Also keeps the spectral image, with BINS channels over the range of wavelengths and one for
    /// each emission line
    #[arg(long, value_name = "BINS", num_args = 0..=1, default_missing_value = "47", value_parser = clap::value_parser!(u16).range(1..=4096))]
    pub spectral: Option<u16>,
    /// Renders only the pixels X0 <= x < X1, Y0 <= y < Y1
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = values::crop)]
    pub crop: Option<Crop>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub seed: Option<u64>,
    #[command(flatten)]
    pub moment: Moment,
    #[command(flatten)]
    pub overrides: Overrides,
    /// Threads for the pilots and for the passes that are measured; all cores otherwise
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Prints nothing but warnings and errors
    #[arg(short, long)]
    pub quiet: bool,
}

impl NewJobOptions {
    /// The overrides of the scene file: the options that have a key in it, then those of `--set`.
    #[must_use]
    pub fn scene_overrides(&self) -> Vec<(String, String)> {
        let seed = self.moment.seed(self.seed);
        let options = [
            ("render.spp", self.spp.map(u64::from)),
            ("render.seed", seed),
        ];
        let options = options
            .into_iter()
            .filter_map(|(key, value)| Some((key.to_owned(), value?.to_string())));
        options
            .chain(self.moment.overrides())
            .chain(self.overrides.set.iter().cloned())
            .collect()
    }
}

/// Options of `abbe job run`.
#[derive(Debug, Args)]
pub struct RunOptions {
    /// The job
    #[arg(value_name = "JOB")]
    pub job: PathBuf,
    /// A name for this process, to which random digits are added
    #[arg(long, value_name = "NAME", value_parser = values::worker)]
    pub worker: Option<String>,
    /// Works only on the chunks A, A+1, ..., B-1
    #[arg(long, value_name = "A..B", value_parser = values::chunks)]
    pub chunks: Option<Range<u32>>,
    /// Ends while others work on the last chunks, instead of waiting in case one of them dies
    #[arg(long)]
    pub no_wait: bool,
    /// Threads; all cores otherwise
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Prints nothing but warnings and errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// Options of `abbe job status`.
#[derive(Debug, Args)]
pub struct StatusOptions {
    /// The job
    #[arg(value_name = "JOB")]
    pub job: PathBuf,
    /// Reads no sums: without the error, and at once
    #[arg(long)]
    pub quick: bool,
    /// Prints JSON
    #[arg(long)]
    pub json: bool,
}

/// Options of `abbe job collect`.
#[derive(Debug, Args)]
pub struct CollectOptions {
    /// The job
    #[arg(value_name = "JOB")]
    pub job: PathBuf,
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
    /// Removes the job once the image is written; only if it is complete and nobody works on it
    #[arg(long)]
    pub remove: bool,
    /// Prints nothing but warnings and errors
    #[arg(short, long)]
    pub quiet: bool,
}
