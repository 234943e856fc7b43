//! Lens prescriptions made elsewhere: Zemax `.zmx`, CODE V `.seq`, optiland `.json`.
//!
//! Anything unknown that bends rays is refused by name and line; what does not matter here is
//! passed over and, where it might be missed, said in [`Prescription::notes`]. Glasses come from
//! the library, by catalog where the file names one; a glass that is not there is an error with
//! near names.

mod glass;
pub mod optiland;
pub mod seq;
pub mod zmx;

use super::glass::{decode_text, read_capped};
use crate::optics::{Prescription, PrescriptionError};
use crate::spectrum::Library;
use std::path::Path;
use thiserror::Error;

/// Most surfaces read, coordinate breaks included.
const MAX_SURFACES: usize = 1000;
/// Most coefficients of a surface.
const MAX_COEFFICIENTS: usize = 32;

/// Problem of a lens file, and where.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{line}: {message}")]
pub struct LensError {
    /// Line of the file, counted from 1.
    pub line: usize,
    /// Problem, and the values allowed.
    pub message: String,
}

impl LensError {
    fn new(line: usize, message: impl Into<String>) -> Self {
        Self {
            line,
            message: message.into(),
        }
    }
}

/// Kinds of lens files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Zemax OpticStudio, sequential.
    Zmx,
    /// CODE V command sequence.
    Seq,
    /// optiland.
    Optiland,
}

/// Refusal of a file by its name.
const NO_LENS: &str = "not a lens file (.zmx, .seq, or .json of optiland)";

impl Format {
    /// The format that the extension of a file says.
    fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_string_lossy().to_lowercase();
        match extension.as_str() {
            "zmx" => Some(Self::Zmx),
            "seq" => Some(Self::Seq),
            "json" => Some(Self::Optiland),
            _ => None,
        }
    }
}

/// Reads a lens from the bytes of a file of the name `path`, its kind by its extension.
///
/// # Errors
/// Refusal of the kind of file, or the first thing that is wrong with its line.
pub fn parse_named(bytes: &[u8], path: &Path, library: &Library) -> Result<Prescription, String> {
    let format = Format::of(path).ok_or(NO_LENS)?;
    parse(bytes, format, library).map_err(|e| format!("line {e}"))
}

/// Reads a lens from the bytes of a file and checks it.
///
/// # Errors
/// The first thing that is wrong, with its line.
pub fn parse(bytes: &[u8], format: Format, library: &Library) -> Result<Prescription, LensError> {
    let text = decode_text(bytes);
    let lens = match format {
        Format::Zmx => zmx::parse(&text, library)?,
        Format::Seq => seq::parse(&text, library)?,
        Format::Optiland => optiland::parse(&text, library)?,
    };
    lens.validate().map_err(|error: PrescriptionError| {
        let place = error
            .surface
            .map_or(String::new(), |i| format!("surface {i}: "));
        LensError::new(error.line.max(1), format!("{place}{}", error.message))
    })?;
    Ok(lens)
}

/// Reads a lens file, its kind by its extension.
///
/// # Errors
/// A text that begins with the path: what cannot be read, or is wrong at which line.
pub fn read(path: &Path, library: &Library) -> Result<Prescription, String> {
    let format = Format::of(path).ok_or_else(|| format!("{}: {NO_LENS}", path.display()))?;
    let bytes = read_capped(path).map_err(|e| e.to_string())?;
    let mut lens = parse(&bytes, format, library).map_err(|e| format!("{}:{e}", path.display()))?;
    if lens.name.is_empty() {
        lens.name = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
    }
    Ok(lens)
}

/// Reads any bytes as each kind of lens: must not panic.
pub fn fuzz_lens(bytes: &[u8]) {
    for format in [Format::Zmx, Format::Seq, Format::Optiland] {
        // the outcome does not matter
        _ = parse(bytes, format, Library::embedded());
    }
}

/// A finite number.
fn number(word: &str, line: usize) -> Result<f64, LensError> {
    match word.parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err(LensError::new(
            line,
            format!("`{word}` is not a finite number"),
        )),
    }
}
