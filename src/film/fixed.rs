//! Sums in fixed point, so that the order of addition does not matter.
//!
//! Each value is rounded once to a multiple of 2⁻⁶⁴ and added as a 128-bit integer. Integer
//! addition is associative, so any number of threads in any order leave the same bits.

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

/// Whether a value can be added.
///
/// # Errors
/// Where the value is not finite or too large.
pub fn check(value: f64) -> Result<(), Unrepresentable> {
    if !value.is_finite() {
        Err(Unrepresentable::NotFinite)
    } else if value.abs() > MAX_VALUE {
        Err(Unrepresentable::TooLarge)
    } else {
        Ok(())
    }
}

/// A value in units of 2⁻⁶⁴, rounded to nearest (exact from 2⁻¹¹ up).
///
/// # Errors
/// Where the value is not finite or too large.
pub fn quantize(value: f64) -> Result<i128, Unrepresentable> {
    check(value)?;
    Ok((value * PER_UNIT).round() as i128)
}

/// The number that a sum of quantized values stands for.
#[must_use]
pub fn to_f64(sum: i128) -> f64 {
    sum as f64 / PER_UNIT
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sums_are_exact(values in prop::collection::vec(-1e14..1e14_f64, 1..50)) {
            let quantized: Vec<i128> = values.iter().map(|&v| quantize(v).unwrap()).collect();
            for (&q, &v) in quantized.iter().zip(&values) {
                prop_assert!((to_f64(q) - v).abs() <= 0.5 / PER_UNIT);
            }
            let forward: i128 = quantized.iter().sum();
            let backward: i128 = quantized.iter().rev().sum();
            prop_assert_eq!(forward, backward);
        }
    }

    #[test]
    fn tiny_and_negative_values() {
        let mut sum = 0;
        let quantum = 1.0 / PER_UNIT;
        for v in [
            quantum,
            1.0 - f64::EPSILON,
            3.0 * quantum,
            -quantum,
            -2.5,
            7.25,
        ] {
            sum += quantize(v).unwrap();
        }
        // epsilon is 2^12 quanta, and the sum without it exact in f64
        let expected = ((7.25_f64 - 2.5 + 1.0) * PER_UNIT) as i128 - (1 << 12) + 3;
        assert_eq!(sum, expected);
    }

    #[test]
    fn bad_values_are_told() {
        assert_eq!(quantize(f64::NAN), Err(Unrepresentable::NotFinite));
        assert_eq!(quantize(f64::NEG_INFINITY), Err(Unrepresentable::NotFinite));
        assert_eq!(quantize(1e15), Err(Unrepresentable::TooLarge));
    }
}
