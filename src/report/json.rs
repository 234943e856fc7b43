//! JSON files of this floor: read typed and capped in size, written at once or not at all.

use super::ReportError;
use crate::io::atomic::{FileError, write_atomic};
use crate::io::files::read_regular;
use serde::de::{Deserialize, DeserializeOwned, Deserializer};
use serde::ser::Serialize;
use std::io::Write as _;
use std::path::Path;

/// Longest file read, in bytes.
const LONGEST: u64 = 1 << 28;

/// Reads a file; `what` names what it should be, for messages.
///
/// # Errors
/// Where the file cannot be read, is too long, or is something else.
pub fn read<T: DeserializeOwned>(path: &Path, what: &str) -> Result<T, ReportError> {
    let text = read_regular(path, LONGEST).map_err(|e| ReportError::file(path, e.to_string()))?;
    serde_json::from_slice(&text)
        .map_err(|e| ReportError::file(path, format!("is not {what}: {e}")))
}

/// Writes a file.
///
/// # Errors
/// Where it cannot be written.
pub fn write(path: &Path, value: &impl Serialize) -> Result<(), FileError> {
    let text = serde_json::to_string_pretty(value);
    let text = text.map_err(|e| FileError::new(path, e.into()))?;
    write_atomic(path, |w| writeln!(w, "{text}"))
}

/// A number, of which JSON has no other word than `null` where it is not finite.
pub fn number<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}
