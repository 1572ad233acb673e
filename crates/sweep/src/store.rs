//! The store: one `SQLite` file per campaign, the only memory of the program.
//!
//! State changes are synced to the disk before they count; checkpoints survive a killed process at once and a power
//! cut up to the last few. Every change to a running case is made on condition that this process still owns it. A run is a
//! pure function of its case, so what is damaged or lost is computed again.

mod campaign;
mod check;
mod claims;
mod digest;
mod ends;
mod error;
mod failures;
mod frames;
mod log;
mod merge;
mod place;
mod points;
mod provenance;
mod prune;
mod reading;
mod registry;
mod request;
mod results;
mod rules;
mod runs;
mod samples;
mod schema;
mod statements;
mod story;
mod submissions;
mod work;

pub(crate) use crate::model::checkpoint::can_be_kept;
pub use crate::model::checkpoint::{Checkpoint, Damage};
pub use check::{Checked, Finding, accept_changes, check};
pub use claims::Claim;
pub(crate) use ends::LastState;
pub use error::StoreError;
pub use failures::{Attempt, FailureLine};
pub use frames::StoredFrame;
pub(crate) use merge::MergeMode;
pub use merge::{Damaged, Disagreement, Merged};
pub use points::PointRun;
pub use provenance::Provenance;
pub use reading::StoreSource;
pub(crate) use reading::snapshot;
pub use registry::DEATH_LIMIT;
pub use request::{Adoption, Inventory};
pub use results::{Failure, Finished};
pub use rules::PointState;
pub use story::{Origin, Story};
pub use submissions::{OpenCase, SliceState, Submission, TaskName};
pub(crate) use work::PointWork;
pub use work::{Counts, ProcessLine, Work};

use log::Mark;
use place::{FileIdentity, Files};
use registry::Registered;
use request::Request;
use rusqlite::config::DbConfig;
use rusqlite::{Connection, ErrorCode, OpenFlags, Transaction, TransactionBehavior};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How long a lock is waited for before its owner is looked for.
const LOCK_WAIT: Duration = if cfg!(test) {
    Duration::from_millis(500)
} else {
    Duration::from_secs(5)
};
/// How often, where no owner is known to live.
const LOCK_WAITS: u32 = if cfg!(test) { 4 } else { 12 };
/// After so many more the user is told again.
const WAITS_UNTOLD: u32 = 60;
/// How long a lock is waited for once a stop was requested.
const LOCK_WAIT_WHEN_STOPPING: Duration = Duration::from_millis(500);
/// Time from one look at a lock to the next.
const LOCK_LOOK: Duration = Duration::from_millis(5);
/// Whether a stop was requested.
static STOP_REQUESTED: AtomicBool = AtomicBool::new(false);
/// Largest text or blob that is read, in bytes.
const LENGTH_LIMIT: i32 = 256 << 20;
/// Pages of a store that are kept in memory, in KiB: enough to go through the results of 100 000 runs several times.
const CACHE: i32 = 64 << 10;

/// An open store.
#[derive(Debug)]
pub struct Store {
    connection: Connection,
    path: PathBuf,
    /// Its files, as they were when it was opened for writing.
    files: Option<Files>,
    /// What whoever opened it must know: changes that are lost with a log.
    warning: Option<String>,
    /// This process, once it works on the store.
    process: Option<Registered>,
    /// The task of a scheduler this process works for.
    task: Option<TaskName>,
    /// What this process requests, once it has taken a campaign into the store.
    request: Option<Request>,
    /// The file last run, if another version of it is shown.
    last_run_with: Option<PathBuf>,
    /// What is waited for while cases are computed, until somebody has said so.
    waiting: Arc<Mutex<Option<String>>>,
}

