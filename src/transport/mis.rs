//! The terms of all strategies of a path: the one place that knows how strategies are weighted.
//!
//! For the executed strategy s the contribution is `T_L T_C g' g' η² G V Tr / Σ_{s'} ρ_{s'} m(s')`
//! with `ρ_{s'} = P̃_{s'}/P̃_s` and `m(s') = n_{s'} · A^{N_r(s')} · c(s') · [executed]`, N_r the
//! number of specular vertices at the joint. The ratios are walked outward from the joined edge,
//! dividing only by densities of vertices that were really generated, so nothing is ever divided by
//! zero and 1/A is never formed.
//!
//! Photon merging at a non-specular x_i adds the term `ρ_i pf_i π r² N_L c`: x_i is generated from
//! both sides (Georgiev et al., "Light Transport Simulation with Vertex Connection and Merging",
//! 2012, eq. 10).
//!
//! A strategy that scatters less than its density says counts more by its variance factor, which is
//! part of its preference ([`Factors`](super::factors::Factors)).
//!
//! The lane multiplicity c(s') counts the wavelengths that could have made the path's lane as their
//! hero: all of them where no dispersive vertex is scattered at, only those of exactly the same
//! wavelength elsewhere. It splits the sum in two: `D_j = shared + own_j`.

use super::class::PathClass;
use super::density::{Bridge, Column, PathView};
use super::factors::FactorKey;
use super::strategies::StrategySet;
use crate::scene::settings::{Heuristic, SingleRule};
use crate::spectrum::{MAX_LANES, SampledWavelengths};

/// The denominators `D_j` of all lanes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Denominator {
    /// Terms that every lane could have made.
    pub shared: f64,
    /// Terms that only lanes of the same wavelength could have made.
    pub own: [f64; MAX_LANES],
    /// Factors of the shared terms by lane, where lanes have chains of their own to the sensor;
    /// else all are 1.
    pub shares: Option<Column>,
    /// Factor on the contribution's numerator: the strategy's preference (1 unless it has a
    /// variance factor, or regularized strategies are weighted down or chosen among), times `m₁(s)`
    /// for the power heuristic.
    pub numerator: f64,
}

impl Denominator {
    /// The factor that turns lane `j`'s numerator into its contribution.
    #[must_use]
    pub fn factor(&self, j: usize) -> f64 {
        if self.numerator == 0.0 {
            // not admitted; then no other strategy need be either
            return 0.0;
        }
        self.numerator / self.sum(j)
    }

    /// `D_j`.
    #[must_use]
    pub fn sum(&self, j: usize) -> f64 {
        self.shared * self.share(j) + self.own[j]
    }

    /// Factor of a term of lane `j`, shared or of its own.
    #[must_use]
    pub fn share_of(&self, is_shared: bool, j: usize) -> f64 {
        if is_shared { self.share(j) } else { 1.0 }
    }

    /// Factor of the shared terms of lane `j`.
    #[must_use]
    pub fn share(&self, j: usize) -> f64 {
        self.shares.map_or(1.0, |shares| shares[j])
    }
}

/// Technique that makes a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Technique {
    /// x₀ ... x_{s−1} from the light, the others from the sensor.
    Join(usize),
    /// x_i from both sides.
    Merge(usize),
    /// x₀ ... x_a from the light, x_b and all after it from the sensor, the chain between them
    /// solved for.
    Bridge(usize, usize),
}

impl Technique {
    /// The one that made a path.
    #[must_use]
    pub fn of(path: &PathView) -> Self {
        match path.made {
            Some(bridge) => Self::Bridge(bridge.a, bridge.b),
            None => Self::Join(path.s()),
        }
    }
}

/// Which of a path's strategies may make it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Admitted {
    /// All that are executed.
    All,
    /// None: it is made by merging.
    None,
    /// Those that join at no specular vertex.
    Unregularized,
    /// One.
    Only(usize),
}

