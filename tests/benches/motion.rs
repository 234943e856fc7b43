//! Cost of motion per ray: the same rays, in the space of the thing, against a thing at rest, one
//! that moves rigidly, and one that changes its form.
//!
//! A sphere of 39,600 triangles with edges of about 0.03. Rays are chords between random points of
//! a sphere about it, at random times, [`PATH`] after one another at the same time like those of a
//! path. Deforming: all vertices go the same way, by half an edge, 5 and 25 edges. Run on one
//! thread.

use abbe::geometry::deforming::{self, KeyFrame};
use abbe::geometry::pose::{Pose, Rotation};
use abbe::geometry::track::{Interpolation, Track};
use abbe::geometry::{Accel, Instance, Link, Mesh, Placements, Ray, Shape, Shutter, Transform};
use abbe::math::hash;
use divan::Bencher;
use divan::counter::ItemsCount;
use glam::{DAffine3, DVec3, dvec3};
use std::f64::consts::{PI, TAU};
use std::hint::black_box;
use std::sync::{Arc, LazyLock};
use std::time::Instant;

const RAYS: u64 = 50_000;
/// Rays of one moment; a pair of sub-paths in `scenes/bench/motion.toml` takes more.
const PATH: u64 = 8;
const SHUTTER: Shutter = Shutter {
    open_s: 0.0,
    close_s: 1.0,
};
const EDGE: f64 = 0.03;
const ROWS: u32 = 100;

type Points = Vec<[f32; 3]>;

/// Vertices and triangles of the sphere of radius 1, with single vertices at the poles.
static SPHERE: LazyLock<(Points, Vec<[u32; 3]>)> = LazyLock::new(|| {
    let columns = 2 * ROWS;
    let vertex = |row: u32, column: u32| {
        let theta = PI * f64::from(row) / f64::from(ROWS);
        let phi = TAU * f64::from(column) / f64::from(columns);
        let (sin, cos) = theta.sin_cos();
        dvec3(sin * phi.cos(), cos, sin * phi.sin())
            .as_vec3()
            .to_array()
    };
    let mut positions = vec![vertex(0, 0)];
    for row in 1..ROWS {
        positions.extend((0..columns).map(|column| vertex(row, column)));
    }
    positions.push(vertex(ROWS, 0));
    let last = positions.len() as u32 - 1;
    let index = |row: u32, column: u32| match row {
        0 => 0,
        r if r == ROWS => last,
        r => 1 + (r - 1) * columns + column % columns,
    };
    let mut triangles = Vec::new();
    for row in 0..ROWS {
        for c in 0..columns {
            let (a, b) = (index(row, c), index(row, c + 1));
            let (d, e) = (index(row + 1, c), index(row + 1, c + 1));
            triangles.extend([[a, b, e], [a, e, d]]);
        }
    }
    triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    (positions, triangles)
});

static MESH: LazyLock<Shape> = LazyLock::new(|| {
    let (positions, triangles) = &*SPHERE;
    Shape::Mesh(Arc::new(
        Mesh::new(positions, None, None, triangles.clone()).expect("a valid mesh"),
    ))
});

fn swept(edges: f64) -> Shape {
    let (positions, triangles) = &*SPHERE;
    let shift = (dvec3(0.6, 0.0, 0.8) * edges * EDGE).as_vec3();
    let moved = positions
        .iter()
        .map(|p| [p[0] + shift.x, p[1], p[2] + shift.z]);
    let frame = |time_s: f64, positions: Points| KeyFrame {
        time_s,
        positions,
        normals: None,
    };
    let frames = vec![frame(0.0, positions.clone()), frame(1.0, moved.collect())];
    deforming::shape(&frames, None, triangles.clone(), SHUTTER).expect("a valid mesh")
}

fn slide() -> Link {
    let keys = [(0.0, DVec3::ZERO), (1.0, dvec3(2.0, 0.3, 0.0))];
    Link::Keyed(Pose {
        translation: Some(Track::new(&keys, Interpolation::Linear).expect("valid")),
        ..Pose::default()
    })
}

