//! Triangle meshes: vertices in f32, intersected watertight in f64.
//!
//! Corners take 36 bytes per triangle, in the order of the leaves of the tree, and the tree about 5; indices are kept
//! only where normals or texture coordinates need them.

use super::ray::LocalRay;
use super::shape::LocalPoint;
use super::tree::{self, Entry, Tree};
use super::triangles::{Corners, Triangles};
use crate::math::distribution::AliasTable;
use crate::math::predicates::{TriangleFilter, TriangleHit, TriangleRay};
use glam::{DMat3, DVec2, DVec3};
use std::sync::OnceLock;

/// A triangle mesh with its tree.
#[derive(Debug)]
pub struct Mesh {
    triangles: Triangles,
    attributes: Option<Attributes>,
    tree: Tree,
    bounds: (DVec3, DVec3),
    area: f64,
    dropped: usize,
    /// Triangles by area, built when the mesh is first sampled.
    area_table: OnceLock<AliasTable>,
}

/// What varies over a mesh besides its position.
#[derive(Debug)]
struct Attributes {
    /// Vertices of each triangle.
    indices: Vec<[u32; 3]>,
    normals: Option<Vec<[f32; 3]>>,
    uvs: Option<Vec<[f32; 2]>>,
}

/// Why arrays are no mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    /// A position, normal or texture coordinate is infinite or not a number.
    #[error("{array} {index} is not finite")]
    NotFinite {
        /// Which array.
        array: &'static str,
        /// Which vertex, from 0.
        index: usize,
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} refers to vertex {vertex}, but there are {count}")]
    NoSuchVertex {
        /// Which triangle, from 0.
        triangle: usize,
        /// The vertex it names, from 0.
        vertex: u32,
        /// How many there are.
        count: usize,
    },
    /// An attribute has another number of entries than there are positions.
    #[error("{count} {array}s for {positions} positions")]
    WrongCount {
        /// Which array.
        array: &'static str,
        /// Its entries.
        count: usize,
        /// The positions.
        positions: usize,
    },
    /// More triangles or vertices than a tree can name.
    #[error("more than 2^29 triangles or vertices")]
    TooLarge,
    /// No triangle, or none with an area.
    #[error("no triangle with an area (of {given})")]
    Empty {
        /// Triangles given.
        given: usize,
    },
}

impl Mesh {
    /// A mesh from indexed vertices; triangles run counter-clockwise seen from outside. Triangles without area are
    /// dropped (see [`Mesh::dropped`]), and the rest is reordered.
    ///
    /// # Errors
    /// [`MeshError`] if a number is not finite, an index is out of range, the arrays do not match, or no triangle is
    /// left.
    pub fn new(
        positions: &[[f32; 3]],
        normals: Option<Vec<[f32; 3]>>,
        uvs: Option<Vec<[f32; 2]>>,
        mut indices: Vec<[u32; 3]>,
    ) -> Result<Self, MeshError> {
        if positions.len() > tree::LIMIT || indices.len() > tree::LIMIT {
            return Err(MeshError::TooLarge);
        }
        check("position", positions, positions.len())?;
        check(
            "normal",
            normals.as_deref().unwrap_or_default(),
            positions.len(),
        )?;
        check(
            "texture coordinate",
            uvs.as_deref().unwrap_or_default(),
            positions.len(),
        )?;
        for (triangle, t) in indices.iter().enumerate() {
            if let Some(&vertex) = t.iter().find(|&&v| v as usize >= positions.len()) {
                let count = positions.len();
                return Err(MeshError::NoSuchVertex {
                    triangle,
                    vertex,
                    count,
                });
            }
        }
        let corners = |t: &[u32; 3]| t.map(|v| positions[v as usize]);
        let given = indices.len();
        indices.retain(|t| winding_normal(&corners(t)) != DVec3::ZERO);
        if indices.is_empty() {
            return Err(MeshError::Empty { given });
        }
        let dropped = given - indices.len();
        let (tree, order) = Tree::build(indices.len(), tree::LEAF_LIMIT, |i| {
            bounds(&corners(&indices[i]))
        });
        let indices: Vec<[u32; 3]> = order.iter().map(|&i| indices[i as usize]).collect();
        let triangles = Triangles::new(indices.iter().map(corners));
        let bounds = triangles
            .iter()
            .map(|t| bounds(&t))
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
            .unwrap_or_default();
        let area = triangles
            .iter()
            .map(|t| winding_normal(&t).length() / 2.0)
            .sum();
        let attributes = (normals.is_some() || uvs.is_some()).then_some(Attributes {
            indices,
            normals,
            uvs,
        });
        let area_table = OnceLock::new();
        Ok(Self {
            triangles,
            attributes,
            tree,
            bounds,
            area,
            dropped,
            area_table,
        })
    }

