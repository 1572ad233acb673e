//! `sweep merge`.

use super::Output;
use super::place::{StoreArguments, say_warning};
use crate::api::Error;
use crate::campaign::{Campaign, Order};
use crate::cluster::shard::{self, ShardError};
use crate::exit;
use crate::store::{Counts, Disagreement, Merged, Store, StoreError, StoreSource};
use serde::Serialize;
use std::path::{Path, PathBuf};

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
    let mixed = arguments.allow_mixed_versions;
    let joined = join(&source, &arguments.shards, mixed)?;
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

/// What came of it.
#[derive(Serialize)]
struct Joined {
    #[serde(flatten)]
    merged: Merged,
    /// Cases of the store by state.
    cases: Counts,
    /// Results that do not agree.
    disagreements: Vec<Disagreement>,
    /// Shards of other builds in the store.
    mixed_shards: u64,
}

/// Merges shards, or all in folders of them; of none those in the folder beside the store.
fn join(source: &StoreSource, given: &[PathBuf], mixed: bool) -> Result<Joined, Error> {
    let shards = if given.is_empty() {
        in_folder(&shard::folder_of(source.path()))?
    } else {
        let mut all = Vec::new();
        for given in given {
            if given.is_dir() {
                all.extend(in_folder(given)?);
            } else if given.exists() {
                all.push(given.clone());
            } else {
                let path = given.clone();
                return Err(ShardError::Vanished { path }.into());
            }
        }
        all
    };
    let mut store = open(source, &shards)?;
    say_warning(&store);
    Ok(Joined {
        merged: store.merge(&shards, mixed)?,
        cases: store.counts()?,
        disagreements: store.disagreements()?,
        mixed_shards: store.mixed_shards()?,
    })
}

/// The shards in a folder.
fn in_folder(folder: &Path) -> Result<Vec<PathBuf>, ShardError> {
    if !folder.is_dir() {
        return Err(ShardError::Vanished {
            path: folder.to_owned(),
        });
    }
    Ok(shard::published(folder)
        .into_iter()
        .map(|shard| shard.path)
        .collect())
}

/// Opens the store; a new one gets the campaign of the file given, or else that of the first shard that can be read.
fn open(source: &StoreSource, shards: &[PathBuf]) -> Result<Store, Error> {
    let path = source.path();
    if path.exists() {
        return Ok(Store::open(path)?);
    }
    if let Some(campaign) = source.campaign() {
        return Ok(Store::enter(path, campaign, Order::default())?.0);
    }
    let mut first = None;
    for shard in shards {
        match Store::campaign_of(shard) {
            Ok(text) => {
                let campaign = Campaign::parse(&shard.display().to_string(), text)?;
                return Ok(Store::enter(path, &campaign, Order::default())?.0);
            }
            Err(error) => first = first.or(Some(error)),
        }
    }
    Err(first
        .unwrap_or_else(|| StoreError::Missing {
            path: path.to_owned(),
        })
        .into())
}
