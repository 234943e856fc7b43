//! `abbe job collect`: the image of what is done.

use super::run::damage;
use crate::cli::args::CollectOptions;
use crate::cli::ending;
use crate::cli::image_output::FilmTargets;
use crate::cli::{CliError, Outcome, print, tell};
use crate::io::destination::Claims;
use crate::io::part;
use crate::io::part::Part;
use crate::job::Folder;
use crate::job::status::error_of;
use crate::report::readable::counted;

/// Runs the command.
pub fn run(options: &CollectOptions) -> Result<Outcome, CliError> {
    let job = Folder::open(&options.job)?;
    ending::image(&options.output)?;
    let header = &job.manifest.header;
    let targets = FilmTargets::of(header, &options.output, !options.no_preview);
    let mut claims = Claims::of_inputs([options.job.join("job.json")]);
    let images = targets.iter().flat_map(FilmTargets::paths);
    for path in images.chain(&options.part) {
        claims.output(path)?;
    }
    let Some(sum) = job.sum(|found| tell(&damage(found)))? else {
        let text = "no chunk is done yet: there is no image".to_owned();
        return Err(CliError::Failed(text));
    };
    if options.remove {
        check_finished(&job, &sum)?;
    }
    if let Some(path) = &options.part {
        part::write(path, &sum)?;
    }
    let passes = sum.header.pass_count();
    let status = job.status()?;
    let all = match status.passes {
        Some(all) if u64::from(all) > passes => format!(" of {all}"),
        _ => String::new(),
    };
    let passes = counted(passes, "pass", "passes");
    for (film, target) in sum.each().iter().zip(&targets) {
        let preview = target.write(film, options.exposure)?;
        if options.quiet {
            continue;
        }
        print(&format!("{}: {passes}{all}\n", target.image.display()))?;
        if let Some(text) = preview {
            print(&format!("  preview   {text}\n"))?;
        }
    }
    if options.remove {
        job.remove()?;
    } else {
        // on a disk that is only read, nothing is removed
        _ = job.sweep(job.manifest.lease_ms);
    }
    Ok(Outcome::Done)
}

/// Whether a job is as good as it gets, and nobody works on it.
fn check_finished(job: &Folder, sum: &Part) -> Result<(), CliError> {
    let status = job.status()?;
    let error = error_of(sum)?.map(|e| e.relative);
    let target = job.manifest.target_error.map(|t| t.0);
    let is_reached = error
        .zip(target)
        .is_some_and(|(error, target)| error <= target);
    let is_complete = status.chunks == Some(status.done);
    let at_work = status.workers.iter().filter(|w| !w.is_dead).count();
    if at_work > 0 || !(is_complete || is_reached) {
        let workers = counted(at_work as u64, "worker is", "workers are");
        return Err(CliError::Failed(format!(
            "--remove: the job is not finished ({} chunks done, {workers} at work)",
            status.done
        )));
    }
    Ok(())
}
