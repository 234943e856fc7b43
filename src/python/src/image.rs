//! Images: their values as arrays, pictures of them, their files.

use abbe::develop::{Development, Display, Exposure, ToneCurve, White};
use abbe::io::atomic::write_atomic;
use abbe::io::exr::{self, ExrImage, MetadataValue, spectral_channel_nm};
use abbe::io::image::{development, read};
use abbe::io::png::{Depth, developed_bytes, picture_bytes};
use abbe::math::image_error::ImageError;
use abbe::math::named::Named;
use abbe::report::compare::{Xyz, errors};
use abbe::report::figure::figure;
use numpy::{IntoPyArray as _, PyArray3, PyArrayMethods as _};
use numpy::{PyReadonlyArray3, PyUntypedArrayMethods as _};
use pyo3::exceptions::{PyKeyError, PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::io::Write as _;
use std::path::PathBuf;

/// Image of a render or of a file.
#[pyclass(frozen, module = "abbe")]
pub struct Image {
    image: ExrImage,
    spectral: Option<ExrImage>,
    error: Option<f64>,
    statistics: String,
}

impl Image {
    /// An image with its spectral image, estimated relative error, and statistics as JSON.
    pub fn new(
        image: ExrImage,
        spectral: Option<ExrImage>,
        error: Option<f64>,
        statistics: String,
    ) -> Self {
        Self {
            image,
            spectral,
            error,
            statistics,
        }
    }

    fn size(&self) -> [usize; 2] {
        let crop = self.image.crop;
        [crop.height() as usize, crop.width() as usize]
    }

    fn development(
        &self,
        exposure: Option<f64>,
        tone: Option<&str>,
        white: &str,
        display: &str,
    ) -> PyResult<Development> {
        let base = development(&self.image);
        let wrong = |e: String| PyValueError::new_err(format!("white \"{white}\": {e}"));
        Ok(Development {
            exposure: match exposure {
                None => base.exposure,
                Some(stops) if stops.abs() <= 1000.0 => Exposure::Stops(stops),
                Some(stops) => {
                    let message = format!("an exposure of {stops} stops (allowed: -1000 to 1000)");
                    return Err(PyValueError::new_err(message));
                }
            },
            tone: named("tone curve", tone, base.tone)?,
            white: white.parse::<White>().map_err(wrong)?,
            display: named("display", Some(display), Display::Srgb)?,
        })
    }

    /// Interleaved XYZ of the image or of a layer.
    fn xyz(&self, layer: Option<&str>) -> PyResult<Vec<f64>> {
        let xyz = match layer {
            None => self.image.xyz(),
            Some(name) => self.image.layer_xyz(name),
        };
        xyz.ok_or_else(|| {
            let there = self.channels().join(", ");
            PyKeyError::new_err(format!("no such layer (channels: {there})"))
        })
    }
}

fn os_error(error: impl std::fmt::Display) -> PyErr {
    PyOSError::new_err(error.to_string())
}

/// Wavelength in nm of a spectral channel, and whether it is an emission line.
fn wavelength(name: &str) -> Option<(f64, bool)> {
    match name.strip_prefix("line.") {
        Some(line) => Some((spectral_channel_nm(line)?, true)),
        None => Some((spectral_channel_nm(name)?, false)),
    }
}

/// PNG bytes, pixels, stops of exposure, share of clipped pixels.
type Developed<'py> = (Bound<'py, PyBytes>, Bound<'py, PyArray3<u16>>, f64, f64);

/// The fields of [`ImageError`], in their order.
type ErrorTuple = (f64, f64, f64, f64, f64, u64);

/// A choice by its name.
fn named<T: Named>(what: &str, name: Option<&str>, otherwise: T) -> PyResult<T> {
    let Some(name) = name else {
        return Ok(otherwise);
    };
    T::named(name).ok_or_else(|| {
        let names: Vec<&str> = T::ALL.iter().map(|v| v.as_str()).collect();
        let there = names.join(", ");
        PyValueError::new_err(format!("{what} \"{name}\" (allowed: {there})"))
    })
}

#[pymethods]
impl Image {
    /// Reads an EXR image or a part.
    #[staticmethod]
    fn read(py: Python, path: PathBuf) -> PyResult<Self> {
        let image = py.detach(|| read(&path)).map_err(os_error)?;
        Ok(Self::new(image, None, None, "{}".to_owned()))
    }

    /// Rows and columns.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        let [rows, columns] = self.size();
        (rows, columns)
    }

    /// Column and row of the film at which the image begins.
    #[getter]
    fn origin(&self) -> (u32, u32) {
        (self.image.crop.x0, self.image.crop.y0)
    }

    /// Names of the channels.
    #[getter]
    fn channels(&self) -> Vec<&str> {
        let channels = self.image.channels.iter();
        channels.map(|c| c.name.as_str()).collect()
    }

    /// Values of some channels, the last axis: rows x columns x channels.
    fn stack<'py>(
        &self,
        py: Python<'py>,
        names: Vec<String>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let missing = |name: &str| {
            let there = self.channels().join(", ");
            PyKeyError::new_err(format!("no channel \"{name}\" (there: {there})"))
        };
        let find = |name: &String| self.image.channel(name).ok_or_else(|| missing(name));
        let channels = names.iter().map(find).collect::<PyResult<Vec<_>>>()?;
        self.stacked(py, &channels)
    }

    /// Wavelengths of the spectral image in nm: centers of the bins, and emission lines.
    #[getter]
    fn wavelengths(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let channels = &self.spectral.as_ref()?.channels;
        let all = || channels.iter().filter_map(|c| wavelength(&c.name));
        let of = |line: bool| all().filter(move |w| w.1 == line).map(|w| w.0).collect();
        Some((of(false), of(true)))
    }

    /// The spectral image: bins (mean per nm), or emission lines (power).
    fn spectrum<'py>(&self, py: Python<'py>, lines: bool) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let channels = self.spectral.iter().flat_map(|image| &image.channels);
        let of_kind = channels.filter(|c| wavelength(&c.name).is_some_and(|w| w.1 == lines));
        let values: Vec<&[f32]> = of_kind.map(|c| c.values.as_slice()).collect();
        self.stacked(py, &values)
    }

    /// Attributes.
    #[getter]
    fn attributes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let out = PyDict::new(py);
        for (name, value) in &self.image.metadata.entries {
            match value {
                MetadataValue::Text(text) => out.set_item(name, text),
                MetadataValue::Integer(n) => out.set_item(name, n),
                MetadataValue::Real(x) => out.set_item(name, x),
                MetadataValue::Pair([a, b]) => out.set_item(name, (a, b)),
            }?;
        }
        Ok(out)
    }

    /// Estimated relative error, or None while it is unknown.
    #[getter]
    fn error(&self) -> Option<f64> {
        self.error
    }

    /// Statistics of the render as JSON.
    #[getter]
    fn statistics(&self) -> &str {
        &self.statistics
    }

    /// A copy with other values of X, Y and Z, and attributes more.
    fn replaced(
        &self,
        xyz: PyReadonlyArray3<f32>,
        attributes: Vec<(String, String)>,
    ) -> PyResult<Self> {
        let [rows, columns] = self.size();
        if xyz.shape() != [rows, columns, 3] {
            let message = format!("an array of {:?} for {:?}", xyz.shape(), [rows, columns, 3]);
            return Err(PyValueError::new_err(message));
        }
        let mut image = self.image.clone();
        for (c, name) in ["X", "Y", "Z"].into_iter().enumerate() {
            let values: Vec<f32> = xyz.as_array().iter().skip(c).step_by(3).copied().collect();
            for channel in image.channels.iter_mut().filter(|ch| ch.name == name) {
                channel.values.clone_from(&values);
            }
        }
        let added = attributes.into_iter();
        let added = added.map(|(name, value)| (name, MetadataValue::Text(value)));
        image.metadata.entries.extend(added);
        Ok(Self::new(image, None, None, self.statistics.clone()))
    }

    /// Writes the image as EXR, and the spectral image beside it.
    fn save(&self, py: Python, path: PathBuf) -> PyResult<()> {
        py.detach(|| {
            exr::write(&path, &self.image)?;
            match &self.spectral {
                Some(spectral) => exr::write(&path.with_extension("spectral.exr"), spectral),
                None => Ok(()),
            }
        })
        .map_err(os_error)
    }

    /// A picture: PNG bytes, pixels (rows x columns x 3, 8 or 16 bits), stops of exposure, and the
    /// share of clipped pixels.
    #[pyo3(signature = (exposure, tone, white, display, depth, layer))]
    #[allow(clippy::too_many_arguments, reason = "Python names them")]
    fn develop<'py>(
        &self,
        py: Python<'py>,
        exposure: Option<f64>,
        tone: Option<&str>,
        white: &str,
        display: &str,
        depth: u8,
        layer: Option<&str>,
    ) -> PyResult<Developed<'py>> {
        let depth = match depth {
            8 => Depth::Eight,
            16 => Depth::Sixteen,
            _ => {
                let message = format!("a depth of {depth} bits (allowed: 8, 16)");
                return Err(PyValueError::new_err(message));
            }
        };
        let development = self.development(exposure, tone, white, display)?;
        let xyz = self.xyz(layer)?;
        let size = (self.image.crop.width(), self.image.crop.height());
        let (png, picture) = py.detach(|| {
            let picture = development.develop(&xyz);
            (
                picture_bytes(size, &picture, development.display, depth),
                picture,
            )
        });
        let png = PyBytes::new(py, &png.map_err(os_error)?);
        let words = if depth == Depth::Eight {
            picture.bytes_8().into_iter().map(u16::from).collect()
        } else {
            picture.words
        };
        let [rows, columns] = self.size();
        let pixels = words.into_pyarray(py).reshape([rows, columns, 3])?;
        Ok((png, pixels, picture.stops, picture.clipped))
    }

    /// A figure as SVG: the picture, its scale, values along the row and the column of a pixel, the
    /// flux of a detector.
    #[pyo3(signature = (title, exposure, tone, layer, at))]
    fn figure(
        &self,
        py: Python,
        title: &str,
        exposure: Option<f64>,
        tone: Option<&str>,
        layer: Option<&str>,
        at: Option<[u32; 2]>,
    ) -> PyResult<String> {
        let development = self.development(exposure, tone, "none", "srgb")?;
        let xyz = self.xyz(layer)?;
        let size = (self.image.crop.width(), self.image.crop.height());
        py.detach(|| {
            let png = developed_bytes(size, &xyz, &development).map_err(os_error)?;
            let wrong = |e: String| PyValueError::new_err(format!("the image {e}"));
            figure(&self.image, &xyz, &png, title, at).map_err(wrong)
        })
    }

    /// Names of tone curves and displays.
    #[staticmethod]
    fn choices() -> (Vec<&'static str>, Vec<&'static str>) {
        (
            ToneCurve::ALL.iter().map(|v| v.as_str()).collect(),
            Display::ALL.iter().map(|v| v.as_str()).collect(),
        )
    }
}

