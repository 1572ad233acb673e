//! The store: one `SQLite` file per campaign, the only memory of the program.
//!
//! State changes are synced to the disk before they count; checkpoints survive a killed process at once and a power
//! cut up to the last few. Every change to a running case is made on condition that this process still owns it.

mod asked;
mod axis_columns;
mod campaign;
mod checksum;
mod claims;
mod ends;
mod entries;
mod error;
mod failures;
mod frames;
mod guard;
mod log;
mod merge;
mod order;
mod place;
mod process;
mod provenance;
mod prune;
mod query;
mod reading;
mod results;
mod rules;
mod runs;
mod salvage;
mod samples;
mod schema;
mod source;
mod story;
mod submissions;
mod verify;

pub(crate) use crate::checkpoint::can_be_kept;
pub use crate::checkpoint::{Checkpoint, Damage};
pub use asked::{Adoption, Inventory};
pub use claims::{Claim, DEATH_LIMIT};
pub use error::StoreError;
pub use failures::FailureGroup;
pub use frames::StoredFrame;
pub(crate) use merge::MergeMode;
pub use merge::{Damaged, Disagreement, Merged};
pub use order::Priority;
pub(crate) use place::is_full;
pub use place::network_file_system;
pub use process::{HEARTBEAT_LIMIT, Identity};
pub(crate) use process::{alive, build, start_of};
pub use provenance::Provenance;
pub use query::{Counts, FailureLine, PointRun, ProcessLine, Replay};
pub(crate) use reading::snapshot;
pub use results::{Failure, Finished};
pub use rules::PointState;
pub use salvage::{Salvaged, salvage, salvage_in_place};
pub use source::StoreSource;
pub use story::{Attempt, Origin, Story};
pub use submissions::{OpenCase, SliceState, Submission, TaskName};
pub use verify::accept_changes;

use asked::Asks;
use place::{Files, Loss, name_new, set_aside};
use rusqlite::config::DbConfig;
use rusqlite::{Connection, ErrorCode, OpenFlags, Transaction, TransactionBehavior};
use schema::{Kind, bring_up_to_date, identify, version_of};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How long a lock held by another program is waited for.
const LOCK_WAIT: Duration = if cfg!(test) {
    Duration::from_secs(2)
} else {
    Duration::from_mins(1)
};
/// The same once a stop was asked for.
const LOCK_WAIT_WHEN_STOPPING: Duration = Duration::from_millis(500);
/// Time from one look at a lock to the next.
const LOCK_LOOK: Duration = Duration::from_millis(5);
/// Whether a stop was asked for.
static STOP_ASKED: AtomicBool = AtomicBool::new(false);

/// An open store.
#[derive(Debug)]
pub struct Store {
    connection: Connection,
    path: PathBuf,
    /// Its files, as they were when it was opened for writing.
    files: Option<Files>,
    /// What is to be said to whoever opened it: changes that are lost with a damaged log.
    warning: Option<String>,
    /// This process, once it works on the store.
    process: Option<Registered>,
    /// The task of a scheduler this process works for.
    task: Option<TaskName>,
    /// What this process asks for, once it has taken a campaign into the store.
    asks: Option<Asks>,
    /// The file last run, if another version of it is shown.
    last_run_with: Option<PathBuf>,
}

/// This process as the store knows it.
#[derive(Debug, Clone)]
struct Registered {
    id: i64,
    identity: Identity,
}

