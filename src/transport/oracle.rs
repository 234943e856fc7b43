//! The weights by definition: every strategy's density as a plain product, nothing shared, nothing
//! cancelled. Slow; checks `mis.rs`.

use super::density::{Bridge, Column, Edge, EdgeDensity, NO_COLUMN, PathView, VertexDensity};
use super::factors::MAX_DEPTH;
use super::merge::{MergeSide, is_separable, merge_factors, side_terms};
use super::mis::{Multipliers, Technique, denominator, for_each_term, merge_denominator};
use super::regularize::Cone;
use super::strategies::{Aims, StrategySet};
use crate::bsdf::Label;
use crate::light::LightId;
use crate::scene::settings::{Heuristic, SingleRule};
use crate::spectrum::{SampledWavelengths, WavelengthDistribution};
use glam::DVec2;
use std::collections::BTreeSet;

mod bridges;
mod random;

pub(crate) use random::random_factors;
use random::{Random, random_disabled, random_factor, random_path, random_strategies};

/// All densities of a finished path, from both sides and for every lane.
pub(crate) struct FullPath {
    pub pf: Vec<Column>,
    pub pr: Vec<Column>,
    pub direct: f64,
    pub specular: Vec<bool>,
    pub dispersive: Vec<bool>,
    /// Of the edge before each vertex.
    pub lengths: Vec<f32>,
    pub hittable_light: bool,
    pub emitter: LightId,
    pub raster: DVec2,
    /// Chains solved for, and the one that made the path.
    pub bridges: [Option<Bridge>; 2],
    pub made: Option<Bridge>,
}

impl FullPath {
    fn len(&self) -> usize {
        self.pf.len()
    }

    /// `P̃_s` for lane `k`, by definition.
    fn density(&self, s: usize, k: usize) -> f64 {
        let mut product = 1.0;
        for i in 0..self.len() {
            product *= match (i, s) {
                (0, 1) => self.direct,
                _ if i < s => self.pf[i][k],
                _ => self.pr[i][k],
            };
        }
        product
    }

    /// The density of generating x_i from both sides, for lane `k`.
    fn merge_density(&self, i: usize, k: usize) -> f64 {
        let light: f64 = (0..=i).map(|j| self.pf[j][k]).product();
        let sensor: f64 = (i..self.len()).map(|j| self.pr[j][k]).product();
        light * sensor
    }

    /// π r² N_L where merging at x_i is done.
    fn merging(&self, strategies: &StrategySet, i: usize) -> f64 {
        let inner = 1..self.len() - 1;
        let last = inner.clone().rev().find(|&j| !self.specular[j]);
        let merges = inner.contains(&i)
            && !self.specular[i]
            && (!strategies.merges_first_only() || last == Some(i));
        if merges {
            strategies.merge_samples()
        } else {
            0.0
        }
    }

    fn is_mergeable(&self) -> bool {
        (1..self.len() - 1).any(|i| !self.specular[i])
    }

