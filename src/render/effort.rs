//! Effort of a render: how many light sub-paths a camera sub-path is worth, and how often pairs of
//! inner vertices are tried.
//!
//! A pilot renders a lattice of pixels under each of a few choices, with the same random numbers,
//! and takes the one whose variance times cost is least; cost is counted at fixed prices. What is
//! the pixel's own scatters by the means of independent groups of consecutive passes, which sees
//! that passes are stratified; splats scatter by their squares, as they are rare. A choice other
//! than the usual one has to win clearly. [theory (2.11)]
//!
//! Invariant: a function of scene, sensor, crop and settings without the seed and of the length of
//! the pilot, counted and never timed, whatever the threads, so that all parts of a render agree.
//! Any choice is unbiased: no light sub-paths at all is none of them.

use super::PilotPasses;
use super::pilot::{Regions, lattice, price};
use crate::film::Crop;
use crate::integrator::{SensorJob, Workspace, sample_pixel};
use crate::math::exact;
use crate::math::hash::combine;
use crate::scene::Settings;
use crate::spectrum::SensorResponse;
use crate::transport::factors::Factors;
use crate::transport::{Cone, Counters, PassSettings, Target};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Choices of light sub-paths per camera sub-path and of the probability of pairs; the first is the
/// usual one.
const CHOICES: [(f64, f64); 6] = [
    (1.0, 0.25),
    (1.0, 1.0),
    (0.0625, 0.25),
    (0.0625, 1.0),
    (2.0, 0.25),
    (2.0, 1.0),
];
/// Product of variance and cost, relative to the usual choice, above which another is not taken.
const CLEAR: f64 = 0.93;
/// Independent groups of passes, and passes of each.
const GROUPS: usize = 4;
const PASSES: u32 = 4;
/// Pixels of the lattice at most, and pixels of the film for one of them: the pilot takes a sixth
/// of a sample per pixel.
const PIXELS: u64 = 512;
const PIXELS_SHARE: u64 = 576;
/// Share of the pixels that is left out, those that scatter most: a few rare paths are no reason.
const TRIMMED: f64 = 0.02;

/// Effort per sample, and how it was found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffortChoice {
    /// Light sub-paths per camera sub-path; a fraction is the probability of one more.
    #[serde(with = "exact")]
    pub light_paths: f64,
    /// Probability with which a pair of inner vertices is tried.
    #[serde(with = "exact")]
    pub pairs: f64,
    /// Samples that the pilot took.
    pub samples: u64,
}

impl fmt::Display for EffortChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            light_paths,
            pairs,
            samples,
        } = self;
        write!(
            f,
            "{light_paths} light sub-paths per pixel, {pairs} of the pairs of inner vertices, as {samples} samples say"
        )
    }
}

/// Whether a render has a choice of effort: it takes light sub-paths beside all others, merges
/// none, and one number at least is to be found.
pub(super) fn has_choice(frame: &SensorJob) -> bool {
    let (strategies, settings) = (&frame.strategies, frame.settings);
    strategies.merge.is_none()
        && strategies.splats
        && strategies.direct
        && (settings.light_paths.is_none() || settings.pair_probability.is_none())
}

/// Finds the effort, with the tries of `frame` and these variance factors; `None` where there is no
/// choice, or the render is too short for a pilot.
#[must_use]
pub fn choose(
    frame: &SensorJob,
    factors: Option<&Factors>,
    crop: Crop,
    cone: Option<Cone>,
    response: SensorResponse,
    length: PilotPasses,
) -> Option<EffortChoice> {
    let count = (crop.pixels() / PIXELS_SHARE).min(PIXELS) as usize;
    if !has_choice(frame) || !length.is_full() || count == 0 {
        return None;
    }
    let settings: Vec<Settings> = (0..GROUPS as u64)
        .map(|group| Settings {
            seed: combine(u64::from(u32::MAX), combine(1 << 32, group)),
            ..frame.settings.clone()
        })
        .collect();
    let pixels: Vec<(u32, u32)> = lattice(&crop).take(count).collect();
    let mut choices: Vec<(f64, f64)> = Vec::new();
    for (light_paths, pairs) in CHOICES {
        // a number that is given stays
        let choice = (
            frame.settings.light_paths.unwrap_or(light_paths),
            frame.settings.pair_probability.unwrap_or(pairs),
        );
        if !choices.contains(&choice) {
            choices.push(choice);
        }
    }
    let mut scale = Vec::new();
    let mut samples = 0;
    let mut products = Vec::new();
    for (light_paths, pairs) in &choices {
        let jobs = settings.iter().map(|settings| {
            let mut job = SensorJob::new(frame.scene, frame.sensor, settings, &crop, false);
            job.strategies.tries = frame.strategies.tries;
            job.strategies.factors = factors;
            job.strategies.pairs = *pairs;
            job.strategies.set_light_paths(*light_paths);
            job
        });
        let pilot = Pilot {
            groups: jobs.collect(),
            crop,
            cone,
            response,
        };
        let found = pilot.run(&pixels);
        if scale.is_empty() {
            scale = pilot.scale(&found);
        }
        samples += found.len() as u64 * GROUPS as u64 * u64::from(PASSES);
        products.push(product(&found, &scale));
    }
    let usual = products[0];
    let best = (1..products.len())
        .filter(|&i| products[i] < CLEAR * usual)
        .min_by(|&a, &b| products[a].total_cmp(&products[b]));
    let (light_paths, pairs) = choices[best.unwrap_or(0)];
    Some(EffortChoice {
        light_paths,
        pairs,
        samples,
    })
}

