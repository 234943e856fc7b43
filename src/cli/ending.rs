//! Endings of the names of outputs, which must not promise another format than what is written: a
//! slip would take the place of a file of another kind.

use super::CliError;
use std::path::Path;

/// Refuses a name that ends in none of `allowed`; `written` says what the files are.
///
/// # Errors
/// The name has another ending, or none.
pub fn check(path: &Path, written: &str, allowed: &[&str]) -> Result<(), CliError> {
    let has = |ending: &str| {
        let of_path = path.extension();
        of_path.is_some_and(|e| e.eq_ignore_ascii_case(ending))
    };
    if allowed.iter().any(|ending| has(ending)) {
        return Ok(());
    }
    let endings: Vec<String> = allowed.iter().map(|e| format!(".{e}")).collect();
    Err(CliError::Usage(format!(
        "{}: {written} (allowed: a name that ends in {})",
        path.display(),
        endings.join(" or ")
    )))
}

/// The same of an image.
///
/// # Errors
/// The name does not end in `.exr`.
pub fn image(path: &Path) -> Result<(), CliError> {
    check(
        path,
        "images are OpenEXR files, beside which a PNG preview is written",
        &["exr"],
    )
}

/// The same of a drawing.
///
/// # Errors
/// The name does not end in `.svg`.
pub fn drawing(path: &Path) -> Result<(), CliError> {
    check(path, "drawings are SVG files", &["svg"])
}
