//! Tries of a render: how often each kind of chain is worth solving for.
//!
//! A pilot tries every kind with a small probability p₀ of its own, from everywhere. A bridge that
//! gave c with weight w in the sum of all strategies stands for a second moment of
//! c²/(1 − w + (p/p₀) w) had it been tried with probability p; what it cost is counted in searches
//! and rays, at fixed prices. Kind by kind and origin by origin, the p is taken that makes variance
//! times cost of the whole render least. [theory (9.6)]
//!
//! Invariant: a function of scene, sensor, crop and settings without the seed and of the length of
//! the pilot, which its counted cost bounds; nothing is timed. Whatever the threads, all parts of a
//! render agree.

use super::PilotPasses;
use super::pilot::{Regions, spread};
use crate::film::Crop;
use crate::integrator::{SensorJob, Workspace, sample_pixel};
use crate::math::hash::combine;
use crate::scene::Settings;
use crate::scene::chains::ChainKind;
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
/// Pixels of the lattice by length of the pilot, most of them, and the share of a film that they
/// are at most. A chain that few pixels see needs many of them.
const PIXELS: [(u32, u64); 4] = [(64, 8192), (4, 1024), (1, 256), (0, 64)];
const PIXELS_SHARE: u64 = 8;
/// Pixels of the first batch; each later one doubles all. A batch is the last where the next would
/// make the cost larger than a share of that of the shortest render with a pilot of variance
/// factors of this length.
const FIRST_PIXELS: usize = 16;
const COST_SHARE: f64 = 0.1;
/// Kinds that a vertex of the pilot tries at most on average.
const MOST_TRIED: f64 = 8.0;
/// Probabilities that may be chosen, from the largest down.
const SHARES: [f64; 8] = [1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625, 0.0];
/// Largest probability of what nothing else makes and the pilot has not seen, and how many such
/// kinds a vertex tries at most on average.
const UNSEEN: f64 = 0.015625;
const MOST_UNSEEN: f64 = 4.0;
/// Share of the samples that are left out of what others scatter, the largest ones.
const TRIMMED: f64 = 1e-3;
/// Rounds of the search.
const ROUNDS: usize = 4;

/// Prices, in units of a microsecond of a core of 2020: of a path pair, a ray that looks for the
/// closest hit with the vertex there, a shadow ray, a connection; of a search, by the square of the
/// length of the chain, and of a chain found.
const PAIR: f64 = 1.0;
const CLOSEST: f64 = 0.5;
const SHADOW: f64 = 0.2;
const CONNECTION: f64 = 0.1;
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
    tally: Vec<(u32, AimTally)>,
    counters: Counters,
}

/// Few tries of every kind from everywhere, for pilots; `None` where no chains are solved for.
pub(super) fn sparse(frame: &SensorJob) -> Option<Tries> {
    if !frame.strategies.aims.any() {
        return None;
    }
    let shares = shared(&searches(frame), MOST_TRIED);
    let all = Origin::all().flat_map(|_| shares.iter().map(|s| *s as f32));
    let tries = Tries::new(shares.len(), all.collect());
    Some(tries.expect("invariant: a share of each kind from each origin"))
}

/// Price of a search, by kind.
fn searches(frame: &SensorJob) -> Vec<f64> {
    let price = |kind: &ChainKind| SEARCH * (kind.len() * kind.len()) as f64;
    frame.scene.chains().kinds().iter().map(price).collect()
}

/// Probabilities of kinds, powers of two from 1 down, in inverse proportion to these prices: a
/// vertex tries `most` of them at most on average.
fn shared(prices: &[f64], most: f64) -> Vec<f64> {
    let all: f64 = prices.iter().map(|price| 1.0 / price).sum();
    let share = |price: &f64| (most / (price * all)).min(1.0).log2().floor().exp2();
    prices.iter().map(share).collect()
}