    /// The path as strategy `s` stores it, and handed to `f`.
    fn seen_by<T>(&self, s: usize, f: impl FnOnce(&PathView) -> T) -> T {
        let n = self.len();
        let label = |i: usize| {
            if self.specular[i] {
                Label::SpecularTransmit
            } else {
                Label::NonSpecular
            }
        };
        let different = |c: &Column| c.iter().any(|v| *v != c[0]);
        let mut columns = Vec::new();
        let mut vertex = |own: &Column, other: &Column, i: usize, length: f32| {
            let mut density = VertexDensity::new(own[0]);
            density.other = other[0];
            density.label = label(i);
            density.dispersive = self.dispersive[i];
            density.length = length;
            for (column, index) in [
                (own, &mut density.own_column),
                (other, &mut density.other_column),
            ] {
                if different(column) {
                    *index = columns.len() as u32;
                    columns.push(*column);
                } else {
                    *index = NO_COLUMN;
                }
            }
            density
        };
        let light: Vec<_> = (0..s)
            .map(|i| vertex(&self.pf[i], &self.pr[i], i, self.lengths[i]))
            .collect();
        let camera: Vec<_> = (s..n)
            .rev()
            .map(|i| {
                let behind = self.lengths.get(i + 1).copied().unwrap_or(f32::INFINITY);
                vertex(&self.pr[i], &self.pf[i], i, behind)
            })
            .collect();
        let edge_density = |table: &[Column], i: Option<usize>| match i.filter(|&i| i < n) {
            None => EdgeDensity::default(),
            Some(i) => EdgeDensity {
                hero: table[i][0],
                lanes: different(&table[i]).then_some(table[i]),
            },
        };
        let edge = Edge {
            light_end: edge_density(&self.pr, s.checked_sub(1)),
            light_before: edge_density(&self.pr, s.checked_sub(2)),
            camera_end: edge_density(&self.pf, Some(s)),
            camera_before: edge_density(&self.pf, Some(s + 1)),
            light_label: if s > 0 {
                label(s - 1)
            } else {
                Label::NonSpecular
            },
            camera_label: if s < n { label(s) } else { Label::NonSpecular },
            length: self.lengths.get(s).copied().unwrap_or(f32::INFINITY),
            light_dispersive: s > 0 && self.dispersive[s - 1],
            camera_dispersive: s < n && self.dispersive[s],
        };
        f(&PathView {
            light: &light,
            camera: &camera,
            light_columns: &columns,
            camera_columns: &columns,
            edge,
            direct: self.direct,
            hittable_light: self.hittable_light,
            bridges: self.bridges,
            made: self.made,
            fan: None,
            emitter: self.emitter,
            raster: self.raster,
        })
    }

    /// Sum of the weights of all strategies that can make the path, each as that strategy sees it.
    pub fn weight_sum(&self, strategies: &StrategySet) -> f64 {
        let one = WavelengthDistribution::uniform([360.0, 830.0]).sample(0.5, 1);
        (0..=self.len())
            .filter(|&s| self.density(s, 0) > 0.0)
            .map(|s| self.seen_by(s, |view| weight(&Multipliers::new(view, strategies), &one)))
            .sum()
    }

    fn regularized(&self, s: usize) -> i32 {
        if s == 0 || s == self.len() {
            0
        } else {
            i32::from(self.specular[s - 1]) + i32::from(self.specular[s])
        }
    }

    /// Variance factor of strategy `s` by definition.
    fn factor(&self, strategies: &StrategySet, s: usize) -> f64 {
        let labels = &self.specular[1..self.len() - 1];
        match strategies.factors {
            Some(_) if labels.len() <= MAX_DEPTH as usize && s < self.len() => {
                random_factor(self.emitter, labels, self.raster, s)
            }
            _ => 1.0,
        }
    }

    /// `m₁(s)` by definition.
    fn multiplier(&self, strategies: &StrategySet, s: usize) -> f64 {
        let n = self.len();
        let plain = |s: usize| {
            let r = self.regularized(s);
            let cone = match strategies.cone {
                Some(cone) => cone.area.powi(r),
                None if r > 0 => 0.0,
                None => 1.0,
            };
            strategies.samples(Technique::Join(s), n, r > 0) * cone
        };
        let possible: Vec<usize> = (0..=n)
            .filter(|&s| plain(s) > 0.0 && (s > 0 || self.hittable_light))
            .collect();
        let unbiased = possible.iter().any(|&s| self.regularized(s) == 0)
            || strategies.merge_samples() > 0.0 && self.is_mergeable();
        if strategies.cone.is_some() && self.bridges.iter().any(Option::is_some) {
            return plain(s)
                * self.factor(strategies, s)
                * f64::from(u8::from(self.regularized(s) == 0));
        }
        let preference = match strategies.single.filter(|_| strategies.cone.is_some()) {
            None if unbiased && strategies.cone.is_some() => {
                strategies.bias_weight.powi(self.regularized(s))
            }
            None => 1.0,
            Some(_) if unbiased => f64::from(u8::from(self.regularized(s) == 0)),
            Some(rule) => {
                let least = possible.iter().map(|&s| self.regularized(s)).min();
                let mut candidates: Vec<usize> = possible
                    .into_iter()
                    .filter(|&s| Some(self.regularized(s)) == least)
                    .collect();
                match rule {
                    SingleRule::Light => candidates.reverse(),
                    SingleRule::Camera => {}
                    SingleRule::ShortestEdge => {
                        candidates.sort_by(|&a, &b| self.lengths[b].total_cmp(&self.lengths[a]));
                    }
                }
                f64::from(u8::from(candidates.last() == Some(&s)))
            }
        };
        let forbidden = strategies.merges_alone() && self.is_mergeable();
        plain(s) * preference * self.factor(strategies, s) * f64::from(u8::from(!forbidden))
    }
}

