//! `abbe job status`: how far a job is.

use super::run::damage;
use super::time_text;
use crate::cli::args::StatusOptions;
use crate::cli::{CliError, Outcome, print, tell};
use crate::job::Folder;
use crate::job::claims::Seen;
use crate::job::status::{Status, error_of};
use crate::render::ErrorEstimate;
use crate::report::readable::counted;
use serde_json::json;
use std::time::Duration;

/// Knowledge of a job.
struct Known {
    status: Status,
    error: Option<ErrorEstimate>,
    target: Option<f64>,
    left: Option<Duration>,
}

/// Runs the command.
pub fn run(options: &StatusOptions) -> Result<Outcome, CliError> {
    let job = Folder::open(&options.job)?;
    let error = if options.quick {
        None
    } else {
        let sum = job.sum(|found| tell(&damage(found)))?;
        sum.map(|sum| error_of(&sum)).transpose()?.flatten()
    };
    // after damaged parts were set aside
    let status = job.status()?;
    let target = job.manifest.target_error.map(|t| t.0);
    let expected = status.expected_passes(error.map(|e| e.relative), target);
    let known = Known {
        left: expected.and_then(|passes| status.time_left(passes)),
        status,
        error,
        target,
    };
    print(&if options.json {
        format!("{:#}\n", known.json())
    } else {
        known.text(&options.job.display().to_string())
    })?;
    Ok(Outcome::Done)
}

impl Known {
    fn text(&self, job: &str) -> String {
        let s = &self.status;
        let of = |all: Option<u32>| all.map_or_else(String::new, |all| format!(" of {all}"));
        let mut text = format!(
            "{job}: {}{} chunks done, {} running, {} dead; {}{} passes in {}\n",
            s.done,
            of(s.chunks),
            s.running,
            s.dead,
            s.passes_done,
            of(s.passes),
            counted(s.parts as u64, "part", "parts"),
        );
        if s.damaged > 0 {
            let parts = counted(s.damaged as u64, "part", "parts");
            text += &format!("  damaged   {parts} set aside\n");
        }
        if let Some(error) = &self.error {
            let target = self.target.map_or_else(String::new, |target| {
                format!(", to become {:.3} %", 100.0 * target)
            });
            text += &format!("  error     {:.3} %{target}\n", 100.0 * error.relative);
        }
        let alive = s.workers.iter().filter(|w| !w.is_dead).count();
        if let Some(left) = self.left {
            let workers = counted(alive as u64, "worker", "workers");
            text += &format!("  left      about {} with {workers}\n", time_text(left));
        }
        for Seen {
            worker,
            report,
            age,
            is_dead,
        } in &s.workers
        {
            let state = match report.chunk {
                _ if *is_dead => format!("dead, last seen {} ago", time_text(*age)),
                Some(chunk) => format!("works on chunk {chunk}"),
                None => "waits".to_owned(),
            };
            text += &format!(
                "  {worker}  {}, {}, {state}\n",
                counted(report.threads.into(), "thread", "threads"),
                counted(report.passes, "pass", "passes"),
            );
        }
        text
    }

    fn json(&self) -> serde_json::Value {
        let s = &self.status;
        let worker = |w: &Seen| {
            json!({
                "worker": w.worker, "dead": w.is_dead, "age_s": w.age.as_secs_f64(),
                "threads": w.report.threads, "chunk": w.report.chunk, "chunks": w.report.chunks,
                "passes": w.report.passes, "seconds": w.report.seconds,
            })
        };
        json!({
            "chunks": s.chunks, "done": s.done, "running": s.running, "dead": s.dead,
            "passes": s.passes, "passes_done": s.passes_done, "parts": s.parts,
            "damaged": s.damaged, "error": self.error.map(|e| e.relative),
            "target_error": self.target, "left_s": self.left.map(|t| t.as_secs_f64()),
            "workers": s.workers.iter().map(worker).collect::<Vec<_>>(),
        })
    }
}
