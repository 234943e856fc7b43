//! Shapes of objects: the canonical surface and the map that makes it what the file says.

use super::keys::{Build, NON_NEGATIVE, POSITIVE, Table, keys};
use super::reader::Reader;
use super::value::{Direction, Length, Point};
use crate::geometry::Shape;
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// A canonical shape, and the map to where and how large it is.
pub type Placed = (Shape, DAffine3);

fn placed(shape: Shape, map: DMat3, center: DVec3) -> Placed {
    (shape, DAffine3::from_mat3_translation(map, center))
}

keys! {
    /// A sphere.
    SphereKeys = "sphere" {
        /// Center.
        center: Point, default Point(DVec3::ZERO);
        /// Radius.
        radius: Length, in POSITIVE;
    }
}

impl Build for SphereKeys {
    type Output = Placed;

    fn build(self, _: &Table<'_>, _: &mut Reader<'_>) -> Option<Placed> {
        let map = DMat3::from_diagonal(DVec3::splat(self.radius.0));
        Some(placed(Shape::Sphere, map, self.center.0))
    }
}

keys! {
    /// A disk, with a hole where `inner_radius` is above 0.
    DiskKeys = "disk" {
        /// Center.
        center: Point, default Point(DVec3::ZERO);
        /// The side that it faces.
        normal: Direction, default Direction(DVec3::Z);
        /// Radius.
        radius: Length, in POSITIVE;
        /// Radius of the hole, below `radius`.
        inner_radius: Length, in NON_NEGATIVE, default Length(0.0);
    }
}

impl Build for DiskKeys {
    type Output = Placed;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Placed> {
        let (radius, inner) = (self.radius.0, self.inner_radius.0);
        if table.get("inner_radius").is_some() && inner >= radius {
            let message = "inner_radius is not smaller than radius";
            cx.conflict(&table.span("inner_radius"), message);
        }
        let turn = DQuat::from_rotation_arc(DVec3::Z, self.normal.0);
        let shape = Shape::Disk {
            inner: inner / radius,
        };
        Some(placed(
            shape,
            DMat3::from_quat(turn) * radius,
            self.center.0,
        ))
    }
}

keys! {
    /// A parallelogram of half edges u and v about its center; the normal is u x v.
    QuadKeys = "quad" {
        /// Center.
        center: Point;
        /// Half an edge.
        u: Point;
        /// Half the other edge, not parallel.
        v: Point;
    }
}

impl Build for QuadKeys {
    type Output = Placed;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Placed> {
        let (u, v) = (self.u.0, self.v.0);
        let Some(normal) = u.cross(v).try_normalize() else {
            cx.conflict(&table.at, "u and v of the quad are parallel or zero");
            return None;
        };
        let map = DMat3::from_cols(u, v, normal * u.cross(v).length().sqrt());
        Some(placed(Shape::Quad, map, self.center.0))
    }
}

keys! {
    /// The side of a cylinder, open at both ends.
    CylinderKeys = "cylinder" {
        /// Center of one end.
        from: Point;
        /// Center of the other end.
        to: Point;
        /// Radius.
        radius: Length, in POSITIVE;
    }
}

impl Build for CylinderKeys {
    type Output = Placed;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Placed> {
        let half = (self.to.0 - self.from.0) / 2.0;
        let Some(axis) = half.try_normalize() else {
            cx.conflict(&table.span("to"), "from and to are the same point");
            return None;
        };
        let turn = DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Z, axis));
        let size = DVec3::new(self.radius.0, self.radius.0, half.length());
        let map = turn * DMat3::from_diagonal(size);
        Some(placed(Shape::Cylinder, map, self.from.0 + half))
    }
}

keys! {
    /// A box along the axes.
    BoxKeys = "box" {
        /// Least corner.
        min: Point;
        /// Largest corner, above `min` on every axis.
        max: Point;
    }
}

impl Build for BoxKeys {
    type Output = Placed;

    fn build(self, table: &Table<'_>, cx: &mut Reader<'_>) -> Option<Placed> {
        let (min, max) = (self.min.0, self.max.0);
        if !min.cmplt(max).all() {
            let message = "max is not above min on every axis";
            cx.conflict(&table.span("max"), message);
        }
        let map = DMat3::from_diagonal((max - min) / 2.0);
        Some(placed(Shape::Box, map, (min + max) / 2.0))
    }
}
