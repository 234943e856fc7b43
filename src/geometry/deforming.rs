//! Meshes whose vertices move: positions and normals keyed over time, interpolated linearly at the
//! time of a ray.
//!
//! At each time the vertices are rounded to f32 like those of any mesh, every one in the same way
//! for all its triangles, so that the surface is as watertight as a [`super::Mesh`]. The boxes of
//! the tree move as well, along lines. Where vertices do not, or where those that are near one
//! another part, rays test many triangles in vain; the shutter is then cut into segments with a
//! tree each, as many as measured tests per ray pay for.

use super::mesh::{self, Attributes, Corners, CornersAt, MeshError, TriangleMesh, check, vec};
use super::moving_tree::{MovingTree, MovingTreeAt};
use super::ray::LocalRay;
use super::shape::Shape;
use super::shutter::Shutter;
use super::tree;
use super::tree_walk::Steps;
use super::triangles::{Triangle, Triangles};
use super::{InstanceId, Mesh, Ray};
use crate::math::hash::{random_bits, unit_f64};
use crate::math::predicates::TriangleFilter;
use crate::math::sampling::uniform_sphere;
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// The vertices of a mesh at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyFrame {
    /// Seconds.
    pub time_s: f64,
    /// One per vertex.
    pub positions: Vec<[f32; 3]>,
    /// One per vertex, or none.
    pub normals: Option<Vec<[f32; 3]>>,
}

/// Why frames are no mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeformingError {
    /// One of the frames is no mesh.
    #[error("frame {frame}: {source}")]
    Mesh {
        /// Which frame, from 0.
        frame: usize,
        /// Fault of the key.
        source: MeshError,
    },
    /// No frames, or times that do not rise.
    #[error("the times of the frames must rise")]
    NotAscending,
    /// The frames have different numbers of vertices.
    #[error("frame {frame} has {count} vertices where the first has {expected}")]
    WrongCount {
        /// Which frame, from 0.
        frame: usize,
        /// Number of its vertices.
        count: usize,
        /// Those of the first.
        expected: usize,
    },
}

/// Corners that are keyed over time.
#[derive(Debug)]
pub struct Keyed {
    keys: Vec<Key>,
    shutter: Shutter,
    segments: Vec<Segment>,
}

/// A triangle mesh that changes its form within the shutter.
pub type Deforming = TriangleMesh<Keyed>;

/// Corners and normals at one moment.
#[derive(Debug)]
struct Key {
    /// Seconds.
    time_s: f64,
    triangles: Triangles,
    /// One per vertex, or none in all keys.
    normals: Option<Vec<[f32; 3]>>,
}

/// The tree of a part of the shutter, and the triangle of each of its leaves where these are not in
/// the order of the triangles.
#[derive(Debug)]
struct Segment {
    tree: MovingTree,
    order: Option<Vec<u32>>,
}

/// Corners between two keys.
#[derive(Clone, Copy, Debug)]
pub(super) struct Between<'a> {
    from: &'a Key,
    to: &'a Key,
    /// Fraction of the way.
    u: f64,
    segment: &'a Segment,
    /// Fraction of the segment.
    fraction: f64,
}

/// Most segments of a shutter.
const MOST_SEGMENTS: usize = 16;
/// Most leaves of all segments of a mesh together (some 4 GB).
const MOST_LEAVES: usize = 1 << 28;
/// Twice the segments must leave at most this share of the triangles tested per ray.
const WORTHWHILE: f64 = 0.65;
/// Rays by which tests are measured.
const TRIAL_RAYS: u64 = 512;

/// The mesh of `frames` (at ascending times, held before the first and after the last) with the
/// same triangles over `shutter`: an ordinary one if it does not change while the shutter is open.
///
/// # Errors
/// [`DeformingError`] if the frames differ in their vertices, their times do not rise, or one of
/// them is no mesh.
pub fn shape(
    frames: &[KeyFrame],
    uvs: Option<Vec<[f32; 2]>>,
    triangles: Vec<[u32; 3]>,
    shutter: Shutter,
) -> Result<Shape, DeformingError> {
    let rising = frames.windows(2).all(|w| w[0].time_s < w[1].time_s);
    let Some(first) = frames.first().filter(|_| rising) else {
        return Err(DeformingError::NotAscending);
    };
    let expected = first.positions.len();
    for (frame, f) in frames.iter().enumerate() {
        if f.positions.len() != expected {
            return Err(DeformingError::WrongCount {
                frame,
                count: f.positions.len(),
                expected,
            });
        }
        check("position", &f.positions, expected)
            .and_then(|()| check("normal", f.normals.as_deref().unwrap_or_default(), expected))
            .map_err(|source| DeformingError::Mesh { frame, source })?;
    }
    // the first frame as a mesh: indices, counts and emptiness are checked there
    let still = |frames: &[KeyFrame], t: f64| {
        let at = |v: usize| position(frames, v, t);
        let positions: Vec<[f32; 3]> = (0..expected).map(at).collect();
        let normals = has_normals(frames).then(|| {
            (0..expected)
                .map(|v| normal(frames, v, t).as_vec3().to_array())
                .collect()
        });
        Mesh::new(&positions, normals, uvs.clone(), triangles.clone())
            .map_err(|source| DeformingError::Mesh { frame: 0, source })
    };
    let inside = held(frames, shutter);
    let mesh = still(frames, shutter.open_s)?;
    if shutter.is_instant() || inside.windows(2).all(|w| same(&w[0], &w[1])) {
        return Ok(Shape::Mesh(Arc::new(mesh)));
    }
    let mut triangles = triangles;
    triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    let deforming = Deforming::new(inside, uvs, triangles, shutter);
    Ok(Shape::Deforming(Arc::new(deforming)))
}

