//! The search for a chunk to work on, at a cost that grows neither with the number of chunks nor,
//! but for its logarithm, with that of workers.
//!
//! A worker remembers which chunks were open when it looked last. It tries to claim one of the
//! first of them, so that blocks become complete early, and doubles their number whenever somebody
//! has been faster. Only where nothing is found so are all claims listed. How long folders take to
//! list is measured: the next look waits for a hundred times as long, so that looking takes a
//! hundredth of a worker's time at most, on a slow disk and among many.

use super::blocks::{Open, outermost};
use super::claims::Claim;
use super::folder::Folder;
use super::{Block, JobError};
use std::collections::BTreeMap;
use std::ops::Range;
use std::time::{Duration, Instant};

/// Longest share of its time that a worker spends on looking is 1 in so many.
const SHARE: u32 = 100;
/// Looks within a lease at most.
const LOOKS: u32 = 4;
/// Further tries once all open chunks are in reach.
const MORE_TRIES: u32 = 4;
/// Free chunks of which one is tried, for each that somebody has claimed.
const SPREAD: usize = 2;

/// Next thing to do.
pub(super) enum Next {
    /// Render this.
    Chunk(Claim),
    /// Wait: others work on so many chunks.
    Wait(usize),
    /// Nothing: all chunks are done.
    Complete,
}

/// A thing that is done now and then: at most so often, and at most for 1 % of the time.
#[derive(Debug)]
pub(super) struct Pace {
    least: Duration,
    next: Option<Instant>,
}

impl Pace {
    /// For a job with such a lease.
    pub(super) fn new(lease: Duration) -> Self {
        Self {
            least: lease / LOOKS,
            next: None,
        }
    }

    /// Whether it is time.
    pub(super) fn is_due(&self) -> bool {
        self.next.is_none_or(|next| next <= Instant::now())
    }

    /// Notes that it was done just now, for so long.
    fn done(&mut self, took: Duration) {
        self.next = Instant::now().checked_add(self.least.max(took.saturating_mul(SHARE)));
    }

    /// Does it, and notes how long it takes.
    pub(super) fn measure<T>(&mut self, act: impl FnOnce() -> T) -> T {
        let began = Instant::now();
        let result = act();
        self.done(began.elapsed());
        result
    }

    /// Time until it is due.
    pub(super) fn wait(&self) -> Duration {
        let next = self
            .next
            .map(|n| n.saturating_duration_since(Instant::now()));
        next.unwrap_or_default()
    }
}

/// The search of one worker.
#[derive(Debug)]
pub(super) struct Search<'a> {
    job: &'a Folder,
    worker: &'a str,
    /// Chunks that it works on.
    all: Range<u32>,
    /// Those that were open at the last look, without those tried since.
    open: Open,
    look: Pace,
    /// Logarithm to base 2 of the number of open chunks among which it has found the last one.
    reach: u32,
}

impl<'a> Search<'a> {
    /// A search among some chunks.
    pub(super) fn new(job: &'a Folder, worker: &'a str, chunks: Option<Range<u32>>) -> Self {
        let count = job.manifest.chunks().count();
        let all = chunks.unwrap_or(0..count);
        Self {
            job,
            worker,
            all: all.start..all.end.min(count),
            open: Open::default(),
            look: Pace::new(job.manifest.lease_ms),
            reach: 0,
        }
    }

    /// Claims a chunk, or says why there is none to claim.
    pub(super) fn next(&mut self) -> Result<Next, JobError> {
        if self.look.is_due() {
            self.look(false)?;
            // the oldest is enough: the next one has its turn after the next look
            let oldest = self.open.iter().next();
            if let Some(claim) = oldest.and_then(|chunk| self.job.latest_claim(chunk))
                && let Some(claim) = self.inherit(claim)?
            {
                return Ok(Next::Chunk(claim));
            }
        }
        match self.near()? {
            Some(claim) => Ok(Next::Chunk(claim)),
            None => self.everywhere(),
        }
    }

    /// Time after which looking again is worth it.
    pub(super) fn pause(&self) -> Duration {
        self.look.wait()
    }

