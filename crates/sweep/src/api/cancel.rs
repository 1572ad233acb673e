//! Ending the tasks of a campaign that were submitted.

use super::Error;
use crate::cluster::{Scheduler, shard};
use crate::store::{Store, Submission};
use serde::Serialize;
use std::path::Path;
use std::time::{Duration, Instant};

/// Time from one look at tasks that are ending to the next.
const LOOK: Duration = Duration::from_secs(1);

/// What was cancelled.
#[derive(Serialize)]
pub(crate) struct Cancelled {
    pub(crate) cancelled: Vec<String>,
    /// Tasks that have not ended yet.
    pub(crate) ending: usize,
}

/// Ends the tasks of one job, or of all of the campaign, and waits for that long until they have ended.
pub(crate) fn cancel(path: &Path, job: Option<&str>, wait: Duration) -> Result<Cancelled, Error> {
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
