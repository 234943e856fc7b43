//! The threads of a command.

use super::CliError;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// A pool of that many threads, or of one per core.
///
/// # Errors
/// Where the system gives none.
pub fn pool(threads: Option<u16>) -> Result<ThreadPool, CliError> {
    ThreadPoolBuilder::new()
        .num_threads(threads.map_or(0, usize::from))
        .build()
        .map_err(|e| CliError::Failed(format!("cannot start threads: {e}")))
}
