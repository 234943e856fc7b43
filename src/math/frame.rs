//! Orthonormal bases around a direction.

use glam::DVec3;

/// A right-handed orthonormal basis whose local z axis is a given unit vector.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Local x axis in the outer space.
    pub x: DVec3,
    /// Local y axis in the outer space.
    pub y: DVec3,
    /// Local z axis in the outer space.
    pub z: DVec3,
}

impl Frame {
    /// The basis around the unit vector `z` (Duff et al. 2017: continuous but for z = -1, no
    /// branch).
    #[must_use]
    pub fn from_z(z: DVec3) -> Self {
        let sign = 1.0_f64.copysign(z.z);
        let a = -1.0 / (sign + z.z);
        let b = z.x * z.y * a;
        let x = DVec3::new(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x);
        let y = DVec3::new(b, sign + z.y * z.y * a, -z.y);
        Self { x, y, z }
    }

    /// From outer to local coordinates.
    #[must_use]
    pub fn to_local(&self, v: DVec3) -> DVec3 {
        DVec3::new(v.dot(self.x), v.dot(self.y), v.dot(self.z))
    }

    /// From local to outer coordinates.
    #[must_use]
    pub fn to_outer(&self, v: DVec3) -> DVec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

/// The unit vector along `v`: `v` itself where that has unit length but for rounding, which most
/// maps leave as it is, and which takes no root.
#[must_use]
#[inline]
pub fn normalized(v: DVec3) -> DVec3 {
    let square = v.length_squared();
    if (square - 1.0).abs() <= 8.0 * f64::EPSILON {
        return v;
    }
    v * (1.0 / square.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_vectors_stay_as_they_are_and_others_become_such() {
        let unit = DVec3::new(1.0, -2.0, 0.5).normalize();
        assert_eq!(normalized(unit), unit);
        for factor in [1e-9, 0.999_999, 1.0 + 1e-12, 4e5] {
            let error = (normalized(unit * factor) - unit).length();
            assert!(error < 4.0 * f64::EPSILON, "{factor}: {error}");
        }
        assert!(normalized(DVec3::ZERO).is_nan());
    }
}
