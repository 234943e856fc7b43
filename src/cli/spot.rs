//! `abbe spot`: power, centroid, radius, encircled energy and modulation transfer of the light on a
//! detector.

use super::args::SpotOptions;
use super::{CliError, Outcome, ending, print};
use crate::io::atomic;
use crate::io::destination::Claims;
use crate::io::exr;
use crate::report::ReportError;
use crate::report::spot::{self, SpotRequest};
use std::io::Write;

/// Runs the command.
pub fn run(options: &SpotOptions) -> Result<Outcome, CliError> {
    let path = &options.image;
    let image = exr::read(path).map_err(ReportError::from)?;
    let mut claims = Claims::of_inputs([path]);
    if let Some(drawing) = &options.drawing {
        claims.output(drawing)?;
        ending::drawing(drawing)?;
    }
    let request = SpotRequest {
        window: options.window,
        background: options.background,
        frequencies: options.frequencies.clone(),
    };
    let found = spot::measure(path, &image, &request)?;
    print(&if options.json {
        format!("{:#}\n", spot::json(&found))
    } else {
        spot::text(&found)
    })?;
    if let Some(to) = &options.drawing {
        let svg = spot::drawing(&found, &path.display().to_string());
        atomic::write_atomic(to, |out| out.write_all(svg.as_bytes()))?;
    }
    Ok(Outcome::Done)
}
