//! `sweep salvage`.

use super::Output;
use crate::campaign::Campaign;
use crate::cli::Error;
use crate::exit;
use crate::store::salvage;
use std::path::PathBuf;

/// Save all that can be read of a damaged store into a new one
///
/// Results are taken over if they are whole, with all their samples; checkpoints if their checksums agree. The damaged store
/// is only read. What was lost is computed again by `sweep run` on the new store, with the same digits.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  sweep salvage results/figure-11.sqlite --to saved.sqlite\n  sweep run sweeps/figure-11.toml --store saved.sqlite"
)]
pub(crate) struct Arguments {
    /// The damaged store
    store: PathBuf,
    /// The new store; must not exist
    #[arg(long, value_name = "FILE")]
    to: PathBuf,
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
    let saved = salvage(&arguments.store, &arguments.to, campaign.as_ref())?;
    if output.json {
        output.json(&saved)?;
    } else {
        writeln!(
            output.out,
            "{}: {} results with {} samples, {} failures and {} runs under way saved; {} entries could not be read",
            arguments.to.display(),
            saved.results,
            saved.samples,
            saved.failures,
            saved.checkpoints,
            saved.unreadable
        )?;
        if saved.pending > 0 {
            writeln!(
                output.out,
                "{} cases are to be computed: sweep run CAMPAIGN.toml --store {}",
                saved.pending,
                arguments.to.display()
            )?;
        }
    }
    Ok(exit::DONE)
}
