//! A map keyed in translation, rotation and scale, each with keys of its own: a node of an animated
//! hierarchy.

use super::shutter::Shutter;
use super::track::{Interpolation, Span, Track, TrackError};
use glam::{DAffine3, DMat3, DQuat, DVec3, DVec4};

/// Scaled, then rotated, then translated. What is `None` does nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// Metres.
    pub translation: Option<Track<DVec3>>,
    /// About the origin.
    pub rotation: Option<Rotation>,
    /// Factors along the axes; none may pass through 0.
    pub scale: Option<Track<DVec3>>,
}

/// A rotation over time.
#[derive(Clone, Debug, PartialEq)]
pub enum Rotation {
    /// Along great arcs from orientation to orientation, at most half a turn each.
    Arcs(Arcs),
    /// About one axis by any angle.
    Spin {
        /// Unit axis.
        axis: DVec3,
        /// Radians, any number of turns.
        angle_rad: Track<f64>,
    },
}

/// Keyed orientations.
#[derive(Clone, Debug, PartialEq)]
pub struct Arcs {
    quaternions: Track<DVec4>,
    /// Angle between the quaternions of a key and the next: half of what is turned.
    angles_rad: Vec<f64>,
}

impl Arcs {
    /// Through the orientations `keys` (time in seconds); linear means spherical interpolation
    /// along the shorter arc.
    ///
    /// # Errors
    /// As [`Track::new`].
    pub fn new(keys: &[(f64, DQuat)], interpolation: Interpolation) -> Result<Self, TrackError> {
        let mut signed: Vec<(f64, DVec4)> = Vec::with_capacity(keys.len());
        for (time, q) in keys {
            let q = DVec4::from(q.normalize());
            let opposite = signed.last().is_some_and(|last| last.1.dot(q) < 0.0);
            signed.push((*time, if opposite { -q } else { q }));
        }
        Ok(Self::over(Track::new(&signed, interpolation)?))
    }

    /// Cubic, with tangents given (those of a glTF sampler): quaternions are blended as they are,
    /// then normalized.
    ///
    /// # Errors
    /// As [`Track::with_tangents`].
    pub fn with_tangents(
        keys: &[(f64, DQuat)],
        tangents: Vec<[DVec4; 2]>,
    ) -> Result<Self, TrackError> {
        let keys: Vec<(f64, DVec4)> = keys.iter().map(|k| (k.0, k.1.into())).collect();
        Ok(Self::over(Track::with_tangents(&keys, tangents)?))
    }

    fn over(quaternions: Track<DVec4>) -> Self {
        // the sine of the half angle from the chord: exact for small turns, where the cosine is not
        let angle = |pair: &[DVec4]| 2.0 * (0.5 * (pair[1] - pair[0]).length()).min(1.0).asin();
        Self {
            angles_rad: quaternions.values().windows(2).map(angle).collect(),
            quaternions,
        }
    }

    fn at(&self, t: f64, before: bool) -> DQuat {
        let track = &self.quaternions;
        let q = match track.span(t, before) {
            Span::Held(i) => return DQuat::from_vec4(track.values()[i]),
            Span::Between(i, u) if track.interpolation() == Interpolation::Linear => {
                let (a, b) = (track.values()[i], track.values()[i + 1]);
                let angle = self.angles_rad[i];
                // nearly parallel: the arc is its chord
                if angle < 1e-8 {
                    a + (b - a) * u
                } else {
                    a * ((1.0 - u) * angle).sin() + b * (u * angle).sin()
                }
            }
            Span::Between(..) => track.at(t, before),
        };
        DQuat::from_vec4(q.normalize())
    }

    /// Bounds of the rate of turning and of the second derivative of the matrix.
    ///
    /// With q = p/|p|, |q'| <= |p'|/|p| and |q''| <= |p''|/|p| + 3 |p'|²/|p|²; the matrix of a unit
    /// quaternion has |R'| <= 2|q'| and |R''| <= 2|q''| + 2|q'|².
    fn bounds(&self, a: f64, b: f64) -> [f64; 2] {
        let track = &self.quaternions;
        match (track.span(0.5 * (a + b), false), track.interpolation()) {
            (Span::Held(_), _) => [0.0; 2],
            (Span::Between(i, _), Interpolation::Linear) => {
                let rate = 2.0 * self.angles_rad[i] / (track.times()[i + 1] - track.times()[i]);
                [rate, rate * rate]
            }
            _ => {
                let [_, d, dd] = track.bounds(a, b, DVec4::length);
                let middle = track.at(0.5 * (a + b), false).length();
                let least = middle - d * 0.5 * (b - a);
                if least <= 0.0 {
                    return [f64::INFINITY; 2];
                }
                let (q1, q2) = (d / least, dd / least + 3.0 * (d / least).powi(2));
                [2.0 * q1, 2.0 * q2 + 2.0 * q1 * q1]
            }
        }
    }
}

