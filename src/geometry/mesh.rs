//! Triangle meshes: vertices in f32, intersected watertight in f64.
//!
//! A mesh is its corners ([`Corners`]: at rest, or keyed over time) and what its triangles have
//! whenever it is. All that is asked of it is asked of its corners at one moment ([`CornersAt`]),
//! which are those of a mesh like any other: for a mesh at rest the moment is no more than a
//! reference. Corners take 36 bytes per triangle and key, in the order of the leaves of the tree,
//! and the tree about 5; indices are kept only where normals or texture coordinates need them.

use super::ray::LocalRay;
use super::shape::LocalPoint;
use super::tree::Entry;
use super::tree_walk::{Boxes, Steps};
use super::triangles::Triangle;
use crate::math::distribution::AliasTable;
use crate::math::predicates::{TriangleFilter, TriangleHit, TriangleRay};
use glam::{DMat3, DVec2, DVec3};

/// Corners of the triangles of a mesh over time, with the trees over them.
pub(super) trait Corners {
    /// Corners at one moment.
    type At<'a>: CornersAt
    where
        Self: 'a;

    /// Bound of |coordinate| that filters of triangles take, relative to the largest coordinate.
    const FILTER_EXTENT: f64;

    /// The corners at `time` in seconds.
    fn at(&self, time: f64) -> Self::At<'_>;

    /// The corners at each key.
    fn keys(&self) -> impl Iterator<Item = Self::At<'_>>;

    /// Number of triangles.
    fn len(&self) -> usize;

    /// Memory held, in bytes.
    fn bytes(&self) -> usize;

    /// Whether searches of the triangles had better take turns ([`Steps::pay`]).
    fn takes_turns(&self) -> bool;
}

/// Corners of the triangles of a mesh at one moment.
pub(super) trait CornersAt: Copy {
    /// Kind of boxes that the tree over the triangles has.
    type Boxes: Boxes;

    /// The corners of triangle `prim`, counter-clockwise seen from outside.
    fn triangle(self, prim: u32) -> Triangle;

    /// Whether `filter` lets triangle `prim` pass.
    fn passes(self, filter: &TriangleFilter, prim: u32) -> bool;

    /// The normal at a vertex (not of unit length), where the mesh has normals.
    fn normal(self, vertex: usize) -> Option<DVec3>;

    /// The boxes of the tree over the triangles.
    fn boxes(self) -> Self::Boxes;

    /// The triangle of a leaf of the tree.
    fn prim(self, leaf: u32) -> u32;

    /// Has the memory of the triangles from `leaf` on fetched, where that pays.
    fn fetch(self, leaf: u32);
}

/// A triangle mesh with its trees.
#[derive(Clone, Debug)]
pub struct TriangleMesh<C> {
    pub(super) corners: C,
    pub(super) attributes: Option<Attributes>,
    /// In object space, over the shutter.
    pub(super) bounds: (DVec3, DVec3),
    /// Largest coordinate of the bounds.
    pub(super) extent: f64,
}

/// Attributes of vertices that do not change over time.
#[derive(Clone, Debug)]
pub(super) struct Attributes {
    /// Vertices of each triangle.
    pub indices: Vec<[u32; 3]>,
    /// Texture coordinates.
    pub uvs: Option<Vec<[f32; 2]>>,
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
        /// Number of entries.
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

#[allow(private_bounds)]
impl<C: Corners> TriangleMesh<C> {
    /// Number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.corners.len()
    }

    /// The corners of triangle `prim` at `time`, counter-clockwise seen from outside.
    #[must_use]
    pub fn corners(&self, prim: u32, time: f64) -> [DVec3; 3] {
        self.corners.at(time).triangle(prim).map(vec)
    }

    /// The unit normal of triangle `prim` at `time`, outward; that of its vertices may be another.
    #[must_use]
    pub fn geometric_normal(&self, prim: u32, time: f64) -> DVec3 {
        winding_normal(&self.corners.at(time).triangle(prim)).normalize()
    }

    /// Whether its vertices have texture coordinates.
    #[must_use]
    pub fn has_texture_coordinates(&self) -> bool {
        self.attributes.as_ref().is_some_and(|a| a.uvs.is_some())
    }

