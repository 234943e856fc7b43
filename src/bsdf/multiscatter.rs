//! Multiple scattering between the facets of a rough surface: light that lobes of single scattering
//! lose, given back.
//!
//! With L the share lost for a direction, and L̄ its mean over the hemisphere of a side, the kernel
//! between two directions is a constant of their sides times L(ω⁻) L(ω⁺): symmetric, and of albedo
//! L (Kulla and Conty 2017, Revisiting Physically Based Shading at Imageworks). Of light that met
//! facets of reflectance F̄ in the mean, F̄²(1 - L̄)/(1 - F̄ L̄) is left (Fdez-Agüera 2019, A
//! Multiple-Scattering Microfacet Model for Real-Time Image-based Lighting).
//!
//! Through an interface the flux exchanged in diffuse light is the same both ways. It is taken as
//! η² T̄ min(L̄₁, L̄₂) of either side, for η² T̄ is that of a smooth interface: no side then passes
//! more than it has, and what it does not pass it reflects.

use super::albedo::profile::Blend;
use super::albedo::{AlbedoTables, hemisphere_mean, mean_transmittance};
use super::microfacet::Ggx;
use glam::DVec3;
use std::f64::consts::FRAC_1_PI;

/// Share left, in [0, 1], of light that facets of a metal held back, where they lose the mean share
/// `lost` and have `reflectance` by the cosine.
#[must_use]
pub fn share_left(lost: f64, reflectance: impl Fn(f64) -> f64) -> f64 {
    let mean = hemisphere_mean(reflectance);
    mean * mean * (1.0 - lost) / (1.0 - mean * lost)
}

/// Multiple scattering by facets that reflect.
#[derive(Clone, Debug)]
pub struct Reflection<'a>(Blend<'a>);

impl<'a> Reflection<'a> {
    /// Reflection after several facets of `ggx`; `None` where the tables have nothing for it.
    #[must_use]
    pub fn new(tables: &'a AlbedoTables, ggx: &Ggx) -> Option<Self> {
        tables.lost_by_reflector(ggx).map(Self)
    }

    /// Mean share of diffuse light that facets hold back.
    #[must_use]
    pub fn lost(&self) -> f64 {
        self.0.mean()
    }

    /// Kernel of a perfect reflector in a medium of index 1, between directions on one side.
    #[must_use]
    pub fn kernel(&self, a: DVec3, b: DVec3) -> f64 {
        self.0.at(a) * self.0.at(b) * FRAC_1_PI / self.0.mean()
    }

    /// Probability with which it is drawn for a given direction: the share of a perfect reflector.
    #[must_use]
    pub fn probability(&self, given: DVec3) -> f64 {
        self.0.at(given)
    }

    /// Density of [`Reflection::generate`], per solid angle.
    #[must_use]
    pub fn density(&self, w: DVec3) -> f64 {
        self.0.density(w)
    }

    /// A direction above the surface.
    #[must_use]
    pub fn generate(&self, u: [f64; 2]) -> DVec3 {
        self.0.sample(u)
    }
}

/// Multiple scattering by facets between two media, one of which is that above.
#[derive(Clone, Debug)]
pub struct Exchange<'a> {
    /// Shares lost by single scattering: above, below.
    lost: [Blend<'a>; 2],
    /// η² L̄: above, below.
    flux: [f64; 2],
    /// Flux that passes through, the same from both sides.
    passed: f64,
}

impl<'a> Exchange<'a> {
    /// Exchange after several facets of `ggx` between media of index `eta` above and below; `None`
    /// where the tables have nothing for it.
    #[must_use]
    pub fn new(tables: &'a AlbedoTables, ggx: &Ggx, eta: [f64; 2]) -> Option<Self> {
        let rarer_is_above = eta[0] <= eta[1];
        let [rarer, denser] = if rarer_is_above {
            eta
        } else {
            [eta[1], eta[0]]
        };
        let mut lost = tables.lost_by_interface(ggx, denser / rarer)?;
        let least = lost[0].mean().min(lost[1].mean());
        if !rarer_is_above {
            lost.swap(0, 1);
        }
        let flux = [0, 1].map(|side| eta[side] * eta[side] * lost[side].mean());
        Some(Self {
            lost,
            flux,
            passed: rarer * rarer * mean_transmittance(denser / rarer) * least,
        })
    }

    /// Kernel g between two directions.
    #[must_use]
    pub fn kernel(&self, a: DVec3, b: DVec3) -> f64 {
        let [i, j] = [a, b].map(side);
        let lost = self.lost[i].at(a) * self.lost[j].at(b);
        lost * self.share_to(i, j) * FRAC_1_PI / self.flux[j]
    }

    /// Share that leaves to side `to` of the light that arrives on side `from` and is held back.
    fn share_to(&self, from: usize, to: usize) -> f64 {
        let passed = self.passed / self.flux[from];
        if from == to { 1.0 - passed } else { passed }
    }

    /// Probability with which it is drawn for a given direction: what single scattering loses.
    #[must_use]
    pub fn probability(&self, given: DVec3) -> f64 {
        self.lost[side(given)].at(given)
    }

    /// Density of [`Exchange::generate`], per solid angle.
    #[must_use]
    pub fn density(&self, given: DVec3, w: DVec3) -> f64 {
        let [i, j] = [given, w].map(side);
        self.share_to(i, j) * self.lost[j].density(w)
    }

    /// A direction for light given on the side `above` or not, as if that were up: on the same side
    /// if its z is positive.
    #[must_use]
    pub fn generate(&self, above: bool, u: [f64; 3]) -> DVec3 {
        let near = usize::from(!above);
        let far = 1 - near;
        if u[0] < self.share_to(near, far) {
            let w = self.lost[far].sample([u[1], u[2]]);
            DVec3::new(w.x, w.y, -w.z)
        } else {
            self.lost[near].sample([u[1], u[2]])
        }
    }
}

/// Index of the side a direction is on: 0 above, 1 below.
fn side(w: DVec3) -> usize {
    usize::from(w.z < 0.0)
}

#[cfg(test)]
mod tests;