    /// Finds the chunks that are open now, and the latest claim of each that was claimed.
    fn look(&mut self, with_claims: bool) -> Result<BTreeMap<u32, u32>, JobError> {
        let job = self.job;
        let (claims, blocks) = self.look.measure(|| {
            // parts after claims: a chunk that is done in between is not taken for an open one
            let claims = with_claims.then(|| job.claims()).transpose()?;
            Ok::<_, JobError>((claims.unwrap_or_default(), outermost(&job.blocks()?)))
        })?;
        self.open = Open::among(&self.all, &blocks);
        Ok(claims)
    }

    /// Claims one of the first open chunks.
    fn near(&mut self) -> Result<Option<Claim>, JobError> {
        let (mut reach, mut more) = (self.reach.saturating_sub(1), MORE_TRIES);
        loop {
            let count = self.open.count();
            let near = count.min(1_u32.checked_shl(reach).unwrap_or(u32::MAX));
            let Some(chunk) = self.open.take(random_below(near)) else {
                return Ok(None);
            };
            let claim = Claim {
                chunk,
                generation: 0,
            };
            if self.claim(claim)? {
                self.reach = reach;
                return Ok(Some(claim));
            }
            if near < count {
                reach += 1;
            } else if more == 0 {
                return Ok(None);
            } else {
                more -= 1;
            }
        }
    }

    /// Claims any chunk that is not done and that nobody works on.
    fn everywhere(&mut self) -> Result<Next, JobError> {
        let claims = self.look(true)?;
        if self.open.count() == 0 {
            return Ok(Next::Complete);
        }
        let claimed: Vec<Claim> = claims
            .iter()
            .filter(|(chunk, _)| self.open.holds(**chunk))
            .map(|(&chunk, &generation)| Claim { chunk, generation })
            .collect();
        let free = self.open.iter().filter(|c| !claims.contains_key(c));
        let free: Vec<u32> = free.take(1 + SPREAD * claimed.len()).collect();
        let first = random_below(free.len() as u32) as usize;
        for i in 0..free.len() {
            let claim = Claim {
                chunk: free[(first + i) % free.len()],
                generation: 0,
            };
            if self.claim(claim)? {
                return Ok(Next::Chunk(claim));
            }
        }
        for claim in &claimed {
            if let Some(claim) = self.inherit(*claim)? {
                return Ok(Next::Chunk(claim));
            }
        }
        Ok(Next::Wait(claimed.len() + free.len()))
    }

    /// Claims a chunk whose worker is dead.
    fn inherit(&self, claim: Claim) -> Result<Option<Claim>, JobError> {
        if !self.job.is_abandoned(claim)? {
            return Ok(None);
        }
        let claim = Claim {
            generation: claim.generation.saturating_add(1),
            ..claim
        };
        Ok(self.claim(claim)?.then_some(claim))
    }

    /// Whether a claim is this worker's now, and worth it.
    fn claim(&self, claim: Claim) -> Result<bool, JobError> {
        if !self.job.claim(claim, self.worker)? {
            return Ok(false);
        }
        // done since the last look, its claims removed
        let is_done = self.job.is_done(&Block::of_chunk(claim.chunk));
        if is_done {
            self.job.release(claim);
        }
        Ok(!is_done)
    }
}

/// A random number below a limit; 0 without one.
fn random_below(limit: u32) -> u32 {
    use std::hash::{BuildHasher, RandomState};
    (RandomState::new().hash_one(0) % u64::from(limit.max(1))) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_slow_is_done_seldom() {
        let mut pace = Pace::new(Duration::from_millis(4));
        assert!(pace.is_due());
        pace.measure(|| std::thread::sleep(Duration::from_millis(20)));
        assert!(!pace.is_due());
        // a hundred times as long, of which some has passed
        assert!(pace.wait() > Duration::from_secs(1), "{pace:?}");
        let mut quick = Pace::new(Duration::from_secs(4000));
        assert_eq!(quick.measure(|| 7), 7);
        assert!(
            quick.wait() > Duration::from_secs(900) && quick.wait() <= Duration::from_secs(1000)
        );
    }
}