/// Multiplier `m₁(s) = n_s · (A β)^{N_r(s)} · v_s · [executed and admitted]` of every technique of
/// a path.
#[derive(Clone, Copy, Debug)]
pub struct Multipliers<'a> {
    path: &'a PathView<'a>,
    strategies: &'a StrategySet<'a>,
    admitted: Admitted,
    /// Some vertex is specular; without one there is little to ask.
    has_specular: bool,
    /// β: 1 where no unbiased strategy makes the path.
    beta: f64,
    /// v of the strategies s = 0, 1, ...; those that are not there have 1.
    factors: &'a [f32],
    /// `n_s` where it is not worth asking for again.
    rough: Option<RoughSamples>,
}

/// `n_s` of a path without specular vertices, which only at its ends depends on s.
#[derive(Clone, Copy, Debug)]
struct RoughSamples {
    /// s = 0, 1, inner ones, n − 1, n.
    of: [f64; 5],
}

impl RoughSamples {
    fn new(strategies: &StrategySet, n: usize) -> Option<Self> {
        let of = |s| strategies.samples(Technique::Join(s), n, false);
        let inner = if n > 3 { of(2) } else { 0.0 };
        strategies.disabled.is_empty().then(|| Self {
            of: [of(0), of(1), inner, of(n - 1), of(n)],
        })
    }

    #[inline]
    fn at(&self, s: usize, n: usize) -> f64 {
        let place = match s {
            _ if s + 1 >= n => 4 + s - n,
            0 | 1 => s,
            _ => 2,
        };
        self.of[place]
    }
}

impl<'a> Multipliers<'a> {
    /// For a path. Looks at the whole path only where the techniques call for it.
    #[must_use]
    #[inline]
    pub fn new(path: &'a PathView<'a>, strategies: &'a StrategySet<'a>) -> Self {
        let mut out = Self {
            path,
            strategies,
            admitted: Admitted::All,
            has_specular: path.has_specular(),
            beta: 1.0,
            factors: &[],
            rough: None,
        };
        if !out.has_specular {
            out.rough = RoughSamples::new(strategies, path.len());
        }
        if let Some(factors) = strategies.factors {
            let class = if out.has_specular {
                PathClass::of(path)
            } else {
                PathClass::rough(path.len().saturating_sub(2) as u32)
            };
            let key = FactorKey::new(path.emitter, class);
            out.factors = key.map_or(&[], |key| factors.of(key, path.raster));
        }
        if strategies.merges_alone() && out.is_mergeable() {
            out.admitted = Admitted::None;
            return out;
        }
        if strategies.cone.is_none() || !out.has_specular {
            return out;
        }
        if path.fan.is_some() {
            // walks make it, and the others know nothing of the chains of other lanes
            out.admitted = Admitted::Unregularized;
            return out;
        }
        if path.bridges.iter().any(Option::is_some) {
            // perturbed chains whose ends have no exact one would leak
            out.admitted = Admitted::Unregularized;
            return out;
        }
        if let Some(rule) = strategies.single {
            out.admitted = if out.has_unregularized() {
                Admitted::Unregularized
            } else {
                out.single(rule).map_or(Admitted::All, Admitted::Only)
            };
        } else if strategies.bias_weight < 1.0 && out.has_unregularized() {
            out.beta = strategies.bias_weight;
        }
        out
    }

