//! Which solids a point is inside of, found by counting the surfaces that rays to infinity cross.

use super::Object;
use super::crossing::{faces_at, stands_alone};
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
    let sight = |direction: DVec3| {
        let ray = Ray::leaving(p, frame.to_outer(direction.normalize()), start);
        sight(geometry, objects, ray, ambient)
    };
    let [first, second, third] = DIRECTIONS.map(sight);
    let sights = [first?, second?, third?];
    let outside = sights.iter().find_map(|s| s.outside).unwrap_or(ambient);
    let stack = |sight: &Sight| {
        let agrees = sight.outside.is_none_or(|seen| seen == outside);
        agrees.then(|| sight.stack(objects, outside)).flatten()
    };
    let found = stack(&sights[0])?;
    sights[1..]
        .iter()
        .all(|sight| stack(sight).as_ref() == Some(&found))
        .then_some(found)
}

/// Surroundings of its origin as a ray sees them.
struct Sight {
    /// Solids, and how often more they are left than entered.
    left: Vec<(usize, i32)>,
    /// Medium around all solids; `None` where something opaque stands before all that tells.
    outside: Option<MediumId>,
}

impl Sight {
    /// The solids that are left more often than entered, in a medium.
    fn stack(&self, objects: &[Object], outside: MediumId) -> Option<MediumStack> {
        let mut stack = MediumStack::new(outside);
        for &(index, count) in &self.left {
            let id = InstanceId(index as u32);
            match count {
                0 => {}
                1 => stack = stack.crossed(objects[index].boundary, id, true)?,
                _ => return None,
            }
        }
        Some(stack)
    }
}

/// Whether a surface bounds no medium and ends what can be said about media: another one may be
/// behind it, as behind the edge of a lens.
fn hides(object: &Object) -> bool {
    object.boundary == Boundary::None && object.sensor.is_none() && stands_alone(object)
}

/// Follows a ray to infinity.
fn sight(geometry: &AccelAt, objects: &[Object], mut ray: Ray, ambient: MediumId) -> Option<Sight> {
    let mut left: Vec<(usize, i32)> = Vec::new();
    let (mut outside, mut is_hidden) = (None, false);
    for _ in 0..MOST_CROSSINGS {
        let tells = outside.is_none() && !is_hidden;
        let is_met = |id: InstanceId| {
            let object = &objects[id.0 as usize];
            object.boundary != Boundary::None || tells && hides(object)
        };
        let Some(hit) = geometry.closest(&ray, is_met) else {
            let outside = outside.or((!is_hidden).then_some(ambient));
            return Some(Sight { left, outside });
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
            if tells {
                outside = Some(*near);
            }
        } else if hides(&objects[point.id.instance.0 as usize]) {
            is_hidden = true;
        }
        ray = Ray::leaving(point.p, ray.d, Some(point.id));
    }
    None
}
