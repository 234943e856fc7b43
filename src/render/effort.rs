//! Effort of a render: how many light sub-paths a camera sub-path is worth, and how often pairs of
//! inner vertices are tried.
//!
//! A pilot renders a lattice of pixels under a few choices, with the same random numbers, and takes
//! the one whose variance times cost is least; cost is counted at fixed prices. What camera
//! sub-paths make alone scatters by the means of independent groups of consecutive passes, which
//! sees that passes are stratified; what light sub-paths bring scatters by its squares, as it is
//! rare. The pilot traces one light sub-path with every sample, and what it brings counts as often
//! as it is traced: so rare light is not missed where few are. [theory (2.11)]
//!
//! Without light sub-paths, camera sub-paths must make all light, and how much that scatters is not
//! seen where they hardly find it. So what light sub-paths bring says it too: by the share that
//! strategies of camera sub-paths have in its weights. [theory (2.13)]
//!
//! Where mirrors or smooth glass make caustics, there are as many light sub-paths as camera
//! sub-paths, or none where that says that camera sub-paths find the lights well enough, as under a
//! sky. Casters see to it that the pilot meets what makes caustics.
//!
//! Invariant: a function of scene, sensor, crop and settings without the seed and of the length of
//! the pilot, counted and never timed, whatever the threads, so that all parts of a render agree.
//! Every choice is unbiased: none is taken that leaves a path without a strategy.

use super::PilotPasses;
use super::pilot::{Regions, lattice};
use crate::film::Crop;
use crate::integrator::strategies::PAIR_PROBABILITY;
use crate::integrator::{LightWalks, SensorJob, Workspace, sample_pixel};
use crate::light::Light;
use crate::math::exact;
use crate::math::hash::combine;
use crate::scene::Settings;
use crate::scene::effects::EffectKind;
use crate::scene::settings::Aiming;
use crate::spectrum::SensorResponse;
use crate::transport::factors::Factors;
use crate::transport::{Cone, Counters, PassSettings, Target};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Light sub-paths per camera sub-path and probability of pairs: what is usual, and what is worth
/// its cost where camera sub-paths do nearly as well alone. Where few light sub-paths are traced,
/// each is joined to all.
const USUAL: (f64, f64) = (1.0, PAIR_PROBABILITY);
const FEW: (f64, f64) = (0.0625, 1.0);
/// The choice of camera sub-paths alone.
const NONE: (f64, f64) = (0.0, 0.0);
/// Product of variance and cost, relative to the usual choice, above which no other is taken.
const CLEAR: f64 = 0.9;
/// Prices in units of 6,800 instructions, as these were counted in three scenes: of a sample, a ray
/// that looks for the closest hit with the vertex there, a shadow ray, a connection with its
/// weights.
const SAMPLE: f64 = 0.2;
const CLOSEST: f64 = 0.5;
const SHADOW: f64 = 0.3;
const CONNECTION: f64 = 0.3;
/// Price of camera sub-paths alone whose weights ask for no densities of light sub-paths, of that
/// with them.
const UNASKED: f64 = 0.84;
/// Independent groups of passes, and passes of each.
const GROUPS: usize = 4;
const PASSES: u32 = 4;
/// Pixels of the lattice at most, and samples of the shortest render with a pilot of this length
/// for one of them: it takes at most 1.3 % of the render.
const PIXELS: u64 = 512;
const PIXELS_SHARE: u64 = 5120;
/// Pixels of the lattice at least: fewer do not tell; and where there are caustics, so that a
/// thousand light sub-paths look for them.
const LEAST: usize = 16;
const CAUSTICS: usize = 64;

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
        if *light_paths == 0.0 {
            return write!(
                f,
                "neither light sub-paths nor chains, as {samples} samples say"
            );
        }
        write!(
            f,
            "{light_paths} light sub-paths per pixel, {pairs} of the pairs of inner vertices, as {samples} samples say"
        )
    }
}

/// Whether a render has a choice of effort: it takes light sub-paths beside all others, merges
/// none, both numbers are to be found, and if a surface makes caustics it can do without them.
pub(super) fn has_choice(frame: &SensorJob) -> bool {
    let (strategies, settings) = (&frame.strategies, frame.settings);
    strategies.merge.is_none()
        && strategies.splats
        && strategies.direct
        && settings.light_paths.is_none()
        && settings.pair_probability.is_none()
        && (!makes_caustics(frame) || can_do_without(frame))
}

