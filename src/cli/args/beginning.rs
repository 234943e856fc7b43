//! The options of `abbe new`, `completions` and `man`.

use crate::math::named::named;
use clap::Args;
use clap_complete::Shell;
use std::path::PathBuf;

named! {
    /// Scenes to begin with.
    pub enum Template {
        Lens = "lens": "A singlet, a beam and a detector behind the focus",
        Prism = "prism": "The spectrum of a beam behind a prism",
        Room = "room": "A box with a lamp, a metal block and a ball of glass",
        Model = "model": "A file of another program, a table and lamps",
    }
}

/// Options of `abbe new`.
#[derive(Debug, Args)]
pub struct NewOptions {
    /// The kind of scene
    #[arg(value_enum, value_name = "KIND")]
    pub template: Template,
    /// The scene file to write (.toml); a mesh that it needs goes beside it. Files that are there
    /// are left alone
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Prints nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// Options of `abbe completions`.
#[derive(Debug, Args)]
pub struct CompletionsOptions {
    /// The shell
    #[arg(value_enum, value_name = "SHELL")]
    pub shell: Shell,
}

/// Options of `abbe man`.
#[derive(Debug, Args)]
pub struct ManOptions {
    /// The folder to write abbe.1 and a page for each command to; it must be there
    #[arg(value_name = "FOLDER")]
    pub folder: PathBuf,
}
