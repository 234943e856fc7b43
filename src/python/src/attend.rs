//! Work on threads of its own, while the thread that Python called looks after the interpreter's
//! signals.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// How often Python is asked whether a signal has arrived.
const POLL: Duration = Duration::from_millis(50);

/// Threads for one piece of work; 0 for one per core. Never the global ones: those do not survive
/// the fork of a process.
pub fn pool(threads: usize) -> PyResult<ThreadPool> {
    let builder = ThreadPoolBuilder::new().num_threads(threads);
    builder
        .build()
        .map_err(|e| PyRuntimeError::new_err(format!("cannot start threads: {e}")))
}

/// Does `work` on the threads of `pool` without the interpreter, which is asked for signals
/// meanwhile and shown `watch`. The first error of either calls `cancel`, and comes beside the
/// outcome of the work.
pub fn attend<T: Send>(
    py: Python,
    pool: &ThreadPool,
    work: impl FnOnce() -> T + Send,
    mut watch: impl FnMut(Python) -> PyResult<()> + Send,
    cancel: impl Fn() + Sync,
) -> (T, Option<PyErr>) {
    py.detach(|| {
        std::thread::scope(|scope| {
            let (done, is_done) = channel::<()>();
            let worker = scope.spawn(move || {
                let outcome = pool.install(work);
                // the other end waits for this or for the end of the channel
                _ = done.send(());
                outcome
            });
            let mut error = None;
            while is_done.recv_timeout(POLL) == Err(RecvTimeoutError::Timeout) {
                if error.is_none() {
                    let asked = Python::attach(|py| py.check_signals().and_then(|()| watch(py)));
                    if let Err(raised) = asked {
                        cancel();
                        error = Some(raised);
                    }
                }
            }
            match worker.join() {
                Ok(outcome) => (outcome, error),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        })
    })
}
