//! Class × strategy: hits, raw mean and weighted mean, the instrument for finding what a method
//! misses.
//!
//! The raw mean is what the strategy alone would estimate for the class; all strategies that can
//! make a class agree on it.

use crate::spectrum::LaneResponse;
use crate::transport::Contribution;
use crate::transport::class::PathClass;
use std::collections::BTreeMap;

/// Sums of one class by one strategy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Non-zero contributions.
    pub hits: u64,
    /// Sum of raw (unweighted) values of Y.
    pub raw: f64,
    /// Sum of squares of raw values.
    pub raw_squares: f64,
    /// Sum of weighted values of Y.
    pub weighted: f64,
}

/// Sum over all strategies of one class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassShare {
    /// The class.
    pub class: PathClass,
    /// Non-zero contributions.
    pub hits: u64,
    /// Share of the light of the image.
    pub share: f64,
}

/// Rows by class and strategy (s, t).
#[derive(Clone, Debug, Default)]
pub struct ClassTable {
    rows: BTreeMap<(PathClass, u32, u32), Row>,
}

impl ClassTable {
    /// Adds the `share` of a contribution that lands on the film, as it counts for the sum over all
    /// pixels.
    pub fn add(&mut self, contribution: &Contribution, share: f64, response: &LaneResponse) {
        let y = |lanes| response.xyz(lanes)[1];
        let row = self
            .rows
            .entry((contribution.class, contribution.s, contribution.t))
            .or_default();
        let raw = share * y(&contribution.raw);
        row.hits += 1;
        row.raw += raw;
        row.raw_squares += raw * raw;
        row.weighted += share * y(&contribution.lanes);
    }

    /// Adds another table.
    pub fn merge(&mut self, other: Self) {
        for (key, theirs) in other.rows {
            let ours = self.rows.entry(key).or_default();
            ours.hits += theirs.hits;
            ours.raw += theirs.raw;
            ours.raw_squares += theirs.raw_squares;
            ours.weighted += theirs.weighted;
        }
    }

    /// All rows, sorted by class, then strategy.
    pub fn rows(&self) -> impl Iterator<Item = (&(PathClass, u32, u32), &Row)> {
        self.rows.iter()
    }

    /// The classes that hold light but were hit fewer than `least_hits` times, the brightest first.
    /// Such estimates may be far from the truth, without any sign of it in the noise of the
    /// image.
    #[must_use]
    pub fn rarely_hit(&self, least_hits: u64) -> Vec<ClassShare> {
        let mut classes: BTreeMap<PathClass, (u64, f64)> = BTreeMap::new();
        for ((class, _, _), row) in &self.rows {
            let (hits, weighted) = classes.entry(*class).or_default();
            *hits += row.hits;
            *weighted += row.weighted;
        }
        let all: f64 = classes.values().map(|c| c.1).sum();
        let mut rare: Vec<ClassShare> = classes
            .into_iter()
            .filter(|(_, (hits, weighted))| *hits < least_hits && *weighted > 0.0)
            .map(|(class, (hits, weighted))| ClassShare {
                class,
                hits,
                share: weighted / all,
            })
            .collect();
        rare.sort_by(|a, b| b.share.total_cmp(&a.share));
        rare
    }

    /// Whether nothing was counted.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}
