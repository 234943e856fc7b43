//! Trees over moving and deforming things against brute force over all triangles at the time of the
//! ray: no hit is missed, and none is found that is not there.

use super::support::{Random, icosphere};
use abbe::geometry::deforming::{self, KeyFrame};
use abbe::geometry::pose::{Arcs, Pose, Rotation};
use abbe::geometry::track::{Interpolation, Track};
use abbe::geometry::{Accel, Instance, Link, Mesh, Ray, Shape, Shutter, Transform};
use abbe::math::predicates::TriangleRay;
use glam::{DAffine3, DQuat, DVec3, dvec3};
use rayon::prelude::*;
use std::sync::Arc;

const SHUTTER: Shutter = Shutter {
    open_s: -0.5,
    close_s: 1.0,
};

fn keyed(pose: Pose) -> Link {
    Link::Keyed(pose)
}

fn at(p: DVec3) -> Link {
    Link::Fixed(DAffine3::from_translation(p))
}

fn slide(keys: &[(f64, DVec3)], interpolation: Interpolation) -> Link {
    keyed(Pose {
        translation: Some(Track::new(keys, interpolation).expect("valid")),
        ..Pose::default()
    })
}

fn spin(axis: DVec3, keys: &[(f64, f64)], interpolation: Interpolation) -> Link {
    keyed(Pose {
        rotation: Some(Rotation::Spin {
            axis: axis.normalize(),
            angle_rad: Track::new(keys, interpolation).expect("valid"),
        }),
        ..Pose::default()
    })
}

/// Turns, scales and slides, with keys at times of their own, some far outside of the shutter.
fn tumble(random: &mut Random, interpolation: Interpolation, reach: f64) -> Link {
    let mut vector = |least: f64, most: f64| {
        let mut one = || least + (most - least) * random.unit();
        dvec3(one(), one(), one())
    };
    let places: Vec<(f64, DVec3)> = [-40.0, -0.2, 0.35, 0.9, 70.0]
        .iter()
        .map(|&t| (t, vector(-reach, reach)))
        .collect();
    let sizes: Vec<(f64, DVec3)> = [-0.5, 0.5, 1.5]
        .iter()
        .map(|&t| (t, vector(1.0, 1.4)))
        .collect();
    let turns: Vec<(f64, DQuat)> = [-0.4, 0.1, 0.3, 1.2]
        .iter()
        .map(|&t| (t, DQuat::from_mat3(&random.rotation())))
        .collect();
    keyed(Pose {
        translation: Some(Track::new(&places, interpolation).expect("valid")),
        rotation: Some(Rotation::Arcs(
            Arcs::new(&turns, interpolation).expect("valid"),
        )),
        scale: Some(Track::new(&sizes, interpolation).expect("valid")),
    })
}

fn ball() -> Shape {
    let (points, faces) = icosphere(1);
    Shape::Mesh(Arc::new(super::support::mesh(&points, &faces)))
}

/// 320 triangles that swing about: the sphere drifts along, swells and is sheared, in frames of
/// unequal distance.
fn jelly(random: &mut Random, sweep: f64) -> Shape {
    let (points, faces) = icosphere(1);
    let frames: Vec<_> = [-3.0, -0.1, 0.2, 0.7, 2.0]
        .iter()
        .map(|&time_s| {
            let drift = random.direction() * sweep;
            let shear = random.rotation() * 0.3 * sweep.min(1.0);
            KeyFrame {
                time_s,
                positions: points
                    .iter()
                    .map(|&p| (p + drift + shear * p).as_vec3().to_array())
                    .collect(),
                normals: None,
            }
        })
        .collect();
    deforming::shape(&frames, None, faces, SHUTTER).expect("valid")
}

fn still() -> Instance {
    Instance {
        shape: ball(),
        transform: Transform::fixed(DAffine3::from_translation(dvec3(2.0, 1.0, -1.0))),
    }
}

fn moving(shape: Shape, links: &[Link]) -> Instance {
    Instance {
        shape,
        transform: Transform::chain(links, SHUTTER),
    }
}

/// The corners of all triangles of an instance at one moment, in its own space.
fn triangles(shape: &Shape, time: f64) -> Vec<[[f32; 3]; 3]> {
    let rounded = |corners: [DVec3; 3]| corners.map(|p| p.as_vec3().to_array());
    match shape {
        Shape::Mesh(mesh) => (0..mesh.triangle_count() as u32)
            .map(|i| rounded(mesh.corners(i, time)))
            .collect(),
        Shape::Deforming(mesh) => (0..mesh.triangle_count() as u32)
            .map(|i| rounded(mesh.corners(i, time)))
            .collect(),
        _ => panic!("only meshes here"),
    }
}

