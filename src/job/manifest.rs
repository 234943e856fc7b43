//! The manifest of a job, `job.json`: what is rendered, and which files that takes.
//!
//! Invariant: no absolute path, no name of a user or a machine.

use super::{Block, Chunks, JobError};
use crate::io::atomic::write_atomic;
use crate::io::identity::VERSION;
use crate::io::part::{PartHeader, PassRange};
use crate::math::exact;
use crate::render::session::NO_LIMIT;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::io::Write as _;
use std::path::{Component, Path};
use std::time::Duration;

/// Version of the form of job folders.
pub const FORMAT: u32 = 2;
/// Largest manifest.
pub const MAX_BYTES: u64 = 16 << 20;
/// Most files, and most bytes of all of them.
const MAX_FILES: usize = 100_000;
const MAX_FILE_BYTES: u64 = 1 << 40;
/// Limits of leases.
pub const LEASES: [Duration; 2] = [Duration::from_millis(200), Duration::from_secs(86_400)];

/// Copy of a file that was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Copy {
    /// As seen from the scene's folder: plain names with slashes between.
    pub name: String,
    /// Size.
    pub bytes: u64,
    /// SHA-256 in lower-case hexadecimal digits, the name of the copy in `files/`.
    pub sha256: String,
}

/// An error below which a job ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TargetError(#[serde(with = "exact")] pub f64);

/// Manifest: what a job renders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// [`FORMAT`].
    pub format: u32,
    /// Version of the program that made it.
    pub version: String,
    /// The file among `files` that is the scene.
    pub scene: String,
    /// Keys of the scene file that are replaced, with their values.
    pub overrides: Vec<(String, String)>,
    /// Header of its parts, without passes: scene, settings, sensor, film.
    pub header: PartHeader,
    /// Seed of all random numbers.
    pub seed: u64,
    /// One past the last pass.
    pub passes: u32,
    /// Passes of a chunk.
    pub chunk: u32,
    /// Error below which no more chunks are claimed.
    pub target_error: Option<TargetError>,
    /// Time without a sign of life after which a worker counts as dead.
    #[serde(with = "milliseconds")]
    pub lease_ms: Duration,
    /// Results of the pilots of the sensor and of each companion, the one file that is not of the
    /// scene.
    pub choices: Copy,
    /// Files of the scene.
    pub files: Vec<Copy>,
}

/// The parts of a manifest that every version has.
#[derive(Deserialize)]
struct Versions {
    format: u32,
    version: String,
}

impl Manifest {
    /// Chunks of the job.
    #[must_use]
    pub fn chunks(&self) -> Chunks {
        Chunks {
            passes: self.passes,
            size: self.chunk,
        }
    }

    /// Whether only the target error ends it.
    #[must_use]
    pub fn is_endless(&self) -> bool {
        self.passes == NO_LIMIT
    }

    /// Header of the part of a block.
    #[must_use]
    pub fn header_of(&self, block: &Block) -> PartHeader {
        let passes = self.chunks().passes_of(block);
        PartHeader {
            passes: vec![PassRange {
                seed: self.seed,
                start: passes.start.into(),
                end: passes.end.into(),
            }],
            ..self.header.clone()
        }
    }

    /// Bytes of a part at most, without its header.
    #[must_use]
    pub fn part_bytes(&self) -> u64 {
        self.header
            .sum_count()
            .unwrap_or(u64::MAX)
            .saturating_mul(16)
    }

    /// Reads a manifest from its text; `path` stands for it in messages.
    ///
    /// # Errors
    /// Another version, or anything that a manifest cannot hold.
    pub fn parse(text: &[u8], path: &Path) -> Result<Self, JobError> {
        let wrong = |e: serde_json::Error| JobError::format(path, format!("no job: {e}"));
        let Versions { format, version } = serde_json::from_slice(text).map_err(wrong)?;
        if version != VERSION {
            return Err(JobError::Version {
                path: path.to_owned(),
                job: version,
                own: VERSION,
            });
        }
        if format != FORMAT {
            let text = format!("a job of format {format}, this program has format {FORMAT}");
            return Err(JobError::format(path, text));
        }
        let manifest: Self = serde_json::from_slice(text).map_err(wrong)?;
        manifest
            .check()
            .map_err(|message| JobError::format(path, message))?;
        Ok(manifest)
    }

    /// Writes it.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), JobError> {
        let mut text =
            serde_json::to_vec_pretty(self).map_err(|e| JobError::format(path, e.to_string()))?;
        text.push(b'\n');
        Ok(write_atomic(path, |file| file.write_all(&text))?)
    }

    fn check(&self) -> Result<(), String> {
        self.header.check()?;
        if !self.header.passes.is_empty() || self.header.unfinished.is_some() {
            return Err("a header with passes of its own".to_owned());
        }
        if self.files.len() > MAX_FILES {
            return Err(format!("more than {MAX_FILES} files"));
        }
        let all = self.files.iter().chain([&self.choices]);
        let bytes = all.clone().map(|f| f.bytes);
        if bytes.fold(0, u64::saturating_add) > MAX_FILE_BYTES {
            return Err(format!("files of more than {MAX_FILE_BYTES} bytes"));
        }
        for copy in all {
            if !is_plain(&copy.name) {
                return Err(format!(
                    "\"{}\" leads out of the job (allowed: plain names with slashes between)",
                    copy.name.escape_debug()
                ));
            }
            if !is_sha256(&copy.sha256) {
                return Err(format!(
                    "\"{}\" is no SHA-256 in lower-case digits",
                    copy.sha256.escape_debug()
                ));
            }
        }
        let mut names: Vec<&str> = self.files.iter().map(|f| f.name.as_str()).collect();
        names.sort_unstable();
        if names.windows(2).any(|w| w[0] == w[1]) {
            return Err("a file stands in it twice".to_owned());
        }
        if !names.contains(&self.scene.as_str()) || self.scene.contains('/') {
            return Err("the scene is none of its files".to_owned());
        }
        if self.passes == 0 || self.passes > NO_LIMIT || self.chunk == 0 {
            return Err("no passes, more than 2^32 - 2, or none in a chunk".to_owned());
        }
        if self.is_endless() && self.target_error.is_none() {
            return Err("neither a number of passes nor a target error".to_owned());
        }
        if self.target_error.is_some_and(|TargetError(r)| r <= 0.0) {
            return Err("a target error that is not above 0".to_owned());
        }
        let [least, most] = LEASES;
        if !(least..=most).contains(&self.lease_ms) {
            return Err("a lease that is not 0.2 s to a day".to_owned());
        }
        Ok(())
    }
}

