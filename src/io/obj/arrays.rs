//! Faces of an OBJ file as the arrays of one mesh: a vertex for each corner that differs, polygons
//! as fans of triangles.

use super::parse::{Corner, Group, NONE, Parsed};
use glam::DVec3;

/// The vertices and faces of some groups.
#[derive(Clone, Debug, Default)]
pub struct Arrays {
    /// Positions, as the file says them.
    pub positions: Vec<[f64; 3]>,
    /// `None` where no corner has one.
    pub normals: Option<Vec<[f32; 3]>>,
    /// `None` where no corner has them.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Finds the vertex of a corner. Corners of one position are a chain, as they are few.
struct Welder {
    /// First vertex of each position.
    heads: Vec<u32>,
    /// Per vertex: its corner, and the next vertex of the same position.
    vertices: Vec<(Corner, u32)>,
}

impl Welder {
    fn vertex(&mut self, corner: Corner) -> u32 {
        let head = &mut self.heads[corner[0] as usize];
        let mut at = *head;
        while at != NONE {
            let (known, next) = self.vertices[at as usize];
            if known == corner {
                return at;
            }
            at = next;
        }
        let new = self.vertices.len() as u32;
        self.vertices.push((corner, *head));
        *head = new;
        new
    }
}

/// The arrays of groups, and a note where some of their corners lack what others have.
pub fn arrays<'p>(
    parsed: &'p Parsed,
    groups: impl Iterator<Item = &'p Group> + Clone,
) -> (Arrays, Option<String>) {
    let has = |slot: usize| {
        let mut corners = groups.clone().flat_map(|g| &g.corners);
        corners.any(|c| c[slot] != NONE)
    };
    let (has_uvs, has_normals) = (has(1), has(2));
    let mut welder = Welder {
        heads: vec![NONE; parsed.positions.len()],
        vertices: Vec::new(),
    };
    let mut triangles = Vec::new();
    // normals of flat faces among those that have some
    let mut flat: Vec<[f32; 3]> = Vec::new();
    let mut lacking: Option<(usize, u32)> = None;
    for group in groups {
        let mut rest = group.corners.as_slice();
        for &(count, line) in &group.faces {
            let (face, after) = rest.split_at(count as usize);
            rest = after;
            let mut own = NONE;
            if has_normals && face.iter().any(|c| c[2] == NONE) {
                own = (parsed.normals.len() + flat.len()) as u32;
                flat.push(face_normal(parsed, face));
            }
            if has_uvs && face.iter().any(|c| c[1] == NONE) {
                lacking = Some(lacking.map_or((1, line), |(n, first)| (n + 1, first)));
            }
            let vertex = |welder: &mut Welder, &[v, vt, vn]: &Corner| {
                welder.vertex([v, vt, if vn == NONE { own } else { vn }])
            };
            let mut fan = [0; 2];
            for (i, corner) in face.iter().enumerate() {
                let v = vertex(&mut welder, corner);
                match i {
                    0 | 1 => fan[i] = v,
                    _ => {
                        triangles.push([fan[0], fan[1], v]);
                        fan[1] = v;
                    }
                }
            }
        }
    }
    let corners = || welder.vertices.iter().map(|v| v.0);
    let normal = |i: u32| {
        let i = i as usize;
        let flat = || flat.get(i - parsed.normals.len());
        parsed
            .normals
            .get(i)
            .or_else(flat)
            .copied()
            .unwrap_or_default()
    };
    let uv = |i: u32| parsed.uvs.get(i as usize).copied().unwrap_or_default();
    let arrays = Arrays {
        positions: corners().map(|c| parsed.positions[c[0] as usize]).collect(),
        normals: has_normals.then(|| corners().map(|c| normal(c[2])).collect()),
        uvs: has_uvs.then(|| corners().map(|c| uv(c[1])).collect()),
        triangles,
    };
    let note = lacking.map(|(count, line)| {
        let faces = if count == 1 { "face has" } else { "faces have" };
        format!("line {line}: {count} {faces} no texture coordinates beside others that do: 0, 0 is taken")
    });
    (arrays, note)
}

/// The normal of a polygon (M. Newell's sum over its edges).
fn face_normal(parsed: &Parsed, face: &[Corner]) -> [f32; 3] {
    let at = |c: &Corner| DVec3::from(parsed.positions[c[0] as usize]);
    let origin = face.first().map(at).unwrap_or_default();
    let edges = face.iter().zip(face.iter().cycle().skip(1));
    let sum: DVec3 = edges
        .map(|(a, b)| (at(a) - origin).cross(at(b) - origin))
        .sum();
    sum.normalize_or(DVec3::Z).as_vec3().to_array()
}

impl Arrays {
    /// Positions in single precision about `origin`.
    #[must_use]
    pub fn about(&self, origin: DVec3) -> Vec<[f32; 3]> {
        let near = |&p: &[f64; 3]| (DVec3::from(p) - origin).as_vec3().to_array();
        self.positions.iter().map(near).collect()
    }

    /// Gives every corner of every triangle a vertex of its own.
    pub fn unroll(&mut self) {
        let corners = self.triangles.as_flattened();
        let each = |v: &u32| *v as usize;
        self.positions = corners.iter().map(|v| self.positions[each(v)]).collect();
        if let Some(normals) = &mut self.normals {
            *normals = corners.iter().map(|v| normals[each(v)]).collect();
        }
        if let Some(uvs) = &mut self.uvs {
            *uvs = corners.iter().map(|v| uvs[each(v)]).collect();
        }
        self.triangles = (0..self.triangles.len() as u32)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::obj::parse::parse;

    fn read(text: &str) -> (Arrays, Option<String>) {
        let parsed = parse(text.as_bytes()).expect("valid");
        arrays(&parsed, parsed.groups.iter())
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 1 0 0\nvt 0.5 0.25\n";

    #[test]
    fn corners_that_differ_are_vertices() {
        let (all, note) = read(&format!("{SQUARE}f 1//1 2//1 3//1\nf 1//1 3//1 4//1\n"));
        assert_eq!(
            (all.positions.len(), all.triangles.len(), note),
            (4, 2, None)
        );
        let (all, _) = read(&format!("{SQUARE}f 1/1 2/1 3/1\nf 1 3 4\n"));
        assert_eq!(all.positions.len(), 6);
    }

    #[test]
    fn what_only_some_faces_have_stays_theirs() {
        let (all, note) = read(&format!("{SQUARE}f 1/1/1 2/1/1 3/1/1\nf 1 3 4\n"));
        let normals = all.normals.expect("some have them");
        assert_eq!(normals[0], [1.0, 0.0, 0.0]);
        assert_eq!(normals[all.triangles[1][2] as usize], [0.0, 0.0, 1.0]);
        let uvs = all.uvs.expect("some have them");
        assert_eq!(uvs[all.triangles[0][0] as usize], [0.5, 0.25]);
        assert_eq!(
            note.as_deref(),
            Some("line 8: 1 face has no texture coordinates beside others that do: 0, 0 is taken")
        );
    }
}
