//! `abbe merge`: the images of disjoint passes, from their exact sums.

use super::args::MergeOptions;
use super::ending;
use super::image_output::FilmTargets;
use super::{CliError, Outcome, print, tell};
use crate::io::destination::Claims;
use crate::io::part::{self, Part, PartError};
use std::path::Path;

/// Runs the command.
pub fn run(options: &MergeOptions) -> Result<Outcome, CliError> {
    ending::image(&options.output)?;
    let mut claims = Claims::of_inputs(&options.parts);
    if let Some(part) = &options.part {
        claims.output(part)?;
    }
    let merged = part::merge_each(options.parts.iter().map(|path| whole_passes(path)))?;
    if merged.header.pass_count() == 0 {
        let text =
            "no pass of these parts is whole: there is no image (render goes on with --resume)";
        return Err(CliError::Failed(text.to_owned()));
    }
    if merged.header.channels != 3 {
        return Err(CliError::Failed(format!(
            "the parts have {} channels, not X, Y and Z",
            merged.header.channels
        )));
    }
    let targets = FilmTargets::of(&merged.header, &options.output, !options.no_preview);
    for path in targets.iter().flat_map(FilmTargets::paths) {
        claims.output(path)?;
    }
    let passes = merged.header.pass_count();
    if let Some(path) = &options.part {
        part::write(path, &merged)?;
    }
    let parts = options.parts.len();
    let [part, pass] = [
        (parts, "part", "parts"),
        (passes as usize, "pass", "passes"),
    ]
    .map(|(n, one, several)| format!("{n} {}", if n == 1 { one } else { several }));
    for (film, target) in merged.each().iter().zip(&targets) {
        let preview = target.write(film, options.exposure)?;
        if options.quiet {
            continue;
        }
        print(&format!("{}: {part}, {pass}\n", target.image.display()))?;
        if let Some(text) = preview {
            print(&format!("  preview   {text}\n"))?;
        }
    }
    Ok(Outcome::Done)
}

/// A part, of which merging leaves out what is not whole.
fn whole_passes(path: &Path) -> Result<Part, PartError> {
    let part = part::read(path)?;
    if let Some(unfinished) = &part.unfinished {
        tell(&format!(
            "warning: {}: pass {} is not whole and left out",
            path.display(),
            unfinished.pass
        ));
    }
    Ok(part)
}
