//! Gaps against the tree: the same hits, with things in the way and without.

use super::*;
use crate::geometry::{Accel, LensShape};
use crate::math::hash::{random_bits, unit_f64};
use crate::optics::{Aperture, LensSurface};
use glam::{DMat3, DQuat};
use std::sync::Arc;

/// From millimeters of a tilted lens to the world.
fn place(map: DAffine3) -> Transform {
    let turned = DQuat::from_rotation_x(0.4) * DQuat::from_rotation_y(-0.7);
    let to_world = DAffine3::from_scale_rotation_translation(
        DVec3::splat(1e-3),
        turned,
        DVec3::new(3.0, -2.0, 5.0),
    );
    Transform::fixed(to_world * map)
}

fn at(z: f64, size: DVec3) -> DAffine3 {
    DAffine3::from_mat3_translation(DMat3::from_diagonal(size), DVec3::Z * z)
}

fn lens(profile: Profile, aperture: Aperture, z: f64) -> Instance {
    let shape = LensShape::new(LensSurface::new(profile, aperture)).expect("valid");
    Instance {
        shape: Shape::Lens(Arc::new(shape)),
        transform: place(at(z, DVec3::ONE)),
    }
}

fn ring(z: f64, inner: f64, outer: f64) -> Instance {
    Instance {
        shape: Shape::Disk {
            inner: inner / outer,
        },
        transform: place(at(z, DVec3::splat(outer))),
    }
}

fn tube(low: f64, high: f64, radius: f64) -> Instance {
    let size = DVec3::new(radius, radius, (high - low) / 2.0);
    Instance {
        shape: Shape::Cylinder,
        transform: place(at((low + high) / 2.0, size)),
    }
}

/// A film and five surfaces on both sides of a diaphragm, with rims and tubes; the curved ones face
/// each other hollow and full, one is a paraboloid and one is flat.
fn stack() -> Vec<Instance> {
    let sphere =
        |radius: f64, a: f64, z: f64| lens(Profile::sphere(radius), Aperture::circle(a), z);
    let conic = Profile::Conic {
        curvature: -1.0 / 30.0,
        conic: -1.0,
    };
    vec![
        Instance {
            shape: Shape::Quad,
            transform: place(at(-40.0, DVec3::new(9.0, 6.0, 1.0))),
        },
        lens(conic, Aperture::circle(11.0), 0.0),
        sphere(20.0, 9.0, 3.0),
        ring(5.0 - 2.0 + 20.0 - (20.0f64 * 20.0 - 81.0).sqrt(), 9.0, 12.0),
        tube(-2.0, 5.1, 12.0),
        ring(9.0, 5.0, 20.0),
        sphere(-17.0, 8.0, 15.0),
        lens(Profile::PLANE, Aperture::circle(10.0), 17.0),
        ring(17.0, 10.0, 13.0),
        sphere(-40.0, 12.0, 23.0),
        tube(17.0, 22.0, 13.0),
        tube(-3.0, 30.0, 20.0),
    ]
}

/// Follows rays from surface to surface, some of them turned at random, and compares what is found
/// with what the tree finds alone. How many rays there were, and how many crossed gaps.
fn compare(instances: &[Instance]) -> [usize; 2] {
    let mut without = Accel::build(instances.to_vec());
    without.gaps = Gaps::default();
    let with = Accel::build(instances.to_vec());
    let (with, without) = (with.at(0.0), without.at(0.0));
    let (mut rays, mut crossed) = (0, 0);
    for case in 0..4000u64 {
        let mut count = 0;
        let mut u = || {
            count += 1;
            2.0 * unit_f64(random_bits(case, count)) - 1.0
        };
        let first = if case % 3 == 0 {
            0
        } else {
            1 + case as usize % 11
        };
        let Transform::Static(placement) = &instances[first].transform else {
            panic!("at rest");
        };
        // somewhere near the surface, then on it
        let p = placement
            .to_world
            .transform_point3(DVec3::new(u(), u(), 0.3 * u()));
        let id = crate::geometry::SurfaceId {
            instance: InstanceId(first as u32),
            prim: 0,
        };
        let hit = crate::geometry::Hit {
            t: 0.0,
            id,
            uv: DVec2::ZERO,
        };
        let mut point = without.surface(&Ray::new(p, DVec3::Z), &hit);
        let along = (placement.to_world.matrix3.z_axis).normalize();
        let spread = 0.05 + 0.5 * u().abs();
        let mut d = along * if first == 0 { 1.0 } else { u().signum() };
        for _ in 0..12 {
            d = (d + spread * DVec3::new(u(), u(), u())).normalize();
            let ray = Ray::leaving(point.p, d, Some(point.id));
            let (a, b) = (
                with.closest(&ray, |_| true),
                without.closest(&ray, |_| true),
            );
            let bits = |hit: Option<crate::geometry::Hit>| hit.map(|h| (h.t.to_bits(), h.id));
            assert_eq!(bits(a), bits(b), "{case} {ray:?}");
            rays += 1;
            crossed += usize::from(with.across_gap(&ray, &|_| true).is_some());
            let Some(hit) = b else { break };
            point = without.surface(&ray, &hit);
        }
    }
    [rays, crossed]
}

#[test]
fn rays_across_gaps_find_what_the_tree_finds() {
    let whole = stack();
    let [rays, crossed] = compare(&whole);
    assert!(crossed * 4 > rays, "{crossed} of {rays}");
    // things in the way, beside and beyond
    let ball = |x: f64, z: f64| Instance {
        shape: Shape::Sphere,
        transform: place(DAffine3::from_scale_rotation_translation(
            DVec3::splat(1.5),
            DQuat::IDENTITY,
            DVec3::new(x, 0.5, z),
        )),
    };
    let obstacles = [
        ball(2.0, 8.0),
        ball(0.0, -20.0),
        ball(1.0, 20.0),
        ring(-10.0, 0.0, 4.0),
        ring(-10.0, 3.0, 30.0),
        ring(10.0, 4.0, 8.0),
        tube(-30.0, -10.0, 5.0),
        lens(Profile::sphere(12.0), Aperture::circle(6.0), -12.0),
        lens(Profile::sphere(12.0), Aperture::circle(6.0), 8.0),
    ];
    let mut crossed = 0;
    for obstacle in obstacles {
        let mut more = whole.clone();
        more.push(obstacle);
        // a gap with something near it may not be one
        crossed += compare(&more)[1];
    }
    assert!(crossed > 1000, "{crossed}");
}

#[test]
fn surfaces_off_one_axis_have_no_gap() {
    let sphere = |radius: f64| lens(Profile::sphere(radius), Aperture::circle(4.0), 0.0);
    let moved = |map: DAffine3| Instance {
        transform: place(map),
        ..sphere(30.0)
    };
    let count = |other: Instance| Gaps::new(&[sphere(20.0), other]).gaps.len();
    assert_eq!(count(moved(at(3.0, DVec3::ONE))), 2);
    let beside = DAffine3::from_translation(DVec3::new(1e-3, 0.0, 3.0));
    assert_eq!(count(moved(beside)), 0);
    let tilted = at(3.0, DVec3::ONE) * DAffine3::from_rotation_x(1e-4);
    assert_eq!(count(moved(tilted)), 0);
    // they meet where they are thickest
    assert_eq!(count(moved(at(0.05, DVec3::ONE))), 0);
}
