//! Directional albedo of rough surfaces, tabulated for the roughnesses and indices of a scene.
//!
//! A lobe of single scattering loses what its facets mask. How much is a function of the direction,
//! the roughness and the relative index alone, and has no closed form (Kulla and Conty 2017).

pub mod measure;
pub mod profile;

use super::fresnel;
use super::microfacet::Ggx;
use measure::{Shares, single_scattering};
use profile::{Blend, Corners, Pattern};

/// Roughness below which nothing is compensated: a metal loses less than 1e-4 of diffuse light.
pub const NEGLIGIBLE_ALPHA: f64 = 3.9e-3;

/// Knots of roughness from [`NEGLIGIBLE_ALPHA`] to 1, where it varies.
const ALPHAS: usize = 32;
/// Knots of the index from 1 to [`LARGEST_INDEX`], where it varies.
const INDICES: usize = 33;
const LARGEST_INDEX: f64 = 4.0;

/// Roughnesses and indices that are looked up.
#[derive(Clone, Debug, Default)]
pub struct Needs {
    /// Roughnesses of perfect reflectors.
    pub reflectors: Alphas,
    /// Roughnesses of interfaces.
    pub interfaces: Alphas,
    /// Ranges of their indices, denser to rarer side.
    pub ratios: Vec<[f64; 2]>,
    /// Roughnesses of layers.
    pub layers: Alphas,
    /// Their indices, 1 or more.
    pub layer_indices: Vec<f64>,
}

/// Roughnesses that are looked up.
#[derive(Clone, Debug, Default)]
pub struct Alphas {
    /// Ranges of isotropic ones.
    ranges: Vec<[f64; 2]>,
    /// Anisotropic ones.
    pairs: Vec<[f64; 2]>,
}

impl Alphas {
    /// Adds one roughness, along x and y; nothing where it is negligible.
    pub fn add(&mut self, alpha: [f64; 2]) {
        if !is_rough(alpha) {
        } else if alpha[0] == alpha[1] {
            self.ranges.push(alpha);
        } else if !self.pairs.contains(&alpha) {
            self.pairs.push(alpha);
        }
    }

    /// Adds the isotropic roughnesses of a range.
    pub fn add_range(&mut self, range: [f64; 2]) {
        let [low, high] = range.map(|alpha| alpha.clamp(NEGLIGIBLE_ALPHA, 1.0));
        self.ranges.push([low, high]);
    }
}

/// Whether surfaces of this roughness are compensated.
#[must_use]
pub fn is_rough(alpha: [f64; 2]) -> bool {
    alpha[0].max(alpha[1]) >= NEGLIGIBLE_ALPHA
}

/// Knots such that linear interpolation between them is as good as on the standard ones, anywhere
/// in the ranges; the ends of the ranges are knots unless they are too many.
fn knots(ranges: &[[f64; 2]], standard: &[f64]) -> Vec<f64> {
    let within = |x: f64| ranges.iter().any(|r| r[0] < x && x < r[1]);
    let sorted = |mut knots: Vec<f64>| {
        knots.sort_by(f64::total_cmp);
        knots.dedup();
        knots
    };
    let inner = standard.iter().copied().filter(|&x| within(x));
    let exact = sorted(ranges.iter().flatten().copied().chain(inner).collect());
    if exact.len() <= standard.len() {
        return exact;
    }
    let [low, high] = [exact[0], exact[exact.len() - 1]];
    let inner = standard.iter().copied().filter(|&x| low < x && x < high);
    sorted([low, high].into_iter().chain(inner).collect())
}

/// The knots about `x` and their shares; those at the end beyond it.
fn bracket(knots: &[f64], x: f64) -> ArrayOfTwo {
    let above = knots.partition_point(|&k| k < x);
    let mut out = ArrayOfTwo::new();
    if above == 0 || above == knots.len() || knots[above] == x {
        if !knots.is_empty() {
            out.push((above.min(knots.len() - 1), 1.0));
        }
        return out;
    }
    let (a, b) = (knots[above - 1], knots[above]);
    let t = (x - a) / (b - a);
    out.push((above - 1, 1.0 - t));
    out.push((above, t));
    out
}

type ArrayOfTwo = arrayvec::ArrayVec<(usize, f64), 2>;

/// Patterns by roughness and index.
#[derive(Clone, Debug)]
struct Table {
    isotropic: Vec<f64>,
    pairs: Vec<[f64; 2]>,
    indices: Vec<f64>,
    /// Of the patterns, how many a roughness and an index have.
    kinds: usize,
    patterns: Vec<Pattern>,
}

impl Table {
    const EMPTY: Self = Self {
        isotropic: Vec::new(),
        pairs: Vec::new(),
        indices: Vec::new(),
        kinds: 1,
        patterns: Vec::new(),
    };

