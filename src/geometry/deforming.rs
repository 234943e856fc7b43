//! Meshes whose vertices move: positions and normals keyed over time, interpolated linearly at the time of a ray.
//!
//! At each time the vertices are rounded to f32 like those of any mesh, every one in the same way for all its triangles, so
//! that the surface is as watertight as a [`super::Mesh`]. The tree holds swept boxes, which are exact for vertices that move along
//! lines. Where triangles move far in comparison to their size, boxes overlap and rays test many triangles in vain; the
//! shutter is then cut into segments with a tree each, as many as measured tests per ray pay for.

use super::mesh::{self, MeshError, check, edges_pair_up, vec, winding_normal};
use super::ray::LocalRay;
use super::shape::{LocalPoint, Shape};
use super::shutter::Shutter;
use super::tree::{self, Entry, Tree};
use super::triangles::{Corners, Triangles};
use super::{InstanceId, Mesh, Ray};
use crate::math::distribution::AliasTable;
use crate::math::hash::{random_bits, unit_f64};
use crate::math::predicates::{TriangleFilter, TriangleHit, TriangleRay};
use crate::math::sampling::uniform_sphere;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::sync::{Arc, OnceLock};

/// The vertices of a mesh at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
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
        /// What is wrong.
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
        /// Its vertices.
        count: usize,
        /// Those of the first.
        expected: usize,
    },
}

/// A mesh that changes its form within the shutter.
#[derive(Debug)]
pub struct Deforming {
    frames: Vec<Frame>,
    uvs: Option<Vec<[f32; 2]>>,
    triangles: Vec<[u32; 3]>,
    /// Corners of all triangles, per frame.
    corners: Vec<Triangles>,
    shutter: Shutter,
    segments: Vec<Segment>,
    bounds: (DVec3, DVec3),
    /// Triangles by their mean area over the frames, built when the mesh is first sampled.
    area_table: OnceLock<AliasTable>,
}

/// The tree of a part of the shutter, and the triangle of each of its leaves.
#[derive(Debug)]
struct Segment {
    tree: Tree,
    order: Vec<u32>,
}

/// Most segments of a shutter.
const MOST_SEGMENTS: usize = 16;
/// Most leaves of all segments of a mesh together (some 3 GB).
const MOST_LEAVES: usize = 1 << 28;
/// Twice the segments must leave at most this share of the triangles tested per ray.
const WORTHWHILE: f64 = 0.65;
/// Rays by which tests are measured.
const TRIAL_RAYS: u64 = 512;

