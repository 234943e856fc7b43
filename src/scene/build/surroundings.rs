//! Solids put right, and what each surface has around it: what touches it, and which segments it
//! stops.

use super::{BuildError, Builder, Subject};
use crate::geometry::contact::{TooManyContacts, add_region, contacts, crowd, overlaps};
use crate::geometry::{Accel, Contact, InstanceId, Mesh, Shape};
use crate::medium::{Boundary, MediumId};
use crate::scene::crossing::stands_alone;
use crate::scene::description::ObjectDescription;
use crate::scene::{Object, Passage};
use std::collections::HashMap;
use std::sync::Arc;

impl Builder {
    /// Turns the mesh of a solid that is wound inwards; `turned` remembers those that were.
    pub(super) fn turn_outward(
        &mut self,
        index: usize,
        object: &mut ObjectDescription,
        turned: &mut HashMap<*const Mesh, Arc<Mesh>>,
    ) -> Result<(), BuildError> {
        match &mut object.shape {
            Shape::Mesh(mesh) if mesh.signed_volume() < 0.0 => {
                let new = turned
                    .entry(Arc::as_ptr(mesh))
                    .or_insert_with(|| Arc::new(mesh.turned()));
                *mesh = Arc::clone(new);
                self.notes.push(format!(
                    "object \"{}\": its mesh is inside out (triangles run clockwise seen from \
                     outside), and is turned",
                    object.name
                ));
            }
            Shape::Deforming(mesh) if mesh.signed_volume() < 0.0 => {
                return Err(BuildError::InsideOut {
                    subject: Subject::Object(index),
                    name: object.name.clone(),
                });
            }
            _ => {}
        }
        Ok(())
    }

    /// Pairs of instances whose bounds have something in common.
    pub(super) fn overlaps(&self) -> Result<Vec<[InstanceId; 2]>, BuildError> {
        overlaps(&self.instances).map_err(|too_many| self.too_many(too_many))
    }

    fn too_many(&self, TooManyContacts(pair): TooManyContacts) -> BuildError {
        let (subject, name, other) = self.named(pair);
        BuildError::TooManyContacts {
            subject,
            name,
            other,
        }
    }

    /// Surroundings of each object: surfaces that touch it, and solids that decide about segments.
    /// The contacts.
    pub(super) fn surroundings(
        &mut self,
        accel: &Accel,
        overlaps: &[[InstanceId; 2]],
    ) -> Result<Vec<Contact>, BuildError> {
        let contacts = contacts(accel, overlaps).map_err(|too_many| self.too_many(too_many))?;
        for contact in &contacts {
            let [first, second] = contact.pair.map(|id| &self.objects[id.0 as usize]);
            let hides = |o: &Object| o.sensor.is_some() && !o.transparent_sensor;
            if contact.certain && hides(first) && hides(second) {
                return Err(BuildError::SensorsTouch {
                    subject: Subject::Sensor(first.sensor.unwrap_or_default()),
                    name: first.name.clone(),
                    other: second.name.clone(),
                });
            }
            for id in contact.pair {
                for region in &contact.regions {
                    add_region(&mut self.objects[id.0 as usize].contacts, *region);
                }
            }
        }
        if let Some(pair) = crowd(accel, &contacts) {
            let (subject, name, other) = self.named(pair);
            return Err(BuildError::Crowd {
                subject,
                name,
                other,
            });
        }
        let mut among_solids = vec![false; self.objects.len()];
        for pair in overlaps {
            let [a, b] = pair.map(|id| id.0 as usize);
            let separates = |i: usize| self.objects[i].boundary != Boundary::None;
            if separates(a) && separates(b) {
                among_solids[a] = true;
                among_solids[b] = true;
            }
        }
        for (object, among_solids) in self.objects.iter_mut().zip(among_solids) {
            object.passage = passage(object, among_solids, self.ambient);
            object.is_passed = object.transparent_sensor && object.contacts.is_empty();
        }
        Ok(contacts)
    }

    /// The first of two instances as a subject with its name, and the name of the other.
    fn named(&self, pair: [InstanceId; 2]) -> (Subject, String, String) {
        let [name, other] = pair.map(|id| self.objects[id.0 as usize].name.clone());
        let first = pair[0].0 as usize;
        let subject = match self.objects[first].sensor {
            Some(sensor) => Subject::Sensor(sensor),
            None => Subject::Object(first),
        };
        (subject, name, other)
    }
}

/// Effect of the faces of an object on segments. By itself, without other solids around, a boundary
/// always changes the medium, or never.
fn passage(object: &Object, among_solids: bool, ambient: MediumId) -> Passage {
    if object.transparent_sensor || object.has_alpha {
        return Passage::Free;
    }
    let changes = match object.boundary {
        Boundary::None => true,
        Boundary::Solid { medium, .. } => medium != ambient,
        Boundary::Interface { above, below } => above != below,
    };
    if stands_alone(object) {
        Passage::Blocked
    } else if among_solids {
        Passage::Depends
    } else if object.clear && !changes {
        Passage::Free
    } else {
        Passage::Blocked
    }
}