    /// Bounds in object space over the shutter.
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        self.bounds
    }

    /// Memory held, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let attributes = self.attributes.as_ref().map_or(0, |a| {
            12 * a.indices.len() + 8 * a.uvs.as_ref().map_or(0, Vec::len)
        });
        self.corners.bytes() + attributes
    }

    /// Six times the volume that the mesh encloses at its first key, in object space; negative
    /// where it is wound inwards.
    #[must_use]
    pub fn signed_volume(&self) -> f64 {
        let middle = (self.bounds.0 + self.bounds.1) / 2.0;
        let Some(at) = self.corners.keys().next() else {
            return 0.0;
        };
        let part = |prim: u32| {
            let [a, b, c] = at.triangle(prim).map(|p| vec(p) - middle);
            a.dot(b.cross(c))
        };
        (0..self.corners.len() as u32).map(part).sum()
    }

    /// An edge that is not shared by two triangles of opposite winding, from vertex to vertex in
    /// object space at the first key; `None` where the mesh is closed. Vertices count as one where
    /// their positions agree at all keys, so that seams in the normals or texture coordinates are
    /// no holes. Takes time n log n.
    #[must_use]
    pub fn open_edge(&self) -> Option<[DVec3; 2]> {
        let count = 3 * self.corners.len();
        // Adding 0 turns -0 into 0.
        let key = |v: u32| {
            let corner = move |at: C::At<'_>| at.triangle(v / 3)[v as usize % 3];
            let keys = self.corners.keys();
            keys.map(move |at| corner(at).map(|x| (x + 0.0).to_bits()))
        };
        let mut by_position: Vec<u32> = (0..count as u32).collect();
        by_position.sort_unstable_by(|&a, &b| key(a).cmp(key(b)));
        let mut welded = vec![0u32; count];
        for pair in by_position.windows(2) {
            let step = u32::from(!key(pair[0]).eq(key(pair[1])));
            welded[pair[1] as usize] = welded[pair[0] as usize] + step;
        }
        let edge = unpaired_edge(welded.as_chunks::<3>().0.iter().copied())?;
        let first = self.corners.keys().next()?;
        let corner = |v: u32| vec(first.triangle(v / 3)[v as usize % 3]);
        let place = |w: u32| welded.iter().position(|&of| of == w);
        let [a, b] = edge.map(place);
        Some([corner(a? as u32), corner(b? as u32)])
    }

    /// Whether every edge is shared by two triangles of opposite winding. Takes time n log n.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.open_edge().is_none()
    }

    /// Largest coordinate in object space over the shutter.
    #[inline]
    pub(super) fn extent(&self) -> f64 {
        self.extent
    }

    /// Whether searches had better take turns.
    #[inline]
    pub(super) fn takes_turns(&self) -> bool {
        self.corners.takes_turns()
    }

    /// Ray and filter for tests of triangles by a ray that enters the tree.
    #[inline(always)]
    fn prepare(&self, ray: &LocalRay, entry: &Entry) -> (TriangleRay, TriangleFilter) {
        let tri = TriangleRay::new(ray.o, ray.d);
        let extent = C::FILTER_EXTENT * self.extent();
        let filter = TriangleFilter::new(&tri, ray.at(entry.t), extent);
        (tri, filter)
    }

    /// The closest hit: parameter, triangle and barycentric weights of its second and third vertex.
    #[inline]
    pub(super) fn closest(&self, ray: &LocalRay, time: f64) -> Option<(f64, u32, DVec2)> {
        self.visit(ray, time, |_| ())
    }

    /// The closest hit, with `tested` called for every triangle looked at.
    #[inline]
    pub(super) fn visit(
        &self,
        ray: &LocalRay,
        time: f64,
        mut tested: impl FnMut(u32),
    ) -> Option<(f64, u32, DVec2)> {
        let corners = self.corners.at(time);
        let boxes = corners.boxes();
        let entry = boxes.tree().enter(ray.o, ray.d, ray.t_max)?;
        let prepared = self.prepare(ray, &entry);
        let mut best = None;
        let mut t_best = ray.t_max;
        let fetch = |leaf| corners.fetch(leaf);
        boxes.closest(&entry, fetch, |leaves| {
            let mut nearer = None;
            for leaf in leaves {
                let prim = corners.prim(leaf);
                tested(prim);
                if let Some(hit) = hit(corners, ray, &prepared, prim, t_best) {
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
    pub(super) fn occluded(&self, ray: &LocalRay, time: f64) -> bool {
        let corners = self.corners.at(time);
        let boxes = corners.boxes();
        let Some(entry) = boxes.tree().enter(ray.o, ray.d, ray.t_max) else {
            return false;
        };
        let prepared = self.prepare(ray, &entry);
        let fetch = |leaf| corners.fetch(leaf);
        boxes.any(&entry, fetch, |mut leaves| {
            leaves.any(|leaf| hit(corners, ray, &prepared, corners.prim(leaf), ray.t_max).is_some())
        })
    }

    /// The same search, before its first step; `None` where the ray misses the bounds.
    #[inline]
    pub(super) fn start<'a>(&'a self, ray: LocalRay<'a>, time: f64) -> Option<Underway<'a, C>> {
        let corners = self.corners.at(time);
        let entry = corners.boxes().tree().enter(ray.o, ray.d, ray.t_max)?;
        let prepared = self.prepare(&ray, &entry);
        Some(Underway {
            corners,
            ray,
            entry,
            prepared,
            steps: Steps::new(),
        })
    }

    /// Calls `found` for every triangle that is hit, with the barycentric weights of its second and
    /// third vertex.
    pub(super) fn each(&self, ray: &LocalRay, time: f64, mut found: impl FnMut(u32, DVec2)) {
        let corners = self.corners.at(time);
        let boxes = corners.boxes();
        let Some(entry) = boxes.tree().enter(ray.o, ray.d, ray.t_max) else {
            return;
        };
        let prepared = self.prepare(ray, &entry);
        boxes.any(
            &entry,
            |_| (),
            |leaves| {
                for prim in leaves.map(|leaf| corners.prim(leaf)) {
                    if let Some(hit) = hit(corners, ray, &prepared, prim, ray.t_max) {
                        found(prim, DVec2::from(hit.weights));
                    }
                }
                false
            },
        );
    }

    /// The point of triangle `prim` with barycentric `weights` of its second and third vertex, at
    /// `time`.
    pub(super) fn local_point(&self, prim: u32, weights: DVec2, time: f64) -> LocalPoint {
        let at = self.corners.at(time);
        let corners = at.triangle(prim);
        let [a, b, c] = corners.map(vec);
        let blend = [1.0 - weights.x - weights.y, weights.x, weights.y];
        let (mut ns, mut uv) = (None, weights);
        if let Some(attributes) = &self.attributes {
            let [i, j, k] = attributes.indices[prim as usize].map(|v| v as usize);
            if let (Some(l), Some(m), Some(n)) = (at.normal(i), at.normal(j), at.normal(k)) {
                ns = Some(l * blend[0] + m * blend[1] + n * blend[2]);
            }
            if let Some(uvs) = &attributes.uvs {
                let at = |v: usize| DVec2::from(uvs[v].map(f64::from));
                uv = at(i) * blend[0] + at(j) * blend[1] + at(k) * blend[2];
            }
        }
        LocalPoint {
            p: a + (b - a) * weights.x + (c - a) * weights.y,
            ng: winding_normal(&corners).normalize(),
            ns,
            uv,
            prim,
        }
    }

    /// Derivatives of the position of triangle `prim` at `time` by its texture coordinates; `None`
    /// where it has none or they are degenerate.
    pub(super) fn tangents(&self, prim: u32, time: f64) -> Option<[DVec3; 2]> {
        let attributes = self.attributes.as_ref()?;
        let uvs = attributes.uvs.as_ref()?;
        let uv = |v: u32| DVec2::from(uvs[v as usize].map(f64::from));
        let at = attributes.indices[prim as usize].map(uv);
        tangents(self.corners(prim, time), at)
    }

    /// Barycentric weights of the second and third vertex at the point of triangle `prim` nearest
    /// to `p` in its plane, at `time`.
    pub(super) fn weights(&self, prim: u32, p: DVec3, time: f64) -> DVec2 {
        weights(self.corners(prim, time), p)
    }

    /// Triangles in proportion to their mean area over the keys. `None` if none has an area.
    pub(super) fn area_table(&self) -> Option<AliasTable> {
        let mut areas = vec![0.0; self.corners.len()];
        let mut keys = 0.0;
        for at in self.corners.keys() {
            for (prim, area) in (0u32..).zip(&mut areas) {
                *area += winding_normal(&at.triangle(prim)).length() / 2.0;
            }
            keys += 1.0;
        }
        areas.iter_mut().for_each(|area| *area /= keys);
        AliasTable::new(&areas)
    }

    /// Area of triangle `prim` at `time`, in object space.
    pub(super) fn area_of(&self, prim: u32, time: f64) -> f64 {
        winding_normal(&self.corners.at(time).triangle(prim)).length() / 2.0
    }

    /// Area at `time` after the linear map `m`.
    pub(super) fn mapped_area(&self, m: DMat3, time: f64) -> f64 {
        let at = self.corners.at(time);
        let area = |prim: u32| {
            let [a, b, c] = at.triangle(prim).map(|p| m * vec(p));
            (b - a).cross(c - a).length() / 2.0
        };
        (0..self.corners.len() as u32).map(area).sum()
    }
}

/// A search for any triangle that a ray hits, taken step by step.
pub(super) struct Underway<'a, C: Corners + 'a> {
    corners: C::At<'a>,
    ray: LocalRay<'a>,
    entry: Entry,
    prepared: (TriangleRay, TriangleFilter),
    steps: Steps,
}

impl<C: Corners> Underway<'_, C> {
    /// Takes a step. Whether any triangle is hit, once that is known.
    #[inline(always)]
    pub fn step(&mut self) -> Option<bool> {
        let Self {
            corners,
            ray,
            entry,
            prepared,
            steps,
        } = self;
        let corners = *corners;
        let fetch = |leaf| corners.fetch(leaf);
        steps.step(corners.boxes(), entry, fetch, |mut leaves| {
            leaves.any(|leaf| hit(corners, ray, prepared, corners.prim(leaf), ray.t_max).is_some())
        })
    }
}

/// The hit of triangle `prim`, if it counts.
#[inline(always)]
fn hit(
    corners: impl CornersAt,
    ray: &LocalRay,
    (tri, filter): &(TriangleRay, TriangleFilter),
    prim: u32,
    t_max: f64,
) -> Option<TriangleHit> {
    if !corners.passes(filter, prim) || ray.start == Some(prim) || ray.end == Some(prim) {
        return None;
    }
    let triangle = corners.triangle(prim);
    let hit = tri.intersect(&triangle, t_max)?;
    let approach = || hit.d_dot_normal / winding_normal(&triangle).length();
    ray.counts(hit.t, approach).then_some(hit)
}

/// An edge of the triangles that is not shared by two of opposite winding.
fn unpaired_edge(triangles: impl ExactSizeIterator<Item = [u32; 3]>) -> Option<[u32; 2]> {
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
        .find(|e| !(e.len() == 2 && e[0].2 != e[1].2))
        .map(|e| [e[0].0, e[0].1])
}

/// Derivatives of the position on a triangle by its texture coordinates; `None` where they are
/// degenerate.
fn tangents([a, b, c]: [DVec3; 3], [i, j, k]: [DVec2; 3]) -> Option<[DVec3; 2]> {
    let (s, t) = (j - i, k - i);
    let determinant = s.perp_dot(t);
    let (p, q) = (b - a, c - a);
    let du = (p * t.y - q * s.y) / determinant;
    let dv = (q * s.x - p * t.x) / determinant;
    (du.is_finite() && dv.is_finite()).then_some([du, dv])
}

/// Barycentric weights of the second and third corner at the point of a triangle nearest to `p` in
/// its plane.
fn weights([a, b, c]: [DVec3; 3], p: DVec3) -> DVec2 {
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
pub(super) fn winding_normal(corners: &Triangle) -> DVec3 {
    let [a, b, c] = corners.map(vec);
    (b - a).cross(c - a)
}

/// The largest coordinate of bounds.
pub(super) fn extent((low, high): (DVec3, DVec3)) -> f64 {
    low.abs().max(high.abs()).max_element()
}

pub(super) fn bounds(corners: &Triangle) -> (DVec3, DVec3) {
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