impl Store {
    /// Opens a store for writing.
    ///
    /// # Errors
    /// A path that cannot be written, a file that is no store, or one of another schema. Such files are not touched.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        place::refuse_other_than_files(path)?;
        let file = FileIdentity::of(path).ok_or_else(|| StoreError::Missing {
            path: path.to_owned(),
        })?;
        let had_log = log::is_there(path);
        let last = log::check(path)?;
        let failed = |error| StoreError::sqlite(path, error, false);
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let mut connection = Connection::open_with_flags(path, flags).map_err(failed)?;
        connection
            .busy_handler(Some(wait_for_lock))
            .map_err(failed)?;
        harden(&connection).map_err(failed)?;
        let mut store = Self::on(connection, path)?;
        store.use_write_ahead_log()?;
        store
            .connection
            .pragma_update(None, "synchronous", "FULL")
            .map_err(failed)?;
        // What lies at the path must be what was opened.
        store.files = Some(Files::of(path, Some(file)));
        store.warning = store.look_for_losses(had_log, last)?;
        Ok(store)
    }

    /// A store on a connection, which must hold one.
    fn on(connection: Connection, path: &Path) -> Result<Self, StoreError> {
        let failed = |error| StoreError::sqlite(path, error, false);
        let file = path.to_owned();
        match schema::identify(&connection).map_err(failed)? {
            Some(schema::VERSION) => {}
            None => return Err(StoreError::NotAStore { path: file }),
            Some(found) => {
                return Err(StoreError::Schema {
                    path: file,
                    found,
                    known: schema::VERSION,
                });
            }
        }
        connection
            .execute_batch(&format!(
                "PRAGMA foreign_keys = OFF; PRAGMA temp_store = MEMORY; PRAGMA cache_size = -{CACHE}"
            ))
            .map_err(failed)?;
        Ok(Self {
            connection,
            path: path.to_owned(),
            files: None,
            warning: None,
            process: None,
            task: None,
            request: None,
            last_run_with: None,
            waiting: Arc::default(),
        })
    }

    /// Says what is lost with the log of a store that was opened: its end, or all of it.
    fn look_for_losses(
        &self,
        had_log: bool,
        last: Option<u64>,
    ) -> Result<Option<String>, StoreError> {
        let Some((pid, host)) = self.read(registry::abandoned(&self.connection))? else {
            return Ok(None);
        };
        let log = log::log_of(&self.path);
        Ok(if log::is_cut(&self.connection, last) {
            Some(format!(
                "the end of the log {} cannot be read: what process {pid} on {host} wrote last is lost, and is computed again",
                log.display()
            ))
        } else if !had_log {
            Some(format!(
                "process {pid} on {host} did not end in order, and there is no log {}: what it wrote last may be lost, and is \
                 computed again",
                log.display()
            ))
        } else {
            None
        })
    }

    /// What whoever opened it must know: changes that are lost with a log.
    pub fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// Turns the write-ahead log on. `SQLite` does not wait for others by itself here.
    fn use_write_ahead_log(&self) -> Result<(), StoreError> {
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
                    return Err(StoreError::NoLog {
                        path: self.path.clone(),
                    });
                }
                Err(error)
                    if error.sqlite_error_code() == Some(ErrorCode::DatabaseBusy)
                        && begun.elapsed() < LOCK_WAIT * LOCK_WAITS =>
                {
                    std::thread::sleep(LOCK_LOOK);
                }
                Err(error) => return self.read(Err(error)),
            }
        }
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What is waited for, to be told once.
    pub(crate) fn waiting(&self) -> Arc<Mutex<Option<String>>> {
        self.waiting.clone()
    }

    /// Does something in one transaction that holds the write lock from its start.
    fn write<T>(
        &mut self,
        work: impl FnOnce(&Connection) -> rusqlite::Result<T>,
    ) -> Result<T, StoreError> {
        let under_way = self.process.is_some();
        self.make_sure_of_the_file()?;
        let result = self.begin().and_then(|transaction| {
            let value = work(&transaction)?;
            Mark::renew(&transaction)?;
            transaction.commit()?;
            Ok(value)
        });
        result.map_err(|error| StoreError::sqlite(&self.path, error, under_way))
    }

    /// Begins a transaction. A lock is waited for as long as another process that works on the store lives; one that has another
    /// owner for a minute.
    fn begin(&self) -> rusqlite::Result<Transaction<'_>> {
        let mut waits = 0;
        loop {
            let begun =
                Transaction::new_unchecked(&self.connection, TransactionBehavior::Immediate);
            let Err(error) = begun else {
                return begun;
            };
            let is_busy = error.sqlite_error_code() == Some(ErrorCode::DatabaseBusy);
            waits += 1;
            if !is_busy || STOP_REQUESTED.load(Ordering::Relaxed) {
                return Err(error);
            }
            match registry::other_worker(&self.connection, self.me())? {
                Some((pid, host)) if waits % WAITS_UNTOLD == 1 => {
                    let text = format!(
                        "waiting for the lock of {}, which process {pid} on {host} works on",
                        self.path.display()
                    );
                    if self.process.is_some() {
                        let mut waiting =
                            self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
                        *waiting = Some(text);
                    } else {
                        tracing::warn!("{text}");
                    }
                }
                Some(_) => {}
                None if waits < LOCK_WAITS => {}
                None => return Err(error),
            }
        }
    }

    /// A transaction that need not be on the disk when it returns.
    fn write_relaxed<T>(
        &mut self,
        work: impl FnOnce(&Connection) -> rusqlite::Result<T>,
    ) -> Result<T, StoreError> {
        self.read(self.connection.pragma_update(None, "synchronous", "NORMAL"))?;
        let result = self.write(work);
        self.read(self.connection.pragma_update(None, "synchronous", "FULL"))?;
        result
    }

    /// Makes sure that the file at the path of the store is the one that was opened: what is written to another would be lost.
    ///
    /// # Errors
    /// [`StoreError::Gone`].
    pub fn make_sure_of_the_file(&self) -> Result<(), StoreError> {
        match self.files.as_ref().and_then(Files::loss) {
            None => Ok(()),
            Some(what) => Err(StoreError::Gone {
                path: self.path.clone(),
                what,
            }),
        }
    }

    /// Turns an error of a query into one of the store.
    fn read<T>(&self, result: rusqlite::Result<T>) -> Result<T, StoreError> {
        result.map_err(|error| StoreError::sqlite(&self.path, error, self.process.is_some()))
    }

    /// What a query finds, row by row.
    fn rows<T, C: FromIterator<T>>(
        &self,
        query: &str,
        parameters: impl rusqlite::Params,
        read: impl FnMut(&rusqlite::Row<'_>) -> rusqlite::Result<T>,
    ) -> Result<C, StoreError> {
        let rows = self
            .connection
            .prepare_cached(query)
            .and_then(|mut query| query.query_map(parameters, read)?.collect());
        self.read(rows)
    }

    /// The number that a query finds.
    fn number(&self, query: &str, parameters: impl rusqlite::Params) -> Result<u64, StoreError> {
        let number = self
            .connection
            .query_row(query, parameters, |row| row.get(0));
        self.read(number).map(count)
    }

    /// Turns an error of JSON into one of the store.
    fn json<T>(&self, result: Result<T, serde_json::Error>) -> Result<T, StoreError> {
        result.map_err(|error| StoreError::unreadable(&self.path, &error))
    }
}

