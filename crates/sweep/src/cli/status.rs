//! `sweep status`.

use super::{Output, store_path};
use crate::error::Error;
use crate::exit;
use crate::report::duration;
use crate::store::{Counts, FailureLine, ProcessLine, Store};
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
}

/// Writes the status.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let store = Store::open_read_only(&store_path(&arguments.store)?)?;
    let (total, done) = store.work()?;
    let status = Status {
        campaign: store.campaign_name()?,
        cases: store.counts()?,
        work_done: if total > 0.0 { done / total } else { 1.0 },
        processes: store.processes()?,
        failures: store.failures(arguments.failures)?,
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
