//! One placed shape and its bounds.

use super::motion::Placement;
use super::shape::{LocalPoint, square};
use super::{Shape, SurfaceId, SurfacePoint, Transform};
use glam::{DAffine3, DVec3};

/// Index of an instance in the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InstanceId(pub u32);

/// A shape placed in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The surface in its own space.
    pub shape: Shape,
    /// Where it is.
    pub transform: Transform,
}

impl Instance {
    /// Whether it moves or changes its form while the shutter is open.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.transform.is_moving() || matches!(self.shape, Shape::Deforming(_))
    }

    /// World bounds over the whole shutter.
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let extent = self.shape.bounds();
        let radius = extent.0.abs().max(extent.1.abs()).length();
        self.transform
            .swept(radius, |to_world| self.placed_bounds(to_world))
    }

    /// World bounds under one map.
    fn placed_bounds(&self, to_world: &DAffine3) -> (DVec3, DVec3) {
        let rows = to_world.matrix3.transpose();
        let rows = [rows.x_axis, rows.y_axis, rows.z_axis];
        let reach = |f: &dyn Fn(DVec3) -> f64| DVec3::from(rows.map(f));
        let half = match &self.shape {
            Shape::Sphere => reach(&|r| r.length()),
            Shape::Disk { .. } => reach(&|r| r.truncate().length()),
            Shape::Quad => reach(&|r| r.x.abs() + r.y.abs()),
            Shape::Cylinder => reach(&|r| r.truncate().length() + r.z.abs()),
            Shape::Box | Shape::Lens(_) | Shape::Mesh(_) | Shape::Deforming(_) => {
                let (middle, half) = placed_box(to_world, self.shape.bounds());
                return (middle - half, middle + half);
            }
        };
        let middle = to_world.transform_point3(DVec3::ZERO);
        (middle - half, middle + half)
    }
}

/// Middle and half the size of the box in the world that holds a box in another space.
pub(super) fn placed_box(to_world: &DAffine3, (low, high): (DVec3, DVec3)) -> (DVec3, DVec3) {
    let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
    let rows = to_world.matrix3.transpose();
    let reach = [rows.x_axis, rows.y_axis, rows.z_axis].map(|row| row.abs().dot(half));
    (to_world.transform_point3(middle), reach.into())
}

/// The point of a flat shape on the z axis' plane that `p` of its own space is above, in the world.
#[inline]
pub(super) fn flat_to_world(id: InstanceId, placement: &Placement, p: DVec3) -> SurfacePoint {
    let up = placement.normal_to_world(DVec3::Z);
    SurfacePoint {
        p: placement.to_world.transform_point3(p.with_z(0.0)),
        ng: up,
        ns: up,
        uv: square(p.truncate()),
        id: SurfaceId {
            instance: id,
            prim: 0,
        },
    }
}

/// A point of the shape, in the world.
#[inline]
pub(super) fn to_world(id: InstanceId, placement: &Placement, point: &LocalPoint) -> SurfacePoint {
    let ng = placement.normal_to_world(point.ng);
    let ns = match point.ns.map(|n| placement.normal_to_world(n)) {
        Some(ns) if ns.is_finite() => {
            let side = ns.dot(ng);
            if side > 0.0 {
                ns
            } else if side < 0.0 {
                -ns
            } else {
                ng
            }
        }
        _ => ng,
    };
    SurfacePoint {
        p: placement.to_world.transform_point3(point.p),
        ng,
        ns,
        uv: point.uv,
        id: SurfaceId {
            instance: id,
            prim: point.prim,
        },
    }
}
