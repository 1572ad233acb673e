//! `sweep merge`.

use super::Output;
use super::place::{StoreArguments, print_warning};
use crate::cluster::merge::{Joined, join, shards_in, store_for};
use crate::error::Error;
use crate::system::exit;
use std::path::PathBuf;

/// Merge the shards that tasks published into the store of their campaign
///
/// May be repeated in any order, also while tasks run: unchanged shards are not read again.
/// Complete runs replace partial ones, and later attempts earlier ones. Runs computed twice must
/// agree to the last bit; disagreeing ones are listed, and the exit code is 1. The same holds for a
/// damaged shard, of which the intact part is merged. This also recovers a damaged store into a new
/// one; `sweep run` then recomputes the rest with the same digits.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep merge results/figure-11.sqlite results/figure-11.shards\n  \
                  sweep merge results/figure-11.sqlite results/figure-11.shards/*.sqlite other-machine.sqlite\n  \
                  sweep merge saved.sqlite damaged.sqlite"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    place: StoreArguments,
    /// Shards, or folders of them [default: the folder beside the store]
    shards: Vec<PathBuf>,
    /// Merge shards of another build of sweep, whose bits may differ; the store records this
    #[arg(long)]
    allow_mixed_versions: bool,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let source = arguments.place.find()?;
    let shards = shards_in(&arguments.shards, source.path())?;
    let mut store = store_for(&source, &shards)?;
    print_warning(&store);
    let joined = join(&mut store, &shards, arguments.allow_mixed_versions)?;
    let clean = joined.merged.damaged.is_empty() && joined.disagreements.is_empty();
    if output.json {
        output.json(&joined)?;
    } else {
        write_text(&joined, output)?;
    }
    Ok(if clean { exit::DONE } else { exit::FAILED })
}

fn write_text(answer: &Joined, output: &mut Output<'_>) -> Result<(), Error> {
    let (merged, cases, out) = (&answer.merged, &answer.cases, &mut *output.out);
    writeln!(
        out,
        "{} shards read, {} unchanged: {} new results, {} failures, {} checkpoints; {} results known, with the same bits",
        merged.shards,
        merged.unchanged,
        merged.results,
        merged.failures,
        merged.checkpoints,
        merged.duplicates
    )?;
    if merged.unreadable > 0 {
        writeln!(
            out,
            "{} entries were damaged and are recomputed",
            merged.unreadable
        )?;
    }
    for damaged in &merged.damaged {
        writeln!(
            out,
            "cannot be read: {}: {}",
            damaged.path.display(),
            damaged.reason
        )?;
    }
    if !merged.damaged.is_empty() {
        writeln!(
            out,
            "running tasks publish theirs again; their other cases are open, and `sweep submit` continues them"
        )?;
    }
    for disagreement in &answer.disagreements {
        writeln!(
            out,
            "DISAGREE: {}: {}; kept: {}, not: {}",
            disagreement.key, disagreement.what, disagreement.kept, disagreement.other
        )?;
    }
    if answer.mixed_shards > 0 {
        writeln!(
            out,
            "{} shards of another build of sweep were accepted",
            answer.mixed_shards
        )?;
    }
    writeln!(
        out,
        "{} of {} cases are done, {} jammed, {} failed",
        cases.done,
        cases.total(),
        cases.jammed,
        cases.failed
    )?;
    Ok(())
}
