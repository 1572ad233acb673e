//! `sweep salvage`.

use super::Output;
use crate::campaign::Campaign;
use crate::cli::Error;
use crate::exit;
use crate::store::{salvage, salvage_in_place};
use std::path::PathBuf;

/// Save all that can be read of a damaged store into a new one
///
/// Results are taken over if they are whole, with all their samples, and their checksums agree; checkpoints and frames if they
/// are whole. The damaged store is only read; with --in-place it is kept under another name, with its log, and the new one takes
/// its place. What was lost is computed again by `sweep run` on the new store, with the same digits.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep salvage results/figure-11.sqlite --in-place\n  sweep salvage results/figure-11.sqlite --to saved.sqlite\n  sweep run sweeps/figure-11.toml --store saved.sqlite"
)]
pub(crate) struct Arguments {
    /// The damaged store
    store: PathBuf,
    /// The new store; must not exist
    #[arg(long, value_name = "FILE", required_unless_present = "in_place")]
    to: Option<PathBuf>,
    /// Put the new store in the place of the damaged one, which is set aside. Nobody may be working on it
    #[arg(long, conflicts_with = "to")]
    in_place: bool,
    /// The campaign file, where the store no longer has it
    #[arg(long, value_name = "FILE")]
    campaign: Option<PathBuf>,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let campaign = arguments
        .campaign
        .as_deref()
        .map(Campaign::read)
        .transpose()?;
    let place = arguments.to.as_ref().unwrap_or(&arguments.store);
    let saved = match &arguments.to {
        Some(to) => salvage(&arguments.store, to, campaign.as_ref())?,
        None => salvage_in_place(&arguments.store, campaign.as_ref())?,
    };
    if output.json {
        output.json(&saved)?;
    } else {
        writeln!(
            output.out,
            "{}: {} results with {} samples, {} frames, {} failures and {} runs under way saved; {} entries could not be read or trusted",
            place.display(),
            saved.results,
            saved.samples,
            saved.frames,
            saved.failures,
            saved.checkpoints,
            saved.unreadable
        )?;
        if let Some(warning) = &saved.warning {
            writeln!(output.out, "{warning}")?;
        }
        if let Some(aside) = &saved.set_aside {
            writeln!(output.out, "the damaged store is now {}", aside.display())?;
        }
        if saved.pending > 0 {
            writeln!(
                output.out,
                "{} cases are to be computed: sweep run CAMPAIGN.toml --store {}",
                saved.pending,
                place.display()
            )?;
        }
    }
    Ok(exit::DONE)
}
