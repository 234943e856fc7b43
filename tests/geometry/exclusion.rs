//! A ray that leaves a surface, or a segment that ends on one, does not hit it there.

use crate::support::{Random, ball, scene};
use abbe::geometry::{Accel, InstanceId, Ray, Shape};
use glam::{DAffine3, DMat3, DVec2, DVec3, dvec3};

const ID: InstanceId = InstanceId(0);

fn placements(random: &mut Random) -> Vec<DAffine3> {
    let mut maps = Vec::new();
    for scale in [1e-6, 1e-3, 1.0, 1e3, 1e6] {
        for translation in [DVec3::ZERO, dvec3(577.0, -577.0, 577.0)] {
            for stretch in [DVec3::ONE, dvec3(1.0, 0.4, -2.0)] {
                let matrix3 = random.rotation() * DMat3::from_diagonal(stretch * scale);
                maps.push(DAffine3 {
                    matrix3,
                    translation,
                });
            }
        }
    }
    maps
}

fn sample(accel: &Accel, random: &mut Random) -> abbe::geometry::SurfacePoint {
    let u = DVec2::new(random.unit(), random.unit());
    let instance = &accel.instances()[0];
    abbe::geometry::AreaSampler::new(&instance.shape)
        .sample(instance, ID, 0.0, random.unit(), u)
        .point
}

/// How much smaller the shape is than its distance, which bounds how well its normal is known.
fn tolerance(map: &DAffine3) -> f64 {
    1e-12 * (1.0 + map.translation.length() / map.matrix3.x_axis.length())
}

#[test]
fn leaving_outward_never_hits_a_convex_shape() {
    let mut random = Random::new(11);
    let shapes = [
        Shape::Sphere,
        Shape::Disk { inner: 0.2 },
        Shape::Quad,
        Shape::Box,
        ball(3),
    ];
    for map in placements(&mut random) {
        for shape in &shapes {
            let accel = scene(&[(shape, map)]);
            for _ in 0..300 {
                let from = sample(&accel, &mut random);
                let d = random.direction();
                let d = if d.dot(from.ng) < 0.0 { -d } else { d };
                if d.dot(from.ng) < tolerance(&map) {
                    continue;
                }
                let ray = Ray::leaving(from.p, d, Some(from.id));
                let hit = accel.at(0.0).closest(&ray, |_| true);
                assert!(hit.is_none(), "{shape:?} {map:?} {ray:?} {hit:?}");
                assert!(!accel.at(0.0).occluded(&ray, |_| true));
            }
        }
    }
}

#[test]
fn leaving_inward_hits_the_far_side_of_a_solid() {
    let mut random = Random::new(12);
    let solids = [Shape::Sphere, Shape::Box, ball(3)];
    for map in placements(&mut random) {
        // Where the shape is a millionth of its distance, its far side is known to 1e-4 of its size
        // only.
        let size = map.matrix3.x_axis.length();
        let blur = 1e-13 * (1.0 + map.translation.length() / size) + 1e-6;
        for shape in &solids {
            let accel = scene(&[(shape, map)]);
            for _ in 0..300 {
                let from = sample(&accel, &mut random);
                let to = sample(&accel, &mut random);
                let d = (to.p - from.p).normalize();
                if d.dot(from.ng) > -0.05 || d.dot(to.ng) < 0.05 {
                    continue;
                }
                let ray = Ray::leaving(from.p, d, Some(from.id));
                let hit = accel.at(0.0).closest(&ray, |_| true).expect("the far side");
                let p = accel.at(0.0).surface(&ray, &hit).p;
                let error = p.distance(to.p) / size;
                assert!(error < 100.0 * blur, "{shape:?} {map:?}: {error}");
            }
        }
    }
}

#[test]
fn segments_between_points_of_a_convex_solid_are_free_inside_and_blocked_by_nothing_else() {
    let mut random = Random::new(13);
    let solids = [Shape::Sphere, Shape::Box, ball(3)];
    for map in placements(&mut random) {
        for shape in &solids {
            let accel = scene(&[(shape, map)]);
            for _ in 0..300 {
                let (from, to) = (sample(&accel, &mut random), sample(&accel, &mut random));
                let v = to.p - from.p;
                if v.dot(from.ng).abs() < tolerance(&map) * v.length()
                    || from.id == to.id && !matches!(shape, Shape::Sphere)
                {
                    continue;
                }
                let ray = Ray {
                    t_max: v.length(),
                    end: Some(to.id),
                    ..Ray::leaving(from.p, v.normalize(), Some(from.id))
                };
                assert!(
                    !accel.at(0.0).occluded(&ray, |_| true),
                    "{shape:?} {map:?} {ray:?}"
                );
            }
        }
    }
}

#[test]
fn segments_from_free_space_see_the_near_side_only() {
    let mut random = Random::new(14);
    let shapes = [Shape::Sphere, Shape::Box, ball(3), Shape::Cylinder];
    for map in placements(&mut random) {
        let size = map.matrix3.x_axis.length();
        for shape in &shapes {
            let accel = scene(&[(shape, map)]);
            for _ in 0..300 {
                let to = sample(&accel, &mut random);
                let o = map.translation + random.direction() * 20.0 * size;
                let v = to.p - o;
                let cos = v.normalize().dot(to.ng);
                if cos.abs() < 0.05 || (matches!(shape, Shape::Cylinder) && cos > 0.0) {
                    continue;
                }
                let ray = Ray {
                    t_max: v.length(),
                    end: Some(to.id),
                    ..Ray::new(o, v.normalize())
                };
                assert_eq!(
                    accel.at(0.0).occluded(&ray, |_| true),
                    cos > 0.0,
                    "{shape:?} {map:?} {ray:?} {cos}"
                );
            }
        }
    }
}

#[test]
fn a_chord_inside_a_sphere_has_its_closed_length() {
    let mut random = Random::new(15);
    let accel = scene(&[(&Shape::Sphere, DAffine3::from_scale(DVec3::splat(1e-3)))]);
    for _ in 0..1000 {
        let from = sample(&accel, &mut random);
        let d = random.direction();
        let ray = Ray::leaving(from.p, d, Some(from.id));
        let t = accel.at(0.0).closest(&ray, |_| true).map(|h| h.t);
        let chord = -2.0 * from.ng.dot(d) * 1e-3;
        match t {
            Some(t) => assert!((t - chord).abs() < 1e-16),
            None => assert!(chord < 1e-16),
        }
    }
}
