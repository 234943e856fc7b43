//! The closed set of shapes, each in its own object space.

use super::{Mesh, SurfaceId, SurfacePoint};
use glam::{DVec2, DVec3};
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
    /// A triangle mesh.
    Mesh(Arc<Mesh>),
}

/// A point sampled on a shape by area.
#[derive(Clone, Copy, Debug)]
pub struct AreaSample {
    /// The point, in world space.
    pub point: SurfacePoint,
    /// Density per world area.
    pub pdf_a: f64,
}

#[allow(unused_variables)]
impl Shape {
    /// Whether the shape bounds a solid (mesh: every edge shared by two triangles of opposite winding).
    #[must_use]
    pub fn is_closed(&self) -> bool {
        todo!()
    }
}

// H2: intersection, surface point from hit, area sampling and its density live in geometry/instance.rs and shape files.
#[allow(dead_code)]
fn _types(_: DVec2, _: DVec3, _: SurfaceId) {}