/// Finds the probabilities, by samples that try as `frame` does ([`sparse`]); `None` where no
/// chains are solved for.
#[must_use]
pub fn choose(
    frame: &SensorJob,
    crop: Crop,
    cone: Option<Cone>,
    response: SensorResponse,
    length: PilotPasses,
) -> Option<TriesChoice> {
    let sparse = frame.strategies.tries?;
    let kinds = sparse.kinds();
    let settings = Settings {
        seed: combine(u64::from(u32::MAX), u64::from(FIRST_PASS)),
        ..frame.settings.clone()
    };
    let mut job = SensorJob::new(frame.scene, frame.sensor, &settings, &crop, false);
    job.detailed = true;
    job.strategies.tries = Some(sparse);
    let most = PIXELS.iter().find(|(passes, _)| length.0 >= *passes);
    let most = most.map_or(0, |(_, pixels)| *pixels);
    let most = (crop.pixels() / PIXELS_SHARE).clamp(1, most) as usize;
    let lattice: Vec<(u32, u32)> = spread(&crop).take(most).collect();
    let least = f64::from(length.of_factors().least_samples()) * crop.pixels() as f64;
    let regions = Regions::new(crop);
    let run = |pixels: &[(u32, u32)]| -> Vec<Pixel> {
        let one = |workspace: &mut Workspace, &pixel: &(u32, u32)| {
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
                        (None, Target::Splat(_)) if made.beside => sample.own += value,
                        (None, Target::Splat(_)) => sample.splats.push((value, region)),
                    }
                }
                sample
            });
            Pixel {
                region: regions.at(f64::from(pixel.0), f64::from(pixel.1)),
                samples: samples.collect(),
                tally: (0u32..)
                    .zip(workspace.aims().iter().copied())
                    .filter(|(_, tally)| tally.solved > 0)
                    .collect(),
                counters: workspace.counters,
            }
        };
        let pixels = pixels.par_iter();
        pixels.map_init(Workspace::default, one).collect()
    };
    let listed = Listed {
        needed: needed(frame, kinds),
        searches: searches(frame),
    };
    let mut pixels = Vec::new();
    let balance = loop {
        let more = pixels.len().max(FIRST_PIXELS);
        let end = lattice.len().min(pixels.len() + more);
        pixels.extend(run(&lattice[pixels.len()..end]));
        let found = Balance::new(&pixels, &listed, regions.clone(), sparse);
        let samples = pixels.len() as f64 * f64::from(PASSES);
        let spent = samples * (found.cost + found.spent);
        if end == lattice.len() || 2.0 * spent > COST_SHARE * least * found.cost {
            break found;
        }
    };
    let samples = u64::from(PASSES) * pixels.len() as u64;
    let unseen = shared(&listed.searches, MOST_UNSEEN);
    let shares = balance.shares(&unseen);
    let tries =
        Tries::new(kinds, shares).expect("invariant: a share of each kind from each origin");
    Some(TriesChoice::new(tries, samples))
}

