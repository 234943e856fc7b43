//! Morph targets and skins: meshes whose vertices are elsewhere than in their file, or move while
//! the shutter is open.
//!
//! A vertex is its place at rest, with what the morph targets add by their weights, taken along by
//! the joints it hangs on (glTF 2.0, 3.7.3): the mean of their maps by its weights. Such vertices
//! run along curves; they are read off at so many moments that the lines between stray from the
//! curves by no more than a ten-thousandth of the mesh.

use super::hierarchy::{Hierarchy, Place};
use super::mesh::Arrays;
use super::{Fault, Reader};
use crate::geometry::deforming::{self, DeformingError, KeyFrame};
use crate::geometry::track::Track;
use crate::geometry::{Mesh, Shape, Shutter};
use glam::{DAffine3, DMat3, DMat4, DVec3};
use gltf::json::scene::Node;

/// Most places of vertices that are computed for a file: 25 bytes each while they are kept.
const MAX_PLACES: usize = 1 << 26;
/// Most moments between two keys.
const MOST_STEPS: f64 = 64.0;
/// How far vertices may stray from their curves, as a share of the mesh.
const STRAY: f64 = 1e-4;

/// Weights of the morph targets of a node.
#[derive(Debug)]
pub enum Weights {
    /// They do not change; none where nothing is morphed.
    Still(Vec<f64>),
    /// They change.
    Moving(Vec<Track<f64>>),
}

/// The joints of a node.
#[derive(Debug)]
pub struct Skin {
    joints: Vec<Place>,
    /// From the mesh at rest to the joint.
    inverse_binds: Vec<DAffine3>,
    /// From the world to the space that vertices are kept in: that of the file.
    to_file: DAffine3,
}

/// How the vertices of a node are moved.
#[derive(Debug)]
pub struct Deformation {
    pub weights: Weights,
    pub skin: Option<Skin>,
}

/// The state of a deformation at a moment.
struct State {
    weights: Vec<f64>,
    joints: Option<Vec<DAffine3>>,
}

