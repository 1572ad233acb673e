//! Errors of slices and shards.

use std::io;
use std::path::PathBuf;

/// Why a task could not start, or its shard could not be published.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
pub enum ShardError {
    /// A folder that cannot be made.
    #[error("cannot make the folder {}: {source}", path.display())]
    #[diagnostic(help("nothing was computed; make it writable, then repeat the command"))]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The folder of shards is gone.
    #[error("there is no folder of shards at {}", path.display())]
    #[diagnostic(help(
        "running tasks recreate it when they next publish; `sweep submit CAMPAIGN.toml` recomputes what was lost \
         with it, with the same digits"
    ))]
    Vanished {
        /// The folder.
        path: PathBuf,
    },
    /// A missing file of slices.
    #[error("there are no slices at {}: the folder of shards was deleted", path.display())]
    #[diagnostic(help("`sweep submit CAMPAIGN.toml` makes a new plan for the open cases"))]
    NoSlices {
        /// The file.
        path: PathBuf,
    },
    /// A file of slices that cannot be used.
    #[error("{}: {reason}", path.display())]
    #[diagnostic(help("`sweep submit CAMPAIGN.toml` makes a new plan for the open cases"))]
    Slices {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file of the plan that could not be written.
    #[error("cannot write {}: {source}{}", path.display(), no_room(*full))]
    #[diagnostic(help(
        "nothing was submitted; {}, or choose another place with --store FILE, then repeat the command",
        if *full { "make room" } else { "make the folder writable" }
    ))]
    Plan {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
        /// Whether the disk is full.
        full: bool,
    },
    /// A shard that could not be written to the shared folder.
    #[error("cannot publish {}: {source}{}", path.display(), no_room(*full))]
    #[diagnostic(help("{advice}"))]
    Publish {
        /// The shard.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
        /// Whether the disk is full.
        full: bool,
        /// What can be done.
        advice: String,
    },
}

impl ShardError {
    /// Whether the cause is a disk rather than the command.
    pub(crate) fn is_of_the_disk(&self) -> bool {
        matches!(self, Self::Publish { .. } | Self::Plan { .. })
    }
}

/// Suffix of a message about a full disk.
fn no_room(full: bool) -> &'static str {
    if full {
        ": the disk is full or the quota used up"
    } else {
        ""
    }
}
