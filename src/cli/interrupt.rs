//! Ctrl-C and SIGTERM: the first asks the render to stop and save, the second says that it does,
//! the third ends the process at once.

use super::{CliError, INTERRUPTED, tell};
use crate::render::Cancel;
use rayon::ThreadPool;
use std::sync::Arc;
#[cfg(unix)]
use std::sync::atomic::AtomicBool;
use std::sync::atomic::{AtomicU32, Ordering::SeqCst};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// How often work that does not look for interrupts is asked whether it is done.
const POLL: Duration = Duration::from_millis(100);

/// Interrupts of this process.
#[derive(Clone, Debug, Default)]
pub struct Interrupts {
    cancel: Cancel,
    count: Arc<AtomicU32>,
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

    /// Does work that knows no interrupts on the threads of a pool. `None` where one comes before
    /// it is done: it is abandoned, for the process to end.
    pub fn unless_interrupted<T: Send + 'static>(
        &self,
        pool: &ThreadPool,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Option<T> {
        let (send, receive) = channel();
        // nobody receives what has been abandoned
        pool.spawn(move || _ = send.send(work()));
        loop {
            match receive.recv_timeout(POLL) {
                Ok(done) => return Some(done),
                Err(RecvTimeoutError::Timeout) if !self.cancel.is_requested() => {}
                Err(_) => return None,
            }
        }
    }

    fn arrive(&self) {
        let before = self.count.fetch_add(1, SeqCst);
        self.cancel.request();
        match before {
            0 => tell("interrupted: stops now and saves"),
            1 => tell("interrupted again: still saving; once more ends at once, without"),
            _ => std::process::exit(i32::from(INTERRUPTED)),
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
    handle(move || arriving.arrive())?;
    Ok(interrupts)
}

/// Lets an interrupt end the process with a word: for work of which every finished piece is saved.
///
/// # Errors
/// Where the system refuses the handler.
pub fn end_with(text: &'static str) -> Result<(), CliError> {
    handle(move || {
        tell(text);
        std::process::exit(i32::from(INTERRUPTED));
    })
}

fn handle(arrive: impl FnMut() + Send + 'static) -> Result<(), CliError> {
    ctrlc::set_handler(arrive)
        .map_err(|e| CliError::Failed(format!("cannot listen for interrupts: {e}")))
}
