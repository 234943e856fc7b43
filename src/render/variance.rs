//! Variance factors of a render: which strategies of the pixel's own scatter less than their second
//! moments say.
//!
//! A pilot renders a lattice of pixels in [`GROUPS`] independent groups of consecutive passes, by
//! the strategies of the pixel's own that take camera sub-paths alone; those that take light
//! sub-paths count in the weights and are not made. Of each strategy and key of paths it knows the
//! second moment of a pass and the variance of a group's mean, which sees that passes are
//! stratified. [theory (2.8), (2.10)]
//!
//! Invariant: a function of scene, sensor, crop and settings without the seed and of a number of
//! passes, counted and never timed, whatever the threads, so that all parts of a render agree.

use super::choices::Written;
use crate::film::Crop;
use crate::integrator::{LightWalks, SensorJob, Workspace, sample_pixel};
use crate::light::LightId;
use crate::math::hash::combine;
use crate::scene::Settings;
use crate::scene::settings::Heuristic;
use crate::spectrum::SensorResponse;
use crate::transport::class::PathClass;
use crate::transport::factors::{Cells, FactorKey, Factors};
use crate::transport::{Cone, PassSettings, Target};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// Factor of direct light on what a camera sees directly, where nothing is measured.
const DIRECT: f32 = 16.0;
/// Independent groups of passes. With two, rare bright samples are missed and noisy strategies come
/// out too quiet.
const GROUPS: usize = 4;
/// Pixels of the lattice along a side of a cell.
const LATTICE: u32 = 4;
/// Side of a cell in pixels, doubled until there are at most so many of them.
const SIDE: u32 = 16;
const MOST_CELLS: usize = 4096;
/// Largest factor.
const MOST: f64 = 1024.0;
/// So many non-zero samples behind a factor halve its distance to the rule's.
const PRIOR_SAMPLES: f64 = 32.0;
/// Growth of a factor from a group of four passes to a render of sixteen, at most.
const MOST_GROWTH: f64 = 4.0;
/// Share of the standard deviation that a pass leaves in a pixel, below which contributions meet
/// roulette before their shadow ray.
const ROULETTE_SHARE: f64 = 0.05;
/// Numbers that are kept, at most.
const MOST_VALUES: usize = 1 << 21;
/// Length of the pilots of a render of at least so many samples per pixel.
const PASSES: [(u32, u32); 3] = [(64, 64), (16, 4), (4, 1)];
/// Passes of a group of the pilot of variance factors, at most: it takes a sixteenth of the pixels
/// in [`GROUPS`] times as many, without light sub-paths, which is at most 3 % of the render.
const MOST_PASSES: u32 = 4;

/// Length of the pilots of a render: passes of a group in that of variance factors, up to 4;
/// beyond, only that of tries is longer. 0: there are none, the factors are those of the rule.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PilotPasses(pub u32);

impl PilotPasses {
    /// This length, if it is one that renders have.
    #[must_use]
    pub fn known(passes: u32) -> Option<Self> {
        let lengths = PASSES.iter().map(|(_, passes)| *passes).chain([0]);
        lengths.into_iter().find(|&p| p == passes).map(Self)
    }

    /// Samples per pixel of the shortest render with a pilot of this length.
    #[must_use]
    pub fn least_samples(self) -> u32 {
        let found = PASSES.iter().find(|(_, passes)| *passes == self.0);
        found.map_or(1, |(least, _)| *least)
    }

    /// That of the pilot of variance factors.
    #[must_use]
    pub fn of_factors(self) -> Self {
        Self(self.0.min(MOST_PASSES))
    }

    /// Whether the render is long enough for a pilot of variance factors of full length.
    #[must_use]
    pub fn is_full(self) -> bool {
        self.of_factors().0 == MOST_PASSES
    }

    /// For a render of so many samples per pixel.
    #[must_use]
    pub fn of(spp: u32) -> Self {
        let found = PASSES.iter().find(|(least, _)| spp >= *least);
        Self(found.map_or(0, |(_, passes)| *passes))
    }
}

/// Factors that the weights of a render count besides densities, and how they were found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct VarianceFactors {
    /// The factors.
    pub factors: Factors,
    /// Length of the pilot.
    pub passes: PilotPasses,
    /// Samples that it took.
    pub samples: u64,
    /// Kinds of paths with a factor: light, labels, and its largest factor.
    pub found: Vec<(FactorKey, f32)>,
}

impl fmt::Display for VarianceFactors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            passes: PilotPasses(passes),
            samples,
            found,
            ..
        } = self;
        let most = found.iter().map(|f| f.1).fold(1.0, f32::max);
        if *passes == 0 {
            return write!(f, "by rule, direct light on what is seen directly {most}");
        }
        write!(
            f,
            "from {samples} samples ({GROUPS} x {passes} passes): {} kinds of paths, up to {most}",
            found.len()
        )
    }
}

