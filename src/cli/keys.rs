//! `abbe keys`: the reference of all keys of scene files.

use super::args::KeysOptions;
use super::{Outcome, print};
use crate::io::scene_file::reference;

/// Runs the command.
pub fn run(options: &KeysOptions) -> Outcome {
    print(&if options.json {
        format!("{:#}\n", reference::json_schema())
    } else {
        reference::markdown()
    });
    Outcome::Done
}
