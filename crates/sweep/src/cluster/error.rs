//! Errors of schedulers, slices and shards.

use crate::campaign::CampaignError;
use crate::store::StoreError;
use crate::system::disk::is_full;
use std::io;
use std::path::{Path, PathBuf};

/// Why a command about the tasks of a campaign was refused or could not be finished.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum ClusterError {
    #[error("there is no `{program}` on this machine")]
    #[diagnostic(help(
        "give this command on a login node of the cluster, where Slurm is installed (`module load slurm` on some); \
         on a single machine `sweep run` computes the campaign"
    ))]
    Missing { program: String },
    #[error("`{command}` was refused: {said}")]
    #[diagnostic(help(
        "correct what it names, then repeat the command: `sinfo -s` lists partitions; --sbatch-arg passes --partition \
         and --account; fewer --tasks or a shorter --time keep to limits of the site. If Slurm's controller does not \
         answer, check with `squeue --me` whether the job exists, and try again in a while"
    ))]
    Refused { command: String, said: String },
    #[error("`{command}` gave no job number but {said:?}")]
    #[diagnostic(help(
        "the job may still exist: check with `squeue --me` before you repeat the command; computing twice \
         does no harm"
    ))]
    Answer { command: String, said: String },
    #[error("{asked} tasks are more than the {limit} a job may have here")]
    #[diagnostic(help(
        "nothing was submitted; give --tasks {limit} or fewer, so that each computes more cases. Several workers per task \
         (--workers-per-task) make them faster"
    ))]
    TooManyTasks { asked: usize, limit: usize },
    #[error("whether job {job}, submitted before, still runs is unknown: {source}")]
    #[diagnostic(help(
        "repeat the command in a while, or with --again to submit its open cases once more"
    ))]
    Unclear {
        job: String,
        #[source]
        source: Box<ClusterError>,
    },
    #[error("{} is not valid UTF-8, and cannot be named in a script", path.display())]
    #[diagnostic(help("nothing was submitted; put the store elsewhere with --store FILE"))]
    Path { path: PathBuf },
    #[error("there is no folder of shards at {}", path.display())]
    #[diagnostic(help(
        "nothing was submitted into it yet, or it was deleted: running tasks then recreate it when they next publish, and \
         `sweep submit CAMPAIGN.toml` recomputes what was lost with it, with the same digits"
    ))]
    Vanished { path: PathBuf },
    #[error("no shards were found to merge into {}", store.display())]
    #[diagnostic(help(
        "nothing was written; name stores of the campaign, or folders into which tasks have published theirs"
    ))]
    NoShards { store: PathBuf },
    #[error("{}: {reason}", path.display())]
    #[diagnostic(help("`sweep submit CAMPAIGN.toml` makes a new plan for the open cases"))]
    Slices { path: PathBuf, reason: String },
    #[error("cannot write {}: {source}{}", path.display(), about_room(*full))]
    #[diagnostic(help(
        "nothing was submitted; {}, or choose another place with --store FILE, then repeat the command",
        if *full { "make room" } else { "make the folder writable" }
    ))]
    Plan {
        path: PathBuf,
        source: io::Error,
        full: bool,
    },
    #[error("cannot publish {}: {source}{}", path.display(), about_room(*full))]
    #[diagnostic(help(
        "earlier publications are kept, and {} holds the rest; {} in the folder, then restart the task \
         (scontrol requeue JOB_TASK), or repeat `sweep submit`: it continues from published shards",
        work.display(),
        if *full { "make room" } else { "allow writing" }
    ))]
    Publish {
        path: PathBuf,
        work: PathBuf,
        source: io::Error,
        full: bool,
    },
    #[error(transparent)]
    #[diagnostic(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    #[diagnostic(transparent)]
    Campaign(#[from] CampaignError),
}

impl ClusterError {
    /// An error about a file of the plan.
    pub(super) fn of_plan(path: &Path, source: io::Error) -> Self {
        Self::Plan {
            full: no_room(&source, path),
            path: path.to_owned(),
            source,
        }
    }

    /// Whether the cause is a disk or a store rather than the command.
    pub(crate) fn is_of_the_disk(&self) -> bool {
        match self {
            Self::Publish { .. } | Self::Plan { .. } => true,
            Self::Store(error) => error.is_of_the_store(),
            _ => false,
        }
    }
}

/// Suffix of a message about a full disk.
fn about_room(full: bool) -> &'static str {
    if full {
        ": the disk is full or the quota used up"
    } else {
        ""
    }
}

/// Whether a write failed because the disk was full.
pub(crate) fn no_room(error: &io::Error, path: &Path) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded
    ) || is_full(path)
}
