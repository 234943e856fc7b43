//! Chains of smooth surfaces that can be solved for: which there are in a scene.
//!
//! A chain runs from the light to the sensor and names each surface, whether it reflects or
//! transmits, and the media on both sides of it. Listed are single mirrors and interfaces, balls
//! crossed in one or two chords, reflections around the inside of a mirror, lenses of few surfaces,
//! meshes with interpolated normals, and flat faces in a row: those of boxes, quads and disks, and
//! the facets of meshes.

mod closed;
mod face;
mod names;

use super::Scene;
use crate::geometry::{Facets, InstanceId, Mesh, Placements, Shape, SurfaceId};
use crate::medium::{Medium, MediumId};
use crate::spectrum::ior::LINE_D_NM;
use arrayvec::ArrayVec;
use face::{Face, FaceShape, Sample, facet_samples, mesh_samples, samples};
use std::collections::HashMap;
use std::sync::Arc;

pub use names::UnknownChain;

/// Most specular vertices of a chain.
pub const MAX_CHAIN: usize = 4;
/// Most kinds of chains listed.
pub const MOST_KINDS: usize = 4096;
/// Most groups of lens surfaces.
const MOST_GROUPS: usize = 2;
/// Most faces looked at, and most of one mesh.
const MOST_FACES: usize = 256;
const MOST_FACETS: usize = 64;

/// A specular vertex of a kind of chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChainLink {
    /// The face; of a mesh, the triangle that stands for a facet.
    pub id: SurfaceId,
    /// Transmits; else reflects.
    pub transmits: bool,
    /// The segment on the light side is on the side that the normal points to.
    pub from_above: bool,
    /// The media above and below the normal.
    pub media: [MediumId; 2],
}

impl ChainLink {
    /// Medium of the segment on the light side.
    #[must_use]
    pub fn before(&self) -> MediumId {
        self.media[usize::from(!self.from_above)]
    }

    /// Medium of the segment on the sensor side.
    #[must_use]
    pub fn after(&self) -> MediumId {
        self.media[usize::from(self.from_above == self.transmits)]
    }
}

/// A kind of chain, from the light to the sensor.
pub type ChainKind = ArrayVec<ChainLink, MAX_CHAIN>;

/// The kinds of chains of a scene.
#[derive(Clone, Debug, Default)]
pub struct Chains {
    kinds: Vec<ChainKind>,
    /// (hash, kind), sorted.
    index: Vec<(u64, u32)>,
    left_out: usize,
    /// Facets of meshes, by instance.
    facets: Vec<(InstanceId, Arc<Facets>)>,
    /// Instances of meshes that are one smooth face.
    smooth: Vec<InstanceId>,
    /// See [`Self::length_listed`].
    length_listed: usize,
}

