//! The progress of a render on stderr. On a terminal a line that is there at once and follows every
//! tile: passes, error so far, time gone and left. Elsewhere one line at each save.

use super::tell;
use crate::render::forecast::Forecast;
use crate::render::session::NO_LIMIT;
use crate::render::{self, Session, Tiles};
use crate::report::readable::{counted, duration, percent};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicU64, Ordering::SeqCst};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Steps of the bar for each pass.
const STEPS: u64 = 1000;
/// The line is drawn anew this often, however slow tiles are.
const TICK: Duration = Duration::from_millis(500);
/// The error is asked for no more often than this, and for no more than a twentieth of the time.
const ERROR_INTERVAL: Duration = Duration::from_secs(1);
const TIMES_AN_ERROR: u32 = 20;

fn line(length: Option<u64>, template: &str, quiet: bool) -> ProgressBar {
    // the target hides itself where stderr is not a terminal
    let target = if quiet {
        ProgressDrawTarget::hidden()
    } else {
        ProgressDrawTarget::stderr_with_hz(5)
    };
    let bar = ProgressBar::with_draw_target(length, target);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    if !bar.is_hidden() {
        bar.enable_steady_tick(TICK);
    }
    bar
}

/// A line on work that has no measure, until it is dropped.
#[derive(Debug)]
pub struct Waiting(ProgressBar);

impl Waiting {
    /// The line, there at once.
    #[must_use]
    pub fn new(what: String, quiet: bool) -> Self {
        let bar = line(None, "{spinner} {msg}, {elapsed} gone", quiet);
        bar.set_message(what);
        bar.tick();
        Self(bar)
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// The error that was last asked for.
#[derive(Debug)]
struct LastError {
    relative: Option<f64>,
    /// Time left by the error that is aimed for.
    left: Option<Duration>,
    next: Instant,
}

/// The progress of a session.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    name: String,
    quiet: bool,
    /// Passes of the session; `None`: something else ends it.
    all: Option<u64>,
    limit: Option<Duration>,
    target_error: Option<f64>,
    /// When the session began.
    began: Instant,
    /// Passes added.
    added: AtomicU64,
    error: Mutex<LastError>,
}

impl Progress {
    /// For a session, of whose passes a rule may cut off some.
    #[must_use]
    pub fn new(name: &str, session: &Session, rules: render::StopRules, quiet: bool) -> Self {
        let (all, limit) = (session.passes_left(), rules.time);
        let all = (all < u64::from(NO_LIMIT) / 2).then_some(all);
        // what ends a session first is not known: the time counts where there is a limit
        let length = limit.map_or(all.map(|n| STEPS * n), |t| Some(t.as_millis() as u64));
        let template = match length {
            Some(_) => "{prefix} [{bar:24}] {percent} %, {msg}{elapsed} gone, {eta} left",
            None => "{prefix} {spinner} {msg}{elapsed} gone",
        };
        let bar = line(length, template, quiet);
        bar.set_prefix(name.to_owned());
        bar.tick();
        let now = Instant::now();
        Self {
            bar,
            name: name.to_owned(),
            quiet,
            all,
            limit,
            target_error: rules.target_error,
            began: now.checked_sub(session.elapsed()).unwrap_or(now),
            added: AtomicU64::new(0),
            error: Mutex::new(LastError {
                relative: None,
                left: None,
                next: now,
            }),
        }
    }

    /// After a tile.
    pub fn tile(&self, tiles: Tiles) {
        let added = self.added.load(SeqCst);
        self.place(STEPS * added + STEPS * tiles.done / tiles.all);
    }

    /// After a pass.
    pub fn pass(&self, state: &render::Progress, session: &Session) {
        self.added.store(state.added, SeqCst);
        if !self.bar.is_hidden() {
            self.bar.set_message(self.so_far(session, false));
        }
        self.place(STEPS * state.added);
    }

