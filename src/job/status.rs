//! The state of a job: what is done, who works, the error reached, and the time that is left for
//! the workers there are.

use super::blocks::{is_in, outermost};
use super::claims::{Claim, Seen};
use super::folder::Folder;
use super::{Block, JobError};
use crate::film::AddSumsError;
use crate::io::image::films_of_part;
use crate::io::part::Part;
use crate::render::ErrorEstimate;
use crate::render::error::error_estimate;
use std::time::Duration;

/// State of a job.
#[derive(Clone, Debug)]
pub struct Status {
    /// Chunks; `None` where only the error ends the job.
    pub chunks: Option<u32>,
    /// Chunks whose sums are there.
    pub done: u32,
    /// Chunks on which a worker works that lives.
    pub running: u32,
    /// Chunks whose worker has died.
    pub dead: u32,
    /// Passes done.
    pub passes_done: u64,
    /// Passes in all; `None` where only the error ends the job.
    pub passes: Option<u32>,
    /// Parts that hold what is done.
    pub parts: usize,
    /// Parts set aside.
    pub damaged: usize,
    /// Workers.
    pub workers: Vec<Seen>,
}

impl Folder {
    /// The state of the job.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn status(&self) -> Result<Status, JobError> {
        let workers = self.workers()?;
        let claims = self.claims()?;
        let blocks = outermost(&self.blocks()?);
        let lives = |worker: &str| workers.iter().any(|w| w.worker == worker && !w.is_dead);
        let (mut running, mut dead) = (0, 0);
        for (&chunk, &generation) in claims.iter().filter(|c| !is_in(&blocks, *c.0)) {
            let owner = self.owner(Claim { chunk, generation });
            if owner.is_some_and(|owner| lives(&owner)) {
                running += 1;
            } else {
                dead += 1;
            }
        }
        let (manifest, all) = (&self.manifest, self.manifest.chunks());
        let passes = blocks.iter().map(|b| all.passes_of(b).len() as u64).sum();
        let is_endless = manifest.is_endless();
        Ok(Status {
            chunks: (!is_endless).then(|| all.count()),
            done: blocks.iter().map(Block::len).sum(),
            running,
            dead,
            passes_done: passes,
            passes: (!is_endless).then_some(manifest.passes),
            parts: blocks.len(),
            damaged: self.names("damaged")?.len(),
            workers,
        })
    }
}

impl Status {
    /// Passes per second of the workers that live; 0 where none has done a chunk.
    #[must_use]
    pub fn rate(&self) -> f64 {
        let alive = self.workers.iter().filter(|w| !w.is_dead);
        let reports = alive.map(|w| w.report).filter(|r| r.seconds > 0.0);
        reports.map(|r| r.passes as f64 / r.seconds).sum()
    }

    /// Passes that the job will have: to the last, or to the target error where `error` falls with
    /// the root of their number. `None` where that is unknown.
    #[must_use]
    pub fn expected_passes(&self, error: Option<f64>, target: Option<f64>) -> Option<f64> {
        let by_error = error.zip(target).map(|(error, target)| {
            let done = self.passes_done as f64;
            done * (error / target).powi(2).max(1.0)
        });
        let all = self.passes.map(f64::from);
        match (by_error, all) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }

    /// Time that so many passes will still take the workers that live.
    #[must_use]
    pub fn time_left(&self, expected_passes: f64) -> Option<Duration> {
        let left = expected_passes - self.passes_done as f64;
        if left <= 0.0 {
            return Some(Duration::ZERO);
        }
        Duration::try_from_secs_f64(left / self.rate()).ok()
    }
}

/// The error of a part: of several films the largest.
///
/// # Errors
/// The sums do not fit the header.
pub fn error_of(part: &Part) -> Result<Option<ErrorEstimate>, AddSumsError> {
    let odd = |end: u64| end / 2;
    let odd = part.header.passes.iter().map(|p| odd(p.end) - odd(p.start));
    let odd: u64 = odd.sum();
    let even = part.header.pass_count() - odd;
    let films = films_of_part(part)?;
    let errors = films.iter().filter_map(|f| error_estimate(f, even, odd));
    Ok(errors.reduce(|a, b| if b.relative > a.relative { b } else { a }))
}
