//! Meshes whose normals are interpolated: facets that bend light as a smooth surface does.
//!
//! A ray meets the first triangle in its way and is scattered at the normal that those of the
//! vertices make there, as walks do. So a chain is found triangle by triangle, and each of its
//! vertices then lies on a plane with a field of normals of its own.

use crate::geometry::{InstanceId, Mesh, Placement, Ray, SurfaceId};
use glam::{DMat3, DVec3};

/// A mesh with normals at its vertices, where it is.
#[derive(Clone, Copy, Debug)]
pub struct Smooth<'s> {
    mesh: &'s Mesh,
    id: InstanceId,
    placement: Placement,
}

impl PartialEq for Smooth<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

/// The plane of a triangle with the normals that scatter there: linear in the position, before they
/// are made unit vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothTriangle {
    /// A corner.
    origin: DVec3,
    /// Unit normal of the plane.
    face_normal: DVec3,
    /// Normal at the corner, on the side of that of the plane.
    at_origin: DVec3,
    /// Change of it per meter.
    slope: DMat3,
}

impl<'s> Smooth<'s> {
    /// A mesh as instance `id` under `placement`.
    #[must_use]
    pub fn new(mesh: &'s Mesh, id: InstanceId, placement: Placement) -> Self {
        Self {
            mesh,
            id,
            placement,
        }
    }

    /// The point of reference: the middle of its bounds.
    pub(super) fn reference(&self) -> DVec3 {
        let (low, high) = self.mesh.bounds();
        self.placement.to_world.transform_point3((low + high) / 2.0)
    }

    /// The first triangle that a ray meets that leaves triangle `from`, if it is met from the side
    /// that its normal points to (`above`) or from the other; and the distance.
    pub(super) fn meet(
        &self,
        o: DVec3,
        d: DVec3,
        above: bool,
        from: Option<u32>,
    ) -> Option<(f64, u32)> {
        let from = from.map(|prim| SurfaceId {
            instance: self.id,
            prim,
        });
        let ray = Ray::leaving(o, d, from);
        let (t, prim) = self.mesh.first_hit(self.id, &self.placement, &ray)?;
        let normal = self.mesh.geometric_normal(prim, 0.0);
        let approach = d.dot(self.placement.normal_to_world(normal));
        let is_met = if above {
            approach < 0.0
        } else {
            approach > 0.0
        };
        is_met.then_some((t, prim))
    }

    /// Triangle `prim`.
    #[must_use]
    pub fn triangle(&self, prim: u32) -> SmoothTriangle {
        let Placement {
            to_world,
            to_object,
            ..
        } = &self.placement;
        let corners = self.mesh.corners(prim, 0.0);
        let face = self.mesh.geometric_normal(prim, 0.0);
        let normals = self.mesh.vertex_normals(prim).unwrap_or([face; 3]);
        // from the two edges and the normal, along which nothing changes
        let edges = DMat3::from_cols(corners[1] - corners[0], corners[2] - corners[0], face);
        let changes = DMat3::from_cols(
            normals[1] - normals[0],
            normals[2] - normals[0],
            DVec3::ZERO,
        );
        let back = to_object.matrix3;
        let turn = back.transpose();
        let face_normal = self.placement.normal_to_world(face);
        let slope = turn * (changes * edges.inverse()) * back;
        SmoothTriangle {
            origin: to_world.transform_point3(corners[0]),
            face_normal,
            at_origin: turn * normals[0],
            slope,
        }
    }
}

impl SmoothTriangle {
    /// Unit normal of the plane.
    pub(super) fn face_normal(&self) -> DVec3 {
        self.face_normal
    }

    /// The normal that scatters at a point of the plane, on the side of that of the plane, and its
    /// length before it was made a unit vector.
    fn scaled_normal(&self, p: DVec3) -> (DVec3, f64) {
        let n = self.at_origin + self.slope * (p - self.origin);
        let length = if n.dot(self.face_normal) < 0.0 {
            -n.length()
        } else {
            n.length()
        };
        (n / length, length)
    }

    pub(super) fn normal(&self, p: DVec3) -> DVec3 {
        self.scaled_normal(p).0
    }

    pub(super) fn turn(&self, p: DVec3, dp: DVec3) -> DVec3 {
        let (n, length) = self.scaled_normal(p);
        (self.slope * dp / length).reject_from_normalized(n)
    }

    pub(super) fn settle(&self, p: DVec3) -> DVec3 {
        p - self.face_normal * (p - self.origin).dot(self.face_normal)
    }
}
