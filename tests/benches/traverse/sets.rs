//! Sets of rays: what cameras, walks and connections send through a scene.

use super::scenes::{Scene, numbers, on_sphere};
use abbe::geometry::{AreaSampler, InstanceId, Placements, Ray, SurfacePoint};
use glam::{DVec2, DVec3, dvec3};
use std::hint::black_box;

/// Rays of a set.
const RAYS: usize = 100_000;
/// Rays of one moment in a scene that moves, like those of a path.
const PATH: usize = 8;

/// Rays through a scene, and the time of each in seconds.
pub struct Set {
    pub name: &'static str,
    pub rays: Vec<Ray>,
    pub times: Vec<f64>,
}

/// Question about a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// The closest hit.
    Closest,
    /// Whether there is any.
    Occluded,
    /// The same, of as many rays at once, in the order of the set: 8, as a sample may have that
    /// joins two sub-paths, or 32, as several samples have.
    Batched(usize),
}

impl Query {
    pub const ALL: [Self; 4] = [
        Self::Closest,
        Self::Occluded,
        Self::Batched(8),
        Self::Batched(32),
    ];

    pub fn name(self) -> String {
        match self {
            Self::Closest => "closest".into(),
            Self::Occluded => "occluded".into(),
            Self::Batched(size) => format!("batched{size}"),
        }
    }
}

/// Asks about each ray; the number of those that hit.
pub fn hits(scene: &Scene, set: &Set, query: Query) -> usize {
    let mut placements = Placements::default();
    let (mut count, mut first) = (0, 0);
    let mut occluded = Vec::new();
    for times in set.times.chunk_by(|a, b| a == b) {
        let accel = scene.accel.at(placements.at(times[0], 0));
        let rays = &set.rays[first..][..times.len()];
        first += times.len();
        let is_hit = |ray| match query {
            Query::Closest => accel.closest(black_box(ray), |_| true).is_some(),
            _ => accel.occluded(black_box(ray), |_| true),
        };
        if let Query::Batched(size) = query {
            for batch in rays.chunks(size) {
                occluded.resize(batch.len(), false);
                accel.occluded_each(black_box(batch), |_| true, &mut occluded);
                count += occluded.iter().filter(|&&is_hit| is_hit).count();
            }
        } else {
            count += rays.iter().filter(|&ray| is_hit(ray)).count();
        }
    }
    count
}

impl Set {
    /// Rays of one moment.
    fn still(name: &'static str, rays: impl Iterator<Item = Ray>) -> Self {
        let rays: Vec<_> = rays.collect();
        let times = vec![0.0; rays.len()];
        Self { name, rays, times }
    }
}

/// Points of the instances, each instance as often, uniform over its area.
fn points(scene: &Scene, stream: u64) -> impl FnMut() -> SurfacePoint {
    let instances = scene.accel.instances();
    let samplers: Vec<_> = instances
        .iter()
        .map(|i| AreaSampler::new(&i.shape))
        .collect();
    let mut next = numbers(stream);
    move || {
        let i = (next() * instances.len() as f64) as usize;
        let u = DVec2::new(next(), next());
        let id = InstanceId(i as u32);
        samplers[i].sample(&instances[i], id, 0.0, next(), u).point
    }
}

/// From random points of surfaces, cosine-distributed outward, in no order.
fn bounces(scene: &Scene) -> Set {
    let (mut point, mut next) = (points(scene, 1), numbers(2));
    let rays = (0..RAYS).map(|_| {
        let p = point();
        let d = (p.ng + on_sphere(next(), next())).normalize();
        Ray::leaving(p.p, d, Some(p.id))
    });
    Set::still("bounces", rays)
}

/// Segments between two points of surfaces that face one another, in no order.
fn pairs(scene: &Scene) -> Set {
    let (mut from, mut to) = (points(scene, 5), points(scene, 7));
    let mut ray = || {
        loop {
            let (a, b) = (from(), to());
            let w = b.p - a.p;
            if w.dot(a.ng) > 0.0 && w.dot(b.ng) < 0.0 {
                let length = w.length();
                return Ray::leaving(a.p, w / length, Some(a.id)).ending(length, Some(b.id));
            }
        }
    };
    let rays = (0..RAYS).map(|_| ray());
    Set::still("pairs", rays)
}

/// Segments between random points of surfaces and a lamp that is no part of the scene, where the
/// surface faces it, in no order.
fn shadows(scene: &Scene) -> Set {
    let (mut point, mut next) = (points(scene, 5), numbers(6));
    let mut ray = || {
        loop {
            let a = point();
            let lamp = dvec3(1.5 + next(), 5.0, 2.5 + next());
            let w = lamp - a.p;
            if w.dot(a.ng) > 0.0 {
                let length = w.length();
                return Ray::leaving(a.p, w / length, Some(a.id)).ending(length, None);
            }
        }
    };
    let rays = (0..RAYS).map(|_| ray());
    Set::still("shadows", rays)
}

/// Between random points of a sphere.
fn chords(center: DVec3, radius: f64, moments: bool) -> Set {
    let mut next = numbers(1);
    let mut time = 0.0;
    let rays = (0..RAYS).map(|i| {
        if moments && i % PATH == 0 {
            time = next();
        }
        let mut point = || center + on_sphere(next(), next()) * radius;
        let (a, b) = (point(), point());
        (Ray::new(a, (b - a).normalize()), time)
    });
    let (rays, times) = rays.unzip();
    Set {
        name: "chords",
        rays,
        times,
    }
}

/// From an eye to a square about `center` across the z axis, row by row.
fn camera(eye: DVec3, center: DVec3, half: f64) -> Set {
    let side = RAYS.isqrt();
    let rays = (0..side * side).map(|i| {
        let at = |k: usize| (k as f64 / side as f64 * 2.0 - 1.0) * half;
        let target = center + dvec3(at(i % side), at(i / side), 0.0);
        Ray::new(eye, (target - eye).normalize())
    });
    Set::still("camera", rays)
}

/// Through the front of a lens, slightly inclined.
fn pupil() -> Set {
    let mut next = numbers(1);
    let rays = (0..RAYS).map(|_| {
        let (r, (sin, cos)) = (
            0.02 * next().sqrt(),
            (next() * std::f64::consts::TAU).sin_cos(),
        );
        let from = dvec3(r * cos, r * sin, -0.05);
        let to = dvec3(0.012 * (next() - 0.5), 0.012 * (next() - 0.5), 0.04);
        Ray::new(from, (to - from).normalize())
    });
    Set::still("pupil", rays)
}

/// All sets of a scene.
pub fn of(scene: &Scene) -> Vec<Set> {
    let up = dvec3(0.0, 1.15, 0.0);
    match scene.name {
        "million" => vec![
            bounces(scene),
            chords(up, 1.06, false),
            camera(dvec3(0.0, 1.9, 4.5), up, 1.2),
            shadows(scene),
        ],
        "cornell" => vec![
            camera(dvec3(2.75, 2.75, -8.0), dvec3(2.75, 2.75, 0.0), 2.8),
            bounces(scene),
            pairs(scene),
        ],
        "moving" => vec![chords(DVec3::ZERO, 1.15, true)],
        "lens" => vec![pupil()],
        _ => vec![
            camera(dvec3(0.2, 0.3, 4.0), DVec3::ZERO, 1.0),
            chords(DVec3::ZERO, 1.5, false),
        ],
    }
}