/// Distances agree exactly with those of a search over all triangles; returns how many rays hit.
fn compare(name: &str, instances: Vec<Instance>, rays: usize) -> usize {
    let accel = Accel::build(instances);
    let (low, high) = accel.bounds().expect("there are instances");
    const CHUNK: usize = 1000;
    (0..rays / CHUNK)
        .into_par_iter()
        .map(|chunk| {
            let mut random = Random::new(chunk as u64 + 77);
            let mut hits = 0;
            for _ in 0..CHUNK {
                let time = SHUTTER.at(random.unit());
                let posed: Vec<_> = accel
                    .instances()
                    .iter()
                    .map(|i| (i.transform.at(time), triangles(&i.shape, time)))
                    .collect();
                // most rays aim at a triangle from a distance of its own size, some from far away
                let (placement, all) = &posed[random.index(posed.len())];
                let corners = all[random.index(all.len())].map(|p| DVec3::from(p.map(f64::from)));
                let (u, v) = (random.unit(), random.unit());
                let target = corners[0] * u.max(v).mul_add(-1.0, 1.0)
                    + corners[1] * u.min(v)
                    + corners[2] * (u.max(v) - u.min(v));
                let target = placement.to_world.transform_point3(target);
                let far = if random.unit() < 0.2 {
                    (high - low).length()
                } else {
                    3.0
                };
                let o = target + random.direction() * far;
                let jitter = random.direction() * 0.3 * random.unit();
                let ray = Ray::new(o, (target + jitter - o).normalize());
                let found = accel.at(time).closest(&ray, |_| true).map(|hit| hit.t);
                let brute = posed
                    .iter()
                    .flat_map(|(placement, all)| {
                        let tri = TriangleRay::new(
                            placement.to_object.transform_point3(ray.o),
                            placement.to_object.transform_vector3(ray.d),
                        );
                        all.iter()
                            .filter_map(move |c| tri.intersect(c, f64::INFINITY))
                            .map(|hit| hit.t)
                    })
                    .reduce(f64::min);
                assert_eq!(found, brute, "{name}, time {time}");
                assert_eq!(
                    accel.at(time).occluded(&ray, |_| true),
                    brute.is_some(),
                    "{name}"
                );
                hits += usize::from(found.is_some());
            }
            hits
        })
        .sum()
}

#[test]
fn a_million_rays_at_random_times_miss_nothing() {
    use Interpolation::{Cubic, Linear, Step};
    let mut random = Random::new(4);
    let r = &mut random;
    let far = dvec3(600.0, -500.0, 620.0);
    let wheel = |turns: f64| {
        let keys = [(-9.0, 0.0), (9.0, turns * 18.0 * std::f64::consts::TAU)];
        spin(dvec3(0.3, 1.0, -0.2), &keys, Linear)
    };
    let cases: Vec<(&str, Vec<Instance>)> = vec![
        (
            "slides on straight lines",
            vec![
                still(),
                moving(
                    ball(),
                    &[slide(
                        &[(-1e4, dvec3(-2e4, 0.0, 3e3)), (1e4, dvec3(2e4, 0.0, -3e3))],
                        Linear,
                    )],
                ),
            ],
        ),
        (
            "turns beside itself, less than a turn",
            vec![
                still(),
                moving(ball(), &[wheel(0.2), at(dvec3(3.0, 0.0, 0.0))]),
            ],
        ),
        (
            "turns seven times, with an axis 1000 away from the origin",
            vec![moving(
                ball(),
                &[at(far), wheel(5.0), at(dvec3(4.0, 1.0, 0.0))],
            )],
        ),
        (
            "turns about the origin at a distance of 1000",
            vec![moving(ball(), &[wheel(0.4), at(far)])],
        ),
        (
            "steps",
            vec![still(), moving(ball(), &[wheel(0.1), tumble(r, Step, 3.0)])],
        ),
        (
            "tumbles from key to key",
            vec![still(), moving(ball(), &[tumble(r, Linear, 4.0)])],
        ),
        (
            "tumbles along splines",
            vec![still(), moving(ball(), &[tumble(r, Cubic, 4.0)])],
        ),
        (
            "tumbles along splines in a frame that tumbles, 1000 away",
            vec![moving(
                ball(),
                &[
                    at(far),
                    tumble(r, Linear, 3.0),
                    at(dvec3(2.0, 0.0, 1.0)),
                    tumble(r, Cubic, 3.0),
                ],
            )],
        ),
        (
            "changes its form a little",
            vec![still(), moving(jelly(r, 0.05), &[at(DVec3::ZERO)])],
        ),
        (
            "changes its form and place a lot",
            vec![still(), moving(jelly(r, 8.0), &[at(far / 100.0)])],
        ),
        (
            "changes its form while it turns and scales",
            vec![
                still(),
                moving(jelly(r, 2.0), &[wheel(1.5), tumble(r, Linear, 3.0)]),
            ],
        ),
    ];
    let rays = 91_000;
    let total = cases.len() * rays;
    assert!(total >= 1_000_000);
    for (name, instances) in cases {
        let hits = compare(name, instances, rays);
        println!("{name}: {hits} of {rays} hit");
        assert!(hits > rays / 2, "{name}: only {hits} rays hit anything");
    }
}

