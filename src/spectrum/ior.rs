//! Refractive index and extinction of a material as functions of wavelength.

/// A complex refractive index n + i k; real catalogue glasses are relative to air.
#[derive(Clone, Debug, PartialEq)]
pub struct Ior {
    // H1: name, formula (constant | refractiveindex.info formulas 1-6 | table), coefficients, fitted range, k table, provenance
}

impl Ior {
    /// A wavelength-independent real index.
    #[must_use]
    pub fn constant(_n: f64) -> Self {
        todo!()
    }

    /// The index n at `lambda_nm`. Finite and >= 1 over the working range (checked when the scene is built).
    #[must_use]
    pub fn n(&self, _lambda_nm: f64) -> f64 {
        todo!()
    }

    /// The extinction coefficient k at `lambda_nm` (0 where the material has no k table; end values held).
    #[must_use]
    pub fn k(&self, _lambda_nm: f64) -> f64 {
        todo!()
    }

    /// Whether n varies with wavelength.
    #[must_use]
    pub fn is_dispersive(&self) -> bool {
        todo!()
    }

    /// Whether there is a k table with a non-zero entry.
    #[must_use]
    pub fn is_absorbing(&self) -> bool {
        todo!()
    }

    // H1: abbe_number(), fitted_range_nm(), validate(range_nm) -> Result<Option<extrapolated stretch>, IorError>, source
}
