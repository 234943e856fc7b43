//! The closed set of shapes, each in its own object space.
//!
//! Analytic shapes have unit size (lens surfaces that of their prescription) and are placed by the
//! transform of their instance. Here is what
//! any surface needs so that rays can hit it; [`super::AreaSampler`] adds what those need that
//! emit.

use super::analytic::{self, FaceHit};
use super::ray::LocalRay;
use super::{Deforming, LensShape, Mesh};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// A surface in its own space. Closed shapes have outward normals.
#[derive(Clone, Debug)]
pub enum Shape {
    /// Radius 1 about the origin.
    Sphere,
    /// Radius 1 in the plane z = 0, normal +z; `inner` (0..1) cuts a concentric hole.
    Disk {
        /// Radius of the hole, 0 for none.
        inner: f64,
    },
    /// The square -1..1 in x and y of the plane z = 0, normal +z.
    Quad,
    /// Radius 1 about the z axis, -1 <= z <= 1, open at both ends, normal outward.
    Cylinder,
    /// The cube -1..1 on each axis.
    Box,
    /// A lens surface within its aperture, open, normal on the side of +z.
    Lens(Arc<LensShape>),
    /// A triangle mesh.
    Mesh(Arc<Mesh>),
    /// A triangle mesh whose vertices move.
    Deforming(Arc<Deforming>),
}

/// A surface point in object space; the normals have unit length, except that `ns` may be
/// degenerate.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalPoint {
    pub p: DVec3,
    pub ng: DVec3,
    /// Interpolated normal, where the shape has one.
    pub ns: Option<DVec3>,
    pub uv: DVec2,
    pub prim: u32,
}

impl Shape {
    /// Whether it is a mesh so large that searches had better take turns.
    #[inline]
    pub(super) fn takes_turns(&self) -> bool {
        match self {
            Self::Mesh(mesh) => mesh.takes_turns(),
            Self::Deforming(mesh) => mesh.takes_turns(),
            _ => false,
        }
    }

