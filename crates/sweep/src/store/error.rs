//! Errors of stores.

use super::digest::DigestMismatch;
use crate::system::disk::{is_full, reason_against};
use rusqlite::ErrorCode;
use std::io;
use std::path::{Path, PathBuf};

/// Why the store could not be opened or used.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the message of each explains it")]
pub enum StoreError {
    #[error("there is no store at {}", path.display())]
    #[diagnostic(help("`sweep run CAMPAIGN.toml` creates one, by default results/NAME.sqlite"))]
    Missing { path: PathBuf },
    #[error("{} is {what}", path.display())]
    #[diagnostic(help(
        "name a store, such as results/quickstart.sqlite, or a campaign file, such as sweeps/quickstart.toml"
    ))]
    NotAFile { path: PathBuf, what: &'static str },
    #[error("{} is damaged: {what}", path.display())]
    #[diagnostic(help(
        "`sweep check {0}` lists damaged runs, and `sweep run` computes them again, with the same digits; from a file that cannot be \
         read `sweep merge NEW.sqlite {0}` copies the runs that can, and where it copies none, move the file away: `sweep run` \
         computes all of them again",
        path.display()
    ))]
    Damaged { path: PathBuf, what: String },
    #[error("cannot write a store at {}: {source}", path.display())]
    #[diagnostic(help("choose another place with --store FILE"))]
    Unwritable { path: PathBuf, source: io::Error },
    #[error("{} is not a store of sweep", path.display())]
    #[diagnostic(help(
        "nothing was changed in it; name the store of a campaign, such as results/NAME.sqlite"
    ))]
    NotAStore { path: PathBuf },
    #[error(
        "{} has schema {found}, but this program supports schema {known}: it was made by another version of sweep", path.display()
    )]
    #[diagnostic(help(
        "nothing was changed in it; read it with the version that made it, and move it away or name another place with --store FILE: \
         `sweep run` computes its runs again"
    ))]
    Schema {
        path: PathBuf,
        found: i32,
        known: i32,
    },
    #[error("the runs of {} are of physics {found}, but this program has physics {known}", path.display())]
    #[diagnostic(help(
        "nothing was changed in it; read it with the version of sweep that made it, and move it away or name another place with \
         --store FILE: `sweep run` computes its runs again"
    ))]
    Physics {
        path: PathBuf,
        found: u32,
        known: u32,
    },
    #[error("{} has {column}, which this program does not know: a later version of sweep wrote it", path.display())]
    #[diagnostic(help(
        "nothing was changed in it; use that version, or choose another place with --store FILE"
    ))]
    Later { path: PathBuf, column: String },
    #[error("{} is the store of campaign {found:?}, not of {wanted:?}", path.display())]
    #[diagnostic(help("nothing was changed in it; choose another place with --store FILE"))]
    OtherCampaign {
        path: PathBuf,
        found: String,
        wanted: String,
    },
    #[error(
        "process {pid} on {host} computes {} on {}, and {} has other runs under the same name",
        theirs.display(), path.display(), ours.display()
    )]
    #[diagnostic(help(
        "nothing was changed; wait until that process has ended, or give this campaign another `name` or another --store FILE"
    ))]
    ActiveProcess {
        path: PathBuf,
        ours: PathBuf,
        theirs: PathBuf,
        pid: u32,
        host: String,
    },
    #[error(
        "{} now holds the campaign of {}, not that of {}",
        path.display(), theirs.display(), ours.display()
    )]
    #[diagnostic(help(
        "finished runs stay in it; repeat the command once the other one has ended, or give this campaign another \
         `name` or another --store FILE"
    ))]
    Displaced {
        path: PathBuf,
        ours: PathBuf,
        theirs: PathBuf,
    },
    #[error("the store {} was {what} while it was in use", path.display())]
    #[diagnostic(help(
        "later changes of this process are lost with it; restore the store from a copy, or repeat the \
         command to start again"
    ))]
    Gone { path: PathBuf, what: &'static str },
    #[error("case {key} was taken over by another process")]
    ClaimLost { key: String },
    #[error("{given:?} is {what} of {}", path.display())]
    #[diagnostic(help(
        "identify a case by the beginning of its key, or by its number in the campaign file, from 1"
    ))]
    Case {
        path: PathBuf,
        given: String,
        what: &'static str,
    },
    #[error("no frames of case {key} are stored")]
    #[diagnostic(help(
        "`sweep run CAMPAIGN.toml --trajectory` computes runs without frames again, with the same digits"
    ))]
    NoFrames { key: String },
    #[error(
        "the frames of case {key} have no velocities: an earlier version of this program wrote them"
    )]
    #[diagnostic(help(
        "its numbers are valid; for its frames compute it in a new store: \
         `sweep run CAMPAIGN.toml --trajectory --store NEW.sqlite`"
    ))]
    EarlierFrames { key: String },
    #[error("{}: {what}", path.display())]
    #[diagnostic(help("{advice}"))]
    Sqlite {
        path: PathBuf,
        what: String,
        advice: &'static str,
        during_run: bool,
        passing: bool,
        #[source]
        source: Box<rusqlite::Error>,
    },
}

