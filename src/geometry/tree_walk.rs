//! Walks of a ray through a [`Tree`].
//!
//! The search for the closest hit visits boxes from near to far. The search for any hit needs no
//! order, and its bound, the length of the segment, never changes: it keeps no distances.

use super::tree::{Child, Entry, Node, Tree, WIDTH, fetch};
use arrayvec::ArrayVec;
use std::ops::Range;
use wide::f32x8;

/// Pending children that need no allocation (a million triangles: at most 84).
const PENDING: usize = 96;
/// Depth of trees whose pending nodes need none (a million triangles: 12).
const DEEP: usize = 32;
/// Nodes of a tree from which on searches had better take turns: a mesh of 250,000 triangles, more
/// than the caches of a core hold. Tests have small meshes.
const TURNS: usize = if cfg!(test) { 2 } else { 1 << 14 };

/// Children still to be visited, or nodes that have such, last in, first out.
trait Stack<T> {
    fn push(&mut self, pending: T);
    fn pop(&mut self) -> Option<T>;
    /// The last `count`.
    fn last(&mut self, count: usize) -> &mut [T];
}

impl<T, const N: usize> Stack<T> for ArrayVec<T, N> {
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
        if self.tree().depth > DEEP {
            return self.any_in_deep_tree(entry, &mut hit);
        }
        unordered(self, entry, ArrayVec::<_, DEEP>::new(), fetch, hit)
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
                let fetch = |child| {
                    if is_large {
                        boxes.fetch_child(child, &fetch);
                    }
                };
                let mut nearest = take_child(node, &near, &mut hits, fetch);
                if hits != 0 {
                    let other = take_child(node, &near, &mut hits, fetch);
                    pending.push(nearest.max(other));
                    nearest = nearest.min(other);
                    let mut count = 1;
                    while hits != 0 {
                        let other = take_child(node, &near, &mut hits, fetch);
                        pending.push(nearest.max(other));
                        nearest = nearest.min(other);
                        count += 1;
                        sort_last(pending.last(count));
                    }
                }
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

/// [`Boxes::any`] with room for nodes of which hits are pending.
///
/// A node is kept with the bits of its hits: a loop that puts one child after the other aside ends
/// where no processor foretells it.
#[inline(always)]
fn unordered(
    boxes: impl Boxes,
    entry: &Entry,
    mut pending: impl Stack<(u32, u32)>,
    fetch: impl Fn(u32),
    mut hit: impl FnMut(Range<u32>) -> bool,
) -> bool {
    let nodes = boxes.tree().nodes.as_slice();
    let is_large = boxes.tree().is_large();
    let mut index = 0;
    let mut node = &nodes[0];
    loop {
        let (mut hits, _) = boxes.hits(node, index, entry, entry.limit);
        if is_large {
            let mut rest = hits;
            while let Some(slot) = take(&mut rest) {
                boxes.fetch_child(node.child(slot), &fetch);
            }
        }
        index = loop {
            let Some(slot) = take(&mut hits) else {
                let Some((above, rest)) = pending.pop() else {
                    return false;
                };
                (index, hits) = (above as usize, rest);
                node = &nodes[index];
                continue;
            };
            let child = node.child(slot);
            let Some(prims) = child.prims() else {
                if hits != 0 {
                    pending.push((index as u32, hits));
                }
                break child.index();
            };
            if hit(prims) {
                return true;
            }
        };
        node = &nodes[index];
    }
}

/// A search for any hit that is taken step by step.
pub(super) struct Steps {
    child: Child,
    pending: ArrayVec<(u32, u32), DEEP>,
}

impl Steps {
    /// Whether searches that take turns pay, and have room.
    #[inline]
    pub fn pay(tree: &Tree) -> bool {
        tree.nodes.len() >= TURNS && tree.depth <= DEEP
    }

    /// Before the first step through a tree for which [`Steps::pay`] holds.
    pub fn new() -> Self {
        Self {
            child: Child::ROOT,
            pending: ArrayVec::new(),
        }
    }

