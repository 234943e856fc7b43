//! Rays per second through the two-level tree: one instance of a bumpy sphere of a million
//! triangles.
//!
//! `diffuse_bounces`: from random surface points, cosine-distributed outward, shuffled. `chords`:
//! between random points of the sphere that bounds the mesh. `camera`: coherent rays from outside.
//! Run on one thread.

use abbe::geometry::{Accel, AreaSampler, Instance, InstanceId, Mesh, Ray, Shape, Transform};
use abbe::math::hash;
use divan::Bencher;
use divan::counter::ItemsCount;
use glam::{DAffine3, DVec2, DVec3, dvec3};
use std::f64::consts::{PI, TAU};
use std::hint::black_box;
use std::sync::{Arc, LazyLock};

const RAYS: u64 = 100_000;

static SCENE: LazyLock<Accel> = LazyLock::new(|| {
    let mesh = bumpy_sphere(500, 1000);
    let to_world = DAffine3::from_translation(dvec3(0.0, 1.15, 0.0));
    let instance = Instance {
        shape: Shape::Mesh(Arc::new(mesh)),
        transform: Transform::fixed(to_world),
    };
    Accel::build(vec![instance])
});

/// Radius 1 + 0.05 sin(12 θ) sin(16 φ) + 0.01 sin(60 θ) sin(80 φ), with single vertices at the
/// poles.
fn bumpy_sphere(rows: u32, columns: u32) -> Mesh {
    let vertex = |row: u32, column: u32| {
        let theta = PI * f64::from(row) / f64::from(rows);
        let phi = TAU * f64::from(column) / f64::from(columns);
        let r = 1.0
            + 0.05 * (12.0 * theta).sin() * (16.0 * phi).sin()
            + 0.01 * (60.0 * theta).sin() * (80.0 * phi).sin();
        let p = dvec3(
            theta.sin() * phi.cos(),
            theta.cos(),
            theta.sin() * phi.sin(),
        ) * r;
        p.as_vec3().to_array()
    };
    let mut positions = vec![vertex(0, 0)];
    for row in 1..rows {
        positions.extend((0..columns).map(|column| vertex(row, column)));
    }
    positions.push(vertex(rows, 0));
    let last = positions.len() as u32 - 1;
    let index = |row: u32, column: u32| match row {
        0 => 0,
        r if r == rows => last,
        r => 1 + (r - 1) * columns + column % columns,
    };
    let mut triangles = Vec::new();
    for row in 0..rows {
        for c in 0..columns {
            let quad = [
                index(row, c),
                index(row, c + 1),
                index(row + 1, c + 1),
                index(row + 1, c),
            ];
            triangles.push([quad[0], quad[1], quad[2]]);
            triangles.push([quad[0], quad[2], quad[3]]);
        }
    }
    Mesh::new(&positions, None, None, triangles).expect("a valid mesh")
}

/// A fixed stream of numbers in [0, 1).
fn numbers() -> impl FnMut() -> f64 {
    let mut i = 0u64;
    move || {
        i += 1;
        hash::unit_f64(hash::random_bits(1, i))
    }
}

fn on_sphere(u: f64, v: f64) -> DVec3 {
    let z = 1.0 - 2.0 * u;
    let r = (1.0 - z * z).sqrt();
    dvec3(r * (TAU * v).cos(), r * (TAU * v).sin(), z)
}

fn bounces() -> Vec<Ray> {
    let mut next = numbers();
    let instance = &SCENE.instances()[0];
    let sampler = AreaSampler::new(&instance.shape);
    (0..RAYS)
        .map(|_| {
            let u = DVec2::new(next(), next());
            let s = sampler.sample(instance, InstanceId(0), 0.0, next(), u);
            let d = (s.point.ng + on_sphere(next(), next())).normalize();
            Ray::leaving(s.point.p, d, Some(s.point.id))
        })
        .collect()
}

fn chords() -> Vec<Ray> {
    let mut next = numbers();
    let (center, radius) = (dvec3(0.0, 1.15, 0.0), 1.06);
    let mut point = || center + on_sphere(next(), next()) * radius;
    (0..RAYS)
        .map(|_| {
            let (a, b) = (point(), point());
            Ray::new(a, (b - a).normalize())
        })
        .collect()
}

fn camera() -> Vec<Ray> {
    let side = (RAYS as f64).sqrt() as u64;
    let eye = dvec3(0.0, 1.9, 4.5);
    (0..side * side)
        .map(|i| {
            let at = |k: u64| k as f64 / side as f64 * 2.4 - 1.2;
            let target = dvec3(at(i % side), 1.15 + at(i / side), 0.0);
            Ray::new(eye, (target - eye).normalize())
        })
        .collect()
}

fn closest(bencher: Bencher, rays: &[Ray]) {
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench_local(|| {
            rays.iter()
                .filter(|ray| SCENE.at(0.0).closest(black_box(ray), |_| true).is_some())
                .count()
        });
}

fn occluded(bencher: Bencher, rays: &[Ray]) {
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench_local(|| {
            rays.iter()
                .filter(|ray| SCENE.at(0.0).occluded(black_box(ray), |_| true))
                .count()
        });
}

#[divan::bench]
fn closest_diffuse_bounces(bencher: Bencher) {
    closest(bencher, &bounces());
}

#[divan::bench]
fn closest_chords(bencher: Bencher) {
    closest(bencher, &chords());
}

#[divan::bench]
fn closest_camera(bencher: Bencher) {
    closest(bencher, &camera());
}

#[divan::bench]
fn occluded_diffuse_bounces(bencher: Bencher) {
    occluded(bencher, &bounces());
}

#[divan::bench]
fn occluded_chords(bencher: Bencher) {
    occluded(bencher, &chords());
}

#[expect(clippy::print_stdout, reason = "the output of a benchmark")]
fn main() {
    if let Shape::Mesh(mesh) = &SCENE.instances()[0].shape {
        let (n, bytes) = (mesh.triangle_count(), mesh.bytes());
        println!("{n} triangles, {:.1} MB", bytes as f64 / 1e6);
    }
    divan::main();
}
