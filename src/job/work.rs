//! Workers: claim a chunk, render it, put it to the others, until none is left.

use super::claims::{Claim, Report, is_worker_name};
use super::folder::{Folder, random_name};
use super::parts::Damaged;
use super::search::{Next, Pace, Search};
use super::status::error_of;
use super::thaw::Thawed;
use super::{Block, JobError};
use crate::io::part::{self, Part, PartError};
use crate::render::{Cancel, StopReason, StopRules};
use std::io::ErrorKind;
use std::ops::Range;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Signs of life within a lease.
const SIGNS: u32 = 4;
/// Longest wait for an interrupt.
const LOOK: Duration = Duration::from_millis(100);
/// How long errors of the disk other than a full one are waited for, and how often.
const PATIENCE: Duration = Duration::from_secs(600);
const RETRY: Duration = Duration::from_secs(1);

/// Wishes of a worker.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Name, to which random digits are added; `None`: those alone.
    pub name: Option<String>,
    /// Threads, to be told.
    pub threads: u32,
    /// Chunks to work on; `None`: all.
    pub chunks: Option<Range<u32>>,
    /// Ends while others work on the last chunks, instead of waiting for them to be done.
    pub leaves_last: bool,
}

/// News of a worker.
#[derive(Debug)]
pub enum Event<'a> {
    /// Beginning of a chunk.
    Begun {
        /// The chunk.
        chunk: u32,
        /// Passes of the chunk.
        passes: Range<u32>,
    },
    /// End of a chunk.
    Done {
        /// The chunk.
        chunk: u32,
        /// Time of its passes.
        time: Duration,
    },
    /// All chunks are done or claimed by workers that live.
    Waits {
        /// Chunks that others work on.
        chunks: usize,
    },
    /// Writing fails; it tries again.
    Paused(&'a JobError),
    /// Writing works again.
    Resumed,
    /// A part was set aside.
    Damaged(&'a Damaged),
}

/// Reason for which a worker ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// All chunks are done.
    Complete,
    /// The error is small enough.
    TargetReached(f64),
    /// Others work on all that is not done.
    OthersLeft,
    /// A request to stop.
    Interrupted,
}

/// Balance of a worker.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Full name of the worker.
    pub worker: String,
    /// Last sign of life: chunks and passes done.
    pub report: Report,
    /// Time since it began.
    pub elapsed: Duration,
    /// Time for claims, parts and merges: what is not spent on passes, nor on waiting.
    pub overhead: Duration,
    /// Reason for the end.
    pub end: End,
}

struct Worker<'a> {
    job: &'a Folder,
    scene: &'a Thawed,
    options: &'a Options,
    cancel: &'a Cancel,
    tell: &'a (dyn Fn(&Event) + Sync),
    name: String,
    report: Mutex<Report>,
}

/// Works on a job until nothing is left to do.
///
/// # Errors
/// The folder cannot be used, or the scene does not fit.
pub fn run(
    job: &Folder,
    scene: &Thawed,
    options: &Options,
    cancel: &Cancel,
    tell: &(dyn Fn(&Event) + Sync),
) -> Result<Summary, JobError> {
    let name = match &options.name {
        Some(name) => format!("{name}-{}", random_name()),
        None => random_name(),
    };
    if !is_worker_name(&name) {
        let text = "a worker's name has 1 to 60 letters, digits, \"-\", \"_\" and \".\"";
        return Err(JobError::format(job.path(), text));
    }
    let report = Report {
        threads: options.threads,
        ..Report::default()
    };
    let worker = Worker {
        job,
        scene,
        options,
        cancel,
        tell,
        name,
        report: Mutex::new(report),
    };
    // no claim before the first sign of life
    worker.show();
    let (end_of_life, life) = channel::<()>();
    let worker = &worker;
    let summary = thread::scope(|scope| {
        scope.spawn(move || worker.live(&life));
        let summary = worker.work();
        drop(end_of_life);
        summary
    });
    job.leave(&worker.name);
    summary
}

