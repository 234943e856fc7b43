//! Locks: sole use of a file by one process.

use super::atomic::{FileError, folder, make_readable, temporary_in};
use super::destination::destination;
use std::fs::{File, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Content of a lock file, by which it is told from files of other programs.
const MARK: &[u8] = b"abbe writes the file beside this one\n";

/// Sole use of a file that is replaced as a whole, kept by a lock on a file `NAME.lock` beside it.
/// The system lets go of it when the process ends, however it ends.
///
/// Invariant: a file of that name which holds anything but [`MARK`] is neither written nor removed.
#[derive(Debug)]
pub struct FileLock {
    path: PathBuf,
    /// Holds the lock while it is open.
    file: File,
}

impl FileLock {
    /// Takes the lock of `path`, unless another process has it.
    ///
    /// # Errors
    /// Another process uses the file, its folder cannot be written, or what is called `NAME.lock`
    /// is no lock of this program.
    pub fn acquire(path: &Path) -> Result<Self, FileError> {
        let mut name = destination(path)
            .map_err(|e| FileError::new(path, e))?
            .into_os_string();
        name.push(".lock");
        let beside = PathBuf::from(name);
        loop {
            let step = match beside.symlink_metadata() {
                Ok(found) if found.is_file() => take(&beside),
                Ok(_) => Err(foreign()),
                Err(e) if e.kind() == io::ErrorKind::NotFound => create(&beside),
                Err(e) => Err(e),
            };
            match step {
                Ok(Some(file)) => return Ok(Self { path: beside, file }),
                Ok(None) => {}
                Err(e) if e.kind() == io::ErrorKind::InvalidData => {
                    return Err(FileError::new(&beside, e));
                }
                Err(e) => return Err(FileError::new(path, e)),
            }
        }
    }
}

/// Makes a lock file that is locked and complete when it appears. `None` where another one has
/// appeared before.
fn create(beside: &Path) -> io::Result<Option<File>> {
    let mut temporary = temporary_in(folder(beside))?;
    temporary.write_all(MARK)?;
    make_readable(temporary.as_file())?;
    match temporary.persist_noclobber(beside) {
        Ok(file) => Ok(Some(file)),
        Err(e) if e.error.kind() == io::ErrorKind::AlreadyExists => Ok(None),
        Err(e) => Err(e.error),
    }
}

/// Locks a file that is there. `None` where its last owner has removed it meanwhile.
fn take(beside: &Path) -> io::Result<Option<File>> {
    let file = match File::open(beside) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        file => file?,
    };
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let text = "another process writes it now (allowed: another file)";
            return Err(io::Error::new(io::ErrorKind::ResourceBusy, text));
        }
        // some network file systems have no locks
        Err(TryLockError::Error(e)) if e.kind() == io::ErrorKind::Unsupported => {}
        Err(TryLockError::Error(e)) => return Err(e),
    }
    if !is_at(&file, beside) {
        return Ok(None);
    }
    if is_marked(&file)? {
        Ok(Some(file))
    } else {
        Err(foreign())
    }
}

fn foreign() -> io::Error {
    let text = "is there and no lock of this program: move it away, or name another part";
    io::Error::new(io::ErrorKind::InvalidData, text)
}

fn is_marked(file: &File) -> io::Result<bool> {
    let mut content = Vec::new();
    file.take(MARK.len() as u64 + 1).read_to_end(&mut content)?;
    Ok(content == MARK)
}

impl Drop for FileLock {
    fn drop(&mut self) {
        // what has taken its place meanwhile is somebody else's
        let is_own = File::open(&self.path).and_then(|now| is_marked(&now));
        if is_own.unwrap_or(false) && is_at(&self.file, &self.path) {
            // the lock is what counts: a file that stays is taken by the next process
            _ = std::fs::remove_file(&self.path);
        }
    }
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let inode = |m: io::Result<std::fs::Metadata>| m.ok().map(|m| (m.dev(), m.ino()));
    inode(file.metadata()) == inode(path.metadata())
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_process_at_a_time() {
        let folder = tempfile::tempdir().expect("folder");
        let part = folder.path().join("a.part");
        let lock = FileLock::acquire(&part).expect("free");
        let error = FileLock::acquire(&part).expect_err("taken");
        assert!(error.to_string().contains("another process"), "{error}");
        drop(lock);
        drop(FileLock::acquire(&part).expect("free again"));
        assert_eq!(std::fs::read_dir(&folder).expect("folder").count(), 0);
        // as a killed process leaves it
        std::fs::write(folder.path().join("a.part.lock"), MARK).expect("file");
        FileLock::acquire(&part).expect("nobody holds it");
    }

    #[test]
    fn files_of_others_stay() {
        let folder = tempfile::tempdir().expect("folder");
        let (part, beside) = (
            folder.path().join("a.part"),
            folder.path().join("a.part.lock"),
        );
        for content in [
            "",
            "a letter",
            "abbe writes the file beside this one\nand more",
        ] {
            std::fs::write(&beside, content).expect("file");
            let error = FileLock::acquire(&part).expect_err("foreign").to_string();
            let expected = format!(
                "{}: is there and no lock of this program: move it away, or name another part",
                beside.display()
            );
            assert_eq!(error, expected);
            assert_eq!(std::fs::read_to_string(&beside).expect("there"), content);
        }
        std::fs::remove_file(&beside).expect("removed");
        std::fs::create_dir(&beside).expect("folder");
        FileLock::acquire(&part).expect_err("a folder");
        std::fs::remove_dir(&beside).expect("removed");
        // what takes the place of the lock while it is held
        let lock = FileLock::acquire(&part).expect("free");
        std::fs::remove_file(&beside).expect("removed");
        std::fs::write(&beside, MARK).expect("file");
        drop(lock);
        assert!(beside.exists(), "another's lock");
        let lock = FileLock::acquire(&part).expect("nobody holds it");
        std::fs::write(&beside, "a letter").expect("file");
        drop(lock);
        assert!(beside.exists(), "another's file");
    }
}
