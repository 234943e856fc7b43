//! Animations: the samplers that play, as tracks of translation, rotation, scale and weights per
//! node.
//!
//! Of keyed values only those are kept that matter while the shutter is open: the keys within, and
//! one on either side.

use super::{Fault, Reader};
use crate::geometry::Shutter;
use crate::geometry::pose::{Arcs, Pose, Rotation};
use crate::geometry::track::{Interpolation, Track, TrackError};
use glam::{DQuat, DVec3, DVec4};
use gltf::json::animation::{Animation, Interpolation as Source, Property, Sampler};
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Most keys of a sampler.
const MAX_KEYS: usize = 1 << 20;

/// Motion of a node.
#[derive(Debug, Default)]
pub struct Moves {
    translation: Option<Track<DVec3>>,
    rotation: Option<Rotation>,
    scale: Option<Track<DVec3>>,
    /// One per morph target.
    pub weights: Option<Vec<Track<f64>>>,
}

/// Motion of each node, by its index.
pub type AllMoves = BTreeMap<usize, Moves>;

/// The keys of a sampler that matter.
struct Keys {
    /// In seconds of the scene.
    times: Vec<f64>,
    /// Which keys of the file they are.
    range: Range<usize>,
    /// How many the file has.
    count: usize,
    interpolation: Interpolation,
}

/// The values of a sampler at its keys, with the tangents on arriving and on leaving where it is
/// cubic.
struct Values<const N: usize> {
    at: Vec<[f64; N]>,
    tangents: Vec<[[f64; N]; 2]>,
}

