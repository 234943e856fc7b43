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
