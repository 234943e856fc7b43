//! `abbe job`: a long render as a folder of chunks that any number of processes work on.

mod collect;
mod new;
mod run;
mod status;

use super::args::JobCommand;
use super::{CliError, Outcome};
use std::time::Duration;

/// Runs the command.
pub fn run(command: &JobCommand) -> Result<Outcome, CliError> {
    match command {
        JobCommand::New(options) => new::run(options),
        JobCommand::Run(options) => run::run(options),
        JobCommand::Status(options) => status::run(options),
        JobCommand::Collect(options) => collect::run(options),
    }
}

/// A time for reading.
fn time_text(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    match seconds {
        ..90.0 => format!("{seconds:.1} s"),
        ..5400.0 => format!("{:.1} min", seconds / 60.0),
        ..172_800.0 => format!("{:.1} h", seconds / 3600.0),
        _ => format!("{:.1} days", seconds / 86_400.0),
    }
}