impl Reader<'_> {
    /// Reads the animations that play: the one that is asked for, or every one that moves nothing
    /// that an earlier one moves.
    pub fn moves(&mut self) -> Result<AllMoves, Fault> {
        let root = self.root;
        let name = |i: usize| {
            let name = root.animations[i].name.clone();
            name.unwrap_or_else(|| format!("{i}"))
        };
        let mut playing: Vec<usize> = (0..root.animations.len()).collect();
        if let Some(wanted) = &self.staging.animation {
            let named = playing.iter().copied().find(|&i| name(i) == *wanted);
            let numbered = || wanted.parse().ok().filter(|i| playing.contains(i));
            let Some(found) = named.or_else(numbered) else {
                let known: Vec<String> = playing.iter().map(|&i| name(i)).collect();
                let known = if known.is_empty() {
                    "none".to_owned()
                } else {
                    known.join(", ")
                };
                return Err(Fault::new(format!(
                    "no animation \"{wanted}\" (there are: {known})"
                )));
            };
            playing = vec![found];
        }
        let mut all = AllMoves::new();
        let mut claimed = BTreeSet::new();
        for i in playing {
            let animation = &root.animations[i];
            let targets: BTreeSet<(usize, u8)> = animation
                .channels
                .iter()
                .filter_map(|c| match c.target.path {
                    Checked::Valid(path) => Some((c.target.node.value(), path as u8)),
                    Checked::Invalid => None,
                })
                .collect();
            if !claimed.is_disjoint(&targets) {
                self.note(format!(
                    "animation \"{}\" moves what an earlier one moves: it does not play (animation = NAME chooses)",
                    name(i)
                ));
                continue;
            }
            claimed.extend(targets);
            self.animation(i, animation, &mut all)?;
        }
        self.model.animated = !all.is_empty();
        Ok(all)
    }

    fn animation(
        &mut self,
        i: usize,
        animation: &Animation,
        all: &mut AllMoves,
    ) -> Result<(), Fault> {
        for (k, channel) in animation.channels.iter().enumerate() {
            let (s, node) = (channel.sampler.value(), channel.target.node.value());
            let sampler = animation.samplers.get(s).ok_or_else(|| {
                Fault::missing(&format!("animation {i}, channel {k}: sampler"), s)
            })?;
            if node >= self.root.nodes.len() {
                let what = format!("animation {i}, channel {k}: node");
                return Err(Fault::missing(&what, node));
            }
            let Checked::Valid(path) = channel.target.path else {
                self.note(format!("animation {i}, channel {k}: unknown path: ignored"));
                continue;
            };
            let what = format!("animation {i}, sampler {s}");
            let keys = self.keys(sampler, &what)?;
            let bad = |e: TrackError| Fault::new(format!("{what}: {e}"));
            let moves = all.entry(node).or_default();
            match path {
                Property::Translation => {
                    let values = self.values::<3>(sampler, &keys, 1, &what)?;
                    moves.translation = Some(vectors(&keys, values.of(0)).map_err(bad)?);
                }
                Property::Scale => {
                    let values = self.values::<3>(sampler, &keys, 1, &what)?;
                    moves.scale = Some(vectors(&keys, values.of(0)).map_err(bad)?);
                }
                Property::Rotation => {
                    let values = self.values::<4>(sampler, &keys, 1, &what)?;
                    moves.rotation = Some(arcs(&keys, values.of(0)).map_err(bad)?);
                }
                Property::MorphTargetWeights => {
                    let targets = self.target_count(node);
                    let values = self.values::<1>(sampler, &keys, targets, &what)?;
                    let track = |k| numbers(&keys, values.of(k));
                    let tracks: Result<Vec<_>, _> = (0..targets).map(track).collect();
                    moves.weights = Some(tracks.map_err(bad)?);
                }
            }
        }
        Ok(())
    }

    /// Morph targets of the mesh of a node.
    pub fn target_count(&self, node: usize) -> usize {
        let mesh = self.root.nodes[node].mesh;
        let mesh = mesh.and_then(|m| self.root.meshes.get(m.value()));
        let primitives = mesh.iter().flat_map(|m| &m.primitives);
        primitives
            .filter_map(|p| p.targets.as_ref().map(Vec::len))
            .max()
            .unwrap_or(0)
    }

    fn keys(&self, sampler: &Sampler, what: &str) -> Result<Keys, Fault> {
        let interpolation = match sampler.interpolation {
            Checked::Valid(Source::Step) => Interpolation::Step,
            Checked::Valid(Source::Linear) => Interpolation::Linear,
            Checked::Valid(Source::CubicSpline) => Interpolation::Cubic,
            Checked::Invalid => return Err(Fault::new(format!("{what}: unknown interpolation"))),
        };
        let count = self.buffers.count(sampler.input)?;
        if count == 0 || count > MAX_KEYS as u64 {
            return Err(Fault::new(format!(
                "{what}: {count} keys (allowed: 1 to {MAX_KEYS})"
            )));
        }
        let times: Vec<f64> = self
            .buffers
            .vectors::<1>(sampler.input)?
            .iter()
            .map(|t| f64::from(t[0]) - self.staging.at_s)
            .collect();
        // the rules for times are those of all tracks
        let keys: Vec<(f64, f64)> = times.iter().map(|&t| (t, 0.0)).collect();
        Track::new(&keys, Interpolation::Step).map_err(|e| Fault::new(format!("{what}: {e}")))?;
        let Shutter { open_s, close_s } = self.staging.shutter;
        let first = times.partition_point(|&t| t <= open_s).saturating_sub(1);
        let end = (times.partition_point(|&t| t < close_s) + 1).min(times.len());
        // a shutter after the last key finds it as the first
        let range = first..end.max(first + 1);
        Ok(Keys {
            times: times[range.clone()].to_vec(),
            range,
            count: times.len(),
            interpolation,
        })
    }

    /// The values at the keys of a sampler that has `parts` vectors per key.
    fn values<const N: usize>(
        &self,
        sampler: &Sampler,
        keys: &Keys,
        parts: usize,
        what: &str,
    ) -> Result<PerPart<N>, Fault> {
        let cubic = keys.interpolation == Interpolation::Cubic;
        let needed = keys.count as u64 * parts as u64 * if cubic { 3 } else { 1 };
        let count = self.buffers.count(sampler.output)?;
        if count != needed {
            return Err(Fault::new(format!(
                "{what}: {count} outputs for {} keys (needed: {needed})",
                keys.count
            )));
        }
        let values = self.buffers.vectors::<N>(sampler.output)?;
        Ok(PerPart {
            values,
            parts,
            cubic,
            range: keys.range.clone(),
        })
    }
}

/// The outputs of a sampler with several vectors per key (weights of several morph targets).
struct PerPart<const N: usize> {
    values: Vec<[f32; N]>,
    parts: usize,
    cubic: bool,
    range: Range<usize>,
}

impl<const N: usize> PerPart<N> {
    /// Those of one part.
    fn of(&self, part: usize) -> Values<N> {
        let at = |row: usize| self.values[row * self.parts + part].map(f64::from);
        let keys = self.range.clone();
        if self.cubic {
            // three rows per key: the tangent on arriving, the value, the tangent on leaving
            Values {
                at: keys.clone().map(|i| at(3 * i + 1)).collect(),
                tangents: keys.map(|i| [at(3 * i), at(3 * i + 2)]).collect(),
            }
        } else {
            Values {
                at: keys.map(at).collect(),
                tangents: Vec::new(),
            }
        }
    }
}

