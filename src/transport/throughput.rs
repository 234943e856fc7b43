//! The weight a sub-path carries: lanes of order one times a wide-range scale.

use crate::spectrum::{MAX_LANES, SampledSpectrum};

/// `scale · lanes`. The scale holds what all lanes share (areas, 1/density), so that the f32 lanes
/// never leave their range.
#[derive(Clone, Copy, Debug)]
pub struct Throughput {
    /// Common factor.
    pub scale: f64,
    /// Per-lane factor, of order one.
    pub lanes: SampledSpectrum,
}

impl Throughput {
    /// `scale` in every lane.
    #[must_use]
    pub const fn splat(scale: f64) -> Self {
        Self {
            scale,
            lanes: SampledSpectrum::ONE,
        }
    }

    /// Times a spectrum.
    #[must_use]
    #[inline]
    pub fn times(self, factor: &SampledSpectrum) -> Self {
        let product = Self {
            scale: self.scale,
            lanes: self.lanes * *factor,
        };
        let max = product.lanes.max_lane(MAX_LANES);
        if (1e-3..=1e3).contains(&max) || max == 0.0 {
            product
        } else {
            product.balanced(max)
        }
    }

    /// The same weight, with the largest of all lanes, `max`, moved into the scale.
    #[cold]
    fn balanced(self, max: f32) -> Self {
        if !max.is_finite() {
            return self;
        }
        // a power of two moves between the two parts without rounding
        let exponent = max.log2().floor() as i32;
        let shift = 2.0_f64.powi(exponent);
        Self {
            scale: self.scale * shift,
            lanes: self.lanes.map(|v| (f64::from(v) / shift) as f32),
        }
    }

    /// Times a number.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            scale: self.scale * factor,
            ..self
        }
    }

    /// The largest of the first `count` lanes.
    #[must_use]
    pub fn max_lane(&self, count: usize) -> f64 {
        self.scale * f64::from(self.lanes.max_lane(count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thousand_small_factors_do_not_underflow() {
        let factor = SampledSpectrum::splat(1e-3);
        let mut t = Throughput::splat(1.0);
        for _ in 0..90 {
            t = t.times(&factor);
        }
        let relative = (t.max_lane(4) / 1e-270 - 1.0).abs();
        // each product rounds in f32: 90 roundings of 6e-8
        assert!(relative < 1e-5, "{relative}");
    }
}
