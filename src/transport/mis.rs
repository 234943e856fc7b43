//! The terms of all strategies of a path: the one place that knows how strategies are weighted.
//!
//! For the executed strategy s the contribution is `T_L T_C g' g' η² G V Tr / Σ_{s'} ρ_{s'} m(s')` with `ρ_{s'} = P̃_{s'}/P̃_s` and
//! `m(s') = n_{s'} · A^{N_r(s')} · c(s') · [executed]`: the ratios are walked outward from the joined edge, dividing only by densities
//! of vertices that were really generated, so nothing is ever divided by zero and 1/A is never formed.
//!
//! The lane multiplicity c(s') counts the wavelengths that could have made the path's lane as their hero: all of them where no
//! dispersive vertex is scattered at, only those of exactly the same wavelength elsewhere. It splits the sum in two:
//! `D_j = shared + own_j`.

use super::density::PathView;
use super::techniques::Techniques;
use crate::scene::settings::Heuristic;
use crate::spectrum::{MAX_LANES, SampledWavelengths};

/// The denominators `D_j` of all lanes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Denominator {
    /// Terms that every lane could have made.
    pub shared: f64,
    /// Terms that only lanes of the same wavelength could have made.
    pub own: [f64; MAX_LANES],
    /// Factor on the contribution's numerator: 1 for the balance heuristic, `m₁(s)` for the power heuristic.
    pub numerator: f64,
}

impl Denominator {
    /// The factor that turns lane `j`'s numerator into its contribution.
    #[must_use]
    pub fn factor(&self, j: usize) -> f64 {
        self.numerator / (self.shared + self.own[j])
    }
}

/// `m₁(s) = n_s · A^{N_r(s)} · [executed]` for a path.
#[must_use]
pub fn multiplier(path: &PathView, techniques: &Techniques, s: usize) -> f64 {
    let n = path.len();
    let samples = techniques.samples(s, n - s);
    if samples == 0.0 || s == 0 || s == n {
        return samples;
    }
    let regularized = u8::from(path.is_specular(s - 1)) + u8::from(path.is_specular(s));
    match (regularized, techniques.cone_area) {
        (0, _) => samples,
        (_, None) => 0.0,
        (1, Some(area)) => samples * area,
        (_, Some(area)) => samples * area * area,
    }
}

/// Calls `term(s', ρ_{s'} m₁(s'))` for every strategy of the path, in no particular order; the executed one has ρ = 1.
pub fn for_each_term(path: &PathView, techniques: &Techniques, mut term: impl FnMut(usize, f64)) {
    let n = path.len();
    let s = path.s();
    let m = |i: usize| multiplier(path, techniques, i);
    term(s, m(s));

    // Direct sampling of x₀ (s' = 1) has a density of its own, which enters where s' = 1 is an end of the walk.
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
                term(1, rho * path.direct / generated * m(1));
            }
            term(0, rho * path.pr(0) / generated * m(0));
        } else {
            rho *= path.pr(i) / path.pf(i);
            if rho == 0.0 {
                break;
            }
            if i >= 2 {
                term(i, rho * m(i));
            }
        }
    }

    let mut rho = 1.0;
    if s == 1 {
        // strategies s' >= 2 draw x₀ by emission
        rho = pf0 / path.direct;
    }
    for i in s..n {
        if i == 0 {
            let pr0 = path.pr(0);
            term(1, path.direct / pr0 * m(1));
            rho *= path.pf(0) / pr0;
        } else {
            rho *= path.pf(i) / path.pr(i);
            term(i + 1, rho * m(i + 1));
        }
        if rho == 0.0 {
            break;
        }
    }
}

/// Whether every dispersive vertex of the path is an end point of strategy `s`, so that every lane can serve as its hero.
fn delivers_to_all(path: &PathView, dispersive: usize, s: usize) -> bool {
    if dispersive == 0 {
        return true;
    }
    let n = path.len();
    let at_ends = if s == 0 || s == n {
        0
    } else {
        usize::from(path.is_dispersive(s - 1)) + usize::from(path.is_dispersive(s))
    };
    at_ends == dispersive
}

/// The denominators of all lanes for the executed strategy of the path.
#[must_use]
pub fn denominator(
    path: &PathView,
    techniques: &Techniques,
    wavelengths: &SampledWavelengths,
) -> Denominator {
    let power = |v: f64| match techniques.heuristic {
        Heuristic::Balance => v,
        Heuristic::Power2 => v * v,
    };
    let dispersive = (0..path.len()).filter(|&i| path.is_dispersive(i)).count();
    let mut out = Denominator {
        numerator: match techniques.heuristic {
            Heuristic::Balance => 1.0,
            Heuristic::Power2 => multiplier(path, techniques, path.s()),
        },
        ..Denominator::default()
    };
    let count = wavelengths.count();
    if path.has_columns() {
        add_columns(path, techniques, wavelengths, dispersive, power, &mut out);
        return out;
    }
    let mut own = 0.0;
    for_each_term(path, techniques, |s, value| {
        if delivers_to_all(path, dispersive, s) {
            out.shared += power(value);
        } else {
            own += power(value);
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

/// The terms where densities differ between lanes: lane k's chain of ratios cannot be walked, because its density may be 0
/// where the hero's is not, so everything is divided by what was really generated (prefix and suffix products).
fn add_columns(
    path: &PathView,
    techniques: &Techniques,
    wavelengths: &SampledWavelengths,
    dispersive: usize,
    power: impl Fn(f64) -> f64,
    out: &mut Denominator,
) {
    let n = path.len();
    let s = path.s();
    let count = wavelengths.count();
    // what generated x₀: direct sampling for s = 1
    let generated = |i: usize| match (i, s) {
        (0, 1) => path.direct,
        _ if i < s => path.pf(i),
        _ => path.pr(i),
    };
    for k in 0..count {
        // suffix[i] = Π_{j >= i} pr_{j,k}/gen_j
        let mut suffix = vec![1.0; n + 1];
        for i in (0..n).rev() {
            suffix[i] = suffix[i + 1] * path.pr_lane(i, k) / generated(i);
        }
        let mut prefix = 1.0;
        for (technique, &behind) in suffix.iter().enumerate() {
            let first = match technique {
                0 => 1.0,
                1 => path.direct / generated(0),
                _ => path.pf(0) / generated(0),
            };
            let value = multiplier(path, techniques, technique) * first * prefix * behind;
            if value > 0.0 {
                if delivers_to_all(path, dispersive, technique) {
                    out.shared += power(value);
                } else {
                    for j in
                        (0..count).filter(|&j| wavelengths.lambda_nm(j) == wavelengths.lambda_nm(k))
                    {
                        out.own[j] += power(value);
                    }
                }
            }
            if technique >= 1 && technique < n {
                prefix *= path.pf_lane(technique, k) / generated(technique);
            }
        }
    }
}
