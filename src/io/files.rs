//! Files that a scene names: inside its folder, of bounded size.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Component, Path, PathBuf};

/// Largest scene file.
pub const MAX_SCENE_BYTES: u64 = 16 << 20;
/// Most tables and lists of a scene file, which take far more memory than their text.
pub const MAX_SCENE_LISTS: usize = 600_000;
/// Largest table of a spectrum or an index.
pub const MAX_CSV_BYTES: u64 = 16 << 20;
/// Largest mesh file.
pub const MAX_OBJ_BYTES: u64 = 2 << 30;

/// Why a file that another one names cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FileProblem {
    /// A file that is not there.
    #[error("file \"{0}\" not found (paths are relative to the scene file)")]
    Missing(String),
    /// A path that leaves the folder of the scene file.
    #[error(
        "file \"{0}\" is outside the scene's folder (allowed: a relative path without \"..\" into the folder of the scene file)"
    )]
    OutsideFolder(String),
    /// A file above its size limit.
    #[error("file \"{path}\" has {bytes} bytes (allowed: at most {limit})")]
    TooLarge {
        /// The path as written.
        path: String,
        /// Size of the file.
        bytes: u64,
        /// The limit in bytes.
        limit: u64,
    },
    /// A file that is there but cannot be used.
    #[error("file \"{path}\": {message}")]
    Bad {
        /// The path as written.
        path: String,
        /// Problem, with the line where known.
        message: String,
    },
}

/// The file `name` in `folder`, which must be a plain relative path that does not leave the folder,
/// also not by a symbolic link, and at most `limit` bytes.
pub fn find(folder: &Path, name: &str, limit: u64) -> Result<PathBuf, FileProblem> {
    let plain = |c: Component<'_>| matches!(c, Component::Normal(_) | Component::CurDir);
    if !Path::new(name).components().all(plain) || name.contains('\\') {
        return Err(FileProblem::OutsideFolder(name.to_owned()));
    }
    let missing = |_| FileProblem::Missing(name.to_owned());
    let folder = folder.canonicalize().map_err(missing)?;
    let path = folder.join(name).canonicalize().map_err(missing)?;
    if !path.starts_with(&folder) {
        return Err(FileProblem::OutsideFolder(name.to_owned()));
    }
    let metadata = path.metadata().map_err(missing)?;
    if !metadata.is_file() {
        return Err(FileProblem::Bad {
            path: name.to_owned(),
            message: "not a file".to_owned(),
        });
    }
    if metadata.len() > limit {
        return Err(FileProblem::TooLarge {
            path: name.to_owned(),
            bytes: metadata.len(),
            limit,
        });
    }
    Ok(path)
}

/// The bytes of a regular file of at most `limit` bytes: pipes and devices may never end.
///
/// # Errors
/// The file cannot be read, is no regular file, or is larger.
pub fn read_regular(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let (file, size) = open_regular(path, limit)?;
    let mut bytes = Vec::with_capacity(size as usize);
    // one byte more than allowed tells of a file that grows
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    check_size(bytes.len() as u64, limit)?;
    Ok(bytes)
}

/// A regular file of at most `limit` bytes, opened, and its size.
///
/// # Errors
/// As [`read_regular`].
pub fn open_regular(path: &Path, limit: u64) -> io::Result<(File, u64)> {
    // a pipe is not even opened: that would wait for a writer
    let metadata = path.metadata()?;
    if !metadata.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a file"));
    }
    check_size(metadata.len(), limit)?;
    Ok((File::open(path)?, metadata.len()))
}

fn check_size(size: u64, limit: u64) -> io::Result<()> {
    if size <= limit {
        return Ok(());
    }
    let text = format!("{size} bytes (allowed: at most {limit})");
    Err(io::Error::new(io::ErrorKind::InvalidInput, text))
}

/// The path and the bytes of the file `name` in `folder`, as [`find`] finds it.
pub fn read(folder: &Path, name: &str, limit: u64) -> Result<(PathBuf, Vec<u8>), FileProblem> {
    let path = find(folder, name, limit)?;
    let bytes = read_regular(&path, limit).map_err(|e| FileProblem::Bad {
        path: name.to_owned(),
        message: e.to_string(),
    })?;
    Ok((path, bytes))
}

/// Rows of 2 to `N` numbers separated by commas, semicolons, tabs or blanks; with semicolons, or
/// with commas beside tabs, commas are decimal. Missing columns are 0. Empty lines, `#` comments
/// and one header line without numbers are passed over. The first column (nm) must ascend.
///
/// # Errors
/// Problem, in words, with the line.
pub fn read_csv<const N: usize>(bytes: &[u8]) -> Result<Vec<[f64; N]>, String> {
    let text =
        std::str::from_utf8(bytes).map_err(|e| format!("not UTF-8 at byte {}", e.valid_up_to()))?;
    parse_csv(text)
}

