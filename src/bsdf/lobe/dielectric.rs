//! Smooth interface between two dielectrics.
//!
//! Reflection or transmission is chosen by the Fresnel reflectance averaged over the lanes: the
//! choice does not depend on which of them is the hero, only the refracted direction does.

use crate::bsdf::{Interface, fresnel};
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
    /// Reflectance per lane at cosine `cos` on the side `above`, tint included.
    pub(super) fn reflectance(
        &self,
        cos: f64,
        above: bool,
        interface: &Interface,
    ) -> SampledSpectrum {
        let (near, far) = interface.sides(above);
        interface.lanes(|k| fresnel::dielectric(cos, near[k], far[k])) * self.reflect_tint
    }

    /// Transmittance per lane for light arriving at cosine `cos` on the side `above`, tint
    /// included.
    pub(super) fn transmittance(
        &self,
        cos: f64,
        above: bool,
        interface: &Interface,
    ) -> SampledSpectrum {
        let (near, far) = interface.sides(above);
        interface.lanes(|k| 1.0 - fresnel::dielectric(cos, near[k], far[k])) * self.transmit_tint
    }
}
