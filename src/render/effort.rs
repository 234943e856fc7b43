//! Effort of a render: how many light sub-paths a camera sub-path is worth, and how often pairs of
//! inner vertices are tried.
//!
//! A pilot renders a lattice of pixels under two choices, with the same random numbers, and takes
//! the one whose variance times cost is less; cost is counted at fixed prices. What camera
//! sub-paths make alone scatters by the means of independent groups of consecutive passes, which
//! sees that passes are stratified; what light sub-paths bring scatters by its squares, as it is
//! rare. The pilot traces one light sub-path with every sample, and what it brings counts as often
//! as it is traced: so rare light is not missed where few are. [theory (2.11)]
//!
//! Scenes with mirrors or smooth glass always have one light sub-path per camera sub-path: caustics
//! are made by them, and a pilot may not have met what lights one.
//!
//! Invariant: a function of scene, sensor, crop and settings without the seed and of the length of
//! the pilot, counted and never timed, whatever the threads, so that all parts of a render agree.
//! Either choice is unbiased: no light sub-paths at all is none.

use super::PilotPasses;
use super::pilot::{Regions, lattice, price};
use crate::film::Crop;
use crate::integrator::strategies::PAIR_PROBABILITY;
use crate::integrator::{LightWalks, SensorJob, Workspace, sample_pixel};
use crate::math::exact;
use crate::math::hash::combine;
use crate::scene::Settings;
use crate::scene::effects::EffectKind;
use crate::spectrum::SensorResponse;
use crate::transport::factors::Factors;
use crate::transport::{Counters, PassSettings, Target};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Light sub-paths per camera sub-path and probability of pairs: what is usual, and what is worth
/// its cost where camera sub-paths do nearly as well alone. Where few light sub-paths are traced,
/// each is joined to all.
const USUAL: (f64, f64) = (1.0, PAIR_PROBABILITY);
const FEW: (f64, f64) = (0.0625, 1.0);
/// Product of variance and cost, relative to the usual choice, above which few are not taken.
const CLEAR: f64 = 0.9;
/// Independent groups of passes, and passes of each.
const GROUPS: usize = 4;
const PASSES: u32 = 4;
/// Pixels of the lattice at most, and pixels of the film for one of them: the pilot takes a tenth
/// of a sample per pixel.
const PIXELS: u64 = 512;
const PIXELS_SHARE: u64 = 320;

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
/// none, both numbers are to be found, and no surface makes caustics.
pub(super) fn has_choice(frame: &SensorJob) -> bool {
    let (strategies, settings) = (&frame.strategies, frame.settings);
    strategies.merge.is_none()
        && strategies.splats
        && strategies.direct
        && settings.light_paths.is_none()
        && settings.pair_probability.is_none()
        && !frame.scene.has_effect(EffectKind::Specular)
}

/// Finds the effort, with these variance factors; `None` where there is no choice, or the render is
/// too short for a pilot.
#[must_use]
pub fn choose(
    frame: &SensorJob,
    factors: Option<&Factors>,
    crop: Crop,
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
    let run = |(light_paths, pairs), light_walks| {
        let jobs = settings.iter().map(|settings| {
            let mut job = SensorJob::new(frame.scene, frame.sensor, settings, &crop, false);
            job.strategies.tries = frame.strategies.tries;
            job.strategies.factors = factors;
            job.strategies.pairs = pairs;
            job.strategies.set_light_paths(light_paths);
            job.light_walks = light_walks;
            job
        });
        let pilot = Pilot {
            groups: jobs.collect(),
            regions: Regions::new(crop),
            response,
        };
        pilot.run(&pixels)
    };
    let cost_of = |pixels: &[Pixel]| pixels.iter().map(|p| price(&p.counters)).sum::<f64>();
    let alone = cost_of(&run(USUAL, LightWalks::Never));
    let (usual, few) = (run(USUAL, LightWalks::Once), run(FEW, LightWalks::Once));
    let scale = scale(Regions::new(crop), &usual);
    let product = |pixels: &[Pixel], light_paths: f64| {
        let cost = alone + light_paths * (cost_of(pixels) - alone);
        variance(pixels, light_paths, &scale) * cost
    };
    let pays = product(&few, FEW.0) < CLEAR * product(&usual, USUAL.0);
    let (light_paths, pairs) = if pays { FEW } else { USUAL };
    Some(EffortChoice {
        light_paths,
        pairs,
        samples: 3 * SAMPLES * pixels.len() as u64,
    })
}

