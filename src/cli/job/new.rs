//! `abbe job new`: the folder of a job.

use super::time_text;
use crate::cli::args::NewJobOptions;
use crate::cli::usage::bytes_text;
use crate::cli::{CliError, Outcome, memory, print, tell, threads};
use crate::job::freeze::{self, Made, Request};
use crate::report::readable::counted;

/// Runs the command.
pub fn run(options: &NewJobOptions) -> Result<Outcome, CliError> {
    options.moment.check(&options.scene)?;
    let request = Request {
        scene: options.scene.clone(),
        overrides: options.scene_overrides(),
        sensor: options.sensor.clone(),
        together: options.together,
        spectral: options.spectral,
        crop: options.crop,
        target_error: options.target_error,
        is_endless: options.target_error.is_some() && options.spp.is_none(),
        chunk: options.chunk.unwrap_or_default(),
        lease: options.lease,
    };
    let pool = threads::pool(options.threads)?;
    let make = || pool.install(|| freeze::make(&options.output, &request));
    let made = memory::guarded(None, make)??;
    for warning in &made.warnings {
        tell(&format!("warning: {warning}"));
    }
    if !options.quiet {
        print(&text(options, &made, pool.current_num_threads()))?;
    }
    Ok(Outcome::Done)
}

fn text(options: &NewJobOptions, made: &Made, threads: usize) -> String {
    let (job, manifest) = (options.output.display(), &made.folder.manifest);
    let chunks = manifest.chunks();
    let chunk = counted(manifest.chunk.into(), "pass", "passes");
    let threads = counted(threads as u64, "thread", "threads");
    let long = made.pass_time.map_or_else(String::new, |pass| {
        let time = time_text(pass * manifest.chunk);
        format!(", about {time} each with {threads}")
    });
    let mut text = if manifest.is_endless() {
        format!("{job}: chunks of {chunk}{long}\n")
    } else {
        let passes = counted(manifest.passes.into(), "pass", "passes");
        let chunks = counted(chunks.count().into(), "chunk", "chunks");
        format!("{job}: {passes} in {chunks} of {chunk}{long}\n")
    };
    let files = counted(manifest.files.len() as u64, "file", "files");
    text += &format!("  copies    {files}, {}\n", bytes_text(made.copied));
    text += &format!(
        "  disk      a part has up to {}; up to {} with one worker, {} more for each further one\n",
        bytes_text(manifest.part_bytes()),
        counted(made.folder.most_parts().into(), "part", "parts"),
        freeze::PARTS_OF_A_WORKER,
    );
    text
}
