//! A tree of boxes that move along lines.
//!
//! Every box, and every box around others, is kept where motion starts and where it ends; at the
//! time of a ray it is as far between the two as time is, and holds what it holds then. So boxes of
//! what moves far are as tight as those of what rests, where boxes that hold whole paths overlap.
//!
//! Invariant: boxes only ever cull, and never what a ray touches, as in [`Tree`]. Planes between
//! two err by more than planes at rest: with u = 2^-24, by 3u (corner), 2u (fraction of the way)
//! and, in units of the inverse direction, 6u (steps of both ends and their sum), 1.5e-6 in all.

use super::tree::{Entry, Node, Tree, fetch};
use super::tree_walk::Boxes;
use wide::f32x8;

/// Added to boxes in the frame of the tree.
pub(super) const MOVING_PADDING: f64 = 2e-6;

/// A tree whose boxes move.
#[derive(Clone, Debug)]
pub(super) struct MovingTree {
    /// Boxes at the start.
    pub tree: Tree,
    /// Nodes of the tree with their boxes at the end.
    pub ends: Vec<Node>,
}

impl MovingTree {
    /// Memory held, in bytes.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + std::mem::size_of_val(self.ends.as_slice())
    }

    /// The boxes at a fraction of the way.
    #[inline]
    pub fn at(&self, fraction: f64) -> MovingTreeAt<'_> {
        MovingTreeAt {
            of: self,
            fraction: fraction as f32,
        }
    }
}

/// A [`MovingTree`] at one moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct MovingTreeAt<'a> {
    of: &'a MovingTree,
    fraction: f32,
}

impl Boxes for MovingTreeAt<'_> {
    #[inline(always)]
    fn tree(&self) -> &Tree {
        &self.of.tree
    }

    #[inline(always)]
    fn hits(&self, node: &Node, index: usize, entry: &Entry, limit: f32) -> (u32, f32x8) {
        node.hits_between(&self.of.ends[index], self.fraction, entry, limit)
    }

    #[inline(always)]
    fn fetch_node(&self, node: usize) {
        fetch(&self.of.tree.nodes, node);
        fetch(&self.of.ends, node);
    }
}