impl StoreError {
    /// The error about an invalid entry.
    pub(super) fn unreadable(path: &Path, why: &dyn std::fmt::Display) -> Self {
        Self::Damaged {
            path: path.to_owned(),
            what: format!("an entry cannot be read: {why}"),
        }
    }

    /// Converts an error of `SQLite`.
    pub(super) fn sqlite(path: &Path, source: rusqlite::Error, during_run: bool) -> Self {
        if let Some(altered) = DigestMismatch::in_error(&source) {
            return Self::Damaged {
                path: path.to_owned(),
                what: altered.to_string(),
            };
        }
        let path = path.to_owned();
        // Invalid values, missing rows and tables.
        let message = source.to_string();
        if source.sqlite_error_code().is_none() || message.contains("no such ") {
            return Self::Damaged {
                path,
                what: message,
            };
        }
        let code = source.sqlite_error_code().map(|code| match code {
            // For example, the index of the log cannot be created.
            ErrorCode::SystemIoFailure | ErrorCode::CannotOpen if is_full(&path) => {
                ErrorCode::DiskFull
            }
            code => code,
        });
        let passing = matches!(
            code,
            Some(ErrorCode::DiskFull | ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked)
        );
        let (what, advice) = match code {
            Some(ErrorCode::NotADatabase) if !during_run => return Self::NotAStore { path },
            Some(ErrorCode::CannotOpen | ErrorCode::PermissionDenied) if !during_run => {
                return Self::Unwritable {
                    source: reason_against(&path).unwrap_or_else(|| io::Error::other(source)),
                    path,
                };
            }
            Some(ErrorCode::ReadOnly) => (
                "the file or its directory is read-only".into(),
                "it can still be read; make it writable, or choose another place with --store FILE",
            ),
            Some(ErrorCode::DiskFull) => (
                "the disk is full, or the quota used up".into(),
                "free some space and repeat the command: it continues from the last change that was written",
            ),
            Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => (
                "another program holds the lock".into(),
                "close programs that write to this file, and repeat the command",
            ),
            Some(ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase) => {
                return Self::Damaged {
                    path,
                    what: source.to_string(),
                };
            }
            Some(ErrorCode::OperationInterrupted) => (
                "reading it takes too long for a store of this size".into(),
                "it may not be a store of sweep, or be on a disk that does not respond",
            ),
            _ => (
                source.to_string(),
                "repeat the command; if that does not help, `sweep check FILE` shows whether the store is damaged",
            ),
        };
        Self::Sqlite {
            path,
            what,
            advice,
            during_run,
            passing,
            source: Box::new(source),
        }
    }

    /// Whether the cause is the store rather than the command: it happened while cases were
    /// computed, or may be temporary.
    pub fn is_of_the_store(&self) -> bool {
        match self {
            Self::ClaimLost { .. }
            | Self::Gone { .. }
            | Self::Displaced { .. }
            | Self::Damaged { .. } => true,
            Self::Sqlite {
                during_run,
                passing,
                ..
            } => *during_run || *passing,
            _ => false,
        }
    }
}