impl Worker<'_> {
    fn lease(&self) -> Duration {
        self.job.manifest.lease_ms
    }

    fn report(&self) -> Report {
        *self.report.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Report)) {
        change(&mut self.report.lock().unwrap_or_else(PoisonError::into_inner));
        self.show();
    }

    fn show(&self) {
        // a worker that cannot show life counts as dead, which costs others time and no more
        _ = self.job.show(&self.name, &self.report());
    }

    /// Shows life until the other end of the channel is gone.
    fn live(&self, life: &Receiver<()>) {
        let pause = self.lease() / SIGNS;
        while life.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
            self.show();
        }
    }

    fn work(&self) -> Result<Summary, JobError> {
        let (began, mut waited) = (Instant::now(), Duration::ZERO);
        let (mut target, mut was_waiting) = (Target::default(), false);
        let mut search = Search::new(self.job, &self.name, self.options.chunks.clone());
        let mut sweep = Pace::new(self.lease());
        let end = loop {
            if self.cancel.is_requested() {
                break End::Interrupted;
            }
            if sweep.is_due() {
                self.patiently(|| sweep.measure(|| self.job.sweep(self.lease())))?;
            }
            if let Some(error) = self.patiently(|| target.reached(self))? {
                break End::TargetReached(error);
            }
            match self.patiently(|| search.next())? {
                Next::Chunk(claim) => {
                    was_waiting = false;
                    if !self.chunk(claim)? {
                        self.job.release(claim);
                        break End::Interrupted;
                    }
                }
                Next::Wait(_) if self.options.leaves_last => break End::OthersLeft,
                Next::Wait(chunks) => {
                    if !std::mem::replace(&mut was_waiting, true) {
                        (self.tell)(&Event::Waits { chunks });
                    }
                    let start = Instant::now();
                    self.sleep(search.pause());
                    waited += start.elapsed();
                }
                Next::Complete => {
                    if self.patiently(|| self.merge_all())? {
                        break End::Complete;
                    }
                }
            }
        };
        let (report, elapsed) = (self.report(), began.elapsed());
        let rendered = Duration::try_from_secs_f64(report.seconds).unwrap_or_default();
        Ok(Summary {
            worker: self.name.clone(),
            report,
            elapsed,
            overhead: elapsed.saturating_sub(rendered + waited),
            end,
        })
    }

    /// Renders a chunk and puts it to the others. Whether it was not interrupted.
    fn chunk(&self, claim: Claim) -> Result<bool, JobError> {
        let chunk = claim.chunk;
        let block = Block::of_chunk(chunk);
        let passes = self.job.manifest.chunks().passes_of(&block);
        let count = passes.len() as u64;
        self.change(|report| report.chunk = Some(chunk));
        (self.tell)(&Event::Begun {
            chunk,
            passes: passes.clone(),
        });
        let began = Instant::now();
        let Some(part) = self.render(passes)? else {
            return Ok(false);
        };
        let time = began.elapsed();
        // a worker that counted as dead may find its chunk done
        if !self.job.is_done(&block) {
            self.patiently(|| Ok(self.job.put(&block, &part)?))?;
        }
        drop(part);
        self.change(|report| {
            report.chunk = None;
            report.chunks += 1;
            report.passes += count;
            report.seconds += time.as_secs_f64();
        });
        (self.tell)(&Event::Done { chunk, time });
        self.patiently(|| self.merge_up(block).map(drop))?;
        Ok(true)
    }

    fn render(&self, passes: Range<u32>) -> Result<Option<Part>, JobError> {
        let mut session = self.scene.session(passes, self.cancel.clone())?;
        let stop = session.run();
        Ok((stop == StopReason::Passes).then(|| part::of(&session)))
    }

    /// Merges the blocks that hold one. Whether nothing was damaged.
    fn merge_up(&self, block: Block) -> Result<bool, JobError> {
        let mut is_sound = true;
        let mut damaged = |found: &Damaged| {
            is_sound = false;
            (self.tell)(&Event::Damaged(found));
        };
        self.job.merge_up(block, &mut damaged)?;
        Ok(is_sound)
    }

    /// Merges what other workers have not come to. Whether nothing was damaged.
    fn merge_all(&self) -> Result<bool, JobError> {
        for block in super::blocks::outermost(&self.job.blocks()?) {
            if !self.merge_up(block)? {
                return Ok(false);
            }
        }
        self.job.sweep(self.lease())?;
        Ok(true)
    }

    fn sleep(&self, time: Duration) {
        let began = Instant::now();
        while began.elapsed() < time && !self.cancel.is_requested() {
            thread::sleep(LOOK.min(time));
        }
    }

    /// Does something that needs the disk, again and again while that is full, and for a while
    /// where it fails otherwise.
    fn patiently<T>(&self, mut act: impl FnMut() -> Result<T, JobError>) -> Result<T, JobError> {
        let (began, mut is_paused) = (Instant::now(), false);
        loop {
            let error = match act() {
                Ok(done) => {
                    if is_paused {
                        (self.tell)(&Event::Resumed);
                    }
                    return Ok(done);
                }
                Err(error) => error,
            };
            let may_pass = match disk_error(&error) {
                Some(ErrorKind::StorageFull | ErrorKind::QuotaExceeded) => true,
                Some(ErrorKind::FileTooLarge | ErrorKind::InvalidInput) | None => false,
                Some(_) => began.elapsed() < PATIENCE,
            };
            if !may_pass {
                return Err(error);
            }
            if !std::mem::replace(&mut is_paused, true) {
                (self.tell)(&Event::Paused(&error));
            }
            // what others may still be reading goes first
            _ = self.job.sweep(Duration::ZERO);
            self.sleep(RETRY);
            if self.cancel.is_requested() {
                return Err(JobError::Interrupted);
            }
        }
    }
}

fn disk_error(error: &JobError) -> Option<ErrorKind> {
    match error {
        JobError::File(e) | JobError::Part(PartError::File(e)) => Some(e.source.kind()),
        _ => None,
    }
}

/// The target error of a job, looked at as seldom as is safe.
#[derive(Debug, Default)]
struct Target {
    /// Passes and error when it was looked at last.
    last: Option<(u64, f64)>,
}

impl Target {
    /// The error of all parts that are there, if it is small enough.
    fn reached(&mut self, worker: &Worker) -> Result<Option<f64>, JobError> {
        let job = worker.job;
        let Some(target) = job.manifest.target_error else {
            return Ok(None);
        };
        let (target, chunks) = (target.0, job.manifest.chunks());
        let blocks = super::blocks::outermost(&job.blocks()?);
        let passes = blocks.iter().map(|b| chunks.passes_of(b).len() as u64);
        let passes: u64 = passes.sum();
        // no error falls faster than the number of passes grows
        let is_far = |(then, error): (u64, f64)| error * then as f64 > target * passes as f64;
        if passes == 0 || self.last.is_some_and(is_far) {
            return Ok(None);
        }
        let tell = |found: &Damaged| (worker.tell)(&Event::Damaged(found));
        let Some(sum) = job.sum(tell)? else {
            return Ok(None);
        };
        let passes = sum.header.pass_count();
        let error = error_of(&sum)?.map(|e| e.relative);
        self.last = error.map(|e| (passes, e));
        let rules = StopRules {
            target_error: Some(target),
            ..StopRules::default()
        };
        let stop = rules.check(passes as usize, Duration::ZERO, || error);
        Ok(error.filter(|_| stop.is_some()))
    }
}
