//! Effort of a render: how many light sub-paths a camera sub-path is worth, and how often pairs of
//! inner vertices are tried.
//!
//! A pilot renders a lattice of pixels under two choices and takes the one whose variance times
//! cost is less; cost is counted at fixed prices. What camera sub-paths make alone scatters by the
//! means of independent groups of consecutive passes, which sees that passes are stratified: their
//! error falls faster than that of independent ones, so groups are as long as the render allows,
//! and the choice whose passes cost half as much has twice as many. What light sub-paths bring
//! scatters by its squares, as it is rare; a few passes with one light sub-path for every sample
//! tell, and it counts as often as they are traced: so rare light is not missed where few are.
//! [theory (2.11)]
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

/// Effort of a sample beside its camera sub-path.
#[derive(Clone, Copy)]
struct Effort {
    light_paths: f64,
    /// Probability with which a pair of inner vertices is tried.
    pairs: f64,
    /// Passes that cost as much as one of the usual choice.
    passes: u32,
}

/// Usual effort, and the one that is worth its cost where camera sub-paths do nearly as well alone.
/// Where few light sub-paths are traced, each is joined to all.
const USUAL: Effort = Effort {
    light_paths: 1.0,
    pairs: PAIR_PROBABILITY,
    passes: 1,
};
const FEW: Effort = Effort {
    light_paths: 0.0625,
    pairs: 1.0,
    passes: 2,
};
/// Product of variance and cost, relative to the usual choice, above which few are not taken.
const CLEAR: f64 = 0.9;
/// Independent groups of passes.
const GROUPS: usize = 4;
/// Passes of a group of camera sub-paths of the usual choice, pixels of the film for one of the
/// lattice, and pixels of the lattice at least: the longest that the length of the pilot and the
/// film have room for. Each costs at most 2 % of the shortest render that has it.
const LENGTHS: [(u32, u64, u64); 2] = [(64, 512, 8), (4, 320, 1)];
/// Passes of a group with light sub-paths.
const LIGHT_PASSES: u32 = 4;
/// Pixels of the lattice at most.
const PIXELS: u64 = 512;

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
    if !has_choice(frame) {
        return None;
    }
    let (passes, count) = LENGTHS
        .iter()
        .map(|&(passes, share, least)| (passes, crop.pixels() / share, least))
        .find(|&(passes, count, least)| length.within(passes).0 == passes && count >= least)
        .map(|(passes, count, _)| (passes, count.min(PIXELS) as usize))?;
    let settings: Vec<Settings> = (0..GROUPS as u64)
        .map(|group| Settings {
            seed: combine(u64::from(u32::MAX), combine(1 << 32, group)),
            ..frame.settings.clone()
        })
        .collect();
    let lattice: Vec<(u32, u32)> = lattice(&crop).take(count).collect();
    let run = |effort: Effort, passes, light_walks| {
        let jobs = settings.iter().map(|settings| {
            let mut job = SensorJob::new(frame.scene, frame.sensor, settings, &crop, false);
            job.strategies.tries = frame.strategies.tries;
            job.strategies.factors = factors;
            job.strategies.pairs = effort.pairs;
            job.strategies.set_light_paths(effort.light_paths);
            job.light_walks = light_walks;
            job
        });
        let pilot = Pilot {
            groups: jobs.collect(),
            regions: Regions::new(crop),
            response,
            passes,
        };
        pilot.run(&lattice)
    };
    let found = [USUAL, FEW].map(|effort| Trial {
        light_paths: effort.light_paths,
        own: run(effort, effort.passes * passes, LightWalks::Never),
        all: run(effort, LIGHT_PASSES, LightWalks::Once),
    });
    let scale = found[0].all.scale(Regions::new(crop));
    let [usual, few] = found
        .each_ref()
        .map(|trial| trial.variance(&scale) * trial.cost());
    let chosen = if few < CLEAR * usual { FEW } else { USUAL };
    Some(EffortChoice {
        light_paths: chosen.light_paths,
        pairs: chosen.pairs,
        samples: found.iter().map(Trial::samples).sum(),
    })
}

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
    /// Of each group.
    passes: u32,
}

