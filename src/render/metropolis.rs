//! Metropolis sampling over whole bidirectional samples (Kelemen et al. 2002), pass by pass.
//!
//! A pass takes an ordinary sample of every pixel, whose brightness is I(u) for the numbers u it
//! was made of. From some of these samples, chosen in proportion to I, Markov chains set out whose
//! states have the density I/b, b the mean of I. A state drawn so and weighted by the mean b̂ of
//! *these* samples stands for the whole image without bias, and so does every later state of its
//! chain (Veach and Guibas 1997): there is no burn-in to wait for and no brightness to be known
//! better later. Passes are therefore independent of each other, unbiased one by one, and add up
//! in films and parts as those of any other integrator do, whatever their cones.
//!
//! Ordinary samples and states are weighted together by the balance heuristic: one sample of
//! density 1 and r states of density I/b₀ per pixel, where the constant b₀ is of a pilot
//! ([`Choices`](super::Choices)), times 10 because states of a chain are alike, and no result
//! depends on it in the mean.
//!
//! A chain is a pure function of scene, settings, seed, pass and its index.

use super::pass::{Local, PassCounts, Watch, add_sample};
use super::pilot::{PASS, SAMPLES, lattice};
use super::share::share;
use super::{ClassTable, Outputs, Tiles};
use crate::film::{Crop, Film};
use crate::integrator::{SensorJob, Workspace, sample_pixel, sample_primary};
use crate::math::hash::{combine, random_bits, unit_f64};
use crate::sampler::Primary;
use crate::scene::settings::Metropolis;
use crate::spectrum::{LaneResponse, SensorResponse};
use crate::transport::subpath::Event;
use crate::transport::{Cone, Contribution, PassSettings, Target};
use std::mem;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Probability of a large step (Kelemen et al.).
const LARGE: f64 = 0.3;
/// States of a chain that weigh as much as one independent sample: they are alike. (Measured on the
/// torus in its glass cube between 1/3 and 100.)
const ALIKE: f64 = 10.0;
/// Least number of chains of a pass.
const LEAST_CHAINS: u64 = 8;
/// Chains whose spread tells the error: four passes have them.
pub(super) const LEAST_CHAINS_FOR_ERROR: u64 = 32;
/// Part of the key of a chain that no key of a pixel has.
const CHAIN: u64 = 0x4348_4149;

/// Number of chains of a pass over so many pixels.
#[must_use]
pub fn chains(settings: &Metropolis, pixels: u64) -> u64 {
    let states = pixels as f64 * (1.0 / settings.uniform - 1.0);
    let chains = (states / f64::from(settings.mutations)).round() as u64;
    chains.max(LEAST_CHAINS)
}

/// Brightness of a sample: what it adds to all pixels, as a single number.
fn brightness(
    contributions: &[Contribution],
    response: &LaneResponse,
    sensor: SensorResponse,
    image: &Film,
) -> f64 {
    let of = |contribution: &Contribution| {
        let share = match contribution.target {
            Target::OwnPixel => 1.0,
            Target::Splat(raster) => image.coverage(raster),
        };
        share * sensor.importance(response, &contribution.lanes)
    };
    let sum: f64 = contributions.iter().map(of).sum();
    if sum.is_finite() { sum } else { 0.0 }
}

/// Mean brightness of a sample, roughly, and above 0: from it the constant b₀ of the weights.
#[must_use]
pub(super) fn mean_brightness(
    frame: &SensorJob,
    crop: Crop,
    cone: Option<Cone>,
    sensor: SensorResponse,
) -> f64 {
    let pass = PassSettings {
        index: PASS,
        cone,
        ..PassSettings::default()
    };
    let image = Film::new(crop, frame.scene.sensors[frame.sensor].filter, 0);
    let mut workspace = Workspace::default();
    let sum: f64 = lattice(&crop)
        .map(|pixel| {
            let response = sample_pixel(frame, &pass, pixel, sensor, &mut workspace);
            brightness(&workspace.contributions, &response, sensor, &image)
        })
        .sum();
    let mean = sum / f64::from(SAMPLES);
    if mean > 0.0 {
        mean
    } else {
        f64::from(frame.scene.film_exponent).exp2()
    }
}

