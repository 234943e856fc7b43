//! Curved shapes that solvers are tried on.

use super::{Random, World};
use crate::geometry::{InstanceId, Mesh, Placement};
use crate::transport::aim::quadric::Quadric;
use crate::transport::aim::smooth::Smooth;
use crate::transport::aim::surface::Surface;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::sync::LazyLock;

/// A flattened ball of triangles, whose normals are those of the shape they are cut from.
static PEBBLE: LazyLock<Mesh> = LazyLock::new(|| {
    let (rows, columns) = (24u32, 40u32);
    let (mut points, mut normals, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..=rows {
        for column in 0..columns {
            let polar = std::f64::consts::PI * f64::from(row) / f64::from(rows);
            let azimuth = std::f64::consts::TAU * f64::from(column) / f64::from(columns);
            let p = DVec3::new(
                polar.sin() * azimuth.cos(),
                polar.sin() * azimuth.sin(),
                polar.cos(),
            );
            let axes = DVec3::new(1.0, 0.9, 0.6);
            points.push((p * axes).as_vec3().to_array());
            normals.push((p / axes).as_vec3().to_array());
        }
    }
    let vertex = |row: u32, column: u32| row * columns + column % columns;
    for row in 0..rows {
        for column in 0..columns {
            let [a, b] = [vertex(row, column), vertex(row, column + 1)];
            let [c, d] = [vertex(row + 1, column), vertex(row + 1, column + 1)];
            triangles.extend([[a, c, d], [a, d, b]]);
        }
    }
    Mesh::new(&points, Some(normals), None, triangles).expect("no number is wrong")
});

/// The pebble about the origin, turned.
pub(super) fn pebble(world: &World, random: &mut Random) -> Surface<'static> {
    let turned = DQuat::from_axis_angle(random.direction(), 3.0 * random.next());
    let placement = Placement::new(DAffine3::from_scale_rotation_translation(
        DVec3::splat(world.scale),
        turned,
        world.point(DVec3::ZERO),
    ));
    Surface::Mesh(Smooth::new(&PEBBLE, InstanceId(0), placement))
}

/// An ellipsoid about the origin, turned.
pub(super) fn ellipsoid(world: &World, random: &mut Random) -> Surface<'static> {
    let axes = DVec3::new(random.between(0.2, 1.0), random.between(0.5, 1.0), 1.0);
    let turned = DQuat::from_axis_angle(random.direction(), 3.0 * random.next());
    let to_world = DAffine3::from_scale_rotation_translation(
        axes * world.scale,
        turned,
        world.point(DVec3::ZERO),
    );
    let back = to_world.inverse();
    Surface::Quadric(Quadric::placed(
        DMat3::IDENTITY,
        DVec3::ZERO,
        -1.0,
        &to_world,
        &back,
    ))
}

/// A spherical cap of curvature `c` across the z axis at `z`, its normal towards +z.
pub(super) fn cap(world: &World, c: f64, z: f64) -> Surface<'static> {
    let to_world = DAffine3::from_scale_rotation_translation(
        DVec3::splat(world.scale),
        DQuat::IDENTITY,
        world.point(DVec3::Z * z),
    );
    let q = DMat3::from_diagonal(DVec3::splat(-0.5 * c));
    let back = to_world.inverse();
    Surface::Quadric(Quadric::placed(q, DVec3::Z * 0.5, 0.0, &to_world, &back))
}