fn spin() -> Link {
    Link::Keyed(Pose {
        rotation: Some(Rotation::Spin {
            axis: dvec3(0.6, 0.8, 0.0),
            angle_rad: Track::new(&[(0.0, 0.0), (1.0, TAU)], Interpolation::Linear).expect("valid"),
        }),
        ..Pose::default()
    })
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

/// A ray and its time, in seconds.
type Timed = (f64, Ray);

/// A thing alone, and the same chords in its own space wherever it is at the time of the ray.
fn prepare(shape: Shape, mut transform: Transform) -> (Accel, Vec<Timed>) {
    let mut next = numbers();
    let mut time = 0.0;
    let rays = (0..RAYS)
        .map(|i| {
            if i % PATH == 0 {
                time = next();
            }
            let mut end = || on_sphere(next(), next()) * 1.02;
            let (a, b) = (end(), end());
            let place = transform.at(time).to_world;
            let (a, b) = (place.transform_point3(a), place.transform_point3(b));
            (time, Ray::new(a, (b - a).normalize()))
        })
        .collect();
    transform.enumerate(&mut 0);
    (Accel::build(vec![Instance { shape, transform }]), rays)
}

fn hits(accel: &Accel, rays: &[Timed]) -> usize {
    let mut placements = Placements::default();
    let mut count = 0;
    for path in rays.chunk_by(|a, b| a.0 == b.0) {
        let accel = accel.at(placements.at(path[0].0, 1));
        let hit = |(_, ray): &&Timed| accel.closest(black_box(ray), |_| true).is_some();
        count += path.iter().filter(hit).count();
    }
    count
}

fn run(bencher: Bencher, shape: Shape, transform: Transform) {
    let (accel, rays) = prepare(shape, transform);
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench_local(|| hits(&accel, &rays));
}

fn at_rest() -> Transform {
    Transform::fixed(DAffine3::IDENTITY)
}

#[divan::bench(sample_count = 15, sample_size = 1)]
fn mesh_at_rest(bencher: Bencher) {
    run(bencher, MESH.clone(), at_rest());
}

#[divan::bench(sample_count = 15, sample_size = 1)]
fn mesh_slides(bencher: Bencher) {
    run(bencher, MESH.clone(), Transform::chain(&[slide()], SHUTTER));
}

#[divan::bench(sample_count = 15, sample_size = 1)]
fn mesh_spins_and_slides(bencher: Bencher) {
    run(
        bencher,
        MESH.clone(),
        Transform::chain(&[slide(), spin()], SHUTTER),
    );
}

#[divan::bench(args = [0.5, 5.0, 25.0], sample_count = 15, sample_size = 1)]
fn mesh_deforms(bencher: Bencher, edges: f64) {
    run(bencher, swept(edges), at_rest());
}

#[divan::bench(sample_count = 15, sample_size = 1)]
fn sphere_at_rest(bencher: Bencher) {
    run(bencher, Shape::Sphere, at_rest());
}

#[divan::bench(sample_count = 15, sample_size = 1)]
fn sphere_spins_and_slides(bencher: Bencher) {
    run(
        bencher,
        Shape::Sphere,
        Transform::chain(&[slide(), spin()], SHUTTER),
    );
}

/// Time of the second against that of the first, run in turns so that what else the machine does
/// meets both: the median and the range that holds it with 95 %.
#[expect(clippy::print_stdout, reason = "the output of a benchmark")]
fn compare(name: &str, rest: &(Accel, Vec<Timed>), moving: &(Accel, Vec<Timed>)) {
    const PAIRS: usize = 1001;
    const CHUNK: usize = 400;
    let time = |(accel, rays): &(Accel, Vec<Timed>), i: usize| {
        let start = i * CHUNK % rays.len();
        let begin = Instant::now();
        black_box(hits(accel, &rays[start..start + CHUNK]));
        begin.elapsed().as_secs_f64()
    };
    let mut ratios: Vec<f64> = (0..PAIRS)
        .map(|i| {
            // other rays than just before, which caches and branch predictors would know
            let (a, b) = (time(rest, 2 * i), time(moving, 2 * i));
            let (b2, a2) = (time(moving, 2 * i + 1), time(rest, 2 * i + 1));
            (b + b2) / (a + a2)
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    // binomial: the median lies between these ranks
    let half = (0.98 * (PAIRS as f64).sqrt()) as usize;
    let [low, median, high] = [PAIRS / 2 - half, PAIRS / 2, PAIRS / 2 + half].map(|i| ratios[i]);
    println!("{name}: {median:.2} times as long as at rest ({low:.2} to {high:.2})");
}

fn main() {
    let mesh = prepare(MESH.clone(), at_rest());
    let slides = Transform::chain(&[slide()], SHUTTER);
    let spins = Transform::chain(&[slide(), spin()], SHUTTER);
    compare("mesh, slides", &mesh, &prepare(MESH.clone(), slides));
    compare(
        "mesh, spins and slides",
        &mesh,
        &prepare(MESH.clone(), spins.clone()),
    );
    let sphere = prepare(Shape::Sphere, at_rest());
    compare(
        "sphere, spins and slides",
        &sphere,
        &prepare(Shape::Sphere, spins),
    );
    for edges in [0.5, 5.0, 25.0] {
        let shape = swept(edges);
        let parts = match &shape {
            Shape::Deforming(mesh) => mesh.segment_count(),
            _ => 1,
        };
        let name = format!("mesh, deforms by {edges} edges, {parts} trees over the shutter");
        compare(&name, &mesh, &prepare(shape, at_rest()));
    }
    divan::main();
}