/// Tries one step of a chain at a point of brightness `now`: a large one or a small one, by `key`.
/// `evaluate` gives the brightness where it leads, and what else is to be kept of that, `rule` the
/// probability of going there.
fn mutate<T>(
    point: &mut Primary,
    key: u64,
    now: f64,
    rule: fn(f64, f64) -> f64,
    evaluate: impl FnOnce(&Primary) -> (f64, T),
) -> (Step, T) {
    let number = |i| unit_f64(random_bits(key, i));
    let is_large = number(0) < LARGE;
    let of_step = combine(key, 1);
    if is_large {
        point.try_large(of_step);
    } else {
        point.try_small(of_step);
    }
    let (brightness, there) = evaluate(point);
    let acceptance = rule(now, brightness);
    let is_accepted = number(1) < acceptance;
    if is_accepted {
        point.accept();
    } else {
        point.reject();
    }
    let step = Step {
        acceptance,
        is_large,
        is_accepted,
    };
    (step, there)
}

/// One step of a chain.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// Probability of going to where it leads.
    acceptance: f64,
    is_large: bool,
    is_accepted: bool,
}

/// Probability of going from a point of one brightness, above 0, to one of another, as it keeps a
/// density in proportion to brightness (Metropolis et al. 1953): steps there and back are equally
/// likely.
fn acceptance(now: f64, there: f64) -> f64 {
    (there / now).min(1.0)
}

/// Samples at which chains start, by index and ascending: each in proportion to its brightness, as
/// evenly as whole numbers allow (systematic sampling; `u` in [0, 1)).
fn starts(brightness: &[f64], chains: u64, u: f64) -> Vec<usize> {
    let total: f64 = brightness.iter().sum();
    let mut found = Vec::new();
    let mut passed = 0.0;
    for (i, value) in brightness.iter().enumerate() {
        passed += value;
        // never at the dark ones that end the list
        while (found.len() as u64) < chains
            && (found.len() as f64 + u) * total < passed * chains as f64
        {
            found.push(i);
        }
    }
    found
}

/// A pass: what its samples and chains share.
struct Pass<'a> {
    frame: &'a SensorJob<'a>,
    settings: &'a PassSettings,
    outputs: &'a Outputs,
    /// b₀.
    constant: f64,
    /// r, states of chains per pixel.
    states: f64,
}

/// Adds a pass to a film. Whether it is whole then: not where it was cancelled, and what the film
/// has got of it is of no use then.
pub(super) fn render_pass(
    frame: &SensorJob,
    settings: &PassSettings,
    constant: f64,
    outputs: &Outputs,
    watch: &Watch,
    counts: &mut PassCounts,
) -> bool {
    let crop = outputs.image.crop();
    let (chosen, pixels) = (&frame.settings.metropolis, crop.pixels());
    let chains = chains(chosen, pixels);
    let pass = Pass {
        frame,
        settings,
        outputs,
        constant: ALIKE * constant,
        states: chains as f64 * f64::from(chosen.mutations) / pixels as f64,
    };
    let (all, done) = (u64::from(crop.height()) + chains, AtomicU64::new(0));
    let tell = || {
        let done = done.fetch_add(1, Relaxed) + 1;
        if let Some(observer) = watch.observer {
            let pass = settings.index;
            observer(Tiles { pass, done, all });
        }
    };
    let mut brightness = vec![0.0; pixels as usize];
    let width = crop.width() as usize;
    let pixel_of = |i: usize| (crop.x0 + (i % width) as u32, crop.y0 + (i / width) as u32);
    let add_row = |buffers: &mut Buffers, (row, values): (usize, &mut [f64])| {
        for (x, value) in values.iter_mut().enumerate() {
            if watch.is_cancelled() {
                return;
            }
            *value = pass.add_ordinary(pixel_of(row * width + x), buffers);
        }
        tell();
    };
    let rows = brightness.chunks_mut(width).enumerate();
    let all_buffers = share(rows, Buffers::default, add_row);
    all_buffers.into_iter().for_each(|b| counts.add(b.local));
    let key = pass.key();
    let starts = starts(&brightness, chains, unit_f64(random_bits(key, 0)));
    let mean = brightness.iter().sum::<f64>() / pixels as f64;
    let run = |buffers: &mut Buffers, (chain, start): (usize, &usize)| {
        let key = combine(key, 1 + chain as u64);
        if pass.run_chain(key, pixel_of(*start), mean, watch, buffers) {
            tell();
        }
    };
    let all_buffers = share(starts.iter().enumerate(), Buffers::default, run);
    all_buffers.into_iter().for_each(|b| counts.add(b.local));
    !watch.is_cancelled()
}

