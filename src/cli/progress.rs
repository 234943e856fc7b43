//! The progress line on stderr: passes or time used, rate, time left. Silent where stderr is not a
//! terminal.

use crate::render::{self, Session, Tiles};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicU64, Ordering::SeqCst};
use std::time::{Duration, Instant};

/// Steps of the bar for each pass.
const STEPS: u64 = 1000;

/// A progress line.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    /// The bar shows time used in milliseconds, not passes.
    by_time: bool,
    /// When the session began.
    began: Instant,
    /// Passes added.
    added: AtomicU64,
}

impl Progress {
    /// For a session, of whose passes a time limit may cut off some.
    #[must_use]
    pub fn new(name: &str, session: &Session, limit: Option<Duration>, quiet: bool) -> Self {
        let passes = STEPS.saturating_mul(session.passes_left());
        let length = limit.map_or(passes, |t| t.as_millis() as u64);
        // the target hides itself where stderr is not a terminal
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr_with_hz(5)
        };
        let bar = ProgressBar::with_draw_target(Some(length), target);
        let template = if limit.is_some() {
            "{prefix} [{bar:30}] {msg}, {eta} left"
        } else {
            "{prefix} [{bar:30}] {percent} %, {msg}, {eta} left"
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_prefix(name.to_owned());
        let now = Instant::now();
        Self {
            bar,
            by_time: limit.is_some(),
            began: now.checked_sub(session.elapsed()).unwrap_or(now),
            added: AtomicU64::new(0),
        }
    }

    /// After a tile.
    pub fn tile(&self, tiles: Tiles) {
        let added = self.added.load(SeqCst);
        self.place(STEPS * added + STEPS * tiles.done / tiles.all);
    }

    /// After a pass.
    pub fn pass(&self, state: &render::Progress) {
        self.added.store(state.added, SeqCst);
        let rate = state.rays as f64 * 1e-6 / state.elapsed.as_secs_f64().max(1e-9);
        let passes = state.added;
        self.bar
            .set_message(format!("{passes} passes, {rate:.2} Mrays/s"));
        self.place(STEPS * passes);
    }

    fn place(&self, steps: u64) {
        self.bar.set_position(if self.by_time {
            self.began.elapsed().as_millis() as u64
        } else {
            steps
        });
    }

    /// Takes the line away.
    pub fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.clear();
    }
}
