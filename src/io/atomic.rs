//! Writing files at once or not at all: a temporary file in the same folder, synced, then renamed
//! over the old one. Symbolic links are followed; temporary files of killed runs are removed.

use super::destination::destination;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::NamedTempFile;

const TEMPORARY: [&str; 2] = [".abbe-", ".tmp"];
/// Age from which a temporary file that nobody has locked is one of a killed run.
const LEFT_BEHIND: Duration = Duration::from_secs(60);

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
/// Error that `write` or the file system reports.
pub fn write_atomic(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> Result<(), FileError> {
    let fail = |e| FileError::new(path, e);
    let target = destination(path).map_err(fail)?;
    let temporary = temporary_in(folder(&target)).map_err(fail)?;
    let mut buffered = BufWriter::with_capacity(1 << 20, temporary.as_file());
    write(&mut buffered)
        .and_then(|()| buffered.flush())
        .map_err(fail)?;
    drop(buffered);
    make_readable(temporary.as_file())
        .and_then(|()| temporary.as_file().sync_all())
        .map_err(fail)?;
    temporary.persist(&target).map_err(|e| fail(e.error))?;
    Ok(())
}

/// A temporary file, locked to tell that its process lives.
pub(super) fn temporary_in(folder: &Path) -> io::Result<NamedTempFile> {
    let [prefix, suffix] = TEMPORARY;
    let mut names = tempfile::Builder::new();
    let temporary = names.prefix(prefix).suffix(suffix).tempfile_in(folder)?;
    // without locks its age alone tells
    _ = temporary.as_file().try_lock();
    Ok(temporary)
}

/// Removes temporary files of runs that were killed while they wrote.
pub(crate) fn remove_left_behind(folder: &Path) {
    let [prefix, suffix] = TEMPORARY;
    for entry in folder.read_dir().into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        // neither through a link nor into a pipe, which would wait for a writer
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if !is_file || !name.starts_with(prefix) || !name.ends_with(suffix) {
            continue;
        }
        let Ok(file) = File::open(entry.path()) else {
            continue;
        };
        let modified = file.metadata().and_then(|m| m.modified());
        let age = modified.ok().and_then(|at| at.elapsed().ok());
        if age.is_some_and(|age| age >= LEFT_BEHIND) && file.try_lock().is_ok() {
            // one that cannot be removed does no harm
            _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Temporary files are private; an image is for everyone, as if created plainly (umask 022).
#[cfg(unix)]
pub(super) fn make_readable(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
pub(super) fn make_readable(_: &File) -> io::Result<()> {
    Ok(())
}

/// Whether `path` can be written later: asked before rendering, so that hours of work do not end
/// in an error. Leaves nothing behind, nor what killed runs left in its folder.
///
/// # Errors
/// The folder is missing or read-only, or what is there is no regular file.
pub fn check_writable(path: &Path) -> Result<(), FileError> {
    let target = destination(path).map_err(|e| FileError::new(path, e))?;
    remove_left_behind(folder(&target));
    temporary_in(folder(&target)).map(drop).map_err(|e| {
        let text = "the folder cannot be written";
        FileError::new(path, io::Error::new(e.kind(), text))
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
    fn files_of_killed_runs_are_removed() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let make = |name: &str, age_s: u64| {
            let file = File::create(dir.path().join(name)).expect("file");
            let at = std::time::SystemTime::now() - Duration::from_secs(age_s);
            file.set_modified(at).expect("time");
            file
        };
        for (name, age_s) in [
            (".abbe-a.tmp", 100),
            (".abbe-new.tmp", 0),
            ("mine.tmp", 100),
        ] {
            drop(make(name, age_s));
        }
        #[cfg(unix)]
        std::os::unix::fs::symlink("mine.tmp", dir.path().join(".abbe-link.tmp")).expect("link");
        let alive = make(".abbe-b.tmp", 100);
        alive.lock().expect("locked");
        check_writable(&dir.path().join("a.exr")).expect("writable");
        #[cfg(unix)]
        std::fs::remove_file(dir.path().join(".abbe-link.tmp")).expect("is there");
        let mut left: Vec<_> = std::fs::read_dir(dir.path())
            .expect("folder")
            .map(|entry| entry.expect("entry").file_name())
            .collect();
        left.sort();
        assert_eq!(left, [".abbe-b.tmp", ".abbe-new.tmp", "mine.tmp"]);
    }

    #[test]
    #[cfg(unix)]
    fn links_are_followed() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let at = |name: &str| dir.path().join(name);
        std::os::unix::fs::symlink("image", at("link")).expect("link");
        write_atomic(&at("link"), |w| w.write_all(b"new")).expect("writes");
        assert!(at("link").is_symlink());
        assert_eq!(std::fs::read(at("image")).expect("there"), b"new");
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