    /// Visits a node, or a run of boxes for which `hit` may hold, and has what comes next fetched.
    /// Whether it holds for any, once that is known.
    #[inline(always)]
    pub fn step(
        &mut self,
        boxes: impl Boxes,
        entry: &Entry,
        fetch: impl Fn(u32),
        hit: impl FnOnce(Range<u32>) -> bool,
    ) -> Option<bool> {
        let nodes = boxes.tree().nodes.as_slice();
        if let Some(prims) = self.child.prims() {
            if hit(prims) {
                return Some(true);
            }
        } else {
            let index = self.child.index();
            let (hits, _) = boxes.hits(&nodes[index], index, entry, entry.limit);
            if hits != 0 {
                self.pending.push((index as u32, hits));
            }
        }
        let Some((index, hits)) = self.pending.last_mut() else {
            return Some(false);
        };
        let slot = hits.trailing_zeros() as usize % WIDTH;
        *hits &= *hits - 1;
        self.child = nodes[*index as usize].child(slot);
        if *hits == 0 {
            self.pending.pop();
        }
        boxes.fetch_child(self.child, fetch);
        None
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

/// The child of the lowest bit that is set (there is one), and unsets it: its distance in the upper
/// half (positive floats sort like their bits), its number in the lower. As a closure it would be
/// called, not put in place.
#[inline(always)]
fn take_child(node: &Node, near: &[f32; WIDTH], hits: &mut u32, fetch: impl Fn(Child)) -> u64 {
    let slot = hits.trailing_zeros() as usize % WIDTH;
    *hits &= *hits - 1;
    let child = node.child(slot);
    fetch(child);
    u64::from(near[slot].to_bits()) << 32 | u64::from(child.number())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::hash::{random_bits, unit_f64};
    use glam::DVec3;

    type Hit<'a> = &'a mut dyn FnMut(Range<u32>) -> bool;
    type Met<'a> = &'a mut dyn FnMut(Range<u32>);

    #[test]
    fn any_search_visits_the_leaves_on_the_way_until_one_holds() {
        let mut counter = 0;
        let mut random = || {
            counter += 1;
            unit_f64(random_bits(11, counter)) * 2.0 - 1.0
        };
        let mut point = || DVec3::new(random(), random(), random());
        let boxes: Vec<_> = (0..40_000)
            .map(|_| (point(), point().abs() * 0.05))
            .map(|(low, size)| (low, low + size))
            .collect();
        let (tree, _) = Tree::build(boxes.len(), 3, |i| boxes[i]);
        assert!(tree.is_large() && Steps::pay(&tree) && tree.pending <= PENDING);
        let depth = DEEP + 1;
        assert!(!Steps::pay(&Tree {
            depth,
            ..tree.clone()
        }));
        for _ in 0..200 {
            let from = point();
            let entry = tree
                .enter(from, point() - from, 1.0)
                .expect("starts inside");
            let starts = |search: &dyn Fn(Met)| {
                let mut starts = Vec::new();
                search(&mut |run| starts.push(run.start));
                starts.sort_unstable();
                starts
            };
            let any = |hit: Hit| (&tree).any(&entry, |_| (), hit);
            let deep = |hit: Hit| (&tree).any_in_deep_tree(&entry, hit);
            let by_steps = |hit: Hit| {
                let mut steps = Steps::new();
                loop {
                    if let Some(found) = steps.step(&tree, &entry, |_| (), &mut *hit) {
                        return found;
                    }
                }
            };
            let searches: [&dyn Fn(Hit) -> bool; 3] = [&any, &deep, &by_steps];
            let met = starts(&|met| {
                (&tree).closest(
                    &entry,
                    |_| (),
                    |run| {
                        met(run);
                        None
                    },
                );
            });
            for search in searches {
                let all = starts(&|met| {
                    let none = |run| {
                        met(run);
                        false
                    };
                    assert!(!search(&mut { none }));
                });
                assert_eq!(all, met);
                let mut left = met.len() / 2;
                let mut last = |_| {
                    left -= 1;
                    left == 0
                };
                assert!(met.len() < 2 || search(&mut last) && left == 0);
            }
        }
    }
}