/// The frames within the shutter, with one at each of its ends.
fn held(frames: &[KeyFrame], shutter: Shutter) -> Vec<KeyFrame> {
    let cut = |time_s: f64| {
        let count = frames[0].positions.len();
        KeyFrame {
            time_s,
            positions: (0..count).map(|v| position(frames, v, time_s)).collect(),
            normals: has_normals(frames).then(|| {
                (0..count)
                    .map(|v| normal(frames, v, time_s).as_vec3().to_array())
                    .collect()
            }),
        }
    };
    let mut inside = vec![cut(shutter.open_s)];
    inside.extend(
        frames
            .iter()
            .filter(|f| f.time_s > shutter.open_s && f.time_s < shutter.close_s)
            .cloned(),
    );
    if !shutter.is_instant() {
        inside.push(cut(shutter.close_s));
    }
    inside
}

fn same(a: &KeyFrame, b: &KeyFrame) -> bool {
    a.positions == b.positions && a.normals == b.normals
}

fn has_normals(frames: &[KeyFrame]) -> bool {
    frames.iter().all(|f| f.normals.is_some())
}

/// The key at or before a time, the one after it, and the fraction of the way between.
#[inline]
fn between<K>(keys: &[K], time_s: impl Fn(&K) -> f64, t: f64) -> (&K, &K, f64) {
    let next = keys.partition_point(|key| time_s(key) <= t);
    if next == 0 {
        return (&keys[0], &keys[0], 0.0);
    }
    let from = &keys[next - 1];
    let Some(to) = keys.get(next) else {
        return (from, from, 0.0);
    };
    (from, to, (t - time_s(from)) / (time_s(to) - time_s(from)))
}

#[inline]
fn lerp(a: [f32; 3], b: [f32; 3], u: f64) -> DVec3 {
    vec(a) + (vec(b) - vec(a)) * u
}

fn position(frames: &[KeyFrame], vertex: usize, t: f64) -> [f32; 3] {
    let (a, b, u) = between(frames, |f| f.time_s, t);
    lerp(a.positions[vertex], b.positions[vertex], u)
        .as_vec3()
        .to_array()
}

/// The interpolated normal (not of unit length); zero where a frame has none.
fn normal(frames: &[KeyFrame], vertex: usize, t: f64) -> DVec3 {
    let (a, b, u) = between(frames, |f| f.time_s, t);
    let of = |f: &KeyFrame| f.normals.as_ref().map_or([0.0; 3], |n| n[vertex]);
    lerp(of(a), of(b), u)
}

/// The corners of triangle `prim` at the fraction `u` of the way, rounded to f32.
#[inline(always)]
fn triangle(from: &Key, to: &Key, u: f64, prim: u32) -> Triangle {
    let (from, to) = (from.triangles.get(prim), to.triangles.get(prim));
    let corner = |i: usize| lerp(from[i], to[i], u).as_vec3().to_array();
    [corner(0), corner(1), corner(2)]
}

impl Corners for Keyed {
    type At<'a> = Between<'a>;

    // interpolation in f32 errs by less than 7 units of the extent, which the filter's own bound
    // would not hold
    const FILTER_EXTENT: f64 = 2.0;

