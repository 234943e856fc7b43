//! Closed meshes do not leak at any scale or distance, and the tree finds what brute force finds.

use crate::support::{Random, ball, icosphere, mesh, scene};
use abbe::geometry::{Accel, Hit, Ray, Shape};
use abbe::math::predicates::TriangleRay;
use glam::{DAffine3, DVec3, Vec3, dvec3};
use std::sync::Arc;

/// Rays at vertices, edges and inner points of the faces turned toward the origin of the ray;
/// counts misses.
fn misses(accel: &Accel, distance: f64, n: usize, random: &mut Random) -> usize {
    let instance = &accel.instances()[0];
    let Shape::Mesh(mesh) = &instance.shape else {
        panic!("a mesh")
    };
    let to_world = instance.transform.at(0.0).to_world;
    (0..n)
        .filter(|i| {
            let corners = mesh.corners(random.index(mesh.triangle_count()) as u32, 0.0);
            let s = random.unit();
            let target = match i % 3 {
                0 => corners[0],
                1 => corners[0].lerp(corners[1], s),
                _ => (corners[0] + corners[1] + corners[2]) / 3.0,
            };
            let away = random.direction();
            // From outside, keep clear of the silhouette, where a miss is right.
            let o = if distance < 1.0 {
                away * distance
            } else {
                let toward = if away.dot(target.normalize()) < 0.0 {
                    -away
                } else {
                    away
                };
                (toward + target.normalize() * 0.3).normalize() * distance
            };
            let (o, target) = (
                to_world.transform_point3(o),
                to_world.transform_point3(target),
            );
            let ray = Ray::new(o, (target - o).normalize());
            let hit = accel.at(0.0).closest(&ray, |_| true);
            let near = hit.is_some_and(|hit| {
                let p = accel.at(0.0).surface(&ray, &hit).p;
                let size = to_world.matrix3.x_axis.length();
                let error = 1e-6 * size + 1e-14 * (o.length() + target.length());
                p.distance(target) < error || distance > 1e4 || hit.t < o.distance(target)
            });
            let segment = Ray {
                t_max: 2.0 * o.distance(target),
                ..ray
            };
            !(near && accel.at(0.0).occluded(&segment, |_| true))
        })
        .count()
}

#[test]
fn closed_meshes_do_not_leak() {
    let mut random = Random::new(1);
    let shape = ball(5);
    let turned = random.rotation();
    for scale in [1e-6, 1.0, 1e3] {
        for offset in [0.0, 100.0] {
            let to_world = DAffine3 {
                matrix3: turned * scale,
                translation: dvec3(offset, -offset, offset * 0.5),
            };
            let plain = DAffine3::from_scale(DVec3::splat(scale));
            for map in [plain, to_world] {
                let accel = scene(&[(&shape, map)]);
                for distance in [0.0, 0.7, 10.0, 1e3, 1e6] {
                    let n = 2000;
                    let m = misses(&accel, distance, n, &mut random);
                    assert_eq!(
                        m, 0,
                        "of {n}: scale {scale} offset {offset} from {distance} radii"
                    );
                }
            }
        }
    }
}

#[test]
fn closed_meshes_with_small_or_offset_vertices_do_not_leak() {
    let mut random = Random::new(2);
    let (points, faces) = icosphere(5);
    for (scale, offset) in [
        (1e-6, 0.0),
        (1e3, 0.0),
        (1.0, 100.0),
        (1e-30, 0.0),
        (1e30, 0.0),
    ] {
        let moved: Vec<DVec3> = points
            .iter()
            .map(|p| *p * scale + DVec3::splat(offset))
            .collect();
        let shape = Shape::Mesh(Arc::new(mesh(&moved, &faces)));
        let Shape::Mesh(m) = &shape else {
            unreachable!()
        };
        assert!(m.is_closed());
        let accel = scene(&[(&shape, DAffine3::IDENTITY)]);
        let center = DVec3::splat(offset);
        let missed = (0..30_000)
            .filter(|i| {
                let c = m.corners(random.index(m.triangle_count()) as u32, 0.0);
                let target = if i % 2 == 0 {
                    c[0]
                } else {
                    c[1].lerp(c[2], random.unit())
                };
                let o = center + random.direction() * scale * 0.5;
                let ray = Ray::new(o, (target - o).normalize());
                accel.at(0.0).closest(&ray, |_| true).is_none()
            })
            .count();
        assert_eq!(missed, 0, "of 30000 at scale {scale}, offset {offset}");
    }
}

