//! The corners of triangles, laid out for traversal.
//!
//! Nine numbers per triangle, axis by axis and in the order of the leaves of the tree: a ray that
//! reaches a leaf finds all it needs in one place, without a table of indices in between (traversal
//! waits for memory more than for arithmetic), and tests an axis of three corners at a time.

use crate::math::predicates::TriangleFilter;
use glam::Vec4;
use prefetch_index::prefetch_index;

/// Positions of the corners of a triangle, counter-clockwise seen from outside.
pub(super) type Triangle = [[f32; 3]; 3];

/// A list of triangles.
#[derive(Clone, Debug)]
pub(super) struct Triangles {
    /// x, y, z of the three corners of each triangle, and one number more: rows are read by four.
    rows: Vec<f32>,
}

impl Triangles {
    pub fn new(corners: impl ExactSizeIterator<Item = Triangle>) -> Self {
        let mut rows = Vec::with_capacity(9 * corners.len() + 1);
        for [a, b, c] in corners {
            for axis in 0..3 {
                rows.extend([a[axis], b[axis], c[axis]]);
            }
        }
        rows.push(0.0);
        Self { rows }
    }

    pub fn len(&self) -> usize {
        self.rows.len() / 9
    }

    /// Memory held, in bytes.
    pub fn bytes(&self) -> usize {
        4 * self.rows.len()
    }

    #[inline(always)]
    pub fn get(&self, index: u32) -> Triangle {
        let (rows, _) = self.rows.as_chunks::<9>();
        let &[ax, bx, cx, ay, by, cy, az, bz, cz] = &rows[index as usize];
        [[ax, ay, az], [bx, by, bz], [cx, cy, cz]]
    }

    /// Turns every triangle: its last two corners change places.
    pub fn turn(&mut self) {
        for row in self.rows.as_chunks_mut::<3>().0 {
            row.swap(1, 2);
        }
    }

    pub fn iter(&self) -> impl Iterator<Item = Triangle> {
        (0..self.len() as u32).map(|i| self.get(i))
    }

    /// Has the memory of four triangles from `index` on fetched.
    #[inline(always)]
    pub fn fetch(&self, index: u32) {
        for offset in [0, 16, 32] {
            prefetch_index(&self.rows, 9 * index as usize + offset);
        }
    }

    /// Whether `filter` lets triangle `index` pass at the fraction `u` of the way to the same
    /// triangle of `other`.
    #[inline(always)]
    pub fn pass_between(&self, other: &Self, u: f32, filter: &TriangleFilter, index: u32) -> bool {
        let (from, to) = (self.row(index), other.row(index));
        filter.passes(|axis| {
            let [from, to] = [from, to].map(|row| Vec4::from_slice(&row[3 * axis..][..4]));
            from + (to - from) * Vec4::splat(u)
        })
    }

    /// The numbers of triangle `index`, and one more.
    #[inline(always)]
    fn row(&self, index: u32) -> &[f32] {
        &self.rows[9 * index as usize..][..10]
    }

    /// Whether `filter` lets triangle `index` pass.
    #[inline(always)]
    pub fn pass(&self, filter: &TriangleFilter, index: u32) -> bool {
        let row = self.row(index);
        filter.passes(|axis| Vec4::from_slice(&row[3 * axis..][..4]))
    }
}