/// Whether the weights of a render have variance factors: not where its strategies are all of one
/// kind, and not where photons are merged. [theory (2.7)]
pub(super) fn has_factors(frame: &SensorJob) -> bool {
    let strategies = &frame.strategies;
    frame.settings.heuristic == Heuristic::VarianceAware
        && strategies.merge.is_none()
        && strategies.splats
        && strategies.direct
}

/// The factors of a render, by a pilot of this length or by rule; `None` where its weights have
/// none.
#[must_use]
pub fn choose(
    frame: &SensorJob,
    crop: Crop,
    cone: Option<Cone>,
    response: SensorResponse,
    passes: PilotPasses,
) -> Option<VarianceFactors> {
    if !has_factors(frame) {
        return None;
    }
    let passes = passes.of_factors();
    if passes.0 == 0 {
        return Some(by_rule(frame, crop));
    }
    let cells = cells(crop);
    let settings: Vec<Settings> = (0..GROUPS as u64)
        .map(|group| Settings {
            seed: combine(u64::from(u32::MAX), group),
            ..frame.settings.clone()
        })
        .collect();
    let groups = settings.iter().map(|settings| {
        let mut job = SensorJob::new(frame.scene, frame.sensor, settings, &crop, false);
        job.strategies.tries = frame.strategies.tries;
        job.detailed = true;
        job.light_walks = LightWalks::Never;
        job
    });
    let pilot = Pilot {
        groups: groups.collect(),
        is_image: !frame.strategies.hittable_sensor,
        cells,
        crop,
        cone,
        response,
        passes: passes.0,
    };
    Some(pilot.run())
}

/// Factors by rule: what an image camera sees directly and lights reach directly (LDE) is made by
/// next-event estimation and by hits, which scatter little; splats of it are grain. A detector sees
/// nothing directly.
fn by_rule(frame: &SensorJob, crop: Crop) -> VarianceFactors {
    let mut factors = Factors::new(Cells {
        side: crop.width().max(crop.height()),
        ..cells(crop)
    });
    let mut found = Vec::new();
    if !frame.strategies.hittable_sensor {
        for light in 0..frame.scene.lights.len() {
            if let Some(key) = FactorKey::new(LightId(light as u32), direct_class()) {
                // s = 0 and 1 are the pixel's own, 2 is a splat
                factors
                    .insert(key, &[DIRECT, DIRECT, 1.0])
                    .expect("invariant: one cell, three strategies");
                found.push((key, DIRECT));
            }
        }
    }
    VarianceFactors {
        factors,
        passes: PilotPasses(0),
        samples: 0,
        found,
    }
}

/// LDE.
fn direct_class() -> PathClass {
    let mut class = PathClass::new();
    class.push(false);
    class
}

pub(super) fn cells(crop: Crop) -> Cells {
    let mut cells = Cells {
        first: [crop.x0, crop.y0],
        size: [crop.width(), crop.height()],
        side: SIDE,
    };
    while cells.count() > MOST_CELLS {
        cells.side *= 2;
    }
    cells
}

/// A strategy of a kind of paths.
type Strategy = (FactorKey, u32);

/// One strategy in one pixel.
struct PixelSums {
    strategy: Strategy,
    /// Of the pass.
    value: f64,
    groups: [f64; GROUPS],
    squares: f64,
    hits: u32,
}

/// One strategy in one cell: sums over its pixels.
#[derive(Clone, Copy, Debug, Default)]
struct CellSums {
    /// Second moment of a pass over the passes of a group.
    moment: f64,
    /// Variance of the mean of a group.
    variance: f64,
    /// The same had its passes been independent.
    unstratified: f64,
    /// Passes in which it gave anything.
    hits: f64,
}

impl CellSums {
    fn add(&mut self, other: &Self, weight: f64) {
        self.moment += weight * other.moment;
        self.variance += weight * other.variance;
        self.unstratified += weight * other.unstratified;
        self.hits += weight * other.hits;
    }

    /// v as a power of two, for four times the passes of a group: shrunk to `prior` where few
    /// samples stand behind it, and never more than there are.
    fn factor(&self, prior: f64) -> f32 {
        let most = MOST.min(self.hits).max(prior);
        // stratified passes scatter ever less than independent ones
        let growth = if self.unstratified < MOST_GROWTH * self.variance {
            (self.unstratified / self.variance).max(1.0)
        } else {
            MOST_GROWTH
        };
        let found = if self.moment * growth < most * self.variance {
            growth * self.moment / self.variance
        } else {
            most
        };
        let shrunk = (self.hits * found + PRIOR_SAMPLES * prior) / (self.hits + PRIOR_SAMPLES);
        2.0_f64.powi(shrunk.max(1.0).log2().round() as i32) as f32
    }
}