/// Every strategy, executed by the pixel.
fn every(disabled: &BTreeSet<(u32, u32)>) -> StrategySet<'_> {
    StrategySet {
        hits: true,
        direct: true,
        direct_to_detector: true,
        splats: true,
        arrivals: true,
        pairs: 1.0,
        merge: None,
        heuristic: Heuristic::Balance,
        factors: None,
        light_paths: 1.0,
        splat_samples: 1.0,
        hittable_sensor: true,
        cone: None,
        single: None,
        bias_weight: 1.0,
        aims: Aims::NONE,
        fans: false,
        tries: None,
        disabled,
    }
}

/// `D_j · P̃_s(hero)` by definition: every technique (s', k) that delivers to lane j.
fn denominator_by_definition(
    path: &FullPath,
    strategies: &StrategySet,
    wavelengths: &SampledWavelengths,
    j: usize,
) -> f64 {
    let n = path.len();
    let scattered = |s: usize| {
        (0..n).any(|i| {
            let end = (s > 0 && s < n) && (i + 1 == s || i == s);
            path.dispersive[i] && !end
        })
    };
    let mut sum = 0.0;
    for s in 0..=n {
        for k in 0..wavelengths.count() {
            if !scattered(s) || wavelengths.lambda_nm(k) == wavelengths.lambda_nm(j) {
                let term = path.multiplier(strategies, s) * path.density(s, k);
                sum += match strategies.heuristic {
                    Heuristic::VarianceAware | Heuristic::Balance => term,
                    Heuristic::Power2 => term * term,
                };
            }
        }
    }
    let disperses = path.dispersive.contains(&true);
    for i in 1..n - 1 {
        for k in 0..wavelengths.count() {
            if !disperses || wavelengths.lambda_nm(k) == wavelengths.lambda_nm(j) {
                let term = path.merging(strategies, i) * path.merge_density(i, k);
                sum += match strategies.heuristic {
                    Heuristic::VarianceAware | Heuristic::Balance => term,
                    Heuristic::Power2 => term * term,
                };
            }
        }
    }
    sum
}

/// The largest relative error of the constant-time sums for merging at x_i against the walk over
/// the whole path.
fn merge_error(
    path: &FullPath,
    strategies: &StrategySet,
    wavelengths: &SampledWavelengths,
    i: usize,
) -> f64 {
    path.seen_by(i + 1, |view| {
        let expected = merge_denominator(
            &Multipliers::new(view, strategies),
            wavelengths,
            &mut Vec::new(),
        );
        let mut sensor = view.camera.to_vec();
        sensor.push(VertexDensity::new(path.pr[i][0]));
        let direct = path.direct / path.pf[0][0];
        let side = MergeSide::Light { direct };
        let mut light = side_terms(view.light, path.pr[i - 1][0], side, strategies);
        // as they are stored
        for sum in [&mut light.first, &mut light.rest, &mut light.rest_shared] {
            *sum = f64::from(*sum as f32);
        }
        let factor = path.pf[i + 1][0];
        let sensor = side_terms(&sensor, factor, MergeSide::Sensor, strategies);
        let found = merge_factors(&light, &sensor, (1.0, 1.0), strategies, wavelengths);
        (0..wavelengths.count())
            .map(|j| (found[j] / expected.factor(j) - 1.0).abs())
            .fold(0.0, f64::max)
    })
}

