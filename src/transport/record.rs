//! Test hook: what the strategies of this thread's samples say of the paths they made.

use super::density::{Column, PathView};
use super::mis::{Multipliers, Technique, for_each_term};
use super::strategies::StrategySet;
use crate::geometry::Ray;
use crate::light::LightId;
use crate::spectrum::MAX_LANES;
use glam::DVec2;
use std::cell::RefCell;

/// A path as its strategy sees it.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// Vertices made from the light.
    pub s: usize,
    /// Vertices made from the sensor.
    pub t: usize,
    /// `pf_i` of every lane.
    pub pf: Vec<Column>,
    /// `pr_i` of every lane.
    pub pr: Vec<Column>,
    /// Density of x₀ by direct sampling.
    pub direct: f64,
    /// Labels.
    pub specular: Vec<bool>,
    /// Transmissions that disperse.
    pub dispersive: Vec<bool>,
    /// `m(s)` of every strategy.
    pub multipliers: Vec<f64>,
    /// Weight of the strategy, without the lanes.
    pub weight: f64,
    /// The light of x₀.
    pub emitter: LightId,
    /// Where on the film.
    pub raster: DVec2,
    /// The segment that joins the sub-paths.
    pub segment: Option<Ray>,
}

thread_local! {
    static RECORDS: RefCell<Option<Vec<Recorded>>> = const { RefCell::new(None) };
}

/// Starts to record on this thread and returns what was recorded so far.
pub fn take() -> Vec<Recorded> {
    RECORDS.replace(Some(Vec::new())).unwrap_or_default()
}

pub(super) fn record(view: &PathView, strategies: &StrategySet, segment: Option<&Ray>) {
    RECORDS.with_borrow_mut(|records| {
        let Some(records) = records else { return };
        let n = view.len();
        let s = view.s();
        let column = |f: &dyn Fn(usize) -> f64| -> Column {
            let mut lanes = [0.0; MAX_LANES];
            for (k, lane) in lanes.iter_mut().enumerate() {
                *lane = f(k);
            }
            lanes
        };
        let mut sum = 0.0;
        let multipliers = Multipliers::new(view, strategies);
        for_each_term(&multipliers, |_, term| sum += term);
        records.push(Recorded {
            s,
            t: n - s,
            pf: (0..n).map(|i| column(&|k| view.pf_lane(i, k))).collect(),
            pr: (0..n).map(|i| column(&|k| view.pr_lane(i, k))).collect(),
            direct: view.direct,
            specular: (0..n).map(|i| view.is_specular(i)).collect(),
            dispersive: (0..n).map(|i| view.is_dispersive(i)).collect(),
            multipliers: (0..=n)
                .map(|i| multipliers.of(Technique::Join(i)))
                .collect(),
            weight: multipliers.of(Technique::Join(s)) / sum,
            emitter: view.emitter,
            raster: view.raster,
            segment: segment.copied(),
        });
    });
}
