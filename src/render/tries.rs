//! Tries of a render: how often each kind of chain is worth solving for.
//!
//! A pilot tries every kind from everywhere. A bridge that gave c with weight w in the sum of all
//! strategies stands for a second moment of c²/(1 − w + p w) had it been tried with probability p;
//! what it cost is counted in searches and rays, at fixed prices. Kind by kind and origin by
//! origin, the p is taken that makes variance times cost of the whole render least. [theory (9.6)]
//!
//! Invariant: a function of scene, sensor, crop and settings without the seed and of the length of
//! the pilot, counted and never timed, whatever the threads, so that all parts of a render agree.

use super::PilotPasses;
use super::pilot::{Regions, SHADOW, lattice, price};
use crate::film::Crop;
use crate::integrator::{SensorJob, Workspace, sample_pixel};
use crate::math::hash::combine;
use crate::scene::Settings;
use crate::spectrum::SensorResponse;
use crate::transport::aim::tries::{Origin, Tries};
use crate::transport::connect::AimTally;
use crate::transport::{Cone, Counters, PassSettings, Target};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Passes of the pilot.
const PASSES: u32 = 4;
/// Index of the first, which no render reaches.
const FIRST_PASS: u32 = u32::MAX - 32;
/// Pixels of the lattice by length of the pilot of variance factors, most of them, and the share of
/// a film that they are at most.
const PIXELS: [(u32, u64); 3] = [(4, 1024), (1, 256), (0, 64)];
const PIXELS_SHARE: u64 = 8;
/// Kinds up to which the pilot takes as many: it tries all of them at every vertex.
const FEW_KINDS: usize = 256;
/// Probabilities that may be chosen, from the largest down.
const SHARES: [f64; 6] = [1.0, 0.5, 0.25, 0.125, 0.0625, 0.0];
/// Largest probability of what nothing else makes and the pilot has not seen, and how many such
/// kinds a vertex tries at most on average.
const UNSEEN: f64 = 0.0625;
const MOST_UNSEEN: f64 = 8.0;
/// Share of the samples that are left out of what others scatter, the largest ones.
const TRIMMED: f64 = 1e-3;
/// Rounds of the search.
const ROUNDS: usize = 4;

/// Prices of a search and of a chain found, beside those of [`price`].
const SEARCH: f64 = 1.5;
const CHAIN: f64 = 1.5;

/// Probabilities with which kinds of chains are tried, and how they were found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "Written", try_from = "Written")]
pub struct TriesChoice {
    /// The probabilities.
    pub tries: Tries,
    /// Samples that the pilot took.
    pub samples: u64,
    /// Kinds that are tried from anywhere, of all.
    pub tried: usize,
    /// Number of all kinds.
    pub kinds: usize,
}

/// Tries as they are written: shares are powers of two, which text names exactly.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    kinds: usize,
    samples: u64,
    /// Origin by origin.
    shares: Vec<f32>,
}

impl TriesChoice {
    fn new(tries: Tries, samples: u64) -> Self {
        let kinds = tries.kinds();
        let is_tried = |kind: &usize| Origin::all().any(|o| tries.share(o, *kind) > 0.0);
        Self {
            tried: (0..kinds).filter(is_tried).count(),
            tries,
            samples,
            kinds,
        }
    }
}

impl From<TriesChoice> for Written {
    fn from(found: TriesChoice) -> Self {
        Self {
            kinds: found.kinds,
            samples: found.samples,
            shares: found.tries.shares().to_vec(),
        }
    }
}

impl TryFrom<Written> for TriesChoice {
    type Error = &'static str;

    fn try_from(written: Written) -> Result<Self, &'static str> {
        let Written {
            kinds,
            samples,
            shares,
        } = written;
        if kinds > shares.len() {
            return Err("tries of chains without their shares");
        }
        let tries = Tries::new(kinds, shares).map_err(|_| "tries of chains that are none")?;
        Ok(Self::new(tries, samples))
    }
}

impl fmt::Display for TriesChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            samples,
            tried,
            kinds,
            ..
        } = self;
        write!(
            f,
            "{tried} of {kinds} kinds of chains, as often as {samples} samples say"
        )
    }
}

/// Yield of one sample besides bridges, and its bridges.
#[derive(Default)]
struct Sample {
    /// Of its own pixel.
    own: f64,
    /// Brightness and place of splats.
    splats: Vec<(f64, usize)>,
    bridges: Vec<Made>,
}

/// A contribution of a bridge.
struct Made {
    /// Origin and kind.
    at: usize,
    region: usize,
    value: f64,
    weight: f64,
}

/// The samples of a pixel.
struct Pixel {
    region: usize,
    samples: Vec<Sample>,
    tally: Vec<AimTally>,
    counters: Counters,
}

