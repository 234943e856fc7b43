//! The progress line on stderr: passes or time used, rate, time left. Silent where stderr is not a terminal.

use crate::render::stop::StopRules;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::time::Duration;

/// A progress line.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    /// The bar shows time used in milliseconds, not passes.
    by_time: bool,
}

impl Progress {
    /// For `passes` passes of a sensor, of which a time limit may cut off some.
    #[must_use]
    pub fn new(name: &str, passes: u64, rules: &StopRules, quiet: bool) -> Self {
        let by_time = rules.time.is_some();
        let length = rules.time.map_or(passes, |t| t.as_millis() as u64);
        // the target hides itself where stderr is not a terminal
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr_with_hz(5)
        };
        let bar = ProgressBar::with_draw_target(Some(length), target);
        let template = if by_time {
            "{prefix} [{bar:30}] {msg}, {eta} left"
        } else {
            "{prefix} [{bar:30}] {percent} %, {msg}, {eta} left"
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_prefix(name.to_owned());
        Self { bar, by_time }
    }

    /// After a pass: passes done, rays so far, time used.
    pub fn update(&self, passes: u64, rays: u64, elapsed: Duration) {
        let rate = rays as f64 * 1e-6 / elapsed.as_secs_f64().max(1e-9);
        self.bar
            .set_message(format!("{passes} passes, {rate:.2} Mrays/s"));
        self.bar.set_position(if self.by_time {
            elapsed.as_millis() as u64
        } else {
            passes
        });
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