fn vectors(keys: &Keys, values: Values<3>) -> Result<Track<DVec3>, TrackError> {
    let at: Vec<(f64, DVec3)> = keyed(keys, values.at.into_iter().map(DVec3::from_array));
    match keys.interpolation {
        Interpolation::Cubic => {
            let tangents = values
                .tangents
                .into_iter()
                .map(|t| t.map(DVec3::from_array));
            Track::with_tangents(&at, tangents.collect())
        }
        other => Track::new(&at, other),
    }
}

fn numbers(keys: &Keys, values: Values<1>) -> Result<Track<f64>, TrackError> {
    let at: Vec<(f64, f64)> = keyed(keys, values.at.into_iter().map(|v| v[0]));
    match keys.interpolation {
        Interpolation::Cubic => {
            let tangents = values.tangents.into_iter().map(|t| t.map(|v| v[0]));
            Track::with_tangents(&at, tangents.collect())
        }
        other => Track::new(&at, other),
    }
}

fn arcs(keys: &Keys, values: Values<4>) -> Result<Rotation, TrackError> {
    // what is no rotation is not finite after this, which is reported
    let unit = |v: [f64; 4]| DQuat::from_array(v).normalize();
    let at: Vec<(f64, DQuat)> = keyed(keys, values.at.into_iter().map(unit));
    let arcs = match keys.interpolation {
        Interpolation::Cubic => {
            let tangents = values
                .tangents
                .into_iter()
                .map(|t| t.map(DVec4::from_array));
            Arcs::with_tangents(&at, tangents.collect())
        }
        other => Arcs::new(&at, other),
    };
    arcs.map(Rotation::Arcs)
}

fn keyed<T>(keys: &Keys, values: impl Iterator<Item = T>) -> Vec<(f64, T)> {
    keys.times.iter().copied().zip(values).collect()
}

impl Moves {
    /// The pose of a node with these moves, which keeps what does not move; `None` if its placement
    /// does not move.
    pub fn pose(&self, node: &Node, i: usize) -> Result<Option<Pose>, Fault> {
        if self.translation.is_none() && self.rotation.is_none() && self.scale.is_none() {
            return Ok(None);
        }
        if node.matrix.is_some() {
            return Err(Fault::new(format!(
                "node {i} is animated, but placed by a matrix (allowed: translation, rotation, scale)"
            )));
        }
        let bad = |_| Fault::new(format!("the transform of node {i} is not finite"));
        let one =
            |v: [f32; 3]| Track::new(&[(0.0, DVec3::from(v.map(f64::from)))], Interpolation::Step);
        let still = |v: Option<[f32; 3]>| v.map(one).transpose().map_err(bad);
        let rotation = match (&self.rotation, node.rotation) {
            (Some(rotation), _) => Some(rotation.clone()),
            (None, Some(r)) => {
                let q = DQuat::from_array(r.0.map(f64::from)).normalize();
                let arcs = Arcs::new(&[(0.0, q)], Interpolation::Step).map_err(bad)?;
                Some(Rotation::Arcs(arcs))
            }
            (None, None) => None,
        };
        let track = |moving: &Option<Track<DVec3>>, at_rest| match moving {
            Some(track) => Ok(Some(track.clone())),
            None => still(at_rest),
        };
        Ok(Some(Pose {
            translation: track(&self.translation, node.translation)?,
            rotation,
            scale: track(&self.scale, node.scale)?,
        }))
    }
}

/// Whether a scale neither is nor becomes 0 while the shutter is open.
pub fn keeps_its_size(pose: &Pose, shutter: Shutter) -> bool {
    let Some(scale) = &pose.scale else {
        return true;
    };
    if scale.interpolation() == Interpolation::Cubic {
        return pose.is_invertible();
    }
    let Shutter { open_s, close_s } = shutter;
    let inside = |t: &&f64| (open_s..close_s).contains(*t);
    let at = |t: f64| scale.at(t, false);
    let sign = at(open_s).signum();
    let times = scale.times().iter().filter(inside).copied();
    times
        .chain([open_s, close_s])
        .all(|t| (at(t) * sign).cmpgt(DVec3::ZERO).all())
}
