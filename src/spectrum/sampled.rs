//! Values at the wavelengths of one path: one number per lane.

use std::ops::{Add, AddAssign, Div, Index, IndexMut, Mul, MulAssign, Neg, Sub};
use wide::f32x8;

/// The largest number of wavelengths a path can carry.
pub const MAX_LANES: usize = 8;

/// One value per lane; lanes beyond the scene's lane count are carried along and never read.
///
/// Eight lanes cost what four do (all operations are latency-bound), so the count is not a type
/// parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampledSpectrum(pub [f32; MAX_LANES]);

impl SampledSpectrum {
    /// Every lane 0.
    pub const ZERO: Self = Self([0.0; MAX_LANES]);
    /// Every lane 1.
    pub const ONE: Self = Self([1.0; MAX_LANES]);

    /// Every lane `value`.
    #[must_use]
    pub const fn splat(value: f32) -> Self {
        Self([value; MAX_LANES])
    }

    /// The lanes `f(0), f(1), ...`.
    #[must_use]
    pub fn from_fn(f: impl FnMut(usize) -> f32) -> Self {
        Self(std::array::from_fn(f))
    }

    /// `f` of the first `count` lanes, 0 in the others.
    ///
    /// The usual four are put together in a register: a vector that is read right after its lanes
    /// were written one by one waits until all of them have reached memory.
    #[must_use]
    #[inline]
    pub fn of_lanes(count: usize, mut f: impl FnMut(usize) -> f32) -> Self {
        if count == 4 {
            let [a, b, c, d] = [f(0), f(1), f(2), f(3)];
            return Self(f32x8::new([a, b, c, d, 0.0, 0.0, 0.0, 0.0]).to_array());
        }
        let mut out = Self::ZERO;
        for lane in 0..count {
            out[lane] = f(lane);
        }
        out
    }

    /// Each lane mapped.
    #[must_use]
    pub fn map(self, f: impl FnMut(f32) -> f32) -> Self {
        Self(self.0.map(f))
    }

    /// The largest of the first `count` lanes.
    #[must_use]
    #[inline]
    pub fn max_lane(&self, count: usize) -> f32 {
        let greater = |most: f32, v: f32| if v > most { v } else { most };
        let [a, b, c, d, ..] = self.0;
        match count {
            1 => greater(0.0, a),
            4 => greater(greater(greater(greater(0.0, a), b), c), d),
            _ => self.0[..count].iter().copied().fold(0.0, greater),
        }
    }

    /// The mean of the first `count` lanes.
    #[must_use]
    pub fn mean(&self, count: usize) -> f32 {
        self.0[..count].iter().sum::<f32>() / count as f32
    }

    /// Whether the first `count` lanes are all 0.
    #[must_use]
    pub fn is_black(&self, count: usize) -> bool {
        self.0[..count].iter().all(|&v| v == 0.0)
    }

    /// Whether the first `count` lanes are all finite.
    #[must_use]
    pub fn is_finite(&self, count: usize) -> bool {
        self.0[..count].iter().all(|v| v.is_finite())
    }

    /// Lane 0 kept, all others 0: what is left when the secondary wavelengths die.
    #[must_use]
    pub fn hero_only(self) -> Self {
        let mut out = Self::ZERO;
        out.0[0] = self.0[0];
        out
    }
}

impl Index<usize> for SampledSpectrum {
    type Output = f32;
    fn index(&self, lane: usize) -> &f32 {
        &self.0[lane]
    }
}

impl IndexMut<usize> for SampledSpectrum {
    fn index_mut(&mut self, lane: usize) -> &mut f32 {
        &mut self.0[lane]
    }
}

macro_rules! by_lane {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for SampledSpectrum {
            type Output = Self;
            fn $method(self, rhs: Self) -> Self {
                Self(std::array::from_fn(|i| self.0[i] $op rhs.0[i]))
            }
        }
        impl $trait<f32> for SampledSpectrum {
            type Output = Self;
            fn $method(self, rhs: f32) -> Self {
                Self(self.0.map(|v| v $op rhs))
            }
        }
    };
}
by_lane!(Add, add, +);
by_lane!(Sub, sub, -);
by_lane!(Mul, mul, *);
by_lane!(Div, div, /);

impl AddAssign for SampledSpectrum {
    fn add_assign(&mut self, rhs: Self) {
        *self = *self + rhs;
    }
}

impl MulAssign for SampledSpectrum {
    fn mul_assign(&mut self, rhs: Self) {
        *self = *self * rhs;
    }
}

impl MulAssign<f32> for SampledSpectrum {
    fn mul_assign(&mut self, rhs: f32) {
        *self = *self * rhs;
    }
}

impl Neg for SampledSpectrum {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.map(|v| -v))
    }
}
