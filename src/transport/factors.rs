//! Variance factors: how much less a strategy scatters than its second moment says.
//!
//! The balance heuristic compares strategies by second moments of single samples. What makes grain
//! is variance, and a strategy that gives a pixel nearly the same value in every pass has a large
//! moment and hardly any variance. The weights therefore count strategy s as
//! [`Factors::of`]`[s]` times its density: the quotient v of the two for strategies of the pixel's
//! own, 1 for splats. [theory (2.7)]
//!
//! Invariant: a function of the strategy and of the path (the light of x₀, the labels, where on the
//! film), so that all strategies of a path agree and the weights sum to 1 whatever the numbers are.

use super::class::PathClass;
use crate::light::LightId;
use glam::DVec2;

/// Longer classes have no factors.
pub const MAX_DEPTH: u32 = 8;
/// Lights with factors of their own; all further ones share the last.
const LIGHTS: usize = 64;
/// Numbers of the classes of up to `MAX_DEPTH` scattering vertices.
const CLASSES: usize = 2 << MAX_DEPTH;
/// Marks a key without factors.
const NONE: u32 = u32::MAX;

/// Square cells over a part of the film; what lies outside belongs to the nearest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cells {
    /// First column and row.
    pub first: [u32; 2],
    /// Columns and rows of pixels.
    pub size: [u32; 2],
    /// Side in pixels.
    pub side: u32,
}

impl Cells {
    /// Cells in a row.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.size[0].div_ceil(self.side) as usize
    }

    /// Rows of cells.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.size[1].div_ceil(self.side) as usize
    }

    /// All cells.
    #[must_use]
    pub fn count(&self) -> usize {
        self.columns() * self.rows()
    }

    /// The cell of a raster position.
    #[must_use]
    pub fn at(&self, raster: DVec2) -> usize {
        let along = |x: f64, i: usize| {
            let last = f64::from(self.size[i] - 1);
            (x - f64::from(self.first[i])).clamp(0.0, last) as u32 / self.side
        };
        along(raster.y, 1) as usize * self.columns() + along(raster.x, 0) as usize
    }
}

/// Light of x₀ and labels: the part of a path, besides its place on the film, that its factors
/// depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FactorKey {
    light: u8,
    class: PathClass,
}

impl FactorKey {
    /// Of paths from a light; `None` where they are too long for factors.
    #[must_use]
    pub fn new(light: LightId, class: PathClass) -> Option<Self> {
        let light = (light.0 as usize).min(LIGHTS - 1) as u8;
        (class.depth() <= MAX_DEPTH).then_some(Self { light, class })
    }

    /// The class.
    #[must_use]
    pub fn class(&self) -> PathClass {
        self.class
    }

    /// Number of the light of x₀; the last stands for all further ones.
    #[must_use]
    pub fn light(&self) -> u8 {
        self.light
    }

    /// Number of strategies that have a factor: all but t = 0.
    #[must_use]
    pub fn strategies(&self) -> usize {
        self.class.depth() as usize + 2
    }

    fn number(&self) -> usize {
        usize::from(self.light) * CLASSES + self.class.number()
    }
}

/// The factors of all strategies, by key and cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Factors {
    cells: Cells,
    /// First value of each key.
    first: Vec<u32>,
    /// Key by key, cell by cell, strategy s = 0, 1, ...
    values: Vec<f32>,
    /// Cell by cell; empty: no bounds.
    roulette: Vec<f32>,
}

impl Factors {
    /// 1 for every strategy.
    #[must_use]
    pub fn new(cells: Cells) -> Self {
        Self {
            cells,
            first: Vec::new(),
            values: Vec::new(),
            roulette: Vec::new(),
        }
    }

    /// The cells.
    #[must_use]
    pub fn cells(&self) -> &Cells {
        &self.cells
    }

    /// Sets the factors of a key: for each cell those of its strategies s = 0, 1, ..., all of them
    /// positive. Fails where there are other than cells times [`FactorKey::strategies`].
    ///
    /// # Errors
    /// The number of values that is wanted.
    pub fn insert(&mut self, key: FactorKey, values: &[f32]) -> Result<(), usize> {
        let wanted = self.cells.count() * key.strategies();
        if values.len() != wanted || !values.iter().all(|v| *v > 0.0 && v.is_finite()) {
            return Err(wanted);
        }
        self.first.resize(LIGHTS * CLASSES, NONE);
        self.first[key.number()] = self.values.len() as u32;
        self.values.extend_from_slice(values);
        Ok(())
    }

