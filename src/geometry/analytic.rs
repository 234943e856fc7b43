//! Intersection of the analytic unit shapes, in their own space.
//!
//! Roots come from the rejected vector (the foot of the perpendicular from the center to the line),
//! which keeps its precision however far away the ray starts (Haines et al., Ray Tracing Gems,
//! 2019, chapter 7). An end of the ray that lies on a curved shape is taken to be exactly on it:
//! its own root is then zero by definition and the other has a closed form.

use super::ray::LocalRay;
use glam::{DVec2, DVec3};

/// A hit: parameter and face.
pub(super) type FaceHit = (f64, u32);

/// The sphere of radius 1 about the origin.
pub(super) fn sphere(ray: &LocalRay) -> Option<FaceHit> {
    let approach = |t| approach(ray, ray.at(t), ray.d);
    let roots = unit_roots(ray.o, ray.d, ray);
    roots
        .into_iter()
        .find(|&t| ray.counts(t, || approach(t)))
        .map(|t| (t, 0))
}

/// The open cylinder of radius 1 about z, -1 <= z <= 1.
pub(super) fn cylinder(ray: &LocalRay) -> Option<FaceHit> {
    let flat = |v: DVec3| v.with_z(0.0);
    let approach = |t| approach(ray, flat(ray.at(t)), flat(ray.d));
    let roots = unit_roots(flat(ray.o), flat(ray.d), ray);
    let inside = |t: f64| (ray.o.z + ray.d.z * t).abs() <= 1.0;
    roots
        .into_iter()
        .find(|&t| inside(t) && ray.counts(t, || approach(t)))
        .map(|t| (t, 0))
}

/// How fast a ray nears a curved shape where its normal is `n`. The other root of the shape that an
/// end lies on has a closed form, and is told from the end however flat the chord is.
fn approach(ray: &LocalRay, n: DVec3, d: DVec3) -> f64 {
    if ray.start.is_some() || ray.end.is_some() {
        d.length()
    } else {
        n.dot(d).abs()
    }
}

/// Parameters, in order, at which the line is at distance 1 from the origin; NaN for those that do
/// not exist or that are an end of the ray on this shape.
fn unit_roots(o: DVec3, d: DVec3, ray: &LocalRay) -> [f64; 2] {
    let none = f64::NAN;
    let inv_d2 = 1.0 / d.length_squared();
    match (ray.start, ray.end) {
        (Some(_), Some(_)) => [none, none],
        (Some(_), None) => [-2.0 * o.normalize().dot(d) * inv_d2, none],
        (None, Some(_)) => {
            let far = (o + d * ray.t_end).normalize();
            [ray.t_end - 2.0 * far.dot(d) * inv_d2, none]
        }
        (None, None) => {
            let nearest = -o.dot(d) * inv_d2;
            let foot = o + d * nearest;
            let half = ((1.0 - foot.length_squared()) * inv_d2).sqrt();
            [nearest - half, nearest + half]
        }
    }
}

/// Where the ray, no end of which lies in the plane z = 0, meets the part of it that is `inside`.
#[inline(always)]
fn plane(ray: &LocalRay, inside: impl Fn(DVec2) -> bool) -> Option<FaceHit> {
    let t = -ray.o.z / ray.d.z;
    let is_hit = ray.reaches(t) && inside(ray.at(t).truncate()) && ray.counts(t, || ray.d.z.abs());
    is_hit.then_some((t, 0))
}

/// The disk of radius 1 in z = 0 with a hole of radius `inner`.
pub(super) fn disk(ray: &LocalRay, inner: f64) -> Option<FaceHit> {
    plane(ray, |p| (inner * inner..=1.0).contains(&p.length_squared()))
}

/// The square -1..1 in z = 0.
#[inline(always)]
pub(super) fn quad(ray: &LocalRay) -> Option<FaceHit> {
    plane(ray, |p| p.abs().max_element() <= 1.0)
}

/// Outward unit normal of a face of the cube; faces are numbered -x, +x, -y, +y, -z, +z.
pub(super) fn cube_normal(face: u32) -> DVec3 {
    let axis = DVec3::AXES[(face / 2) as usize % 3];
    if face.is_multiple_of(2) { -axis } else { axis }
}

/// The cube -1..1. A convex solid: a ray that starts on it can only leave it, through a face other
/// than its own.
pub(super) fn cube(ray: &LocalRay) -> Option<FaceHit> {
    let (mut enter, mut leave) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
    for (axis, face) in [(0, 0u32), (1, 2), (2, 4)] {
        let (o, d) = (ray.o[axis], ray.d[axis]);
        if d == 0.0 {
            if o.abs() > 1.0 {
                return None;
            }
            continue;
        }
        let inv = 1.0 / d;
        let (low, high) = ((-1.0 - o) * inv, (1.0 - o) * inv);
        let (near, far) = if d > 0.0 {
            ((low, face), (high, face + 1))
        } else {
            ((high, face + 1), (low, face))
        };
        if near.0 > enter.0 {
            enter = near;
        }
        if far.0 < leave.0 {
            leave = far;
        }
    }
    if enter.0 > leave.0 {
        return None;
    }
    let toward = |face: u32| cube_normal(face).dot(ray.d);
    let candidates = match (ray.start, ray.end) {
        (None, None) => [Some(enter), Some(leave)],
        (Some(s), None) if toward(s) < 0.0 => [Some(leave), None],
        (None, Some(e)) if toward(e) > 0.0 => [Some(enter), None],
        _ => [None, None],
    };
    candidates
        .into_iter()
        .flatten()
        .find(|&(t, face)| ray.counts(t, || toward(face).abs()))
}
