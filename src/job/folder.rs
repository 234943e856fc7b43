//! The folder of a job: its places, and opening what is in them without following links.

use super::JobError;
use super::manifest::{self, Manifest};
use crate::io::atomic::FileError;
use crate::io::files::read_regular;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Folders of a job.
const FOLDERS: [&str; 5] = ["files", "claims", "workers", "parts", "damaged"];

/// A job's folder, with its manifest.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
    /// Manifest of the job.
    pub manifest: Manifest,
}

impl Folder {
    /// Makes the folders of a new job; the manifest is written last, by [`Self::begin`].
    ///
    /// # Errors
    /// There is something already, or nothing can be made there.
    pub(super) fn make(path: &Path) -> Result<(), JobError> {
        let make = |folder: &Path| fs::create_dir(folder).map_err(|e| FileError::new(folder, e));
        make(path)?;
        for name in FOLDERS {
            make(&path.join(name))?;
        }
        Ok(())
    }

    /// Completes a new job.
    pub(super) fn begin(path: &Path, manifest: Manifest) -> Result<Self, JobError> {
        manifest.write(&path.join("job.json"))?;
        Ok(Self {
            path: path.to_owned(),
            manifest,
        })
    }

    /// Opens a job.
    ///
    /// # Errors
    /// There is none, one of another version, or one that no program of this version has made.
    pub fn open(path: &Path) -> Result<Self, JobError> {
        let at = path.join("job.json");
        let text = read_unlinked(&at, manifest::MAX_BYTES).map_err(|e| match e.kind() {
            io::ErrorKind::NotFound => JobError::format(path, "no job (a folder with job.json)"),
            _ => FileError::new(&at, e).into(),
        })?;
        let manifest = Manifest::parse(&text, &at)?;
        for name in FOLDERS {
            let folder = path.join(name);
            let found = folder.symlink_metadata();
            if !found.map_err(|e| FileError::new(&folder, e))?.is_dir() {
                return Err(JobError::format(&folder, "is no folder"));
            }
        }
        Ok(Self {
            path: path.to_owned(),
            manifest,
        })
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Folder of the parts of a job.
    #[must_use]
    pub fn parts_of(job: &Path) -> PathBuf {
        job.join("parts")
    }

    /// One of its folders.
    pub(super) fn at(&self, folder: &str) -> PathBuf {
        self.path.join(folder)
    }

    /// Names in one of its folders.
    pub(super) fn names(&self, folder: &str) -> Result<Vec<String>, JobError> {
        let path = self.at(folder);
        let list = || path.read_dir()?.map(|e| Ok(e?.file_name())).collect();
        let names: io::Result<Vec<_>> = list();
        let names = names.map_err(|e| FileError::new(&path, e))?;
        // what is no text was named by somebody else
        Ok(names.into_iter().flat_map(|n| n.into_string()).collect())
    }

    /// Removes the job; what is not of it stays, with its folder.
    ///
    /// # Errors
    /// A file cannot be removed.
    pub fn remove(&self) -> Result<(), JobError> {
        let fail = |path: &Path, e| JobError::from(FileError::new(path, e));
        // without it there is no job, whatever of it is left
        let manifest = self.at("job.json");
        fs::remove_file(&manifest).map_err(|e| fail(&manifest, e))?;
        for folder in FOLDERS {
            for name in self.names(folder)? {
                let path = self.at(folder).join(name);
                if path.symlink_metadata().is_ok_and(|found| found.is_file()) {
                    fs::remove_file(&path).map_err(|e| fail(&path, e))?;
                }
            }
            // one that is not empty stays
            _ = fs::remove_dir(self.at(folder));
        }
        _ = fs::remove_dir(&self.path);
        Ok(())
    }

    /// The time by the clock of the disk, which all workers share whatever theirs say.
    pub(super) fn now(&self) -> Result<SystemTime, JobError> {
        let path = self.at("workers");
        let probe = tempfile::Builder::new()
            .prefix(".abbe-")
            .suffix(".tmp")
            .tempfile_in(&path)
            .and_then(|file| file.as_file().metadata()?.modified());
        Ok(probe.map_err(|e| FileError::new(&path, e))?)
    }
}

/// Refuses anything but a plain file, links included.
pub(super) fn check_unlinked(path: &Path) -> io::Result<fs::Metadata> {
    let found = path.symlink_metadata()?;
    if !found.is_file() {
        let text = "is no plain file (links are not followed)";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
    }
    Ok(found)
}

/// Bytes of a plain file.
pub(super) fn read_unlinked(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    check_unlinked(path)?;
    read_regular(path, limit)
}

/// When a file was written last. It is opened, so that a network file system asks its server.
pub(super) fn modified(path: &Path) -> io::Result<SystemTime> {
    check_unlinked(path)?;
    File::open(path)?.metadata()?.modified()
}

/// Random digits for names that nobody else takes.
pub(super) fn random_name() -> String {
    use std::hash::{BuildHasher, RandomState};
    format!("{:016x}", RandomState::new().hash_one(std::process::id()))
}
