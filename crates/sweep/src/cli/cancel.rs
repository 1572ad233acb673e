//! `sweep cancel`.

use super::Output;
use super::place::StoreArguments;
use crate::cluster::status::cancel;
use crate::error::Error;
use crate::system::exit;
use std::time::Duration;

/// Cancel the submitted tasks of a campaign
///
/// Running tasks checkpoint and publish before they end; the command waits for them. `sweep submit`
/// continues from there.
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
    /// Maximum seconds to wait for the tasks
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
            "no tasks of this campaign are pending or running"
        )?;
    } else {
        writeln!(output.out, "cancelled: {}", answer.cancelled.join(", "))?;
        if answer.ending > 0 {
            let ending = answer.ending;
            writeln!(output.out, "{ending} tasks have not ended yet")?;
        }
        writeln!(
            output.out,
            "`sweep merge {}` collects their results; `sweep submit` continues from there",
            arguments.place.file.display()
        )?;
    }
    Ok(exit::DONE)
}
