//! Keyed values over time, with the three interpolations of glTF 2.0 (appendix C), and bounds of
//! their derivatives.
//!
//! Before its first key and after its last a track holds their values.

use glam::{DVec3, DVec4};
use std::ops::{Add, Mul, Sub};

/// Value that a track can hold.
pub trait Vector:
    Copy + PartialEq + Add<Output = Self> + Sub<Output = Self> + Mul<f64, Output = Self>
{
    /// The value without any effect: 0.
    const ZERO: Self;
    /// Whether all components are finite.
    fn is_finite(self) -> bool;
}

impl Vector for f64 {
    const ZERO: Self = 0.0;
    fn is_finite(self) -> bool {
        self.is_finite()
    }
}

impl Vector for DVec3 {
    const ZERO: Self = DVec3::ZERO;
    fn is_finite(self) -> bool {
        DVec3::is_finite(self)
    }
}

impl Vector for DVec4 {
    const ZERO: Self = DVec4::ZERO;
    fn is_finite(self) -> bool {
        DVec4::is_finite(self)
    }
}

/// How a value goes from key to key.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// The value stays until the next key.
    Step,
    /// Along a straight line; rotations along the shortest great arc.
    #[default]
    Linear,
    /// By cubic Hermite splines.
    Cubic,
}

/// Why keys are no track.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TrackError {
    /// No key.
    #[error("no keys")]
    Empty,
    /// Times must rise from key to key.
    #[error("the time of key {0} is not above that of the key before")]
    NotAscending(usize),
    /// A time, value or tangent is infinite or not a number.
    #[error("key {0} is not finite")]
    NotFinite(usize),
    /// Another number of tangents than keys.
    #[error("{tangents} pairs of tangents for {keys} keys")]
    WrongCount {
        /// Pairs given.
        tangents: usize,
        /// Keys given.
        keys: usize,
    },
}

/// Values at ascending times (seconds).
#[derive(Clone, Debug, PartialEq)]
pub struct Track<T> {
    times: Vec<f64>,
    values: Vec<T>,
    /// Cubic: derivatives on arriving at each key and on leaving it, per second.
    tangents: Vec<[T; 2]>,
    interpolation: Interpolation,
}

/// Where a moment falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Span {
    /// The value of a key holds.
    Held(usize),
    /// Between a key and the next, at this fraction of the way.
    Between(usize, f64),
}

impl<T: Vector> Track<T> {
    /// A track through `keys` (time in seconds, value). Cubic tangents are the slopes between the
    /// neighbors of a key (Catmull-Rom), at the ends those to the only neighbor.
    ///
    /// # Errors
    /// [`TrackError`] without keys, or if times do not rise or a number is not finite.
    pub fn new(keys: &[(f64, T)], interpolation: Interpolation) -> Result<Self, TrackError> {
        let tangents = match interpolation {
            Interpolation::Cubic => {
                let last = keys.len().saturating_sub(1);
                (0..keys.len())
                    .map(|i| {
                        let (a, b) = (keys[i.saturating_sub(1)], keys[(i + 1).min(last)]);
                        let dt = b.0 - a.0;
                        let slope = if dt > 0.0 {
                            (b.1 - a.1) * (1.0 / dt)
                        } else {
                            T::ZERO
                        };
                        [slope; 2]
                    })
                    .collect()
            }
            Interpolation::Step | Interpolation::Linear => Vec::new(),
        };
        Self::checked(keys, tangents, interpolation)
    }

    /// A cubic track with tangents given: on arriving at each key and on leaving it, per second.
    ///
    /// # Errors
    /// As [`Track::new`], and if there are not as many pairs of tangents as keys.
    pub fn with_tangents(keys: &[(f64, T)], tangents: Vec<[T; 2]>) -> Result<Self, TrackError> {
        if tangents.len() != keys.len() {
            return Err(TrackError::WrongCount {
                tangents: tangents.len(),
                keys: keys.len(),
            });
        }
        Self::checked(keys, tangents, Interpolation::Cubic)
    }

