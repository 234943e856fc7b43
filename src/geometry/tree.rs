//! One level of the tree: a wide tree of boxes that culls for f64 rays at any scale.
//!
//! obvhs builds a binary tree (parallel locally-ordered clustering, Meister and Bittner, TVCG 2018,
//! and reinsertion); its inner nodes are merged, at least expected cost, into nodes of eight (the
//! dynamic program of Ylitie, Karras and Laine, HPG 2017), whose boxes are rounded outward to
//! bytes, as there: a ray waits for memory more than for arithmetic.
//!
//! Invariant: boxes only ever cull, and never what a ray touches. They live in a frame in which the
//! tree fills -1..1; a ray is advanced in f64 to the bounds before it is rounded, so that planes
//! are at most 2 and a little away. With u = 2^-24, the distance of a plane then errs by u (start
//! of the ray) + 2u (corner of the node from it) and, in units of the inverse direction, by 2u
//! (that itself) + 2u (corner) + 2u (sum) more, and 2u (steps) where no processor fuses product and
//! sum, together 7e-7 at most, and boxes are padded by more.

use glam::{DVec3, Vec3, Vec3A};
use prefetch_index::prefetch_index;
use std::ops::Range;
use wide::f32x8;

/// Added to boxes in the frame of the tree, which has coordinates up to 1; the bounds take twice
/// that.
pub(super) const PADDING: f64 = 1e-6;
/// Components of directions (of which the longest is 1) below 1 / this are as good as zero.
const MOST: f32 = 1e12;
/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Most boxes in a tree, and in one of its leaves.
pub(super) const LIMIT: usize = 1 << 29;
pub(super) const LEAF_LIMIT: usize = 4;
/// Nodes of a tree from which on memory is fetched early: fewer stay in the caches.
const MANY: usize = 1 << 11;

/// Eight boxes and what they hold: on each axis, steps of a power of two from a corner (Ylitie,
/// Karras and Laine). Unused ones are inside out, and never hit.
#[derive(Clone, Debug)]
#[repr(align(16))]
pub(super) struct Node {
    origin: Vec3,
    /// The first child that is a node, and the first box in a leaf; the others follow.
    first_node: u32,
    first_prim: u32,
    /// Steps, as exponents of f32.
    exponents: [u8; 3],
    /// Which node after the first; or [`Node::LEAF`], one less than the boxes << 5, and which box
    /// after the first.
    children: [u8; WIDTH],
    /// Low and high planes on each axis, in steps.
    planes: [[[u8; WIDTH]; 2]; 3],
}

/// The index of a node, or a run of boxes in the order of the tree: [`Child::LEAF`], one less than
/// their number (1..=4) << 29, and the first (< 2^29).
#[derive(Clone, Copy, Debug)]
pub(super) struct Child(u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    /// The first node of a tree.
    pub const ROOT: Self = Self(0);

    /// A number that [`Child::of`] takes.
    #[inline(always)]
    pub fn number(self) -> u32 {
        self.0
    }

    #[inline(always)]
    pub fn of(number: u32) -> Self {
        Self(number)
    }

    /// The index of a node.
    #[inline(always)]
    pub fn index(self) -> usize {
        self.0 as usize
    }

    /// The boxes of a leaf.
    #[inline(always)]
    pub fn prims(self) -> Option<Range<u32>> {
        let first = self.0 & (LIMIT as u32 - 1);
        (self.0 >= Self::LEAF).then(|| first..first + (self.0 >> 29 & 3) + 1)
    }
}

/// A tree of boxes, in the space of the boxes given.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
    /// Pending children a traversal may have, and nodes from the first to the deepest.
    pub(super) pending: usize,
    pub(super) depth: usize,
    /// Middle of the bounds and 1 / the largest half side: the map to the frame of the tree.
    pub(super) center: DVec3,
    pub(super) inv_scale: f64,
    /// Padded bounds are `-reach..reach` in the frame of the tree.
    pub(super) reach: DVec3,
}

/// A ray in the frame of a tree, from where it reaches the bounds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// Where the ray reaches the bounds.
    pub t: f64,
    origin: Vec3,
    inv_direction: Vec3,
    /// Whether the direction is negative.
    negative: [bool; 3],
    /// Length in the frame per unit of `t`, along the longest axis.
    rate: f64,
    /// Nearest hit so far, as a length in the frame.
    pub limit: f32,
}