    /// How many triangles without area were dropped.
    #[must_use]
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// The corners of triangle `prim`, counter-clockwise seen from outside.
    #[must_use]
    pub fn corners(&self, prim: u32) -> [DVec3; 3] {
        self.triangles.get(prim).map(vec)
    }

    /// Whether its vertices have texture coordinates.
    #[must_use]
    pub fn has_texture_coordinates(&self) -> bool {
        self.attributes.as_ref().is_some_and(|a| a.uvs.is_some())
    }

    /// Bounds in object space.
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        self.bounds
    }

    /// Area in object space.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.area
    }

    /// Memory held, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let attributes = self.attributes.as_ref().map_or(0, |a| {
            let normals = a.normals.as_ref().map_or(0, Vec::len);
            let uvs = a.uvs.as_ref().map_or(0, Vec::len);
            12 * (a.indices.len() + normals) + 8 * uvs
        });
        let table = self.area_table.get().map_or(0, AliasTable::bytes);
        self.triangles.bytes() + attributes + self.tree.bytes() + table
    }

    /// Whether every edge is shared by two triangles of opposite winding. Vertices count as one where their positions
    /// agree, so that seams in the normals or texture coordinates are no holes. Takes time n log n.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        let count = 3 * self.triangles.len();
        // Adding 0 turns -0 into 0.
        let key = |v: u32| self.triangles.get(v / 3)[v as usize % 3].map(|x| (x + 0.0).to_bits());
        let mut by_position: Vec<u32> = (0..count as u32).collect();
        by_position.sort_unstable_by_key(|&v| key(v));
        let mut welded = vec![0u32; count];
        for pair in by_position.windows(2) {
            let step = u32::from(key(pair[0]) != key(pair[1]));
            welded[pair[1] as usize] = welded[pair[0] as usize] + step;
        }
        edges_pair_up(welded.as_chunks::<3>().0.iter().copied())
    }

    /// Largest coordinate in object space.
    #[inline]
    pub(super) fn extent(&self) -> f64 {
        self.bounds.0.abs().max(self.bounds.1.abs()).max_element()
    }

    /// What tests of triangles need to know of a ray that enters the tree.
    #[inline(always)]
    fn prepare(&self, ray: &LocalRay, entry: &Entry) -> (TriangleRay, TriangleFilter) {
        let tri = TriangleRay::new(ray.o, ray.d);
        let filter = TriangleFilter::new(&tri, ray.at(entry.t), self.extent());
        (tri, filter)
    }

    /// The hit of triangle `prim`, if it counts.
    #[inline(always)]
    fn hit(
        &self,
        ray: &LocalRay,
        (tri, filter): &(TriangleRay, TriangleFilter),
        prim: u32,
        t_max: f64,
    ) -> Option<TriangleHit> {
        if !self.triangles.pass(filter, prim) || ray.start == Some(prim) || ray.end == Some(prim) {
            return None;
        }
        let corners = self.triangles.get(prim);
        let hit = tri.intersect(&corners, t_max)?;
        let n = winding_normal(&corners);
        ray.counts(hit.t, hit.d_dot_normal / n.length())
            .then_some(hit)
    }

    /// The closest hit: parameter, triangle and barycentric weights of its second and third vertex.
    #[inline]
    pub(super) fn closest(&self, ray: &LocalRay) -> Option<(f64, u32, DVec2)> {
        let entry = self.tree.enter(ray.o, ray.d, ray.t_max)?;
        let prepared = self.prepare(ray, &entry);
        let mut best = None;
        let mut t_best = ray.t_max;
        let fetch = |prim| self.triangles.fetch(prim);
        self.tree.closest(entry, fetch, |prims| {
            let mut nearer = None;
            for prim in prims {
                if let Some(hit) = self.hit(ray, &prepared, prim, t_best) {
                    t_best = hit.t;
                    best = Some((hit.t, prim, DVec2::from(hit.weights)));
                    nearer = Some(hit.t);
                }
            }
            nearer
        });
        best
    }

    /// Whether any triangle is hit.
    #[inline]
    pub(super) fn occluded(&self, ray: &LocalRay) -> bool {
        let Some(entry) = self.tree.enter(ray.o, ray.d, ray.t_max) else {
            return false;
        };
        let prepared = self.prepare(ray, &entry);
        let fetch = |prim| self.triangles.fetch(prim);
        self.tree.any(entry, fetch, |mut prims| {
            prims.any(|prim| self.hit(ray, &prepared, prim, ray.t_max).is_some())
        })
    }

    /// The point of triangle `prim` with barycentric `weights` of its second and third vertex.
    pub(super) fn local_point(&self, prim: u32, weights: DVec2) -> LocalPoint {
        let corners = self.triangles.get(prim);
        let [a, b, c] = corners.map(vec);
        let blend = [1.0 - weights.x - weights.y, weights.x, weights.y];
        let (mut ns, mut uv) = (None, weights);
        if let Some(attributes) = &self.attributes {
            let [i, j, k] = attributes.indices[prim as usize].map(|v| v as usize);
            ns = attributes
                .normals
                .as_ref()
                .map(|n| vec(n[i]) * blend[0] + vec(n[j]) * blend[1] + vec(n[k]) * blend[2]);
            if let Some(uvs) = &attributes.uvs {
                let at = |v: usize| DVec2::from(uvs[v].map(f64::from));
                uv = at(i) * blend[0] + at(j) * blend[1] + at(k) * blend[2];
            }
        }
        let p = a + (b - a) * weights.x + (c - a) * weights.y;
        LocalPoint {
            p,
            ng: winding_normal(&corners).normalize(),
            ns,
            uv,
            prim,
        }
    }

    /// Derivatives of the position of triangle `prim` by its texture coordinates; `None` where it has none or they are
    /// degenerate.
    pub(super) fn tangents(&self, prim: u32) -> Option<[DVec3; 2]> {
        let attributes = self.attributes.as_ref()?;
        let uvs = attributes.uvs.as_ref()?;
        let uv = |v: u32| DVec2::from(uvs[v as usize].map(f64::from));
        let at = attributes.indices[prim as usize].map(uv);
        tangents(self.corners(prim), at)
    }

    /// Barycentric weights of the second and third vertex at the point of triangle `prim` nearest to `p` in its plane.
    pub(super) fn weights(&self, prim: u32, p: DVec3) -> DVec2 {
        weights(self.corners(prim), p)
    }

    /// A point uniform over the area in object space.
    pub(super) fn sample(&self, u_face: f64, u: DVec2) -> LocalPoint {
        let table = self.area_table.get_or_init(|| {
            let areas: Vec<f64> = self
                .triangles
                .iter()
                .map(|t| winding_normal(&t).length())
                .collect();
            AliasTable::new(&areas).expect("invariant: every triangle has a finite, positive area")
        });
        let prim = table.sample(u_face).index as u32;
        let s = u.x.sqrt();
        self.local_point(prim, DVec2::new(s * (1.0 - u.y), s * u.y))
    }

    /// Area after the linear map `m`.
    pub(super) fn mapped_area(&self, m: DMat3) -> f64 {
        let area = |t: Corners| {
            let [a, b, c] = t.map(|p| m * vec(p));
            (b - a).cross(c - a).length() / 2.0
        };
        self.triangles.iter().map(area).sum()
    }
}

