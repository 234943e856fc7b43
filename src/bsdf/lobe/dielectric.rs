//! Smooth interface between two dielectrics.
//!
//! Reflection or transmission is chosen by the reflectance averaged over the lanes, that of the
//! coating where there is one: the choice does not depend on which of them is the hero, only the
//! refracted direction does.

use crate::bsdf::Interface;
use crate::spectrum::SampledSpectrum;

/// Smooth dielectric interface.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Factor on reflection per lane.
    pub reflect_tint: SampledSpectrum,
    /// Factor on transmission per lane.
    pub transmit_tint: SampledSpectrum,
}

impl Dielectric {
    /// Without tint.
    pub const CLEAR: Self = Self {
        reflect_tint: SampledSpectrum::ONE,
        transmit_tint: SampledSpectrum::ONE,
    };

    /// Reflectance per lane at cosine `cos` on the side `above`, tint included.
    pub(super) fn reflectance(
        &self,
        cos: f64,
        above: bool,
        interface: &Interface,
    ) -> SampledSpectrum {
        interface.lanes(|k| interface.response(k, cos, above)[0]) * self.reflect_tint
    }

    /// Transmittance per lane for light arriving at cosine `cos` on the side `above`, tint
    /// included.
    pub(super) fn transmittance(
        &self,
        cos: f64,
        above: bool,
        interface: &Interface,
    ) -> SampledSpectrum {
        interface.lanes(|k| interface.response(k, cos, above)[1]) * self.transmit_tint
    }
}
