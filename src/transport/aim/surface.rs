//! Surfaces that chains are solved for, as if they had no bounds.

use super::quadric::Quadric;
use super::smooth::{Smooth, SmoothTriangle};
use glam::DVec3;

/// An unbounded smooth surface. Normals point as those of hits do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface<'s> {
    /// A plane.
    Plane {
        /// A point on it.
        origin: DVec3,
        /// Unit normal.
        normal: DVec3,
    },
    /// A sphere, normal outward.
    Sphere {
        /// Center.
        center: DVec3,
        /// Radius.
        radius: f64,
    },
    /// A circular cylinder, normal outward.
    Cylinder {
        /// The middle of the axis.
        center: DVec3,
        /// Unit direction of the axis.
        axis: DVec3,
        /// Radius.
        radius: f64,
        /// Length of the axis to either side of its middle over which there is a surface.
        half_length: f64,
    },
    /// Any other surface of the second degree.
    Quadric(Quadric),
    /// A mesh whose normals are interpolated.
    Mesh(Smooth<'s>),
    /// One triangle of such a mesh.
    Triangle(SmoothTriangle),
}

impl Surface<'_> {
    /// The surface at a vertex of a chain that was found on triangle `prim`, if it is a mesh.
    #[must_use]
    pub fn at(self, prim: u32) -> Self {
        match self {
            Self::Mesh(mesh) => Self::Triangle(mesh.triangle(prim)),
            _ => self,
        }
    }

    /// Unit normal at a point of the surface, at which light is scattered. None of a mesh, whose
    /// triangles have theirs.
    #[must_use]
    pub fn normal(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Plane { normal, .. } => *normal,
            Self::Sphere { center, .. } => (p - *center).normalize(),
            Self::Cylinder { center, axis, .. } => (p - *center).reject_from(*axis).normalize(),
            Self::Quadric(quadric) => quadric.normal(p),
            Self::Triangle(triangle) => triangle.normal(p),
            Self::Mesh(_) => DVec3::NAN,
        }
    }

    /// Unit normal of the surface itself, on the same side.
    #[must_use]
    pub fn face_normal(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Triangle(triangle) => triangle.face_normal(),
            _ => self.normal(p),
        }
    }

    /// Both, that at which light is scattered first.
    #[must_use]
    pub fn normals(&self, p: DVec3) -> [DVec3; 2] {
        let normal = self.normal(p);
        match self {
            Self::Triangle(triangle) => [normal, triangle.face_normal()],
            _ => [normal; 2],
        }
    }

    /// Change of the normal for a step `dp` along the surface from `p`: the shape operator.
    #[must_use]
    pub fn turn(&self, p: DVec3, dp: DVec3) -> DVec3 {
        match self {
            Self::Plane { .. } => DVec3::ZERO,
            Self::Sphere { radius, .. } => dp / *radius,
            Self::Cylinder { axis, radius, .. } => dp.reject_from(*axis) / *radius,
            Self::Quadric(quadric) => quadric.turn(p, dp),
            Self::Triangle(triangle) => triangle.turn(p, dp),
            Self::Mesh(_) => DVec3::NAN,
        }
    }

    /// Distance at which a ray with unit direction, which leaves triangle `from` of a mesh, meets
    /// the surface from the side that the normal points to (`above`) or from the other; and the
    /// triangle that it meets of a mesh.
    #[must_use]
    pub fn meet(&self, o: DVec3, d: DVec3, above: bool, from: Option<u32>) -> Option<(f64, u32)> {
        if let Self::Mesh(mesh) = self {
            return mesh.meet(o, d, above, from);
        }
        let round = |o: DVec3, d: DVec3, radius: f64| {
            let height = 0.5 * (o.length() - radius) * (o.length() + radius);
            quadratic_root(0.5 * d.length_squared(), o.dot(d), height, above)
        };
        match self {
            Self::Plane { origin, normal } => {
                let approach = d.dot(*normal);
                let is_met = if above {
                    approach < 0.0
                } else {
                    approach > 0.0
                };
                is_met.then(|| (*origin - o).dot(*normal) / approach)
            }
            Self::Sphere { center, radius } => round(o - *center, d, *radius),
            Self::Cylinder {
                center,
                axis,
                radius,
                ..
            } => round(
                (o - *center).reject_from(*axis),
                d.reject_from(*axis),
                *radius,
            ),
            Self::Quadric(quadric) => quadric.meet(o, d, above),
            Self::Mesh(_) | Self::Triangle(_) => None,
        }
        .filter(|t| *t > 0.0)
        .map(|t| (t, 0))
    }

    /// Whether a point is on the side that the normal points to; `None` where both are one, or go
    /// over into each other around a rim.
    #[must_use]
    pub fn is_above(&self, p: DVec3) -> Option<bool> {
        match self {
            Self::Plane { origin, normal } => Some((p - *origin).dot(*normal) > 0.0),
            Self::Sphere { center, radius } => Some(p.distance_squared(*center) >= radius * radius),
            Self::Cylinder { .. } | Self::Mesh(_) | Self::Triangle(_) => None,
            Self::Quadric(quadric) => quadric.is_outside(p),
        }
    }

    /// Whether the surface itself is between a point and its inner side: beside a cylinder, not
    /// beyond its ends.
    #[must_use]
    pub fn hides_inside_from(&self, p: DVec3) -> bool {
        let Self::Cylinder {
            center,
            axis,
            radius,
            half_length,
        } = self
        else {
            return false;
        };
        let v = p - *center;
        v.dot(*axis).abs() <= *half_length
            && v.reject_from(*axis).length_squared() > radius * radius
    }

    /// Onto the surface from near it, where positions have few digits.
    #[must_use]
    pub fn settle(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Quadric(quadric) => quadric.settle(p),
            Self::Triangle(triangle) => triangle.settle(p),
            Self::Plane { .. } | Self::Sphere { .. } | Self::Cylinder { .. } | Self::Mesh(_) => p,
        }
    }
}

/// Root of a t² + b t + c at which it falls (`falls`) or rises.
pub(super) fn quadratic_root(a: f64, b: f64, c: f64, falls: bool) -> Option<f64> {
    let root = (b * b - 4.0 * a * c).sqrt();
    // of a negative square it is no number
    let slope = if falls { -root } else { root };
    if root.is_nan() {
        None
    } else if slope * b > 0.0 {
        // without the difference of near-equal numbers
        Some(-2.0 * c / (b + slope))
    } else if a == 0.0 {
        None
    } else {
        Some((slope - b) / (2.0 * a))
    }
}
