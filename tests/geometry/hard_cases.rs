//! Rays and meshes at the limits of arithmetic.
//!
//! Part of the test group `hard_cases`, whose table is in `docs/validation.md`.

use crate::support::{Random, ball, mesh, scene};
use abbe::geometry::{InstanceId, Mesh, Ray, Shape};
use glam::{DAffine3, DVec2, DVec3, dvec3};
use std::sync::Arc;

fn shapes() -> Vec<Shape> {
    vec![
        ball(2),
        Shape::Sphere,
        Shape::Disk { inner: 0.0 },
        Shape::Quad,
        Shape::Cylinder,
        Shape::Box,
    ]
}

/// Rays that are not rays: an answer comes, and a hit has a place.
#[test]
fn rays_that_are_not_numbers() {
    let shapes = shapes();
    let parts: Vec<(&Shape, DAffine3)> = shapes
        .iter()
        .enumerate()
        .map(|(i, s)| {
            (
                s,
                DAffine3::from_translation(dvec3(0.0, 0.0, 3.0 * i as f64)),
            )
        })
        .collect();
    let accel = scene(&parts);
    let odd = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        f64::MIN_POSITIVE,
        5e-324,
        0.0,
        -0.0,
        1.0,
    ];
    let mut random = Random::new(11);
    let mut hits = 0;
    for _ in 0..200_000 {
        let mut any = || odd[random.index(odd.len())];
        let (o, d) = (dvec3(any(), any(), any()), dvec3(any(), any(), any()));
        let ray = Ray::new(o, d);
        if let Some(hit) = accel.at(0.0).closest(&ray, |_| true) {
            assert!(hit.t > 0.0 && hit.t.is_finite(), "{ray:?}: {hit:?}");
            hits += 1;
        }
        let _ = accel.at(0.0).occluded(&ray, |_| true);
    }
    assert!(hits > 100, "rays that are rays hit: {hits}");
}

/// Triangles 10⁵ times as long as they are wide cover a square without a gap, and once.
#[test]
fn slivers_leave_no_gap() {
    const STRIPS: u32 = 100_000;
    let x = |i: u32| f64::from(i) / f64::from(STRIPS);
    let points: Vec<DVec3> = (0..=STRIPS)
        .flat_map(|i| [dvec3(x(i), 0.0, 0.0), dvec3(x(i), 1.0, 0.0)])
        .collect();
    let faces: Vec<[u32; 3]> = (0..STRIPS)
        .flat_map(|i| {
            [
                [2 * i, 2 * i + 2, 2 * i + 1],
                [2 * i + 1, 2 * i + 2, 2 * i + 3],
            ]
        })
        .collect();
    let shape = Shape::Mesh(Arc::new(mesh(&points, &faces)));
    let accel = scene(&[(&shape, DAffine3::IDENTITY)]);
    let mut random = Random::new(12);
    for i in 0..100_000 {
        // half of the rays at edges
        let u = random.unit();
        let u = if i & 1 == 0 {
            u
        } else {
            x((u * f64::from(STRIPS)) as u32).max(1e-6)
        };
        let ray = Ray::new(dvec3(u, 0.999 * random.unit() + 5e-4, 2.0), DVec3::NEG_Z);
        let t = accel.at(0.0).closest(&ray, |_| true).map(|h| h.t);
        assert!(t.is_some_and(|t| (t - 2.0).abs() < 1e-12), "{ray:?}: {t:?}");
    }
}

/// Triangles without area are dropped and never drawn as light; vertices that are not numbers are
/// refused.
#[test]
fn triangles_without_area_or_numbers() {
    let corners = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [2.0, 0.0, 0.0_f32],
    ];
    // a point, a line, and one triangle
    let faces = vec![[0, 0, 0], [0, 1, 3], [0, 1, 2]];
    let mesh = Mesh::new(&corners, None, None, faces.clone()).expect("one triangle has area");
    assert_eq!(
        (mesh.dropped(), mesh.triangle_count(), mesh.area()),
        (2, 1, 0.5)
    );
    let shape = Shape::Mesh(Arc::new(mesh));
    let accel = scene(&[(&shape, DAffine3::IDENTITY)]);
    let sampler = abbe::geometry::AreaSampler::new(&shape);
    let mut random = Random::new(13);
    for _ in 0..1000 {
        let u = DVec2::new(random.unit(), random.unit());
        let sample = sampler.sample(&accel.instances()[0], InstanceId(0), 0.0, random.unit(), u);
        assert!((sample.pdf_a - 2.0).abs() < 1e-6, "{sample:?}");
    }
    for bad in [f32::NAN, f32::INFINITY] {
        let mut corners = corners;
        corners[2][1] = bad;
        assert!(Mesh::new(&corners, None, None, faces.clone()).is_err());
    }
    assert!(Mesh::new(&corners, None, None, vec![[0, 0, 0], [0, 1, 3]]).is_err());
}