    /// After a save, or one that could not be made: what stands elsewhere than on a terminal.
    pub fn saved(&self, session: &Session, could: bool) {
        if self.quiet || !self.bar.is_hidden() {
            return;
        }
        let (name, so_far) = (&self.name, self.so_far(session, true));
        let gone = self.began.elapsed();
        let left = self.left(gone).map_or_else(String::new, |left| {
            format!(", about {} left", duration(left.as_secs_f64()))
        });
        let gone = duration(gone.as_secs_f64());
        let saved = if could { "saved" } else { "not saved" };
        tell(&format!("{name}: {saved}, {so_far}{gone} gone{left}"));
    }

    /// Passes and error, with a comma behind each.
    fn so_far(&self, session: &Session, now: bool) -> String {
        let added = self.added.load(SeqCst);
        let passes = match self.all {
            Some(all) => format!("{added} of {all} passes, "),
            None => counted(added, "pass", "passes") + ", ",
        };
        let error = self.error(session, now);
        let error = error.map_or_else(String::new, |e| format!("error {}, ", percent(e)));
        passes + &error
    }

    /// The error, as of a moment ago unless it is asked for now.
    fn error(&self, session: &Session, now: bool) -> Option<f64> {
        let mut last = self.error.lock().unwrap_or_else(PoisonError::into_inner);
        let began = Instant::now();
        if now || began >= last.next {
            last.relative = session.render().error().map(|e| e.relative);
            last.left = match session.forecast(self.target_error) {
                Some((target, Forecast::Takes { time, .. }))
                    if Some(target) == self.target_error =>
                {
                    Some(time.saturating_sub(session.elapsed()))
                }
                _ => None,
            };
            last.next = Instant::now() + ERROR_INTERVAL.max(TIMES_AN_ERROR * began.elapsed());
        }
        last.relative
    }

    /// Time left, by the rule that is expected to end the session first.
    fn left(&self, gone: Duration) -> Option<Duration> {
        let added = self.added.load(SeqCst);
        let by_passes = self.all.filter(|_| added > 0).map(|all| {
            let share = all.saturating_sub(added) as f64 / added as f64;
            Duration::try_from_secs_f64(gone.as_secs_f64() * share).unwrap_or(Duration::MAX)
        });
        let by_time = self.limit.map(|limit| limit.saturating_sub(gone));
        let by_error = self
            .error
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .left;
        [by_passes, by_time, by_error].into_iter().flatten().min()
    }

    fn place(&self, steps: u64) {
        self.bar.set_position(match self.limit {
            Some(_) => self.began.elapsed().as_millis() as u64,
            None => steps,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{SessionOptions, StopRules};
    use crate::scene::Settings;
    use crate::scene::builder::tests::lit_floor;

    #[test]
    fn passes_error_and_time_are_told() {
        let scene = std::sync::Arc::new(lit_floor([16, 12]).build().expect("valid"));
        let settings = Settings {
            spp: 4,
            ..Settings::default()
        };
        let session = |passes| {
            let options = SessionOptions {
                passes,
                ..SessionOptions::default()
            };
            Session::new(scene.clone(), &settings, options).expect("a session")
        };
        let mut four = session(None);
        let progress = Progress::new("main", &four, StopRules::default(), true);
        let step = |session: &mut Session, progress: &Progress| {
            let state = session.step();
            progress.pass(&state, session);
        };
        step(&mut four, &progress);
        assert_eq!(progress.so_far(&four, true), "1 of 4 passes, ");
        step(&mut four, &progress);
        let text = progress.so_far(&four, true);
        assert!(text.starts_with("2 of 4 passes, error "), "{text}");
        let left = progress.left(Duration::from_secs(10));
        assert_eq!(left, Some(Duration::from_secs(10)));
        // whatever ends it first
        let rules = StopRules {
            time: Some(Duration::from_secs(60)),
            target_error: None,
        };
        let mut endless = session(Some(0..NO_LIMIT));
        let progress = Progress::new("main", &endless, rules, true);
        step(&mut endless, &progress);
        assert_eq!(progress.so_far(&endless, true), "1 pass, ");
        let left = progress.left(Duration::from_secs(10));
        assert_eq!(left, Some(Duration::from_secs(50)));
    }
}
