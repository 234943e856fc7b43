//! Lens prescriptions: what the paraxial and the real rays of one do.

use abbe::io::lens::read;
use abbe::optics::analysis::{Beams, RINGS};
use abbe::optics::paraxial::Paraxial;
use abbe::optics::{FieldKind, FirstOrder, Prescription};
use abbe::spectrum::Library;
use numpy::{PyArray2, PyArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// A lens prescription. Lengths are millimeters, wavelengths nanometers.
#[pyclass(frozen, module = "abbe")]
pub struct Lens {
    prescription: Prescription,
}

impl Lens {
    fn nm(&self, nm: Option<f64>) -> PyResult<f64> {
        let nm = nm.unwrap_or_else(|| self.prescription.primary_nm());
        if nm.is_finite() && nm > 0.0 {
            return Ok(nm);
        }
        let message = format!("a wavelength of {nm} nm (allowed: above 0)");
        Err(PyValueError::new_err(message))
    }
}

#[pymethods]
impl Lens {
    /// Reads a prescription: Zemax .zmx, CODE V .seq or optiland .json.
    #[new]
    fn new(py: Python, path: PathBuf) -> PyResult<Self> {
        let prescription = py.detach(|| read(&path, Library::embedded()));
        let prescription = prescription.map_err(PyValueError::new_err)?;
        Ok(Self { prescription })
    }

    /// Title.
    #[getter]
    fn name(&self) -> &str {
        &self.prescription.name
    }

    /// Decisions of the reader: model glasses, things passed over.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.prescription.notes.clone()
    }

    /// Wavelengths of the file in nm.
    #[getter]
    fn wavelengths(&self) -> Vec<f64> {
        let all = self.prescription.wavelengths.iter();
        all.map(|w| w.nm).collect()
    }

    /// Fields of the file, x and y, in degrees or mm (see field_unit).
    #[getter]
    fn fields(&self) -> Vec<(f64, f64)> {
        let all = self.prescription.fields.iter();
        all.map(|&[x, y]| (x, y)).collect()
    }

    /// Unit of the fields: "deg", or "mm" of the object or image.
    #[getter]
    fn field_unit(&self) -> &'static str {
        match self.prescription.field_kind {
            FieldKind::AngleDeg => "deg",
            FieldKind::ObjectHeight | FieldKind::ImageHeight => "mm",
        }
    }

    /// Paraxial data at a wavelength in nm (the primary one without): lengths in mm.
    #[pyo3(signature = (nm = None))]
    fn first_order<'py>(&self, py: Python<'py>, nm: Option<f64>) -> PyResult<Bound<'py, PyDict>> {
        let FirstOrder {
            lambda_nm,
            efl,
            bfl,
            ffl,
            principal,
            entrance_pupil,
            exit_pupil,
            f_number,
            image_na,
            image_distance,
            magnification,
            image_height,
            lagrange,
        } = Paraxial::new(&self.prescription, self.nm(nm)?).first_order();
        let out = PyDict::new(py);
        for (key, value) in [
            ("wavelength_nm", lambda_nm),
            ("efl", efl),
            ("bfl", bfl),
            ("ffl", ffl),
            ("front_principal", principal[0]),
            ("rear_principal", principal[1]),
            ("entrance_pupil_position", entrance_pupil.position),
            ("entrance_pupil_diameter", entrance_pupil.diameter),
            ("exit_pupil_position", exit_pupil.position),
            ("exit_pupil_diameter", exit_pupil.diameter),
            ("f_number", f_number),
            ("image_na", image_na),
            ("image_distance", image_distance),
            ("image_height", image_height),
            ("lagrange", lagrange),
        ] {
            out.set_item(key, value)?;
        }
        out.set_item("magnification", magnification)?;
        Ok(out)
    }

    /// Where rays that fill the stop evenly meet the image surface: an array of x and y in mm, a
    /// row each; rays that are stopped are left out.
    #[pyo3(signature = (field = (0.0, 0.0), nm = None, rings = RINGS))]
    fn spot<'py>(
        &self,
        py: Python<'py>,
        field: (f64, f64),
        nm: Option<f64>,
        rings: u32,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        if !(1..=200).contains(&rings) {
            let message = format!("{rings} rings (allowed: 1 to 200)");
            return Err(PyValueError::new_err(message));
        }
        let (nm, lens) = (self.nm(nm)?, &self.prescription);
        let points = py.detach(|| {
            let spot = Beams::new(lens, nm).spot([field.0, field.1], rings);
            spot.points(0.0)
        });
        let flat: Vec<f64> = points.iter().flat_map(|p| [p.x, p.y]).collect();
        numpy::PyArray1::from_vec(py, flat).reshape([points.len(), 2])
    }

    fn __repr__(&self) -> String {
        let lens = &self.prescription;
        let efl = Paraxial::new(lens, lens.primary_nm()).efl();
        format!(
            "<abbe.Lens {}: {} surfaces, focal length {efl:.4} mm>",
            lens.name,
            lens.surfaces.len()
        )
    }
}
