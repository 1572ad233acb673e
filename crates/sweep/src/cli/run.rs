//! `sweep run`.

mod task;

use super::Output;
use super::place::{say_warning, store_of};
use crate::campaign::Campaign;
use crate::cli::Error;
use crate::exit;
use crate::format::bytes;
use crate::runner::{self, Options, Progress, Stop, Style};
use crate::store::{Adoption, Inventory, Store, network_file_system};
use std::io::{IsTerminal, Write as _};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Most threads; more are a slip of the keyboard.
const WORKER_LIMIT: usize = 4096;

/// Compute what a campaign lacks, then print its report
///
/// What is in the store already is not computed again. A signal (Ctrl-C) checkpoints and stops; a second one aborts. The
/// same command goes on, with the same bits as if nothing had happened. Several processes may run the same campaign on one
/// machine: they share its cases. A case of a process that is gone goes on from its last checkpoint: at once on the same
/// machine, after two minutes of silence on another. If its processes die five times in a row without a new checkpoint, it
/// ends as failed.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  sweep run sweeps/quickstart.toml\n  sweep run sweeps/figure-11.toml --workers 8 --store /scratch/figure-11.sqlite\n  \
                  sweep run sweeps/figure-11.toml --reuse results/quickstart.sqlite\n  \
                  sweep run sweeps/figure-11.toml --shard 3/24"
)]
pub(crate) struct Arguments {
    /// The campaign file
    campaign: PathBuf,
    /// The store [default: results/NAME.sqlite in the folder that holds `sweeps/`, or beside the file]
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    /// Cases computed at a time [default: the cores of the machine]
    #[arg(
        long,
        short,
        value_name = "N",
        visible_alias = "jobs",
        visible_short_alias = 'j'
    )]
    workers: Option<NonZeroUsize>,
    /// Compute failed cases again
    #[arg(long)]
    retry_failed: bool,
    /// Computing time after which a single case ends as failed, in seconds [default: 50 times its estimate, half an hour at least]
    #[arg(long, value_name = "SECONDS")]
    max_wall_time: Option<f64>,
    /// Another campaign's store: take its runs of the same parameters, steps and seeds in place of computing them again. May be
    /// given several times
    #[arg(long, value_name = "STORE", conflicts_with = "shard")]
    reuse: Vec<PathBuf>,
    /// Keep the layer at every sampled strain, for `sweep export` and movies; finished cases are not computed again for it
    #[arg(long)]
    trajectory: bool,
    /// One task of a cluster: compute slice I, from 0, of N in a store of its own, and publish it among the shards. TERM and
    /// USR1 checkpoint, publish, and have Slurm start the task again if work is left
    #[arg(long, value_name = "I/N", conflicts_with = "store", value_parser = task::part)]
    shard: Option<task::Part>,
    /// The slices, as `sweep submit` wrote them [default: all cases of the file, cut here]
    #[arg(long, value_name = "FILE", requires = "shard")]
    slices: Option<PathBuf>,
    /// Folder shards are published in [default: NAME.shards beside the store]
    #[arg(long, value_name = "DIR", requires = "shard")]
    shards: Option<PathBuf>,
    /// Disk of this machine to work on [default: SLURM_TMPDIR, or else the folder of shards]
    #[arg(long, value_name = "DIR", requires = "shard")]
    scratch: Option<PathBuf>,
    /// Seconds between publications: what a crashed machine loses at most
    #[arg(long, value_name = "SECONDS", default_value_t = 60, requires = "shard")]
    publish_every: u64,
    /// Go on from shards another build of sweep computed; their bits may differ
    #[arg(long, requires = "shard")]
    allow_mixed_versions: bool,
}