/// Samples of a pixel.
const SAMPLES: u64 = GROUPS as u64 * PASSES as u64;

/// Samples of one pixel.
struct Pixel {
    region: usize,
    /// Means over each group of what camera sub-paths make alone.
    own: [f64; GROUPS],
    /// Brightness and region of what a light sub-path brings, each.
    brought: Vec<(f64, usize)>,
    counters: Counters,
}

struct Pilot<'a> {
    groups: Vec<SensorJob<'a>>,
    regions: Regions,
    response: SensorResponse,
}

impl Pilot<'_> {
    fn run(&self, pixels: &[(u32, u32)]) -> Vec<Pixel> {
        pixels
            .par_iter()
            .map_init(Workspace::default, |workspace, &pixel| {
                self.pixel(pixel, workspace)
            })
            .collect()
    }

    fn pixel(&self, pixel: (u32, u32), workspace: &mut Workspace) -> Pixel {
        let region = self.regions.at(f64::from(pixel.0), f64::from(pixel.1));
        let (mut own, mut brought) = ([0.0; GROUPS], Vec::new());
        workspace.counters = Counters::default();
        for (job, own) in self.groups.iter().zip(&mut own) {
            for index in 0..PASSES {
                let pass = PassSettings {
                    index,
                    ..PassSettings::default()
                };
                let response = sample_pixel(job, &pass, pixel, self.response, workspace);
                for made in &workspace.contributions {
                    let value = response.brightness(&made.lanes);
                    match made.target {
                        Target::Splat(raster) => {
                            brought.push((value, self.regions.at(raster.x, raster.y)));
                        }
                        Target::OwnPixel if made.s >= 2 => brought.push((value, region)),
                        Target::OwnPixel => *own += value / f64::from(PASSES),
                    }
                }
            }
        }
        Pixel {
            region,
            own,
            brought,
            counters: workspace.counters,
        }
    }
}

/// Region by region, one over the squared brightness that is found where light sub-paths are as
/// many as samples.
fn scale(mut regions: Regions, pixels: &[Pixel]) -> Vec<f64> {
    for pixel in pixels {
        regions.add_samples(pixel.region, SAMPLES as u32);
        let own = pixel.own.iter().sum::<f64>() * f64::from(PASSES);
        regions.add_light(pixel.region, own);
        for &(value, at) in &pixel.brought {
            regions.add_light(at, value);
        }
    }
    regions.scale()
}

/// Variance of a sample, relative to the brightness around, summed over the pixels; light sub-paths
/// are traced `light_paths` times as often as they were.
fn variance(pixels: &[Pixel], light_paths: f64, scale: &[f64]) -> f64 {
    let of_pixel = |pixel: &Pixel| {
        let mean = pixel.own.iter().sum::<f64>() / GROUPS as f64;
        let scatter: f64 = pixel.own.iter().map(|v| (v - mean).powi(2)).sum();
        // of the mean of a group, times its passes: of one pass
        let own = scatter / (GROUPS - 1) as f64 * f64::from(PASSES);
        let brought: f64 = pixel.brought.iter().map(|(v, at)| v * v * scale[*at]).sum();
        own * scale[pixel.region] + light_paths * brought / SAMPLES as f64
    };
    pixels.iter().map(of_pixel).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variance_is_that_of_a_pass() {
        // means of groups of 4 passes with variance 1: a pass has 4
        let spread = 0.75_f64.sqrt();
        let pixel = Pixel {
            region: 0,
            own: [1.0 - spread, 1.0 + spread, 1.0 - spread, 1.0 + spread],
            brought: vec![(4.0, 1), (8.0, 1)],
            counters: Counters::default(),
        };
        // 80 / 16 of what light sub-paths bring, half as often, of a region half as bright
        let found = variance(&[pixel], 0.5, &[0.25, 1.0]);
        assert!((found - (0.25 * 4.0 + 2.5)).abs() < 1e-12, "{found}");
    }
}
