//! The weights by definition: every strategy's density as a plain product, nothing shared, nothing cancelled. Slow; checks `mis.rs`.

use super::density::{Column, Edge, EdgeDensity, NO_COLUMN, PathView, VertexDensity};
use super::mis::{Denominator, denominator, for_each_term, multiplier};
use super::techniques::Techniques;
use crate::bsdf::Label;
use crate::math::hash::{random_bits, unit_f64};
use crate::scene::Settings;
use crate::scene::settings::{Heuristic, IntegratorKind};
use crate::spectrum::{MAX_LANES, SampledWavelengths, WavelengthDistribution};

/// All densities of a finished path, from both sides and for every lane.
struct FullPath {
    pf: Vec<Column>,
    pr: Vec<Column>,
    direct: f64,
    specular: Vec<bool>,
    dispersive: Vec<bool>,
}

struct Random {
    key: u64,
    counter: u64,
}

impl Random {
    fn next(&mut self) -> f64 {
        self.counter += 1;
        unit_f64(random_bits(self.key, self.counter))
    }

    /// Between 1e-3 and 1e3, log-uniform.
    fn density(&mut self) -> f64 {
        10.0_f64.powf(self.next() * 6.0 - 3.0)
    }
}

fn random_path(random: &mut Random, n: usize, columns: bool, zeros: f64) -> FullPath {
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
    let pr: Vec<Column> = (0..n).map(|i| column(i + 1 < n)).collect();
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
    FullPath {
        pf,
        pr,
        direct,
        specular,
        dispersive,
    }
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
        let mut vertex = |own: &Column, other: &Column, i: usize| {
            let mut density = VertexDensity::new(own[0]);
            density.other = other[0];
            density.label = label(i);
            density.dispersive = self.dispersive[i];
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
            .map(|i| vertex(&self.pf[i], &self.pr[i], i))
            .collect();
        let camera: Vec<_> = (s..n)
            .rev()
            .map(|i| vertex(&self.pr[i], &self.pf[i], i))
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
        })
    }
}

fn random_techniques(random: &mut Random, n: usize) -> Techniques {
    let mut settings = Settings {
        pair_probability: 0.05 + 0.95 * random.next(),
        ..Settings::default()
    };
    if random.next() < 0.3 {
        settings.heuristic = Heuristic::Power2;
    }
    for s in 0..=n {
        if random.next() < 0.15 {
            settings.disabled.insert((s as u32, (n - s) as u32));
        }
    }
    settings.integrator = match (random.next() * 4.0) as u32 {
        0 => IntegratorKind::Path,
        1 => IntegratorKind::Light,
        _ => IntegratorKind::Bdpt,
    };
    let mut techniques = Techniques::new(&settings, 0.01 + random.next(), random.next() < 0.5);
    if random.next() < 0.5 {
        techniques.cone_area = Some(10.0_f64.powf(random.next() * -11.0 - 1.0));
    }
    techniques
}

/// `D_j · P̃_s(hero)` by definition: every technique (s', k) that delivers to lane j.
fn denominator_by_definition(
    path: &FullPath,
    view: &PathView,
    techniques: &Techniques,
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
                let term = multiplier(view, techniques, s) * path.density(s, k);
                sum += match techniques.heuristic {
                    Heuristic::Balance => term,
                    Heuristic::Power2 => term * term,
                };
            }
        }
    }
    sum
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
    for _ in 0..rounds {
        let span = (lengths.end() - lengths.start() + 1) as f64;
        let n = lengths.start() + (random.next() * span) as usize;
        let path = random_path(&mut random, n, columns, zeros);
        let techniques = random_techniques(&mut random, n);
        let count = [1, 4, 8][(random.next() * 3.0) as usize];
        let distribution = if random.next() < 0.3 {
            &lines
        } else {
            &continuous
        };
        let wavelengths = distribution.sample(random.next(), count);
        let mut weight_sum = 0.0;
        let mut possible = 0;
        for s in 0..=n {
            path.seen_by(s, |view| {
                let own = multiplier(view, &techniques, s);
                if own == 0.0 || path.density(s, 0) == 0.0 {
                    return;
                }
                possible += 1;
                let mut total = 0.0;
                for_each_term(view, &techniques, |_, term| total += term);
                weight_sum += own / total;
                let all: Denominator = denominator(view, &techniques, &wavelengths);
                for j in 0..count {
                    let base = path.density(s, 0);
                    let base = if techniques.heuristic == Heuristic::Power2 {
                        base * base
                    } else {
                        base
                    };
                    let expected =
                        denominator_by_definition(&path, view, &techniques, &wavelengths, j) / base;
                    let found = all.shared + all.own[j];
                    if expected > 0.0 || found > 0.0 {
                        worst_lane = worst_lane.max((found / expected - 1.0).abs());
                    }
                }
            });
        }
        executed_strategies += possible;
        if possible > 0 && !columns {
            worst_sum = worst_sum.max((weight_sum - 1.0).abs());
        }
    }
    assert!(
        executed_strategies > rounds,
        "only {executed_strategies} strategies could be checked"
    );
    // n products of f64, each with a rounding of 1.1e-16
    assert!(worst_sum < 1e-12, "weights sum to 1 {worst_sum:e}");
    assert!(worst_lane < 1e-12, "denominators differ by {worst_lane:e}");
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
fn a_planted_error_is_seen() {
    // the check itself must be able to fail: here the strategy of largest weight counts 2 % too high
    let mut random = Random { key: 4, counter: 0 };
    let mut path = random_path(&mut random, 5, false, 0.0);
    path.specular.fill(false);
    let techniques = Techniques::new(&Settings::default(), 1.0, true);
    let weight_sum = |planted: Option<usize>| {
        let mut sum = 0.0;
        for s in 0..=5 {
            path.seen_by(s, |view| {
                let mut total = 0.0;
                for_each_term(view, &techniques, |i, term| {
                    total += if Some(i) == planted {
                        1.02 * term
                    } else {
                        term
                    };
                });
                sum += multiplier(view, &techniques, s) / total;
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
