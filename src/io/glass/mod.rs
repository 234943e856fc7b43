//! Glass catalogs made elsewhere: AGF files and refractiveindex.info YAML, and folders of them.

pub mod agf;
pub mod refractiveindex;

use crate::spectrum::{Ior, Library};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Largest catalog file read, bytes.
pub const MAX_FILE_BYTES: u64 = 16 << 20;
/// Most files of a catalog folder.
const MAX_FILES: usize = 10_000;

/// Problem of a catalog file, and where.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{line}: {message}")]
pub struct CatalogError {
    /// Line of the file, counted from 1.
    pub line: usize,
    /// Problem, and the values allowed.
    pub message: String,
}

/// A catalog file with an error, or that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}:{message}", path.display())]
pub struct CatalogFileError {
    /// The file or folder.
    pub path: PathBuf,
    /// Problem.
    pub message: String,
}

/// A number of a catalog file.
fn number(word: &str, line: usize) -> Result<f64, CatalogError> {
    match word.parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err(CatalogError {
            line,
            message: format!("`{word}` is not a finite number"),
        }),
    }
}

/// Text of bytes that are UTF-16 with a byte order mark, UTF-8, or else one byte per character
/// (Windows-1252 without its rare punctuation), as lens and glass files come.
#[must_use]
pub fn decode_text(bytes: &[u8]) -> String {
    let units = |from: fn([u8; 2]) -> u16| -> String {
        let units = bytes[2..].chunks_exact(2).map(|c| from([c[0], c[1]]));
        char::decode_utf16(units)
            .map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER))
            .collect()
    };
    match bytes {
        [0xff, 0xfe, ..] => units(u16::from_le_bytes),
        [0xfe, 0xff, ..] => units(u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => String::from_utf8_lossy(rest).into_owned(),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => text.to_owned(),
            Err(_) => bytes.iter().map(|&b| char::from(b)).collect(),
        },
    }
}

/// Reads a file of at most [`MAX_FILE_BYTES`].
///
/// # Errors
/// If it is larger or cannot be read.
pub fn read_capped(path: &Path) -> Result<Vec<u8>, CatalogFileError> {
    super::files::read_regular(path, MAX_FILE_BYTES).map_err(|e| CatalogFileError {
        path: path.to_owned(),
        message: format!(" {e}"),
    })
}

/// The glasses of a catalog file, qualified with the name of the file without its extension:
/// `mine.agf` holds `mine:NAME`, and `catalog/NAME.yml` is `catalog:NAME`.
///
/// # Errors
/// If it cannot be read or is not well formed, with the line.
pub fn read_file(path: &Path) -> Result<Vec<Ior>, CatalogFileError> {
    let text = decode_text(&read_capped(path)?);
    let stem = |p: &Path| {
        p.file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let glasses = match extension.as_deref() {
        Some("agf") => agf::parse(&text, &stem(path).to_lowercase()),
        Some("toml") => {
            return crate::spectrum::library::parse_glass_toml(&text).map_err(|e| {
                CatalogFileError {
                    path: path.to_owned(),
                    message: e.to_string(),
                }
            });
        }
        _ => {
            let folder = path.parent().map(stem).unwrap_or_default().to_lowercase();
            let name = format!("{folder}:{}", stem(path));
            refractiveindex::parse(&text)
                .map(|ior| vec![ior.named(name, path.display().to_string())])
        }
    };
    glasses.map_err(|e| CatalogFileError {
        path: path.to_owned(),
        message: e.to_string(),
    })
}

/// Adds all catalogs of a folder and of the folders in it (`.agf`, `.yml`, `.yaml`, `.toml`) to a
/// library.
///
/// # Errors
/// If the folder or a file in it cannot be read or is not well formed.
pub fn add_folder(library: &mut Library, folder: &Path) -> Result<(), CatalogFileError> {
    let list = |folder: &Path| -> Result<Vec<PathBuf>, CatalogFileError> {
        let error = |e: std::io::Error| CatalogFileError {
            path: folder.to_owned(),
            message: format!(" {e}"),
        };
        let mut paths = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(error)? {
            if paths.len() == MAX_FILES {
                return Err(CatalogFileError {
                    path: folder.to_owned(),
                    message: format!(" more than {MAX_FILES} files"),
                });
            }
            paths.push(entry.map_err(error)?.path());
        }
        paths.sort();
        Ok(paths)
    };
    for path in list(folder)? {
        let files = if path.is_dir() {
            list(&path)?
        } else {
            vec![path]
        };
        for file in files {
            let extension = file.extension().map(|e| e.to_string_lossy().to_lowercase());
            if matches!(extension.as_deref(), Some("agf" | "yml" | "yaml" | "toml")) {
                for glass in read_file(&file)? {
                    library.add_glass(glass);
                }
            }
        }
    }
    Ok(())
}

/// Reads any bytes as each kind of catalog: must not panic.
pub fn fuzz_catalog(bytes: &[u8]) {
    let text = decode_text(bytes);
    // the outcomes do not matter
    _ = agf::parse(&text, "fuzz");
    _ = refractiveindex::parse(&text);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_of_catalogs_is_added() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("lab");
        std::fs::create_dir(&inner).unwrap();
        let yaml = "DATA:\n  - type: formula 5\n    wavelength_range: 0.4 0.7\n    coefficients: 1.5 0.01 -2\n";
        std::fs::write(inner.join("X-1.yml"), yaml).unwrap();
        let agf = "NM A1 5 0 1.5 60 0\nCD 1.5 0.01 0\nLD 0.4 0.7\n";
        // UTF-16 as some programs write it
        let wide: Vec<u8> = agf.encode_utf16().flat_map(u16::to_le_bytes).collect();
        std::fs::write(
            folder.path().join("Mine.AGF"),
            [&[0xff, 0xfe][..], &wide].concat(),
        )
        .unwrap();
        let mut library = Library::embedded().clone();
        add_folder(&mut library, folder.path()).unwrap();
        assert!((library.ior("lab:X-1").unwrap().n(500.0) - 1.54).abs() < 1e-14);
        assert!((library.ior("mine:A1").unwrap().n(500.0) - 1.52).abs() < 1e-14);
        std::fs::write(folder.path().join("bad.agf"), "NM\n").unwrap();
        let error = add_folder(&mut library, folder.path()).unwrap_err();
        assert!(error.to_string().contains("bad.agf:1: "), "{error}");
    }
}