/// Weight of the strategy that made a path, from what contributions are multiplied by: its
/// numerator is F over its density and n_s.
fn weight(multipliers: &Multipliers, wavelengths: &SampledWavelengths) -> f64 {
    let executed = Technique::Join(multipliers.path().s());
    let found = denominator(multipliers, wavelengths, &mut Vec::new());
    multipliers.plain(executed) * found.factor(0)
}

fn check(
    seed: u64,
    columns: bool,
    zeros: f64,
    lengths: std::ops::RangeInclusive<usize>,
    rounds: usize,
) {
    let mut random = Random {
        key: seed,
        counter: 0,
    };
    let continuous = WavelengthDistribution::uniform([360.0, 830.0]);
    let lines = WavelengthDistribution::lines(&[450.0, 550.0, 650.0]);
    let (mut executed_strategies, mut worst_sum, mut worst_lane) = (0, 0.0_f64, 0.0_f64);
    let (mut merges, mut worst_merge) = (0, 0.0_f64);
    let factors = random_factors();
    for _ in 0..rounds {
        let span = (lengths.end() - lengths.start() + 1) as f64;
        let n = lengths.start() + (random.next() * span) as usize;
        let path = random_path(&mut random, n, columns, zeros);
        let disabled = random_disabled(&mut random, n);
        let strategies = random_strategies(&mut random, &disabled, &factors);
        let count = [1, 4, 8][(random.next() * 3.0) as usize];
        let distribution = if random.next() < 0.3 {
            &lines
        } else {
            &continuous
        };
        let wavelengths = distribution.sample(random.next(), count);
        let (mut weight_sum, mut made_sum) = (0.0, 0.0);
        let mut possible = 0;
        let one = continuous.sample(0.5, 1);
        for s in 0..=n {
            path.seen_by(s, |view| {
                let multipliers = Multipliers::new(view, &strategies);
                let own = path.multiplier(&strategies, s);
                if path.density(s, 0) == 0.0 {
                    return;
                }
                let found = multipliers.of(Technique::Join(s));
                assert!(
                    found == own || (found / own - 1.0).abs() < 1e-12,
                    "m({s}) is {found:e}, not {own:e}"
                );
                if own == 0.0 {
                    return;
                }
                possible += 1;
                let mut total = 0.0;
                for_each_term(&multipliers, |_, term| total += term);
                weight_sum += own / total;
                made_sum += weight(&multipliers, &one);
                let all = denominator(&multipliers, &wavelengths, &mut Vec::new());
                for j in 0..count {
                    let base = path.density(s, 0);
                    let base = if strategies.heuristic == Heuristic::Power2 {
                        base * base
                    } else {
                        base
                    };
                    let expected =
                        denominator_by_definition(&path, &strategies, &wavelengths, j) / base;
                    let found = all.shared + all.own[j];
                    if expected > 0.0 || found > 0.0 {
                        worst_lane = worst_lane.max((found / expected - 1.0).abs());
                    }
                }
            });
        }
        for i in 1..n - 1 {
            let (own, base) = (path.merging(&strategies, i), path.density(i + 1, 0));
            if own == 0.0 || path.merge_density(i, 0) == 0.0 {
                continue;
            }
            merges += 1;
            possible += 1;
            path.seen_by(i + 1, |view| {
                let multipliers = Multipliers::new(view, &strategies);
                let mut total = 0.0;
                for_each_term(&multipliers, |_, term| total += term);
                weight_sum += own * path.pr[i][0] / total;
                let found = merge_denominator(&multipliers, &one, &mut Vec::new());
                made_sum += own * found.factor(0);
                let all = merge_denominator(&multipliers, &wavelengths, &mut Vec::new());
                for j in [0, count - 1] {
                    let expected = denominator_by_definition(&path, &strategies, &wavelengths, j);
                    let expected = expected / strategies.heuristic.power(base);
                    worst_lane = worst_lane.max(((all.shared + all.own[j]) / expected - 1.0).abs());
                }
            });
            if !columns && is_separable(&strategies) {
                worst_merge = worst_merge.max(merge_error(&path, &strategies, &wavelengths, i));
            }
        }
        executed_strategies += possible;
        if possible > 0 && !columns {
            let balance = strategies.heuristic != Heuristic::Power2;
            if balance {
                worst_sum = worst_sum.max((weight_sum - 1.0).abs());
            }
            worst_sum = worst_sum.max((made_sum - 1.0).abs());
        }
    }
    assert!(
        executed_strategies > rounds,
        "only {executed_strategies} strategies could be checked"
    );
    // n products of f64, each with a rounding of 1.1e-16
    assert!(worst_sum < 1e-12, "weights sum to 1 {worst_sum:e}");
    assert!(worst_lane < 1e-12, "denominators differ by {worst_lane:e}");
    assert!(merges > rounds / 4, "only {merges} merges");
    // three roundings to f32 of 6e-8
    assert!(
        worst_merge < 1e-6,
        "sums for merging differ by {worst_merge:e}"
    );
}

