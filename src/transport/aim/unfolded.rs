//! Planes in a row of which one transmits at most.
//!
//! A mirror unfolds: everything beyond it is replaced by its image, and the path goes straight on.
//! A straight line is left, or one refraction, which lies in the plane of its ends and the normal:
//! there one number decides it, and what both sides carry along the plane differs by a function of
//! it that rises.

use super::roots::root;
use super::surface::Surface;
use super::{Bounce, Far, MAX_CHAIN, Points};
use arrayvec::ArrayVec;
use glam::{DAffine3, DMat3, DVec3};

/// A plane among the images.
struct Unfolded {
    origin: DVec3,
    normal: DVec3,
    /// From there to where the plane is.
    back: DAffine3,
}

/// The map to the image behind a plane.
fn mirror(origin: DVec3, normal: DVec3) -> DAffine3 {
    let flip = |axis: DVec3| axis - 2.0 * normal * normal.dot(axis);
    DAffine3 {
        matrix3: DMat3::from_cols(flip(DVec3::X), flip(DVec3::Y), flip(DVec3::Z)),
        translation: 2.0 * normal * normal.dot(origin),
    }
}

/// Candidates for the chain between `far` and `to`: one at most.
pub(super) fn solve(bounces: &[Bounce], eta: &[f64], far: &Far, to: DVec3) -> Option<Points> {
    // all positions are from the sensor's end, and planes in the order from there
    let (mut image, mut back) = (DAffine3::IDENTITY, DAffine3::IDENTITY);
    let mut planes: ArrayVec<Unfolded, MAX_CHAIN> = ArrayVec::new();
    for bounce in bounces.iter().rev() {
        let Surface::Plane { origin, normal } = bounce.surface else {
            return None;
        };
        let origin = image.transform_point3(origin - to);
        let normal = image.transform_vector3(normal);
        planes.push(Unfolded {
            origin,
            normal,
            back,
        });
        if !bounce.transmits {
            let mirror = mirror(origin, normal);
            (image, back) = (mirror * image, back * mirror);
        }
    }
    let far = match *far {
        Far::Point(x) => Far::Point(image.transform_point3(x - to)),
        Far::Direction(w) => Far::Direction(image.transform_vector3(w)),
    };
    let bend = bounces.iter().rposition(|b| b.transmits);
    let bent = match bend {
        Some(i) => {
            let plane = &planes[bounces.len() - 1 - i];
            Some(refraction(plane, [eta[i], eta[i + 1]], &far)?)
        }
        None => None,
    };
    let mut points = Points::new();
    let mut start = DVec3::ZERO;
    let mut end = bent.map_or(far, Far::Point);
    for (plane, bounce) in planes.iter().zip(bounces.iter().rev()) {
        let p = match bent {
            Some(p) if bounce.transmits => {
                (start, end) = (p, far);
                p
            }
            _ => crossing(plane, start, &end)?,
        };
        points.push(plane.back.transform_point3(p) + to);
    }
    points.reverse();
    Some(points)
}

/// Where the straight way from `start` to an end crosses a plane.
fn crossing(plane: &Unfolded, start: DVec3, end: &Far) -> Option<DVec3> {
    let (d, most) = match *end {
        Far::Point(x) => (x - start, 1.0),
        Far::Direction(w) => (w, f64::INFINITY),
    };
    let t = (plane.origin - start).dot(plane.normal) / d.dot(plane.normal);
    (t > 0.0 && t < most).then(|| {
        let p = start + d * t;
        p - plane.normal * (p - plane.origin).dot(plane.normal)
    })
}

/// The point of a plane where light from an end is refracted to the origin; the indices on the
/// sides of light and sensor.
fn refraction(plane: &Unfolded, [of_light, of_sensor]: [f64; 2], far: &Far) -> Option<DVec3> {
    let n = plane.normal;
    let foot = n * plane.origin.dot(n);
    let height = foot.length();
    match *far {
        Far::Point(x) => {
            let above = (x - plane.origin).dot(n);
            let (apart, far_height) = (x - n * above - foot, above.abs());
            let width = apart.length();
            if width == 0.0 {
                return Some(foot);
            }
            // what a segment carries along the plane, and the derivative
            let carried = |eta: f64, across: f64, height: f64| {
                let length = across.hypot(height);
                let sine = across / length;
                let cosine = height / length;
                (eta * sine, eta * cosine * cosine / length)
            };
            let f = |across: f64| {
                let (near, beyond) = (
                    carried(of_sensor, across, height),
                    carried(of_light, width - across, far_height),
                );
                (near.0 - beyond.0, near.1 + beyond.1)
            };
            let across = root(f, 0.0, width)?;
            Some(foot + apart * (across / width))
        }
        Far::Direction(w) => {
            let along = w.reject_from_normalized(n);
            let sine = along.length() * of_light / of_sensor;
            if sine >= 1.0 {
                return None;
            }
            // the sine over the index is the part of the direction along the plane
            let slope = of_light / of_sensor / ((1.0 - sine) * (1.0 + sine)).sqrt();
            Some(foot + along * (height * slope))
        }
    }
}
