//! The nodes of a scene: who hangs on whom, and where each is over time.
//!
//! A node's place is a chain of maps from the world down. Maps that do not change while the shutter
//! is open are multiplied on the way down; only the animated ones are kept apart.

use super::animation::{AllMoves, keeps_its_size};
use super::{Fault, Reader};
use crate::geometry::pose::{Arcs, Pose, Rotation};
use crate::geometry::track::{Interpolation, Track};
use crate::geometry::{Link, Shutter, Transform};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use gltf::json::scene::Node;

/// Largest coordinate of a placement.
const LARGEST: f64 = 1e30;

/// Most animated nodes above one another.
const MAX_DEPTH: usize = 256;
/// Steps over the shutter at which the motion of a camera or light under a changing or uneven scale
/// is read off.
const STEPS: u32 = 1024;
/// Deviation from a rotation that is rounding of a file's f32.
const ROUNDING: f64 = 1e-5;

/// Where a node is: `still` within the animated node `keyed` (or the world).
#[derive(Clone, Copy, Debug)]
pub struct Place {
    still: DAffine3,
    keyed: Option<usize>,
}

/// An animated node.
#[derive(Debug)]
struct Keyed {
    above: Place,
    pose: Pose,
    /// Animated nodes above.
    depth: usize,
    /// Neither it nor one above is scaled to nothing while the shutter is open.
    has_size: bool,
}

/// All nodes of the scene.
#[derive(Debug)]
pub struct Hierarchy {
    /// Parents before their children, siblings in the order of the file.
    pub order: Vec<usize>,
    places: Vec<Option<Place>>,
    keyed: Vec<Keyed>,
    shutter: Shutter,
}

impl Hierarchy {
    /// The nodes below `roots`, in the world by `to_world`.
    pub fn read(reader: &Reader<'_>, roots: &[usize], moves: &AllMoves) -> Result<Self, Fault> {
        let nodes = &reader.root.nodes;
        let shutter = reader.staging.shutter;
        let mut all = Self {
            order: Vec::new(),
            places: vec![None; nodes.len()],
            keyed: Vec::new(),
            shutter,
        };
        let world = Place {
            still: reader.staging.to_world,
            keyed: None,
        };
        let mut open: Vec<(usize, Place)> = roots.iter().rev().map(|&n| (n, world)).collect();
        while let Some((i, above)) = open.pop() {
            let node = nodes.get(i).ok_or_else(|| Fault::missing("node", i))?;
            if all.places[i].is_some() {
                return Err(Fault::new(format!(
                    "node {i} is reached twice: the hierarchy is no tree"
                )));
            }
            let pose = moves
                .get(&i)
                .map(|m| m.pose(node, i))
                .transpose()?
                .flatten();
            let place = match pose {
                Some(pose) if !shutter.is_instant() && pose.varies(shutter) => {
                    all.add(above, pose, i)?
                }
                pose => {
                    let map = match pose {
                        Some(pose) => pose.at(shutter.open_s, false),
                        None => local(node, i)?,
                    };
                    Place {
                        still: above.still * map,
                        ..above
                    }
                }
            };
            if !finite(&place.still) {
                return Err(Fault::new(format!(
                    "the transform of node {i} is not finite"
                )));
            }
            all.places[i] = Some(place);
            all.order.push(i);
            let children = node.children.iter().flatten().rev();
            open.extend(children.map(|c| (c.value(), place)));
        }
        Ok(all)
    }

    fn add(&mut self, above: Place, pose: Pose, i: usize) -> Result<Place, Fault> {
        let parent = above.keyed.map(|k| &self.keyed[k]);
        let depth = parent.map_or(0, |p| p.depth + 1);
        if depth >= MAX_DEPTH {
            return Err(Fault::new(format!(
                "node {i}: more than {MAX_DEPTH} animated nodes above one another"
            )));
        }
        let has_size = parent.is_none_or(|p| p.has_size) && keeps_its_size(&pose, self.shutter);
        self.keyed.push(Keyed {
            above,
            pose,
            depth,
            has_size,
        });
        Ok(Place {
            still: DAffine3::IDENTITY,
            keyed: Some(self.keyed.len() - 1),
        })
    }

    /// Where a node is; `None` if it is not in the scene.
    pub fn place(&self, node: usize) -> Option<Place> {
        self.places.get(node).copied().flatten()
    }

    /// Number of animated nodes.
    pub fn keyed_count(&self) -> usize {
        self.keyed.len()
    }

    /// The animated nodes at and above a place, the innermost first.
    fn above(&self, place: Place) -> impl Iterator<Item = &Keyed> {
        let first = place.keyed.map(|k| &self.keyed[k]);
        std::iter::successors(first, |k| k.above.keyed.map(|k| &self.keyed[k]))
    }

    /// Keys of all animated nodes at and above a place.
    pub fn times(&self, place: Place) -> Vec<f64> {
        let poses = self.above(place).map(|k| &k.pose);
        poses.flat_map(Pose::times).collect()
    }

    fn links(&self, place: Place) -> Vec<Link> {
        let mut links = vec![Link::Fixed(place.still)];
        for keyed in self.above(place) {
            links.push(Link::Keyed(keyed.pose.clone()));
            links.push(Link::Fixed(keyed.above.still));
        }
        links.reverse();
        links.retain(does_something);
        links
    }

    /// The placement over the shutter; `None` where it is scaled to nothing.
    pub fn transform(&self, place: Place) -> Option<Transform> {
        let invertible = |m: &DAffine3| m.matrix3.determinant().abs() >= f64::MIN_POSITIVE;
        let fixed = self.above(place).all(|k| invertible(&k.above.still));
        let sized = place.keyed.is_none_or(|k| self.keyed[k].has_size);
        if !(invertible(&place.still) && fixed && sized) {
            return None;
        }
        Some(match place.keyed {
            None => Transform::fixed(place.still),
            Some(_) => Transform::chain(&self.links(place), self.shutter),
        })
    }

