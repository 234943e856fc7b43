//! The source of the page: a scene that is rendered, an image or part, or the folder of a job.

use crate::cli::CliError;
use crate::io::exr::ExrImage;
use crate::io::model_file::ModelKind;
use crate::io::{image, part};
use crate::job::Folder;
use std::path::{Path, PathBuf};

/// Kind of what the command line names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A scene file or model.
    Scene,
    /// An image or part.
    Image,
    /// A job, of which whatever is done is shown.
    Job,
}

impl Source {
    /// # Errors
    /// There is no such file, or the folder is none of a job.
    pub fn of(path: &Path) -> Result<Self, CliError> {
        if path.is_dir() {
            Folder::open(path)?;
            return Ok(Self::Job);
        }
        if !path.is_file() {
            return Err(CliError::file(path, "there is no such file"));
        }
        let is_exr = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("exr"));
        let is_image = is_exr || ModelKind::of(path).is_none() && part::is_part(path)?;
        Ok(if is_image { Self::Image } else { Self::Scene })
    }

    /// The file or folder whose changes are followed first.
    pub fn watched(self, path: &Path) -> PathBuf {
        match self {
            Self::Job => Folder::parts_of(path),
            Self::Scene | Self::Image => path.to_owned(),
        }
    }
}

/// An image, and how far the render has come that made it.
#[derive(Debug)]
pub struct Found {
    pub image: ExrImage,
    /// Passes in it and of all; 0 where that is not known.
    pub passes: u64,
    pub all: u64,
}

impl Found {
    /// That of an image or part.
    ///
    /// # Errors
    /// The file cannot be read, or is no picture.
    pub fn of_file(path: &Path) -> Result<Self, CliError> {
        let image = image::read(path)?;
        if image.xyz().is_none() {
            return Err(CliError::file(path, "has no channels X, Y and Z"));
        }
        Ok(Self {
            image,
            passes: 0,
            all: 0,
        })
    }

    /// That of all chunks of a job that are done.
    ///
    /// # Errors
    /// No chunk is done, or they cannot be read.
    pub fn of_job(path: &Path) -> Result<Self, CliError> {
        let job = Folder::open(path)?;
        // who works on the job or collects it tells of damage
        let sum = job.sum(|_| {})?;
        let sum = sum.ok_or_else(|| CliError::file(path, "no chunk is done yet"))?;
        if !sum.header.companions.is_empty() {
            let text = "holds several detectors: make their images by abbe job collect";
            return Err(CliError::file(path, text));
        }
        Ok(Self {
            image: image::of_part(&sum)?,
            passes: sum.header.pass_count(),
            all: job.status()?.passes.map_or(0, u64::from),
        })
    }
}