impl Chains {
    /// All chains of a scene that can be solved for.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let mut placements = Placements::default();
        let opening = scene.sensors.first().map_or(0.0, |s| s.shutter.open_s);
        let geometry = scene.at(opening, &mut placements).geometry;
        let mut faces = Vec::new();
        let mut facets: Vec<(InstanceId, Arc<Facets>)> = Vec::new();
        let mut smooth = Vec::new();
        let mut known: HashMap<*const Mesh, Option<Arc<Facets>>> = HashMap::new();
        for (i, instance) in scene.accel.instances().iter().enumerate() {
            let object = &scene.objects[i];
            let is_mirror_or_glass = object.light.is_none() && object.sensor.is_none();
            if !is_mirror_or_glass || object.has_alpha {
                continue;
            }
            let Some(labels) = scene.material(object.material).smooth_labels() else {
                continue;
            };
            let placement = instance.transform.at(geometry.moment());
            let of = InstanceId(i as u32);
            let mut add = |prim: u32, samples: &[Sample], is_smooth: bool| {
                let id = SurfaceId { instance: of, prim };
                let samples = (samples, is_smooth);
                faces.extend(Face::new(scene, &geometry, id, labels, samples, &placement));
            };
            match &instance.shape {
                Shape::Mesh(mesh) => {
                    let of_mesh = || Facets::of(mesh, MOST_FACETS).map(Arc::new);
                    let found = known.entry(Arc::as_ptr(mesh)).or_insert_with(of_mesh);
                    if let Some(found) = found {
                        for triangles in found.all() {
                            add(triangles[0], &facet_samples(mesh, triangles), false);
                        }
                        facets.push((of, Arc::clone(found)));
                    } else if mesh.vertex_normals(0).is_some() {
                        add(0, &mesh_samples(mesh), true);
                        smooth.push(of);
                    }
                }
                Shape::Box => {
                    (0..6).for_each(|prim| add(prim, &samples(&instance.shape, prim), false));
                }
                shape => add(0, &samples(shape, 0), false),
            }
            if faces.len() >= MOST_FACES {
                break;
            }
        }
        let mut chains = Self {
            facets,
            smooth,
            ..Self::default()
        };
        chains.singles(&faces);
        chains.balls(&faces);
        chains.around(&faces);
        chains.lenses(&faces);
        let flat: Vec<&Face> = faces
            .iter()
            .filter(|f| f.shape == FaceShape::Flat)
            .collect();
        for length in 2..=MAX_CHAIN {
            chains.rows(&flat, &scene.media, length, &mut ChainKind::new(), None);
        }
        chains.index_kinds();
        chains.length_listed = closed::length_listed(&chains, scene, &faces);
        chains
    }

    fn index_kinds(&mut self) {
        self.index = (0u32..)
            .zip(&self.kinds)
            .map(|(i, k)| (hash(k), i))
            .collect();
        self.index.sort_unstable();
    }

    fn push(&mut self, kind: ChainKind) {
        if self.kinds.len() < MOST_KINDS {
            self.kinds.push(kind);
        } else {
            self.left_out += 1;
        }
    }

    fn singles(&mut self, faces: &[Face]) {
        for face in faces.iter().filter(|f| f.shape != FaceShape::Lens) {
            for link in face.links(false) {
                self.push(ChainKind::from_iter([link]));
            }
            if face.shape != FaceShape::Tube {
                for link in face.links(true) {
                    self.push(ChainKind::from_iter([link]));
                }
            }
        }
    }

    /// Through a ball, with a reflection inside at most; through a smooth mesh once, or twice where
    /// it is hollow: of inner reflections shooting finds few.
    fn balls(&mut self, faces: &[Face]) {
        let is_solid = |f: &&Face| matches!(f.shape, FaceShape::Ball | FaceShape::Smooth);
        for face in faces.iter().filter(is_solid) {
            for enter in face.links(true).filter(|l| l.from_above) {
                for leave in face.links(true).filter(|l| !l.from_above) {
                    if enter.after() != leave.before() || enter.before() != leave.after() {
                        continue;
                    }
                    self.push(ChainKind::from_iter([enter, leave]));
                    if face.shape == FaceShape::Smooth {
                        if leave.after() == enter.before() {
                            self.push(ChainKind::from_iter([enter, leave, enter, leave]));
                        }
                        continue;
                    }
                    let inner = |l: &ChainLink| !l.from_above && l.before() == enter.after();
                    for turn in face.links(false).filter(inner) {
                        self.push(ChainKind::from_iter([enter, turn, leave]));
                    }
                }
            }
        }
    }

    /// Several reflections inside round mirrors.
    fn around(&mut self, faces: &[Face]) {
        let is_round =
            |f: &&Face| matches!(f.shape, FaceShape::Ball | FaceShape::Tube) && !f.transmits;
        for face in faces.iter().filter(is_round) {
            for inside in face.links(false).filter(|l| !l.from_above) {
                for count in 2..=MAX_CHAIN {
                    self.push(std::iter::repeat_n(inside, count).collect());
                }
            }
        }
    }

    /// Straight through lenses, from air to air in either direction: through a group of surfaces
    /// with glass between them, and through two. Of more, each alone joins nothing that is not
    /// between them.
    fn lenses(&mut self, faces: &[Face]) {
        let surfaces: Vec<&Face> = (faces.iter())
            .filter(|f| f.shape == FaceShape::Lens && f.transmits)
            .collect();
        let is_outside = |medium: MediumId| medium == MediumId::AMBIENT;
        let is_outer = |f: &&&Face| f.media.iter().flatten().any(|&m| is_outside(m));
        if surfaces.iter().filter(is_outer).count() > 2 * MOST_GROUPS {
            return;
        }
        for first in 0..surfaces.len() {
            for last in first + 1..surfaces.len().min(first + MAX_CHAIN) {
                let row = &surfaces[first..=last];
                let mut ways = vec![ChainKind::new()];
                for face in row {
                    let goes_on = |way: &ChainKind, link: &ChainLink| match way.last() {
                        Some(before) => before.after() == link.before(),
                        None => is_outside(link.before()),
                    };
                    ways = (ways.iter())
                        .flat_map(|way| {
                            let on = face.links(true).filter(move |link| goes_on(way, link));
                            on.map(move |link| {
                                let mut longer = way.clone();
                                longer.push(link);
                                longer
                            })
                        })
                        .collect();
                }
                for way in ways {
                    if way.last().is_some_and(|link| is_outside(link.after())) {
                        // back: each link the other way round
                        let back = |link: &ChainLink| ChainLink {
                            from_above: !link.from_above,
                            ..*link
                        };
                        let reverse = way.iter().rev().map(back).collect();
                        self.push(way);
                        self.push(reverse);
                    }
                }
            }
        }
    }

    /// Flat faces in a row. Of reflections those of mirrors, and of two faces those inside glass,
    /// which may be total: outside it sends little back.
    fn rows(
        &mut self,
        faces: &[&Face],
        media: &[Medium],
        length: usize,
        so_far: &mut ChainKind,
        last: Option<&Face>,
    ) {
        if so_far.len() == length {
            self.push(so_far.clone());
            return;
        }
        if self.left_out > MOST_KINDS {
            return;
        }
        for face in faces {
            for link in face.links(true).chain(face.links(false)) {
                let is_of_glass = !link.transmits && face.transmits;
                if is_of_glass && (length > 2 || !can_be_total(media, &link)) {
                    continue;
                }
                if let (Some(before), Some(from)) = (so_far.last(), last)
                    && !from.leads_to(before, face, &link)
                {
                    continue;
                }
                so_far.push(link);
                self.rows(faces, media, length, so_far, Some(face));
                so_far.pop();
            }
        }
    }

    /// The kinds, by index.
    #[must_use]
    pub fn kinds(&self) -> &[ChainKind] {
        &self.kinds
    }

    /// Number of specular vertices in a row up to which every chain is known to be listed, by
    /// solvers that find all; `usize::MAX` where there are no longer ones.
    #[must_use]
    pub fn length_listed(&self) -> usize {
        self.length_listed
    }

    /// Kinds that found no place in the list; a lower bound.
    #[must_use]
    pub fn left_out(&self) -> usize {
        self.left_out
    }

    /// The face that stands for another one in links: of a mesh, that of its facet.
    #[must_use]
    pub fn face(&self, id: SurfaceId) -> SurfaceId {
        match self.facets(id.instance) {
            Some(facets) => SurfaceId {
                prim: facets.first(id.prim),
                ..id
            },
            None if self.smooth.binary_search(&id.instance).is_ok() => SurfaceId { prim: 0, ..id },
            None => id,
        }
    }

    /// The facets of an instance of a mesh, where it has few.
    #[must_use]
    pub fn facets(&self, instance: InstanceId) -> Option<&Facets> {
        let found = self.facets.binary_search_by_key(&instance, |of| of.0);
        found.ok().map(|i| &*self.facets[i].1)
    }

    /// Index of the kind that these links are; `None` where it is not listed.
    #[must_use]
    pub fn find(&self, links: &[ChainLink]) -> Option<usize> {
        let key = hash(links);
        let first = self.index.partition_point(|e| e.0 < key);
        self.index[first..]
            .iter()
            .take_while(|e| e.0 == key)
            .map(|e| e.1 as usize)
            .find(|&kind| self.kinds[kind].as_slice() == links)
    }
}

/// Whether a reflection is on the side of the larger index.
fn can_be_total(media: &[Medium], link: &ChainLink) -> bool {
    let [n_above, n_below] = link.media.map(|m| media[m.0 as usize].ior.n(LINE_D_NM));
    if link.from_above {
        n_above > n_below
    } else {
        n_below > n_above
    }
}

fn hash(links: &[ChainLink]) -> u64 {
    use crate::math::hash::combine;
    links.iter().fold(links.len() as u64, |h, link| {
        let face = u64::from(link.id.instance.0) << 32 | u64::from(link.id.prim);
        let labels = u64::from(link.transmits) | u64::from(link.from_above) << 1;
        combine(combine(h, face), labels)
    })
}