impl Reader<'_> {
    /// How the vertices of node `i` are moved; `None` if they are at rest where the file has them.
    pub fn deformation(
        &self,
        node: &Node,
        i: usize,
        moving: Option<&Vec<Track<f64>>>,
        hierarchy: &Hierarchy,
    ) -> Result<Option<Deformation>, Fault> {
        let mesh = node.mesh.and_then(|m| self.root.meshes.get(m.value()));
        let at_rest = node
            .weights
            .as_ref()
            .or(mesh.and_then(|m| m.weights.as_ref()));
        let weights = match (moving, at_rest) {
            (Some(tracks), _) => Weights::Moving(tracks.clone()),
            (None, Some(weights)) => {
                Weights::Still(weights.iter().map(|&w| f64::from(w)).collect())
            }
            (None, None) => Weights::Still(Vec::new()),
        };
        let targets = self.target_count(i);
        if let Weights::Still(given) = &weights
            && !given.is_empty()
            && given.len() != targets
        {
            return Err(Fault::new(format!(
                "node {i}: {} weights for {targets} morph targets",
                given.len()
            )));
        }
        let skin = match node.skin {
            Some(skin) => Some(self.skin(skin.value(), hierarchy)?),
            None => None,
        };
        let morphed = match &weights {
            Weights::Still(weights) => weights.iter().any(|&w| w != 0.0),
            Weights::Moving(_) => targets > 0,
        };
        Ok((morphed || skin.is_some()).then_some(Deformation { weights, skin }))
    }

    fn skin(&self, i: usize, hierarchy: &Hierarchy) -> Result<Skin, Fault> {
        let skins = &self.root.skins;
        let skin = skins.get(i).ok_or_else(|| Fault::missing("skin", i))?;
        let place = |j: &gltf::json::Index<Node>| {
            let j = j.value();
            let place = hierarchy.place(j);
            place.ok_or_else(|| Fault::new(format!("skin {i}: joint {j} is not in the scene")))
        };
        let joints: Vec<Place> = skin.joints.iter().map(place).collect::<Result<_, _>>()?;
        let inverse_binds = match skin.inverse_bind_matrices {
            None => vec![DAffine3::IDENTITY; joints.len()],
            Some(id) => {
                let count = self.buffers.count(id)?;
                if count < joints.len() as u64 {
                    return Err(Fault::new(format!(
                        "skin {i}: {count} inverse bind matrices for {} joints",
                        joints.len()
                    )));
                }
                let matrices = self.buffers.vectors::<16>(id)?;
                let affine =
                    |m: &[f32; 16]| DAffine3::from_mat4(DMat4::from_cols_array(&m.map(f64::from)));
                matrices.iter().map(affine).collect()
            }
        };
        Ok(Skin {
            joints,
            inverse_binds,
            to_file: self.staging.to_world.inverse(),
        })
    }

    /// The shape of `arrays` over the shutter. `what` is for messages.
    pub fn deformed(
        &mut self,
        arrays: &Arrays,
        deformation: &Deformation,
        hierarchy: &Hierarchy,
        what: &str,
    ) -> Result<Vec<KeyFrame>, Fault> {
        let shutter = self.staging.shutter;
        if let Some(skin) = &deformation.skin {
            let known = skin.joints.len();
            for set in &arrays.joints {
                let used = set
                    .indices
                    .iter()
                    .flatten()
                    .zip(set.weights.iter().flatten());
                if let Some((bad, _)) = used
                    .into_iter()
                    .find(|(j, w)| **w != 0.0 && **j as usize >= known)
                {
                    return Err(Fault::new(format!("{what}: joint {bad} of {known}")));
                }
            }
        }
        let mut frame = |time: f64, before: bool| -> Result<KeyFrame, Fault> {
            let joints = deformation.skin.as_ref().map_or(0, |s| s.joints.len());
            let cost = arrays.positions.len().max(joints + hierarchy.keyed_count());
            self.places = self.places.saturating_add(cost);
            if self.places > MAX_PLACES {
                return Err(Fault::new(format!(
                    "{what}: morph targets and skins take more than {MAX_PLACES} places of vertices over the shutter"
                )));
            }
            let state = deformation.state(hierarchy, time, before);
            Ok(state.frame(arrays, time))
        };
        let mut frames = vec![frame(shutter.open_s, false)?];
        if shutter.is_instant() {
            return Ok(frames);
        }
        let tolerance = STRAY * extent(&frames[0]);
        let breaks = deformation.breaks(hierarchy, shutter);
        for pair in breaks.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let at = |u: f64| a + (b - a) * u;
            let end = frame(b, true)?;
            let start = &frames[frames.len() - 1];
            let mut stray = 0.0_f64;
            for u in [0.25, 0.5, 0.75] {
                stray = stray.max(strayed(start, &end, &frame(at(u), false)?, u));
            }
            // how far lines stray falls with the square of the steps; the parts of a long curve
            // stray a little more than that
            let steps = if stray > tolerance {
                (1.3 * stray / tolerance).sqrt().ceil().min(MOST_STEPS) as u32
            } else {
                1
            };
            for i in 1..steps {
                frames.push(frame(at(f64::from(i) / f64::from(steps)), false)?);
            }
            let after = frame(b, false)?;
            // a step: just before it things are as they were
            if after.positions != end.positions || after.normals != end.normals {
                frames.push(KeyFrame {
                    time_s: b.next_down(),
                    ..end
                });
            }
            frames.push(after);
        }
        frames.dedup_by(|later, earlier| later.time_s <= earlier.time_s);
        Ok(frames)
    }
}

impl Deformation {
    fn state(&self, hierarchy: &Hierarchy, time: f64, before: bool) -> State {
        let weights = match &self.weights {
            Weights::Still(weights) => weights.clone(),
            Weights::Moving(tracks) => tracks.iter().map(|t| t.at(time, before)).collect(),
        };
        let joints = self.skin.as_ref().map(|skin| {
            let poses = hierarchy.poses(time, before);
            let joint = |(place, bind): (&Place, &DAffine3)| {
                skin.to_file * hierarchy.world(*place, &poses) * *bind
            };
            skin.joints
                .iter()
                .zip(&skin.inverse_binds)
                .map(joint)
                .collect()
        });
        State { weights, joints }
    }

    /// The ends of the shutter and the keys within it, ascending.
    fn breaks(&self, hierarchy: &Hierarchy, shutter: Shutter) -> Vec<f64> {
        let mut times = vec![shutter.open_s, shutter.close_s];
        if let Weights::Moving(tracks) = &self.weights {
            // all have the same times
            times.extend(tracks.iter().take(1).flat_map(Track::times));
        }
        if let Some(skin) = &self.skin {
            times.extend(skin.joints.iter().flat_map(|j| hierarchy.times(*j)));
        }
        times.retain(|t| (shutter.open_s..=shutter.close_s).contains(t));
        times.sort_unstable_by(f64::total_cmp);
        times.dedup();
        times
    }
}

