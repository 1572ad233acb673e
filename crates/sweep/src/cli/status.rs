//! `sweep status`.

mod tasks;

use super::{Output, store_path};
use crate::error::Error;
use crate::exit;
use crate::report::duration;
use crate::store::{Counts, Disagreement, FailureLine, ProcessLine, Store};
use serde::Serialize;
use std::path::PathBuf;

/// Say how far a campaign is
///
/// Reads only, needs no write access, and may be used while the campaign runs.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep status results/quickstart.sqlite\n  sweep status sweeps/quickstart.toml --json"
)]
pub(crate) struct Arguments {
    /// The store, or a campaign file whose default store is meant
    store: PathBuf,
    /// Failures listed at most
    #[arg(long, default_value_t = 10, value_name = "N")]
    failures: u32,
}

/// The answer.
#[derive(Serialize)]
struct Status {
    /// Name of the campaign.
    campaign: String,
    /// Cases by state.
    cases: Counts,
    /// Share of the estimated work that is done, 0 to 1.
    work_done: f64,
    /// Processes that own cases.
    processes: Vec<ProcessLine>,
    /// Failed cases.
    failures: Vec<FailureLine>,
    /// Jobs that were submitted, with their tasks.
    jobs: Vec<tasks::Jobs>,
    /// Published shards that were not merged, or have changed since.
    unmerged_shards: u64,
    /// Results of one case that do not agree bit for bit.
    disagreements: Vec<Disagreement>,
    /// Shards of another build that were let in.
    mixed_shards: u64,
}

/// Writes the status.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let path = store_path(&arguments.store)?;
    let store = Store::open_read_only(&path)?;
    let (total, done) = store.work()?;
    let status = Status {
        campaign: store.campaign_name()?,
        cases: store.counts()?,
        work_done: if total > 0.0 { done / total } else { 1.0 },
        processes: store.processes()?,
        failures: store.failures(arguments.failures)?,
        jobs: tasks::jobs(&store)?,
        unmerged_shards: store.unmerged(&crate::cluster::shard::folder_of(&path))?,
        disagreements: store.disagreements()?,
        mixed_shards: store.mixed_shards()?,
    };
    if output.json {
        output.json(&status)?;
        return Ok(exit::DONE);
    }
    let c = &status.cases;
    let mut table = crate::report::table(output.width);
    table.set_header(["cases", "done", "jammed", "failed", "running", "pending"]);
    table.add_row([c.total(), c.done, c.jammed, c.failed, c.running, c.pending]);
    let out = &mut *output.out;
    writeln!(
        out,
        "{}: about {:.1} % of the work is done",
        status.campaign,
        100.0 * status.work_done
    )?;
    writeln!(out, "{table}")?;
    for process in &status.processes {
        writeln!(
            out,
            "process {} on {}: {} cases, last heard of {} ago",
            process.pid,
            process.host,
            process.running,
            duration(process.silent_s)
        )?;
    }
    tasks::write(&status.jobs, output.width, out, &arguments.store)?;
    if status.unmerged_shards > 0 {
        writeln!(
            out,
            "{} shards are newer than the store: sweep merge {}",
            status.unmerged_shards,
            arguments.store.display()
        )?;
    }
    if !status.disagreements.is_empty() {
        writeln!(
            out,
            "{} results do not agree bit for bit with another attempt: sweep merge {} lists them",
            status.disagreements.len(),
            arguments.store.display()
        )?;
    }
    if status.mixed_shards > 0 {
        writeln!(
            out,
            "{} shards of another build of sweep were let in",
            status.mixed_shards
        )?;
    }
    for failure in &status.failures {
        writeln!(
            out,
            "failed: {} seed {} at strain {:.3}, attempt {}: {}",
            failure.key, failure.seed, failure.strain, failure.attempt, failure.error
        )?;
    }
    if !status.failures.is_empty() {
        writeln!(
            out,
            "the state before a failure: sweep replay {} KEY | sweep solve -",
            arguments.store.display()
        )?;
    }
    Ok(exit::DONE)
}