    /// The motion of a camera or light, which has no size: only moved and turned. `None` if it does
    /// not move.
    pub fn rigid_links(&self, place: Place) -> Option<Vec<Link>> {
        place.keyed?;
        let links = self.links(place);
        let exact: Option<Vec<Link>> = links.iter().map(rigid_link).collect();
        Some(exact.unwrap_or_else(|| vec![Link::Keyed(self.read_off(&links))]))
    }

    /// A chain as one pose keyed at many moments, without scale.
    fn read_off(&self, links: &[Link]) -> Pose {
        let transform = Transform::chain(links, self.shutter);
        let key = |i: u32| {
            let t = self.shutter.at(f64::from(i) / f64::from(STEPS));
            (t, rigid(&transform.at(t).to_world))
        };
        let mut keys: Vec<(f64, DAffine3)> = (0..=STEPS).map(key).collect();
        keys.dedup_by(|b, a| b.0 <= a.0);
        let places: Vec<(f64, DVec3)> = keys.iter().map(|k| (k.0, k.1.translation)).collect();
        let turns: Vec<(f64, DQuat)> = keys
            .iter()
            .map(|k| (k.0, DQuat::from_mat3(&k.1.matrix3)))
            .collect();
        Pose {
            translation: Track::new(&places, Interpolation::Linear).ok(),
            rotation: Arcs::new(&turns, Interpolation::Linear)
                .ok()
                .map(Rotation::Arcs),
            scale: None,
        }
    }

    /// The maps of all animated nodes at a moment; at a step after it, or before it if `before`.
    pub fn poses(&self, time: f64, before: bool) -> Vec<DAffine3> {
        let mut worlds: Vec<DAffine3> = Vec::with_capacity(self.keyed.len());
        for keyed in &self.keyed {
            let above = keyed.above.keyed.map_or(DAffine3::IDENTITY, |k| worlds[k]);
            worlds.push(above * keyed.above.still * keyed.pose.at(time, before));
        }
        worlds
    }

    /// The map of a place at the moment of `poses`.
    pub fn world(&self, place: Place, poses: &[DAffine3]) -> DAffine3 {
        place.keyed.map_or(DAffine3::IDENTITY, |k| poses[k]) * place.still
    }

    /// The map of a place as the shutter opens.
    pub fn opening(&self, place: Place) -> DAffine3 {
        match place.keyed {
            None => place.still,
            Some(_) => self.world(place, &self.poses(self.shutter.open_s, false)),
        }
    }
}

fn does_something(link: &Link) -> bool {
    *link != Link::Fixed(DAffine3::IDENTITY)
}

/// A map that only moves and turns, free of rounding; `None` if it does more.
fn rigid_link(link: &Link) -> Option<Link> {
    match link {
        Link::Fixed(map) => {
            let gram = map.matrix3.transpose() * map.matrix3 - DMat3::IDENTITY;
            let turns = gram.to_cols_array().iter().all(|v| v.abs() <= ROUNDING)
                && map.matrix3.determinant() > 0.0;
            turns.then(|| Link::Fixed(rigid(map)))
        }
        Link::Keyed(pose) => {
            let unscaled = |s: &Track<DVec3>| s.values().iter().all(|v| *v == DVec3::ONE);
            let rigid = pose.scale.as_ref().is_none_or(unscaled)
                && pose
                    .scale
                    .as_ref()
                    .is_none_or(|s| s.interpolation() != Interpolation::Cubic);
            rigid.then(|| {
                Link::Keyed(Pose {
                    scale: None,
                    ..pose.clone()
                })
            })
        }
    }
}

/// The placement of a node in its parent.
fn local(node: &Node, i: usize) -> Result<DAffine3, Fault> {
    let map = match &node.matrix {
        Some(matrix) => DAffine3::from_mat4(DMat4::from_cols_array(&matrix.map(f64::from))),
        None => {
            let vector = |v: Option<[f32; 3]>, default: DVec3| {
                v.map_or(default, |v| DVec3::from(v.map(f64::from)))
            };
            let rotation = node
                .rotation
                .map_or(DQuat::IDENTITY, |r| DQuat::from_array(r.0.map(f64::from)));
            let length = rotation.length();
            if !(length > 0.0 && length.is_finite()) {
                return Err(Fault::new(format!(
                    "the transform of node {i} is not finite"
                )));
            }
            DAffine3::from_scale_rotation_translation(
                vector(node.scale, DVec3::ONE),
                rotation / length,
                vector(node.translation, DVec3::ZERO),
            )
        }
    };
    if finite(&map) {
        Ok(map)
    } else {
        Err(Fault::new(format!(
            "the transform of node {i} is not finite"
        )))
    }
}

fn finite(map: &DAffine3) -> bool {
    map.to_cols_array().iter().all(|v| v.abs() <= LARGEST)
}

/// The nearest rigid motion: cameras do not scale what they see.
pub(super) fn rigid(world: &DAffine3) -> DAffine3 {
    let back = world.matrix3.z_axis.normalize_or(DVec3::Z);
    let up = world.matrix3.y_axis;
    let right = up
        .cross(back)
        .try_normalize()
        .unwrap_or_else(|| back.any_orthonormal_vector());
    DAffine3 {
        matrix3: glam::DMat3::from_cols(right, back.cross(right), back),
        translation: world.translation,
    }
}
