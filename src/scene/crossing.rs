//! Crossings: surfaces in the same place are met as one.
//!
//! All faces in one place (see [`AccelAt::coincident`]) are one crossing. Its media are those
//! before all of it and those after all of it. Where a surface in it scatters or absorbs by itself
//! (it separates no media, or it emits or senses), that is what is met, under the medium in front
//! of all of it; of several, the last in the scene. Else it is one interface between the two media,
//! with the material of the last object in the scene whose own medium is on one of its sides.
//!
//! Invariant: whatever asks what is at a place asks here: walks, segments, ends of paths, the media
//! of lights and sensors.

use super::{Object, Passage, SceneAt};
use crate::geometry::{AccelAt, EndPoint, Face, Faces, InstanceId, Ray, SurfacePoint};
use crate::medium::{Boundary, MediumStack, Rank};
use glam::DVec3;

/// Encounter of a ray that crosses all faces in a place.
#[derive(Clone, Debug)]
pub struct Crossing {
    /// Which of the faces is met.
    pub met: usize,
    /// The solids behind all of it, where its faces are boundaries of any.
    pub behind: Option<MediumStack>,
    /// Whether it is no more than a change of solids, without a change of the medium.
    pub clear: bool,
    /// A solid that is left but was never entered (or the reverse), or an interface whose named
    /// medium is not the one around.
    pub mismatch: Option<InstanceId>,
}

/// More solids are nested than a stack holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NestedTooDeep;

/// Obstacles on the way of a segment.
enum Way {
    /// Something that lets no light pass.
    Blocked,
    /// Nothing.
    Open,
    /// Surfaces that cover themselves partly and, with `media`, such as may change the medium.
    Crosses { media: bool },
}

/// All faces in the place of `point`, its own among them, in the order of the scene.
#[must_use]
#[inline]
pub fn faces_at(geometry: &AccelAt, objects: &[Object], point: &SurfacePoint) -> Faces {
    let object = &objects[point.id.instance.0 as usize];
    if object.may_touch(point.p) {
        return geometry.coincident(point);
    }
    let mut faces = Faces::new();
    faces.push(Face {
        point: *point,
        folded: false,
    });
    faces
}

/// Whether a surface scatters, absorbs, emits or senses by itself, and not as the boundary of a
/// medium.
pub(super) fn stands_alone(object: &Object) -> bool {
    !object.is_interface || object.light.is_some()
}

/// Which of the faces in one place is met, where that does not depend on the media: the last that
/// stands alone.
#[must_use]
pub fn alone(objects: &[Object], faces: &[Face]) -> Option<usize> {
    faces
        .iter()
        .rposition(|f| stands_alone(&objects[f.point.id.instance.0 as usize]))
}

/// Encounter where a ray along `d`, in the solids of `stack`, comes to the `faces` in one place (at
/// least one).
///
/// # Errors
/// Where more solids are nested behind than a stack holds.
#[inline]
pub fn resolve(
    objects: &[Object],
    faces: &[Face],
    stack: &MediumStack,
    d: DVec3,
) -> Result<Crossing, NestedTooDeep> {
    if let [face] = faces {
        return resolve_alone(objects, face, stack, d);
    }
    let id = |i: usize| faces[i].point.id.instance;
    let boundary = |i: usize| objects[id(i).0 as usize].boundary;
    let entering = |i: usize| d.dot(faces[i].point.ng) < 0.0;
    let mut behind = *stack;
    let mut mismatch = None;
    // interfaces follow one another by the media they name, whatever their order in the scene
    let mut left: u32 = 0;
    for (i, face) in faces.iter().enumerate() {
        if !face.folded && boundary(i) != Boundary::None {
            left |= 1 << i;
        }
    }
    while left != 0 {
        let pending = || (0..faces.len()).filter(|i| left & 1 << i != 0);
        let agrees = |&i: &usize| behind.agrees(boundary(i), id(i), entering(i));
        let i = match pending().find(agrees) {
            Some(i) => i,
            None => {
                let i = left.trailing_zeros() as usize;
                mismatch = mismatch.or(Some(id(i)));
                i
            }
        };
        left &= !(1 << i);
        behind = behind
            .crossed(boundary(i), id(i), entering(i))
            .ok_or(NestedTooDeep)?;
    }
    let takes_part = |i: usize| match boundary(i) {
        Boundary::None => true,
        Boundary::Solid { priority, .. } => {
            let solid = id(i);
            let inner = if entering(i) { &behind } else { stack };
            !faces[i].folded && inner.rank() == Some(Rank { priority, solid })
        }
        Boundary::Interface { .. } => stack.rank().is_none() || behind.rank().is_none(),
    };
    let last = faces.len() - 1;
    let (met, is_alone) = match alone(objects, faces) {
        Some(i) => (i, true),
        None => ((0..=last).rfind(|&i| takes_part(i)).unwrap_or(last), false),
    };
    Ok(Crossing {
        clear: !is_alone && objects[id(met).0 as usize].clear && behind.medium() == stack.medium(),
        met,
        behind: Some(behind),
        mismatch,
    })
}

/// The same for a face that has its place for itself.
fn resolve_alone(
    objects: &[Object],
    face: &Face,
    stack: &MediumStack,
    d: DVec3,
) -> Result<Crossing, NestedTooDeep> {
    if face.folded {
        return Ok(Crossing {
            met: 0,
            clear: objects[face.point.id.instance.0 as usize].clear,
            behind: None,
            mismatch: None,
        });
    }
    let mut behind = *stack;
    let alone = cross_alone(objects, &face.point, d, &mut behind)?;
    Ok(Crossing {
        met: 0,
        clear: alone.clear && (!alone.changes || behind.medium() == stack.medium()),
        behind: alone.changes.then_some(behind),
        mismatch: alone.mismatch,
    })
}

