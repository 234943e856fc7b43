//! Ctrl-C and SIGTERM: the first asks the render to stop after the pass in flight, the second ends the process at once.

use super::{CliError, INTERRUPTED};
use crate::render::Cancel;

/// Listens from now on. Before, an interrupt ends the process as usual: nothing is lost.
///
/// # Errors
/// Where the system refuses the handler.
pub fn listen() -> Result<Cancel, CliError> {
    let cancel = Cancel::default();
    let asked = cancel.clone();
    let handler = move || {
        if asked.request() {
            std::process::exit(i32::from(INTERRUPTED));
        }
    };
    ctrlc::set_handler(handler)
        .map_err(|e| CliError::Failed(format!("cannot listen for interrupts: {e}")))?;
    Ok(cancel)
}
