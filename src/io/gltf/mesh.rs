//! Primitives of glTF meshes: vertices that triangles use, with their morph targets and joints.

use super::{Fault, Reader};
use gltf::json::mesh::{Mode, MorphTarget, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Index, accessor::Accessor};

/// Most displacements of vertices by the morph targets of a mesh.
const MAX_DISPLACEMENTS: usize = 1 << 27;
/// Most sets of joints: eight joints per vertex are the most that programs write.
const MAX_JOINT_SETS: u32 = 4;

/// The arrays of a mesh while its primitives are joined.
#[derive(Clone, Debug, Default)]
pub struct Arrays {
    pub positions: Vec<[f32; 3]>,
    pub normals: Option<Vec<[f32; 3]>>,
    pub uvs: Option<Vec<[f32; 2]>>,
    pub triangles: Vec<[u32; 3]>,
    pub targets: Vec<Target>,
    /// Sets of four joints of a skin with their weights; none where vertices hang on no joints.
    pub joints: Vec<Joints>,
}

/// Offsets of a morph target, one per vertex.
#[derive(Clone, Debug)]
pub struct Target {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
}

/// Joints and weights, one per vertex.
#[derive(Clone, Debug)]
pub struct Joints {
    pub indices: Vec<[u32; 4]>,
    pub weights: Vec<[f32; 4]>,
}

type Accessors = Index<Accessor>;

/// Reads accessors of a primitive, checks their lengths, and keeps the entries of vertices that are
/// used.
struct Picker<'r, 'a> {
    reader: &'r Reader<'a>,
    what: &'r str,
    given: usize,
    used: Vec<u32>,
}

impl Picker<'_, '_> {
    fn pick<const N: usize>(&self, name: &str, id: Accessors) -> Result<Vec<[f32; N]>, Fault> {
        let count = self.reader.buffers.count(id)?;
        if count != self.given as u64 {
            return Err(Fault::new(format!(
                "{}: {name} has {count} entries for {} positions",
                self.what, self.given
            )));
        }
        Ok(self.of(&self.reader.buffers.vectors::<N>(id)?))
    }

    fn of<const N: usize>(&self, all: &[[f32; N]]) -> Vec<[f32; N]> {
        self.used.iter().map(|&v| all[v as usize]).collect()
    }

    fn target(&self, target: &MorphTarget) -> Result<Target, Fault> {
        let pick = |name, id: Option<Accessors>| match id {
            Some(id) => self.pick::<3>(name, id),
            None => Ok(vec![[0.0; 3]; self.used.len()]),
        };
        Ok(Target {
            positions: pick("POSITION of a morph target", target.positions)?,
            normals: pick("NORMAL of a morph target", target.normals)?,
        })
    }
}

impl Reader<'_> {
    /// `None` for points and lines. `set` is that of the texture coordinates.
    pub fn primitive(
        &mut self,
        primitive: &Primitive,
        set: u32,
        what: &str,
    ) -> Result<Option<Arrays>, Fault> {
        let Checked::Valid(mode) = primitive.mode else {
            return Err(Fault::new(format!("{what}: unknown mode")));
        };
        if !matches!(
            mode,
            Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
        ) {
            self.note(format!("{what} is made of points or lines: ignored"));
            return Ok(None);
        }
        if let Some(extensions) = &primitive.extensions
            && let Some(name) = extensions
                .others
                .keys()
                .find(|k| *k != "KHR_materials_variants")
        {
            self.note(format!("{what}: {name} is not understood: ignored"));
        }
        let find =
            |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let Some(positions) = find(Semantic::Positions) else {
            return Err(Fault::new(format!("{what} has no POSITION")));
        };
        if find(Semantic::Colors(0)).is_some() {
            self.note("vertex colors are not read".into());
        }
        let positions = self.buffers.vectors::<3>(positions)?;
        let indices = match primitive.indices {
            Some(id) => self.buffers.indices(id)?,
            None => (0..u32::try_from(positions.len()).unwrap_or(u32::MAX)).collect(),
        };
        if let Some(bad) = indices.iter().find(|&&v| v as usize >= positions.len()) {
            return Err(Fault::new(format!(
                "{what}: index {bad} of {} positions",
                positions.len()
            )));
        }
        let mut triangles = triangles(mode, &indices);
        let picker = Picker {
            reader: self,
            what,
            given: positions.len(),
            used: compact(&mut triangles, positions.len()),
        };
        let normals = find(Semantic::Normals).map(|id| picker.pick::<3>("NORMAL", id));
        let uvs = find(Semantic::TexCoords(set)).map(|id| picker.pick::<2>("TEXCOORD", id));
        let sources = primitive.targets.as_deref().unwrap_or_default();
        if sources.len().saturating_mul(picker.used.len()) > MAX_DISPLACEMENTS {
            return Err(Fault::new(format!(
                "{what}: {} morph targets of {} vertices (allowed: {MAX_DISPLACEMENTS} together)",
                sources.len(),
                picker.used.len()
            )));
        }
        let targets = sources.iter().map(|t| picker.target(t));
        let mut joints = Vec::new();
        for set in 0..MAX_JOINT_SETS {
            let (Some(indices), Some(weights)) =
                (find(Semantic::Joints(set)), find(Semantic::Weights(set)))
            else {
                break;
            };
            let indices = picker.pick::<4>("JOINTS", indices)?;
            joints.push(Joints {
                // whole numbers of at most 16 bits, which f32 holds
                indices: indices.iter().map(|j| j.map(|v| v as u32)).collect(),
                weights: picker.pick::<4>("WEIGHTS", weights)?,
            });
        }
        Ok(Some(Arrays {
            positions: picker.of(&positions),
            normals: normals.transpose()?,
            uvs: uvs.transpose()?,
            targets: targets.collect::<Result<_, _>>()?,
            joints,
            triangles,
        }))
    }
}

fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, w)| {
                if i % 2 == 0 {
                    [w[0], w[1], w[2]]
                } else {
                    [w[1], w[0], w[2]]
                }
            })
            .collect(),
        Mode::TriangleFan => indices
            .get(1..)
            .unwrap_or_default()
            .windows(2)
            .map(|w| [indices[0], w[0], w[1]])
            .collect(),
        _ => indices.as_chunks::<3>().0.to_vec(),
    }
}

/// Numbers the vertices that are used anew, in their old order; gives their old numbers.
fn compact(triangles: &mut [[u32; 3]], count: usize) -> Vec<u32> {
    let mut new = vec![u32::MAX; count];
    for &v in triangles.as_flattened() {
        new[v as usize] = 0;
    }
    let mut used = Vec::new();
    for (old, number) in new.iter_mut().enumerate() {
        if *number == 0 {
            *number = used.len() as u32;
            used.push(old as u32);
        }
    }
    for v in triangles.as_flattened_mut() {
        *v = new[*v as usize];
    }
    used
}

impl Arrays {
    /// Joins another primitive; what only one of them has is dropped.
    pub fn append(&mut self, other: Self) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.normals = both(self.normals.take(), other.normals);
        self.uvs = both(self.uvs.take(), other.uvs);
        let shifted = other.triangles.iter().map(|t| t.map(|v| v + first));
        self.triangles.extend(shifted);
        self.targets.truncate(other.targets.len());
        for (mine, more) in self.targets.iter_mut().zip(other.targets) {
            mine.positions.extend(more.positions);
            mine.normals.extend(more.normals);
        }
        self.joints.truncate(other.joints.len());
        for (mine, more) in self.joints.iter_mut().zip(other.joints) {
            mine.indices.extend(more.indices);
            mine.weights.extend(more.weights);
        }
    }
}

fn both<T>(a: Option<Vec<T>>, b: Option<Vec<T>>) -> Option<Vec<T>> {
    let (mut a, b) = (a?, b?);
    a.extend(b);
    Some(a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_used_vertices_are_kept_in_their_order() {
        let mut triangles = [[7, 2, 5], [5, 2, 0]];
        assert_eq!(compact(&mut triangles, 9), [0, 2, 5, 7]);
        assert_eq!(triangles, [[3, 1, 2], [2, 1, 0]]);
    }

    #[test]
    fn strips_and_fans_keep_their_winding() {
        let indices = [0, 1, 2, 3];
        assert_eq!(
            triangles(Mode::TriangleStrip, &indices),
            [[0, 1, 2], [2, 1, 3]]
        );
        assert_eq!(
            triangles(Mode::TriangleFan, &indices),
            [[0, 1, 2], [0, 2, 3]]
        );
    }
}