    /// Factors of a key as [`Factors::insert`] took them; none where it has none.
    #[must_use]
    pub fn of_key(&self, key: FactorKey) -> &[f32] {
        match self.first.get(key.number()) {
            None | Some(&NONE) => &[],
            Some(&first) => &self.values[first as usize..][..self.cells.count() * key.strategies()],
        }
    }

    /// The largest roulette threshold of each cell, in Y; empty: no bounds.
    #[must_use]
    pub fn roulette(&self) -> &[f32] {
        &self.roulette
    }

    /// Sets the largest roulette threshold of each cell, in Y.
    ///
    /// # Errors
    /// The number of cells where there are other than so many.
    pub fn bound_roulette(&mut self, thresholds: Vec<f32>) -> Result<(), usize> {
        if thresholds.len() != self.cells.count() {
            return Err(self.cells.count());
        }
        self.roulette = thresholds;
        Ok(())
    }

    /// Largest roulette threshold at a raster position, in Y: where a pixel is quiet, small
    /// contributions are not worth the noise of a game.
    #[must_use]
    pub fn roulette_bound(&self, raster: DVec2) -> f64 {
        if self.roulette.is_empty() {
            f64::INFINITY
        } else {
            f64::from(self.roulette[self.cells.at(raster)])
        }
    }

    /// Factors of the strategies s = 0, 1, ... of a path of this key that lies at `raster`; those
    /// that are not there are 1.
    #[must_use]
    pub fn of(&self, key: FactorKey, raster: DVec2) -> &[f32] {
        match self.first.get(key.number()) {
            None | Some(&NONE) => &[],
            Some(&first) => {
                let n = key.strategies();
                let at = first as usize + self.cells.at(raster) * n;
                &self.values[at..at + n]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn class(labels: &[bool]) -> PathClass {
        let mut class = PathClass::new();
        labels.iter().for_each(|&specular| class.push(specular));
        class
    }

    #[test]
    fn keys_and_cells_do_not_mix() {
        let cells = Cells {
            first: [8, 4],
            size: [32, 26],
            side: 16,
        };
        assert_eq!((cells.columns(), cells.rows()), (2, 2));
        let mut factors = Factors::new(cells);
        let keys: Vec<FactorKey> = [
            (0, vec![]),
            (0, vec![false]),
            (1, vec![false]),
            (0, vec![true, false]),
        ]
        .into_iter()
        .filter_map(|(light, labels)| FactorKey::new(LightId(light), class(&labels)))
        .collect();
        assert_eq!(keys.len(), 4);
        for (i, key) in keys.iter().enumerate().skip(1) {
            let count = cells.count() * key.strategies();
            let values: Vec<f32> = (0..count).map(|c| (100 * i + c + 1) as f32).collect();
            assert_eq!(factors.insert(*key, &values), Ok(()));
        }
        // the first has none
        assert!(factors.of(keys[0], DVec2::new(9.0, 5.0)).is_empty());
        assert_eq!(
            factors.of(keys[1], DVec2::new(9.0, 5.0)),
            [101.0, 102.0, 103.0]
        );
        assert_eq!(
            factors.of(keys[2], DVec2::new(24.5, 5.0)),
            [204.0, 205.0, 206.0]
        );
        // beyond the film: the nearest cell
        assert_eq!(
            factors.of(keys[1], DVec2::new(-3.0, 99.0)),
            [107.0, 108.0, 109.0]
        );
        assert_eq!(
            factors.of(keys[3], DVec2::new(99.0, 99.0)),
            [313.0, 314.0, 315.0, 316.0]
        );
        assert_eq!(factors.roulette_bound(DVec2::new(9.0, 5.0)), f64::INFINITY);
        assert_eq!(factors.bound_roulette(vec![1.0]), Err(4));
        assert_eq!(factors.bound_roulette(vec![1.0, 2.0, 3.0, 4.0]), Ok(()));
        assert_eq!(factors.roulette_bound(DVec2::new(24.5, 5.0)), 2.0);
        assert_eq!(factors.insert(keys[1], &[1.0]), Err(12));
        assert_eq!(factors.insert(keys[1], &[0.0; 12]), Err(12));
    }

    #[test]
    fn long_classes_have_none_and_late_lights_share() {
        assert!(FactorKey::new(LightId(0), class(&[false; 9])).is_none());
        let of = |light| FactorKey::new(LightId(light), class(&[true]));
        assert_eq!(of(63), of(1000));
        assert_ne!(of(62), of(63));
    }
}