impl Store {
    /// Opens a store for writing; makes it, and the directory it is in, if it is not there.
    ///
    /// # Errors
    /// A path that cannot be written, a file that is no store, or one of another schema. Such files are not touched.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        guard::refuse_other_than_files(path)?;
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(|source| StoreError::Unwritable {
                path: path.to_owned(),
                source,
            })?;
        }
        let warning = log::check(path)?.map(log::Fault::into_words);
        let connection = Connection::open_with_flags(
            path,
            OpenFlags::SQLITE_OPEN_READ_WRITE
                | OpenFlags::SQLITE_OPEN_CREATE
                | OpenFlags::SQLITE_OPEN_NO_MUTEX,
        )
        .map_err(|error| StoreError::sqlite(path, error, false))?;
        let mut store = Self {
            connection,
            path: path.to_owned(),
            files: None,
            warning,
            process: None,
            task: None,
            asks: None,
            last_run_with: None,
        };
        store.set_up().map_err(|error| match error {
            Setup::Sqlite(error) => StoreError::sqlite(path, error, false),
            Setup::Refused(error) => error,
        })?;
        store.files = Some(Files::of(path));
        store.verify()?;
        Ok(store)
    }

    /// What is to be said to whoever opened it: that its log is damaged, and what was lost with that.
    pub fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// Makes or checks the schema, and sets the connection up.
    fn set_up(&mut self) -> Result<(), Setup> {
        guard::distrust(&self.connection)?;
        self.connection.busy_handler(Some(wait_for_lock))?;
        match identify(&self.connection)? {
            Kind::Ours(1..=schema::VERSION) | Kind::Empty => {}
            Kind::Ours(found) => return Err(Setup::Refused(self.other_schema(found))),
            Kind::Foreign => {
                return Err(Setup::Refused(StoreError::NotAStore {
                    path: self.path.clone(),
                }));
            }
        }
        if !guard::has_plain_tables(&self.connection)? {
            return Err(Setup::Refused(StoreError::NotAStore {
                path: self.path.clone(),
            }));
        }
        self.use_write_ahead_log()?;
        self.connection.pragma_update(None, "synchronous", "FULL")?;
        self.connection.pragma_update(None, "foreign_keys", true)?;
        guard::keep_pages(&self.connection)?;
        let transaction = self
            .connection
            .transaction_with_behavior(TransactionBehavior::Immediate)?;
        // Looked at again under the lock: another process may have made it meanwhile.
        match version_of(&transaction)? {
            schema::VERSION => {
                if axis_columns::bring_up_to_date(&transaction)? {
                    log::go_on(&transaction)?;
                }
            }
            0..schema::VERSION => bring_up_to_date(&transaction)?,
            found => {
                drop(transaction);
                return Err(Setup::Refused(self.other_schema(found)));
            }
        }
        transaction.commit()?;
        Ok(())
    }

    /// Turns the write-ahead log on. `SQLite` does not wait for others by itself here.
    fn use_write_ahead_log(&self) -> Result<(), Setup> {
        let begun = Instant::now();
        loop {
            let mode =
                self.connection
                    .pragma_update_and_check(None, "journal_mode", "WAL", |row| {
                        row.get::<_, String>(0)
                    });
            match mode {
                Ok(mode) if mode.eq_ignore_ascii_case("wal") => return Ok(()),
                Ok(_) => {
                    return Err(Setup::Refused(StoreError::NoLog {
                        path: self.path.clone(),
                    }));
                }
                Err(error)
                    if error.sqlite_error_code() == Some(ErrorCode::DatabaseBusy)
                        && begun.elapsed() < LOCK_WAIT =>
                {
                    std::thread::sleep(Duration::from_millis(20));
                }
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Does something in one transaction that holds the write lock from its start.
    fn write<T>(
        &mut self,
        work: impl FnOnce(&Transaction<'_>) -> Result<T, rusqlite::Error>,
    ) -> Result<T, StoreError> {
        let under_way = self.process.is_some();
        self.check_place()?;
        let result = self
            .connection
            .transaction_with_behavior(TransactionBehavior::Immediate)
            .and_then(|transaction| {
                let value = work(&transaction)?;
                log::go_on(&transaction)?;
                transaction.commit()?;
                Ok(value)
            });
        result.map_err(|error| StoreError::sqlite(&self.path, error, under_way))
    }

    /// That the files are still those that were opened: what is written to others would be lost.
    fn check_place(&self) -> Result<(), StoreError> {
        match self.loss() {
            None => Ok(()),
            Some(loss) => Err(StoreError::Gone {
                path: self.path.clone(),
                what: loss.words(),
                advice: "finished results were in it: restore it from a copy, or give the same command again to begin anew"
                    .into(),
            }),
        }
    }

    /// What became of its files.
    fn loss(&self) -> Option<Loss> {
        self.files.as_ref().and_then(Files::loss)
    }

    /// Saves all that a store holds whose files were deleted or replaced under way, as the system keeps the files themselves
    /// for as long as they are open, and puts it in its place unless something else is there now. Gives the error back with
    /// word of it. Other errors are given back as they are.
    pub(crate) fn rescue(&mut self, error: StoreError) -> StoreError {
        // A query may have met a missing log before we looked.
        let Some(loss) = self.loss() else {
            return error;
        };
        // The log beside the name may be another store's by now: closing must not touch it.
        let _ = self
            .connection
            .set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true);
        let path = self.path.clone();
        if let Some(parent) = path.parent() {
            let _ = std::fs::create_dir_all(parent);
        }
        let to = path.with_extension(format!("rescued-{}.sqlite", std::process::id()));
        let saved = self
            .connection
            .execute("VACUUM INTO ?1", [to.to_string_lossy()]);
        let advice = match saved {
            Ok(_) => self.put_back(loss, &to),
            Err(error) => format!(
                "what it held could not be saved ({error}): `sweep salvage {} --in-place` keeps all that is whole, or restore it \
                 from a copy",
                path.display()
            ),
        };
        StoreError::Gone {
            path,
            what: loss.words(),
            advice,
        }
    }

    /// Gives a rescued store the name of the lost one, if it is free, or if what has it is the file of this store without its
    /// log. Says what the user can do now.
    fn put_back(&self, loss: Loss, rescued: &Path) -> String {
        let path = &self.path;
        let placed = match loss {
            Loss::Replaced => {
                // Our own log is none of the file that has the name now, which could not be opened beside it.
                if self.files.as_ref().is_some_and(Files::has_own_log) {
                    let _ = set_aside(path);
                }
                None
            }
            Loss::Deleted => {
                // Our own log without its file; all of it is in what was rescued.
                if self.files.as_ref().is_some_and(Files::has_own_log) {
                    let _ = std::fs::remove_file(place::log_of(path));
                }
                Some(set_aside(path).and_then(|()| name_new(rescued, path)))
            }
            Loss::LogDeleted | Loss::LogReplaced | Loss::LogCut => {
                Some(set_aside(path).and_then(|()| std::fs::rename(rescued, path)))
            }
        };
        match placed {
            Some(Ok(())) => {
                "all it held was saved and put back in its place; give the same command again"
                    .into()
            }
            Some(Err(_)) | None => format!(
                "all it held is saved in {rescued}: `sweep run CAMPAIGN.toml --store {} --reuse {rescued}` takes it over into \
                 what is there now",
                path.display(),
                rescued = rescued.display()
            ),
        }
    }

    /// Turns an error of a query into one of the store.
    fn read<T>(&self, result: Result<T, rusqlite::Error>) -> Result<T, StoreError> {
        result.map_err(|error| StoreError::sqlite(&self.path, error, self.process.is_some()))
    }
}

/// Why a store could not be set up.
enum Setup {
    /// `SQLite` said so.
    Sqlite(rusqlite::Error),
    /// We did.
    Refused(StoreError),
}

impl From<rusqlite::Error> for Setup {
    fn from(error: rusqlite::Error) -> Self {
        Self::Sqlite(error)
    }
}

/// No lock is waited for much longer: a stop was asked for.
pub(crate) fn shorten_lock_wait() {
    STOP_ASKED.store(true, Ordering::Relaxed);
}

/// Waits a moment for a lock, or says that it was enough.
fn wait_for_lock(looks: i32) -> bool {
    let patience = if STOP_ASKED.load(Ordering::Relaxed) {
        LOCK_WAIT_WHEN_STOPPING
    } else {
        LOCK_WAIT
    };
    let waited = LOCK_LOOK.saturating_mul(looks.unsigned_abs());
    if waited >= patience {
        return false;
    }
    std::thread::sleep(LOCK_LOOK);
    true
}

/// A count as `SQLite` keeps it.
fn integer(count: u64) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

/// A count as it is read back; what cannot be one is 0.
fn count(integer: i64) -> u64 {
    u64::try_from(integer).unwrap_or(0)
}

#[cfg(test)]
mod tests;
