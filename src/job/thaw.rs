//! The scene of a job from its copies: each is hashed while it is copied to a folder of this
//! process, and the scene is read from there, so that what is read is what was hashed.

use super::JobError;
use super::folder::{Folder, check_unlinked};
use super::freeze::{MAX_BYTES, copy_hashed};
use super::manifest::Copy;
use crate::io::atomic::FileError;
use crate::io::files::open_regular;
use crate::io::loaded::{self, Loaded};
use crate::io::part::{self, SpectralFilm};
use crate::render::{Cancel, Choices, OutputRequest, Session, SessionError, SessionOptions};
use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// Name of the results of the pilots.
pub(super) const CHOICES: &str = "choices.json";
/// Largest results of pilots.
const MAX_CHOICES_BYTES: u64 = 256 << 20;

/// The scene of a job, ready to be rendered.
#[derive(Debug)]
pub struct Thawed {
    loaded: Loaded,
    options: SessionOptions,
}

/// Reads the scene of a job.
///
/// # Errors
/// A copy is damaged or missing, or the scene is not the one that the job names.
pub fn scene(job: &Folder) -> Result<Thawed, JobError> {
    let manifest = &job.manifest;
    let place = tempfile::tempdir();
    let place = place.map_err(|e| FileError::new(&std::env::temp_dir(), e))?;
    let place = place.path();
    for copy in &manifest.files {
        take(job, copy, &place.join(&copy.name), MAX_BYTES)?;
    }
    let scene = place.join(&manifest.scene);
    let loaded = loaded::load(&scene, &manifest.overrides)?;
    // beside the files of the scene, whatever they are called
    let written = tempfile::NamedTempFile::new();
    let written = written.map_err(|e| FileError::new(&std::env::temp_dir(), e))?;
    take(job, &manifest.choices, written.path(), MAX_CHOICES_BYTES)?;
    let text = fs::read(written.path()).map_err(|e| FileError::new(written.path(), e))?;
    let broken =
        |message| JobError::format(&job.at("files").join(&manifest.choices.sha256), message);
    let choices: Vec<Choices> = serde_json::from_slice(&text).map_err(|e| broken(e.to_string()))?;
    let mut choices = choices.into_iter();
    let own = choices.next();
    let own = own.ok_or_else(|| broken("holds no results of pilots".to_owned()))?;
    let companions = manifest.header.companions.iter();
    let companions = companions.map(|film| loaded.sensor(Some(&film.sensor)));
    let companions = companions.collect::<Result<_, _>>()?;
    let options = SessionOptions {
        sensor: loaded.sensor(Some(&manifest.header.sensor))?,
        crop: Some(manifest.header.crop()),
        outputs: OutputRequest {
            response: loaded.response(),
            spectral: (manifest.header.spectral.as_ref()).and_then(SpectralFilm::channels),
            ..OutputRequest::default()
        },
        companions,
        choices: Some(own),
        companion_choices: Some(choices.collect()),
        live: true,
        ..SessionOptions::default()
    };
    let found = {
        let session = session(&loaded, &options, 0..0, Cancel::default())?;
        part::header_of(&session.render())
    };
    part::check_identical(&manifest.header, &found)?;
    Ok(Thawed { loaded, options })
}

fn session(
    loaded: &Loaded,
    options: &SessionOptions,
    passes: Range<u32>,
    cancel: Cancel,
) -> Result<Session, SessionError> {
    let options = SessionOptions {
        passes: Some(passes),
        cancel,
        ..options.clone()
    };
    Session::new(Arc::clone(&loaded.scene), &loaded.settings, options)
}

impl Thawed {
    /// A session of some passes.
    ///
    /// # Errors
    /// The crop or the results of the pilots do not fit the scene.
    pub fn session(&self, passes: Range<u32>, cancel: Cancel) -> Result<Session, SessionError> {
        session(&self.loaded, &self.options, passes, cancel)
    }

    /// The scene, loaded.
    #[must_use]
    pub fn loaded(&self) -> &Loaded {
        &self.loaded
    }
}

/// Copies a file out of a job if its size and hash are those that the job names.
fn take(job: &Folder, copy: &Copy, to: &Path, limit: u64) -> Result<(), JobError> {
    let from = job.at("files").join(&copy.sha256);
    let fail = |e| JobError::from(FileError::new(&from, e));
    let found = check_unlinked(&from).map_err(fail)?;
    if found.len() != copy.bytes || found.len() > limit {
        let (found, named) = (found.len(), copy.bytes);
        let text = format!("{found} bytes, the job names {named}, allowed are {limit}");
        return Err(JobError::format(&from, text));
    }
    let (reader, _) = open_regular(&from, limit).map_err(fail)?;
    let fail = |e| JobError::from(FileError::new(to, e));
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder).map_err(fail)?;
    }
    let mut writer = BufWriter::new(File::create(to).map_err(fail)?);
    let (_, sha256) = copy_hashed(reader, &mut writer).map_err(fail)?;
    writer.flush().map_err(fail)?;
    if sha256 == copy.sha256 {
        return Ok(());
    }
    let text = format!("is damaged: its bytes have the SHA-256 {sha256}");
    Err(JobError::format(&from, text))
}
