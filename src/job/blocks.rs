//! Chunks and blocks: how the passes of a job are cut, and which parts become one.
//!
//! Chunk i holds the passes i·n to (i + 1)·n. A block is a chunk, or four neighboring blocks
//! beginning at a multiple of their number; at the end of the job blocks may be shorter. Two blocks
//! are one within the other or disjoint, never anything else. What is done and what is open is kept
//! as ranges: chunks are not counted one by one.

use std::ops::Range;

/// Blocks that become one.
const RADIX: u32 = 4;

/// Chunks of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chunks {
    /// One past the last pass.
    pub passes: u32,
    /// Passes of a chunk, at least 1.
    pub size: u32,
}

/// Neighboring chunks that one part holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Block {
    /// First chunk.
    pub start: u32,
    /// One past the last chunk.
    pub end: u32,
}

impl Block {
    /// The block of one chunk.
    #[must_use]
    pub fn of_chunk(chunk: u32) -> Self {
        Self {
            start: chunk,
            end: chunk + 1,
        }
    }

    /// Number of chunks.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.end - self.start
    }

    /// Never: a block has a chunk.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.end <= self.start
    }

    /// Chunks of the block.
    #[must_use]
    pub fn chunks(&self) -> Range<u32> {
        self.start..self.end
    }

    /// Whether it holds all of another one.
    #[must_use]
    pub fn holds(&self, other: &Self) -> bool {
        self.start <= other.start && other.end <= self.end
    }
}

impl Chunks {
    /// Number of chunks.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.passes.div_ceil(self.size)
    }

    /// Passes of neighboring chunks.
    #[must_use]
    pub fn passes_of(&self, block: &Block) -> Range<u32> {
        let at = |chunk: u32| chunk.saturating_mul(self.size).min(self.passes);
        at(block.start)..at(block.end)
    }

    /// The block of so many chunks, a power of the radix, that holds a chunk.
    fn aligned(&self, chunk: u32, size: u32) -> Block {
        let start = chunk - chunk % size;
        Block {
            start,
            end: start.saturating_add(size).min(self.count()),
        }
    }

    fn sizes() -> impl Iterator<Item = u32> {
        std::iter::successors(Some(1_u32), |size| size.checked_mul(RADIX))
    }

    /// Whether these chunks are a block.
    #[must_use]
    pub fn is_block(&self, block: &Block) -> bool {
        !block.is_empty()
            && block.end <= self.count()
            && Self::sizes().any(|size| self.aligned(block.start, size) == *block)
    }

    /// The smallest block that holds more than this one; `None` for the whole job.
    #[must_use]
    pub fn parent(&self, block: &Block) -> Option<Block> {
        let larger = |b: &Block| b.len() > block.len();
        Self::sizes()
            .map(|size| self.aligned(block.start, size))
            .find(larger)
    }

    /// A block and all that hold it, from the smallest.
    pub fn holders(&self, block: &Block) -> impl Iterator<Item = Block> {
        std::iter::successors(Some(*block), |held| self.parent(held))
    }

    /// The blocks that become this one; none for a chunk.
    #[must_use]
    pub fn children(&self, block: &Block) -> Vec<Block> {
        if block.len() <= 1 {
            return Vec::new();
        }
        let below = Self::sizes().take_while(|&size| size < block.len());
        let size = below.last().unwrap_or(1);
        (block.start..block.end)
            .step_by(size as usize)
            .map(|chunk| self.aligned(chunk, size))
            .collect()
    }
}

/// The blocks among these that no other one holds, in order.
#[must_use]
pub fn outermost(blocks: &[Block]) -> Vec<Block> {
    let mut sorted = blocks.to_vec();
    sorted.sort_unstable_by_key(|b| (b.start, std::cmp::Reverse(b.end)));
    let mut outer: Vec<Block> = Vec::new();
    for block in sorted {
        if !outer.last().is_some_and(|last| last.holds(&block)) {
            outer.push(block);
        }
    }
    outer
}

/// Whether one of these blocks, which are in order and disjoint, holds a chunk.
#[must_use]
pub fn is_in(outer: &[Block], chunk: u32) -> bool {
    let after = outer.partition_point(|b| b.start <= chunk);
    after > 0 && chunk < outer[after - 1].end
}

/// Chunks that are not done, as ranges in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Open(Vec<Range<u32>>);

impl Open {
    /// Chunks of a range that none of these blocks holds, which are in order and disjoint.
    #[must_use]
    pub fn among(all: &Range<u32>, outer: &[Block]) -> Self {
        let starts = std::iter::once(all.start).chain(outer.iter().map(|b| b.end));
        let ends = outer.iter().map(|b| b.start).chain([all.end]);
        let gaps = starts.zip(ends);
        let gaps = gaps.map(|(start, end)| start.max(all.start)..end.min(all.end));
        Self(gaps.filter(|gap| !gap.is_empty()).collect())
    }