impl Rotation {
    fn at(&self, t: f64, before: bool) -> DMat3 {
        match self {
            Self::Arcs(arcs) => DMat3::from_quat(arcs.at(t, before)),
            Self::Spin { axis, angle_rad } => {
                DMat3::from_axis_angle(*axis, angle_rad.at(t, before))
            }
        }
    }

    /// Bounds of the matrix and its first two derivatives.
    fn bounds(&self, a: f64, b: f64) -> [f64; 3] {
        let [rate, bend] = match self {
            Self::Arcs(arcs) => arcs.bounds(a, b),
            Self::Spin { angle_rad, .. } => {
                let [_, rate, change] = angle_rad.bounds(a, b, f64::abs);
                [rate, rate * rate + change]
            }
        };
        [1.0, rate, bend]
    }

    fn varies(&self, a: f64, b: f64) -> bool {
        match self {
            Self::Arcs(arcs) => arcs.quaternions.varies(a, b),
            Self::Spin { angle_rad, .. } => angle_rad.varies(a, b),
        }
    }

    fn times(&self) -> &[f64] {
        match self {
            Self::Arcs(arcs) => arcs.quaternions.times(),
            Self::Spin { angle_rad, .. } => angle_rad.times(),
        }
    }
}

impl Pose {
    /// The map at `t` (seconds); at a step after it, or before it if `before`.
    #[must_use]
    #[inline]
    pub fn at(&self, t: f64, before: bool) -> DAffine3 {
        let mut matrix3 = self
            .rotation
            .as_ref()
            .map_or(DMat3::IDENTITY, |r| r.at(t, before));
        if let Some(scale) = &self.scale {
            matrix3 *= DMat3::from_diagonal(scale.at(t, before));
        }
        let translation = self.translation.as_ref();
        DAffine3 {
            matrix3,
            translation: translation.map_or(DVec3::ZERO, |track| track.at(t, before)),
        }
    }

    /// Whether the map may change while the shutter is open.
    #[must_use]
    pub fn varies(&self, shutter: Shutter) -> bool {
        let Shutter {
            open_s: a,
            close_s: b,
        } = shutter;
        self.translation.as_ref().is_some_and(|t| t.varies(a, b))
            || self.rotation.as_ref().is_some_and(|r| r.varies(a, b))
            || self.scale.as_ref().is_some_and(|s| s.varies(a, b))
    }

    /// Whether no scale passes through 0 at or between keys.
    #[must_use]
    pub fn is_invertible(&self) -> bool {
        let Some(scale) = &self.scale else {
            return true;
        };
        let sign = scale.values()[0].signum();
        let keys_agree = scale
            .values()
            .iter()
            .all(|s| *s != DVec3::ZERO && (*s * sign).cmpgt(DVec3::ZERO).all());
        // a cubic may leave the range of its keys: by no more than its bends allow
        let stays = |pair: &[f64]| {
            let [_, _, bend] = scale.bounds(pair[0], pair[1], |s| s.abs().max_element());
            let h = pair[1] - pair[0];
            let least = (scale.at(pair[0], false) * sign).min(scale.at(pair[1], true) * sign);
            least.min_element() > bend * h * h / 8.0
        };
        let fine: Vec<f64> = scale
            .times()
            .windows(2)
            .flat_map(|w| (0..64).map(move |i| w[0] + (w[1] - w[0]) * f64::from(i) / 64.0))
            .chain(scale.times().last().copied())
            .collect();
        keys_agree && (scale.interpolation() != Interpolation::Cubic || fine.windows(2).all(stays))
    }

    /// Times of all keys, in no order.
    pub fn times(&self) -> impl Iterator<Item = f64> {
        let translation = self.translation.iter().flat_map(Track::times);
        let rotation = self.rotation.iter().flat_map(Rotation::times);
        let scale = self.scale.iter().flat_map(Track::times);
        translation.chain(rotation).chain(scale).copied()
    }