fn parse_csv<const N: usize>(text: &str) -> Result<Vec<[f64; N]>, String> {
    let mut rows: Vec<[f64; N]> = Vec::new();
    let mut header_seen = false;
    for (i, line) in text.lines().enumerate() {
        let line = line
            .split('#')
            .next()
            .unwrap_or_default()
            .trim_start_matches('\u{feff}')
            .trim();
        if line.is_empty() {
            continue;
        }
        // semicolons (or tabs) between the columns leave commas to the decimals: 546,07;1,5187
        let decimal_commas = line.contains(';') || line.contains('\t') && line.contains(',');
        let is_separator = |c: char| match c {
            ',' => !decimal_commas,
            _ => c == ';' || c.is_whitespace(),
        };
        let cells: Vec<String> = line
            .split(is_separator)
            .map(|c| {
                if decimal_commas {
                    c.replace(',', ".")
                } else {
                    c.to_owned()
                }
            })
            .filter(|c| !c.is_empty())
            .collect();
        if rows.is_empty() && !header_seen && cells.iter().all(|c| c.parse::<f64>().is_err()) {
            header_seen = true;
            continue;
        }
        if cells.len() < 2 || cells.len() > N {
            return Err(format!(
                "line {}: {} columns (allowed: 2 to {N})",
                i + 1,
                cells.len()
            ));
        }
        let mut row = [0.0; N];
        for (value, cell) in row.iter_mut().zip(&cells) {
            *value = cell
                .parse()
                .ok()
                .filter(|v: &f64| v.is_finite())
                .ok_or_else(|| format!("line {}: \"{cell}\" is not a finite number", i + 1))?;
        }
        if rows.last().is_some_and(|last| last[0] >= row[0]) {
            return Err(format!("line {}: wavelengths must ascend", i + 1));
        }
        rows.push(row);
    }
    if rows.is_empty() {
        Err("no rows (allowed: lines of \"nm,value\")".to_owned())
    } else {
        Ok(rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_rows() {
        let rows = parse_csv::<2>("nm,value\n# c\n400, 0.5\n\n500;1e-3 # end\n").expect("valid");
        assert_eq!(rows, [[400.0, 0.5], [500.0, 1e-3]]);
        assert_eq!(
            parse_csv::<3>("400 1.5\n500 1.4 0.1").expect("valid"),
            [[400.0, 1.5, 0.0], [500.0, 1.4, 0.1]]
        );
        for text in [
            "nm;n\n360,5;1,53\n830;1,51",
            "nm\tn\n360,5\t1,53\n830\t1,51",
        ] {
            let rows = parse_csv::<3>(text).expect("valid");
            assert_eq!(rows, [[360.5, 1.53, 0.0], [830.0, 1.51, 0.0]], "{text}");
        }
    }

    #[test]
    fn csv_errors_name_the_line() {
        for (text, message) in [
            ("400,1\n400,2", "line 2: wavelengths must ascend"),
            ("400,1\n500,nan", "line 2: \"nan\" is not a finite number"),
            ("400,1,2", "line 1: 3 columns (allowed: 2 to 2)"),
            ("a,b\nc,d", "line 2: \"c\" is not a finite number"),
            ("# only\n", "no rows (allowed: lines of \"nm,value\")"),
        ] {
            assert_eq!(parse_csv::<2>(text).expect_err(text), message);
        }
    }

    #[test]
    fn paths_stay_in_the_folder() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let inner = dir.path().join("scenes");
        std::fs::create_dir(&inner).expect("folder");
        std::fs::write(dir.path().join("secret.csv"), "1,2").expect("file");
        std::fs::write(inner.join("a.csv"), "1,2").expect("file");
        assert!(find(&inner, "./a.csv", 3).is_ok());
        assert!(matches!(
            find(&inner, "a.csv", 2),
            Err(FileProblem::TooLarge {
                bytes: 3,
                limit: 2,
                ..
            })
        ));
        assert!(matches!(
            find(&inner, "b.csv", 3),
            Err(FileProblem::Missing(_))
        ));
        let absolute = inner.join("a.csv");
        for name in [
            "../secret.csv",
            "x/../../secret.csv",
            absolute.to_str().expect("utf-8"),
            "..\\secret.csv",
        ] {
            assert!(
                matches!(find(&inner, name, 3), Err(FileProblem::OutsideFolder(_))),
                "{name}"
            );
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(dir.path().join("secret.csv"), inner.join("link.csv"))
                .expect("link");
            assert!(matches!(
                find(&inner, "link.csv", 3),
                Err(FileProblem::OutsideFolder(_))
            ));
        }
    }
}