/// Results of one cell.
#[derive(Debug, Default)]
struct CellFound {
    samples: u64,
    sums: BTreeMap<Strategy, CellSums>,
    /// Variance that a pass leaves in a pixel, of all that is its own; mean over the pixels.
    noise: f64,
}

/// Unbiased variance of independent values.
fn variance(values: &[f64; GROUPS]) -> f64 {
    let mean = values.iter().sum::<f64>() / GROUPS as f64;
    let scatter: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    scatter / (GROUPS - 1) as f64
}

struct Pilot<'a> {
    groups: Vec<SensorJob<'a>>,
    /// The sensor is no detector.
    is_image: bool,
    cells: Cells,
    crop: Crop,
    cone: Option<Cone>,
    response: SensorResponse,
    passes: u32,
}

impl Pilot<'_> {
    fn run(&self) -> VarianceFactors {
        // cell by cell, and within each in order, so that sums do not depend on threads
        let cells: Vec<CellFound> = (0..self.cells.count())
            .into_par_iter()
            .map_init(Workspace::default, |workspace, cell| {
                self.cell(cell, workspace)
            })
            .collect();
        let samples = cells.iter().map(|c| c.samples).sum();
        let thresholds = cells
            .iter()
            .map(|c| (ROULETTE_SHARE * c.noise.sqrt()) as f32);
        let thresholds: Vec<f32> = thresholds.collect();
        // by key, cell and strategy
        let mut kinds: BTreeMap<FactorKey, BTreeMap<(usize, u32), CellSums>> = BTreeMap::new();
        for (cell, found) in cells.into_iter().enumerate() {
            for ((key, s), sums) in found.sums {
                kinds.entry(key).or_default().insert((cell, s), sums);
            }
        }
        let hits = |kind: &BTreeMap<(usize, u32), CellSums>| -> f64 {
            kind.values().map(|sums| sums.hits).sum()
        };
        let mut order: Vec<(f64, FactorKey)> =
            kinds.iter().map(|(key, k)| (hits(k), *key)).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut factors = Factors::new(self.cells);
        factors
            .bound_roulette(thresholds)
            .expect("invariant: thresholds of all cells");
        let mut found = Vec::new();
        let mut left = MOST_VALUES;
        for (_, key) in order {
            let values = self.factors(&kinds[&key], key);
            let most = values.iter().copied().fold(1.0, f32::max);
            if most > 1.0 && values.len() <= left {
                left -= values.len();
                factors
                    .insert(key, &values)
                    .expect("invariant: factors of all cells and strategies");
                found.push((key, most));
            }
        }
        VarianceFactors {
            factors,
            passes: PilotPasses(self.passes),
            samples,
            found,
        }
    }

    /// Factors of one kind of paths: sums of neighboring cells count a half along each axis.
    fn factors(&self, kind: &BTreeMap<(usize, u32), CellSums>, key: FactorKey) -> Vec<f32> {
        let (columns, rows) = (self.cells.columns() as i64, self.cells.rows() as i64);
        let mut out = Vec::with_capacity(self.cells.count() * key.strategies());
        let by_rule = self.is_image && key.class() == direct_class();
        for (row, column) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
            for s in 0..key.strategies() as u32 {
                let mut sums = CellSums::default();
                for (dy, dx) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dy, dx))) {
                    let (y, x) = (row + dy, column + dx);
                    if (0..rows).contains(&y) && (0..columns).contains(&x) {
                        let cell = (y * columns + x) as usize;
                        if let Some(near) = kind.get(&(cell, s)) {
                            sums.add(near, 0.5_f64.powi(i32::from(dy != 0) + i32::from(dx != 0)));
                        }
                    }
                }
                let prior = if by_rule && s < 2 {
                    f64::from(DIRECT)
                } else {
                    1.0
                };
                out.push(sums.factor(prior));
            }
        }
        out
    }

    /// Pixels of the lattice in a cell: one of each square, at a place of its own.
    fn pixels(&self, cell: usize) -> impl Iterator<Item = (u32, u32)> {
        let (columns, crop) = (self.cells.columns(), self.crop);
        let step = self.cells.side / LATTICE;
        let corner = |first: u32, i: usize| first + i as u32 * self.cells.side;
        let (x0, y0) = (
            corner(crop.x0, cell % columns),
            corner(crop.y0, cell / columns),
        );
        (0..LATTICE * LATTICE)
            .map(move |i| {
                let bits = combine(cell as u64, u64::from(i)) as u32;
                let (dx, dy) = (bits % step, (bits >> 16) % step);
                (x0 + i % LATTICE * step + dx, y0 + i / LATTICE * step + dy)
            })
            .filter(move |&(x, y)| crop.contains(x, y))
    }

    fn cell(&self, cell: usize, workspace: &mut Workspace) -> CellFound {
        let mut out = CellFound::default();
        let mut sums: Vec<PixelSums> = Vec::new();
        let mut pixels = 0.0;
        for pixel in self.pixels(cell) {
            pixels += 1.0;
            sums.clear();
            let mut all = [0.0; GROUPS];
            for (group, job) in self.groups.iter().enumerate() {
                for index in 0..self.passes {
                    let pass = PassSettings {
                        index,
                        cone: self.cone,
                        ..PassSettings::default()
                    };
                    out.samples += 1;
                    let response = sample_pixel(job, &pass, pixel, self.response, workspace);
                    for made in &workspace.contributions {
                        if made.target != Target::OwnPixel && !made.beside {
                            continue;
                        }
                        let value = response.brightness(&made.lanes);
                        all[group] += value;
                        let Some(key) = FactorKey::new(made.emitter, made.class) else {
                            continue;
                        };
                        let strategy = (key, made.s);
                        match sums.iter_mut().find(|sum| sum.strategy == strategy) {
                            Some(sum) => sum.value += value,
                            None => sums.push(PixelSums {
                                strategy,
                                value,
                                groups: [0.0; GROUPS],
                                squares: 0.0,
                                hits: 0,
                            }),
                        }
                    }
                    for sum in sums.iter_mut().filter(|sum| sum.value > 0.0) {
                        sum.groups[group] += sum.value;
                        sum.squares += sum.value * sum.value;
                        sum.hits += 1;
                        sum.value = 0.0;
                    }
                }
            }
            for sum in &sums {
                let in_cell = out.sums.entry(sum.strategy).or_default();
                in_cell.add(&self.of_pixel(sum), 1.0);
            }
            // of the mean of a group, times its passes: of one pass
            out.noise += variance(&all) / f64::from(self.passes);
        }
        out.noise /= pixels;
        out
    }

    fn of_pixel(&self, sum: &PixelSums) -> CellSums {
        let passes = f64::from(self.passes);
        let all = GROUPS as f64 * passes;
        let mean = sum.groups.iter().sum::<f64>() / all;
        let of_pass = (sum.squares / all - mean * mean) * all / (all - 1.0);
        CellSums {
            moment: sum.squares / (all * passes),
            variance: variance(&sum.groups) / (passes * passes),
            unstratified: of_pass.max(0.0) / passes,
            hits: f64::from(sum.hits),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    #[test]
    fn short_renders_have_a_short_pilot() {
        let of = |spp| PilotPasses::of(spp).0;
        let lengths = [0, 0, 1, 1, 4, 4, 64, 64];
        assert_eq!([1, 3, 4, 15, 16, 63, 64, 4096].map(of), lengths);
        let within = |length| PilotPasses(length).of_factors().0;
        assert_eq!([0, 1, 4, 64].map(within), [0, 1, 4, 4]);
        assert_eq!(PilotPasses::known(4), Some(PilotPasses(4)));
        assert_eq!(PilotPasses::known(3), None);
    }

    #[test]
    fn factors_are_shrunk_and_capped() {
        let factor = |moment, variance, hits| {
            let sums = CellSums {
                moment,
                variance,
                unstratified: variance,
                hits,
            };
            [sums.factor(1.0), sums.factor(16.0)]
        };
        // without a sample, the rule's
        assert_eq!(factor(0.0, 0.0, 0.0), [1.0, 16.0]);
        // (64 · 16 + 32) / 96 is 11, of which the nearest power of two is 8
        assert_eq!(factor(16.0, 1.0, 64.0), [8.0, 16.0]);
        assert_eq!(factor(16.0, 1.0, 1e6), [16.0; 2]);
        assert_eq!(factor(1.0, 16.0, 1e6), [1.0; 2]);
        // no more than samples, no more than the cap, however quiet
        assert_eq!(factor(1.0, 0.0, 2.0), [1.0, 16.0]);
        assert_eq!(factor(1.0, 0.0, 1e6), [1024.0; 2]);
    }

    #[test]
    fn stratified_passes_scatter_less_in_a_longer_render() {
        let factor = |unstratified| {
            let sums = CellSums {
                moment: 16.0,
                variance: 1.0,
                unstratified,
                hits: 1e6,
            };
            sums.factor(1.0)
        };
        assert_eq!(
            [0.5, 1.0, 2.0, 4.0, 16.0].map(factor),
            [16.0, 16.0, 32.0, 64.0, 64.0]
        );
    }

    #[test]
    fn large_films_have_large_cells() {
        let crop = |x1, y1| Crop {
            x0: 0,
            y0: 0,
            x1,
            y1,
        };
        assert_eq!(cells(crop(200, 150)).side, 16);
        assert_eq!(cells(crop(4096, 4096)).side, 64);
        let side = cells(crop(1, 1));
        assert_eq!(side.at(DVec2::new(0.5, 0.5)), 0);
    }
}
