//! Sums of a film by the pixels whose samples have brought its light: they tell how well the whole
//! is known.
//!
//! Light of a sample may land anywhere, and what lands in one pixel comes from samples that are
//! spread evenly (wavelengths, points of lights, sequences of surfaces), so that pixels of a film
//! err together: what one misses falls into another. Samples of different pixels share no random
//! numbers but those of wavelengths, which are a net over aligned squares of pixels; over blocks of
//! such squares the halves of the passes are compared.

use super::Crop;
use std::sync::Arc;

/// Division of the pixels whose samples fill a film into square blocks. Sides are powers of two and
/// the same, corners multiples of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Blocks {
    first: (u32, u32),
    columns: u32,
    rows: u32,
    /// The side of a block is 2 to the power of this, in pixels.
    bits: u32,
}

impl Blocks {
    /// Most blocks of a film. The standard error is known to 1/√(2n) of itself by n of them.
    pub const MOST: u32 = 64;

    /// As many as there may be.
    #[must_use]
    pub fn of(crop: &Crop) -> Self {
        let with_bits = |bits: u32| {
            let first = (crop.x0 >> bits, crop.y0 >> bits);
            Self {
                first,
                columns: ((crop.x1 - 1) >> bits) + 1 - first.0,
                rows: ((crop.y1 - 1) >> bits) + 1 - first.1,
                bits,
            }
        };
        let fits = |blocks: &Self| {
            u64::from(blocks.columns) * u64::from(blocks.rows) <= u64::from(Self::MOST)
        };
        // one block of 2^31 pixels' width, or four of them, hold any film
        (0..31).map(with_bits).find(fits).unwrap_or(with_bits(31))
    }

    /// Number of blocks.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.columns * self.rows
    }

    /// The block of a pixel, by number; `None` outside all.
    #[must_use]
    pub fn at(&self, (x, y): (u32, u32)) -> Option<u32> {
        let column = (x >> self.bits).checked_sub(self.first.0)?;
        let row = (y >> self.bits).checked_sub(self.first.1)?;
        (column < self.columns && row < self.rows).then(|| row * self.columns + column)
    }
}

/// How light is summed up by the pixels whose samples have brought it.
#[derive(Clone, Debug)]
pub struct Sources {
    /// Blocks of these pixels.
    pub blocks: Blocks,
    /// Measure of each pixel, where light lands, row by row; `None`: 1 each.
    pub measures: Option<Arc<[f64]>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_aligned_and_cover_a_film() {
        for (x0, y0, x1, y1) in [
            (0, 0, 1, 1),
            (0, 0, 16, 16),
            (0, 0, 17, 16),
            (3, 5, 131, 77),
            (0, 0, 1, 5000),
            (100, 7, 5000, 8),
            (0, 0, u32::MAX, u32::MAX),
            (u32::MAX - 3, u32::MAX - 1, u32::MAX, u32::MAX),
        ] {
            let crop = Crop { x0, y0, x1, y1 };
            let blocks = Blocks::of(&crop);
            assert!((1..=Blocks::MOST).contains(&blocks.count()), "{blocks:?}");
            let side = 1_u64 << blocks.bits;
            // half the side would make too many
            let half = |a: u32, b: u32| u64::from(b - 1) * 2 / side - u64::from(a) * 2 / side + 1;
            let is_least = side == 1 || half(x0, x1) * half(y0, y1) > u64::from(Blocks::MOST);
            assert!(is_least, "{blocks:?}");
            assert_eq!(blocks.at((x0, y0)), Some(0));
            assert_eq!(blocks.at((x1 - 1, y1 - 1)), Some(blocks.count() - 1));
            let left = (x0 >> blocks.bits << blocks.bits).checked_sub(1);
            assert_eq!(left.and_then(|x| blocks.at((x, y0))), None);
        }
    }
}