/// Kinds of chains as they are known without a pilot.
struct Listed {
    /// See [`needed`].
    needed: Vec<bool>,
    /// Price of a search, by kind.
    searches: Vec<f64>,
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

/// Variance and cost of a sample, as functions of the probabilities.
struct Balance {
    /// Variance of what is no bridge's, relative to the brightness around.
    others: f64,
    /// Cost without bridges.
    cost: f64,
    /// Cost of bridges in the pilot.
    spent: f64,
    /// By origin and kind: second moments at each of [`SHARES`], and the cost if always tried.
    aims: Vec<([f64; SHARES.len()], f64)>,
    needed: Vec<bool>,
}

impl Balance {
    /// From samples that tried kinds as often as `sparse` says, alike from everywhere.
    fn new(pixels: &[Pixel], listed: &Listed, mut regions: Regions, sparse: &Tries) -> Self {
        let needed = &listed.needed;
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
        let mut spent = 0.0;
        for pixel in pixels {
            let own: f64 = pixel.samples.iter().map(|s| s.own).sum::<f64>() / f64::from(PASSES);
            for sample in &pixel.samples {
                // unbiased over the passes of a pixel
                let of_own = (sample.own - own).powi(2) / f64::from(PASSES - 1) * f64::from(PASSES);
                let of_splats = sample.splats.iter().map(|(v, at)| v * v * scale[*at]);
                others.push(of_own * scale[pixel.region] + of_splats.sum::<f64>());
                for made in sample.bridges.iter().filter(|made| made.value != 0.0) {
                    let share = sparse.share(Origin::Start, made.at % sparse.kinds());
                    let moment = made.value * made.value * scale[made.region] / count;
                    for (sum, p) in aims[made.at].0.iter_mut().zip(SHARES) {
                        *sum += moment / (1.0 - made.weight + p / share * made.weight);
                    }
                }
            }
            counters.add(&pixel.counters);
            for &(at, tally) in &pixel.tally {
                let (at, kind) = (at as usize, at as usize % sparse.kinds());
                tallies.solved += tally.solved;
                tallies.rays += tally.rays;
                let price = (listed.searches[kind] * tally.solved as f64
                    + CHAIN * tally.found as f64
                    + SHADOW * tally.rays as f64)
                    / count;
                spent += price;
                aims[at].1 += price / sparse.share(Origin::Start, kind);
            }
        }
        others.sort_by(f64::total_cmp);
        let kept = others.len() - (TRIMMED * others.len() as f64).ceil() as usize;
        // what chains cost is told apart
        counters.shadow_rays -= tallies.rays;
        counters.connections_tried -= tallies.solved;
        let cost = PAIR * counters.paths as f64
            + CLOSEST * counters.closest_rays as f64
            + SHADOW * counters.shadow_rays as f64
            + CONNECTION * counters.connections_tried as f64;
        Self {
            others: others[..kept].iter().sum::<f64>() / count,
            cost: cost / count,
            spent,
            aims,
            needed: needed.clone(),
        }
    }

    /// The probabilities that make variance times cost least, each with the others as they are;
    /// `unseen`, by kind, of what is needed and not seen, and at most [`UNSEEN`].
    fn shares(&self, unseen: &[f64]) -> Vec<f32> {
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
                (false, true) => unseen[at % unseen.len()].min(UNSEEN),
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
    use super::{Balance, SHARES, UNSEEN, shared};

    #[test]
    fn chains_are_tried_as_often_as_they_gain() {
        // what gives a second moment v alone at every probability, or shares it with others
        let alone = |v: f64| SHARES.map(|p| v / p);
        let beside = |v: f64, weight: f64| SHARES.map(|p| v / (1.0 - weight + p * weight));
        let aims = vec![
            // cheap, and nothing else makes it well
            (beside(1.0, 0.99), 0.01),
            // dear, and others make it as well
            (beside(1e-3, 0.1), 5.0),
            // the same where it must not be left out
            (beside(1e-3, 0.1), 5.0),
            // nothing else makes it, dear
            (alone(0.04), 25.0),
            // never seen
            ([0.0; SHARES.len()], 1.0),
            ([0.0; SHARES.len()], 1.0),
        ];
        let balance = Balance {
            others: 1.0,
            cost: 1.0,
            spent: 0.0,
            aims,
            needed: vec![false, false, true, false, true, false],
        };
        let found = balance.shares(&[1.0]);
        assert_eq!(found[..3], [1.0, 0.0, 0.015625]);
        // sqrt(v T / (V t)) is 1/25
        assert_eq!(found[3], 0.03125);
        assert_eq!(found[4..], [UNSEEN as f32, 0.0]);
        assert_eq!(shared(&[1.0; 2], 8.0), [1.0; 2]);
        assert_eq!(shared(&[1.0; 129], 8.0)[0], 0.03125);
        // dear ones less often
        assert_eq!(shared(&[1.0, 4.0, 4.0], 0.75), [0.5, 0.125, 0.125]);
    }
}