/// A sample that was taken, with its buffers.
struct Sample {
    contributions: Vec<Contribution>,
    events: Vec<Event>,
    response: LaneResponse,
    pixel: (u32, u32),
    brightness: f64,
}

/// Buffers of one thread.
#[derive(Default)]
struct Buffers {
    local: Local,
    spare: Vec<(Vec<Contribution>, Vec<Event>)>,
}

impl Pass<'_> {
    /// The key of all chains.
    fn key(&self) -> u64 {
        let Self {
            frame, settings, ..
        } = self;
        let sensor = combine(frame.settings.seed, frame.sensor as u64);
        combine(combine(sensor, CHAIN), settings.index.into())
    }

    /// The sample in the workspace, whose place is taken by spare buffers.
    fn taken(&self, response: LaneResponse, pixel: (u32, u32), buffers: &mut Buffers) -> Sample {
        let spare = buffers.spare.pop().unwrap_or_default();
        let (contributions, events) = buffers.local.workspace.exchange(spare);
        let (sensor, image) = (self.outputs.response, &self.outputs.image);
        Sample {
            brightness: brightness(&contributions, &response, sensor, image),
            contributions,
            events,
            response,
            pixel,
        }
    }

    /// Adds a sample that counts as `count` of those that were drawn with the density brightness /
    /// `mean`. With b₀ in place of the mean it is one that was drawn evenly.
    fn add(&self, sample: Sample, mean: f64, count: f64, buffers: &mut Buffers) {
        let Sample {
            mut contributions,
            events,
            response,
            pixel,
            brightness,
        } = sample;
        let factor = count * mean / (self.constant + self.states * brightness);
        for contribution in &mut contributions {
            let Contribution { lanes, raw, .. } = contribution;
            lanes.iter_mut().chain(raw).for_each(|v| *v *= factor);
        }
        let half = (self.settings.index & 1) as usize;
        let Local { values, tables, .. } = &mut buffers.local;
        tables.resize_with(1, ClassTable::default);
        let table = self.frame.with_raw.then_some(&mut tables[0]);
        add_sample(&contributions, &response, self.outputs, pixel, half, table);
        let paths = (&contributions[..], &events[..]);
        self.outputs
            .add_extras(paths, &response, pixel, half, values);
        buffers.spare.push((contributions, events));
    }

    /// Adds the ordinary sample of a pixel. Its brightness.
    fn add_ordinary(&self, pixel: (u32, u32), buffers: &mut Buffers) -> f64 {
        let (sensor, workspace) = (self.outputs.response, &mut buffers.local.workspace);
        let response = sample_pixel(self.frame, self.settings, pixel, sensor, workspace);
        let sample = self.taken(response, pixel, buffers);
        let brightness = sample.brightness;
        self.add(sample, self.constant, 1.0, buffers);
        brightness
    }

    fn primary_sample(&self, point: &Primary, buffers: &mut Buffers) -> Sample {
        let (sensor, workspace) = (self.outputs.response, &mut buffers.local.workspace);
        let response = sample_primary(self.frame, self.settings, point, sensor, workspace);
        self.taken(response, point.pixel(), buffers)
    }

    /// Adds the states of a chain that starts from the sample of a pixel, `mean` the mean of those
    /// that it was chosen from. Whether it was not cancelled.
    fn run_chain(
        &self,
        key: u64,
        start: (u32, u32),
        mean: f64,
        watch: &Watch,
        buffers: &mut Buffers,
    ) -> bool {
        let crop = self.outputs.image.crop();
        let mut point = self.frame.primary(self.settings, start, &crop);
        let mut state = self.primary_sample(&point, buffers);
        let mut count = 0.0;
        for i in 0..self.frame.settings.metropolis.mutations {
            if watch.is_cancelled() {
                return false;
            }
            let key = combine(key, i.into());
            let now = state.brightness;
            let (step, tried) = mutate(&mut point, key, now, acceptance, |point| {
                let sample = self.primary_sample(point, buffers);
                (sample.brightness, sample)
            });
            let counts = &mut buffers.local.workspace.counters.steps;
            counts[usize::from(step.is_large)].count(step.is_accepted);
            // both count as often as they are expected to be the next state
            count += 1.0 - step.acceptance;
            if step.is_accepted {
                let left = mem::replace(&mut state, tried);
                self.add(left, mean, count, buffers);
                count = step.acceptance;
            } else if step.acceptance > 0.0 {
                self.add(tried, mean, step.acceptance, buffers);
            } else {
                buffers.spare.push((tried.contributions, tried.events));
            }
        }
        self.add(state, mean, count, buffers);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::stats::chi_square_test;
    use crate::sampler::{Draw, Pixels, Sampler};

    const CELLS: usize = 8;
    const PIXELS: Pixels = Pixels {
        first: [0, 0],
        size: [1, 1],
    };

    /// A brightness over the unit square: dark in a third of it, and with a narrow bright streak.
    fn brightness_at([x, y]: [f64; 2]) -> f64 {
        let streak = if (0.41..0.43).contains(&x) { 40.0 } else { 0.0 };
        if y < 1.0 / 3.0 {
            0.0
        } else {
            0.2 + y + streak * y * y
        }
    }

    fn at(point: &Primary) -> [f64; 2] {
        let [x, y, ..] = point.sampler().set(Draw::LightStart);
        [x, y]
    }

    fn cell([x, y]: [f64; 2]) -> usize {
        (y * CELLS as f64) as usize * CELLS + (x * CELLS as f64) as usize
    }

    /// Shares of brightness by cell, exact to the midpoint rule on a grid that resolves the edges.
    fn shares() -> Vec<f64> {
        let (mut shares, n) = (vec![0.0; CELLS * CELLS], 2400);
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let place = [i, j].map(|k| (f64::from(k) + 0.5) / f64::from(n));
            shares[cell(place)] += brightness_at(place) / f64::from(n * n);
        }
        shares
    }

    fn fresh(i: u64) -> Primary {
        Primary::of_sample(Sampler::new(3, 0, i, 0), (0, 0), 0.5, PIXELS)
    }

    /// Runs a chain by a rule of acceptance.
    fn run(point: &mut Primary, key: u64, steps: u64, rule: fn(f64, f64) -> f64) {
        let mut now = brightness_at(at(point));
        for i in 0..steps {
            let evaluate = |point: &Primary| {
                let there = brightness_at(at(point));
                (there, there)
            };
            let (step, there) = mutate(point, combine(key, i), now, rule, evaluate);
            if step.is_accepted {
                now = there;
            }
        }
    }

    /// p-value of the states of independent chains after so many steps by a rule, having started
    /// in proportion to brightness (by rejection).
    fn p_value(steps: u64, rule: fn(f64, f64) -> f64) -> f64 {
        let mut counts = vec![0.0; CELLS * CELLS];
        let mut chains = 0.0;
        for i in 0..400_000 {
            let mut point = fresh(i);
            let key = combine(5, i);
            if brightness_at(at(&point)) < 41.2 * unit_f64(random_bits(key, 0)) {
                continue;
            }
            run(&mut point, key, steps, rule);
            counts[cell(at(&point))] += 1.0;
            chains += 1.0;
        }
        let shares = shares();
        let all: f64 = shares.iter().sum();
        let expected: Vec<f64> = shares.iter().map(|s| s / all * chains).collect();
        chi_square_test(&counts, &expected)
    }

    #[test]
    fn states_of_chains_have_the_density_of_brightness() {
        assert!(p_value(0, acceptance) > 1e-4, "the start");
        assert!(p_value(30, acceptance) > 1e-4);
        // planted: what leads to the dark is accepted half too often, or too seldom
        let often = |now: f64, there: f64| (1.5 * there / now).min(1.0);
        assert!(p_value(30, often) < 1e-9);
        let squared = |now: f64, there: f64| (there / now).powi(2).min(1.0);
        assert!(p_value(30, squared) < 1e-9);
    }

    /// Means and standard errors of the brightness of all cells and of each, from passes of 12
    /// samples and 2 chains of 6 steps; `frozen` in place of each pass's own mean brightness.
    fn estimates(passes: u64, frozen: Option<f64>) -> Vec<[f64; 2]> {
        let mut sums = vec![[0.0; 2]; CELLS * CELLS + 1];
        for pass in 0..passes {
            let samples: Vec<f64> = (0..12)
                .map(|i| brightness_at(at(&fresh(12 * pass + i))))
                .collect();
            let mean = samples.iter().sum::<f64>() / 12.0;
            let mut found = vec![0.0; CELLS * CELLS + 1];
            let key = combine(8, pass);
            for start in starts(&samples, 2, unit_f64(random_bits(key, 0))) {
                let mut point = fresh(12 * pass + start as u64);
                run(&mut point, combine(key, start as u64 + 1), 6, acceptance);
                found[1 + cell(at(&point))] += frozen.unwrap_or(mean) / 2.0;
                found[0] += frozen.unwrap_or(mean) / 2.0;
            }
            for (sum, value) in sums.iter_mut().zip(found) {
                sum[0] += value;
                sum[1] += value * value;
            }
        }
        let n = passes as f64;
        sums.iter()
            .map(|[sum, squares]| {
                let mean = sum / n;
                [mean, ((squares / n - mean * mean) / n).sqrt()]
            })
            .collect()
    }

    #[test]
    fn passes_are_unbiased_however_few_samples_they_start_from() {
        let mut expected = shares();
        expected.insert(0, expected.iter().sum());
        let worst = |frozen| {
            let estimates = estimates(60_000, frozen);
            let pairs = estimates.iter().zip(&expected);
            let deviation = |([mean, error], expected): (&[f64; 2], &f64)| {
                if *expected == 0.0 {
                    assert_eq!(*mean, 0.0);
                    return 0.0;
                }
                (mean - expected).abs() / error
            };
            pairs.map(deviation).fold(0.0, f64::max)
        };
        // 65 comparisons beyond 4.5 standard errors: p = 4e-4 in all
        assert!(worst(None) < 4.5);
        // planted: the right brightness for all passes, though each has its own starts
        assert!(worst(Some(expected[0])) > 4.5);
        // planted: that of one pass for all, as if it were known
        assert!(worst(Some(0.8 * expected[0])) > 4.5);
    }

    #[test]
    fn starts_are_as_even_as_whole_numbers_allow() {
        let brightness = [0.0, 1.0, 0.0, 4.0, 2.5, 0.5, 0.0];
        let mut counts = [0.0; 7];
        for i in 0..1000 {
            let found = starts(&brightness, 16, (f64::from(i) + 0.5) / 1000.0);
            assert_eq!(found.len(), 16);
            assert!(found.is_sorted());
            let mut own = [0.0; 7];
            found.iter().for_each(|&k| own[k] += 1.0);
            for (own, b) in own.iter().zip(brightness) {
                assert!((own - 2.0 * b).abs() < 1.0 + 1e-9);
            }
            counts.iter_mut().zip(own).for_each(|(c, o)| *c += o);
        }
        for (count, b) in counts.iter().zip(brightness) {
            assert!((count / 1000.0 - 2.0 * b).abs() < 1e-9);
        }
        assert_eq!(starts(&[0.0, 0.0], 4, 0.5), Vec::<usize>::new());
    }

    #[test]
    fn chains_make_up_what_is_not_uniform() {
        let settings = Metropolis {
            mutations: 100,
            uniform: 0.2,
        };
        assert_eq!(chains(&settings, 10_000), 400);
        assert_eq!(chains(&settings, 1), LEAST_CHAINS);
    }
}
