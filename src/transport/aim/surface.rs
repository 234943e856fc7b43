//! Surfaces that chains are solved for, as if they had no bounds.

use glam::DVec3;

/// An unbounded smooth surface. Normals point as those of hits do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Surface {
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
        /// A point on the axis.
        center: DVec3,
        /// Unit direction of the axis.
        axis: DVec3,
        /// Radius.
        radius: f64,
    },
}

impl Surface {
    /// Unit normal at a point of the surface.
    #[must_use]
    pub fn normal(&self, p: DVec3) -> DVec3 {
        match *self {
            Self::Plane { normal, .. } => normal,
            Self::Sphere { center, .. } => (p - center).normalize(),
            Self::Cylinder { center, axis, .. } => (p - center).reject_from(axis).normalize(),
        }
    }

    /// Change of the normal for a step `dp` along the surface: the shape operator.
    #[must_use]
    pub fn turn(&self, dp: DVec3) -> DVec3 {
        match *self {
            Self::Plane { .. } => DVec3::ZERO,
            Self::Sphere { radius, .. } => dp / radius,
            Self::Cylinder { axis, radius, .. } => dp.reject_from(axis) / radius,
        }
    }
}
