//! The command line: parses, runs one command, turns the outcome into an exit code. Only this floor
//! prints.
//!
//! Results go to stdout; progress, warnings and errors go to stderr, errors as one line each
//! beginning with `error:`.

mod args;
mod banding;
mod compare;
mod convert;
mod cost;
mod develop;
mod ending;
mod error;
mod glass;
mod image_output;
mod info;
mod interrupt;
mod job;
mod keys;
mod lens;
mod manual;
mod memory;
mod merge;
mod new;
mod progress;
mod render;
mod save;
mod spot;
mod stats;
mod summary;
mod terminal;
mod tev;
mod threads;
mod usage;
#[cfg(feature = "view")]
mod view;

use args::{Arguments, Command};
use clap::Parser;
pub use error::CliError;
use std::ffi::OsString;
use std::io::ErrorKind;
use std::process::ExitCode;
use terminal::{print, print_raw, tell};

/// Exit code of a render that was interrupted and whose image so far was saved.
const INTERRUPTED: u8 = 130;

/// How a command ended when it did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Everything asked for was done.
    Done,
    /// Interrupted; what there was has been saved.
    Interrupted,
}

/// Runs the command line of this process, see [`run_with`].
#[must_use]
pub fn run() -> ExitCode {
    ExitCode::from(run_with(std::env::args_os()))
}

/// Runs a command line, whose first argument is the name of the program: 0 done, 1 failed, 2 usage,
/// 130 interrupted with the image saved.
#[must_use]
pub fn run_with(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error) => {
            // help and version are "errors" with exit code 0; a closed pipe is no reason to fail
            _ = error.print();
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
    let outcome = match arguments.command {
        Command::Render(options) => render::run(&options),
        Command::Info(options) => info::run(&options),
        Command::Cost(options) => cost::run(&options),
        Command::Compare(options) => compare::run(&options),
        Command::Spot(options) => spot::run(&options),
        Command::Develop(options) => develop::run(&options),
        Command::Glass(options) => glass::run(&options),
        Command::Keys(options) => keys::run(&options),
        Command::Lens(options) => lens::run(&options),
        Command::Job(options) => job::run(&options.command),
        Command::Merge(options) => merge::run(&options),
        Command::Banding(options) => banding::run(&options),
        Command::Convert(options) => convert::run(&options),
        Command::New(options) => new::run(&options),
        Command::Completions(options) => manual::completions(&options),
        Command::Man(options) => manual::man(&options),
        #[cfg(feature = "view")]
        Command::View(options) => view::run(&options),
    };
    match outcome {
        Ok(Outcome::Done) => 0,
        Ok(Outcome::Interrupted) => INTERRUPTED,
        // whoever has closed the pipe does not ask why
        Err(CliError::Stdout(e)) if e.kind() == ErrorKind::BrokenPipe => 1,
        Err(error) => {
            for line in error.to_string().lines() {
                tell(&format!("error: {line}"));
            }
            error.exit_code()
        }
    }
}
