//! Random paths, variance factors and sets of strategies, of more kinds than renders make.

use super::super::class::PathClass;
use super::super::density::Column;
use super::super::factors::{Cells, FactorKey, Factors, MAX_DEPTH};
use super::super::regularize::Cone;
use super::super::strategies::{Merge, MergeRule, StrategySet};
use super::{FullPath, every};
use crate::light::LightId;
use crate::math::hash::{random_bits, unit_f64};
use crate::scene::settings::{Heuristic, SingleRule};
use crate::spectrum::MAX_LANES;
use glam::DVec2;
use std::collections::BTreeSet;

pub(super) struct Random {
    pub key: u64,
    pub counter: u64,
}

impl Random {
    pub fn next(&mut self) -> f64 {
        self.counter += 1;
        unit_f64(random_bits(self.key, self.counter))
    }

    /// A number of its own, which moves no other.
    pub fn at(&self, i: u64) -> f64 {
        unit_f64(random_bits(!self.key, 4 * self.counter + i))
    }

    /// Between 1e-3 and 1e3, log-uniform.
    pub fn density(&mut self) -> f64 {
        10.0_f64.powf(self.next() * 6.0 - 3.0)
    }
}

pub(super) fn random_path(random: &mut Random, n: usize, columns: bool, zeros: f64) -> FullPath {
    let mut column = |rough: bool| {
        let hero = if random.next() < zeros {
            0.0
        } else {
            random.density()
        };
        let mut lanes = [hero; MAX_LANES];
        if rough && columns {
            for lane in &mut lanes[1..] {
                *lane = if random.next() < 0.1 {
                    0.0
                } else {
                    hero * (0.5 + random.next())
                };
            }
        }
        lanes
    };
    let mut pf: Vec<Column> = (0..n).map(|i| column(i >= 1)).collect();
    let mut pr: Vec<Column> = (0..n).map(|i| column(i + 1 < n)).collect();
    // the plain density of x₀ is lane independent by construction
    pf[0] = [pf[0][0]; MAX_LANES];
    let interior = |i: usize| i > 0 && i + 1 < n;
    let specular: Vec<bool> = (0..n).map(|i| interior(i) && random.next() < 0.4).collect();
    let dispersive = specular.iter().map(|&s| s && random.next() < 0.3).collect();
    let direct = if random.next() < 0.1 {
        0.0
    } else {
        random.density()
    };
    let lengths = (0..n).map(|_| random.density() as f32).collect();
    let hittable_light = random.next() < 0.7;
    if !hittable_light {
        pr[0] = [0.0; MAX_LANES];
    }
    FullPath {
        pf,
        pr,
        direct,
        specular,
        dispersive,
        lengths,
        hittable_light,
        bridges: [None; 2],
        made: None,
        emitter: LightId(n as u32 % 3),
        raster: DVec2::new(random.at(0), random.at(1)) * f64::from(CELLS * CELL),
    }
}

pub(super) fn random_disabled(random: &mut Random, n: usize) -> BTreeSet<(u32, u32)> {
    let all = (0..=n).map(|s| (s as u32, (n - s) as u32));
    all.filter(|_| random.next() < 0.15).collect()
}

/// Side of the film in cells and of a cell in pixels.
const CELLS: u32 = 2;
const CELL: u32 = 16;

/// A number from 1 to 100 for a strategy of a path.
pub(super) fn random_factor(emitter: LightId, labels: &[bool], raster: DVec2, s: usize) -> f64 {
    let class = labels
        .iter()
        .fold(1, |bits, &label| 2 * bits + u64::from(label));
    let [x, y] = [raster.x, raster.y].map(|v| (v / f64::from(CELL)) as u64);
    let key = class << 16 | u64::from(emitter.0) << 8 | y << 1 | x;
    1.0 + (99.0 * unit_f64(random_bits(key, s as u64))).floor()
}

/// The same for every class of three lights.
pub(crate) fn random_factors() -> Factors {
    let mut factors = Factors::new(Cells {
        first: [0; 2],
        size: [CELLS * CELL; 2],
        side: CELL,
    });
    let classes = (0..=MAX_DEPTH).flat_map(|d| (0..1_u32 << d).map(move |bits| (d, bits)));
    for (depth, bits) in classes {
        let labels: Vec<bool> = (0..depth).map(|i| bits >> i & 1 == 1).collect();
        let mut class = PathClass::new();
        labels.iter().for_each(|&label| class.push(label));
        for light in (0..3).map(LightId) {
            let values: Vec<f32> = (0..CELLS * CELLS)
                .map(|cell| DVec2::new(f64::from(cell % CELLS), f64::from(cell / CELLS)))
                .flat_map(|corner| {
                    (0..depth as usize + 2).map(move |s| (corner * f64::from(CELL), s))
                })
                .map(|(raster, s)| random_factor(light, &labels, raster, s) as f32)
                .collect();
            let key = FactorKey::new(light, class).unwrap();
            factors.insert(key, &values).unwrap();
        }
    }
    factors
}

/// Any strategies at all, of more kinds than integrators execute.
pub(super) fn random_strategies<'a>(
    random: &mut Random,
    disabled: &'a BTreeSet<(u32, u32)>,
    factors: &'a Factors,
) -> StrategySet<'a> {
    let mut strategies = every(disabled);
    if random.at(2) < 0.5 {
        strategies.factors = Some(factors);
    }
    strategies.splat_samples = 0.01 + random.next();
    strategies.light_paths = 0.01 + 2.0 * random.next();
    strategies.hittable_sensor = random.next() < 0.5;
    for executed in [
        &mut strategies.hits,
        &mut strategies.direct,
        &mut strategies.direct_to_detector,
        &mut strategies.splats,
        &mut strategies.arrivals,
    ] {
        *executed = random.next() < 0.7;
    }
    strategies.pairs = if random.next() < 0.6 {
        0.05 + 0.95 * random.next()
    } else {
        0.0
    };
    if random.next() < 0.3 {
        strategies.heuristic = Heuristic::Power2;
    }
    if random.next() < 0.7 {
        // from 1e-8 to π/2
        let log = random.next();
        strategies.cone = Some(Cone::new(
            1e-8_f64.powf(log) * std::f64::consts::FRAC_PI_2.powf(1.0 - log),
        ));
    }
    if random.next() < 0.5 {
        strategies.merge = Some(Merge {
            samples: random.density(),
            rule: if random.next() < 0.7 {
                MergeRule::Every
            } else {
                MergeRule::FirstFromSensor
            },
            alone: random.next() < 0.5,
        });
    }
    match (random.next() * 8.0) as u32 {
        0 => strategies.single = Some(SingleRule::ShortestEdge),
        1 => strategies.single = Some(SingleRule::Camera),
        2 => strategies.single = Some(SingleRule::Light),
        3 | 4 => strategies.bias_weight = 0.01 + 0.99 * random.next(),
        _ => {}
    }
    strategies
}
