//! Triangle meshes: vertices in f32, intersected watertight in f64.
//!
//! Triangles are stored in the order of the leaves of the tree and vertices in the order of their first use, so that
//! traversal needs no table of indices and touches memory that lies together: about 30 bytes per triangle in all.

use super::accel::Tree;
use super::ray::LocalRay;
use super::shape::LocalPoint;
use crate::math::distribution::AliasTable;
use crate::math::predicates::{TriangleHit, TriangleRay};
use glam::{DMat3, DVec2, DVec3};
use std::sync::OnceLock;

/// A triangle mesh with its tree.
#[derive(Debug)]
pub struct Mesh {
    positions: Vec<[f32; 3]>,
    normals: Option<Vec<[f32; 3]>>,
    uvs: Option<Vec<[f32; 2]>>,
    triangles: Vec<[u32; 3]>,
    tree: Tree,
    bounds: (DVec3, DVec3),
    area: f64,
    dropped: usize,
    /// Triangles by area, built when the mesh is first sampled.
    area_table: OnceLock<AliasTable>,
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
    /// More triangles or vertices than 32-bit numbers can name.
    #[error("more than 2^31 triangles or vertices")]
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
        positions: Vec<[f32; 3]>,
        normals: Option<Vec<[f32; 3]>>,
        uvs: Option<Vec<[f32; 2]>>,
        mut triangles: Vec<[u32; 3]>,
    ) -> Result<Self, MeshError> {
        let limit = 1 << 31;
        if positions.len() > limit || triangles.len() > limit {
            return Err(MeshError::TooLarge);
        }
        check("position", &positions, positions.len())?;
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
        for (triangle, t) in triangles.iter().enumerate() {
            if let Some(&vertex) = t.iter().find(|&&v| v as usize >= positions.len()) {
                let count = positions.len();
                return Err(MeshError::NoSuchVertex {
                    triangle,
                    vertex,
                    count,
                });
            }
        }
        let given = triangles.len();
        let normal = |t: &[u32; 3]| winding_normal(t.map(|v| vec(positions[v as usize])));
        triangles.retain(|t| normal(t) != DVec3::ZERO);
        if triangles.is_empty() {
            return Err(MeshError::Empty { given });
        }
        let bounds_of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| vec(positions[v as usize]));
            (a.min(b).min(c), a.max(b).max(c))
        };
        let (tree, order) = Tree::build(triangles.len(), |i| bounds_of(&triangles[i]));
        let dropped = given - triangles.len();
        let mut triangles: Vec<[u32; 3]> = order.iter().map(|&i| triangles[i as usize]).collect();
        let area = triangles.iter().map(|t| normal(t).length() / 2.0).sum();
        let bounds = triangles
            .iter()
            .map(bounds_of)
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
            .unwrap_or_default();

        let kept = renumber(&mut triangles, positions.len());
        let pick3 = |from: &[[f32; 3]]| kept.iter().map(|&v| from[v as usize]).collect();
        let pick2 = |from: &[[f32; 2]]| kept.iter().map(|&v| from[v as usize]).collect();
        Ok(Self {
            normals: normals.map(|n| pick3(&n)),
            uvs: uvs.map(|n| pick2(&n)),
            positions: pick3(&positions),
            triangles,
            tree,
            bounds,
            area,
            dropped,
            area_table: OnceLock::new(),
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
        self.triangles[prim as usize].map(|v| vec(self.positions[v as usize]))
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
        let normals = self.normals.as_ref().map_or(0, Vec::len);
        let uvs = self.uvs.as_ref().map_or(0, Vec::len);
        let table = self
            .area_table
            .get()
            .map_or(0, |_| 24 * self.triangles.len());
        12 * (self.positions.len() + normals + self.triangles.len())
            + 8 * uvs
            + self.tree.bytes()
            + table
    }

    /// Whether every edge is shared by two triangles of opposite winding. Vertices count as one where their positions
    /// agree, so that seams in the normals or texture coordinates are no holes. Takes time n log n.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        // Adding 0 turns -0 into 0.
        let key = |v: u32| self.positions[v as usize].map(|x| (x + 0.0).to_bits());
        let mut by_position: Vec<u32> = (0..self.positions.len() as u32).collect();
        by_position.sort_unstable_by_key(|&v| key(v));
        let mut welded = vec![0u32; self.positions.len()];
        for pair in by_position.windows(2) {
            let step = u32::from(key(pair[0]) != key(pair[1]));
            welded[pair[1] as usize] = welded[pair[0] as usize] + step;
        }
        // Each edge from its lower to its higher vertex, then its sense: closed means +, - in turn.
        let mut edges: Vec<(u32, u32, bool)> = Vec::with_capacity(3 * self.triangles.len());
        for t in &self.triangles {
            let w = t.map(|v| welded[v as usize]);
            for (a, b) in [(w[0], w[1]), (w[1], w[2]), (w[2], w[0])] {
                edges.push((a.min(b), a.max(b), a < b));
            }
        }
        edges.sort_unstable();
        edges
            .chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
            .all(|e| e.len() == 2 && e[0].2 != e[1].2)
    }

    /// Largest coordinate in object space.
    #[inline]
    pub(super) fn extent(&self) -> f64 {
        self.bounds.0.abs().max(self.bounds.1.abs()).max_element()
    }

    /// The hit of triangle `prim`, if it counts.
    #[inline(always)]
    fn hit(&self, ray: &LocalRay, tri: &TriangleRay, prim: u32, t_max: f64) -> Option<TriangleHit> {
        let [a, b, c] = self.triangles[prim as usize].map(|v| &self.positions[v as usize]);
        let hit = tri.intersect(a, b, c, t_max)?;
        if ray.start == Some(prim) || ray.end == Some(prim) {
            return None;
        }
        let n = winding_normal([vec(*a), vec(*b), vec(*c)]);
        ray.counts(hit.t, hit.d_dot_normal / n.length())
            .then_some(hit)
    }

    /// The closest hit: parameter, triangle and barycentric weights of its second and third vertex.
    #[inline]
    pub(super) fn closest(&self, ray: &LocalRay) -> Option<(f64, u32, DVec2)> {
        let tri = TriangleRay::new(ray.o, ray.d);
        let mut best = None;
        let mut t_best = ray.t_max;
        self.tree.closest(ray.o, ray.d, ray.t_max, |prim| {
            let hit = self.hit(ray, &tri, prim, t_best)?;
            t_best = hit.t;
            best = Some((hit.t, prim, DVec2::from(hit.weights)));
            Some(hit.t)
        });
        best
    }

    /// Whether any triangle is hit.
    #[inline]
    pub(super) fn occluded(&self, ray: &LocalRay) -> bool {
        let tri = TriangleRay::new(ray.o, ray.d);
        self.tree.any(ray.o, ray.d, ray.t_max, |prim| {
            self.hit(ray, &tri, prim, ray.t_max).is_some()
        })
    }

    /// The point of triangle `prim` with barycentric `weights` of its second and third vertex.
    pub(super) fn local_point(&self, prim: u32, weights: DVec2) -> LocalPoint {
        let index = self.triangles[prim as usize];
        let [a, b, c] = self.corners(prim);
        let p = a + (b - a) * weights.x + (c - a) * weights.y;
        let blend = [1.0 - weights.x - weights.y, weights.x, weights.y];
        let ns = self.normals.as_ref().map(|normals| {
            let n = index.map(|v| vec(normals[v as usize]));
            n[0] * blend[0] + n[1] * blend[1] + n[2] * blend[2]
        });
        let uv = self.uvs.as_ref().map_or(weights, |uvs| {
            let uv = index.map(|v| DVec2::from(uvs[v as usize].map(f64::from)));
            uv[0] * blend[0] + uv[1] * blend[1] + uv[2] * blend[2]
        });
        LocalPoint {
            p,
            ng: winding_normal([a, b, c]).normalize(),
            ns,
            uv,
            prim,
        }
    }

    /// A point uniform over the area in object space.
    pub(super) fn sample(&self, u_face: f64, u: DVec2) -> LocalPoint {
        let table = self.area_table.get_or_init(|| {
            let areas: Vec<f64> = (0..self.triangles.len() as u32)
                .map(|i| winding_normal(self.corners(i)).length())
                .collect();
            AliasTable::new(&areas).expect("invariant: every triangle has a finite, positive area")
        });
        let prim = table.sample(u_face).index as u32;
        let s = u.x.sqrt();
        self.local_point(prim, DVec2::new(s * (1.0 - u.y), s * u.y))
    }

    /// Area after the linear map `m`.
    pub(super) fn mapped_area(&self, m: DMat3) -> f64 {
        (0..self.triangles.len() as u32)
            .map(|i| winding_normal(self.corners(i).map(|p| m * p)).length() / 2.0)
            .sum()
    }
}

/// Twice the area times the unit normal.
#[inline]
fn winding_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

#[inline]
fn vec(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}

/// Checks an attribute that must be absent or match the positions.
fn check<const N: usize>(
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

/// Numbers the `count` vertices in the order of their first use; returns the old number of each new one.
fn renumber(triangles: &mut [[u32; 3]], count: usize) -> Vec<u32> {
    let mut new = vec![u32::MAX; count];
    let mut kept = Vec::new();
    for v in triangles.iter_mut().flatten() {
        let n = &mut new[*v as usize];
        if *n == u32::MAX {
            *n = kept.len() as u32;
            kept.push(*v);
        }
        *v = *n;
    }
    kept.shrink_to_fit();
    kept
}