fn makes_caustics(frame: &SensorJob) -> bool {
    frame.scene.has_effect(EffectKind::Specular)
}

/// Whether a render can leave out light sub-paths. Without what is specular every camera vertex can
/// be joined to every light, and a light that is seen directly is hit; else all lights must be such
/// that they can be hit, and a share of the pilot's light sub-paths must look for caustics. Not
/// where light sub-paths alone, few paths or all chains are asked for.
pub(super) fn can_do_without(frame: &SensorJob) -> bool {
    let (strategies, settings) = (&frame.strategies, frame.settings);
    strategies.hits
        && !strategies.hittable_sensor
        && strategies.disabled.is_empty()
        && !settings.integrator.runs_chains()
        && frame.scene.sequences.is_none()
        && settings.aim != Aiming::All
        && (!makes_caustics(frame)
            || frame.scene.casters.share() > 0.0 && !frame.scene.lights.iter().any(Light::is_delta))
}

/// Finds the effort, with these variance factors; `None` where there is no choice, or the render is
/// too short for a pilot.
#[must_use]
pub fn choose(
    frame: &SensorJob,
    factors: Option<&Factors>,
    crop: Crop,
    cone: Option<Cone>,
    response: SensorResponse,
    length: PilotPasses,
) -> Option<EffortChoice> {
    let share = PIXELS_SHARE / u64::from(length.least_samples().max(1));
    let count = (crop.pixels() / share.max(1)).min(PIXELS) as usize;
    let least = if makes_caustics(frame) {
        CAUSTICS
    } else {
        LEAST
    };
    if !has_choice(frame) || !length.is_full() || count < least {
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
            let mut job = SensorJob::new(frame.scene, frame.sensor, settings, &crop, true);
            job.detailed = false;
            job.strategies.tries = frame.strategies.tries;
            job.strategies.factors = factors;
            job.strategies.set_effort(light_paths, pairs);
            job.light_walks = light_walks;
            job
        });
        let pilot = Pilot {
            groups: jobs.collect(),
            regions: Regions::new(crop),
            cone,
            response,
        };
        pilot.run(&pixels)
    };
    let alone = cost(&run(USUAL, LightWalks::Never));
    let mut runs = vec![(USUAL, run(USUAL, LightWalks::Once))];
    if !makes_caustics(frame) {
        runs.push((FEW, run(FEW, LightWalks::Once)));
    }
    if can_do_without(frame) {
        runs.push((NONE, run(NONE, LightWalks::Never)));
    }
    let scale = scale(Regions::new(crop), &runs);
    let unseen = variance_without(&runs[0].1, &scale);
    let product = |(light_paths, pairs): (f64, f64), pixels: &[Pixel]| {
        let variance = variance(pixels, light_paths, &scale);
        if (light_paths, pairs) == NONE {
            return variance.max(unseen) * UNASKED * cost(pixels);
        }
        variance * (alone + light_paths * (cost(pixels) - alone))
    };
    let samples = (runs.len() as u64 + 1) * SAMPLES * pixels.len() as u64;
    let mut best = (USUAL, CLEAR * product(USUAL, &runs[0].1));
    for (choice, pixels) in &runs[1..] {
        let product = product(*choice, pixels);
        if product < best.1 {
            best = (*choice, product);
        }
    }
    let (light_paths, pairs) = best.0;
    Some(EffortChoice {
        light_paths,
        pairs,
        samples,
    })
}

fn cost(pixels: &[Pixel]) -> f64 {
    let of_pixel = |pixel: &Pixel| {
        let counters = &pixel.counters;
        SAMPLE * counters.paths as f64
            + CLOSEST * counters.closest_rays as f64
            + SHADOW * counters.shadow_rays as f64
            + CONNECTION * counters.connections_tried as f64
    };
    pixels.iter().map(of_pixel).sum()
}

/// Samples of a pixel.
const SAMPLES: u64 = GROUPS as u64 * PASSES as u64;

/// Samples of one pixel.
struct Pixel {
    region: usize,
    /// Means over each group of what camera sub-paths make alone.
    own: [f64; GROUPS],
    brought: Vec<Brought>,
    /// Part of what camera sub-paths make alone: by chains that are solved for.
    aimed: Vec<Brought>,
    counters: Counters,
}

