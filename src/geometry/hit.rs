//! Hits of rays, first as bare ids, then as full local geometry.

use super::InstanceId;
use glam::{DVec2, DVec3};

/// One face of one instance. (Where a line can meet the face twice, the point on it tells the
/// root.)
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceId {
    /// The instance.
    pub instance: InstanceId,
    /// Triangle of a mesh, face of a box, 0 elsewhere.
    pub prim: u32,
}

/// The bare result of a closest-hit query.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance along the (unit) ray direction, in world units.
    pub t: f64,
    /// Surface that was hit.
    pub id: SurfaceId,
    /// Barycentric weights of the second and third vertex on a mesh, zero elsewhere.
    pub uv: DVec2,
}

/// Full local geometry of a surface point at one moment, in world space.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// Position, refined onto the surface.
    pub p: DVec3,
    /// Unit geometric normal: outward for closed shapes and counter-clockwise meshes.
    pub ng: DVec3,
    /// Unit shading normal, on the same side as `ng` by construction (interpolated mesh normals;
    /// else = `ng`).
    pub ns: DVec3,
    /// Texture coordinates.
    pub uv: DVec2,
    /// Face and instance.
    pub id: SurfaceId,
}

impl SurfacePoint {
    /// A point whose two normals are one, without texture coordinates.
    #[must_use]
    pub fn flat(p: DVec3, n: DVec3, id: SurfaceId) -> Self {
        Self {
            p,
            ng: n,
            ns: n,
            uv: DVec2::ZERO,
            id,
        }
    }
}
