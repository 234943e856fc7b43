//! Continuous spectra: a number for every wavelength.

use super::{SampledSpectrum, SampledWavelengths};

/// A smooth or tabulated function of the wavelength in nanometres.
#[derive(Clone, Debug, PartialEq)]
pub enum Curve {
    /// The same value everywhere.
    Constant(f64),
    // H1: Regular { first_nm, step_nm, values }, Table { nm, values }, Blackbody { temp_k, scale },
    // Sigmoid { c: [f64; 3] } (RGB upsampling), Scaled/Product where needed
}

impl Curve {
    /// The value at `lambda_nm`. Tables interpolate linearly and hold their end values.
    #[must_use]
    pub fn eval(&self, _lambda_nm: f64) -> f64 {
        todo!()
    }

    /// The values at the wavelengths of a path.
    #[must_use]
    pub fn sample(&self, wavelengths: &SampledWavelengths) -> SampledSpectrum {
        match self {
            Self::Constant(v) => SampledSpectrum::splat(*v as f32),
        }
    }
}