impl Entry {
    /// The length in the frame that belongs to `t`, rounded up far enough that nothing nearer is
    /// culled.
    #[inline(always)]
    pub fn length(&self, t: f64) -> f32 {
        ((t - self.t).max(0.0) * self.rate * (1.0 + 1e-6) + 2.0 * PADDING) as f32
    }
}

impl Tree {
    /// Memory held, in bytes.
    pub fn bytes(&self) -> usize {
        std::mem::size_of_val(self.nodes.as_slice())
    }

    /// The ray in the frame of the tree, from where it enters the bounds; `None` if it misses them,
    /// or if its numbers make no ray (not finite, too large for finite distances, or without
    /// direction).
    #[inline(always)]
    pub fn enter(&self, o: DVec3, d: DVec3, t_max: f64) -> Option<Entry> {
        let o = (o - self.center) * self.inv_scale;
        let d = d * self.inv_scale;
        // the one division: bounds and boxes both take it
        let inv = 1.0 / d;
        let mut t = 0.0;
        if !o.abs().cmple(self.reach).all() {
            let (a, b) = ((-self.reach - o) * inv, (self.reach - o) * inv);
            let (near, far) = (a.min(b), a.max(b));
            let mut end = t_max;
            for axis in 0..3 {
                // 0 / 0 is no limit: comparisons pass over it
                if near[axis] > t {
                    t = near[axis];
                }
                if far[axis] < end {
                    end = far[axis];
                }
            }
            if t > end {
                return None;
            }
        }
        let rate = d.abs().max_element();
        // one sum tells all: infinite or not a number where any of them is
        if !(rate >= f64::MIN_POSITIVE && (o.dot(d) + t).is_finite()) {
            return None;
        }
        let inv_direction = (inv * rate).as_vec3a();
        let inv_direction = inv_direction.clamp(Vec3A::splat(-MOST), Vec3A::splat(MOST));
        let mut entry = Entry {
            t,
            origin: (o + d * t).as_vec3(),
            inv_direction: inv_direction.into(),
            negative: inv_direction.to_array().map(|x| x < 0.0),
            rate,
            limit: f32::INFINITY,
        };
        entry.limit = entry.length(t_max);
        Some(entry)
    }

    /// Whether memory is fetched early.
    #[inline(always)]
    pub(super) fn is_large(&self) -> bool {
        self.nodes.len() >= MANY
    }
}

/// Has the memory of a node fetched: two lines of 64 bytes.
#[inline(always)]
pub(super) fn fetch(nodes: &[Node], index: usize) {
    prefetch_index(nodes, index);
    prefetch_index(nodes[index].planes.as_slice(), 2);
}

impl Node {
    const LEAF: u8 = 1 << 7;
    const UNUSED: u8 = Self::LEAF - 1;

    /// A node without children.
    pub const EMPTY: Self = Self {
        origin: Vec3::ZERO,
        first_node: 0,
        first_prim: 0,
        exponents: [1; 3],
        children: [Self::UNUSED; WIDTH],
        planes: [[[u8::MAX; WIDTH], [0; WIDTH]]; 3],
    };

    /// A node over boxes (1..=8), each with the number of boxes in its leaf, or 0 if it is a node.
    /// The first of these nodes is `first_node`, the first box in its leaves `first_prim`.
    pub fn new(
        members: impl Iterator<Item = (Vec3A, Vec3A, usize)> + Clone,
        first_node: usize,
        first_prim: usize,
    ) -> Self {
        let (low, high) = members.clone().fold(
            (Vec3A::INFINITY, Vec3A::NEG_INFINITY),
            |(low, high), (l, h, _)| (low.min(l), high.max(h)),
        );
        let mut node = Self {
            origin: low.into(),
            first_node: first_node as u32,
            first_prim: first_prim as u32,
            ..Self::EMPTY
        };
        for axis in 0..3 {
            let extent = f64::from(high[axis]) - f64::from(low[axis]);
            let mut exponent = 1;
            while extent > 255.0 * f64::from(step(exponent)) {
                exponent += 1;
            }
            node.exponents[axis] = exponent;
            let steps = |x: f32| (f64::from(x) - f64::from(low[axis])) / f64::from(step(exponent));
            for (slot, (l, h, _)) in members.clone().enumerate() {
                node.planes[axis][0][slot] = steps(l[axis]).floor() as u8;
                node.planes[axis][1][slot] = steps(h[axis]).ceil() as u8;
            }
        }
        let (mut nodes, mut prims) = (0, 0);
        for (slot, (.., count)) in members.enumerate() {
            if count == 0 {
                node.children[slot] = nodes;
                nodes += 1;
            } else {
                node.children[slot] = Self::LEAF | (count as u8 - 1) << 5 | prims;
                prims += count as u8;
            }
        }
        node
    }