impl Image {
    fn stacked<'py>(
        &self,
        py: Python<'py>,
        channels: &[&[f32]],
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let [rows, columns] = self.size();
        let flat = py.detach(|| {
            let pixels = 0..rows * columns;
            let of_pixel = |i: usize| channels.iter().map(move |values| values[i]);
            pixels.flat_map(of_pixel).collect::<Vec<f32>>()
        });
        flat.into_pyarray(py)
            .reshape([rows, columns, channels.len()])
    }
}

/// Writes bytes to a file, which is whole or as it was.
#[pyfunction]
pub fn write_bytes(py: Python, path: PathBuf, bytes: &[u8]) -> PyResult<()> {
    py.detach(|| write_atomic(&path, |file| file.write_all(bytes)))
        .map_err(os_error)
}

/// Errors of X, Y and Z against a reference of the same size: relMSE, relMSE without the worst
/// 0.1 % of the pixels, RMSE, log-RMSE, mean ratio, fireflies.
#[pyfunction]
pub fn compare(
    py: Python,
    image: PyReadonlyArray3<f64>,
    reference: PyReadonlyArray3<f64>,
) -> PyResult<Vec<ErrorTuple>> {
    let of = |array: &PyReadonlyArray3<f64>| match *array.shape() {
        [rows, columns, 3] if rows * columns > 0 => Ok(Xyz {
            size: (columns as u32, rows as u32),
            values: array.as_array().iter().copied().collect(),
            of: [None, None],
        }),
        _ => {
            let message = format!(
                "an array of {:?} (allowed: rows x columns x 3)",
                array.shape()
            );
            Err(PyValueError::new_err(message))
        }
    };
    let (image, reference) = (of(&image)?, of(&reference)?);
    if image.size != reference.size {
        let message = format!("{:?} and {:?} pixels differ", image.size, reference.size);
        return Err(PyValueError::new_err(message));
    }
    let tuple = |e: ImageError| {
        let ImageError {
            rel_mse,
            trimmed_rel_mse,
            rmse,
            log_rmse,
            mean_ratio,
            fireflies,
        } = e;
        (
            rel_mse,
            trimmed_rel_mse,
            rmse,
            log_rmse,
            mean_ratio,
            fireflies,
        )
    };
    Ok(py.detach(|| errors(&image, &reference).map(tuple).to_vec()))
}
