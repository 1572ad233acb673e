//! `sweep merge`.

use super::Output;
use super::place::{StoreArguments, print_warning};
use crate::api::Error;
use crate::api::merge::{Joined, join, shards_in, store_for};
use crate::exit;
use std::path::PathBuf;

/// Join the shards that tasks published into the store of their campaign
///
/// May be given as often as one likes, in any order, while tasks still run: a shard that has not changed is not read again.
/// Complete runs are preferred to partial ones, and later attempts to earlier ones. Runs computed twice must agree to the last
/// bit; those that do not are listed, and the exit code is 1. So it is if a shard is damaged: what is whole of it is merged. So this
/// is how a damaged store is saved, into a new one; `sweep run` computes there what is lost, with the same digits.
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
    /// Merge shards that another build of sweep computed, whose bits may differ; the store keeps a record of it
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
        "{} shards read, {} unchanged: {} new results, {} failures, {} checkpoints; {} results were there, with the same bits",
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
            "{} entries could not be trusted and are computed again",
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
            "tasks at work publish theirs again; what else they held is open, and `sweep submit` goes on with it"
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
            "{} shards of another build of sweep were let in",
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