    fn checked(
        keys: &[(f64, T)],
        tangents: Vec<[T; 2]>,
        interpolation: Interpolation,
    ) -> Result<Self, TrackError> {
        if keys.is_empty() {
            return Err(TrackError::Empty);
        }
        // a key before its neighbors' tangents, which are made from it
        let finite = |key: &(f64, T)| key.0.is_finite() && key.1.is_finite();
        if let Some(i) = keys.iter().position(|key| !finite(key)) {
            return Err(TrackError::NotFinite(i));
        }
        for (i, (time, _)) in keys.iter().enumerate() {
            let pair = tangents.get(i).copied().unwrap_or([T::ZERO; 2]);
            if !pair.iter().all(|t| t.is_finite()) {
                return Err(TrackError::NotFinite(i));
            }
            if i > 0 && *time <= keys[i - 1].0 {
                return Err(TrackError::NotAscending(i));
            }
        }
        Ok(Self {
            times: keys.iter().map(|k| k.0).collect(),
            values: keys.iter().map(|k| k.1).collect(),
            tangents,
            interpolation,
        })
    }

    /// Times of the keys, ascending, in seconds.
    #[must_use]
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Values of the keys.
    #[must_use]
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// How it goes from key to key.
    #[must_use]
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// Where `t` falls; exactly at a key after it, or before it if `before`.
    #[inline]
    pub(super) fn span(&self, t: f64, before: bool) -> Span {
        let next = if before {
            self.times.partition_point(|&k| k < t)
        } else {
            self.times.partition_point(|&k| k <= t)
        };
        if next == 0 {
            Span::Held(0)
        } else if next == self.times.len() || self.interpolation == Interpolation::Step {
            Span::Held(next - 1)
        } else {
            let (a, b) = (self.times[next - 1], self.times[next]);
            Span::Between(next - 1, (t - a) / (b - a))
        }
    }

    /// The value at `t`; at a step after it, or before it if `before`.
    #[must_use]
    #[inline]
    pub fn at(&self, t: f64, before: bool) -> T {
        match self.span(t, before) {
            Span::Held(i) => self.values[i],
            Span::Between(i, u) if self.interpolation == Interpolation::Linear => {
                self.values[i] + (self.values[i + 1] - self.values[i]) * u
            }
            Span::Between(i, u) => self.hermite(i, u)[0],
        }
    }

    /// Value, first and second derivative (per second) of a cubic between key `i` and the next.
    fn hermite(&self, i: usize, u: f64) -> [T; 3] {
        let dt = self.times[i + 1] - self.times[i];
        let (v0, v1) = (self.values[i], self.values[i + 1]);
        // tangents per unit of u
        let (m0, m1) = (self.tangents[i][1] * dt, self.tangents[i + 1][0] * dt);
        let rise = v1 - v0;
        let (u2, u3) = (u * u, u * u * u);
        [
            v0 + rise * (3.0 * u2 - 2.0 * u3) + m0 * (u3 - 2.0 * u2 + u) + m1 * (u3 - u2),
            (rise * (6.0 * (u - u2)) + m0 * (3.0 * u2 - 4.0 * u + 1.0) + m1 * (3.0 * u2 - 2.0 * u))
                * (1.0 / dt),
            (rise * (6.0 - 12.0 * u) + m0 * (6.0 * u - 4.0) + m1 * (6.0 * u - 2.0))
                * (1.0 / (dt * dt)),
        ]
    }

    /// Bounds of the size (by `norm`, which is convex) of value, first and second derivative over
    /// `a..b`, in whose inside no key lies.
    pub(super) fn bounds(&self, a: f64, b: f64, norm: impl Fn(T) -> f64) -> [f64; 3] {
        let ends = norm(self.at(a, false)).max(norm(self.at(b, true)));
        let Span::Between(i, _) = self.span(0.5 * (a + b), false) else {
            return [ends, 0.0, 0.0];
        };
        let (t, dt) = (self.times[i], self.times[i + 1] - self.times[i]);
        if self.interpolation == Interpolation::Linear {
            return [ends, norm(self.values[i + 1] - self.values[i]) / dt, 0.0];
        }
        // the second derivative is linear, so that it is largest at an end
        let [_, slope, bend] = self.hermite(i, (a - t) / dt);
        let bend = norm(bend).max(norm(self.hermite(i, (b - t) / dt)[2]));
        let h = b - a;
        [ends + bend * h * h / 8.0, norm(slope) + bend * h, bend]
    }

