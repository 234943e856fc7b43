//! `abbe keys`: the reference of all keys of scene files.

use super::args::KeysOptions;
use super::{CliError, Outcome, print};
use crate::io::scene_file::reference;

/// Runs the command.
///
/// # Errors
/// Where they cannot be printed.
pub fn run(options: &KeysOptions) -> Result<Outcome, CliError> {
    print(&if options.json {
        format!("{:#}\n", reference::json_schema())
    } else {
        reference::markdown()
    })?;
    Ok(Outcome::Done)
}
