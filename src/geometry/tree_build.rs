//! Building a [`Tree`] with obvhs.
//!
//! The binary tree is the largest thing that building a scene holds, so no boxes of things at rest
//! are kept beside it, and what serves one step only is dropped before the next.

use super::moving_tree::{MOVING_PADDING, MovingTree};
use super::tree::{Node, PADDING, Tree, WIDTH, pending};
use glam::DVec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, SortPrecision};

/// Neighbors on each side among which a box looks for its partner.
const SEARCH: usize = 14;
/// Passes in which it looks at the next one only.
const SHORT_PASSES: usize = 3;
/// Fractions of the nodes that are tried elsewhere, before and after boxes are gathered in leaves.
const REINSERTED: [f32; 2] = [0.05, 0.1];
/// Cost of a visit to a node of the binary tree, in tests of a box's content, where boxes are
/// gathered in leaves.
const BINARY_COST: f32 = 3.0;
/// Cost of a test of a box's content, in visits of a wide node.
const TEST_COST: f32 = 0.3;

impl Tree {
    /// The tree over `count` boxes (1..2^29), at most `leaf_size` (1..=4) to a leaf, and the order
    /// in which its queries number them: the i-th is box `order[i]`.
    pub fn build(
        count: usize,
        leaf_size: usize,
        bounds: impl Fn(usize) -> (DVec3, DVec3),
    ) -> (Self, Vec<u32>) {
        let mut tree = Self::over((0..count).map(&bounds));
        let padded = |i: usize| tree.padded(bounds(i), PADDING, i);
        let binary = binary_tree(count, leaf_size, padded);
        let ([nodes], order) = wide_nodes(&binary, [&|node| *binary.nodes[node].aabb()]);
        tree.set(nodes);
        (tree, order)
    }

    /// A tree without nodes whose frame holds these boxes.
    fn over(boxes: impl Iterator<Item = (DVec3, DVec3)>) -> Self {
        let (low, high) = boxes
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
            .unwrap_or_default();
        let half = (high - low) / 2.0;
        let largest = half.max_element();
        let inv_scale = if largest > 0.0 { 1.0 / largest } else { 1.0 };
        Self {
            nodes: Vec::new(),
            pending: 0,
            depth: 0,
            center: low + (high - low) / 2.0,
            inv_scale,
            reach: half * inv_scale + PADDING * 2.0,
        }
    }

    fn set(&mut self, nodes: Vec<Node>) {
        (self.pending, self.depth) = pending(&nodes);
        self.nodes = nodes;
    }

    /// Box `i` in the frame of the tree.
    fn padded(&self, (low, high): (DVec3, DVec3), padding: f64, i: usize) -> Aabb {
        // Unequal padding tells coincident boxes apart, of which the builder would pair one at a
        // time.
        let pad = padding * (1.0 + (i as f64 * 0.618_033_988_749_894_9).fract());
        let frame = |p: DVec3| (p - self.center) * self.inv_scale;
        let (low, high) = (frame(low) - pad, frame(high) + pad);
        Aabb::new(low.as_vec3a(), high.as_vec3a())
    }
}

impl MovingTree {
    /// The tree over `count` boxes that move from the first of `ends` to the second, as
    /// [`Tree::build`] gives it for boxes at rest. It is built for where they are half way.
    pub fn build(
        count: usize,
        leaf_size: usize,
        ends: impl Fn(usize) -> [(DVec3, DVec3); 2],
    ) -> (Self, Vec<u32>) {
        let mut tree = Tree::over((0..count).flat_map(&ends));
        let padded = |i: usize| ends(i).map(|bounds| tree.padded(bounds, MOVING_PADDING, i));
        let binary = binary_tree(count, leaf_size, |i| {
            let [a, b] = padded(i);
            Aabb::new(0.5 * (a.min + b.min), 0.5 * (a.max + b.max))
        });
        let boxes = refitted(&binary, padded);
        let ([nodes, ends], order) =
            wide_nodes(&binary, [&|node| boxes[node][0], &|node| boxes[node][1]]);
        tree.set(nodes);
        (Self { tree, ends }, order)
    }
}

/// The boxes of the nodes of a binary tree, over others than it was built for: at both ends of a
/// motion.
fn refitted(binary: &Bvh2, bounds: impl Fn(usize) -> [Aabb; 2]) -> Vec<[Aabb; 2]> {
    let union = |[a, b]: [Aabb; 2], [c, d]: [Aabb; 2]| [a.union(&c), b.union(&d)];
    let mut out = vec![[Aabb::empty(); 2]; binary.nodes.len()];
    for index in parents_first(&binary.nodes).into_iter().rev() {
        let node = &binary.nodes[index as usize];
        let first = node.first_index as usize;
        out[index as usize] = if node.is_leaf() {
            let prims = &binary.primitive_indices[first..first + node.prim_count as usize];
            let boxes = prims.iter().map(|&prim| bounds(prim as usize));
            boxes.fold(out[index as usize], union)
        } else {
            union(out[first], out[first + 1])
        };
    }
    out
}