#[test]
fn the_tree_finds_what_brute_force_finds() {
    let mut random = Random::new(3);
    for size in [0.02, 0.3, 2.0] {
        let mut points = Vec::new();
        for _ in 0..500 {
            let at = random.direction() * random.unit();
            points.extend((0..3).map(|_| at + random.direction() * size));
        }
        let faces: Vec<[u32; 3]> = (0..500).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let shape = mesh(&points, &faces);
        let accel = scene(&[(&Shape::Mesh(Arc::new(shape)), DAffine3::IDENTITY)]);
        let Shape::Mesh(m) = &accel.instances()[0].shape else {
            unreachable!()
        };
        let corners: Vec<[[f32; 3]; 3]> = (0..500)
            .map(|i| m.corners(i, 0.0).map(|p| p.as_vec3().to_array()))
            .collect();
        let mut found = 0;
        for _ in 0..4000 {
            let o = random.direction() * 3.0 * random.unit();
            let mut d = random.direction();
            if random.unit() < 0.1 {
                d = [DVec3::X, DVec3::NEG_Y, DVec3::Z][random.index(3)];
            }
            let tri = TriangleRay::new(o, d);
            let brute = corners
                .iter()
                .filter_map(|c| tri.intersect(c, f64::INFINITY))
                .map(|h| h.t)
                .reduce(f64::min);
            let ray = Ray::new(o, d);
            let hit = accel.at(0.0).closest(&ray, |_| true);
            assert_eq!(hit.map(|h| h.t), brute);
            assert_eq!(accel.at(0.0).occluded(&ray, |_| true), brute.is_some());
            if let Some(t) = brute {
                let before = Ray { t_max: t, ..ray };
                assert!(!accel.at(0.0).occluded(&before, |_| true));
                found += 1;
            }
        }
        assert!(found > 50, "{found}");
    }
}

/// Closest hits of many random rays on a mixed scene, everything (rays included) scaled by `s`.
fn hits_at_scale(s: f64) -> Vec<Option<Hit>> {
    let mut random = Random::new(4);
    let ball = ball(3);
    let shapes = [
        Shape::Sphere,
        Shape::Disk { inner: 0.3 },
        Shape::Quad,
        Shape::Cylinder,
        Shape::Box,
        ball,
    ];
    let parts: Vec<(&Shape, DAffine3)> = (0..60)
        .map(|i| {
            let matrix3 = random.rotation() * 0.8;
            let translation = random.direction() * 3.0;
            (
                &shapes[i % 6],
                DAffine3 {
                    matrix3: matrix3 * s,
                    translation: translation * s,
                },
            )
        })
        .collect();
    let accel = scene(&parts);
    let mut hits = Vec::new();
    for _ in 0..3000 {
        let mut ray = Ray::new(random.direction() * 4.0 * s, random.direction());
        ray.d = (ray.d * 2.0 - ray.o / (4.0 * s)).normalize();
        for _ in 0..4 {
            let hit = accel.at(0.0).closest(&ray, |_| true);
            hits.push(hit);
            let Some(hit) = hit else { break };
            let point = accel.at(0.0).surface(&ray, &hit);
            ray = Ray::leaving(point.p, random.direction(), Some(point.id));
        }
    }
    hits
}

#[test]
fn powers_of_two_change_nothing() {
    let reference = hits_at_scale(1.0);
    assert!(reference.iter().flatten().count() > 1000);
    for exponent in [-20, 20] {
        let s = 2f64.powi(exponent);
        let scaled = hits_at_scale(s);
        assert_eq!(reference.len(), scaled.len());
        for (a, b) in reference.iter().zip(&scaled) {
            let a = a.map(|h| (h.t * s, h.id, h.uv));
            assert_eq!(a, b.map(|h| (h.t, h.id, h.uv)));
        }
    }
}

#[test]
fn coincident_triangles_build_and_answer() {
    let one = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|v| v.to_array());
    let mesh = abbe::geometry::Mesh::new(&one, None, None, vec![[0, 1, 2]; 20_000]);
    let shape = Shape::Mesh(Arc::new(mesh.expect("valid")));
    let accel = scene(&[(&shape, DAffine3::IDENTITY)]);
    let ray = Ray::new(dvec3(0.2, 0.2, 1.0), DVec3::NEG_Z);
    assert_eq!(
        accel.at(0.0).closest(&ray, |_| true).map(|h| h.t),
        Some(1.0)
    );
}
