//! Ctrl-C and SIGTERM: the first asks the render to stop after the pass in flight, the second ends the process at once.

use super::{CliError, INTERRUPTED};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};

/// Whether the user has asked to stop.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Listens from now on. Before, an interrupt ends the process as usual: nothing is lost.
    ///
    /// # Errors
    /// Where the system refuses the handler.
    pub fn listen() -> Result<Self, CliError> {
        let interrupt = Self::default();
        let flag = Arc::clone(&interrupt.0);
        let handler = move || {
            if flag.swap(true, SeqCst) {
                std::process::exit(i32::from(INTERRUPTED));
            }
        };
        ctrlc::set_handler(handler)
            .map_err(|e| CliError::Failed(format!("cannot listen for interrupts: {e}")))?;
        Ok(interrupt)
    }

    /// Whether it is time to stop.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.0.load(SeqCst)
    }
}
