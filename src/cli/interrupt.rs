//! Ctrl-C and SIGTERM: the first asks the render to stop after the pass in flight, the second ends
//! the process at once, but for a save in flight, which the third ends.

use super::{CliError, INTERRUPTED, tell};
use crate::render::Cancel;
use std::sync::Arc;
#[cfg(unix)]
use std::sync::atomic::AtomicBool;
use std::sync::atomic::{AtomicU32, Ordering::SeqCst};

/// Interrupts of this process.
#[derive(Clone, Debug, Default)]
pub struct Interrupts {
    cancel: Cancel,
    count: Arc<AtomicU32>,
    /// Saves in flight.
    saves: Arc<AtomicU32>,
}

/// A save in flight, until it is dropped.
pub struct Saving<'a>(&'a Interrupts);

impl Drop for Saving<'_> {
    fn drop(&mut self) {
        self.0.saves.fetch_sub(1, SeqCst);
    }
}

impl Interrupts {
    /// The request to stop that the first one makes.
    pub fn cancel(&self) -> &Cancel {
        &self.cancel
    }

    /// How many there were.
    pub fn count(&self) -> u32 {
        self.count.load(SeqCst)
    }

    /// Notes that a save is in flight.
    pub fn hold(&self) -> Saving<'_> {
        self.saves.fetch_add(1, SeqCst);
        Saving(self)
    }

    fn arrive(&self) {
        let before = self.count.fetch_add(1, SeqCst);
        if !self.cancel.request() {
            tell("interrupted: stops after this pass and saves; again: stops at once");
        } else if before < 2 && self.saves.load(SeqCst) > 0 {
            tell("interrupted while saving; again: stops at once, without");
        } else {
            std::process::exit(i32::from(INTERRUPTED));
        }
    }
}

/// Lets a file that grows beyond the limit of the process (`ulimit -f`) be an error of writing
/// instead of the end of the process.
///
/// # Errors
/// Where the system refuses the handler.
#[cfg(unix)]
fn keep_file_size_signal() -> Result<(), CliError> {
    // what is noted there is of no use: the error of the write says the same
    let noted = Arc::new(AtomicBool::new(false));
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, noted)
        .map(drop)
        .map_err(|e| CliError::Failed(format!("cannot listen for signals: {e}")))
}

#[cfg(not(unix))]
fn keep_file_size_signal() -> Result<(), CliError> {
    Ok(())
}

/// Listens from now on. Before, an interrupt ends the process as usual: nothing is lost.
///
/// # Errors
/// Where the system refuses the handler.
pub fn listen() -> Result<Interrupts, CliError> {
    keep_file_size_signal()?;
    let interrupts = Interrupts::default();
    let arriving = interrupts.clone();
    ctrlc::set_handler(move || arriving.arrive())
        .map_err(|e| CliError::Failed(format!("cannot listen for interrupts: {e}")))?;
    Ok(interrupts)
}
