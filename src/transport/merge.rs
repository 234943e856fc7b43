//! Photon merging in constant time per photon: the terms of all techniques on either side of the
//! merged vertex as prefix sums.
//!
//! Relative to P̃_i pf_i (x_i generated from both sides) a technique on the light side has the
//! factor 1/pf_i, then pr_{i−1}/pf_{i−1}, and so on outward; only pr_{i−1} depends on the sensor
//! side, by the density of direction at x_i. So that side's terms are `first + pdf · rest` with two
//! numbers known once the light sub-path has arrived at x_i, and likewise on the sensor side. This
//! is the recursive form of Georgiev et al., "Light Transport Simulation with Vertex Connection and
//! Merging" (2012), with the number of wavelengths that a technique serves kept apart.
//!
//! Invariant: equal to the ratio sum of [`mis`](super::mis), which remains for paths whose
//! densities differ between lanes.

use super::density::VertexDensity;
use super::mis::plain_multiplier;
use super::strategies::StrategySet;
use crate::scene::settings::Heuristic;
use crate::spectrum::{MAX_LANES, SampledWavelengths};

/// The terms of all techniques on one side of a merged vertex, that of merging itself not among
/// them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SideTerms {
    /// The strategy that joins at the merged vertex and the one before it on this side.
    pub first: f64,
    /// Sum of all others per unit of the density of direction at the merged vertex towards this
    /// side (per its power, by the heuristic).
    pub rest: f64,
    /// The part of `rest` from techniques that join at every dispersive vertex of this side, so all
    /// lanes share it.
    pub rest_shared: f64,
    /// Whether all dispersive vertices of this side are end points of the first.
    pub first_shared: bool,
    /// Whether there is any dispersive vertex on this side.
    pub dispersive: bool,
}

/// Which side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MergeSide {
    /// Vertices from the light; the density of x₀ by direct sampling over that by emission.
    Light {
        /// `direct / pf_0`.
        direct: f64,
    },
    /// Vertices from the sensor.
    Sensor,
}

/// The terms of the side whose vertices `densities` holds, from its end point to the merged vertex,
/// at least two. `factor` turns a density of direction at the merged vertex into the one of the
/// vertex before it. [theory (6.4)]
#[must_use]
pub fn side_terms(
    densities: &[VertexDensity],
    factor: f64,
    side: MergeSide,
    strategies: &StrategySet,
) -> SideTerms {
    let power = |value| strategies.heuristic.power(value);
    let last = densities.len() - 1;
    let inner = |c: usize| (1..last).contains(&c);
    let is_specular = |c: usize| inner(c) && densities[c].label.is_specular();
    let is_dispersive = |c: usize| inner(c) && densities[c].dispersive;
    let dispersive = (1..last).filter(|&c| is_dispersive(c)).count();
    // the strategy with c vertices on this side: it joins vertex c − 1 to vertex c, unless it has
    // none
    let ends = |c: usize, is: &dyn Fn(usize) -> bool| match c {
        0 => 0,
        _ => usize::from(is(c - 1)) + usize::from(is(c)),
    };
    let multiplier = |c: usize| {
        let regularized = ends(c, &is_specular) as i32;
        match side {
            _ if strategies.merges_alone() => 0.0,
            // the merged vertex and all on the other side are at least two
            MergeSide::Light { direct } if c == 1 => {
                direct * plain_multiplier(strategies, 1, 3, regularized)
            }
            MergeSide::Light { .. } => plain_multiplier(strategies, c, c + 2, regularized),
            MergeSide::Sensor => plain_multiplier(strategies, 2, c + 2, regularized),
        }
    };
    let is_shared = |c: usize| ends(c, &is_dispersive) == dispersive;
    let mut rho = 1.0 / densities[last].own;
    let mut out = SideTerms {
        first: power(rho * multiplier(last)),
        first_shared: is_shared(last),
        dispersive: dispersive > 0,
        ..SideTerms::default()
    };
    rho *= factor / densities[last - 1].own;
    for c in (0..last).rev() {
        if rho == 0.0 {
            break;
        }
        if c >= 1 && !is_specular(c) && !strategies.merges_first_only() {
            let merge = power(rho * densities[c].own * strategies.merge_samples());
            out.rest += merge;
            if dispersive == 0 {
                out.rest_shared += merge;
            }
        }
        let join = power(rho * multiplier(c));
        out.rest += join;
        if is_shared(c) {
            out.rest_shared += join;
        }
        if c >= 1 {
            rho *= densities[c - 1].other / densities[c - 1].own;
        }
    }
    out
}

/// The factors that turn each lane's `T_L T_C g` into its contribution. `toward_light` and
/// `toward_sensor` are the densities of direction at the merged vertex, each of the direction it
/// names given the other. [theory (6.3), (6.5) to (6.7)]
#[must_use]
pub fn merge_factors(
    light: &SideTerms,
    sensor: &SideTerms,
    (toward_light, toward_sensor): (f64, f64),
    strategies: &StrategySet,
    wavelengths: &SampledWavelengths,
) -> [f64; MAX_LANES] {
    let power = |value| strategies.heuristic.power(value);
    let (toward_light, toward_sensor) = (power(toward_light), power(toward_sensor));
    let own_term = power(strategies.merge_samples());
    let all = own_term
        + light.first
        + toward_light * light.rest
        + sensor.first
        + toward_sensor * sensor.rest;
    let numerator = match strategies.heuristic {
        Heuristic::VarianceAware | Heuristic::Balance => 1.0,
        Heuristic::Power2 => strategies.merge_samples(),
    };
    let count = wavelengths.count();
    if !light.dispersive && !sensor.dispersive {
        // any lane's hero could have made all
        return [numerator / (count as f64 * all); MAX_LANES];
    }
    let mut shared = 0.0;
    if !sensor.dispersive {
        shared += toward_light * light.rest_shared;
        if light.first_shared {
            shared += light.first;
        }
    }
    if !light.dispersive {
        shared += toward_sensor * sensor.rest_shared;
        if sensor.first_shared {
            shared += sensor.first;
        }
    }
    let own = (all - shared).max(0.0);
    let mut factors = [0.0; MAX_LANES];
    for (j, factor) in factors.iter_mut().enumerate().take(count) {
        *factor = numerator / (count as f64 * shared + wavelengths.multiplicity(j) as f64 * own);
    }
    factors
}

/// Whether the sums above hold for all paths: the techniques depend on nothing that only the whole
/// path tells.
#[must_use]
pub fn is_separable(strategies: &StrategySet) -> bool {
    let whole =
        strategies.cone.is_some() && (strategies.single.is_some() || strategies.bias_weight < 1.0);
    strategies.disabled.is_empty() && strategies.factors.is_none() && !whole
}
