//! Whether the list holds every chain there can be, so that no path needs a cone.

use super::face::{Face, FaceShape};
use super::{ChainKind, ChainLink, Chains, MAX_CHAIN};
use crate::geometry::InstanceId;
use crate::scene::Scene;
use std::collections::BTreeSet;

/// Number of specular vertices in a row up to which every chain is listed; `usize::MAX` where there
/// are no longer ones.
///
/// Only flat faces at rest that touch nothing are looked at: of them it can be told which others no
/// light goes to, and their solver misses nothing. Here a face is as large as the bounds of its
/// object, so that no row is overlooked.
pub(super) fn length_listed(chains: &Chains, scene: &Scene, faces: &[Face]) -> usize {
    let known: BTreeSet<InstanceId> = faces.iter().map(|f| f.id.instance).collect();
    let is_known = |i: usize| {
        let id = InstanceId(i as u32);
        let is_still = !scene.accel.instance(id).is_moving();
        known.contains(&id) && is_still && scene.objects[i].contacts.is_empty()
    };
    let has_specular = |i: &usize| scene.material(scene.objects[*i].material).has_specular();
    let all_known = (0..scene.objects.len()).filter(has_specular).all(is_known);
    let is_flat = |f: &Face| f.shape == FaceShape::Flat && !f.media.is_empty();
    if !all_known || !faces.iter().all(is_flat) || chains.left_out > 0 {
        return 0;
    }
    // the row that is missing is one vertex longer than what is listed
    let longest = (1..=MAX_CHAIN + 1).find_map(|length| {
        let mut row = Row {
            scene,
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
    scene: &'a Scene,
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
                    (Some(before), Some(from)) => self.may_lead_to(from, before, face, &link),
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

    /// Whether light that leaves a face by a link may go straight to another one and meet it by
    /// another.
    fn may_lead_to(&self, from: &Face, by: &ChainLink, to: &Face, link: &ChainLink) -> bool {
        let bounds = |face: &Face| self.scene.accel.instance(face.id.instance).bounds();
        from.id != to.id
            && by.after() == link.before()
            && from.has_before(bounds(to), by.from_above != by.transmits)
            && to.has_before(bounds(from), link.from_above)
    }
}