/// Whether a name leads from a folder to a file in it, on every system.
fn is_plain(name: &str) -> bool {
    let normal = |part: Component<'_>| matches!(part, Component::Normal(_));
    let written = |part: &str| !part.is_empty() && part != "." && part != "..";
    !name.is_empty()
        && name.len() <= 4096
        && !name.contains(['\\', ':', '\0'])
        && name.split('/').all(written)
        && Path::new(name).components().all(normal)
}

fn is_sha256(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'))
}

mod milliseconds {
    use super::{Deserialize, Deserializer, Duration, Serializer};

    pub fn serialize<S: Serializer>(value: &Duration, s: S) -> Result<S::Ok, S::Error> {
        s.serialize_u64(u64::try_from(value.as_millis()).unwrap_or(u64::MAX))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<Duration, D::Error> {
        u64::deserialize(d).map(Duration::from_millis)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn manifest() -> Manifest {
        let copy = |name: &str| Copy {
            name: name.to_owned(),
            bytes: 3,
            sha256: "0".repeat(64),
        };
        Manifest {
            format: FORMAT,
            version: VERSION.to_owned(),
            scene: "a.toml".to_owned(),
            overrides: vec![("render.spp".to_owned(), "3".to_owned())],
            header: PartHeader {
                version: VERSION.to_owned(),
                scene_hash: 1,
                settings_hash: u64::MAX,
                sensor: "main".to_owned(),
                width: 4,
                height: 4,
                crop: [0, 0, 4, 4],
                channels: 3,
                blocks: 0,
                exponent: 0,
                pilot: 0,
                image: BTreeMap::new(),
                passes: Vec::new(),
                unfinished: None,
                companions: Vec::new(),
                spectral: None,
            },
            seed: 0,
            passes: 10,
            chunk: 2,
            target_error: Some(TargetError(0.1)),
            lease_ms: Duration::from_secs(60),
            choices: copy("choices.json"),
            files: vec![copy("a.toml"), copy("meshes/b.obj")],
        }
    }

    fn refused(change: impl FnOnce(&mut Manifest)) -> String {
        let mut manifest = manifest();
        change(&mut manifest);
        let text = serde_json::to_vec(&manifest).expect("text");
        let error = Manifest::parse(&text, Path::new("job.json"));
        error.expect_err("refused").to_string()
    }

    #[test]
    fn comes_back() {
        let text = serde_json::to_vec(&manifest()).expect("text");
        let back = Manifest::parse(&text, Path::new("job.json")).expect("valid");
        assert_eq!(back, manifest());
    }

    #[test]
    fn hostile_ones_are_refused() {
        for name in [
            "../a",
            "/etc/passwd",
            "x/../../a",
            "x//a",
            "./a",
            "C:\\a",
            "c:a",
            "",
            ".",
            "a\0",
            "x/",
        ] {
            let error = refused(|m| m.files[1].name = name.to_owned());
            assert!(error.contains("leads out of the job"), "{name:?}: {error}");
        }
        for hash in ["", "../../../etc/passwd", &"A".repeat(64), &"0".repeat(63)] {
            let error = refused(|m| m.files[1].sha256 = hash.to_owned());
            assert!(error.contains("no SHA-256"), "{hash:?}: {error}");
        }
        type Case = (fn(&mut Manifest), &'static str);
        let cases: [Case; 10] = [
            (|m| m.header.crop = [0, 0, 5, 4], "crop"),
            (|m| m.files[1].bytes = u64::MAX, "bytes"),
            (|m| m.files[1].name = m.files[0].name.clone(), "twice"),
            (|m| m.scene = "b.toml".to_owned(), "none of its files"),
            (|m| m.passes = 0, "passes"),
            (|m| m.passes = u32::MAX, "passes"),
            (|m| m.chunk = 0, "chunk"),
            (|m| m.lease_ms = Duration::ZERO, "lease"),
            (|m| m.target_error = Some(TargetError(0.0)), "target error"),
            (
                |m| (m.passes, m.target_error) = (NO_LIMIT, None),
                "neither a number",
            ),
        ];
        for (change, expected) in cases {
            let error = refused(change);
            assert!(error.contains(expected), "{expected}: {error}");
        }
    }

    #[test]
    fn versions_are_named() {
        let error = refused(|m| m.version = "0.0.7".to_owned());
        let expected = format!("made by abbe 0.0.7, this is abbe {VERSION}");
        assert!(error.contains(&expected), "{error}");
        assert!(refused(|m| m.format = 9).contains("a job of format 9"));
    }
}
