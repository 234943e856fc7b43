//! Errors of studies: each says what failed and on which file.

use crate::film::Crop;
use crate::io::atomic::FileError;
use crate::io::exr::ExrError;
use crate::io::loaded::LoadError;
use crate::render::SessionError;
use std::path::PathBuf;

/// Why a study failed.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A scene that does not load, or has no such sensor.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A render that cannot begin.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// A file that cannot be used.
    #[error("{}: {message}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The problem, to follow the name of the file.
        message: String,
    },
    /// A file that could not be written.
    #[error(transparent)]
    Write(#[from] FileError),
    /// An image that could not be read or written.
    #[error(transparent)]
    Image(#[from] ExrError),
    /// A pixel that the sensor does not have.
    #[error("probe {x},{y} is beyond sensor \"{sensor}\" of {width} x {height} pixels")]
    Probe {
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// Name of the sensor.
        sensor: String,
        /// Columns of the sensor.
        width: u32,
        /// Rows of the sensor.
        height: u32,
    },
    /// A part of an image that it does not have.
    #[error("region {},{},{},{} reaches beyond an image of {width} x {height} pixels", .region.x0, .region.y0, .region.x1, .region.y1)]
    Region {
        /// The part.
        region: Crop,
        /// Columns of the image.
        width: u32,
        /// Rows of the image.
        height: u32,
    },
    /// An image that has no bands to measure.
    #[error("the region has fewer than three lines of color, or no noise at all")]
    NoLines,
    /// A reference of which no image was kept.
    #[error("there is no reference")]
    NoReference,
}

impl ReportError {
    /// A problem with a file.
    pub fn file(path: impl Into<PathBuf>, message: impl Into<String>) -> Self {
        Self::File {
            path: path.into(),
            message: message.into(),
        }
    }

    /// Whether the request is wrong for this scene or image, rather than that something failed.
    #[must_use]
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Load(error) => error.is_usage(),
            Self::Probe { .. } | Self::Region { .. } => true,
            _ => false,
        }
    }
}