/// Finds the probabilities; `None` where no chains are solved for.
#[must_use]
pub fn choose(
    frame: &SensorJob,
    crop: Crop,
    cone: Option<Cone>,
    response: SensorResponse,
    length: PilotPasses,
) -> Option<TriesChoice> {
    if !frame.strategies.aims.any() {
        return None;
    }
    let kinds = frame.scene.chains().kinds().len();
    let settings = Settings {
        seed: combine(u64::from(u32::MAX), u64::from(FIRST_PASS)),
        ..frame.settings.clone()
    };
    let mut job = SensorJob::new(frame.scene, frame.sensor, &settings, &crop, false);
    job.detailed = true;
    let most = PIXELS.iter().find(|(passes, _)| length.0 >= *passes);
    let most =
        most.map_or(0, |(_, pixels)| *pixels) * FEW_KINDS as u64 / kinds.max(FEW_KINDS) as u64;
    let count = (crop.pixels() / PIXELS_SHARE).clamp(1, most) as usize;
    let pixels: Vec<(u32, u32)> = lattice(&crop).take(count).collect();
    let regions = Regions::new(crop);
    let pixels: Vec<Pixel> = pixels
        .into_par_iter()
        .map_init(Workspace::default, |workspace, pixel| {
            workspace.count_aims(kinds);
            workspace.counters = Counters::default();
            let samples = (0..PASSES).map(|i| {
                let pass = PassSettings {
                    index: FIRST_PASS + i,
                    cone,
                    ..PassSettings::default()
                };
                let response = sample_pixel(&job, &pass, pixel, response, workspace);
                let mut sample = Sample::default();
                for made in &workspace.contributions {
                    let value = response.brightness(&made.lanes);
                    let region = match made.target {
                        Target::OwnPixel => regions.at(f64::from(pixel.0), f64::from(pixel.1)),
                        Target::Splat(raster) => regions.at(raster.x, raster.y),
                    };
                    match (made.aimed, made.target) {
                        (Some(aimed), _) => sample.bridges.push(Made {
                            at: aimed.origin.number() * kinds + aimed.kind as usize,
                            region,
                            value,
                            weight: f64::from(aimed.weight).min(1.0),
                        }),
                        (None, Target::OwnPixel) => sample.own += value,
                        (None, Target::Splat(_)) => sample.splats.push((value, region)),
                    }
                }
                sample
            });
            Pixel {
                region: regions.at(f64::from(pixel.0), f64::from(pixel.1)),
                samples: samples.collect(),
                tally: workspace.aims().to_vec(),
                counters: workspace.counters,
            }
        })
        .collect();
    let samples = u64::from(PASSES) * pixels.len() as u64;
    let shares = Balance::new(&pixels, &needed(frame, kinds), regions).shares(unseen(kinds));
    let tries =
        Tries::new(kinds, shares).expect("invariant: a share of each kind from each origin");
    Some(TriesChoice::new(tries, samples))
}

/// By origin and kind: whether the paths have no other technique that is sure to make them without
/// a cone, or all chains are asked for. These are never left out.
fn needed(frame: &SensorJob, kinds: usize) -> Vec<bool> {
    let strategies = &frame.strategies;
    let aims = strategies.aims;
    let all = aims.light_everywhere
        || aims.sensor_everywhere
        || !(strategies.hits && strategies.direct && strategies.splats);
    Origin::all()
        .flat_map(|origin| std::iter::repeat_n(all || origin.is_needed(), kinds))
        .collect()
}

/// Probability of what nothing else makes and the pilot has not seen, of `kinds` kinds: a power of
/// two.
fn unseen(kinds: usize) -> f64 {
    let most = (MOST_UNSEEN / kinds.max(1) as f64).min(UNSEEN);
    most.log2().floor().exp2()
}

/// Variance and cost of a sample, as functions of the probabilities.
struct Balance {
    /// Variance of what is no bridge's, relative to the brightness around.
    others: f64,
    /// Cost without bridges.
    cost: f64,
    /// By origin and kind: second moments at each of [`SHARES`], and the cost if always tried.
    aims: Vec<([f64; SHARES.len()], f64)>,
    needed: Vec<bool>,
}

