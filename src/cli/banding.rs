//! `abbe banding`: photon merging beside bidirectional path tracing, as a page, a table and a
//! picture.

use super::args::BandingOptions;
use super::{CliError, Outcome, ending, print, threads};
use crate::io::atomic::write_atomic;
use crate::io::destination::Claims;
use crate::io::loaded;
use crate::report::banding::BandingStudy;
use std::io::Write as _;

/// Runs the command.
pub fn run(options: &BandingOptions) -> Result<Outcome, CliError> {
    let json_path = options.output.with_extension("json");
    let picture_path = options.output.with_extension("png");
    // what a scene reads is known when it is loaded
    let read = loaded::load(&options.scene, &options.overrides.set)?.files;
    let mut claims = Claims::of_inputs(&read);
    for path in [&options.output, &json_path, &picture_path] {
        claims.output(path)?;
    }
    ending::check(&options.output, "pages are HTML files", &["html"])?;
    let study = BandingStudy {
        scene: options.scene.clone(),
        overrides: options.overrides.set.clone(),
        sensor: options.sensor.clone(),
        passes: options.passes.clone(),
        reference_passes: options.reference_passes,
        seeds: options.seeds,
        lines: options.lines.to_lines(),
    };
    let pool = threads::pool(options.threads)?;
    let found = pool.install(|| study.run())?;
    let ((width, height), png) = found
        .picture(options.exposure)
        .map_err(|e| CliError::file(&picture_path, e.to_string()))?;
    write_atomic(&picture_path, |w| w.write_all(&png))?;
    write_atomic(&options.output, |w| {
        w.write_all(found.page(&png).as_bytes())
    })?;
    write_atomic(&json_path, |w| writeln!(w, "{:#}", found.json()))?;
    if !options.quiet {
        print(&found.table())?;
        print(&format!(
            "{}: table and picture of {width} x {height} pixels, also as {} and {}\n",
            options.output.display(),
            json_path.display(),
            picture_path.display()
        ))?;
    }
    Ok(Outcome::Done)
}