#[test]
fn weights_equal_their_definition() {
    check(1, false, 0.05, 2..=12, 20_000);
}

#[test]
fn weights_of_long_paths_equal_their_definition() {
    check(2, false, 0.0, 13..=50, 2_000);
}

#[test]
fn lane_columns_equal_their_definition() {
    check(3, true, 0.05, 2..=10, 5_000);
}

#[test]
fn a_numerator_without_its_factor_is_seen() {
    let mut random = Random { key: 5, counter: 0 };
    let (none, factors) = (BTreeSet::new(), random_factors());
    let wavelengths = WavelengthDistribution::uniform([360.0, 830.0]).sample(0.5, 1);
    let mut seen = 0;
    for _ in 0..100 {
        let path = random_path(&mut random, 5, false, 0.0);
        let strategies = StrategySet {
            factors: Some(&factors),
            cone: Some(Cone::new(0.3)),
            ..every(&none)
        };
        let (mut sum, mut forgotten) = (0.0, 0.0);
        for s in 0..=5 {
            let weight = path.seen_by(s, |view| {
                weight(&Multipliers::new(view, &strategies), &wavelengths)
            });
            sum += weight;
            forgotten += weight / path.factor(&strategies, s);
        }
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        seen += usize::from(forgotten < 0.99);
    }
    // the factor of the strategy that makes nearly all is 1 in one path of a hundred
    assert!(seen > 90, "{seen} of 100");
}

#[test]
fn a_planted_error_is_seen() {
    // the check itself must be able to fail: here the strategy of largest weight counts 2 % too
    // high
    let mut random = Random { key: 4, counter: 0 };
    let mut path = random_path(&mut random, 5, false, 0.0);
    path.specular.fill(false);
    let none = BTreeSet::new();
    let strategies = every(&none);
    let weight_sum = |planted: Option<usize>| {
        let mut sum = 0.0;
        for s in 0..=5 {
            path.seen_by(s, |view| {
                let multipliers = Multipliers::new(view, &strategies);
                let mut total = 0.0;
                for_each_term(&multipliers, |i, term| {
                    total += if planted.is_some_and(|s| Technique::Join(s) == i) {
                        1.02 * term
                    } else {
                        term
                    };
                });
                sum += multipliers.of(Technique::Join(s)) / total;
            });
        }
        sum
    };
    assert!((weight_sum(None) - 1.0).abs() < 1e-12);
    let worst = (0..=5)
        .map(|s| (weight_sum(Some(s)) - 1.0).abs())
        .fold(0.0, f64::max);
    assert!(worst > 2e-3, "{worst}");
}
