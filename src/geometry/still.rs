//! Meshes at rest.

use super::mesh::{self, Attributes, Corners, CornersAt, MeshError, TriangleMesh};
use super::mesh::{bounds, check, vec, winding_normal};
use super::ray::LocalRay;
use super::tree::{self, Tree};
use super::tree_walk::Steps;
use super::triangles::{Triangle, Triangles};
use super::{InstanceId, Placement, Ray};
use crate::math::predicates::TriangleFilter;
use glam::DVec3;

/// Corners that do not move.
#[derive(Clone, Debug)]
pub struct Still {
    triangles: Triangles,
    normals: Option<Vec<[f32; 3]>>,
    tree: Tree,
    area: f64,
    dropped: usize,
}

/// A triangle mesh at rest.
pub type Mesh = TriangleMesh<Still>;

impl Corners for Still {
    type At<'a> = &'a Self;

    const FILTER_EXTENT: f64 = 1.0;

    #[inline(always)]
    fn at(&self, _: f64) -> &Self {
        self
    }

    fn keys(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self)
    }

    fn len(&self) -> usize {
        self.triangles.len()
    }

    fn bytes(&self) -> usize {
        let normals = self.normals.as_ref().map_or(0, Vec::len);
        self.triangles.bytes() + 12 * normals + self.tree.bytes()
    }

    #[inline]
    fn takes_turns(&self) -> bool {
        Steps::pay(&self.tree)
    }
}

impl<'a> CornersAt for &'a Still {
    type Boxes = &'a Tree;

    #[inline(always)]
    fn triangle(self, prim: u32) -> Triangle {
        self.triangles.get(prim)
    }

    #[inline(always)]
    fn passes(self, filter: &TriangleFilter, prim: u32) -> bool {
        self.triangles.pass(filter, prim)
    }

    #[inline]
    fn normal(self, vertex: usize) -> Option<DVec3> {
        self.normals.as_ref().map(|n| vec(n[vertex]))
    }

    #[inline(always)]
    fn boxes(self) -> &'a Tree {
        &self.tree
    }

    #[inline(always)]
    fn prim(self, leaf: u32) -> u32 {
        leaf
    }

    #[inline(always)]
    fn fetch(self, leaf: u32) {
        self.triangles.fetch(leaf);
    }
}

impl Mesh {
    /// A mesh from indexed vertices; triangles run counter-clockwise seen from outside. Triangles
    /// without area are dropped (see [`Mesh::dropped`]), and the rest is reordered.
    ///
    /// # Errors
    /// [`MeshError`] if a number is not finite, an index is out of range, the arrays do not match,
    /// or no triangle is left.
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
        let attributes =
            (normals.is_some() || uvs.is_some()).then_some(Attributes { indices, uvs });
        Ok(Self {
            corners: Still {
                triangles,
                normals,
                tree,
                area,
                dropped,
            },
            attributes,
            extent: mesh::extent(bounds),
            bounds,
        })
    }

    /// The same mesh with its triangles wound the other way round.
    #[must_use]
    pub fn turned(&self) -> Self {
        let mut mesh = self.clone();
        mesh.corners.triangles.turn();
        if let Some(attributes) = &mut mesh.attributes {
            attributes.indices.iter_mut().for_each(|t| t.swap(1, 2));
        }
        mesh
    }

    /// The first triangle of the mesh, as instance `id` under `placement`, that a ray hits, and the
    /// distance.
    #[must_use]
    pub fn first_hit(
        &self,
        id: InstanceId,
        placement: &Placement,
        ray: &Ray,
    ) -> Option<(f64, u32)> {
        let to_object = &placement.to_object;
        let local = LocalRay::new(ray, id, to_object, ray.t_max, self.extent());
        let (t, prim, _) = self.closest(&local, 0.0)?;
        Some((t, prim))
    }

    /// Normals at the vertices of triangle `prim`, not of unit length; `None` where the mesh has
    /// none.
    #[must_use]
    pub fn vertex_normals(&self, prim: u32) -> Option<[DVec3; 3]> {
        let normals = self.corners.normals.as_ref()?;
        let of = |v: u32| vec(normals[v as usize]);
        Some(self.attributes.as_ref()?.indices[prim as usize].map(of))
    }

    /// Number of triangles without area that were dropped.
    #[must_use]
    pub fn dropped(&self) -> usize {
        self.corners.dropped
    }

    /// Area in object space.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.corners.area
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

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
            let point = mesh.local_point(prim, DVec2::new(0.3, 0.5), 0.0);
            let (p, n) = (point.p, point.ns.expect("has normals"));
            assert!((n - DVec3::new(p.x + 0.5, p.y - 0.25, 1.0)).length() < 1e-12);
            assert!((point.uv - DVec2::new(p.x + 2.0 * p.z, p.y)).length() < 1e-12);
        }
    }
}