    /// Tabulates `share` of what light does that arrives in each of the ways of `arrivals` (its
    /// relative index from the index of the table).
    fn new<const N: usize>(
        alphas: &Alphas,
        indices: Vec<f64>,
        arrivals: [fn(f64) -> Option<f64>; N],
        share: fn(Shares) -> f64,
    ) -> Self {
        let step = (1.0 / NEGLIGIBLE_ALPHA).ln() / (ALPHAS - 1) as f64;
        let standard: Vec<f64> = (0..ALPHAS)
            .map(|i| (NEGLIGIBLE_ALPHA.ln() + step * i as f64).exp())
            .collect();
        let isotropic = knots(&alphas.ranges, &standard);
        let pairs = alphas.pairs.clone();
        let all = isotropic.iter().map(|&a| [a, a]).chain(pairs.clone());
        let cases: Vec<([f64; 2], Option<f64>)> = all
            .flat_map(|alpha| indices.iter().map(move |&index| (alpha, index)))
            .flat_map(|(alpha, index)| arrivals.map(|arrival| (alpha, arrival(index))))
            .collect();
        let pattern = |&(alpha, index): &([f64; 2], Option<f64>)| {
            let ggx = Ggx { alpha };
            Pattern::new(alpha[0] == alpha[1], |w| {
                share(single_scattering(&ggx, w, index))
            })
        };
        Self {
            isotropic,
            pairs,
            indices,
            kinds: N,
            patterns: cases.iter().map(pattern).collect(),
        }
    }

    /// The places about a roughness and an index; `None` where the table has nothing for it.
    fn corners(&self, alpha: [f64; 2], index: f64) -> Option<Corners<usize>> {
        let mut alphas = ArrayOfTwo::new();
        if alpha[0] == alpha[1] {
            alphas = bracket(&self.isotropic, alpha[0]);
        } else if let Some(i) = self.pairs.iter().position(|p| *p == alpha) {
            alphas.push((self.isotropic.len() + i, 1.0));
        }
        if alphas.is_empty() || self.indices.is_empty() || !is_rough(alpha) {
            return None;
        }
        let mut out = Corners::new();
        for &(i, a) in &alphas {
            for (j, b) in bracket(&self.indices, index) {
                out.push((i * self.indices.len() + j, a * b));
            }
        }
        Some(out)
    }

    fn blend(&self, corners: &Corners<usize>, kind: usize) -> Blend<'_> {
        let pattern = |&(i, share): &(usize, f64)| (&self.patterns[i * self.kinds + kind], share);
        Blend(corners.iter().map(pattern).collect())
    }
}

/// The tables of a scene.
#[derive(Clone, Debug)]
pub struct AlbedoTables {
    reflectors: Table,
    interfaces: Table,
    layers: Table,
}

/// Tables without entries: rough surfaces scatter once.
pub static NO_ALBEDOS: AlbedoTables = AlbedoTables {
    reflectors: Table::EMPTY,
    interfaces: Table::EMPTY,
    layers: Table::EMPTY,
};

impl AlbedoTables {
    /// Tables for all that is needed.
    #[must_use]
    pub fn new(needs: &Needs) -> Self {
        let step = (LARGEST_INDEX - 1.0) / ((INDICES - 1) * (INDICES - 1)) as f64;
        let standard: Vec<f64> = (0..INDICES).map(|i| 1.0 + step * (i * i) as f64).collect();
        let indices: Vec<[f64; 2]> = needs.layer_indices.iter().map(|&n| [n, n]).collect();
        let lost = |shares: Shares| shares.lost;
        Self {
            reflectors: Table::new(&needs.reflectors, vec![1.0], [|_| None], lost),
            interfaces: Table::new(
                &needs.interfaces,
                knots(&needs.ratios, &standard),
                [|n| Some(n), |n| Some(1.0 / n)],
                lost,
            ),
            layers: Table::new(
                &needs.layers,
                knots(&indices, &standard),
                [|n| Some(n)],
                |shares| shares.reflected,
            ),
        }
    }

    /// The share of light that a perfect reflector loses.
    #[must_use]
    pub fn lost_by_reflector(&self, ggx: &Ggx) -> Option<Blend<'_>> {
        let corners = self.reflectors.corners(ggx.alpha, 1.0)?;
        Some(self.reflectors.blend(&corners, 0))
    }

    /// The shares of light that an interface loses whose denser side has `ratio` times the index
    /// of the other: arriving on the rarer side, and on the denser one.
    #[must_use]
    pub fn lost_by_interface(&self, ggx: &Ggx, ratio: f64) -> Option<[Blend<'_>; 2]> {
        let corners = self.interfaces.corners(ggx.alpha, ratio)?;
        Some([0, 1].map(|side| self.interfaces.blend(&corners, side)))
    }

    /// The share of light that the upper face of a layer of relative `index` reflects at once.
    #[must_use]
    pub fn reflected_by_layer(&self, ggx: &Ggx, index: f64) -> Option<Blend<'_>> {
        let corners = self.layers.corners(ggx.alpha, index)?;
        Some(self.layers.blend(&corners, 0))
    }
}