    #[inline]
    fn at(&self, time: f64) -> Between<'_> {
        let (from, to, u) = between(&self.keys, |key| key.time_s, time);
        let count = self.segments.len();
        let Shutter { open_s, close_s } = self.shutter;
        let along = (time - open_s) / (close_s - open_s) * count as f64;
        // negative numbers become 0
        let index = (along as usize).min(count - 1);
        Between {
            from,
            to,
            u,
            segment: &self.segments[index],
            fraction: (along - index as f64).clamp(0.0, 1.0),
        }
    }

    fn keys(&self) -> impl Iterator<Item = Between<'_>> {
        self.keys.iter().map(|key| self.at(key.time_s))
    }

    fn len(&self) -> usize {
        self.keys[0].triangles.len()
    }

    fn bytes(&self) -> usize {
        let key = |k: &Key| k.triangles.bytes() + 12 * k.normals.as_ref().map_or(0, Vec::len);
        let segment = |s: &Segment| s.tree.bytes() + 4 * s.order.as_ref().map_or(0, Vec::len);
        let segments: usize = self.segments.iter().map(segment).sum();
        self.keys.iter().map(key).sum::<usize>() + segments
    }

    #[inline]
    fn takes_turns(&self) -> bool {
        self.segments.iter().all(|s| Steps::pay(&s.tree.tree))
    }
}

impl<'a> CornersAt for Between<'a> {
    type Boxes = MovingTreeAt<'a>;

    #[inline(always)]
    fn triangle(self, prim: u32) -> Triangle {
        triangle(self.from, self.to, self.u, prim)
    }

    #[inline(always)]
    fn passes(self, filter: &TriangleFilter, prim: u32) -> bool {
        let (from, to) = (&self.from.triangles, &self.to.triangles);
        from.pass_between(to, self.u as f32, filter, prim)
    }

    #[inline]
    fn normal(self, vertex: usize) -> Option<DVec3> {
        let (from, to) = (self.from.normals.as_ref()?, self.to.normals.as_ref()?);
        Some(lerp(from[vertex], to[vertex], self.u))
    }

    #[inline(always)]
    fn boxes(self) -> MovingTreeAt<'a> {
        self.segment.tree.at(self.fraction)
    }

    #[inline(always)]
    fn prim(self, leaf: u32) -> u32 {
        match &self.segment.order {
            None => leaf,
            Some(order) => order[leaf as usize],
        }
    }

    #[inline(always)]
    fn fetch(self, leaf: u32) {
        // the order would be waited for as well
        if self.segment.order.is_none() {
            self.from.triangles.fetch(leaf);
            self.to.triangles.fetch(leaf);
        }
    }
}

impl Deforming {
    /// A mesh of `frames` that cover the shutter.
    fn new(
        mut frames: Vec<KeyFrame>,
        mut uvs: Option<Vec<[f32; 2]>>,
        mut triangles: Vec<[u32; 3]>,
        shutter: Shutter,
    ) -> Self {
        let mut bounds = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in frames.iter().flat_map(|frame| &frame.positions) {
            bounds.0 = bounds.0.min(vec(*p));
            bounds.1 = bounds.1.max(vec(*p));
        }
        let extent = mesh::extent(bounds);
        let mut whole = Keyed::cut(&keys(&frames, &triangles), shutter, extent, 1);
        if let Some(order) = whole[0].order.take() {
            sort(&order, &mut triangles, &mut frames, &mut uvs);
        }
        let keys = keys(&frames, &triangles);
        let attributes = (keys[0].normals.is_some() || uvs.is_some()).then_some(Attributes {
            indices: triangles,
            uvs,
        });
        let mut mesh = Self {
            corners: Keyed {
                keys,
                shutter,
                segments: whole,
            },
            attributes,
            extent,
            bounds,
        };
        mesh.choose_segments();
        mesh
    }

    /// Number of parts of the shutter with a tree each.
    #[must_use]
    pub fn segment_count(&self) -> usize {
        self.corners.segments.len()
    }

    /// Cuts the shutter into as many segments as pay for themselves.
    fn choose_segments(&mut self) {
        let mut tests = self.tests_per_ray();
        let count = |mesh: &Self| mesh.corners.segments.len();
        while count(self) < MOST_SEGMENTS && 2 * count(self) * self.corners.len() <= MOST_LEAVES {
            let Keyed { keys, shutter, .. } = &self.corners;
            let finer = Keyed::cut(keys, *shutter, self.extent, 2 * count(self));
            let coarser = std::mem::replace(&mut self.corners.segments, finer);
            let after = self.tests_per_ray();
            if after > WORTHWHILE * tests {
                self.corners.segments = coarser;
                break;
            }
            tests = after;
        }
    }