/// Whether every edge of the triangles is shared by two of opposite winding.
pub(super) fn edges_pair_up(triangles: impl ExactSizeIterator<Item = [u32; 3]>) -> bool {
    // Each edge from its lower to its higher vertex, then its sense: closed means +, - in turn.
    let mut edges: Vec<(u32, u32, bool)> = Vec::with_capacity(3 * triangles.len());
    for w in triangles {
        for (a, b) in [(w[0], w[1]), (w[1], w[2]), (w[2], w[0])] {
            edges.push((a.min(b), a.max(b), a < b));
        }
    }
    edges.sort_unstable();
    edges
        .chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
        .all(|e| e.len() == 2 && e[0].2 != e[1].2)
}

/// Derivatives of the position on a triangle by its texture coordinates; `None` where they are degenerate.
pub(super) fn tangents([a, b, c]: [DVec3; 3], [i, j, k]: [DVec2; 3]) -> Option<[DVec3; 2]> {
    let (s, t) = (j - i, k - i);
    let determinant = s.perp_dot(t);
    let (p, q) = (b - a, c - a);
    let du = (p * t.y - q * s.y) / determinant;
    let dv = (q * s.x - p * t.x) / determinant;
    (du.is_finite() && dv.is_finite()).then_some([du, dv])
}

/// Barycentric weights of the second and third corner at the point of a triangle nearest to `p` in its plane.
pub(super) fn weights([a, b, c]: [DVec3; 3], p: DVec3) -> DVec2 {
    let (s, t, q) = (b - a, c - a, p - a);
    let (ss, st, tt) = (s.dot(s), s.dot(t), t.dot(t));
    let (qs, qt) = (q.dot(s), q.dot(t));
    let w = DVec2::new(tt * qs - st * qt, ss * qt - st * qs) / (ss * tt - st * st);
    if w.is_finite() {
        w.clamp(DVec2::ZERO, DVec2::ONE)
    } else {
        DVec2::ZERO
    }
}

