//! Faces in the same place: those that no arithmetic tells apart.
//!
//! Two faces are in the same place where they are nearer to each other, perpendicular to
//! themselves, than the rounding error of a point on them. What is found here at a point is exactly
//! what a ray that leaves it does not hit ([`LocalRay::counts`]): both ask [`transformed_error`]
//! about the same point.

use super::motion::Placement;
use super::ray::LocalRay;
use super::tree_walk::Boxes;
use super::{AccelAt, Hit, InstanceId, Ray, Shape, SurfaceId, SurfacePoint};
use crate::math::predicates::transformed_error;
use arrayvec::ArrayVec;
use glam::{DVec2, DVec3};

/// Most instances told apart in one place.
pub const MOST_FACES: usize = 8;
/// Room for one more: that there are too many is seen by it.
const ROOM: usize = MOST_FACES + 1;

/// A face of one instance in the place asked for.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// The place on this face.
    pub point: SurfacePoint,
    /// The instance has faces of both orientations here: whoever crosses them all stays on the same
    /// side of it.
    pub folded: bool,
}

/// Faces in one place, at most one of each instance, in the order of the instances.
pub type Faces = ArrayVec<Face, ROOM>;

/// Distance in meters, along the unit normal `n`, within which a face of an instance is in the same
/// place as a point whose coordinates do not exceed `magnitude`; `extent` bounds the coordinates of
/// the shape.
#[must_use]
pub(super) fn coincidence_distance(
    placement: &Placement,
    extent: f64,
    magnitude: DVec3,
    n: DVec3,
) -> f64 {
    // the normal, of length 1 in the object's space, seen from the world
    let per_unit = (placement.to_world.matrix3.transpose() * n).length();
    transformed_error(&placement.to_object, magnitude, extent) * per_unit
}

impl AccelAt<'_> {
    /// The faces in the same place as `point`, its own among them. Of more than [`MOST_FACES`] + 1
    /// instances the first are left out.
    #[must_use]
    pub fn coincident(&self, point: &SurfacePoint) -> Faces {
        let mut faces = Faces::new();
        faces.push(Face {
            point: *point,
            folded: false,
        });
        let Some(top) = self.accel().top() else {
            return faces;
        };
        let (p, n) = (point.p, point.ng);
        // boxes are padded by more than this
        let size = p.abs().max_element() + self.accel().radius();
        let reach = 256.0 * f64::EPSILON * size;
        let Some(entry) = top.tree.enter(p - n * reach, n, 2.0 * reach) else {
            return faces;
        };
        let mut met = |id: InstanceId, prim: u32, uv: DVec2| {
            let id = SurfaceId { instance: id, prim };
            if id == point.id {
                return;
            }
            let hit = Hit { t: 0.0, id, uv };
            let found = self.surface(&Ray::new(p, n), &hit);
            let at = faces.partition_point(|f| f.point.id.instance < id.instance);
            match faces.get_mut(at) {
                // neighbors in a mesh that meet here, or two layers of it
                Some(face) if face.point.id.instance == id.instance => {
                    face.folded |= face.point.ng.dot(found.ng) < 0.0;
                }
                _ => {
                    let face = Face {
                        point: found,
                        folded: false,
                    };
                    if faces.is_full() {
                        faces.remove(0);
                        faces.insert(at.saturating_sub(1), face);
                    } else {
                        faces.insert(at, face);
                    }
                }
            }
        };
        top.tree.any(
            &entry,
            |_| (),
            |leaf| {
                let id = InstanceId(top.order[leaf.start as usize]);
                let instance = self.accel().instance(id);
                let shape = &instance.shape;
                let placement = instance.transform.at(self.moment());
                let half = coincidence_distance(&placement, shape.extent(), p.abs(), n);
                let across = Ray::new(p - n * half, n).ending(2.0 * half, None);
                let to_object = &placement.to_object;
                let local = |extent| LocalRay::new(&across, id, to_object, 2.0 * half, extent);
                let time = self.moment().time();
                match shape {
                    Shape::Mesh(mesh) => {
                        mesh.each(&local(mesh.extent()), time, |prim, weights| {
                            met(id, prim, weights);
                        });
                    }
                    Shape::Deforming(mesh) => {
                        mesh.each(&local(mesh.extent()), time, |prim, weights| {
                            met(id, prim, weights);
                        });
                    }
                    _ => {
                        if let Some((_, prim)) = shape.analytic_hit(false, local) {
                            met(id, prim, DVec2::ZERO);
                        }
                    }
                }
                false
            },
        );
        faces
    }
}