    /// Triangles that a ray between random points about the mesh is tested against, on average.
    fn tests_per_ray(&self) -> f64 {
        let center = (self.bounds.0 + self.bounds.1) / 2.0;
        let radius = (self.bounds.1 - self.bounds.0).length() / 2.0;
        let mut tests = 0u64;
        for i in 0..TRIAL_RAYS {
            let number = |j: u64| unit_f64(random_bits(0x6465_666f, 5 * i + j));
            let end = |u: f64, v: f64| center + radius * uniform_sphere([u, v]);
            let (o, far) = (end(number(0), number(1)), end(number(2), number(3)));
            let time = self.corners.shutter.at(number(4));
            let ray = Ray::new(o, (far - o).normalize());
            let local = LocalRay::new(
                &ray,
                InstanceId(0),
                &DAffine3::IDENTITY,
                f64::INFINITY,
                self.extent(),
            );
            self.visit(&local, time, |_| tests += 1);
        }
        tests as f64 / TRIAL_RAYS as f64
    }
}

impl Keyed {
    /// Trees over `count` equal parts of the shutter; no coordinate is beyond `extent`.
    fn cut(keys: &[Key], shutter: Shutter, extent: f64, count: usize) -> Vec<Segment> {
        let rounding = extent * f64::from(f32::EPSILON);
        (0..count)
            .map(|i| {
                let at = |i: usize| shutter.at(i as f64 / count as f64);
                let (a, b) = (at(i), at(i + 1));
                let times = keys.iter().map(|key| key.time_s);
                let inner: Vec<f64> = times.filter(|t| *t > a && *t < b).collect();
                let ends = |prim: usize| {
                    let at = |t| box_at(keys, prim as u32, t, rounding);
                    let inner = inner.iter().map(|t| ((t - a) / (b - a), at(*t)));
                    holding([a, b].map(at), inner)
                };
                let count = keys[0].triangles.len();
                let (tree, order) = MovingTree::build(count, tree::LEAF_LIMIT, ends);
                let order = Some(order);
                Segment { tree, order }
            })
            .collect()
    }
}

/// The box around a triangle at a time, wider by how far corners are from the lines that they are
/// rounded from.
fn box_at(keys: &[Key], prim: u32, t: f64, rounding: f64) -> (DVec3, DVec3) {
    let (from, to, u) = between(keys, |key| key.time_s, t);
    let (from, to) = (from.triangles.get(prim), to.triangles.get(prim));
    let corners = [0, 1, 2].map(|i| lerp(from[i], to[i], u));
    let [low, high] = [DVec3::min, DVec3::max].map(|of| {
        corners
            .into_iter()
            .reduce(of)
            .expect("invariant: a triangle has corners")
    });
    (low - rounding, high + rounding)
}

/// The boxes at the ends of a time, moved apart until what is between them at any fraction of it
/// holds what is there.
fn holding(
    mut ends: [(DVec3, DVec3); 2],
    inner: impl Iterator<Item = (f64, (DVec3, DVec3))>,
) -> [(DVec3, DVec3); 2] {
    let [from, to] = ends;
    let (mut low, mut high) = (DVec3::ZERO, DVec3::ZERO);
    for (u, there) in inner {
        low = low.max(from.0.lerp(to.0, u) - there.0);
        high = high.max(there.1 - from.1.lerp(to.1, u));
    }
    for end in &mut ends {
        end.0 -= low;
        end.1 += high;
    }
    ends
}

/// The corners of the triangles at each frame.
fn keys(frames: &[KeyFrame], triangles: &[[u32; 3]]) -> Vec<Key> {
    let with_normals = has_normals(frames);
    let key = |f: &KeyFrame| {
        let of = |t: &[u32; 3]| t.map(|v| f.positions[v as usize]);
        Key {
            time_s: f.time_s,
            triangles: Triangles::new(triangles.iter().map(of)),
            normals: f.normals.clone().filter(|_| with_normals),
        }
    };
    frames.iter().map(key).collect()
}

/// Renumbers triangles and vertices in the order of the leaves of the only tree: what is tested
/// together is near in memory.
fn sort(
    order: &[u32],
    triangles: &mut Vec<[u32; 3]>,
    frames: &mut [KeyFrame],
    uvs: &mut Option<Vec<[f32; 2]>>,
) {
    *triangles = order.iter().map(|&i| triangles[i as usize]).collect();
    let mut old = Vec::new();
    let mut new = vec![u32::MAX; frames[0].positions.len()];
    for v in triangles.as_flattened_mut() {
        let number = &mut new[*v as usize];
        if *number == u32::MAX {
            *number = old.len() as u32;
            old.push(*v as usize);
        }
        *v = *number;
    }
    for frame in frames {
        frame.positions = old.iter().map(|&v| frame.positions[v]).collect();
        if let Some(normals) = &mut frame.normals {
            *normals = old.iter().map(|&v| normals[v]).collect();
        }
    }
    if let Some(uvs) = uvs {
        *uvs = old.iter().map(|&v| uvs[v]).collect();
    }
}