pub(crate) fn execute(arguments: &Arguments, output: &mut Output<'_>) -> Result<u8, Error> {
    let campaign = Campaign::read(&arguments.campaign)?;
    let workers = match arguments.workers {
        Some(workers) if workers.get() > WORKER_LIMIT => {
            return Err(Error::Argument {
                argument: "--workers",
                message: format!("at most {WORKER_LIMIT}"),
            });
        }
        Some(workers) => workers.get(),
        None => std::thread::available_parallelism().map_or(1, NonZeroUsize::get),
    };
    let wall_limit = match arguments.max_wall_time {
        None => None,
        Some(seconds) => Some(
            Duration::try_from_secs_f64(seconds)
                .ok()
                .filter(|limit| !limit.is_zero())
                .ok_or_else(|| Error::Argument {
                    argument: "--max-wall-time",
                    message: format!("a time above 0 seconds, not {seconds}"),
                })?,
        ),
    };
    if let Some(part) = arguments.shard {
        return task::execute(arguments, part, campaign, workers, wall_limit, output);
    }
    let stop = Stop::on_signals()?;
    let path = store_of(&campaign, arguments.store.as_deref())?;
    if let Some(network) = network_file_system(&path).filter(|_| !output.quiet) {
        // Nobody may read standard error; the run goes on all the same.
        let _ = writeln!(
            crate::visible::stderr(),
            "warning: {} is on a network file system ({network}), where several machines cannot safely share a store: run it \
             from one machine only, or choose a local disk with --store FILE",
            path.display()
        );
    }
    for other in &arguments.reuse {
        Store::open_read_only(other)?;
    }
    let mut store = Store::open(&path)?;
    say_warning(&store);
    let adoption = store.adopt(&campaign)?;
    if !output.quiet {
        say_what_is_there(&campaign, &path, adoption);
    }
    if !arguments.reuse.is_empty() {
        reuse(&mut store, &arguments.reuse, output)?;
    }
    if arguments.retry_failed {
        store.retry_failed()?;
    }
    let counts = store.counts()?;
    if counts.pending + counts.running > 0 {
        let conditions = Conditions {
            workers,
            wall_limit,
            stop: &stop,
            observer: None,
        };
        compute(arguments, &campaign, &mut store, conditions, output)?;
    }
    store.check_campaign()?;
    let code = match stop.signal() {
        Some(signal) => exit::stopped_by(signal),
        None if store.counts()?.failed > 0 => exit::FAILED,
        None => exit::DONE,
    };
    match super::report::write(&store, output) {
        // Nobody reads on: what became of the runs is told all the same.
        Err(error) if error.is_closed_pipe() => Ok(code),
        written => written.map(|()| code),
    }
}

/// Says what a campaign finds in its store, if there is anything to say: what is kept, what is new, what is not asked for.
fn say_what_is_there(campaign: &Campaign, path: &Path, adoption: Adoption) {
    let Inventory {
        runs,
        ended,
        begun,
        new,
        orphans,
        orphan_bytes,
    } = adoption.inventory;
    // Nobody may read standard error; the run goes on all the same.
    let mut to = crate::visible::stderr();
    if adoption.changed {
        let _ = writeln!(
            to,
            "{} asks for something else than what {} was last run with: of its {runs} runs {ended} are kept as they are, {begun} \
             go on from where they are, and {new} are new",
            campaign.file.display(),
            path.display()
        );
    }
    if orphans > 0 {
        let _ = writeln!(
            to,
            "{orphans} runs in {} (about {}) are not asked for; they stay there, and `sweep prune {}` removes them",
            path.display(),
            bytes(orphan_bytes),
            campaign.file.display()
        );
    }
}

/// Takes over what other stores hold, and says what that was.
fn reuse(store: &mut Store, others: &[PathBuf], output: &Output<'_>) -> Result<(), Error> {
    let taken = store.reuse(others)?;
    if output.quiet {
        return Ok(());
    }
    // Nobody may read standard error; the run goes on all the same.
    let mut to = crate::visible::stderr();
    let _ = writeln!(
        to,
        "taken over: {} runs, {} failures, {} checkpoints",
        taken.results, taken.failures, taken.checkpoints
    );
    for damaged in taken.damaged {
        let _ = writeln!(to, "{damaged}");
    }
    Ok(())
}

/// Under what conditions a campaign is computed.
#[derive(Clone, Copy)]
struct Conditions<'c> {
    /// Cases at a time.
    workers: usize,
    /// Computing time of a single case.
    wall_limit: Option<Duration>,
    stop: &'c Stop,
    observer: Option<&'c dyn runner::RunObserver>,
}

/// Computes the cases of a store.
fn compute(
    arguments: &Arguments,
    campaign: &Campaign,
    store: &mut Store,
    conditions: Conditions<'_>,
    output: &Output<'_>,
) -> Result<(), Error> {
    let style = match (output.quiet, std::io::stderr().is_terminal()) {
        (true, _) => Style::Quiet,
        (false, true) => Style::Bars,
        (false, false) => Style::Lines,
    };
    let threads = conditions.workers;
    let cases = store.counts()?.total();
    let workers = threads.min(usize::try_from(cases).unwrap_or(threads));
    let progress = Progress::new(style, workers, Box::new(std::io::stderr()));
    let options = Options {
        workers,
        threads,
        wall_limit: conditions.wall_limit,
        trajectory: arguments.trajectory,
        observer: conditions.observer,
        stop: conditions.stop,
        progress: &progress,
    };
    Ok(runner::compute_campaign(store, campaign, options)?)
}