/// The mean over the hemisphere, weighted by the cosine, of a smooth function of the cosine: Gauss'
/// rule of three points (Abramowitz and Stegun, table 25.8).
pub(super) fn hemisphere_mean(f: impl Fn(f64) -> f64) -> f64 {
    const RULE: [(f64, f64); 3] = [
        (0.212_340_538_2, 0.139_653_959_8),
        (0.590_533_135_6, 0.458_482_212_8),
        (0.911_412_040_5, 0.401_863_827_4),
    ];
    RULE.iter().map(|&(cos, weight)| weight * f(cos)).sum()
}

/// The mean transmittance from the rarer side of an interface of relative index `ratio`.
pub(super) fn mean_transmittance(ratio: f64) -> f64 {
    1.0 - hemisphere_mean(|cos| fresnel::dielectric(cos, 1.0, ratio))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knots_are_exact_until_they_are_too_many() {
        let standard = [1.0, 1.5, 2.0, 3.0];
        assert_eq!(knots(&[[1.2, 1.2]], &standard), [1.2]);
        assert_eq!(
            knots(&[[1.2, 1.2], [1.4, 1.6]], &standard),
            [1.2, 1.4, 1.5, 1.6]
        );
        let many: Vec<[f64; 2]> = (0..9).map(|i| [1.1 + 0.1 * f64::from(i); 2]).collect();
        assert_eq!(knots(&many, &standard), [1.1, 1.5, many[8][0]]);
        assert!(knots(&[], &standard).is_empty());
    }

    #[test]
    fn shares_of_the_knots_sum_to_one() {
        let knots = [1.0, 1.5, 3.0];
        assert!(bracket(&[], 1.0).is_empty());
        for (x, want) in [
            (0.5, 1.0),
            (1.0, 1.0),
            (1.2, 1.2),
            (1.5, 1.5),
            (2.9, 2.9),
            (9.0, 3.0),
        ] {
            let found = bracket(&knots, x);
            let at: f64 = found.iter().map(|&(i, share)| share * knots[i]).sum();
            let sum: f64 = found.iter().map(|&(_, share)| share).sum();
            assert!(
                (at - want).abs() < 1e-12 && (sum - 1.0).abs() < 1e-12,
                "{x}"
            );
        }
    }

    #[test]
    fn nothing_is_tabulated_for_what_needs_nothing() {
        let mut needs = Needs::default();
        needs.reflectors.add([0.0038, 0.0038]);
        let tables = AlbedoTables::new(&needs);
        assert!(tables.reflectors.patterns.is_empty() && tables.interfaces.patterns.is_empty());
        assert!(tables.lost_by_reflector(&Ggx { alpha: [0.3; 2] }).is_none());
        // at the limit a reflector loses 1e-4 of diffuse light
        needs.reflectors.add([NEGLIGIBLE_ALPHA; 2]);
        let tables = AlbedoTables::new(&needs);
        let ggx = Ggx {
            alpha: [NEGLIGIBLE_ALPHA; 2],
        };
        let lost = tables.lost_by_reflector(&ggx).expect("tabulated").mean();
        assert!(lost < 1e-4, "{lost}");
    }

    /// A metal of roughness 1 reflects 1 - ln 2 along the normal, in closed form.
    #[test]
    fn a_reflector_of_roughness_one_has_its_closed_form() {
        let mut needs = Needs::default();
        needs.reflectors.add([1.0, 1.0]);
        let tables = AlbedoTables::new(&needs);
        let lost = tables
            .lost_by_reflector(&Ggx { alpha: [1.0; 2] })
            .expect("tabulated");
        let along_normal = lost.at(glam::DVec3::Z);
        assert!(
            (along_normal - std::f64::consts::LN_2).abs() < 1e-3,
            "{along_normal}"
        );
    }

    #[test]
    fn three_points_are_enough_for_mean_reflectances() {
        // 2/3 of a cosine, exactly, and glass of 1.5: 0.0918
        assert!((hemisphere_mean(|cos| cos) - 2.0 / 3.0).abs() < 1e-9);
        assert!((mean_transmittance(1.5) - 0.9082).abs() < 4e-3);
    }
}
