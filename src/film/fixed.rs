//! Sums in fixed point, so that the order of addition does not matter.
//!
//! Each value is rounded once to a multiple of 2⁻⁶⁴ and added as a 128-bit integer held in two
//! atomic words. Integer addition is associative and a carry may arrive late, so any number of
//! threads in any order leave the same bits.

use std::sync::atomic::{AtomicI64, AtomicU64, Ordering::Relaxed};

/// Multiples of the quantum in 1.
const PER_UNIT: f64 = 18_446_744_073_709_551_616.0;

/// Largest absolute value that can be added. A sum holds up to 2⁶³, that is at least 32 768 of the
/// largest values.
pub const MAX_VALUE: f64 = 281_474_976_710_656.0;

/// Why a value cannot be added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unrepresentable {
    /// Infinite or not a number.
    NotFinite,
    /// Larger than [`MAX_VALUE`].
    TooLarge,
}

/// A value in units of 2⁻⁶⁴, rounded to nearest (exact from 2⁻¹¹ up).
///
/// # Errors
/// Where the value is not finite or too large.
pub fn quantize(value: f64) -> Result<i128, Unrepresentable> {
    if !value.is_finite() {
        Err(Unrepresentable::NotFinite)
    } else if value.abs() > MAX_VALUE {
        Err(Unrepresentable::TooLarge)
    } else {
        Ok((value * PER_UNIT).round() as i128)
    }
}

/// The number that a sum of quantized values stands for.
#[must_use]
pub fn to_f64(sum: i128) -> f64 {
    sum as f64 / PER_UNIT
}

/// A sum that many threads can add to.
#[derive(Debug, Default)]
pub struct FixedSum {
    low: AtomicU64,
    high: AtomicI64,
}

impl FixedSum {
    /// Adds a quantized value. Whether the sum is still in range: `false` is an overflow that
    /// spoils it.
    pub fn add(&self, value: i128) -> bool {
        if value == 0 {
            return true;
        }
        let low = value as u64;
        let before = self.low.fetch_add(low, Relaxed);
        let carry = i64::from(before.checked_add(low).is_none());
        // in range: |value| < 2^112, so the upper word plus one fits
        let high = (value >> 64) as i64 + carry;
        high == 0
            || self
                .high
                .fetch_add(high, Relaxed)
                .checked_add(high)
                .is_some()
    }

    /// The sum so far. Exact when no other thread is adding.
    #[must_use]
    pub fn get(&self) -> i128 {
        (i128::from(self.high.load(Relaxed)) << 64) | i128::from(self.low.load(Relaxed))
    }

    /// Replaces the sum.
    pub fn set(&mut self, sum: i128) {
        *self.low.get_mut() = sum as u64;
        *self.high.get_mut() = (sum >> 64) as i64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sums_are_exact(values in prop::collection::vec(-1e14..1e14_f64, 1..50)) {
            let sum = FixedSum::default();
            let mut expected = 0;
            for &v in &values {
                let q = quantize(v).unwrap();
                prop_assert!((to_f64(q) - v).abs() <= 0.5 / PER_UNIT);
                prop_assert!(sum.add(q));
                expected += q;
            }
            prop_assert_eq!(sum.get(), expected);
        }
    }

    #[test]
    fn tiny_negative_and_carrying_values() {
        let sum = FixedSum::default();
        let quantum = 1.0 / PER_UNIT;
        for v in [
            quantum,
            1.0 - f64::EPSILON,
            3.0 * quantum,
            -quantum,
            -2.5,
            7.25,
        ] {
            sum.add(quantize(v).unwrap());
        }
        // epsilon is 2^12 quanta, and the sum without it exact in f64
        let expected = ((7.25_f64 - 2.5 + 1.0) * PER_UNIT) as i128 - (1 << 12) + 3;
        assert_eq!(sum.get(), expected);
        let mut other = FixedSum::default();
        other.set(-5);
        assert_eq!(other.get(), -5);
        other.add(3);
        assert_eq!(other.get(), -2);
    }

    #[test]
    fn bad_values_and_overflow_are_told() {
        assert_eq!(quantize(f64::NAN), Err(Unrepresentable::NotFinite));
        assert_eq!(quantize(f64::NEG_INFINITY), Err(Unrepresentable::NotFinite));
        assert_eq!(quantize(1e15), Err(Unrepresentable::TooLarge));
        let mut sum = FixedSum::default();
        sum.set(i128::MAX - 1);
        assert!(!sum.add(quantize(1.0).unwrap()));
    }
}
