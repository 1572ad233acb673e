//! The submitted tasks in the output of `sweep status`.

use crate::cluster::shard;
use crate::cluster::status::{JobStatus, TaskStatus};
use crate::error::Error;
use crate::report::table;
use std::io::Write;

/// Maximum number of tasks listed.
const ROWS: usize = 50;

pub(super) fn write(
    jobs: &[JobStatus],
    width: Option<u16>,
    out: &mut dyn Write,
    store: &std::path::Path,
) -> Result<(), Error> {
    for job in jobs {
        let s = &job.submission;
        let done = |task: &&TaskStatus| task.slice.ended == task.slice.cases;
        writeln!(
            out,
            "job {} on {}{}: {} tasks, {} of their slices done",
            s.job.as_deref().unwrap_or("without a number"),
            s.engine,
            if s.cancelled_at.is_some() {
                ", cancelled"
            } else {
                ""
            },
            job.tasks.len(),
            job.tasks.iter().filter(done).count(),
        )?;
        if let Some(problem) = &job.problem {
            writeln!(out, "its tasks are unknown: {problem}")?;
        }
        let open: Vec<&TaskStatus> = job.tasks.iter().filter(|task| !done(task)).collect();
        if open.is_empty() {
            continue;
        }
        let heads = "task state node restarts cases ended work published".split(' ');
        let rows = open.iter().take(ROWS).map(|task| {
            [
                task.number.to_string(),
                task.state.clone(),
                task.node.clone(),
                task.restarts.to_string(),
                task.slice.cases.to_string(),
                task.slice.ended.to_string(),
                format!("{:.0} %", 100.0 * task.slice.work_done),
                task.published_s.map_or_else(
                    || "–".into(),
                    |s| format!("{} ago", crate::text::format::duration(s)),
                ),
            ]
        });
        writeln!(out, "{}", table(width, heads, rows))?;
        if open.len() > ROWS {
            writeln!(out, "and {} more tasks", open.len() - ROWS)?;
        }
        let waiting = open.iter().any(|task| task.state == "ended");
        if waiting && job.problem.is_none() {
            writeln!(
                out,
                "tasks ended with work left: after `sweep merge {}`, `sweep submit` continues; their logs are in {}",
                store.display(),
                shard::plan_folder(&s.folder, &s.plan).display()
            )?;
        }
    }
    Ok(())
}
