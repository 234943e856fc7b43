//! Jobs: a render as a folder that any number of processes work on, on one machine or on many with
//! a shared disk.
//!
//! `job.json` ([`Manifest`]) says what is rendered; `files/` holds what was read for it, by the
//! SHA-256 of its bytes, with the results of the pilots ([`freeze`], [`thaw`]). The passes are cut
//! into *chunks*. A worker claims a chunk by a file in `claims/` ([`claims`]), renders it, and puts
//! its sums into `parts/` ([`parts`]), where four neighboring blocks become one.
//!
//! Invariant: the name of a part says which chunks it holds, and its bytes follow from that. So
//! claims only save work: a chunk that is rendered twice, or merged twice, is the same file again,
//! and no order of events makes another image.
//!
//! Invariant: a folder is input like any other. No name in it leads out of it, no link in it is
//! followed, sizes are bounded, every copy is hashed before it is used, nothing is executed.

pub mod blocks;
pub mod claims;
pub mod folder;
pub mod freeze;
pub mod manifest;
pub mod parts;
mod search;
pub mod status;
pub mod thaw;
pub mod work;

pub use blocks::{Block, Chunks};
pub use folder::Folder;
pub use manifest::Manifest;
pub use thaw::Thawed;

use crate::film::AddSumsError;
use crate::io::atomic::FileError;
use crate::io::loaded::LoadError;
use crate::io::part::PartError;
use crate::render::SessionError;
use std::path::{Path, PathBuf};

/// Why a job cannot be made, worked on or collected.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// The file system.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file or folder that is not as a job has it.
    #[error("{}: {message}", path.display())]
    Format {
        /// The file or folder.
        path: PathBuf,
        /// Fault, in words.
        message: String,
    },
    /// A job of another version of the program, whose passes would not be this one's.
    #[error(
        "{}: the job was made by abbe {job}, this is abbe {own} (allowed: the same version on all machines)",
        path.display()
    )]
    Version {
        /// The manifest.
        path: PathBuf,
        /// Of the job.
        job: String,
        /// Of this program.
        own: &'static str,
    },
    /// The scene.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A part.
    #[error(transparent)]
    Part(#[from] PartError),
    /// A sensor, a crop or choices that do not fit the scene.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Sums that do not fit.
    #[error(transparent)]
    Sums(#[from] AddSumsError),
    /// Parts that other processes merge faster than this one reads them.
    #[error("{}: parts were merged again and again while they were read", .0.display())]
    Restless(PathBuf),
    /// A request to stop.
    #[error("interrupted")]
    Interrupted,
}

impl JobError {
    fn format(path: &Path, message: impl Into<String>) -> Self {
        Self::Format {
            path: path.to_owned(),
            message: message.into(),
        }
    }
}
