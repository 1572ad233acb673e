//! `sweep plan`.

mod tables;
mod text;

use super::Output;
use super::output_file::{check_outputs, save};
use super::place::{store_of, workers, workers_or_all};
use super::tables::TableArguments;
use crate::error::Error;
use crate::plan::make;
use crate::store::StoreSource;
use crate::system::exit;
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// Show the plan of a campaign: axes, runs, estimated time and disk space
///
/// Writes nothing. CPU times come from runs that this build has measured on this machine, or else
/// from short runs of a few seconds in all. Runs in the store of the campaign are left out.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep plan sweeps/quickstart.toml\n  sweep plan sweeps/quickstart.toml --trajectory\n  \
                  sweep plan sweeps/quickstart.toml --columns step_s,memory_bytes --latex -\n  \
                  sweep plan sweeps/quickstart.toml --json"
)]
pub(crate) struct Arguments {
    /// The campaign file
    campaign: PathBuf,
    /// The store whose runs are left out [default: results/NAME.sqlite in the folder that holds
    /// `sweeps/`, or beside the file]
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    /// Include frames at every sampled strain, as `sweep run --trajectory` keeps them
    #[arg(long)]
    trajectory: bool,
    /// Cases computed in parallel [default: the cores of the machine]
    #[arg(
        long,
        short,
        value_name = "N",
        visible_alias = "jobs",
        visible_short_alias = 'j',
        value_parser = workers
    )]
    workers: Option<NonZeroUsize>,
    #[command(flatten)]
    tables: TableArguments,
}

/// Writes the plan.
pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let columns = tables::columns_named(&arguments.tables.columns)?;
    let inputs: Vec<_> = [
        Some(arguments.campaign.as_path()),
        arguments.store.as_deref(),
    ]
    .into_iter()
    .flatten()
    .collect();
    check_outputs(&[("--latex", &arguments.tables.latex)], &inputs, output)?;
    let campaign = crate::campaign::read(&arguments.campaign)?;
    let workers = workers_or_all(arguments.workers);
    let path = store_of(&campaign, arguments.store.as_deref())?;
    let store = if path.exists() {
        Some(StoreSource::new(path, Some(campaign.clone())).open()?)
    } else {
        None
    };
    let plan = make(&campaign, workers, arguments.trajectory, store.as_ref())?;
    let shape = arguments.tables.shape();
    let sheets = |width| tables::Sheets::of(&plan, &columns, shape, width);
    if let Some(path) = &arguments.tables.latex {
        let mut bytes = Vec::new();
        sheets(None).write_latex(&plan, &mut bytes)?;
        save(path, &bytes, output)?;
    }
    if output.json {
        output.json(&plan)?;
    } else if arguments.tables.latex.is_none() {
        text::write(&plan, &sheets(output.width), output)?;
    }
    Ok(exit::DONE)
}