/// Nodes, parents before children, for each kind of boxes of the nodes of the binary tree, and the
/// order of the boxes in their leaves.
fn wide_nodes<const N: usize>(
    binary: &Bvh2,
    boxes: [&dyn Fn(usize) -> Aabb; N],
) -> ([Vec<Node>; N], Vec<u32>) {
    let costs = costs(&binary.nodes);
    let mut nodes = [(); N].map(|()| vec![Node::EMPTY]);
    let mut order = Vec::with_capacity(binary.primitive_indices.len());
    // Depth first, so that a subtree lies together in memory; the children of a node side by side.
    let mut todo = vec![(0, 0)];
    let mut count = 1;
    while let Some((root, index)) = todo.pop() {
        let mut members = Vec::with_capacity(WIDTH);
        cut(&binary.nodes, &costs, root, WIDTH, true, &mut members);
        for (nodes, bounds) in nodes.iter_mut().zip(&boxes) {
            let member = |&member: &usize| {
                let Aabb { min, max } = bounds(member);
                (min, max, binary.nodes[member].prim_count as usize)
            };
            nodes[index] = Node::new(members.iter().map(member), count, order.len());
        }
        for &member in &members {
            let of = &binary.nodes[member];
            if of.is_leaf() {
                let first = of.first_index as usize;
                let prims = &binary.primitive_indices[first..first + of.prim_count as usize];
                order.extend_from_slice(prims);
            }
        }
        members.retain(|&member| !binary.nodes[member].is_leaf());
        let first = count;
        count += members.len();
        for nodes in &mut nodes {
            nodes.resize(count, Node::EMPTY);
        }
        todo.extend(members.into_iter().zip(first..count).rev());
    }
    nodes.iter_mut().for_each(Vec::shrink_to_fit);
    (nodes, order)
}

fn binary_tree(count: usize, leaf_size: usize, bounds: impl Fn(usize) -> Aabb) -> Bvh2 {
    let mut tree = Bvh2::zeroed(count);
    let mut total = Aabb::empty();
    let mut builder = PlocBuilder::new();
    builder.current_nodes = (0..count)
        .map(|i| {
            let bounds = bounds(i);
            total = total.union(&bounds);
            Bvh2Node::new(bounds, 1, i as u32)
        })
        .collect();
    builder.build_ploc_from_leaves::<SEARCH, false>(
        &mut tree,
        total,
        SortPrecision::U64,
        SHORT_PASSES,
    );
    drop(builder);
    tree.primitive_indices = (0..count as u32).collect();
    let [before, after] = REINSERTED;
    ReinsertionOptimizer::default().run(&mut tree, before, None);
    if leaf_size > 1 {
        collapse(&mut tree, leaf_size as u32, BINARY_COST);
        ReinsertionOptimizer::default().run(&mut tree, after, None);
    }
    tree
}

/// The nodes of a binary tree, each before its children.
fn parents_first(nodes: &[Bvh2Node]) -> Vec<u32> {
    let mut order = vec![0u32];
    let mut at = 0;
    while let Some(&node) = order.get(at) {
        let node = &nodes[node as usize];
        if !node.is_leaf() {
            order.extend([node.first_index, node.first_index + 1]);
        }
        at += 1;
    }
    order
}

/// For each node, the least expected cost of its subtree as at most 1..=8 children of a wide node:
/// of all visits below and of all tests in leaves, in proportion to the areas of the boxes.
fn costs(nodes: &[Bvh2Node]) -> Vec<[f32; WIDTH]> {
    let mut costs = vec![[0.0; WIDTH]; nodes.len()];
    for index in parents_first(nodes).into_iter().rev() {
        let node = &nodes[index as usize];
        let area = node.aabb().half_area();
        costs[index as usize] = if node.is_leaf() {
            [area * node.prim_count as f32 * TEST_COST; WIDTH]
        } else {
            let mut best = [f32::INFINITY; WIDTH];
            for parts in 2..=WIDTH {
                let (_, cost) = split(&costs, node, parts);
                best[parts - 1] = cost.min(best[parts - 2]);
            }
            best[0] = best[WIDTH - 1] + area;
            best.map(|cost| cost.min(best[0]))
        };
    }
    costs
}

/// How many of `parts` (at least 2) the first child of `node` gets at least cost, and that cost.
fn split(costs: &[[f32; WIDTH]], node: &Bvh2Node, parts: usize) -> (usize, f32) {
    let first = node.first_index as usize;
    let (a, b) = (&costs[first], &costs[first + 1]);
    let cost = |k: usize| a[k - 1] + b[parts - k - 1];
    (1..parts)
        .map(|k| (k, cost(k)))
        .reduce(|x, y| if y.1 < x.1 { y } else { x })
        .unwrap_or((1, f32::INFINITY))
}

/// Cuts the subtree of `index` into at most `parts` children of a wide node, as [`costs`] found
/// best; the root of a wide node (`open`) is cut in any case.
fn cut(
    nodes: &[Bvh2Node],
    costs: &[[f32; WIDTH]],
    index: usize,
    parts: usize,
    open: bool,
    members: &mut Vec<usize>,
) {
    let node = &nodes[index];
    let cost = &costs[index];
    if node.is_leaf() || parts == 1 || (!open && cost[parts - 1] == cost[0]) {
        members.push(index);
        return;
    }
    let (k, _) = split(costs, node, parts);
    let first = node.first_index as usize;
    cut(nodes, costs, first, k, false, members);
    cut(nodes, costs, first + 1, parts - k, false, members);
}