impl State {
    fn frame(&self, arrays: &Arrays, time_s: f64) -> KeyFrame {
        let count = arrays.positions.len();
        let blended: Option<Vec<DAffine3>> = self
            .joints
            .as_ref()
            .filter(|_| !arrays.joints.is_empty())
            .map(|joints| (0..count).map(|v| blend(arrays, joints, v)).collect());
        let morphed = |base: [f32; 3], displacement: &dyn Fn(usize) -> [f32; 3]| {
            let targets = self.weights.iter().take(arrays.targets.len()).enumerate();
            targets
                .filter(|(_, w)| **w != 0.0)
                .fold(vector(base), |p, (k, w)| p + vector(displacement(k)) * *w)
        };
        let positions = (0..count).map(|v| {
            let p = morphed(arrays.positions[v], &|k| arrays.targets[k].positions[v]);
            let p = blended
                .as_ref()
                .map_or(p, |maps| maps[v].transform_point3(p));
            p.as_vec3().to_array()
        });
        let normals = arrays.normals.as_ref().map(|normals| {
            let normal = |v: usize| {
                let n = morphed(normals[v], &|k| arrays.targets[k].normals[v]);
                let n = blended
                    .as_ref()
                    .map_or(n, |maps| cofactor(maps[v].matrix3) * n);
                n.normalize_or_zero().as_vec3().to_array()
            };
            (0..count).map(normal).collect()
        });
        KeyFrame {
            time_s,
            positions: positions.collect(),
            normals,
        }
    }
}

/// The mean of the maps of the joints that a vertex hangs on; the first joint's where its weights
/// are all 0.
fn blend(arrays: &Arrays, joints: &[DAffine3], v: usize) -> DAffine3 {
    let mut matrix3 = DMat3::ZERO;
    let mut translation = DVec3::ZERO;
    let mut total = 0.0;
    for set in &arrays.joints {
        for (joint, weight) in set.indices[v].iter().zip(set.weights[v]) {
            if weight != 0.0 {
                let (map, w) = (&joints[*joint as usize], f64::from(weight));
                matrix3 += map.matrix3 * w;
                translation += map.translation * w;
                total += w;
            }
        }
    }
    if total == 0.0 {
        return joints.first().copied().unwrap_or(DAffine3::IDENTITY);
    }
    DAffine3 {
        matrix3: matrix3 * (1.0 / total),
        translation: translation / total,
    }
}

/// Matrix that turns normals as `m` turns surfaces: the inverse transpose times the determinant.
fn cofactor(m: DMat3) -> DMat3 {
    let [a, b, c] = [m.x_axis, m.y_axis, m.z_axis];
    DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b))
}

fn vector(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}

/// Diagonal of the box around the vertices.
fn extent(frame: &KeyFrame) -> f64 {
    let points = frame.positions.iter().map(|p| vector(*p));
    let (low, high) = points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| {
        (l.min(p), h.max(p))
    });
    (high - low).max(DVec3::ZERO).length()
}

/// How far a vertex is at most from the line between two frames, at the fraction `u` of the way.
fn strayed(a: &KeyFrame, b: &KeyFrame, between: &KeyFrame, u: f64) -> f64 {
    let ends = a.positions.iter().zip(&b.positions);
    ends.zip(&between.positions)
        .map(|((a, b), p)| (vector(*a).lerp(vector(*b), u) - vector(*p)).length())
        .fold(0.0, f64::max)
}

/// The shape of frames: one that does not move is an ordinary mesh.
pub fn shape(
    frames: &[KeyFrame],
    arrays: &Arrays,
    shutter: Shutter,
) -> Result<Shape, DeformingError> {
    let (uvs, triangles) = (arrays.uvs.clone(), arrays.triangles.clone());
    let [still] = frames else {
        return deforming::shape(frames, uvs, triangles, shutter);
    };
    Mesh::new(&still.positions, still.normals.clone(), uvs, triangles)
        .map(|mesh| Shape::Mesh(mesh.into()))
        .map_err(|source| DeformingError::Mesh { frame: 0, source })
}