    /// Bounds over `a..b` (without a key inside) of the linear part and of the translation: size,
    /// first and second derivative.
    pub(super) fn bounds(&self, a: f64, b: f64) -> ([f64; 3], [f64; 3]) {
        const ONE: [f64; 3] = [1.0, 0.0, 0.0];
        let rotation = self.rotation.as_ref().map_or(ONE, |r| r.bounds(a, b));
        let scale = self
            .scale
            .as_ref()
            .map_or(ONE, |s| s.bounds(a, b, |scale| scale.abs().max_element()));
        let offset = self
            .translation
            .as_ref()
            .map_or([0.0; 3], |t| t.bounds(a, b, DVec3::length));
        (product_rule(rotation, scale), offset)
    }
}

/// Bounds of a product and its first two derivatives from those of the factors.
pub(super) fn product_rule(f: [f64; 3], g: [f64; 3]) -> [f64; 3] {
    [
        f[0] * g[0],
        f[1] * g[0] + f[0] * g[1],
        f[2] * g[0] + 2.0 * f[1] * g[1] + f[0] * g[2],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    fn arcs(interpolation: Interpolation) -> Arcs {
        let axis = dvec3(1.0, -2.0, 0.5).normalize();
        let keys = [0.0, 2.5, 4.0, 3.0].map(|a| DQuat::from_axis_angle(axis, a));
        let keys: Vec<(f64, DQuat)> = keys
            .iter()
            .enumerate()
            .map(|(i, q)| (i as f64, if i == 2 { -*q } else { *q }))
            .collect();
        Arcs::new(&keys, interpolation).expect("valid")
    }

    #[test]
    fn spherical_interpolation_turns_at_constant_rate_the_short_way() {
        let arcs = arcs(Interpolation::Linear);
        for i in 0..=10 {
            let u = f64::from(i) / 10.0;
            // by the sine of the half angle: glam's angle_between is an approximation
            let angle = |a: DQuat, b: DQuat| {
                let turn = a.inverse() * b;
                2.0 * turn.xyz().length().atan2(turn.w.abs())
            };
            let turned = angle(DQuat::IDENTITY, arcs.at(u, false));
            assert!((turned - 2.5 * u).abs() < 1e-12, "{turned}");
            // the sign of the third key does not matter
            let turned = angle(arcs.at(1.0, false), arcs.at(1.0 + u, false));
            assert!((turned - 1.5 * u).abs() < 1e-12, "{turned}");
        }
    }

    #[test]
    fn derivatives_of_rotations_keep_their_bounds() {
        for interpolation in [Interpolation::Linear, Interpolation::Cubic] {
            let rotation = Rotation::Arcs(arcs(interpolation));
            let h = 1e-4;
            let x = dvec3(0.3, 0.8, -0.5).normalize();
            for i in 0..300 {
                let a = f64::from(i) / 100.0;
                let [_, d, dd] = rotation.bounds(a, a + 0.01);
                let at = |t: f64| rotation.at(t, false) * x;
                let (x0, x1, x2) = (at(a + 0.005 - h), at(a + 0.005), at(a + 0.005 + h));
                assert!((x2 - x0).length() / (2.0 * h) <= d * (1.0 + 1e-6));
                assert!((x2 - 2.0 * x1 + x0).length() / (h * h) <= dd * (1.0 + 1e-4) + 1e-6);
                // and the bounds are not idle
                assert!(d < 12.0 && dd < 200.0, "{d} {dd}");
            }
        }
    }

    #[test]
    fn scales_through_zero_are_seen() {
        let pose = |keys: &[(f64, DVec3)], interpolation| Pose {
            scale: Some(Track::new(keys, interpolation).expect("valid")),
            ..Pose::default()
        };
        use Interpolation::{Cubic, Linear};
        let one = DVec3::ONE;
        assert!(pose(&[(0.0, one), (1.0, one * 3.0)], Linear).is_invertible());
        assert!(!pose(&[(0.0, one), (1.0, -one)], Linear).is_invertible());
        // falls steeply and overshoots
        let keys = [(0.0, one * 30.0), (1.0, one), (2.0, one), (3.0, one)];
        assert!(pose(&keys, Linear).is_invertible() && !pose(&keys, Cubic).is_invertible());
    }
}
