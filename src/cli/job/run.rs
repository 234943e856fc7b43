//! `abbe job run`: a worker.

use super::time_text;
use crate::cli::args::RunOptions;
use crate::cli::{CliError, Outcome, interrupt, memory, print, tell, threads};
use crate::job::work::{self, End, Event, Summary};
use crate::job::{Folder, JobError, thaw};
use crate::report::readable::counted;
use std::ops::Range;
use std::sync::Mutex;

/// Runs the command.
pub fn run(options: &RunOptions) -> Result<Outcome, CliError> {
    let job = Folder::open(&options.job)?;
    check_chunks(&job, options.chunks.as_ref())?;
    let pool = threads::pool(options.threads)?;
    let scene = memory::guarded(None, || pool.install(|| thaw::scene(&job)))??;
    let interrupts = interrupt::listen()?;
    let wishes = work::Options {
        name: options.worker.clone(),
        threads: pool.current_num_threads() as u32,
        chunks: options.chunks.clone(),
        leaves_last: options.no_wait,
    };
    // whether all that was said could be: if not, the work goes on
    let printed = Mutex::new(Ok(()));
    let say = |text: String| {
        if let Ok(mut printed) = printed.lock()
            && !options.quiet
            && printed.is_ok()
        {
            *printed = print(&text);
        }
    };
    let tell = |event: &Event| news(event, &say);
    let done = pool.install(|| work::run(&job, &scene, &wishes, interrupts.cancel(), &tell));
    let summary = match done {
        Err(JobError::Interrupted) => return Ok(Outcome::Interrupted),
        done => done?,
    };
    say(balance(&summary, options.chunks.is_some()));
    let is_interrupted = summary.end == End::Interrupted;
    printed.into_inner().unwrap_or(Ok(()))?;
    Ok(if is_interrupted {
        Outcome::Interrupted
    } else {
        Outcome::Done
    })
}

/// Refuses chunks that a job does not have.
fn check_chunks(job: &Folder, asked: Option<&Range<u32>>) -> Result<(), CliError> {
    let count = job.manifest.chunks().count();
    match asked {
        Some(asked) if asked.end > count => Err(CliError::Usage(format!(
            "--chunks {}..{}: no such chunks (allowed: A..B with 0 <= A < B <= {count})",
            asked.start, asked.end
        ))),
        _ => Ok(()),
    }
}

fn news(event: &Event, say: &dyn Fn(String)) {
    match event {
        Event::Begun { chunk, passes } => {
            say(format!(
                "chunk {chunk}: passes {}..{}\n",
                passes.start, passes.end
            ));
        }
        Event::Done { chunk, time } => {
            say(format!("chunk {chunk}: done in {}\n", time_text(*time)));
        }
        Event::Waits { chunks } => {
            let chunks = counted(*chunks as u64, "chunk", "chunks");
            say(format!("waits for others, who work on {chunks}\n"));
        }
        Event::Paused(error) => {
            tell(&format!(
                "warning: {error}; paused until it works again (an interrupt gives up)"
            ));
        }
        Event::Resumed => tell("warning: it works again: nothing is lost"),
        Event::Damaged(found) => tell(&damage(found)),
    }
}

/// A damaged part in words.
pub(super) fn damage(found: &crate::job::parts::Damaged) -> String {
    let (first, last) = (found.block.start, found.block.end - 1);
    let chunks = if first == last {
        format!("chunk {first} is")
    } else {
        format!("chunks {first} to {last} are")
    };
    format!(
        "warning: {}; set aside as {}: {chunks} to be rendered again",
        found.message,
        found.path.display()
    )
}

/// Balance of a worker in words, of `chosen` chunks or of all.
fn balance(summary: &Summary, chosen: bool) -> String {
    let Summary {
        worker,
        report,
        elapsed,
        overhead,
        end,
    } = summary;
    let end = match end {
        End::Complete if chosen => "the chunks asked for are done".to_owned(),
        End::Complete => "all chunks are done".to_owned(),
        End::TargetReached(error) => format!("the error is {:.3} %", 100.0 * error),
        End::OthersLeft => "others work on what is left".to_owned(),
        End::Interrupted => "interrupted".to_owned(),
    };
    format!(
        "worker {worker}: {}, {} in {}, {:.2} % for claims and parts; {end}\n",
        counted(report.chunks.into(), "chunk", "chunks"),
        counted(report.passes, "pass", "passes"),
        time_text(*elapsed),
        100.0 * overhead.as_secs_f64() / elapsed.as_secs_f64().max(1e-9),
    )
}
