//! `sweep cancel`.

use super::Output;
use super::place::StoreArguments;
use crate::cluster::status::cancel;
use crate::error::Error;
use crate::system::exit;

/// Cancel the submitted tasks of a campaign
///
/// Running tasks checkpoint and publish before they end; the command waits for them. `sweep submit`
/// continues from there.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: sweep cancel sweeps/figure-11.toml")]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let source = arguments.place.find()?;
    let answer = cancel(source.path())?;
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
