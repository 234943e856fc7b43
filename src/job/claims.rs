//! Claims: which worker renders a chunk.
//!
//! A claim is a file `CHUNK.GENERATION` that only one process can create. Each worker shows that it
//! lives by a file in `workers/` that it writes again and again. Where the worker of the latest
//! claim has not done so for the time of a lease, by the clock of the disk, the chunk can be
//! claimed in the next generation. Nothing is taken away from anybody, so that no two processes can
//! take the same claim, and a worker that comes back to life does no harm: what it renders is what
//! the other one has rendered.

use super::JobError;
use super::folder::{Folder, check_unlinked, modified, read_unlinked};
use crate::io::atomic::FileError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

/// Longest sign of life, and longest name of a worker.
const MAX_BYTES: u64 = 4096;
const MAX_NAME: usize = 80;

/// A worker's sign of life: what it has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Report {
    /// Threads.
    pub threads: u32,
    /// Chunk that it renders.
    pub chunk: Option<u32>,
    /// Chunks that it has done.
    pub chunks: u32,
    /// Passes that it has done.
    pub passes: u64,
    /// Time that these took, in seconds.
    pub seconds: f64,
}

/// A worker as others see it.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// Name.
    pub worker: String,
    /// Last sign of life.
    pub report: Report,
    /// Age of that.
    pub age: Duration,
    /// Whether it is older than a lease.
    pub is_dead: bool,
}

/// A chunk that this process renders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Claim {
    /// The chunk.
    pub chunk: u32,
    /// How many have claimed it before.
    pub generation: u32,
}

/// Whether a name can be that of a worker.
#[must_use]
pub fn is_worker_name(name: &str) -> bool {
    let allowed = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'-' | b'_' | b'.');
    (1..=MAX_NAME).contains(&name.len()) && name.bytes().all(allowed) && !name.starts_with('.')
}

fn parse(name: &str) -> Option<Claim> {
    let (chunk, generation) = name.split_once('.')?;
    let number = |text: &str| {
        let is_plain = text.bytes().all(|b| b.is_ascii_digit());
        is_plain.then(|| text.parse().ok()).flatten()
    };
    let claim = Claim {
        chunk: number(chunk)?,
        generation: number(generation)?,
    };
    (name == claim.name()).then_some(claim)
}

impl Claim {
    fn name(&self) -> String {
        format!("{:08}.{}", self.chunk, self.generation)
    }
}

/// Age of something that was written at a moment; none of what is from the future.
fn age(now: SystemTime, then: SystemTime) -> Duration {
    now.duration_since(then).unwrap_or_default()
}

impl Folder {
    /// Latest claim of each chunk that has any.
    pub(super) fn claims(&self) -> Result<BTreeMap<u32, u32>, JobError> {
        let mut latest = BTreeMap::new();
        for claim in self.names("claims")?.iter().filter_map(|n| parse(n)) {
            let generation = latest.entry(claim.chunk).or_insert(claim.generation);
            *generation = claim.generation.max(*generation);
        }
        Ok(latest)
    }

    fn claim_path(&self, claim: Claim) -> PathBuf {
        self.at("claims").join(claim.name())
    }

    /// Claims a chunk. Whether nobody else has.
    pub(super) fn claim(&self, claim: Claim, worker: &str) -> Result<bool, FileError> {
        let path = self.claim_path(claim);
        let mut file = match File::options().write(true).create_new(true).open(&path) {
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => return Ok(false),
            made => made.map_err(|e| FileError::new(&path, e))?,
        };
        file.write_all(worker.as_bytes()).map_err(|e| {
            // nobody's claim would stay for a lease
            self.release(claim);
            FileError::new(&path, e)
        })?;
        Ok(true)
    }

