//! Walks of a ray through a [`Tree`].
//!
//! The search for the closest hit visits boxes from near to far. The search for any hit needs no
//! order, and its bound, the length of the segment, never changes: it keeps no distances.

use super::tree::{Child, Entry, Node, Tree, WIDTH, fetch};
use arrayvec::ArrayVec;
use std::ops::Range;
use wide::f32x8;

/// Pending children that need no allocation (a million triangles: at most 60).
const PENDING: usize = 96;

/// Children still to be visited, last in, first out.
trait Stack<T> {
    fn push(&mut self, pending: T);
    fn pop(&mut self) -> Option<T>;
    /// The last `count`.
    fn last(&mut self, count: usize) -> &mut [T];
}

impl<T> Stack<T> for ArrayVec<T, PENDING> {
    #[inline(always)]
    fn push(&mut self, pending: T) {
        self.push(pending);
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<T> {
        self.pop()
    }

    #[inline(always)]
    fn last(&mut self, count: usize) -> &mut [T] {
        let first = self.len() - count;
        &mut self[first..]
    }
}

impl<T> Stack<T> for Vec<T> {
    fn push(&mut self, pending: T) {
        self.push(pending);
    }

    fn pop(&mut self) -> Option<T> {
        self.pop()
    }

    fn last(&mut self, count: usize) -> &mut [T] {
        let first = self.len() - count;
        &mut self[first..]
    }
}

/// The boxes of a tree at the moment of a ray.
pub(super) trait Boxes: Copy {
    /// The tree that they hang in.
    fn tree(&self) -> &Tree;

    /// The boxes of a node of the tree that are entered before `limit`, as bits, and where.
    fn hits(&self, node: &Node, index: usize, entry: &Entry, limit: f32) -> (u32, f32x8);

    /// Has the memory of a node fetched.
    fn fetch_node(&self, node: usize);

    /// Visits runs of boxes that may be hit, roughly from near to far; `hit` returns the parameter
    /// of a new closest hit, `fetch` learns early where runs start.
    #[inline(always)]
    fn closest(
        self,
        entry: &Entry,
        fetch: impl Fn(u32),
        mut hit: impl FnMut(Range<u32>) -> Option<f64>,
    ) {
        if self.tree().pending > PENDING {
            return self.closest_in_deep_tree(entry, &mut hit);
        }
        ordered(self, entry, ArrayVec::<u64, PENDING>::new(), fetch, hit);
    }

    /// Whether `hit` holds for any run of boxes that may be hit.
    #[inline(always)]
    fn any(
        self,
        entry: &Entry,
        fetch: impl Fn(u32),
        mut hit: impl FnMut(Range<u32>) -> bool,
    ) -> bool {
        if self.tree().pending > PENDING {
            return self.any_in_deep_tree(entry, &mut hit);
        }
        unordered(self, entry, ArrayVec::<u32, PENDING>::new(), fetch, hit)
    }

    /// Has the memory of a child fetched that will likely be visited, while nearer ones are: a walk
    /// through a large tree is a chain of cache misses.
    #[inline(always)]
    fn fetch_child(self, child: Child, leaf: impl Fn(u32)) {
        match child.prims() {
            Some(prims) => leaf(prims.start),
            None => self.fetch_node(child.index()),
        }
    }

    #[cold]
    fn closest_in_deep_tree(self, entry: &Entry, hit: &mut dyn FnMut(Range<u32>) -> Option<f64>) {
        ordered(self, entry, Vec::new(), |_| (), hit);
    }

    #[cold]
    fn any_in_deep_tree(self, entry: &Entry, hit: &mut dyn FnMut(Range<u32>) -> bool) -> bool {
        unordered(self, entry, Vec::new(), |_| (), hit)
    }
}

/// [`Boxes::closest`] with room for what is pending.
#[inline(always)]
fn ordered(
    boxes: impl Boxes,
    entry: &Entry,
    mut pending: impl Stack<u64>,
    fetch: impl Fn(u32),
    mut hit: impl FnMut(Range<u32>) -> Option<f64>,
) {
    let mut limit = entry.limit;
    let mut child = Child::ROOT;
    let is_large = boxes.tree().is_large();
    loop {
        if let Some(prims) = child.prims() {
            if let Some(t) = hit(prims) {
                limit = limit.min(entry.length(t));
            }
        } else {
            let node = &boxes.tree().nodes[child.index()];
            let (mut hits, near) = boxes.hits(node, child.index(), entry, limit);
            if hits != 0 {
                let near = near.to_array();
                // distance in the upper half (positive floats sort like their bits), child in
                // the lower
                let mut next = || {
                    let slot = take(&mut hits)?;
                    let child = node.child(slot);
                    if is_large {
                        boxes.fetch_child(child, &fetch);
                    }
                    Some(u64::from(near[slot].to_bits()) << 32 | u64::from(child.number()))
                };
                let (first, second) = (next(), next());
                let nearest = match (first, second) {
                    (Some(a), Some(b)) => {
                        pending.push(a.max(b));
                        let mut nearest = a.min(b);
                        let mut count = 1;
                        while let Some(c) = next() {
                            pending.push(nearest.max(c));
                            nearest = nearest.min(c);
                            count += 1;
                            sort_last(pending.last(count));
                        }
                        nearest
                    }
                    (a, _) => a.unwrap_or_default(),
                };
                child = Child::of(nearest as u32);
                continue;
            }
        }
        child = loop {
            let Some(next) = pending.pop() else {
                return;
            };
            if f32::from_bits((next >> 32) as u32) <= limit {
                break Child::of(next as u32);
            }
        };
    }
}

/// [`Boxes::any`] with room for what is pending.
#[inline(always)]
fn unordered(
    boxes: impl Boxes,
    entry: &Entry,
    mut pending: impl Stack<u32>,
    fetch: impl Fn(u32),
    mut hit: impl FnMut(Range<u32>) -> bool,
) -> bool {
    let mut child = Child::ROOT;
    let is_large = boxes.tree().is_large();
    loop {
        if let Some(prims) = child.prims() {
            if hit(prims) {
                return true;
            }
        } else {
            let node = &boxes.tree().nodes[child.index()];
            let (mut hits, _) = boxes.hits(node, child.index(), entry, entry.limit);
            while let Some(slot) = take(&mut hits) {
                let child = node.child(slot);
                if is_large {
                    boxes.fetch_child(child, &fetch);
                }
                pending.push(child.number());
            }
        }
        let Some(next) = pending.pop() else {
            return false;
        };
        child = Child::of(next);
    }
}

impl Boxes for &Tree {
    #[inline(always)]
    fn tree(&self) -> &Tree {
        self
    }

    #[inline(always)]
    fn hits(&self, node: &Node, _: usize, entry: &Entry, limit: f32) -> (u32, f32x8) {
        node.hits(entry, limit)
    }

    #[inline(always)]
    fn fetch_node(&self, node: usize) {
        fetch(&self.nodes, node);
    }
}

/// The lowest bit that is set, and unsets it.
#[inline(always)]
fn take(hits: &mut u32) -> Option<usize> {
    if *hits == 0 {
        return None;
    }
    let slot = hits.trailing_zeros() as usize % WIDTH;
    *hits &= *hits - 1;
    Some(slot)
}

/// Moves the last number before those that are smaller.
#[inline(always)]
fn sort_last(numbers: &mut [u64]) {
    for at in (1..numbers.len()).rev() {
        if numbers[at - 1] >= numbers[at] {
            break;
        }
        numbers.swap(at - 1, at);
    }
}
