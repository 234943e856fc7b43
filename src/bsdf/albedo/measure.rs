//! Energy of light that meets one facet of a rough surface: quadrature over the facets it sees.

use crate::bsdf::fresnel;
use crate::bsdf::microfacet::Ggx;
use glam::DVec3;

/// Points of the quadrature, in azimuth and in height of the visible cap.
const POINTS: [u32; 2] = [32, 32];

/// Shares of the light that arrives from one direction.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shares {
    /// Leaves on its own side.
    pub reflected: f64,
    /// Meets another facet: neither reflected nor transmitted by the lobe of single scattering.
    pub lost: f64,
}

/// Shares of the light from `w` (w.z > 0) after one facet, of an interface of relative index
/// `index` (far side to near side), or of a perfect reflector (`None`).
#[must_use]
pub fn single_scattering(ggx: &Ggx, w: DVec3, index: Option<f64>) -> Shares {
    let (mut sum, mut weights) = (Shares::default(), 0.0);
    let midpoint = |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(n);
    // mirror images about the plane of incidence give the same
    let is_mirrored = ggx.alpha[0] == ggx.alpha[1] && w.y == 0.0;
    let turns = if is_mirrored {
        POINTS[0] / 2
    } else {
        POINTS[0]
    };
    for i in 0..turns {
        for j in 0..POINTS[1] {
            // closer towards the steepest facets: few, but their light is what is lost
            let rest = 1.0 - midpoint(j, POINTS[1]);
            let weight = 3.0 * rest * rest;
            let u = [midpoint(i, POINTS[0]), 1.0 - rest * rest * rest];
            let m = ggx.sample_visible(w, u);
            let cos = w.dot(m).clamp(0.0, 1.0);
            let reflectance = index.map_or(1.0, |index| fresnel::dielectric(cos, 1.0, index));
            let mirrored = 2.0 * cos * m - w;
            let seen = if mirrored.z > 0.0 {
                ggx.unmasked(w, mirrored)
            } else {
                0.0
            };
            let refracted = index.and_then(|index| fresnel::refract(w, m, 1.0, index));
            let passes = match refracted {
                Some(refracted) if refracted.z < 0.0 => ggx.unmasked(w, refracted),
                _ => 0.0,
            };
            sum.reflected += weight * reflectance * seen;
            sum.lost += weight * reflectance * (1.0 - seen);
            sum.lost += weight * (1.0 - reflectance) * (1.0 - passes);
            weights += weight;
        }
    }
    Shares {
        reflected: sum.reflected / weights,
        lost: sum.lost / weights,
    }
}
