//! Choices that a render makes before its first pass, by pilots: the first cone, the radius of
//! merging, the variance factors of the weights, the roulette threshold. All passes share them, so
//! that who renders some of the passes elsewhere can be told them instead of finding them again.

use super::effort::{can_do_without, has_choice};
use super::variance::{self, cells, has_factors};
use super::{
    EffortChoice, EpsilonChoice, PilotPasses, RadiusChoice, TriesChoice, VarianceFactors, effort,
    epsilon, merging, metropolis, pilot, tries,
};
use crate::film::Crop;
use crate::integrator::SensorJob;
use crate::light::LightId;
use crate::math::exact;
use crate::spectrum::SensorResponse;
use crate::transport::Cone;
use crate::transport::class::PathClass;
use crate::transport::factors::{Cells, FactorKey, Factors};
use serde::{Deserialize, Serialize};

/// Results of the pilots of a render.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choices {
    /// ε₁ of regularized renders.
    pub epsilon: Option<EpsilonChoice>,
    /// r₁ of renders with merging.
    pub radius: Option<RadiusChoice>,
    /// How often chains are solved for, where any are.
    pub tries: Option<TriesChoice>,
    /// Variance factors of the weights, where they have any.
    pub factors: Option<VarianceFactors>,
    /// Light sub-paths and pairs of a sample, where they are chosen.
    pub effort: Option<EffortChoice>,
    /// Share of contributions below which roulette decides on their shadow rays, in Y.
    #[serde(with = "exact")]
    pub roulette_threshold: f64,
    /// Mean brightness of a sample, roughly, where Markov chains draw samples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brightness: Option<Brightness>,
}

/// The constant by which ordinary samples and those of Markov chains are weighted together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Brightness(#[serde(with = "exact")] pub f64);

impl Choices {
    /// Runs the pilots.
    pub(super) fn find(
        frame: SensorJob,
        crop: Crop,
        response: SensorResponse,
        pilot: PilotPasses,
    ) -> Self {
        let sparse = tries::sparse(&frame);
        let mut aiming = frame;
        aiming.strategies.tries = sparse.as_ref();
        let epsilon = is_regularized(&aiming).then(|| epsilon::choose(&aiming, response));
        let cone = epsilon.as_ref().map(|e| Cone::new(e.epsilon));
        let radius = merges(&aiming).then(|| merging::choose_radius(&aiming, response));
        let tries = tries::choose(&aiming, crop, cone, response, pilot);
        aiming.strategies.tries = tries.as_ref().map(|found| &found.tries);
        let factors = variance::choose(&aiming, crop, cone, response, pilot);
        let given = factors.as_ref().map(|found| &found.factors);
        let effort = effort::choose(&aiming, given, crop, cone, response, pilot);
        let roulette_threshold = pilot::roulette_threshold(&aiming, cone, response);
        let brightness = aiming.settings.integrator.runs_chains().then(|| {
            let mut weighted = aiming.clone();
            weighted.strategies.factors = given;
            Brightness(metropolis::mean_brightness(&weighted, crop, cone, response))
        });
        Self {
            epsilon,
            radius,
            tries,
            factors,
            effort,
            roulette_threshold,
            brightness,
        }
    }