/// Contribution of a light sub-path, or of a chain.
struct Brought {
    brightness: f64,
    region: usize,
    /// Share of strategies of camera sub-paths in the weights.
    camera_share: f64,
}

struct Pilot<'a> {
    groups: Vec<SensorJob<'a>>,
    regions: Regions,
    cone: Option<Cone>,
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
        let (mut own, mut brought, mut aimed) = ([0.0; GROUPS], Vec::new(), Vec::new());
        workspace.counters = Counters::default();
        for (job, own) in self.groups.iter().zip(&mut own) {
            for index in 0..PASSES {
                let pass = PassSettings {
                    index,
                    cone: self.cone,
                    ..PassSettings::default()
                };
                let response = sample_pixel(job, &pass, pixel, self.response, workspace);
                for made in &workspace.contributions {
                    let brightness = response.brightness(&made.lanes);
                    let (region, by_light) = match made.target {
                        Target::Splat(raster) if !made.beside => {
                            (self.regions.at(raster.x, raster.y), true)
                        }
                        // other wavelengths of camera sub-paths land nearby
                        _ => (region, made.s >= 2),
                    };
                    if !by_light {
                        *own += brightness / f64::from(PASSES);
                    }
                    let found = Brought {
                        brightness,
                        region,
                        camera_share: f64::from(made.camera_share),
                    };
                    if by_light {
                        brought.push(found);
                    } else if made.aimed.is_some() {
                        aimed.push(found);
                    }
                }
            }
        }
        Pixel {
            region,
            own,
            brought,
            aimed,
            counters: workspace.counters,
        }
    }
}

/// Region by region, one over the squared brightness that all runs together find: were it that of
/// one, this would look the quietest, for what is bright by chance is so in both.
fn scale(mut regions: Regions, runs: &[((f64, f64), Vec<Pixel>)]) -> Vec<f64> {
    for ((light_paths, _), pixels) in runs {
        for pixel in pixels {
            regions.add_samples(pixel.region, SAMPLES as u32);
            let own = pixel.own.iter().sum::<f64>() * f64::from(PASSES);
            regions.add_light(pixel.region, own);
            for brought in &pixel.brought {
                regions.add_light(brought.region, light_paths * brought.brightness);
            }
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
        let squared = |brought: &Brought| brought.brightness.powi(2) * scale[brought.region];
        let brought: f64 = pixel.brought.iter().map(squared).sum();
        own * scale[pixel.region] + light_paths * brought / SAMPLES as f64
    };
    pixels.iter().map(of_pixel).sum()
}

/// The same of hits and connections to lights alone, of as much as light sub-paths and chains say:
/// what these bring would be brought at so much greater weight.
fn variance_without(pixels: &[Pixel], scale: &[f64]) -> f64 {
    let squared = |brought: &Brought| {
        brought.brightness.powi(2) / brought.camera_share * scale[brought.region]
    };
    let found = pixels
        .iter()
        .flat_map(|pixel| pixel.brought.iter().chain(&pixel.aimed));
    let bright = found.filter(|brought| brought.brightness != 0.0);
    bright.map(squared).sum::<f64>() / SAMPLES as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variance_is_that_of_a_pass() {
        // means of groups of 4 passes with variance 1: a pass has 4
        let spread = 0.75_f64.sqrt();
        let brought = |brightness, camera_share| Brought {
            brightness,
            region: 1,
            camera_share,
        };
        let pixels = [Pixel {
            region: 0,
            own: [1.0 - spread, 1.0 + spread, 1.0 - spread, 1.0 + spread],
            brought: vec![brought(4.0, 0.5), brought(8.0, 0.25)],
            aimed: vec![brought(2.0, 0.5)],
            counters: Counters::default(),
        }];
        // 80 / 16 of what light sub-paths bring, half as often, of a region half as bright
        let found = variance(&pixels, 0.5, &[0.25, 1.0]);
        assert!((found - (0.25 * 4.0 + 2.5)).abs() < 1e-12, "{found}");
        // (16 / 0.5 + 64 / 0.25 + 4 / 0.5) / 16
        let found = variance_without(&pixels, &[0.25, 1.0]);
        assert!((found - 18.5).abs() < 1e-12, "{found}");
    }
}
