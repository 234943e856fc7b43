//! Refractive indices.

use abbe::spectrum::ior::LINE_D_NM;
use abbe::spectrum::{Ior, Library};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyLookupError;
use pyo3::prelude::*;

/// A refractive index as a function of the vacuum wavelength.
#[pyclass(frozen, module = "abbe")]
pub struct Glass {
    ior: Ior,
}

#[pymethods]
impl Glass {
    /// Name with its catalog, such as "schott:N-SF11".
    #[getter]
    fn name(&self) -> &str {
        self.ior.name()
    }

    /// Where the data come from.
    #[getter]
    fn source(&self) -> &str {
        self.ior.source()
    }

    /// Index at the d line of helium, 587.5618 nm.
    #[getter]
    fn n_d(&self) -> f64 {
        self.ior.n(LINE_D_NM)
    }

    /// Abbe number V_d = (n_d - 1)/(n_F - n_C).
    #[getter]
    fn abbe_number(&self) -> f64 {
        self.ior.abbe_number()
    }

    /// Wavelengths in nm over which the data were fitted, or None where there is no such range.
    #[getter]
    fn range_nm(&self) -> Option<(f64, f64)> {
        self.ior.fitted_range_nm().map(|[low, high]| (low, high))
    }

    /// Index at one wavelength in nm.
    fn n_at(&self, nm: f64) -> f64 {
        self.ior.n(nm)
    }

    /// Extinction coefficient at one wavelength in nm; 0 where there are no data.
    fn k_at(&self, nm: f64) -> f64 {
        self.ior.k(nm)
    }

    /// Index at many wavelengths in nm.
    fn n_of<'py>(&self, py: Python<'py>, nm: PyReadonlyArray1<f64>) -> Bound<'py, PyArray1<f64>> {
        let n: Vec<f64> = nm.as_array().iter().map(|&nm| self.ior.n(nm)).collect();
        n.into_pyarray(py)
    }

    /// Extinction coefficient at many wavelengths in nm.
    fn k_of<'py>(&self, py: Python<'py>, nm: PyReadonlyArray1<f64>) -> Bound<'py, PyArray1<f64>> {
        let k: Vec<f64> = nm.as_array().iter().map(|&nm| self.ior.k(nm)).collect();
        k.into_pyarray(py)
    }

    fn __repr__(&self) -> String {
        let (name, n, v) = (self.name(), self.n_d(), self.abbe_number());
        format!("<abbe.Glass {name}: n_d {n:.6}, V_d {v:.2}>")
    }
}

/// A glass, crystal, liquid or metal of the built-in library by name.
#[pyfunction]
pub fn glass(name: &str) -> PyResult<Glass> {
    let ior = Library::embedded().ior(name);
    let ior = ior.map_err(|e| PyLookupError::new_err(e.to_string()))?;
    Ok(Glass { ior })
}

/// Names of all of them.
#[pyfunction]
pub fn glass_names() -> Vec<String> {
    let all = Library::embedded().glasses();
    all.map(|ior| ior.name().to_owned()).collect()
}
