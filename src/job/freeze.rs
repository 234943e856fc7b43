//! Making a job: copies of all that was read, results of the pilots, chunks of a length.

use super::JobError;
use super::folder::{Folder, random_name};
use super::manifest::{Copy, FORMAT, Manifest, TargetError};
use super::thaw;
use crate::film::Crop;
use crate::io::atomic::{FileError, folder, write_atomic};
use crate::io::files::open_regular;
use crate::io::identity::VERSION;
use crate::io::{loaded, part};
use crate::render::session::NO_LIMIT;
use crate::render::{Choices, OutputRequest, Render, Session, SessionOptions, shared_order};
use sha2::{Digest, Sha256};
use std::fs;
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Largest file that is copied.
pub(super) const MAX_BYTES: u64 = 64 << 30;
/// Time that passes are measured for, and their number at most.
const MEASURED: Duration = Duration::from_secs(2);
const MOST_MEASURED: u32 = 64;
/// Chunks of a job of unknown length, unless said otherwise.
const DEFAULT_CHUNK: Duration = Duration::from_secs(600);

/// Parts that a further worker adds to the disk at most: those of a block that is not complete.
pub const PARTS_OF_A_WORKER: u32 = 3;
/// Levels of blocks of a job of which nobody knows how long it is.
const LEVELS_OF_ENDLESS: u32 = 6;

/// Length of chunks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ChunkLength {
    /// Passes.
    Passes(u32),
    /// Time on the threads of the process that makes the job.
    Time(Duration),
}

impl Default for ChunkLength {
    fn default() -> Self {
        Self::Time(DEFAULT_CHUNK)
    }
}

/// Wishes for a job.
#[derive(Clone, Debug)]
pub struct Request {
    /// Scene file or model.
    pub scene: PathBuf,
    /// Keys of the scene file that are replaced.
    pub overrides: Vec<(String, String)>,
    /// Sensor, by name; `None`: the only one.
    pub sensor: Option<String>,
    /// All detectors, filled by one set of light sub-paths.
    pub together: bool,
    /// Bins of a spectral image, if one is kept.
    pub spectral: Option<u16>,
    /// Rendered part of the film; `None`: all of it.
    pub crop: Option<Crop>,
    /// Error below which it ends.
    pub target_error: Option<f64>,
    /// Whether nothing but the error ends it, whatever the number of samples.
    pub is_endless: bool,
    /// Length of chunks.
    pub chunk: ChunkLength,
    /// Time without a sign of life after which a worker counts as dead.
    pub lease: Duration,
}

/// A job that was made.
#[derive(Debug)]
pub struct Made {
    /// The job.
    pub folder: Folder,
    /// Bytes of the copies.
    pub copied: u64,
    /// Time of a pass, where it was measured.
    pub pass_time: Option<Duration>,
    /// Warnings about the scene.
    pub warnings: Vec<String>,
}

/// Makes a job: reads the scene, runs the pilots, copies what was read, and loads it again from the
/// copies. The folder appears when all of that has succeeded.
///
/// # Errors
/// The scene does not load, or not from its copies, or the folder cannot be made.
pub fn make(path: &Path, request: &Request) -> Result<Made, JobError> {
    let draft = Draft::new(path)?;
    let read = loaded::load(&request.scene, &request.overrides)?;
    let settings = &read.settings;
    let passes = if request.is_endless {
        NO_LIMIT
    } else {
        settings.spp
    };
    let sensors = if request.together {
        shared_order(&read.scene)
    } else {
        vec![read.sensor(request.sensor.as_deref())?]
    };
    let options = SessionOptions {
        sensor: sensors[0],
        companions: sensors[1..].to_vec(),
        crop: request.crop,
        outputs: OutputRequest {
            response: read.response(),
            spectral: request.spectral.map(|bins| read.spectral_channels(bins)),
            ..OutputRequest::default()
        },
        passes: Some(0..passes.min(MOST_MEASURED)),
        ..SessionOptions::default()
    };
    let mut session = Session::new(Arc::clone(&read.scene), settings, options)?;
    let header = part::header_of(&session.render());
    let choices = {
        let render = session.render();
        let all: Vec<&Choices> = render.and_companions().map(Render::choices).collect();
        serde_json::to_vec(&all)
    };
    let choices = choices.map_err(|e| JobError::format(path, e.to_string()))?;
    let (chunk, pass_time) = match request.chunk {
        ChunkLength::Passes(passes) => (passes, None),
        ChunkLength::Time(time) => {
            let pass = time_of_a_pass(&mut session);
            let passes = (time.as_secs_f64() / pass.as_secs_f64()).round();
            ((passes as u32).max(1), Some(pass))
        }
    };
    drop(session);
    draft.make()?;
    let scene = file_name(&request.scene)?;
    let files = freeze_all(&draft.path, &request.scene, &scene, &read.files)?;
    let choices = freeze_bytes(&draft.path, &choices, thaw::CHOICES)?;
    let copied = files.iter().map(|f| f.bytes).sum::<u64>() + choices.bytes;
    let manifest = Manifest {
        format: FORMAT,
        version: VERSION.to_owned(),
        scene,
        overrides: request.overrides.clone(),
        header,
        seed: settings.seed,
        passes,
        chunk: chunk.min(passes),
        target_error: request.target_error.map(TargetError),
        lease_ms: request.lease,
        choices,
        files,
    };
    // what a name leads to through a link is at another place among the copies
    thaw::scene(&Folder::begin(&draft.path, manifest)?).map_err(|error| {
        let text = format!(
            "the copies do not make the same scene (allowed: no symbolic links in the scene's \
             folder, and no file that changes meanwhile): {error}"
        );
        JobError::format(&request.scene, text)
    })?;
    Ok(Made {
        folder: draft.publish()?,
        copied,
        pass_time,
        warnings: read.warnings,
    })
}

