//! JSON files of this floor: read typed and capped in size, written at once or not at all.

use super::ReportError;
use crate::io::atomic::{FileError, write_atomic};
use serde::de::{Deserialize, DeserializeOwned, Deserializer};
use serde::ser::Serialize;
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::Path;

/// Longest file read, in bytes.
const LONGEST: u64 = 1 << 28;

/// Reads a file; `what` names what it should be, for messages.
///
/// # Errors
/// Where the file cannot be read, is too long, or is something else.
pub fn read<T: DeserializeOwned>(path: &Path, what: &str) -> Result<T, ReportError> {
    let mut text = String::new();
    File::open(path)
        .and_then(|file| file.take(LONGEST + 1).read_to_string(&mut text))
        .map_err(|e| ReportError::file(path, e.to_string()))?;
    if text.len() as u64 > LONGEST {
        let message = format!("is longer than {} MB", LONGEST >> 20);
        return Err(ReportError::file(path, message));
    }
    serde_json::from_str(&text).map_err(|e| ReportError::file(path, format!("is not {what}: {e}")))
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
