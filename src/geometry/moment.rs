//! One moment, and the placements of moving things at it.
//!
//! All rays of a path meet a thing at one moment, so that its placement is computed once per path,
//! when it is first asked for. The memory belongs to the thread that follows the path; a scene has
//! none.

use super::motion::Placement;
use std::cell::OnceCell;

/// Memory for the placements of the moving things of a scene at one moment.
#[derive(Debug, Default)]
pub struct Placements {
    time: f64,
    computed: Vec<OnceCell<Placement>>,
}

impl Placements {
    /// The moment `time` (seconds) of a scene with `count` numbered motions. What was computed for
    /// another moment is forgotten; a memory serves one scene only.
    pub fn at(&mut self, time: f64, count: usize) -> Moment<'_> {
        if self.time != time || self.computed.len() != count {
            self.time = time;
            self.computed.clear();
            self.computed.resize_with(count, OnceCell::new);
        }
        Moment {
            time,
            computed: &self.computed,
        }
    }
}

/// A moment, with what is known of the placements at it.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    time: f64,
    computed: &'a [OnceCell<Placement>],
}

impl From<f64> for Moment<'_> {
    /// The moment `time` (seconds), for a few questions: placements are computed each time they are
    /// asked for.
    fn from(time: f64) -> Self {
        let computed = &[];
        Self { time, computed }
    }
}

impl<'a> Moment<'a> {
    /// Seconds.
    #[must_use]
    pub fn time(self) -> f64 {
        self.time
    }

    /// The memory for the motion of this number, if there is one.
    #[inline]
    pub(super) fn slot(self, number: usize) -> Option<&'a OnceCell<Placement>> {
        self.computed.get(number)
    }
}