    /// The path.
    #[must_use]
    pub fn path(&self) -> &PathView<'a> {
        self.path
    }

    /// N_r(s): specular ends of strategy `s`. [theory (2.3)]
    #[must_use]
    pub fn regularized(&self, s: usize) -> i32 {
        if !self.has_specular || s == 0 || s == self.path.len() {
            return 0;
        }
        i32::from(self.path.is_specular(s - 1)) + i32::from(self.path.is_specular(s))
    }

    /// Without choice and β: `n_s · A^{N_r(s)} · [executed]`; π r² N_L where merging is done.
    #[must_use]
    pub fn plain(&self, technique: Technique) -> f64 {
        let n = self.path.len();
        match technique {
            Technique::Join(s) => self.plain_join(s),
            Technique::Merge(i) => {
                let samples = self.strategies.samples(technique, n, false);
                let merges = samples > 0.0
                    && (1..n - 1).contains(&i)
                    && !self.path.is_specular(i)
                    && (!self.strategies.merges_first_only()
                        || (i + 1..n - 1).all(|j| self.path.is_specular(j)));
                if merges { samples } else { 0.0 }
            }
            Technique::Bridge(a, b) => {
                let bridges = self.path.bridges.iter().flatten();
                bridges
                    .filter(|bridge| (bridge.a, bridge.b) == (a, b))
                    .map(|bridge| bridge.samples)
                    .sum()
            }
        }
    }

    #[inline]
    fn plain_join(&self, s: usize) -> f64 {
        if let Some(rough) = &self.rough {
            return rough.at(s, self.path.len());
        }
        let regularized = self.regularized(s);
        plain_multiplier(self.strategies, s, self.path.len(), regularized)
    }

    /// Preference, by which a technique is weighted besides its density and A:
    /// `β^{N_r(s)} · v_s · [admitted]`; that of merging is 1, and that of bridges, whose scatter
    /// the pilot does not measure. [theory (2.6), (2.7)]
    #[must_use]
    pub fn preference(&self, technique: Technique) -> f64 {
        match technique {
            Technique::Join(s) => self.preference_of_join(s),
            Technique::Merge(_) | Technique::Bridge(..) => 1.0,
        }
    }

    #[inline]
    fn preference_of_join(&self, s: usize) -> f64 {
        let factor = self.factors.get(s).map_or(1.0, |v| f64::from(*v));
        match self.admitted {
            Admitted::All if self.beta == 1.0 => factor,
            Admitted::All => factor * self.beta.powi(self.regularized(s)),
            Admitted::Unregularized if self.regularized(s) == 0 => factor,
            Admitted::Only(one) if s == one => factor,
            Admitted::None | Admitted::Unregularized | Admitted::Only(_) => 0.0,
        }
    }

    /// `m₁` of a technique. [theory (2.5)]
    #[must_use]
    pub fn of(&self, technique: Technique) -> f64 {
        self.plain(technique) * self.preference(technique)
    }

    /// The same of joining: most terms are of this kind.
    #[inline]
    fn of_join(&self, s: usize) -> f64 {
        self.plain_join(s) * self.preference_of_join(s)
    }

    /// Whether the path can be made at all by strategy `s`: hitting needs something that can be
    /// hit.
    fn is_possible(&self, s: usize) -> bool {
        (s > 0 || self.path.hittable_light) && self.plain_join(s) > 0.0
    }

    /// Whether any scattering vertex is non-specular.
    fn is_mergeable(&self) -> bool {
        (1..self.path.len() - 1).any(|i| !self.path.is_specular(i))
    }

    /// Whether a strategy without regularized vertices makes the path, or merging: a function of
    /// its class alone.
    fn has_unregularized(&self) -> bool {
        self.strategies.merge_samples() > 0.0 && self.is_mergeable()
            || (0..=self.path.len()).any(|s| self.regularized(s) == 0 && self.is_possible(s))
    }

    /// The strategy that makes the path alone, of those with the fewest regularized vertices.
    fn single(&self, rule: SingleRule) -> Option<usize> {
        let possible = || (1..self.path.len()).filter(|&s| self.is_possible(s));
        let fewest = possible().map(|s| self.regularized(s)).min()?;
        let mut candidates = possible().filter(|&s| self.regularized(s) == fewest);
        match rule {
            SingleRule::Light => candidates.next(),
            SingleRule::Camera => candidates.next_back(),
            // of equally long ones the last, as elsewhere the one towards the camera
            SingleRule::ShortestEdge => candidates.rev().min_by(|&a, &b| {
                self.path
                    .edge_length(a)
                    .total_cmp(&self.path.edge_length(b))
            }),
        }
    }
}

/// `n_s · A^{N_r} · [executed]` of strategy `s` of `n` vertices, which joins at N_r = `regularized`
/// specular ones. [theory (2.4), (2.5)]
#[must_use]
pub fn plain_multiplier(strategies: &StrategySet, s: usize, n: usize, regularized: i32) -> f64 {
    if regularized > 0 && strategies.cone.is_none() {
        return 0.0;
    }
    let samples = strategies.samples(Technique::Join(s), n, regularized > 0);
    match (regularized, strategies.cone) {
        (0, _) => samples,
        (_, None) => 0.0,
        (1, Some(cone)) => samples * cone.area,
        (_, Some(cone)) => samples * cone.area * cone.area,
    }
}