/// Encounter with a face that has its place for itself.
#[derive(Clone, Copy, Debug)]
pub struct Alone {
    /// The solids behind it may be others: [`Crossing::behind`].
    pub changes: bool,
    /// A material that lets light pass straight on where the medium is the same.
    pub clear: bool,
    /// See [`Crossing::mismatch`].
    pub mismatch: Option<InstanceId>,
}

/// Takes a stack to the far side of a point of a face that has its place for itself and is not
/// folded.
///
/// # Errors
/// As [`resolve`].
#[inline(always)]
pub fn cross_alone(
    objects: &[Object],
    point: &SurfacePoint,
    d: DVec3,
    stack: &mut MediumStack,
) -> Result<Alone, NestedTooDeep> {
    let id = point.id.instance;
    let object = &objects[id.0 as usize];
    let (boundary, clear) = (object.boundary, object.clear);
    let changes = boundary != Boundary::None;
    let mut mismatch = None;
    if changes {
        let entering = d.dot(point.ng) < 0.0;
        mismatch = (!stack.agrees(boundary, id, entering)).then_some(id);
        if !stack.cross(boundary, id, entering) {
            return Err(NestedTooDeep);
        }
    }
    Ok(Alone {
        changes,
        clear,
        mismatch,
    })
}

impl SceneAt<'_> {
    /// All faces in the place of `point`, its own among them, in the order of the scene.
    #[must_use]
    #[inline]
    pub fn faces_at(&self, point: &SurfacePoint) -> Faces {
        faces_at(&self.geometry, &self.objects, point)
    }

    /// The certainty that a surface is all there is at a point, and is there: nothing touches it,
    /// it covers all of itself, and does not let light pass to measure it.
    #[must_use]
    #[inline]
    pub fn is_simple(&self, point: &SurfacePoint) -> bool {
        let object = self.object(point.id.instance);
        !object.has_alpha && !object.transparent_sensor && !object.may_touch(point.p)
    }

    /// The share of the light at an end of paths on a surface that is not taken by what else is in
    /// the same place and comes later in the scene: 1 where nothing touches it.
    #[must_use]
    pub fn exposure(&self, end: &EndPoint) -> f64 {
        let Some(surface) = end.surface else {
            return 1.0;
        };
        let instance = surface.instance;
        let object = self.object(instance);
        if object.contacts.is_empty() || object.transparent_sensor {
            return 1.0;
        }
        let Some(point) = end.surface_point() else {
            return 1.0;
        };
        let faces = self.faces_at(&point);
        let later = faces.iter().filter(|f| f.point.id.instance > instance);
        let open = later.map(|face| {
            let object = self.object(face.point.id.instance);
            if object.has_alpha {
                1.0 - self.coverage(&face.point)
            } else if stands_alone(object) && !object.transparent_sensor {
                0.0
            } else {
                1.0
            }
        });
        open.product()
    }

    /// Transmittance of a segment that starts in the solids of `stack` and on whose way the medium
    /// must not change: 0 if something is in the way, in between where surfaces cover it partly.
    #[must_use]
    #[inline]
    pub fn visibility(&self, ray: &Ray, stack: &MediumStack) -> f64 {
        match self.way(ray) {
            Way::Blocked => 0.0,
            Way::Open => 1.0,
            Way::Crosses { media } => self.carried(ray, stack, media).0,
        }
    }

    /// The same, and the solids in which the segment ends.
    #[must_use]
    pub fn carry(&self, ray: &Ray, stack: &MediumStack) -> (f64, MediumStack) {
        match self.way(ray) {
            Way::Blocked => (0.0, *stack),
            Way::Open => (1.0, *stack),
            Way::Crosses { media } => self.carried(ray, stack, media),
        }
    }

    /// Obstacles of a segment by one look at all that it meets, in whatever order.
    #[inline]
    fn way(&self, ray: &Ray) -> Way {
        let passage = |id: InstanceId| self.object(id).passage;
        let mut depends = false;
        let blocked = self.geometry.any(
            ray,
            |id| passage(id) != Passage::Free,
            |id| {
                let blocks = passage(id) == Passage::Blocked;
                depends |= !blocks;
                blocks
            },
        );
        if blocked {
            Way::Blocked
        } else if depends || self.has_coverage {
            Way::Crosses { media: depends }
        } else {
            Way::Open
        }
    }

    /// The same, crossing by crossing, where nothing opaque is in the way. Without `media` none is
    /// crossed on it.
    fn carried(&self, ray: &Ray, stack: &MediumStack, media: bool) -> (f64, MediumStack) {
        let (mut ray, mut open, mut stack) = (*ray, 1.0, *stack);
        let is_met = |id: InstanceId| {
            let object = self.object(id);
            object.has_alpha || media && object.passage == Passage::Depends
        };
        while open > 0.0
            && let Some(hit) = self.closest(&ray, is_met)
        {
            let point = self.geometry.surface(&ray, &hit);
            let mut faces = self.faces_at(&point);
            faces.retain(|face| {
                let object = self.object(face.point.id.instance);
                if object.has_alpha {
                    open *= 1.0 - self.coverage(&face.point);
                }
                object.passage == Passage::Depends
            });
            if !faces.is_empty() {
                match resolve(&self.objects, &faces, &stack, ray.d) {
                    Ok(crossing) if crossing.clear => stack = crossing.behind.unwrap_or(stack),
                    _ => return (0.0, stack),
                }
            }
            ray = Ray {
                o: point.p,
                t_max: ray.t_max - hit.t,
                start: Some(point.id),
                ..ray
            };
        }
        (open, stack)
    }
}
