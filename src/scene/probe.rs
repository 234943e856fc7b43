//! Which solids a point is inside of, found by counting the surfaces that rays to infinity cross.

use super::Object;
use super::crossing::faces_at;
use crate::geometry::{AccelAt, InstanceId, Ray, SurfaceId};
use crate::math::frame::Frame;
use crate::medium::{Boundary, MediumId, MediumStack};
use glam::DVec3;

/// No scene has this many surfaces on one line; a ray that meets more is caught in a degenerate
/// mesh.
const MOST_CROSSINGS: usize = 100_000;

/// Directions about +z, chosen away from the axes of modelled scenes.
const DIRECTIONS: [DVec3; 3] = [
    DVec3::new(0.137_51, 0.241_73, 0.960_55),
    DVec3::new(-0.372_19, 0.118_37, 0.920_58),
    DVec3::new(0.214_83, -0.431_27, 0.876_28),
];

/// The stack at `p`, on the side of `normal` where `p` lies on the surface `start`. `None` where
/// three rays disagree: a solid is open there, or a surface cuts through.
#[must_use]
pub fn stack_at(
    geometry: &AccelAt,
    objects: &[Object],
    p: DVec3,
    normal: DVec3,
    start: Option<SurfaceId>,
    ambient: MediumId,
) -> Option<MediumStack> {
    let frame = Frame::from_z(if normal == DVec3::ZERO {
        DVec3::Z
    } else {
        normal
    });
    let mut found: Option<MediumStack> = None;
    for direction in DIRECTIONS {
        let stack = along(
            geometry,
            objects,
            Ray::leaving(p, frame.to_outer(direction.normalize()), start),
            ambient,
        )?;
        if found.as_ref().is_some_and(|first| *first != stack) {
            return None;
        }
        found = Some(stack);
    }
    found
}

/// The stack at the origin of one ray: the solids it leaves more often than it enters.
fn along(
    geometry: &AccelAt,
    objects: &[Object],
    mut ray: Ray,
    ambient: MediumId,
) -> Option<MediumStack> {
    let mut left: Vec<(usize, i32)> = Vec::new();
    let mut outside = None;
    for _ in 0..MOST_CROSSINGS {
        let Some(hit) =
            geometry.closest(&ray, |id| objects[id.0 as usize].boundary != Boundary::None)
        else {
            let mut stack = MediumStack::new(outside.unwrap_or(ambient));
            for (index, count) in left {
                let id = InstanceId(index as u32);
                match count {
                    0 => {}
                    1 => stack = stack.crossed(objects[index].boundary, id, true)?,
                    _ => return None,
                }
            }
            return Some(stack);
        };
        let point = geometry.surface(&ray, &hit);
        // media on this side and on the other of the interfaces in this place
        let mut named: Vec<[MediumId; 2]> = Vec::new();
        for face in faces_at(geometry, objects, &point) {
            let index = face.point.id.instance.0 as usize;
            let leaving = ray.d.dot(face.point.ng) > 0.0;
            match objects[index].boundary {
                Boundary::Solid { .. } if !face.folded => {
                    let change = if leaving { 1 } else { -1 };
                    match left.iter_mut().find(|entry| entry.0 == index) {
                        Some(entry) => entry.1 += change,
                        None => left.push((index, change)),
                    }
                }
                Boundary::Interface { above, below } if !face.folded => {
                    named.push(if leaving {
                        [below, above]
                    } else {
                        [above, below]
                    });
                }
                _ => {}
            }
        }
        // of several, the first on the way is behind none of the others
        let is_first = |[near, _]: &&[MediumId; 2]| !named.iter().any(|other| other[1] == *near);
        if let Some([near, _]) = named.iter().find(is_first).or(named.first()) {
            outside.get_or_insert(*near);
        }
        ray = Ray::leaving(point.p, ray.d, Some(point.id));
    }
    None
}