    /// Content of a slot: the bits of a byte that tell leaf and length are those of a [`Child`], 24
    /// places lower.
    #[inline(always)]
    pub(super) fn child(&self, slot: usize) -> Child {
        let child = self.children[slot];
        let (node, leaf) = (self.first_node, self.first_prim | Child::LEAF);
        let first = if child & Self::LEAF == 0 { node } else { leaf };
        Child((first + u32::from(child & 31)) | (u32::from(child & 0x60) << 24))
    }

    /// The boxes entered before `limit`, as bits, and where.
    #[inline(always)]
    pub(super) fn hits(&self, entry: &Entry, limit: f32) -> (u32, f32x8) {
        slabs(entry, limit, |axis| {
            let inv = entry.inv_direction[axis];
            let per_step = f32x8::splat(step(self.exponents[axis]) * inv);
            let corner = f32x8::splat((self.origin[axis] - entry.origin[axis]) * inv);
            move |high: bool| {
                let steps = self.planes[axis][usize::from(high)].map(f32::from);
                f32x8::from(steps).mul_add(per_step, corner)
            }
        })
    }

    /// The same of boxes that are on a fraction `u` of their way to those of `end`, each along a
    /// line.
    #[inline(always)]
    pub(super) fn hits_between(
        &self,
        end: &Self,
        u: f32,
        entry: &Entry,
        limit: f32,
    ) -> (u32, f32x8) {
        let left = 1.0 - u;
        slabs(entry, limit, |axis| {
            let inv = entry.inv_direction[axis];
            let origin = self.origin[axis] * left + end.origin[axis] * u;
            let corner = f32x8::splat((origin - entry.origin[axis]) * inv);
            let from = f32x8::splat(step(self.exponents[axis]) * left * inv);
            let to = f32x8::splat(step(end.exponents[axis]) * u * inv);
            move |high: bool| {
                let steps =
                    |of: &Self| f32x8::from(of.planes[axis][usize::from(high)].map(f32::from));
                let (a, b) = (steps(self), steps(end));
                a.mul_add(from, b.mul_add(to, corner))
            }
        })
    }
}

/// The boxes entered before `limit`, as bits, and where, from the distances of their low and high
/// planes on each axis.
#[inline(always)]
fn slabs<P: Fn(bool) -> f32x8>(
    entry: &Entry,
    limit: f32,
    planes: impl Fn(usize) -> P,
) -> (u32, f32x8) {
    let (mut enter, mut leave) = (f32x8::ZERO, f32x8::splat(limit));
    for axis in 0..3 {
        let plane = planes(axis);
        let is_negative = entry.negative[axis];
        enter = enter.fast_max(plane(is_negative));
        leave = leave.fast_min(plane(!is_negative));
    }
    (enter.simd_le(leave).to_bitmask(), enter)
}

/// The power of two that has this exponent (1..=254) in f32.
#[inline(always)]
fn step(exponent: u8) -> f32 {
    f32::from_bits(u32::from(exponent) << 23)
}

/// Most children pending at a time, and nodes from the first to the deepest; children follow their
/// parents.
pub(super) fn pending(nodes: &[Node]) -> (usize, usize) {
    let mut most = vec![(0u32, 0u32); nodes.len()];
    for (i, node) in nodes.iter().enumerate().rev() {
        let (mut count, mut below, mut depth) = (0u32, 0, 0);
        for slot in (0..WIDTH).filter(|&slot| node.children[slot] != Node::UNUSED) {
            count += 1;
            let child = node.child(slot);
            if child.prims().is_none() {
                let of = most[child.index()];
                (below, depth) = (below.max(of.0), depth.max(of.1));
            }
        }
        most[i] = (count.max(count.saturating_sub(1) + below), depth + 1);
    }
    let (pending, depth) = most.first().copied().unwrap_or_default();
    (pending as usize, depth as usize)
}