    /// Their number.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.0.iter().map(|gap| gap.end - gap.start).sum()
    }

    /// Whether a chunk is one of them.
    #[must_use]
    pub fn holds(&self, chunk: u32) -> bool {
        let after = self.0.partition_point(|gap| gap.start <= chunk);
        after > 0 && chunk < self.0[after - 1].end
    }

    /// Each of them.
    pub fn iter(&self) -> impl Iterator<Item = u32> {
        self.0.iter().cloned().flatten()
    }

    /// Takes one out, by its place.
    pub fn take(&mut self, mut place: u32) -> Option<u32> {
        for i in 0..self.0.len() {
            let Range { start, end } = self.0[i];
            if place < end - start {
                let chunk = start + place;
                let two = [start..chunk, chunk + 1..end];
                self.0
                    .splice(i..=i, two.into_iter().filter(|gap| !gap.is_empty()));
                return Some(chunk);
            }
            place -= end - start;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn blocks_are_a_tree() {
        for (passes, size) in [(1, 1), (5, 1), (6, 1), (16, 1), (17, 4), (100, 3), (257, 1)] {
            let chunks = Chunks { passes, size };
            let mut waiting: Vec<Block> = (0..chunks.count()).map(Block::of_chunk).collect();
            let mut seen = BTreeSet::new();
            while let Some(block) = waiting.pop() {
                assert!(chunks.is_block(&block), "{block:?}");
                let Some(parent) = chunks.parent(&block) else {
                    assert_eq!(block.chunks(), 0..chunks.count());
                    continue;
                };
                let children = chunks.children(&parent);
                assert!(children.contains(&block), "{block:?} of {parent:?}");
                assert!((2..=4).contains(&children.len()), "{children:?}");
                let joined: Vec<u32> = children.iter().flat_map(Block::chunks).collect();
                assert_eq!(joined, parent.chunks().collect::<Vec<_>>());
                if seen.insert(parent) {
                    waiting.push(parent);
                }
            }
            // two are nested or disjoint
            for (a, b) in seen.iter().flat_map(|a| seen.iter().map(move |b| (a, b))) {
                let disjoint = a.end <= b.start || b.end <= a.start;
                assert!(disjoint || a.holds(b) || b.holds(a), "{a:?} {b:?}");
            }
        }
        let chunks = Chunks { passes: 6, size: 1 };
        for (start, end) in [(0, 2), (1, 5), (4, 7), (3, 3), (2, 6)] {
            assert!(!chunks.is_block(&Block { start, end }), "{start}..{end}");
        }
    }

    #[test]
    fn passes_end_with_the_job() {
        let chunks = Chunks {
            passes: 10,
            size: 4,
        };
        assert_eq!(chunks.count(), 3);
        assert_eq!(chunks.passes_of(&Block { start: 1, end: 3 }), 4..10);
        let endless = Chunks {
            passes: u32::MAX - 1,
            size: 1,
        };
        let last = Block::of_chunk(endless.count() - 1);
        assert_eq!(endless.passes_of(&last), u32::MAX - 2..u32::MAX - 1);
        assert!(endless.parent(&last).is_some_and(|p| p.holds(&last)));
    }

    #[test]
    fn what_is_held_counts_once() {
        let block = |start, end| Block { start, end };
        let all = [
            block(4, 5),
            block(0, 4),
            block(1, 2),
            block(8, 12),
            block(0, 1),
        ];
        assert_eq!(outermost(&all), [block(0, 4), block(4, 5), block(8, 12)]);
    }

    #[test]
    fn open_chunks_are_those_that_no_block_holds() {
        let chunks = Chunks {
            passes: 50,
            size: 1,
        };
        let done =
            [0, 4, 5, 16, 17, 32].map(|i| chunks.aligned(i, if i % 16 == 0 { 4 } else { 1 }));
        let outer = outermost(&done);
        for all in [0..50, 3..20, 6..16, 0..1, 49..50] {
            let expected: Vec<u32> = all.clone().filter(|c| !is_in(&outer, *c)).collect();
            let by_one = |c: &u32| !done.iter().any(|b| b.chunks().contains(c));
            assert_eq!(expected, all.clone().filter(by_one).collect::<Vec<_>>());
            let mut open = Open::among(&all, &outer);
            assert_eq!(open.iter().collect::<Vec<_>>(), expected, "{all:?}");
            assert_eq!(open.count() as usize, expected.len());
            assert!((0..60).all(|c| open.holds(c) == expected.contains(&c)));
            // from the middle, until none is left
            let mut left = expected;
            while !left.is_empty() {
                let place = left.len() / 2;
                assert_eq!(open.take(place as u32), Some(left.remove(place)));
                assert_eq!(open.iter().collect::<Vec<_>>(), left);
            }
            assert_eq!((open.take(0), open.count()), (None, 0));
        }
    }
}