#[test]
fn paths_that_bend_far_are_cut_into_segments_and_others_are_not() {
    let (points, faces) = icosphere(3);
    let moved = |along: &[f64], sweep: f64| {
        let frame = |time_s: f64, shift: f64| KeyFrame {
            time_s,
            positions: points
                .iter()
                .map(|p| (*p + dvec3(shift, 0.0, 0.0)).as_vec3().to_array())
                .collect(),
            normals: None,
        };
        let steps = (along.len() - 1) as f64;
        let key = |(i, x): (usize, &f64)| frame(SHUTTER.at(i as f64 / steps), x * sweep);
        let frames: Vec<KeyFrame> = along.iter().enumerate().map(key).collect();
        match deforming::shape(&frames, None, faces.clone(), SHUTTER).expect("valid") {
            Shape::Deforming(mesh) => mesh.segment_count(),
            _ => panic!("it moves"),
        }
    };
    // edges are about 0.14 long
    let counts = [0.01, 0.3, 3.0].map(|sweep| moved(&[0.0, 1.0, 0.0], sweep));
    println!("{counts:?} segments");
    assert!(counts[0] == 1 && counts[2] > 1 && counts[0] <= counts[1] && counts[1] <= counts[2]);
    // boxes that move along hold no more than what is there
    assert_eq!(moved(&[0.0, 1.0], 3.0), 1);
}

#[test]
fn frames_that_agree_within_the_shutter_are_an_ordinary_mesh() {
    let (points, faces) = icosphere(0);
    let frame = |time_s: f64, size: f64| KeyFrame {
        time_s,
        positions: points
            .iter()
            .map(|p| (*p * size).as_vec3().to_array())
            .collect(),
        normals: None,
    };
    let frames = vec![frame(1.0, 2.0), frame(5.0, 3.0)];
    let before = deforming::shape(&frames, None, faces.clone(), SHUTTER).expect("valid");
    let instant = Shutter {
        open_s: 3.0,
        close_s: 3.0,
    };
    let middle = deforming::shape(&frames, None, faces.clone(), instant).expect("valid");
    let positions: Vec<[f32; 3]> = frame(0.0, 2.5).positions;
    let expected = Mesh::new(&positions, None, None, faces).expect("valid");
    match (before, middle) {
        (Shape::Mesh(before), Shape::Mesh(middle)) => {
            assert!((before.area() / 4.0 - expected.area() / 6.25).abs() < 1e-5);
            assert!((middle.area() / expected.area() - 1.0).abs() < 1e-6);
        }
        _ => panic!("nothing moves"),
    }
}

#[test]
fn area_samples_of_a_moving_thing_have_their_density() {
    let mut random = Random::new(9);
    let shapes = [
        jelly(&mut random, 0.6),
        ball(),
        Shape::Sphere,
        Shape::Quad,
        Shape::Box,
        Shape::Cylinder,
    ];
    for shape in shapes {
        let instance = moving(
            shape.clone(),
            &[tumble(&mut random, Interpolation::Linear, 2.0)],
        );
        let sampler = abbe::geometry::AreaSampler::new(&shape);
        for time in [-0.5, 0.0, 0.37, 0.99] {
            let n = 40_000;
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..n {
                let u = glam::dvec2(random.unit(), random.unit());
                let id = abbe::geometry::InstanceId(0);
                let sample = sampler.sample(&instance, id, time, random.unit(), u);
                let pdf = sampler.pdf(&instance, &sample.point, time);
                assert!((pdf / sample.pdf_a - 1.0).abs() < 1e-12);
                sum += 1.0 / sample.pdf_a;
                squares += sample.pdf_a.powi(-2);
            }
            let mean = sum / f64::from(n);
            let error = ((squares / f64::from(n) - mean * mean).max(0.0) / f64::from(n)).sqrt();
            let area = instance.area(time);
            assert!(
                (mean - area).abs() < 5.0 * error + 1e-4 * area,
                "{shape:?} at {time}: {mean} +- {error}, {area}"
            );
        }
    }
}
