//! Writing files at once or not at all: a temporary file in the same folder, synced, then renamed over the old one.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// A file that could not be written or read.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub source: io::Error,
}

impl FileError {
    /// An error of `path`.
    #[must_use]
    pub fn new(path: &Path, source: io::Error) -> Self {
        Self {
            path: path.to_owned(),
            source,
        }
    }
}

/// The folder of a file: the working directory for a bare name.
#[must_use]
pub fn folder(path: &Path) -> &Path {
    path.parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

/// Replaces `path` by what `write` writes. The old file is untouched unless all of it succeeds.
///
/// # Errors
/// What `write` or the file system reports.
pub fn write_atomic(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> Result<(), FileError> {
    let fail = |e| FileError::new(path, e);
    let temporary = NamedTempFile::new_in(folder(path)).map_err(fail)?;
    let mut buffered = BufWriter::with_capacity(1 << 20, temporary.as_file());
    write(&mut buffered)
        .and_then(|()| buffered.flush())
        .map_err(fail)?;
    drop(buffered);
    make_readable(temporary.as_file())
        .and_then(|()| temporary.as_file().sync_all())
        .map_err(fail)?;
    temporary.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}

/// Temporary files are private; an image is for everyone, as if created plainly (umask 022).
#[cfg(unix)]
fn make_readable(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn make_readable(_: &File) -> io::Result<()> {
    Ok(())
}

/// Whether `path` can be written later: asked before rendering, so that hours of work do not end in an error. Leaves
/// nothing behind.
///
/// # Errors
/// The folder is missing or read-only, or the path is a folder.
pub fn check_writable(path: &Path) -> Result<(), FileError> {
    if path.is_dir() || path.file_name().is_none() {
        return Err(FileError::new(
            path,
            io::Error::new(io::ErrorKind::IsADirectory, "is a folder, not a file"),
        ));
    }
    NamedTempFile::new_in(folder(path)).map(drop).map_err(|e| {
        let kind = e.kind();
        let text = if kind == io::ErrorKind::NotFound {
            "the folder does not exist"
        } else {
            "the folder cannot be written"
        };
        FileError::new(path, io::Error::new(kind, text))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("image");
        write_atomic(&path, |w| w.write_all(b"old")).expect("writes");
        let failed = write_atomic(&path, |w| {
            w.write_all(b"new, half")?;
            Err(io::Error::other("disk full"))
        });
        assert_eq!(
            failed.expect_err("fails").to_string(),
            format!("{}: disk full", path.display())
        );
        assert_eq!(std::fs::read(&path).expect("there"), b"old");
        write_atomic(&path, |w| w.write_all(b"new")).expect("writes");
        assert_eq!(std::fs::read(&path).expect("there"), b"new");
        assert_eq!(std::fs::read_dir(dir.path()).expect("folder").count(), 1);
    }

    #[test]
    fn writable_is_known_before() {
        let dir = tempfile::tempdir().expect("temporary folder");
        assert!(check_writable(&dir.path().join("a.exr")).is_ok());
        assert!(check_writable(dir.path()).is_err());
        let missing = dir.path().join("no/a.exr");
        let text = check_writable(&missing).expect_err("no folder").to_string();
        assert_eq!(
            text,
            format!("{}: the folder does not exist", missing.display())
        );
        assert_eq!(std::fs::read_dir(dir.path()).expect("folder").count(), 0);
    }
}
