//! Emission spectra: a continuous part per nanometre and exact lines.

use super::{Curve, SampledSpectrum, SampledWavelengths};

/// One emission line: all its power at one wavelength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Wavelength in nanometres.
    pub lambda_nm: f64,
    /// Power of the line, in the continuous part's unit times nanometres.
    pub value: f64,
}

/// What a light emits: the sum of a continuous part and of lines, times `scale`.
///
/// The two parts live on different parts of the wavelength measure (Lebesgue + one atom per line): at an
/// atom only lines emit, elsewhere only the continuous part does. They are never added.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Emission {
    /// Per nanometre.
    pub continuous: Option<Curve>,
    /// Sorted by wavelength, without repetition.
    pub lines: Vec<Line>,
    /// Factor on both parts.
    pub scale: f64,
}

impl Emission {
    /// The values at the wavelengths of a path (line power at atoms, density elsewhere).
    #[must_use]
    pub fn sample(&self, _wavelengths: &SampledWavelengths) -> SampledSpectrum {
        todo!()
    }

    /// Luminance-like power: integral over 360..830 nm against x̄+ȳ+z̄ (both parts), in the unit of the values × nm.
    /// Used for choosing lights, never for a result.
    #[must_use]
    pub fn visible_power(&self) -> f64 {
        todo!()
    }
}