/// The mesh of `frames` (at ascending times, held before the first and after the last) with the same triangles over `shutter`:
/// an ordinary one if it does not change while the shutter is open.
///
/// # Errors
/// [`DeformingError`] if the frames differ in their vertices, their times do not rise, or one of them is no mesh.
pub fn shape(
    frames: &[Frame],
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
    let still = |frames: &[Frame], t: f64| {
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
    let mut deforming = Deforming {
        bounds: (DVec3::INFINITY, DVec3::NEG_INFINITY),
        frames: inside,
        uvs,
        triangles,
        corners: Vec::new(),
        shutter,
        segments: Vec::new(),
        area_table: OnceLock::new(),
    };
    for frame in &deforming.frames {
        for p in &frame.positions {
            deforming.bounds.0 = deforming.bounds.0.min(vec(*p));
            deforming.bounds.1 = deforming.bounds.1.max(vec(*p));
        }
    }
    deforming.choose_segments();
    Ok(Shape::Deforming(Arc::new(deforming)))
}

/// The frames within the shutter, with one at each of its ends.
fn held(frames: &[Frame], shutter: Shutter) -> Vec<Frame> {
    let cut = |time_s: f64| {
        let count = frames[0].positions.len();
        Frame {
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

fn same(a: &Frame, b: &Frame) -> bool {
    a.positions == b.positions && a.normals == b.normals
}

fn has_normals(frames: &[Frame]) -> bool {
    frames.iter().all(|f| f.normals.is_some())
}

/// The frame at or before a time, the one after it, and the fraction of the way between.
type Between = (usize, usize, f64);

#[inline]
fn between(frames: &[Frame], t: f64) -> Between {
    let next = frames.partition_point(|f| f.time_s <= t);
    if next == 0 {
        return (0, 0, 0.0);
    }
    if next == frames.len() {
        return (next - 1, next - 1, 0.0);
    }
    let (a, b) = (frames[next - 1].time_s, frames[next].time_s);
    (next - 1, next, (t - a) / (b - a))
}

#[inline]
fn lerp(a: [f32; 3], b: [f32; 3], u: f64) -> DVec3 {
    vec(a) + (vec(b) - vec(a)) * u
}

fn position(frames: &[Frame], vertex: usize, t: f64) -> [f32; 3] {
    let (a, b, u) = between(frames, t);
    lerp(frames[a].positions[vertex], frames[b].positions[vertex], u)
        .as_vec3()
        .to_array()
}

/// The interpolated normal (not of unit length); zero where a frame has none.
fn normal(frames: &[Frame], vertex: usize, t: f64) -> DVec3 {
    let (a, b, u) = between(frames, t);
    let of = |f: &Frame| f.normals.as_ref().map_or([0.0; 3], |n| n[vertex]);
    lerp(of(&frames[a]), of(&frames[b]), u)
}

impl Deforming {
    /// Number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Parts of the shutter with a tree each.
    #[must_use]
    pub fn segment_count(&self) -> usize {
        self.segments.len()
    }

    /// Bounds in object space over the shutter.
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        self.bounds
    }

    /// Largest coordinate in object space over the shutter.
    #[inline]
    pub(super) fn extent(&self) -> f64 {
        self.bounds.0.abs().max(self.bounds.1.abs()).max_element()
    }

    /// Memory held, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let frame = |f: &Frame| 12 * (f.positions.len() + f.normals.as_ref().map_or(0, Vec::len));
        self.frames.iter().map(frame).sum::<usize>()
            + 12 * self.triangles.len()
            + self.corners.iter().map(Triangles::bytes).sum::<usize>()
            + self.uvs.as_ref().map_or(0, |uvs| 8 * uvs.len())
            + self
                .segments
                .iter()
                .map(|s| s.tree.bytes() + 4 * s.order.len())
                .sum::<usize>()
            + self.area_table.get().map_or(0, AliasTable::bytes)
    }

    /// The corners of triangle `prim` at `time`, counter-clockwise seen from outside.
    #[must_use]
    pub fn corners(&self, prim: u32, time: f64) -> [DVec3; 3] {
        self.rounded_corners(prim, time).map(vec)
    }

    fn rounded_corners(&self, prim: u32, time: f64) -> Corners {
        self.corners_between(prim, between(&self.frames, time))
    }

    #[inline(always)]
    fn corners_between(&self, prim: u32, (a, b, u): Between) -> Corners {
        let (from, to) = (self.corners[a].get(prim), self.corners[b].get(prim));
        [0, 1, 2].map(|i| lerp(from[i], to[i], u).as_vec3().to_array())
    }

    /// Whether every edge is shared by two triangles of opposite winding. Vertices count as one where they are at one
    /// place in all frames.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        // adding 0 turns -0 into 0
        let key = |v: u32| {
            self.frames
                .iter()
                .map(move |f| f.positions[v as usize].map(|x| (x + 0.0).to_bits()))
        };
        let mut by_position: Vec<u32> = (0..self.frames[0].positions.len() as u32).collect();
        by_position.sort_unstable_by(|&a, &b| key(a).cmp(key(b)));
        let mut welded = vec![0u32; by_position.len()];
        for pair in by_position.windows(2) {
            let step = u32::from(!key(pair[0]).eq(key(pair[1])));
            welded[pair[1] as usize] = welded[pair[0] as usize] + step;
        }
        let corners = self.triangles.iter().map(|t| t.map(|v| welded[v as usize]));
        edges_pair_up(corners)
    }

    /// Cuts the shutter into as many segments as pay for themselves.
    fn choose_segments(&mut self) {
        self.lay_out();
        self.segments = self.cut(1);
        self.sort();
        self.lay_out();
        let mut tests = self.tests_per_ray();
        while self.segments.len() < MOST_SEGMENTS
            && 2 * self.segments.len() * self.triangles.len() <= MOST_LEAVES
        {
            let finer = self.cut(2 * self.segments.len());
            let coarser = std::mem::replace(&mut self.segments, finer);
            let after = self.tests_per_ray();
            if after > WORTHWHILE * tests {
                self.segments = coarser;
                break;
            }
            tests = after;
        }
    }

    /// Renumbers triangles and vertices in the order of the leaves of the only tree: what is tested together is near in memory.
    fn sort(&mut self) {
        let order = &mut self.segments[0].order;
        let mut triangles: Vec<[u32; 3]> =
            order.iter().map(|&i| self.triangles[i as usize]).collect();
        for (leaf, prim) in order.iter_mut().enumerate() {
            *prim = leaf as u32;
        }
        let mut old = Vec::new();
        let mut new = vec![u32::MAX; self.frames[0].positions.len()];
        for v in triangles.as_flattened_mut() {
            let number = &mut new[*v as usize];
            if *number == u32::MAX {
                *number = old.len() as u32;
                old.push(*v as usize);
            }
            *v = *number;
        }
        self.triangles = triangles;
        for frame in &mut self.frames {
            frame.positions = old.iter().map(|&v| frame.positions[v]).collect();
            if let Some(normals) = &mut frame.normals {
                *normals = old.iter().map(|&v| normals[v]).collect();
            }
        }
        if let Some(uvs) = &mut self.uvs {
            *uvs = old.iter().map(|&v| uvs[v]).collect();
        }
    }

    /// Writes down the corners of the triangles.
    fn lay_out(&mut self) {
        let corners = |f: &Frame| {
            let of = |t: &[u32; 3]| t.map(|v| f.positions[v as usize]);
            Triangles::new(self.triangles.iter().map(of))
        };
        self.corners = self.frames.iter().map(corners).collect();
    }

    /// Trees over `count` equal parts of the shutter.
    fn cut(&self, count: usize) -> Vec<Segment> {
        (0..count)
            .map(|i| {
                let at = |i: usize| self.shutter.at(i as f64 / count as f64);
                let (a, b) = (at(i), at(i + 1));
                let mut times = vec![a, b];
                let inner = self.frames.iter().map(|f| f.time_s);
                times.extend(inner.filter(|t| (a..b).contains(t)));
                let swept = |prim: usize| {
                    let corners = times.iter().flat_map(|&t| self.corners(prim as u32, t));
                    corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
                        (low.min(p), high.max(p))
                    })
                };
                let (tree, order) = Tree::build(self.triangles.len(), tree::LEAF_LIMIT, swept);
                Segment { tree, order }
            })
            .collect()
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
            let time = self.shutter.at(number(4));
            let ray = Ray::new(o, (far - o).normalize(), time);
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

    #[inline]
    fn segment(&self, time: f64) -> &Segment {
        let count = self.segments.len();
        let Shutter { open_s, close_s } = self.shutter;
        let fraction = (time - open_s) / (close_s - open_s);
        // negative fractions become 0
        &self.segments[((fraction * count as f64) as usize).min(count - 1)]
    }

    /// The closest hit, with `tested` called for every triangle looked at.
    #[inline]
    fn visit(
        &self,
        ray: &LocalRay,
        time: f64,
        mut tested: impl FnMut(u32),
    ) -> Option<(f64, u32, DVec2)> {
        let (segment, moment) = (self.segment(time), between(&self.frames, time));
        let mut best = None;
        let mut t_best = ray.t_max;
        let entry = segment.tree.enter(ray.o, ray.d, ray.t_max)?;
        let prepared = self.prepare(ray, &entry);
        segment.tree.closest(
            entry,
            |_| (),
            |leaves| {
                let mut nearer = None;
                for leaf in leaves {
                    let prim = segment.order[leaf as usize];
                    tested(prim);
                    if let Some(hit) = self.hit(ray, &prepared, prim, moment, t_best) {
                        t_best = hit.t;
                        best = Some((hit.t, prim, DVec2::from(hit.weights)));
                        nearer = Some(hit.t);
                    }
                }
                nearer
            },
        );
        best
    }

    /// What tests of triangles need to know of a ray that enters a tree.
    #[inline(always)]
    fn prepare(&self, ray: &LocalRay, entry: &Entry) -> (TriangleRay, TriangleFilter) {
        let tri = TriangleRay::new(ray.o, ray.d);
        // twice the extent: interpolation in f32 errs by less than 7 units of it, which the filter's own bound would not hold
        let filter = TriangleFilter::new(&tri, ray.at(entry.t), 2.0 * self.extent());
        (tri, filter)
    }

    #[inline(always)]
    fn hit(
        &self,
        ray: &LocalRay,
        (tri, filter): &(TriangleRay, TriangleFilter),
        prim: u32,
        moment: Between,
        t_max: f64,
    ) -> Option<TriangleHit> {
        let (a, b, u) = moment;
        let (from, to) = (&self.corners[a], &self.corners[b]);
        let may_hit = from.pass_between(to, u as f32, filter, prim);
        if !may_hit || ray.start == Some(prim) || ray.end == Some(prim) {
            return None;
        }
        let corners = self.corners_between(prim, moment);
        let hit = tri.intersect(&corners, t_max)?;
        let n = winding_normal(&corners);
        ray.counts(hit.t, hit.d_dot_normal / n.length())
            .then_some(hit)
    }

    /// The closest hit: parameter, triangle and barycentric weights of its second and third vertex.
    #[inline]
    pub(super) fn closest(&self, ray: &LocalRay, time: f64) -> Option<(f64, u32, DVec2)> {
        self.visit(ray, time, |_| ())
    }

    /// Whether any triangle is hit.
    #[inline]
    pub(super) fn occluded(&self, ray: &LocalRay, time: f64) -> bool {
        let (segment, moment) = (self.segment(time), between(&self.frames, time));
        let Some(entry) = segment.tree.enter(ray.o, ray.d, ray.t_max) else {
            return false;
        };
        let prepared = self.prepare(ray, &entry);
        segment.tree.any(
            entry,
            |_| (),
            |mut leaves| {
                leaves.any(|leaf| {
                    let prim = segment.order[leaf as usize];
                    self.hit(ray, &prepared, prim, moment, ray.t_max).is_some()
                })
            },
        )
    }

    /// The point of triangle `prim` with barycentric `weights` of its second and third vertex, at `time`.
    pub(super) fn local_point(&self, prim: u32, weights: DVec2, time: f64) -> LocalPoint {
        let corners = self.rounded_corners(prim, time);
        let [a, b, c] = corners.map(vec);
        let blend = [1.0 - weights.x - weights.y, weights.x, weights.y];
        let vertices = self.triangles[prim as usize].map(|v| v as usize);
        let ns = has_normals(&self.frames).then(|| {
            let [i, j, k] = vertices.map(|v| normal(&self.frames, v, time));
            i * blend[0] + j * blend[1] + k * blend[2]
        });
        let uv = self.uvs.as_ref().map_or(weights, |uvs| {
            let [i, j, k] = vertices.map(|v| DVec2::from(uvs[v].map(f64::from)));
            i * blend[0] + j * blend[1] + k * blend[2]
        });
        LocalPoint {
            p: a + (b - a) * weights.x + (c - a) * weights.y,
            ng: winding_normal(&corners).normalize(),
            ns,
            uv,
            prim,
        }
    }

    /// Derivatives of the position of triangle `prim` at `time` by its texture coordinates, as [`Mesh::tangents`].
    pub(super) fn tangents(&self, prim: u32, time: f64) -> Option<[DVec3; 2]> {
        let uvs = self.uvs.as_ref()?;
        let uv = |v: u32| DVec2::from(uvs[v as usize].map(f64::from));
        let at = self.triangles[prim as usize].map(uv);
        mesh::tangents(self.corners(prim, time), at)
    }

    /// Weights at the point of triangle `prim` nearest to `p` at `time`, as [`Mesh::weights`].
    pub(super) fn weights(&self, prim: u32, p: DVec3, time: f64) -> DVec2 {
        mesh::weights(self.corners(prim, time), p)
    }

    /// Whether it has texture coordinates.
    #[must_use]
    pub fn has_texture_coordinates(&self) -> bool {
        self.uvs.is_some()
    }

    fn area_table(&self) -> &AliasTable {
        self.area_table.get_or_init(|| {
            let mean = |prim: u32| {
                let areas = self.frames.iter().map(|f| self.area_of(prim, f.time_s));
                areas.sum::<f64>() / self.frames.len() as f64
            };
            let areas: Vec<f64> = (0..self.triangles.len() as u32).map(mean).collect();
            AliasTable::new(&areas).expect("invariant: the first frame has an area")
        })
    }

    fn area_of(&self, prim: u32, time: f64) -> f64 {
        winding_normal(&self.rounded_corners(prim, time)).length() / 2.0
    }

    /// A point of a triangle chosen by its mean area over the shutter, uniform within the triangle at `time`.
    pub(super) fn sample(&self, u_face: f64, u: DVec2, time: f64) -> LocalPoint {
        let prim = self.area_table().sample(u_face).index as u32;
        let s = u.x.sqrt();
        self.local_point(prim, DVec2::new(s * (1.0 - u.y), s * u.y), time)
    }

    /// What [`Self::sample`] takes for the whole area at a point of triangle `prim`: 1 / its density per object area. Infinite
    /// while the triangle has no area.
    pub(super) fn inverse_density(&self, prim: u32, time: f64) -> f64 {
        let area = self.area_of(prim, time);
        if area > 0.0 {
            area / self.area_table().pmf(prim as usize)
        } else {
            f64::INFINITY
        }
    }

    /// Area at `time` after the linear map `m`.
    pub(super) fn mapped_area(&self, m: DMat3, time: f64) -> f64 {
        (0..self.triangles.len() as u32)
            .map(|prim| {
                let [a, b, c] = self.corners(prim, time).map(|p| m * p);
                (b - a).cross(c - a).length() / 2.0
            })
            .sum()
    }
}
