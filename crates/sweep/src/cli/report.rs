//! `sweep report`.

use super::{Output, store_path};
use crate::error::Error;
use crate::exit;
use crate::report::{Report, write_json, write_text};
use crate::store::Store;
use std::path::PathBuf;

/// Print the results of a campaign, averaged over seeds
///
/// Reads only, and may be used while the campaign runs.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep report results/quickstart.sqlite\n  sweep report sweeps/quickstart.toml --json"
)]
pub(crate) struct Arguments {
    /// The store, or a campaign file whose default store is meant
    store: PathBuf,
}

/// Writes the report.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let store = Store::open_read_only(&store_path(&arguments.store)?)?;
    write(&store, output)?;
    Ok(exit::DONE)
}

/// Writes the report of an open store.
pub(super) fn write(store: &Store, output: &mut Output<'_>) -> Result<(), Error> {
    let report = Report::of(store)?;
    if output.json {
        write_json(&report, output.out)
    } else {
        write_text(&report, output.width, output.out)
    }
}
