//! Sets of rays: what cameras, walks and connections send through a scene.

use super::scenes::{Scene, numbers, on_sphere};
use abbe::geometry::{AreaSampler, InstanceId, Placements, Ray, SurfacePoint};
use glam::{DVec2, DVec3, dvec3};
use std::hint::black_box;

/// Rays of a set.
const RAYS: usize = 100_000;
/// Rays of one moment in a scene that moves, like those of a path.
const PATH: usize = 8;

/// A ray and its time, in seconds.
pub type Timed = (f64, Ray);

/// Rays through a scene.
pub struct Set {
    pub name: &'static str,
    pub rays: Vec<Timed>,
}

/// Question about a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// The closest hit.
    Closest,
    /// Whether there is any.
    Occluded,
}

impl Query {
    pub const ALL: [Self; 2] = [Self::Closest, Self::Occluded];

    pub fn name(self) -> &'static str {
        match self {
            Self::Closest => "closest",
            Self::Occluded => "occluded",
        }
    }
}

/// Asks about each ray; the number of those that hit.
pub fn hits(scene: &Scene, rays: &[Timed], query: Query) -> usize {
    let mut placements = Placements::default();
    let (mut count, mut time) = (0, 0.0);
    let mut accel = scene.accel.at(placements.at(time, 0));
    for (at, ray) in rays {
        if *at != time {
            time = *at;
            accel = scene.accel.at(placements.at(time, 0));
        }
        let is_hit = match query {
            Query::Closest => accel.closest(black_box(ray), |_| true).is_some(),
            Query::Occluded => accel.occluded(black_box(ray), |_| true),
        };
        count += usize::from(is_hit);
    }
    count
}

fn still(rays: impl Iterator<Item = Ray>) -> Vec<Timed> {
    rays.map(|ray| (0.0, ray)).collect()
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
    Set {
        name: "bounces",
        rays: still(rays),
    }
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
    Set {
        name: "pairs",
        rays: still(rays),
    }
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
    Set {
        name: "shadows",
        rays: still(rays),
    }
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
        (time, Ray::new(a, (b - a).normalize()))
    });
    Set {
        name: "chords",
        rays: rays.collect(),
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
    Set {
        name: "camera",
        rays: still(rays),
    }
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
    Set {
        name: "pupil",
        rays: still(rays),
    }
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