impl Balance {
    fn new(pixels: &[Pixel], needed: &[bool], mut regions: Regions) -> Self {
        let count = (pixels.len() * PASSES as usize).max(1) as f64;
        for pixel in pixels {
            regions.add_samples(pixel.region, PASSES);
            for sample in &pixel.samples {
                regions.add_light(pixel.region, sample.own);
                let splats = sample.splats.iter().copied();
                let bridges = sample.bridges.iter().map(|made| (made.value, made.region));
                splats
                    .chain(bridges)
                    .for_each(|(value, at)| regions.add_light(at, value));
            }
        }
        let scale = regions.scale();
        let mut others: Vec<f64> = Vec::new();
        let mut aims = vec![([0.0; SHARES.len()], 0.0); needed.len()];
        let mut counters = Counters::default();
        let mut tallies = AimTally::default();
        for pixel in pixels {
            let own: f64 = pixel.samples.iter().map(|s| s.own).sum::<f64>() / f64::from(PASSES);
            for sample in &pixel.samples {
                // unbiased over the passes of a pixel
                let of_own = (sample.own - own).powi(2) / f64::from(PASSES - 1) * f64::from(PASSES);
                let of_splats = sample.splats.iter().map(|(v, at)| v * v * scale[*at]);
                others.push(of_own * scale[pixel.region] + of_splats.sum::<f64>());
                for made in sample.bridges.iter().filter(|made| made.value != 0.0) {
                    let moment = made.value * made.value * scale[made.region] / count;
                    for (sum, p) in aims[made.at].0.iter_mut().zip(SHARES) {
                        *sum += moment / (1.0 - made.weight + p * made.weight);
                    }
                }
            }
            counters.add(&pixel.counters);
            for (aim, tally) in aims.iter_mut().zip(&pixel.tally) {
                tallies.solved += tally.solved;
                tallies.rays += tally.rays;
                aim.1 += (SEARCH * tally.solved as f64
                    + CHAIN * tally.found as f64
                    + SHADOW * tally.rays as f64)
                    / count;
            }
        }
        others.sort_by(f64::total_cmp);
        let kept = others.len() - (TRIMMED * others.len() as f64).ceil() as usize;
        // what chains cost is told apart
        counters.shadow_rays -= tallies.rays;
        counters.connections_tried -= tallies.solved;
        let cost = price(&counters);
        Self {
            others: others[..kept].iter().sum::<f64>() / count,
            cost: cost / count,
            aims,
            needed: needed.to_vec(),
        }
    }

    /// The probabilities that make variance times cost least, each with the others as they are;
    /// `unseen` of what is needed and not seen.
    fn shares(&self, unseen: f64) -> Vec<f32> {
        let mut chosen = vec![0; self.aims.len()];
        for _ in 0..ROUNDS {
            let (mut moments, mut cost) = (self.others, self.cost);
            for ((of, price), &i) in self.aims.iter().zip(&chosen) {
                moments += of[i];
                cost += price * SHARES[i];
            }
            for (at, (of, price)) in self.aims.iter().enumerate() {
                if *price == 0.0 {
                    continue;
                }
                let now = chosen[at];
                let change = |i: usize| (of[i] - of[now], price * (SHARES[i] - SHARES[now]));
                let product = |i: usize| (moments + change(i).0) * (cost + change(i).1);
                let last = SHARES.len() - usize::from(self.needed[at]);
                let best = (0..last).min_by(|&a, &b| product(a).total_cmp(&product(b)));
                chosen[at] = best.unwrap_or(now);
                let (more, dearer) = change(chosen[at]);
                moments += more;
                cost += dearer;
            }
        }
        let share = |(at, &i): (usize, &usize)| {
            let is_seen = self.aims[at].0[0] != 0.0;
            let p = match (is_seen, self.needed[at]) {
                (false, true) => unseen,
                (false, false) => 0.0,
                (true, _) => SHARES[i],
            };
            p as f32
        };
        chosen.iter().enumerate().map(share).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{Balance, SHARES, UNSEEN, unseen};

    #[test]
    fn chains_are_tried_as_often_as_they_gain() {
        // what gives a second moment v alone at every probability, or shares it with others
        let alone = |v: f64| SHARES.map(|p| v / p);
        let shared = |v: f64, weight: f64| SHARES.map(|p| v / (1.0 - weight + p * weight));
        let aims = vec![
            // cheap, and nothing else makes it well
            (shared(1.0, 0.99), 0.01),
            // dear, and others make it as well
            (shared(1e-3, 0.1), 5.0),
            // the same where it must not be left out
            (shared(1e-3, 0.1), 5.0),
            // nothing else makes it, dear
            (alone(0.04), 25.0),
            // never seen
            ([0.0; SHARES.len()], 1.0),
            ([0.0; SHARES.len()], 1.0),
        ];
        let balance = Balance {
            others: 1.0,
            cost: 1.0,
            aims,
            needed: vec![false, false, true, false, true, false],
        };
        let found = balance.shares(UNSEEN);
        assert_eq!(found[..3], [1.0, 0.0, 0.0625]);
        // sqrt(v T / (V t)) is 1/25, below the least probability
        assert_eq!(found[3], 0.0625);
        assert_eq!(found[4..], [UNSEEN as f32, 0.0]);
        assert_eq!(
            [1, 128, 129, 4096].map(unseen),
            [0.0625, 0.0625, 0.03125, 1.0 / 512.0]
        );
    }
}