impl Pilot<'_> {
    fn run(&self, lattice: &[(u32, u32)]) -> Outcome {
        let pixels = lattice
            .par_iter()
            .map_init(Workspace::default, |workspace, &pixel| {
                self.pixel(pixel, workspace)
            })
            .collect();
        Outcome {
            pixels,
            passes: self.passes,
        }
    }

    fn pixel(&self, pixel: (u32, u32), workspace: &mut Workspace) -> Pixel {
        let region = self.regions.at(f64::from(pixel.0), f64::from(pixel.1));
        let (mut own, mut brought) = ([0.0; GROUPS], Vec::new());
        workspace.counters = Counters::default();
        for (job, own) in self.groups.iter().zip(&mut own) {
            for index in 0..self.passes {
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
                        Target::OwnPixel => *own += value / f64::from(self.passes),
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

/// Findings about an effort.
struct Trial {
    light_paths: f64,
    /// Without light sub-paths.
    own: Outcome,
    /// With one for each sample.
    all: Outcome,
}

impl Trial {
    /// Variance of a sample, relative to the brightness around, summed over the pixels.
    fn variance(&self, scale: &[f64]) -> f64 {
        self.own.scatter(scale) + self.light_paths * self.all.brought(scale)
    }

    /// Cost of a sample at every pixel.
    fn cost(&self) -> f64 {
        let alone = self.own.cost();
        alone + self.light_paths * (self.all.cost() - alone)
    }

    fn samples(&self) -> u64 {
        self.own.samples() + self.all.samples()
    }
}

/// Findings of the groups of a pilot.
struct Outcome {
    pixels: Vec<Pixel>,
    /// Of each group.
    passes: u32,
}

impl Outcome {
    /// Samples of all pixels.
    fn samples(&self) -> u64 {
        GROUPS as u64 * u64::from(self.passes) * self.pixels.len() as u64
    }

    /// Cost of a sample at every pixel.
    fn cost(&self) -> f64 {
        let all: f64 = self.pixels.iter().map(|p| price(&p.counters)).sum();
        all / (GROUPS as f64 * f64::from(self.passes))
    }

    /// Region by region, one over the squared brightness that is found where light sub-paths are as
    /// many as samples.
    fn scale(&self, mut regions: Regions) -> Vec<f64> {
        for pixel in &self.pixels {
            regions.add_samples(pixel.region, GROUPS as u32 * self.passes);
            let own = pixel.own.iter().sum::<f64>() * f64::from(self.passes);
            regions.add_light(pixel.region, own);
            for &(value, at) in &pixel.brought {
                regions.add_light(at, value);
            }
        }
        regions.scale()
    }

    /// Variance of what camera sub-paths make alone: of the mean of a group, times its passes.
    fn scatter(&self, scale: &[f64]) -> f64 {
        let of_pixel = |pixel: &Pixel| {
            let mean = pixel.own.iter().sum::<f64>() / GROUPS as f64;
            let squares: f64 = pixel.own.iter().map(|v| (v - mean).powi(2)).sum();
            squares / (GROUPS - 1) as f64 * scale[pixel.region]
        };
        f64::from(self.passes) * self.pixels.iter().map(of_pixel).sum::<f64>()
    }

    /// Squares of what light sub-paths bring to a sample.
    fn brought(&self, scale: &[f64]) -> f64 {
        let all = self.pixels.iter().flat_map(|pixel| &pixel.brought);
        let squares: f64 = all.map(|(v, at)| v * v * scale[*at]).sum();
        squares / (GROUPS as f64 * f64::from(self.passes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variance_is_that_of_a_pass() {
        let outcome = |own, passes| {
            let pixel = Pixel {
                region: 0,
                own,
                brought: vec![(4.0, 1), (8.0, 1)],
                counters: Counters::default(),
            };
            Outcome {
                pixels: vec![pixel],
                passes,
            }
        };
        // means of groups of 16 passes with variance 1: a pass has 16
        let spread = 0.75_f64.sqrt();
        let trial = Trial {
            light_paths: 0.5,
            own: outcome([1.0 - spread, 1.0 + spread, 1.0 - spread, 1.0 + spread], 16),
            all: outcome([1.0; GROUPS], 4),
        };
        assert_eq!(trial.samples(), 80);
        // 80 / 16 of what light sub-paths bring, half as often, of a region half as bright
        let found = trial.variance(&[0.25, 1.0]);
        assert!((found - (0.25 * 16.0 + 2.5)).abs() < 1e-12, "{found}");
    }
}