/// Calls `term(technique, ρ m₁)` for every technique that could make the path, in no particular
/// order; the executed strategy has ρ = 1.
pub fn for_each_term(multipliers: &Multipliers, mut term: impl FnMut(Technique, f64)) {
    use Technique::{Join, Merge};
    let path = multipliers.path;
    let n = path.len();
    for bridge in path.bridges.iter().flatten() {
        let technique = Technique::Bridge(bridge.a, bridge.b);
        let rho = bridge_ratio(path, bridge);
        term(technique, rho * multipliers.of(technique));
    }
    if let Some(bridge) = &path.made {
        return joins_around(multipliers, bridge, term);
    }
    let s = path.s();
    let merging = multipliers.strategies.merge_samples() > 0.0;
    let m = |i: usize| multipliers.of_join(i);
    term(Join(s), m(s));

    // towards the light: [theory (3.3) left, (3.4), (3.5) left]
    // Direct sampling of x₀ (s' = 1) has a density of its own, which enters where s' = 1 is an end
    // of the walk.
    let pf0 = if s == 1 { path.pf(0) } else { 0.0 };
    let mut rho = 1.0;
    for i in (0..s).rev() {
        if i == 0 {
            // here rho is ρ_1, by emission sampling for s >= 2, by direct sampling for s = 1
            let generated = if s == 1 {
                path.direct
            } else {
                path.light[0].own
            };
            if s >= 2 {
                // ρ_1 was reached with plain pf_0; strategy 1 would have drawn x₀ directly
                term(Join(1), rho * path.direct / generated * m(1));
            }
            term(Join(0), rho * path.pr(0) / generated * m(0));
        } else {
            rho *= path.pr(i) / path.pf(i);
            if rho == 0.0 {
                break;
            }
            if merging {
                // [theory (6.2)]
                term(Merge(i), rho * path.pf(i) * multipliers.of(Merge(i)));
            }
            if i >= 2 {
                term(Join(i), rho * m(i));
            }
        }
    }

    // towards the sensor: [theory (3.3) right, (3.5) right, (3.6)]
    let mut rho = 1.0;
    if s == 1 {
        // strategies s' >= 2 draw x₀ by emission
        rho = pf0 / path.direct;
    }
    for i in s..n {
        if i == 0 {
            let pr0 = path.pr(0);
            term(Join(1), path.direct / pr0 * m(1));
            rho *= path.pf(0) / pr0;
        } else {
            if merging {
                term(Merge(i), rho * path.pf(i) * multipliers.of(Merge(i)));
            }
            rho *= path.pf(i) / path.pr(i);
            term(Join(i + 1), rho * m(i + 1));
        }
        if rho == 0.0 {
            break;
        }
    }
}

/// Share of the weights of a path that the strategies of camera sub-paths alone have: those that
/// hit its light or are joined to it. With only these, the path's contribution would be divided by
/// it.
#[must_use]
pub fn camera_share(multipliers: &Multipliers) -> f64 {
    let heuristic = multipliers.strategies.heuristic;
    let n = multipliers.path.len();
    let (mut own, mut all) = (0.0, 0.0);
    for_each_term(multipliers, |technique, value| {
        let value = heuristic.power(value);
        all += value;
        if let Technique::Join(s @ (0 | 1)) = technique
            && s + 1 < n
        {
            own += value;
        }
    });
    own / all
}

/// `P̃_Bridge/P̃` of a bridge of the path for the technique that made it. [theory (9.4)]
fn bridge_ratio(path: &PathView, bridge: &Bridge) -> f64 {
    let made = path.made.as_ref();
    if made.is_some_and(|made| (made.a, made.b) == (bridge.a, bridge.b)) {
        return 1.0;
    }
    let mut rho = bridge.k / made.map_or(1.0, |made| made.k);
    for i in 0..path.len() {
        let density = if i <= bridge.a {
            path.pf(i)
        } else if i < bridge.b {
            1.0
        } else {
            path.pr(i)
        };
        rho *= density / path.generated(i);
    }
    rho
}