    /// Name in messages.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Disk { .. } => "disk",
            Self::Quad => "quad",
            Self::Cylinder => "cylinder",
            Self::Box => "box",
            Self::Lens(_) => "lens surface",
            Self::Mesh(_) | Self::Deforming(_) => "mesh",
        }
    }

    /// Whether the shape bounds a solid (mesh: every edge shared by two triangles of opposite
    /// winding; takes time n log n).
    #[must_use]
    pub fn is_closed(&self) -> bool {
        match self {
            Self::Sphere | Self::Box => true,
            Self::Disk { .. } | Self::Quad | Self::Cylinder | Self::Lens(_) => false,
            Self::Mesh(mesh) => mesh.is_closed(),
            Self::Deforming(mesh) => mesh.is_closed(),
        }
    }

    /// An edge of a mesh that is open, from vertex to vertex in object space.
    #[must_use]
    pub fn open_edge(&self) -> Option<[DVec3; 2]> {
        match self {
            Self::Mesh(mesh) => mesh.open_edge(),
            Self::Deforming(mesh) => mesh.open_edge(),
            _ => None,
        }
    }

    /// Bounds in object space over the shutter.
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        match self {
            Self::Sphere | Self::Cylinder | Self::Box => (DVec3::NEG_ONE, DVec3::ONE),
            Self::Disk { .. } | Self::Quad => {
                (DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, 1.0, 0.0))
            }
            Self::Lens(lens) => lens.bounds(),
            Self::Mesh(mesh) => mesh.bounds(),
            Self::Deforming(mesh) => mesh.bounds(),
        }
    }

    /// Outward unit normal of face `prim` of a box, in object space; `None` of other shapes.
    #[must_use]
    pub fn face_normal(&self, prim: u32) -> Option<DVec3> {
        matches!(self, Self::Box).then(|| analytic::cube_normal(prim))
    }

    /// Largest coordinate of the shape, in object space.
    #[inline]
    pub(super) fn extent(&self) -> f64 {
        match self {
            Self::Lens(lens) => lens.extent(),
            Self::Mesh(mesh) => mesh.extent(),
            Self::Deforming(mesh) => mesh.extent(),
            _ => 1.0,
        }
    }

    /// Closest hit of an analytic shape (meshes bring their own tree); `ray` is that in the space
    /// of the shape, with the largest coordinate of the shape as its extent, and `is_end` tells
    /// whether one of its ends lies on the shape.
    #[inline(always)]
    pub(super) fn analytic_hit<'a>(
        &self,
        is_end: bool,
        ray: impl Fn(f64) -> LocalRay<'a>,
    ) -> Option<FaceHit> {
        match self {
            // a line meets a plane once
            Self::Disk { .. } | Self::Quad if is_end => None,
            Self::Sphere => analytic::sphere(&ray(1.0)),
            Self::Disk { inner } => analytic::disk(&ray(1.0), *inner),
            Self::Quad => analytic::quad(&ray(1.0)),
            Self::Cylinder => analytic::cylinder(&ray(1.0)),
            Self::Box => analytic::cube(&ray(1.0)),
            Self::Lens(lens) => lens.hit(&ray(lens.extent())),
            Self::Mesh(_) | Self::Deforming(_) => None,
        }
    }

    /// The point of face `prim` nearest to `p` (meshes: that with the barycentric `weights`) at
    /// `time`.
    pub(super) fn local_point(&self, prim: u32, p: DVec3, weights: DVec2, time: f64) -> LocalPoint {
        let flat = |p: DVec3, ng: DVec3, uv: DVec2| LocalPoint {
            p,
            ng,
            ns: None,
            uv,
            prim,
        };
        match self {
            Self::Sphere => {
                let p = p.normalize();
                let uv = DVec2::new(turn(p), (-p.z).clamp(-1.0, 1.0).acos() / PI);
                flat(p, p, uv)
            }
            Self::Disk { .. } | Self::Quad => flat(p.with_z(0.0), DVec3::Z, square(p.truncate())),
            Self::Cylinder => {
                let n = p.with_z(0.0).normalize();
                flat(n.with_z(p.z), n, DVec2::new(turn(p), (p.z + 1.0) / 2.0))
            }
            Self::Box => {
                let n = analytic::cube_normal(prim);
                let axis = (prim / 2) as usize % 3;
                let mut q = p.clamp(DVec3::NEG_ONE, DVec3::ONE);
                q[axis] = n[axis];
                flat(
                    q,
                    n,
                    square(DVec2::new(q[(axis + 1) % 3], q[(axis + 2) % 3])),
                )
            }
            Self::Lens(lens) => {
                let mut point = lens.point(prim, p);
                point.ng = point.ng.normalize();
                point
            }
            Self::Mesh(mesh) => mesh.local_point(prim, weights, time),
            Self::Deforming(mesh) => mesh.local_point(prim, weights, time),
        }
    }

    /// Derivatives of the position by the texture coordinates at `p` on face `prim`, in object
    /// space; `None` where there are none.
    pub(super) fn tangents(&self, prim: u32, p: DVec3, time: f64) -> Option<[DVec3; 2]> {
        let turned = DVec3::new(-p.y, p.x, 0.0) * TAU;
        match self {
            Self::Sphere => {
                let r = p.truncate().length();
                let up = DVec3::new(-p.x * p.z / r, -p.y * p.z / r, r) * PI;
                up.is_finite().then_some([turned, up])
            }
            Self::Disk { .. } | Self::Quad => Some([DVec3::X * 2.0, DVec3::Y * 2.0]),
            Self::Cylinder => Some([turned, DVec3::Z * 2.0]),
            Self::Box => {
                let axis = (prim / 2) as usize % 3;
                Some([(axis + 1) % 3, (axis + 2) % 3].map(|i| DVec3::AXES[i] * 2.0))
            }
            Self::Lens(lens) => lens.tangents(p),
            Self::Mesh(mesh) => mesh.tangents(prim, time),
            Self::Deforming(mesh) => mesh.tangents(prim, time),
        }
    }
}

/// Azimuth about z as a fraction of a turn, in [0, 1].
fn turn(p: DVec3) -> f64 {
    let phi = p.y.atan2(p.x) / TAU;
    if phi < 0.0 { phi + 1.0 } else { phi }
}
/// Texture coordinates of a place in the square from -1 to 1.
#[inline]
pub(super) fn square(q: DVec2) -> DVec2 {
    (q + 1.0) / 2.0
}
