//! `sweep check`.

use super::Output;
use super::place::StoreArguments;
use crate::error::Error;
use crate::store::check;
use crate::system::exit;
use crate::text::format::counted;

/// Verify the contents of a store by its checksums
///
/// Reads only. Runs the integrity check of SQLite and compares every result, sample, failure and
/// frame with its digest. The exit code is 1 if something is damaged. `sweep run` recomputes
/// damaged runs with the same digits; `sweep merge NEW DAMAGED` recovers the intact part of an
/// unreadable file.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep check sweeps/quickstart.toml\n  sweep check sweeps/quickstart.toml --json"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let source = arguments.place.find()?;
    let checked = check(source.path())?;
    if output.json {
        output.json(&checked)?;
    } else {
        for finding in &checked.findings {
            let key = finding
                .key
                .as_ref()
                .map_or_else(String::new, |key| format!("run {key}: "));
            writeln!(output.out, "{key}{}", finding.what)?;
        }
        if let Some(warning) = &checked.warning {
            writeln!(output.out, "{warning}")?;
        }
        writeln!(
            output.out,
            "{}: {}, {}",
            source.path().display(),
            counted(checked.runs, "run"),
            counted(checked.findings.len(), "finding")
        )?;
    }
    Ok(if checked.findings.is_empty() {
        exit::DONE
    } else {
        exit::FAILED
    })
}
