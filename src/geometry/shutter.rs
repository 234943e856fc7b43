//! When light reaches a sensor.

/// When the shutter is open, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shutter {
    /// When it opens.
    pub open_s: f64,
    /// When it closes, not before it opens.
    pub close_s: f64,
}

impl Shutter {
    /// The moment at the fraction `u` of the shutter. Exactly `open_s` at 0.
    #[must_use]
    pub fn at(self, u: f64) -> f64 {
        self.open_s + (self.close_s - self.open_s) * u
    }

    /// Whether it is open for a moment only.
    #[must_use]
    pub fn is_instant(self) -> bool {
        self.close_s <= self.open_s
    }

    /// From the first to open to the last to close.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            open_s: self.open_s.min(other.open_s),
            close_s: self.close_s.max(other.close_s),
        }
    }
}
