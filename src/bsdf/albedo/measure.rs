//! Energy of light that meets one facet of a rough surface: quadrature over the facets it sees.

use crate::bsdf::fresnel;
use crate::bsdf::microfacet::Ggx;
use glam::DVec3;

/// Points of the quadrature: rings of the cap of visible facets, and azimuths on each.
const RINGS: u32 = 128;
const AZIMUTHS: u32 = 16;
/// Turn of each ring against the one before, so that the edges of total reflection and of the
/// horizon fall between points differently.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

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
    // mirror images about the plane of incidence give the same
    let is_mirrored = ggx.alpha[0] == ggx.alpha[1] && w.y == 0.0;
    let azimuths = if is_mirrored { AZIMUTHS / 2 } else { AZIMUTHS };
    for ring in 0..RINGS {
        let turn = (0.5 + f64::from(ring) * GOLDEN).fract();
        // closer towards the steepest facets: few, but their light is what is lost
        let rest = 1.0 - (f64::from(ring) + 0.5) / f64::from(RINGS);
        let weight = 2.0 * rest;
        for azimuth in 0..azimuths {
            let u = [
                (f64::from(azimuth) + turn) / f64::from(AZIMUTHS),
                1.0 - rest * rest,
            ];
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
