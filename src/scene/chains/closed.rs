//! Whether the list holds every chain there can be, so that no path needs a cone.

use super::face::{Face, FaceShape};
use super::{ChainKind, ChainLink, Chains, MAX_CHAIN};
use crate::geometry::InstanceId;
use crate::scene::Scene;
use std::collections::BTreeSet;

/// Number of specular vertices in a row up to which every chain is listed; `usize::MAX` where there
/// are no longer ones.
///
/// Only flat faces at rest are looked at: of them it is known which others each faces, and their
/// solver misses nothing.
pub(super) fn length_listed(chains: &Chains, scene: &Scene, faces: &[Face]) -> usize {
    let known: BTreeSet<InstanceId> = faces.iter().map(|f| f.id.instance).collect();
    let is_known = |i: usize| {
        known.contains(&InstanceId(i as u32))
            && !scene.accel.instance(InstanceId(i as u32)).is_moving()
    };
    let has_specular = |i: &usize| scene.material(scene.objects[*i].material).has_specular();
    let all_known = (0..scene.objects.len()).filter(has_specular).all(is_known);
    if !all_known || faces.iter().any(|f| f.shape != FaceShape::Flat) || chains.left_out > 0 {
        return 0;
    }
    // the row that is missing is one vertex longer than what is listed
    let longest = (1..=MAX_CHAIN + 1).find_map(|length| {
        let mut row = Row {
            chains,
            faces,
            length,
            links: Vec::new(),
            is_any: false,
        };
        match row.is_listed(None) {
            false => Some(length - 1),
            true if !row.is_any => Some(usize::MAX),
            true => None,
        }
    });
    longest.unwrap_or(MAX_CHAIN)
}

/// Chains of one length, vertex by vertex.
struct Row<'a> {
    chains: &'a Chains,
    faces: &'a [Face],
    length: usize,
    links: Vec<ChainLink>,
    /// There is one of that length.
    is_any: bool,
}

impl<'a> Row<'a> {
    /// Whether all that begin like this are listed.
    fn is_listed(&mut self, last: Option<&'a Face>) -> bool {
        if self.links.len() == self.length {
            self.is_any = true;
            let kind: Option<ChainKind> =
                (self.length <= MAX_CHAIN).then(|| self.links.iter().copied().collect());
            return kind.is_some_and(|kind| self.chains.find(&kind).is_some());
        }
        let faces = self.faces;
        faces.iter().all(|face| {
            let links = face.links(true).chain(face.links(false));
            links.into_iter().all(|link| {
                let follows = match (self.links.last(), last) {
                    (Some(before), Some(from)) => from.leads_to(before, face, &link),
                    _ => true,
                };
                if !follows {
                    return true;
                }
                self.links.push(link);
                let is_listed = self.is_listed(Some(face));
                self.links.pop();
                is_listed
            })
        })
    }
}