/// Twice the area times the unit normal.
#[inline]
pub(super) fn winding_normal(corners: &Corners) -> DVec3 {
    let [a, b, c] = corners.map(vec);
    (b - a).cross(c - a)
}

fn bounds(corners: &Corners) -> (DVec3, DVec3) {
    let [a, b, c] = corners.map(vec);
    (a.min(b).min(c), a.max(b).max(c))
}

#[inline]
pub(super) fn vec(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}

/// Checks an attribute that must be absent or match the positions.
pub(super) fn check<const N: usize>(
    array: &'static str,
    values: &[[f32; N]],
    positions: usize,
) -> Result<(), MeshError> {
    if !values.is_empty() && values.len() != positions {
        return Err(MeshError::WrongCount {
            array,
            count: values.len(),
            positions,
        });
    }
    match values.iter().position(|v| v.iter().any(|x| !x.is_finite())) {
        Some(index) => Err(MeshError::NotFinite { array, index }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const P: [[f32; 3]; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];
    const CLOSED: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

    #[test]
    fn bad_arrays_are_refused() {
        let new = |p: &[[f32; 3]], t: &[[u32; 3]]| Mesh::new(p, None, None, t.to_vec()).err();
        let mut bad = P;
        bad[2][1] = f32::NAN;
        let not_finite = MeshError::NotFinite {
            array: "position",
            index: 2,
        };
        assert_eq!(new(&bad, &CLOSED), Some(not_finite));
        let missing = MeshError::NoSuchVertex {
            triangle: 1,
            vertex: 4,
            count: 4,
        };
        assert_eq!(new(&P, &[[0, 1, 2], [0, 4, 1]]), Some(missing));
        assert_eq!(new(&P, &[[0, 1, 1]]), Some(MeshError::Empty { given: 1 }));
        assert_eq!(new(&[], &[]), Some(MeshError::Empty { given: 0 }));
        let short = Mesh::new(&P, Some(vec![[0.0, 0.0, 1.0]]), None, CLOSED.to_vec());
        assert!(matches!(
            short,
            Err(MeshError::WrongCount {
                count: 1,
                positions: 4,
                ..
            })
        ));
    }

    #[test]
    fn triangles_without_area_are_dropped_and_counted() {
        let mut t = CLOSED.to_vec();
        t.push([0, 0, 1]);
        let mesh = Mesh::new(&P, None, None, t).expect("valid");
        assert_eq!((mesh.triangle_count(), mesh.dropped()), (4, 1));
        assert!((mesh.area() - (1.5 + 3f64.sqrt() / 2.0)).abs() < 1e-12);
    }

    #[test]
    fn closed_means_every_edge_paired_in_opposite_sense() {
        let closed = |p: &[[f32; 3]], t: &[[u32; 3]]| {
            Mesh::new(p, None, None, t.to_vec())
                .expect("valid")
                .is_closed()
        };
        assert!(closed(&P, &CLOSED));
        assert!(!closed(&P, &CLOSED[..3]));
        let mut flipped = CLOSED;
        flipped[0].swap(0, 1);
        assert!(!closed(&P, &flipped));
        // Vertices of their own for every triangle, one of them with a negative zero.
        let mut split: Vec<[f32; 3]> = CLOSED
            .iter()
            .flat_map(|t| t.map(|v| P[v as usize]))
            .collect();
        split[0][1] = -0.0;
        let own: Vec<[u32; 3]> = (0..4).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        assert!(closed(&split, &own));
    }

    #[test]
    fn attributes_are_interpolated_at_the_right_triangle() {
        let normals = P.map(|p| [p[0] + 0.5, p[1] - 0.25, 1.0]).to_vec();
        let uvs = P.map(|p| [p[0] + 2.0 * p[2], p[1]]).to_vec();
        let mesh = Mesh::new(&P, Some(normals), Some(uvs), CLOSED.to_vec()).expect("valid");
        for prim in 0..4 {
            let point = mesh.local_point(prim, DVec2::new(0.3, 0.5));
            let (p, n) = (point.p, point.ns.expect("has normals"));
            assert!((n - DVec3::new(p.x + 0.5, p.y - 0.25, 1.0)).length() < 1e-12);
            assert!((point.uv - DVec2::new(p.x + 2.0 * p.z, p.y)).length() < 1e-12);
        }
    }
}