/// Samples of one pixel.
struct Pixel {
    region: usize,
    /// Means of its own light over each group.
    own: [f64; GROUPS],
    /// Brightness and region of splats.
    splats: Vec<(f64, usize)>,
    counters: Counters,
}

struct Pilot<'a> {
    groups: Vec<SensorJob<'a>>,
    crop: Crop,
    cone: Option<Cone>,
    response: SensorResponse,
}

impl Pilot<'_> {
    fn run(&self, pixels: &[(u32, u32)]) -> Vec<Pixel> {
        let regions = Regions::new(self.crop);
        pixels
            .par_iter()
            .map_init(Workspace::default, |workspace, &pixel| {
                workspace.counters = Counters::default();
                let mut out = Pixel {
                    region: regions.at(f64::from(pixel.0), f64::from(pixel.1)),
                    own: [0.0; GROUPS],
                    splats: Vec::new(),
                    counters: Counters::default(),
                };
                for (job, own) in self.groups.iter().zip(&mut out.own) {
                    for index in 0..PASSES {
                        let pass = PassSettings {
                            index,
                            cone: self.cone,
                            ..PassSettings::default()
                        };
                        let response = sample_pixel(job, &pass, pixel, self.response, workspace);
                        for made in &workspace.contributions {
                            let value = response.brightness(&made.lanes);
                            match made.target {
                                Target::OwnPixel => *own += value / f64::from(PASSES),
                                Target::Splat(raster) => {
                                    out.splats.push((value, regions.at(raster.x, raster.y)));
                                }
                            }
                        }
                    }
                }
                out.counters = workspace.counters;
                out
            })
            .collect()
    }

    /// Region by region, one over the squared brightness.
    fn scale(&self, pixels: &[Pixel]) -> Vec<f64> {
        let mut regions = Regions::new(self.crop);
        for pixel in pixels {
            regions.add_samples(pixel.region, GROUPS as u32 * PASSES);
            let own = pixel.own.iter().sum::<f64>() * f64::from(PASSES);
            regions.add_light(pixel.region, own);
            for &(value, at) in &pixel.splats {
                regions.add_light(at, value);
            }
        }
        regions.scale()
    }
}

/// Variance of a sample, relative to the brightness around and without that of a few pixels, times
/// its cost.
fn product(pixels: &[Pixel], scale: &[f64]) -> f64 {
    let samples = GROUPS as f64 * f64::from(PASSES);
    let mut variances: Vec<f64> = pixels
        .iter()
        .map(|pixel| {
            let mean = pixel.own.iter().sum::<f64>() / GROUPS as f64;
            let scatter: f64 = pixel.own.iter().map(|v| (v - mean).powi(2)).sum();
            // of the mean of a group, times its passes: of one pass
            let own = scatter / (GROUPS - 1) as f64 * f64::from(PASSES);
            let splats = pixel.splats.iter().map(|(v, at)| v * v * scale[*at]);
            own * scale[pixel.region] + splats.sum::<f64>() / samples
        })
        .collect();
    variances.sort_by(f64::total_cmp);
    let kept = variances.len() - (TRIMMED * variances.len() as f64).ceil() as usize;
    let cost: f64 = pixels.iter().map(|pixel| price(&pixel.counters)).sum();
    variances[..kept].iter().sum::<f64>() * cost
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variance_is_that_of_a_pass_without_the_noisiest_pixels() {
        let pixel = |own, splat| Pixel {
            region: 0,
            own,
            splats: vec![(splat, 1)],
            counters: Counters {
                paths: 16,
                ..Counters::default()
            },
        };
        // means of groups of 4 passes with variance 1: a pass has 4
        let spread = 0.75_f64.sqrt();
        let own = [1.0 - spread, 1.0 + spread, 1.0 - spread, 1.0 + spread];
        let mut pixels: Vec<Pixel> = (0..49).map(|_| pixel(own, 4.0)).collect();
        pixels.push(pixel([0.0, 0.0, 1e9, 0.0], 0.0));
        // 16/16 of splats, of a region four times as dark as the other
        let found = product(&pixels, &[0.25, 1.0]);
        let expected = 49.0 * (0.25 * 4.0 + 1.0) * (50.0 * 16.0);
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    }
}