/// The terms of all joints of a path that a bridge made. [theory (9.5)]
fn joins_around(multipliers: &Multipliers, bridge: &Bridge, mut term: impl FnMut(Technique, f64)) {
    use Technique::Join;
    let path = multipliers.path;
    let Bridge { a, b, k, .. } = *bridge;
    let m = |s: usize| multipliers.of_join(s);
    // strategy 1 draws x₀ directly, all others and the bridge as light is emitted
    let drawn = |s: usize| {
        if s == 1 {
            path.direct / path.pf(0)
        } else {
            1.0
        }
    };
    let chain = |s: usize| {
        let density = |i: usize| if i < s { path.pf(i) } else { path.pr(i) };
        (a + 1..b).map(density).product::<f64>() / k
    };
    for s in a + 1..=b {
        term(Join(s), chain(s) * drawn(s) * m(s));
    }
    let mut rho = chain(a + 1);
    for i in (0..=a).rev() {
        rho *= path.pr(i) / path.pf(i);
        if rho == 0.0 {
            break;
        }
        term(Join(i), rho * drawn(i) * m(i));
    }
    let mut rho = chain(b);
    for i in b..path.len() {
        rho *= path.pf(i) / path.pr(i);
        if rho == 0.0 {
            break;
        }
        term(Join(i + 1), rho * m(i + 1));
    }
}

/// Whether every dispersive vertex of the path is an end point of the technique, so that every lane
/// can serve as its hero: "delivers" of [theory (4.3)]. Merging has no end points.
#[must_use]
pub fn serves_all_lanes(path: &PathView, dispersive: usize, technique: Technique) -> bool {
    if dispersive == 0 {
        return true;
    }
    let s = match technique {
        Technique::Join(s) => s,
        Technique::Merge(_) => return false,
        Technique::Bridge(a, b) => {
            // what is inside was made by nobody's hero
            let inside = (a + 1..b).filter(|&i| path.is_dispersive(i)).count();
            return inside == dispersive;
        }
    };
    let n = path.len();
    let at_ends = if s == 0 || s == n {
        0
    } else {
        usize::from(path.is_dispersive(s - 1)) + usize::from(path.is_dispersive(s))
    };
    at_ends == dispersive
}

/// The denominators of all lanes for the executed strategy of the path, with the numerator of its
/// weight. `scratch` is overwritten. [theory (3.1), (3.2)]
#[must_use]
#[inline]
pub fn denominator(
    multipliers: &Multipliers,
    wavelengths: &SampledWavelengths,
    scratch: &mut Vec<f64>,
) -> Denominator {
    let executed = Technique::of(multipliers.path);
    let preference = multipliers.preference(executed);
    let mut out = terms(multipliers, wavelengths, scratch);
    out.numerator = match multipliers.strategies.heuristic {
        Heuristic::VarianceAware | Heuristic::Balance => preference,
        Heuristic::Power2 => preference * multipliers.of(executed),
    };
    out
}

/// Weight, without the lanes, of a path whose x₀ was drawn for x₁ (s = 1), where
/// [`StrategySet::has_two_terms`] and all lanes have one density. `hit`: density of hitting x₀ over
/// that of drawing it.
#[must_use]
#[inline]
pub fn direct_weight(strategies: &StrategySet, hit: f64) -> f64 {
    let hit = if strategies.hits { hit } else { 0.0 };
    1.0 / (1.0 + strategies.heuristic.power(hit))
}

/// The same for merging at x_{s−1}, which camera and light sub-path have both generated; the path
/// is seen as by strategy s, at least 2. [theory (6.3)]
#[must_use]
pub fn merge_denominator(
    multipliers: &Multipliers,
    wavelengths: &SampledWavelengths,
    scratch: &mut Vec<f64>,
) -> Denominator {
    let merged = multipliers.path.s() - 1;
    let from_sensor = multipliers.path.pr(merged);
    let merging = multipliers.of(Technique::Merge(merged));
    Denominator {
        numerator: match multipliers.strategies.heuristic {
            _ if merging == 0.0 => 0.0,
            Heuristic::VarianceAware | Heuristic::Balance => from_sensor,
            Heuristic::Power2 => from_sensor * from_sensor * merging,
        },
        ..terms(multipliers, wavelengths, scratch)
    }
}

