//! Locks: sole use of a file by one process.

use super::atomic::FileError;
use super::destination::destination;
use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

/// Sole use of a file that is replaced as a whole, kept by a lock on a file `NAME.lock` beside it.
/// The system lets go of it when the process ends, however it ends.
#[derive(Debug)]
pub struct FileLock {
    path: PathBuf,
    /// Holds the lock while it is open.
    _file: File,
}

impl FileLock {
    /// Takes the lock of `path`, unless another process has it.
    ///
    /// # Errors
    /// Another process uses the file, or its folder cannot be written.
    pub fn acquire(path: &Path) -> Result<Self, FileError> {
        let fail = |e| FileError::new(path, e);
        let mut name = destination(path).map_err(fail)?.into_os_string();
        name.push(".lock");
        let beside = PathBuf::from(name);
        loop {
            let file = File::create(&beside).map_err(fail)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let text = "another process writes it now (allowed: another file)";
                    return Err(fail(io::Error::new(io::ErrorKind::ResourceBusy, text)));
                }
                // some network file systems have no locks
                Err(TryLockError::Error(e)) if e.kind() == io::ErrorKind::Unsupported => {}
                Err(TryLockError::Error(e)) => return Err(fail(e)),
            }
            // its last owner may have removed it between the two steps
            if is_at(&file, &beside) {
                let path = beside;
                return Ok(Self { path, _file: file });
            }
        }
    }
}

impl Drop for FileLock {
    fn drop(&mut self) {
        // the lock is what counts: a file that stays is taken by the next process
        _ = std::fs::remove_file(&self.path);
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
        std::fs::write(folder.path().join("a.part.lock"), "").expect("file");
        FileLock::acquire(&part).expect("nobody holds it");
    }
}
