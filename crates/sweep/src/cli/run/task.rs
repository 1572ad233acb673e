//! One task of a campaign, in a store of its own that is published as a shard.

use super::{Arguments, compute, style};
use crate::cli::Output;
use crate::cluster::shard;
use crate::cluster::task::{Task, TaskOf, TaskOptions, restrict};
use crate::error::Error;
use crate::model::campaign::Campaign;
use crate::runner::Stop;
use crate::store::Counts;
use crate::system::exit;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Computes one slice of a campaign, and reports progress before a scheduler may end this process.
pub(super) fn run(
    arguments: &Arguments,
    part: TaskOf,
    mut campaign: Campaign,
    output: &mut Output<'_>,
) -> Result<u8, Error> {
    let stop = Stop::for_a_task()?;
    let plan = restrict(arguments.cluster.slices.as_deref(), part, &mut campaign)?;
    let options = options(arguments, &campaign);
    let note = |text: &str| output.note(text);
    let (mut store, task) = Task::begin(&options, part.task, &plan, &campaign, &note)?;
    let style = style(arguments, output);
    let computed = compute(
        arguments,
        &campaign,
        &mut store,
        (&stop, Some(&task)),
        style,
    );
    // Results so far count, however the run ended.
    let published = task.publisher.publish();
    let counts = computed?;
    published?;
    drop(store);
    task.publisher.clean_up();
    answer(part, counts, task.publisher.target(), output)?;
    Ok(match stop.signal() {
        Some(signal) if counts.pending + counts.running > 0 => {
            output.note(&task.again(signal));
            exit::stopped_by(signal)
        }
        _ if counts.failed > 0 => exit::FAILED,
        _ => exit::DONE,
    })
}

/// Folders of the task.
fn options(all: &Arguments, campaign: &Campaign) -> TaskOptions {
    let arguments = &all.cluster;
    let usual = || shard::folder_of(&campaign.default_store());
    let folder = arguments.shards.clone().unwrap_or_else(usual);
    let scratch = arguments.scratch.clone();
    let scratch = scratch.or_else(|| std::env::var_os("SLURM_TMPDIR").map(PathBuf::from));
    TaskOptions {
        scratch: scratch.unwrap_or_else(|| folder.join("work")),
        folder,
        publish_every: arguments.publish_every,
        retry_failed: all.retry_failed,
        trajectory: all.trajectory,
    }
}

/// The summary at the end of a task.
#[derive(Serialize)]
struct TaskAnswer<'a> {
    task: usize,
    tasks: usize,
    shard: &'a Path,
    /// Cases of the slice by state.
    #[serde(rename = "cases")]
    counts: Counts,
}

/// Prints the progress of the slice.
fn answer(
    part: TaskOf,
    counts: Counts,
    shard: &Path,
    output: &mut Output<'_>,
) -> Result<(), Error> {
    let left = counts.pending + counts.running;
    if output.json {
        output.json(&TaskAnswer {
            task: part.task,
            tasks: part.tasks,
            shard,
            counts,
        })?;
        return Ok(output.out.flush()?);
    }
    writeln!(
        output.out,
        "task {} of {}: {} cases done, {}, {} failed, {left} left: {}",
        part.task,
        part.tasks,
        counts.done,
        counts.words_of_jammed(),
        counts.failed,
        shard.display()
    )?;
    Ok(output.out.flush()?)
}