/// Sums of the terms, shared by all lanes and of each alone. [theory (4.4)]
fn terms(
    multipliers: &Multipliers,
    wavelengths: &SampledWavelengths,
    scratch: &mut Vec<f64>,
) -> Denominator {
    let path = multipliers.path;
    let heuristic = multipliers.strategies.heuristic;
    let dispersive = if multipliers.has_specular {
        path.dispersive_count()
    } else {
        0
    };
    let mut out = Denominator {
        shares: path.fan.map(|fan| fan.shares),
        ..Denominator::default()
    };
    let count = wavelengths.count();
    if path.has_columns() {
        add_columns(multipliers, wavelengths, dispersive, scratch, &mut out);
        return out;
    }
    let mut own = 0.0;
    for_each_term(multipliers, |technique, value| {
        // of a chain of specular vertices, most cannot be joined
        if value == 0.0 {
            return;
        }
        if dispersive == 0 || serves_all_lanes(path, dispersive, technique) {
            out.shared += heuristic.power(value);
        } else {
            own += heuristic.power(value);
        }
    });
    out.shared *= count as f64;
    if own > 0.0 {
        for j in 0..count {
            out.own[j] = own * wavelengths.multiplicity(j) as f64;
        }
    }
    out
}

/// The terms where densities differ between lanes: lane k's chain of ratios cannot be walked,
/// because its density may be 0 where the hero's is not, so everything is divided by what was
/// really generated (prefix and suffix products). [theory (4.6), (4.7)]
fn add_columns(
    multipliers: &Multipliers,
    wavelengths: &SampledWavelengths,
    dispersive: usize,
    suffix: &mut Vec<f64>,
    out: &mut Denominator,
) {
    use Technique::{Join, Merge};
    let path = multipliers.path;
    let n = path.len();
    let count = wavelengths.count();
    let generated = |i: usize| path.generated(i);
    let scale = path.made.map_or(1.0, |bridge| 1.0 / bridge.k);
    for k in 0..count {
        // suffix[i] = Π_{j >= i} pr_{j,k}/gen_j
        suffix.clear();
        suffix.resize(n + 1, 1.0);
        for i in (0..n).rev() {
            suffix[i] = suffix[i + 1] * path.pr_lane(i, k) / generated(i);
        }
        let mut add = |technique: Technique, value: f64| {
            let value = multipliers.strategies.heuristic.power(value);
            if value == 0.0 {
                return;
            }
            if serves_all_lanes(path, dispersive, technique) {
                out.shared += value;
            } else {
                for j in
                    (0..count).filter(|&j| wavelengths.lambda_nm(j) == wavelengths.lambda_nm(k))
                {
                    out.own[j] += value;
                }
            }
        };
        for bridge in path.bridges.iter().flatten() {
            let technique = Technique::Bridge(bridge.a, bridge.b);
            let before = (0..=bridge.a).map(|i| path.pf_lane(i, k) / generated(i));
            let chain = (bridge.a + 1..bridge.b).map(|i| 1.0 / generated(i));
            let rho = before.chain(chain).product::<f64>() * bridge.k * suffix[bridge.b] * scale;
            add(technique, rho * multipliers.of(technique));
        }
        let mut prefix = 1.0;
        for (technique, &behind) in suffix.iter().enumerate() {
            let emitted = path.pf(0) / generated(0);
            let first = match technique {
                0 => 1.0,
                1 => path.direct / generated(0),
                _ => emitted,
            };
            add(
                Join(technique),
                multipliers.of(Join(technique)) * first * prefix * behind * scale,
            );
            if technique >= 1 && technique < n {
                let merging = multipliers.of(Merge(technique));
                if merging > 0.0 {
                    add(
                        Merge(technique),
                        merging * emitted * prefix * behind * path.pf_lane(technique, k),
                    );
                }
                prefix *= path.pf_lane(technique, k) / generated(technique);
            }
        }
    }
}