/// A job that is being made, beside the place where it will be; removed unless it is published.
#[derive(Debug)]
struct Draft<'a> {
    place: &'a Path,
    path: PathBuf,
}

impl<'a> Draft<'a> {
    /// For a job at this place.
    fn new(place: &'a Path) -> Result<Self, JobError> {
        let is_empty = place.read_dir().map(|mut all| all.next().is_none());
        match is_empty {
            Ok(true) => {}
            Err(e) if e.kind() == ErrorKind::NotFound => {
                // before the scene is read
                let parent = folder(place);
                if !parent.is_dir() {
                    return Err(JobError::format(parent, "no folder to make a job in"));
                }
            }
            Ok(false) | Err(_) => {
                let text = "is there and no empty folder (allowed: a new or an empty folder)";
                return Err(JobError::format(place, text));
            }
        }
        let path = folder(place).join(format!(".abbe-{}.tmp", random_name()));
        Ok(Self { place, path })
    }

    fn make(&self) -> Result<(), JobError> {
        Folder::make(&self.path)
    }

    /// Puts it into its place.
    fn publish(self) -> Result<Folder, JobError> {
        // an empty folder; any other one stays, and is an error
        _ = fs::remove_dir(self.place);
        fs::rename(&self.path, self.place).map_err(|e| FileError::new(self.place, e))?;
        Folder::open(self.place)
    }
}

impl Drop for Draft<'_> {
    fn drop(&mut self) {
        // its own name, of random digits
        _ = fs::remove_dir_all(&self.path);
    }
}

/// Copies the files of a scene, the scene itself first, by their names as seen from its folder.
fn freeze_all(
    job: &Path,
    scene: &Path,
    name: &str,
    read: &[PathBuf],
) -> Result<Vec<Copy>, JobError> {
    let scene_folder = folder(scene);
    let root = scene_folder.canonicalize();
    let root = root.map_err(|e| FileError::new(scene_folder, e))?;
    let mut files = vec![freeze(job, scene, name.to_owned())?];
    for file in read {
        if file == scene {
            continue;
        }
        let at = file.canonicalize().map_err(|e| FileError::new(file, e))?;
        let name = at.strip_prefix(&root).ok().and_then(slashed);
        let name = name.ok_or_else(|| {
            let text = "is outside the scene's folder, or its name is no text";
            JobError::format(file, text)
        })?;
        if files.iter().all(|f| f.name != name) {
            files.push(freeze(job, &at, name)?);
        }
    }
    Ok(files)
}

fn time_of_a_pass(session: &mut Session) -> Duration {
    let began = Instant::now();
    let mut time = Duration::from_nanos(1);
    loop {
        let progress = session.step();
        if progress.added > 0 {
            time = progress.time.wall.div_f64(progress.added as f64);
        }
        if progress.stop.is_some() || began.elapsed() > MEASURED {
            return time.max(Duration::from_nanos(1));
        }
    }
}

fn file_name(path: &Path) -> Result<String, JobError> {
    let name = path.file_name().and_then(|n| n.to_str());
    let name = name.ok_or_else(|| JobError::format(path, "has no name that is text"))?;
    Ok(name.to_owned())
}

/// A relative path with slashes.
fn slashed(path: &Path) -> Option<String> {
    let parts: Option<Vec<&str>> = path.iter().map(|part| part.to_str()).collect();
    Some(parts?.join("/"))
}

/// Copies a file into a job.
fn freeze(job: &Path, file: &Path, name: String) -> Result<Copy, JobError> {
    let fail = |e| JobError::from(FileError::new(file, e));
    let (reader, bytes) = open_regular(file, MAX_BYTES).map_err(fail)?;
    // the name is that of the bytes, which are known when they are written
    let path = job.join("files").join(".copy");
    let mut copied = None;
    write_atomic(&path, |to| {
        copied = Some(copy_hashed(reader, to)?);
        Ok(())
    })?;
    let (size, sha256) = copied.unwrap_or_default();
    if size != bytes {
        return Err(JobError::format(file, "changed while it was copied"));
    }
    let to = job.join("files").join(&sha256);
    fs::rename(&path, &to).map_err(|e| FileError::new(&to, e))?;
    Ok(Copy {
        name,
        bytes,
        sha256,
    })
}

fn freeze_bytes(job: &Path, bytes: &[u8], name: &str) -> Result<Copy, JobError> {
    let sha256 = hex(&Sha256::digest(bytes));
    let path = job.join("files").join(&sha256);
    write_atomic(&path, |file| file.write_all(bytes))?;
    Ok(Copy {
        name: name.to_owned(),
        bytes: bytes.len() as u64,
        sha256,
    })
}

/// Copies bytes: their number, and their SHA-256.
pub(super) fn copy_hashed(mut from: impl Read, to: &mut impl Write) -> io::Result<(u64, String)> {
    let (mut hash, mut size) = (Sha256::new(), 0);
    let mut buffer = vec![0; 1 << 20];
    loop {
        let n = from.read(&mut buffer)?;
        if n == 0 {
            return Ok((size, hex(&hash.finalize())));
        }
        hash.update(&buffer[..n]);
        to.write_all(&buffer[..n])?;
        size += n as u64;
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

impl Folder {
    /// Parts on the disk at most while one process works: three of each level, and four that have
    /// become one and stay for a lease.
    #[must_use]
    pub fn most_parts(&self) -> u32 {
        let chunks = self.manifest.chunks().count();
        let levels = if self.manifest.is_endless() {
            LEVELS_OF_ENDLESS
        } else {
            chunks.ilog(4) + 1
        };
        (3 * levels + 5).min(chunks.saturating_mul(2))
    }
}