    /// The latest claim of a chunk.
    pub(super) fn latest_claim(&self, chunk: u32) -> Option<Claim> {
        let claims = (0..).map(|generation| Claim { chunk, generation });
        let is_there = |c: &Claim| self.claim_path(*c).symlink_metadata().is_ok();
        claims.take_while(is_there).last()
    }

    /// Gives a claim back.
    pub(super) fn release(&self, claim: Claim) {
        // one that stays is that of a dead worker
        _ = fs::remove_file(self.claim_path(claim));
    }

    /// Removes all claims of a chunk: one that is done, or whose part was lost.
    pub(super) fn release_all(&self, chunk: u32) {
        let claims = (0..).map(|generation| Claim { chunk, generation });
        let remove = |c: &Claim| fs::remove_file(self.claim_path(*c)).is_ok();
        claims.take_while(remove).for_each(drop);
    }

    /// The worker of a claim; `None` where it is gone or nobody can be meant.
    pub(super) fn owner(&self, claim: Claim) -> Option<String> {
        let text = read_unlinked(&self.claim_path(claim), MAX_BYTES).ok()?;
        let name = String::from_utf8(text).ok()?;
        is_worker_name(&name).then_some(name)
    }

    /// Whether nobody works on a claim: neither it nor its worker has shown life for a lease.
    pub(super) fn is_abandoned(&self, claim: Claim) -> Result<bool, JobError> {
        let now = self.now()?;
        let shown = match modified(&self.claim_path(claim)) {
            Ok(at) => at,
            // released meanwhile
            Err(_) => return Ok(false),
        };
        let owner = self.owner(claim).map(|worker| self.worker_path(&worker));
        let alive = owner.and_then(|path| modified(&path).ok());
        let last = alive.map_or(shown, |alive| alive.max(shown));
        Ok(age(now, last) > self.manifest.lease_ms)
    }

    fn worker_path(&self, worker: &str) -> PathBuf {
        self.at("workers").join(worker)
    }

    /// Shows that a worker lives.
    pub(super) fn show(&self, worker: &str, report: &Report) -> io::Result<()> {
        let path = self.worker_path(worker);
        if path.symlink_metadata().is_ok() {
            check_unlinked(&path)?;
        }
        fs::write(path, serde_json::to_vec(report)?)
    }

    /// Ends a worker.
    pub(super) fn leave(&self, worker: &str) {
        // one that stays will count as dead
        _ = fs::remove_file(self.worker_path(worker));
    }

    /// All workers that have not left, by name.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn workers(&self) -> Result<Vec<Seen>, JobError> {
        let now = self.now()?;
        let mut names = self.names("workers")?;
        names.retain(|name| is_worker_name(name));
        names.sort_unstable();
        let seen = |worker: String| {
            let path = self.worker_path(&worker);
            let age = age(now, modified(&path).ok()?);
            // while it is written it is empty
            let text = read_unlinked(&path, MAX_BYTES).unwrap_or_default();
            Some(Seen {
                worker,
                report: serde_json::from_slice(&text).unwrap_or_default(),
                age,
                is_dead: age > self.manifest.lease_ms,
            })
        };
        Ok(names.into_iter().filter_map(seen).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_claims_are_exact() {
        let claim = Claim {
            chunk: 17,
            generation: 3,
        };
        assert_eq!(claim.name(), "00000017.3");
        assert_eq!(parse("00000017.3"), Some(claim));
        for bad in [
            "17.3",
            "00000017",
            "00000017.+3",
            "00000017.03",
            "x.0",
            ".abbe-1.tmp",
        ] {
            assert_eq!(parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn names_of_workers_lead_nowhere() {
        for good in ["a", "node-17_b.3", &"x".repeat(80)] {
            assert!(is_worker_name(good), "{good}");
        }
        for bad in [
            "",
            ".",
            "..",
            "../a",
            "a/b",
            "a b",
            ".a",
            "ä",
            &"x".repeat(81),
        ] {
            assert!(!is_worker_name(bad), "{bad}");
        }
    }
}
