//! Errors of the command line: each says what failed and on which file.

use crate::film::AddSumsError;
use crate::io::atomic::FileError;
use crate::io::exr::ExrError;
use crate::io::part::PartError;
use crate::io::scene_file::SceneFileErrors;
use crate::spectrum::LibraryError;
use std::path::PathBuf;

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// Options that are legal one by one but not together, or not for this scene.
    #[error("{0}")]
    Usage(String),
    /// A scene file with problems, one line each.
    #[error("{0}")]
    SceneFile(#[from] SceneFileErrors),
    /// A file that cannot be read or written.
    #[error("{}: {message}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// A file that could not be written.
    #[error(transparent)]
    Write(#[from] FileError),
    /// An image that could not be read or written.
    #[error(transparent)]
    Image(#[from] ExrError),
    /// A part file that could not be read, written or merged.
    #[error(transparent)]
    Part(#[from] PartError),
    /// Sums that do not fit.
    #[error(transparent)]
    Sums(#[from] AddSumsError),
    /// A glass that there is not.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// Anything else that went wrong.
    #[error("{0}")]
    Failed(String),
}

impl CliError {
    /// A problem with a file.
    pub fn file(path: impl Into<PathBuf>, message: impl Into<String>) -> Self {
        Self::File {
            path: path.into(),
            message: message.into(),
        }
    }

    /// 2 for wrong usage, else 1.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            _ => 1,
        }
    }
}
