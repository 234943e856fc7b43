//! `abbe completions` and `abbe man`: the options, for shells and for `man`.

use super::args::{Arguments, CompletionsOptions, ManOptions};
use super::{CliError, Outcome, print_raw};
use crate::io::atomic::write_atomic;
use clap::CommandFactory;
use clap_mangen::Man;
use std::io::Write as _;

/// Runs `abbe completions`.
pub fn completions(options: &CompletionsOptions) -> Result<Outcome, CliError> {
    let mut script = Vec::new();
    clap_complete::generate(
        options.shell,
        &mut Arguments::command(),
        "abbe",
        &mut script,
    );
    print_raw(&script)?;
    Ok(Outcome::Done)
}

/// Runs `abbe man`.
pub fn man(options: &ManOptions) -> Result<Outcome, CliError> {
    let mut all = Arguments::command().disable_help_subcommand(true);
    // spells out the names of commands, such as `abbe render`
    all.build();
    let mut commands = vec![all.clone()];
    commands.extend(all.get_subcommands().cloned());
    for command in commands {
        let name = command.get_display_name().unwrap_or(command.get_name());
        let path = options.folder.join(format!("{name}.1"));
        let mut page = Vec::new();
        let written = Man::new(command.clone()).render(&mut page);
        written.map_err(|e| CliError::file(&path, e.to_string()))?;
        write_atomic(&path, |file| file.write_all(&page))?;
    }
    Ok(Outcome::Done)
}
