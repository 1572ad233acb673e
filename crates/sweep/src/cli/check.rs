//! `sweep check`.

use super::Output;
use crate::api::Error;
use crate::exit;
use crate::store::check;
use std::path::PathBuf;

/// Compare all of a store with what was written
///
/// Only reads. Runs the integrity check of SQLite, and compares every result, sample, failure and frame with its digest. The exit
/// code is 1 if something is damaged. `sweep run` computes damaged runs again, with the same digits; from a file whose pages cannot
/// be read any more `sweep merge NEW DAMAGED` takes what is whole.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep check results/figure-11.sqlite\n  sweep check results/figure-11.sqlite --json"
)]
pub(crate) struct Arguments {
    /// The store
    store: PathBuf,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let checked = check(&arguments.store)?;
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
            "{}: {} runs, {} findings",
            arguments.store.display(),
            checked.runs,
            checked.findings.len()
        )?;
    }
    Ok(if checked.findings.is_empty() {
        exit::DONE
    } else {
        exit::FAILED
    })
}
