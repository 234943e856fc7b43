//! Errors of the command line: each says what failed and on which file.

use crate::film::AddSumsError;
use crate::io::atomic::FileError;
use crate::io::destination::ClaimError;
use crate::io::exr::ExrError;
use crate::io::image::ReadError;
use crate::io::loaded::LoadError;
use crate::io::part::PartError;
use crate::job::JobError;
use crate::render::SessionError;
use crate::report::ReportError;
use crate::spectrum::LibraryError;
use std::io::ErrorKind;
use std::path::PathBuf;

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// Options that are legal one by one but not together, or not for this scene.
    #[error("{0}")]
    Usage(String),
    /// A scene that does not load, or has no such sensor.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A study that failed.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// A file that cannot be read or written.
    #[error("{}: {message}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Fault, in words.
        message: String,
    },
    /// An output that would destroy something.
    #[error(transparent)]
    Claim(#[from] ClaimError),
    /// A file that could not be written.
    #[error(transparent)]
    Write(#[from] FileError),
    /// An image that could not be read or written.
    #[error(transparent)]
    Image(#[from] ExrError),
    /// An image that could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A part file that could not be read, written or merged.
    #[error(transparent)]
    Part(#[from] PartError),
    /// A job that could not be made, worked on or collected.
    #[error(transparent)]
    Job(#[from] JobError),
    /// Sums that do not fit.
    #[error(transparent)]
    Sums(#[from] AddSumsError),
    /// A sensor or crop that the scene does not have.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// A glass that there is not.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// Results that could not be printed.
    #[error("standard output: {0}")]
    Stdout(std::io::Error),
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

    /// Whether the same may succeed later: a disk that is full, a folder that is gone.
    #[must_use]
    pub fn may_pass(&self) -> bool {
        match self {
            Self::Write(e) | Self::Image(ExrError::File(e)) | Self::Part(PartError::File(e)) => {
                e.source.kind() != ErrorKind::FileTooLarge
            }
            _ => false,
        }
    }

    /// 2 for wrong usage, else 1.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::Claim(ClaimError::Input(_) | ClaimError::Twice { .. }) => 2,
            Self::Load(error) | Self::Job(JobError::Load(error)) => 1 + u8::from(error.is_usage()),
            Self::Report(error) => 1 + u8::from(error.is_usage()),
            _ => 1,
        }
    }
}