impl Drop for Store {
    /// Gives back what the process still owns. `SQLite` moves the log into the file when the last one closes it, unless the file
    /// is not that of the log any more: then nothing of it stays beside the other.
    fn drop(&mut self) {
        if self.process.is_some() {
            let _ = self.leave();
        }
        if let Some(files) = self.files.as_ref().filter(|files| files.loss().is_some()) {
            let _ = self
                .connection
                .set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true);
            files.remove_own_log();
        }
    }
}

/// Lets nothing that is written in a store be carried out: no views, no triggers, no functions but those without effect.
fn harden(connection: &Connection) -> rusqlite::Result<()> {
    for (option, value) in [
        (DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false),
        (DbConfig::SQLITE_DBCONFIG_ENABLE_TRIGGER, false),
        (DbConfig::SQLITE_DBCONFIG_ENABLE_VIEW, false),
        (DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true),
    ] {
        connection.set_db_config(option, value)?;
    }
    connection.set_prepared_statement_cache_capacity(64);
    connection.set_limit(rusqlite::limits::Limit::SQLITE_LIMIT_LENGTH, LENGTH_LIMIT)?;
    Ok(())
}

/// No lock is waited for much longer: a stop was requested.
pub(crate) fn shorten_lock_wait() {
    STOP_REQUESTED.store(true, Ordering::Relaxed);
}

/// Waits a moment for a lock, or says that it was enough.
fn wait_for_lock(looks: i32) -> bool {
    let patience = if STOP_REQUESTED.load(Ordering::Relaxed) {
        LOCK_WAIT_WHEN_STOPPING
    } else {
        LOCK_WAIT
    };
    if LOCK_LOOK.saturating_mul(looks.unsigned_abs()) >= patience {
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
