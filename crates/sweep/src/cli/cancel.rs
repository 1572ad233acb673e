//! `sweep cancel`.

use super::Output;
use super::place::StoreArguments;
use crate::api::Error;
use crate::cluster::{Scheduler, shard};
use crate::exit;
use crate::store::{Store, Submission};
use serde::Serialize;
use std::path::Path;
use std::time::{Duration, Instant};

/// End the tasks of a campaign that were submitted
///
/// Tasks at work checkpoint and publish before they end, and are waited for. `sweep submit` goes on from there.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep cancel sweeps/figure-11.toml\n  sweep cancel results/figure-11.sqlite --job 4711"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// Only this job [default: all of the campaign]
    #[arg(long, value_name = "JOB")]
    job: Option<String>,
    /// Seconds the tasks are waited for at most
    #[arg(long, default_value_t = 120, value_name = "SECONDS")]
    wait: u64,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let source = arguments.place.find()?;
    let wait = Duration::from_secs(arguments.wait);
    let answer = cancel(source.path(), arguments.job.as_deref(), wait)?;
    if output.json {
        output.json(&answer)?;
    } else if answer.cancelled.is_empty() {
        writeln!(
            output.out,
            "no tasks of this campaign are waiting or at work"
        )?;
    } else {
        writeln!(output.out, "cancelled: {}", answer.cancelled.join(", "))?;
        if answer.ending > 0 {
            let ending = answer.ending;
            writeln!(output.out, "{ending} tasks have not ended yet")?;
        }
        writeln!(
            output.out,
            "`sweep merge {}` takes over what they computed; `sweep submit` goes on from there",
            arguments.place.file.display()
        )?;
    }
    Ok(exit::DONE)
}

/// Time from one look at tasks that are ending to the next.
const LOOK: Duration = Duration::from_secs(1);

/// What was cancelled.
#[derive(Serialize)]
struct Cancelled {
    cancelled: Vec<String>,
    /// Tasks that have not ended yet.
    ending: usize,
}

/// Ends the tasks of one job, or of all of the campaign, and waits for that long until they have ended.
fn cancel(path: &Path, job: Option<&str>, wait: Duration) -> Result<Cancelled, Error> {
    let mut store = Store::open(path)?;
    let mut cancelled: Vec<(String, Scheduler)> = Vec::new();
    let named = |submission: &Submission| job.is_none() || submission.job.as_deref() == job;
    let submissions = store.submissions()?;
    if job.is_some() && !submissions.iter().any(named) {
        return Err(Error::Argument {
            argument: "--job",
            message: "no such job was submitted from this store".into(),
        });
    }
    for submission in submissions.iter().filter(|submission| named(submission)) {
        let (Some(job), Some(scheduler)) =
            (&submission.job, Scheduler::by_name(&submission.engine))
        else {
            continue;
        };
        if scheduler.active(job)?.is_empty() {
            continue;
        }
        // Before they are told: a task that finds the mark does not ask to be started again.
        let mark = shard::cancel_mark(&submission.folder, &submission.plan, job);
        if let Some(folder) = mark.parent() {
            let _ = std::fs::create_dir_all(folder);
        }
        // Without it the tasks ask Slurm, and find out as well.
        let _ = std::fs::write(&mark, "");
        scheduler.cancel(job)?;
        store.cancelled(submission.id)?;
        cancelled.push((job.clone(), scheduler));
    }
    let begun = Instant::now();
    let ending = loop {
        let mut ending = 0;
        for (job, scheduler) in &cancelled {
            ending += scheduler.active(job)?.len();
        }
        if ending == 0 || begun.elapsed() >= wait {
            break ending;
        }
        std::thread::sleep(LOOK);
    };
    Ok(Cancelled {
        cancelled: cancelled.into_iter().map(|(job, _)| job).collect(),
        ending,
    })
}