    /// Whether the value may change within `a..=b`.
    pub(super) fn varies(&self, a: f64, b: f64) -> bool {
        let first = match self.span(a, false) {
            Span::Held(i) | Span::Between(i, _) => i,
        };
        let last = match self.span(b, false) {
            Span::Between(i, u) if u > 0.0 => i + 1,
            Span::Held(i) | Span::Between(i, _) => i,
        };
        let bent = |i: usize| {
            self.tangents
                .get(i)
                .is_some_and(|pair| *pair != [T::ZERO; 2])
        };
        last > first && (first..=last).any(|i| self.values[i] != self.values[first] || bent(i))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(interpolation: Interpolation) -> Track<f64> {
        Track::new(
            &[(1.0, 2.0), (2.0, 6.0), (4.0, 0.0), (5.0, 1.0)],
            interpolation,
        )
        .expect("valid")
    }

    #[test]
    fn keys_are_met_and_ends_held() {
        use Interpolation::{Cubic, Linear, Step};
        for interpolation in [Step, Linear, Cubic] {
            let track = track(interpolation);
            for (t, v) in [(-9.0, 2.0), (1.0, 2.0), (2.0, 6.0), (4.0, 0.0), (7.0, 1.0)] {
                assert_eq!(track.at(t, false), v);
            }
        }
        assert_eq!(track(Linear).at(3.0, false), 3.0);
        assert_eq!(track(Step).at(3.999, false), 6.0);
        assert_eq!(track(Step).at(4.0, true), 6.0);
        // Catmull-Rom: slopes 4 (one-sided) and -2/3 at the ends of the first segment, Hermite in
        // the middle
        let middle = 0.5 * (2.0 + 6.0) + (4.0 + 2.0 / 3.0) / 8.0;
        assert!((track(Cubic).at(1.5, false) - middle).abs() < 1e-15);
    }

    #[test]
    fn bad_keys_are_refused() {
        let new = |keys: &[(f64, f64)]| Track::new(keys, Interpolation::Cubic).err();
        assert_eq!(new(&[]), Some(TrackError::Empty));
        assert_eq!(
            new(&[(0.0, 1.0), (0.0, 2.0)]),
            Some(TrackError::NotAscending(1))
        );
        assert_eq!(
            new(&[(0.0, 1.0), (1.0, f64::NAN)]),
            Some(TrackError::NotFinite(1))
        );
        assert_eq!(
            Track::with_tangents(&[(0.0, 1.0)], Vec::new()).err(),
            Some(TrackError::WrongCount {
                tangents: 0,
                keys: 1
            })
        );
    }

    #[test]
    fn bounds_hold_and_derivatives_are_those_of_the_value() {
        let track = track(Interpolation::Cubic);
        let h = 1e-4;
        for i in 0..100 {
            let a = 1.0 + 4.0 * f64::from(i) / 100.0;
            let [v, d, dd] = track.bounds(a, a + 0.04, f64::abs);
            for j in 0..=8 {
                let t = a + 0.04 * f64::from(j) / 8.0;
                let (x0, x1, x2) = (
                    track.at(t - h, true),
                    track.at(t, j == 8),
                    track.at(t + h, true),
                );
                assert!(x1.abs() <= v * (1.0 + 1e-12));
                // away from the keys, where the second derivative jumps
                if (1..8).contains(&j) {
                    assert!((x2 - x0).abs() / (2.0 * h) <= d * (1.0 + 1e-6) + 1e-6);
                    assert!((x2 - 2.0 * x1 + x0).abs() / (h * h) <= dd * (1.0 + 1e-4) + 1e-4);
                }
            }
        }
    }

    #[test]
    fn only_the_keys_of_the_interval_count_as_change() {
        let keys = [(0.0, 1.0), (1.0, 1.0), (2.0, 3.0)];
        let linear = Track::new(&keys, Interpolation::Linear).expect("valid");
        assert!(!linear.varies(-1.0, 1.0) && linear.varies(0.5, 1.5) && !linear.varies(2.0, 9.0));
        let step = Track::new(&keys, Interpolation::Step).expect("valid");
        assert!(!step.varies(0.0, 1.9) && step.varies(0.0, 2.0));
    }
}
