//! Paths with chains that are solved for: joins and bridges in one sum.

use super::random_factors;
use super::{FullPath, Random, denominator_by_definition, random_path, random_strategies};
use crate::scene::settings::Heuristic;
use crate::spectrum::{SampledWavelengths, WavelengthDistribution};
use crate::transport::aim::tries::Origin;
use crate::transport::density::Bridge;
use crate::transport::mis::{Multipliers, Technique, denominator};
use crate::transport::strategies::StrategySet;
use std::collections::BTreeSet;

impl FullPath {
    /// Gives the chains at the ends of the path a bridge each, now and then.
    fn add_bridges(&mut self, random: &mut Random) {
        let n = self.len();
        let first = (1..n).find(|&i| !self.specular[i]).unwrap_or(n - 1);
        let last = (0..n - 1).rev().find(|&i| !self.specular[i]).unwrap_or(0);
        let mut bridge = |a: usize, b: usize| {
            (b > a + 1 && random.next() < 0.8).then(|| Bridge {
                a,
                b,
                k: random.density(),
                samples: random.density(),
                kind: 0,
                origin: Origin::Start,
            })
        };
        self.bridges = if first == n - 1 {
            [bridge(0, n - 1), None]
        } else {
            [bridge(0, first), bridge(last, n - 1)]
        };
    }

    /// The density of a bridge for lane `k`, by definition: of the chain, K.
    fn bridge_density(&self, bridge: &Bridge, k: usize) -> f64 {
        let light: f64 = (0..=bridge.a).map(|i| self.pf[i][k]).product();
        let sensor: f64 = (bridge.b..self.len()).map(|i| self.pr[i][k]).product();
        light * bridge.k * sensor
    }

    /// Terms of the bridges in lane `j`'s denominator.
    fn bridge_terms(
        &self,
        strategies: &StrategySet,
        wavelengths: &SampledWavelengths,
        j: usize,
    ) -> f64 {
        let mut sum = 0.0;
        for bridge in self.bridges.iter().flatten() {
            let outside = |i: usize| i <= bridge.a || i >= bridge.b;
            let scattered = (0..self.len()).any(|i| self.dispersive[i] && outside(i));
            for k in 0..wavelengths.count() {
                if !scattered || wavelengths.lambda_nm(k) == wavelengths.lambda_nm(j) {
                    let term = bridge.samples * self.bridge_density(bridge, k);
                    sum += strategies.heuristic.power(term);
                }
            }
        }
        sum
    }
}

/// Every technique's denominators and weight against the definition.
fn check(seed: u64, columns: bool, zeros: f64, rounds: usize) {
    let mut random = Random {
        key: seed,
        counter: 0,
    };
    let continuous = WavelengthDistribution::uniform([360.0, 830.0]);
    let lines = WavelengthDistribution::lines(&[450.0, 550.0, 650.0]);
    let (none, factors) = (BTreeSet::new(), random_factors());
    let (mut joins, mut bridged) = (0, 0);
    for round in 0..rounds {
        let n = 3 + (random.next() * 7.0) as usize;
        let mut path = random_path(&mut random, n, columns, zeros);
        path.add_bridges(&mut random);
        let mut strategies = random_strategies(&mut random, &none, &factors);
        strategies.merge = None;
        let count = [1, 4, 8][(random.next() * 3.0) as usize];
        let distribution = if round % 3 == 0 { &lines } else { &continuous };
        let wavelengths = distribution.sample(random.next(), count);
        let techniques = (0..=n).map(Technique::Join).chain(
            path.bridges
                .iter()
                .flatten()
                .map(|b| Technique::Bridge(b.a, b.b)),
        );
        let mut weights = 0.0;
        let mut possible = 0;
        for technique in techniques.collect::<Vec<_>>() {
            let bridges = path.bridges;
            let made = bridges
                .iter()
                .flatten()
                .find(|b| Technique::Bridge(b.a, b.b) == technique);
            path.made = made.copied();
            let (own, base, seen) = match (technique, made) {
                (Technique::Join(s), _) => (path.multiplier(&strategies, s), path.density(s, 0), s),
                (_, Some(bridge)) => (bridge.samples, path.bridge_density(bridge, 0), bridge.b),
                _ => unreachable!(),
            };
            if own == 0.0 || base == 0.0 {
                continue;
            }
            possible += 1;
            if made.is_some() {
                bridged += 1;
            } else {
                joins += 1;
            }
            path.seen_by(seen, |view| {
                let multipliers = Multipliers::new(view, &strategies);
                assert!(
                    (multipliers.of(technique) / own - 1.0).abs() < 1e-12,
                    "{technique:?}"
                );
                let all = denominator(&multipliers, &wavelengths, &mut Vec::new());
                let numerator = match strategies.heuristic {
                    Heuristic::VarianceAware | Heuristic::Balance => {
                        multipliers.preference(technique)
                    }
                    Heuristic::Power2 => multipliers.preference(technique) * own,
                };
                assert!(
                    all.numerator == numerator || (all.numerator / numerator - 1.0).abs() < 1e-14,
                    "{technique:?}"
                );
                for j in 0..count {
                    let expected = denominator_by_definition(&path, &strategies, &wavelengths, j)
                        + path.bridge_terms(&strategies, &wavelengths, j);
                    let expected = expected / strategies.heuristic.power(base);
                    let found = all.shared + all.own[j];
                    assert!(
                        found == expected || (found / expected - 1.0).abs() < 1e-11,
                        "{technique:?} {:?}: {found} {expected}",
                        path.bridges
                    );
                }
                if !columns && count == 1 {
                    weights += strategies.heuristic.power(own) / (all.shared + all.own[0]);
                }
            });
            path.made = None;
        }
        if possible > 0 && !columns && count == 1 {
            assert!((weights - 1.0).abs() < 1e-11, "{weights}");
        }
    }
    assert!(bridged > rounds / 4 && joins > rounds, "{bridged} {joins}");
}

#[test]
fn bridges_weigh_as_they_are_defined() {
    check(6, false, 0.05, 10_000);
}

#[test]
fn bridges_weigh_as_they_are_defined_where_lanes_differ() {
    check(7, true, 0.05, 3_000);
}
