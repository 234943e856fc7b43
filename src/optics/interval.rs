//! Interval arithmetic for bounds on the distance between a ray and a surface.
//!
//! Bounds are those of real arithmetic up to rounding; who decides by them adds the rounding of
//! what was summed (Moore, Kearfott, Cloud, Introduction to Interval Analysis, 2009).

use std::ops::{Add, Mul, Neg, Sub};

/// All numbers from `lo` to `hi`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Interval {
    pub lo: f64,
    pub hi: f64,
}

impl Interval {
    pub fn new(a: f64, b: f64) -> Self {
        Self {
            lo: a.min(b),
            hi: a.max(b),
        }
    }

    pub fn point(value: f64) -> Self {
        Self {
            lo: value,
            hi: value,
        }
    }

    /// Greatest magnitude in it.
    pub fn magnitude(self) -> f64 {
        self.lo.abs().max(self.hi.abs())
    }

    pub fn contains_zero(self) -> bool {
        self.lo <= 0.0 && self.hi >= 0.0
    }

    /// With `margin` more at both ends.
    pub fn widened(self, margin: f64) -> Self {
        Self {
            lo: self.lo - margin,
            hi: self.hi + margin,
        }
    }

    pub fn square(self) -> Self {
        let (a, b) = (self.lo * self.lo, self.hi * self.hi);
        if self.contains_zero() {
            Self {
                lo: 0.0,
                hi: a.max(b),
            }
        } else {
            Self::new(a, b)
        }
    }

    /// Root of the part that is not negative.
    pub fn sqrt(self) -> Self {
        Self {
            lo: self.lo.max(0.0).sqrt(),
            hi: self.hi.max(0.0).sqrt(),
        }
    }

    /// One over an interval of positive numbers; unbounded where it reaches 0.
    pub fn recip_positive(self) -> Self {
        Self {
            lo: 1.0 / self.hi,
            hi: if self.lo > 0.0 {
                1.0 / self.lo
            } else {
                f64::INFINITY
            },
        }
    }

    pub fn scaled(self, factor: f64) -> Self {
        Self::new(self.lo * factor, self.hi * factor)
    }
}

impl Add for Interval {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            lo: self.lo + other.lo,
            hi: self.hi + other.hi,
        }
    }
}

impl Neg for Interval {
    type Output = Self;

    fn neg(self) -> Self {
        Self {
            lo: -self.hi,
            hi: -self.lo,
        }
    }
}

impl Sub for Interval {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Interval {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        // zero times unbounded is zero: the bound stands for a limit that is not reached
        let product = |a: f64, b: f64| if a == 0.0 || b == 0.0 { 0.0 } else { a * b };
        let all = [
            product(self.lo, other.lo),
            product(self.lo, other.hi),
            product(self.hi, other.lo),
            product(self.hi, other.hi),
        ];
        Self {
            lo: all.into_iter().fold(f64::INFINITY, f64::min),
            hi: all.into_iter().fold(f64::NEG_INFINITY, f64::max),
        }
    }
}
