//! When a render ends: after its passes, its time, or when its error is small enough. Checked
//! between passes.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};
use std::time::Duration;

/// Passes before the estimate of the error is trusted.
const LEAST_PASSES_FOR_ERROR: usize = 4;

/// Rules that end a render before its last pass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StopRules {
    /// Time budget.
    pub time: Option<Duration>,
    /// Estimated relative error to fall below.
    pub target_error: Option<f64>,
}

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// All passes are done.
    Passes,
    /// The time is used up.
    Time,
    /// The error is small enough.
    Error,
    /// Stopped on request ([`Cancel`]).
    Interrupted,
    /// Stopped by the caller's own rule.
    Driver,
}

impl StopReason {
    /// In words.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Passes => "all passes done",
            Self::Time => "time used up",
            Self::Error => "target error reached",
            Self::Interrupted => "interrupted",
            Self::Driver => "a rule of its own",
        }
    }
}

/// A request to stop that other threads, or a signal handler, can make. It stays until it is
/// cleared.
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// Asks to stop. Whether that had been asked before.
    pub fn request(&self) -> bool {
        self.0.swap(true, SeqCst)
    }

    /// Whether to stop.
    #[must_use]
    pub fn is_requested(&self) -> bool {
        self.0.load(SeqCst)
    }

    /// Takes the request back.
    pub fn clear(&self) {
        self.0.store(false, SeqCst);
    }
}

impl StopRules {
    /// Whether to stop after `passes` passes and `elapsed` time; `error` is asked for only where it
    /// counts.
    pub fn check(
        &self,
        passes: usize,
        elapsed: Duration,
        error: impl FnOnce() -> Option<f64>,
    ) -> Option<StopReason> {
        if self.time.is_some_and(|t| elapsed >= t) {
            return Some(StopReason::Time);
        }
        let target = self
            .target_error
            .filter(|_| passes >= LEAST_PASSES_FOR_ERROR)?;
        error()
            .is_some_and(|e| e <= target)
            .then_some(StopReason::Error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn nothing_stops_without_rules() {
        let rules = StopRules::default();
        assert_eq!(rules.check(1000, 1000 * SECOND, || unreachable!()), None);
    }

    #[test]
    fn time_and_error_stop() {
        let rules = StopRules {
            time: Some(2 * SECOND),
            target_error: Some(0.1),
        };
        assert_eq!(rules.check(1, 2 * SECOND, || None), Some(StopReason::Time));
        assert_eq!(
            rules.check(3, SECOND, || Some(0.01)),
            None,
            "too few passes to know"
        );
        assert_eq!(rules.check(4, SECOND, || Some(0.2)), None);
        assert_eq!(rules.check(4, SECOND, || None), None);
        assert_eq!(
            rules.check(4, SECOND, || Some(0.1)),
            Some(StopReason::Error)
        );
    }
}