    /// Whether these can be the choices of a render: those that it makes, and numbers in range.
    pub(super) fn fit(&self, frame: &SensorJob, crop: Crop) -> bool {
        let Self {
            epsilon,
            radius,
            tries,
            factors,
            effort,
            roulette_threshold,
            brightness,
        } = self;
        let is_positive = |v: f64| v > 0.0 && v.is_finite();
        epsilon.is_some() == is_regularized(frame)
            && radius.is_some() == merges(frame)
            && tries.is_some() == frame.strategies.aims.any()
            && tries
                .as_ref()
                .is_none_or(|found| found.kinds == frame.scene.chains().kinds().len())
            && factors.is_some() == has_factors(frame)
            && epsilon.as_ref().is_none_or(|e| is_positive(e.epsilon))
            && radius.as_ref().is_none_or(|r| is_positive(r.radius))
            && effort.as_ref().is_none_or(|e| {
                let in_range = |v: f64, most: f64| v > 0.0 && v <= most;
                let is_none = e.light_paths == 0.0 && e.pairs == 0.0;
                let is_some = in_range(e.light_paths, 16.0) && in_range(e.pairs, 1.0);
                has_choice(frame) && (is_some || is_none && can_do_without(frame))
            })
            && *roulette_threshold >= 0.0
            && brightness.is_some() == frame.settings.integrator.runs_chains()
            && brightness.is_none_or(|b| is_positive(b.0))
            && factors.as_ref().is_none_or(|found| {
                let (has, own) = (found.factors.cells(), cells(crop));
                // by rule there is one cell for all of the film
                let one = crop.width().max(crop.height());
                has.first == own.first
                    && has.size == own.size
                    && (has.side == own.side || has.side == one)
            })
    }
}

fn is_regularized(frame: &SensorJob) -> bool {
    frame.regularization.mode.is_some()
}

fn merges(frame: &SensorJob) -> bool {
    frame.strategies.merge.is_some()
}

/// Variance factors as they are written: bits of numbers in single precision.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Written {
    passes: u32,
    samples: u64,
    first: [u32; 2],
    size: [u32; 2],
    side: u32,
    kinds: Vec<WrittenKind>,
    roulette: Vec<u32>,
}

/// Factors of one kind of paths, in the order in which they were found.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenKind {
    light: u8,
    /// Labels from the light on: specular or not.
    specular: Vec<bool>,
    values: Vec<u32>,
}

fn to_bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

fn to_numbers(bits: &[u32]) -> Vec<f32> {
    bits.iter().map(|b| f32::from_bits(*b)).collect()
}

impl From<VarianceFactors> for Written {
    fn from(found: VarianceFactors) -> Self {
        let factors = &found.factors;
        let Cells { first, size, side } = *factors.cells();
        let kind = |(key, _): &(FactorKey, f32)| WrittenKind {
            light: key.light(),
            specular: key.class().labels().collect(),
            values: to_bits(factors.of_key(*key)),
        };
        Self {
            passes: found.passes.0,
            samples: found.samples,
            first,
            size,
            side,
            kinds: found.found.iter().map(kind).collect(),
            roulette: to_bits(factors.roulette()),
        }
    }
}

impl TryFrom<Written> for VarianceFactors {
    type Error = &'static str;

    fn try_from(written: Written) -> Result<Self, &'static str> {
        let Written { first, size, .. } = written;
        if written.side == 0 || size.contains(&0) {
            return Err("the cells of the variance factors are empty");
        }
        let cells = Cells {
            first,
            size,
            side: written.side,
        };
        let wrong = "the variance factors do not fit their cells";
        let (mut factors, mut found) = (Factors::new(cells), Vec::new());
        for kind in &written.kinds {
            let mut class = PathClass::new();
            kind.specular.iter().for_each(|&s| class.push(s));
            let key = FactorKey::new(LightId(kind.light.into()), class).ok_or(wrong)?;
            let values = to_numbers(&kind.values);
            factors.insert(key, &values).map_err(|_| wrong)?;
            found.push((key, values.iter().copied().fold(1.0, f32::max)));
        }
        let roulette = to_numbers(&written.roulette);
        if !roulette.iter().all(|v| *v >= 0.0) {
            return Err("a roulette threshold is below 0");
        }
        if !roulette.is_empty() {
            factors.bound_roulette(roulette).map_err(|_| wrong)?;
        }
        Ok(Self {
            factors,
            passes: PilotPasses::known(written.passes).ok_or("no pilot has so many passes")?,
            samples: written.samples,
            found,
        })
    }
}
