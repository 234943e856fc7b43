//! Thin sheet: reflection at both faces and straight passage, between equal media.
//!
//! The incoherent sum of all inner reflections is R' = 2R/(1+R), T' = (1-R)/(1+R) for R of one
//! face.

use crate::bsdf::Interface;
use crate::spectrum::SampledSpectrum;

/// Thin sheet of a dielectric.
#[derive(Clone, Copy, Debug)]
pub struct Thin {
    /// Index of the sheet per lane.
    pub n: SampledSpectrum,
    /// Factor on transmission per lane.
    pub transmit_tint: SampledSpectrum,
}

impl Thin {
    /// Reflectance of the sheet at cosine `cos` in lane `k` of the medium on the side `above`.
    pub(super) fn lane_reflectance(
        &self,
        k: usize,
        cos: f64,
        above: bool,
        interface: &Interface,
    ) -> f64 {
        let r = interface.reflectance(cos, [interface.near(above)[k], f64::from(self.n[k])]);
        2.0 * r / (1.0 + r)
    }

    /// Transmittance per lane, tint included.
    pub(super) fn transmittance(
        &self,
        cos: f64,
        above: bool,
        interface: &Interface,
    ) -> SampledSpectrum {
        interface.lanes(|k| 1.0 - self.lane_reflectance(k, cos, above, interface))
            * self.transmit_tint
    }
}
