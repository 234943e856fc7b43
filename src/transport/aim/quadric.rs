//! Surfaces of the second degree: ellipsoids, scaled cylinders, surfaces of lenses.

use super::surface::quadratic_root;
use glam::{DAffine3, DMat3, DVec3};

/// The points at which `v·Q v + 2 b·v + c` is 0, for v from a point of reference; the normal points
/// to where it grows. A line meets the surface from either side once at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quadric {
    origin: DVec3,
    /// Symmetric.
    q: DMat3,
    b: DVec3,
    c: f64,
}

impl Quadric {
    /// The image under `to_world`, which takes back `to_object`, of the surface given by `q`
    /// (symmetric), `b` and `c` in object space.
    #[must_use]
    pub fn placed(q: DMat3, b: DVec3, c: f64, to_world: &DAffine3, to_object: &DAffine3) -> Self {
        let back = to_object.matrix3;
        Self {
            origin: to_world.translation,
            q: back.transpose() * q * back,
            b: back.transpose() * b,
            c,
        }
    }

    /// The point of reference: the center of an ellipsoid, the vertex of a lens surface.
    pub(super) fn reference(&self) -> DVec3 {
        self.origin
    }

    /// For an ellipsoid about its reference, a map of offsets that makes it the unit sphere.
    pub(super) fn sphere_map(&self) -> Option<DMat3> {
        if self.b != DVec3::ZERO || self.c != -1.0 {
            return None;
        }
        // Cholesky's factor: the map up to a rotation
        let q = self.q;
        let x = q.x_axis.x.sqrt();
        let (yx, zx) = (q.x_axis.y / x, q.x_axis.z / x);
        let y = (q.y_axis.y - yx * yx).sqrt();
        let zy = (q.y_axis.z - zx * yx) / y;
        let z = (q.z_axis.z - zx * zx - zy * zy).sqrt();
        let map = DMat3::from_cols(
            DVec3::new(x, 0.0, 0.0),
            DVec3::new(yx, y, 0.0),
            DVec3::new(zx, zy, z),
        );
        (map.is_finite() && z > 0.0).then_some(map)
    }

    /// Whether a point is outside of an ellipsoid.
    pub(super) fn is_outside(&self, p: DVec3) -> Option<bool> {
        let is_ellipsoid = self.b == DVec3::ZERO && self.sphere_map().is_some();
        is_ellipsoid.then(|| self.height(p) > 0.0)
    }

    fn height(&self, p: DVec3) -> f64 {
        let v = p - self.origin;
        v.dot(self.q * v) + 2.0 * self.b.dot(v) + self.c
    }

    /// Half the gradient.
    fn slope(&self, p: DVec3) -> DVec3 {
        self.q * (p - self.origin) + self.b
    }

    pub(super) fn normal(&self, p: DVec3) -> DVec3 {
        self.slope(p).normalize()
    }

    pub(super) fn turn(&self, p: DVec3, dp: DVec3) -> DVec3 {
        let slope = self.slope(p);
        let length = slope.length();
        (self.q * dp / length).reject_from_normalized(slope / length)
    }

    pub(super) fn meet(&self, o: DVec3, d: DVec3, above: bool) -> Option<f64> {
        let slope = self.slope(o);
        quadratic_root(d.dot(self.q * d), 2.0 * d.dot(slope), self.height(o), above)
    }

    /// Moved along the normal onto the surface from near it.
    pub(super) fn settle(&self, p: DVec3) -> DVec3 {
        let slope = self.slope(p);
        p - slope * (0.5 * self.height(p) / slope.length_squared())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, dvec3};

    #[test]
    fn an_ellipsoid_is_met_where_its_sphere_is_in_its_own_space() {
        let to_world = DAffine3::from_scale_rotation_translation(
            dvec3(0.3, 2.0, 1.1),
            DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(-0.4),
            dvec3(5.0, -2.0, 1.0),
        );
        let back = to_world.inverse();
        let ellipsoid = Quadric::placed(DMat3::IDENTITY, DVec3::ZERO, -1.0, &to_world, &back);
        let mut met = 0;
        for i in 0..200 {
            let angle = f64::from(i);
            let o = dvec3(
                5.0 * angle.sin(),
                4.0 * angle.cos(),
                3.0 * (0.7 * angle).sin(),
            );
            let o = o + to_world.translation;
            let aim = 0.8 * dvec3((2.1 * angle).sin(), angle.cos(), (1.3 * angle).cos());
            let d = (to_world.transform_point3(aim) - o).normalize();
            let (q, w) = (back.transform_point3(o), back.transform_vector3(d));
            let (half, nearest) = (q.dot(w) / w.length_squared(), q.length_squared() - 1.0);
            let square = half * half - nearest / w.length_squared();
            let both = [true, false].map(|above| ellipsoid.meet(o, d, above));
            if square < 0.0 {
                assert_eq!(both, [None; 2]);
                continue;
            }
            met += 1;
            for (t, sign) in both.into_iter().zip([-1.0, 1.0]) {
                let expected = -half + sign * square.sqrt();
                assert!((t.unwrap() - expected).abs() < 1e-9 * expected.abs(), "{i}");
            }
            // outward, and that of the sphere by the transposed inverse
            let p = o + d * both[0].unwrap();
            let normal = back.matrix3.transpose() * back.transform_point3(p);
            assert!(ellipsoid.normal(p).distance(normal.normalize()) < 1e-9);
            assert_eq!(ellipsoid.is_outside(o), Some(q.length() > 1.0));
        }
        assert!(met > 50, "{met}");
    }
}
