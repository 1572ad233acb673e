//! An open store: its file, connection, lock and transactions.

use super::StoreError;
use super::entered::Entered;
use super::files::{FileIdentity, OpenedFiles, address, has_log, log_of, refuse_other_than_files};
use super::processes::{ActiveProcess, Registered, TaskName};
use super::schema::{self, Lack};
use super::statements::Statements;
use crate::model::case::{CaseKey, PHYSICS_VERSION};
use crate::system::disk::is_full;
use crate::system::lock;
use rusqlite::{Connection, ErrorCode, OpenFlags, Transaction, TransactionBehavior};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Page cache of a store in KiB: enough to read the results of 100 000 runs several times.
const CACHE: i32 = 64 << 10;

/// An open store.
#[derive(Debug)]
pub struct Store {
    pub(super) connection: Connection,
    pub(super) path: PathBuf,
    /// Its files, as they were when it was opened for writing.
    pub(super) files: Option<OpenedFiles>,
    /// Warning for the user: changes in a log that cannot be read.
    pub(super) warning: Option<String>,
    /// This process, once registered in the store.
    pub(super) process: Option<Registered>,
    /// The task of a scheduler this process works for.
    pub(super) task: Option<TaskName>,
    /// What this process has entered.
    pub(super) entered: Option<Entered>,
    /// The file last run, if another version is shown.
    pub(super) last_run_with: Option<PathBuf>,
    /// Note about waiting while cases are computed, until it has been printed.
    waiting: Arc<Mutex<Option<String>>>,
}

impl Store {
    /// Opens a store for writing.
    ///
    /// # Errors
    /// A path that cannot be written, a file that is not a store, or one of another schema. Such
    /// files are not changed.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        refuse_other_than_files(path)?;
        let file = FileIdentity::of(path);
        let failed = |error| StoreError::sqlite(path, error, false);
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let mut connection = Connection::open_with_flags(path, flags).map_err(failed)?;
        connection
            .busy_handler(Some(wait_for_lock))
            .map_err(failed)?;
        let mut store = Self::on(connection, path)?;
        store.use_write_ahead_log()?;
        store.complete()?;
        store.read(store.connection.pragma_update(None, "synchronous", "FULL"))?;
        // The file at the path must be the one that was opened.
        store.files = Some(OpenedFiles::of(path, file));
        Ok(store)
    }

    /// A store on a connection, which must hold one.
    pub(super) fn on(connection: Connection, path: &Path) -> Result<Self, StoreError> {
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
        connection.set_prepared_statement_cache_capacity(64);
        if let Some(found) = earlier_physics(&connection) {
            return Err(StoreError::Physics {
                path: file,
                found,
                known: PHYSICS_VERSION,
            });
        }
        Ok(Self {
            connection,
            path: path.to_owned(),
            files: None,
            warning: None,
            process: None,
            task: None,
            entered: None,
            last_run_with: None,
            waiting: Arc::default(),
        })
    }

    /// Gives a store of an earlier program the columns and views of this one.
    fn complete(&self) -> Result<(), StoreError> {
        let lack = self.read(Lack::of(&self.connection, true))?;
        self.refuse_later(lack.unknown)?;
        if lack.statements.is_empty() {
            return Ok(());
        }
        // Another process may do the same.
        self.read(self.begin().and_then(|transaction| {
            Lack::of(&transaction, true)?.supply(&transaction)?;
            transaction.commit()
        }))
    }

    /// Refuses a store with a number or an axis that this program does not know.
    pub(super) fn refuse_later(&self, unknown: Option<String>) -> Result<(), StoreError> {
        unknown.map_or(Ok(()), |column| {
            Err(StoreError::Later {
                path: self.path.clone(),
                column,
            })
        })
    }

    /// Warning for the user: changes in a log that cannot be read.
    pub fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// Enables the write-ahead log.
    pub(super) fn use_write_ahead_log(&self) -> Result<(), StoreError> {
        let mode: String = self.read(self.connection.pragma_update_and_check(
            None,
            "journal_mode",
            "WAL",
            |row| row.get(0),
        ))?;
        if mode.eq_ignore_ascii_case("wal") {
            return Ok(());
        }
        Err(StoreError::Unwritable {
            path: self.path.clone(),
            source: std::io::Error::other("this file system cannot keep a write-ahead log"),
        })
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Takes the note about waiting, to be printed once.
    pub(crate) fn waiting(&self) -> Arc<Mutex<Option<String>>> {
        self.waiting.clone()
    }

    /// Runs a function in one transaction that holds the write lock from its start.
    pub(super) fn write<T>(
        &mut self,
        work: impl FnOnce(&Connection) -> rusqlite::Result<T>,
    ) -> Result<T, StoreError> {
        let during_run = self.process.is_some();
        self.make_sure_of_the_file()?;
        let result = self.begin().and_then(|transaction| {
            let value = work(&transaction)?;
            transaction.commit()?;
            Ok(value)
        });
        result.map_err(|error| StoreError::sqlite(&self.path, error, during_run))
    }

    /// Begins a transaction. It waits for the lock while another process that works on the store
    /// lives, and for a minute if the owner is unknown.
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
            if !is_busy || is_stopping() {
                return Err(error);
            }
            match ActiveProcess::alive(&self.connection, self.me())? {
                Some(other) if waits % WAITS_BETWEEN_NOTES == 1 => {
                    let (pid, host) = (other.identity.pid, other.identity.host);
                    let text = format!(
                        "waiting for the lock of {}, held by process {pid} on {host}",
                        self.path.display()
                    );
                    if self.process.is_some() {
                        *lock(&self.waiting) = Some(text);
                    } else {
                        let _ = writeln!(crate::text::visible::stderr(), "{text}");
                    }
                }
                Some(_) => {}
                None if waits < WAITS => {}
                None => return Err(error),
            }
        }
    }

    /// A transaction that is not synced to the disk.
    pub(super) fn write_relaxed<T>(
        &mut self,
        work: impl FnOnce(&Connection) -> rusqlite::Result<T>,
    ) -> Result<T, StoreError> {
        self.read(self.connection.pragma_update(None, "synchronous", "NORMAL"))?;
        let result = self.write(work);
        self.read(self.connection.pragma_update(None, "synchronous", "FULL"))?;
        result
    }

    /// Checks that the file at the path of the store is the one that was opened: changes to another
    /// would be lost.
    ///
    /// # Errors
    /// [`StoreError::Gone`].
    pub fn make_sure_of_the_file(&self) -> Result<(), StoreError> {
        match self.files.as_ref().and_then(OpenedFiles::loss) {
            None => Ok(()),
            Some(what) => Err(StoreError::Gone {
                path: self.path.clone(),
                what,
            }),
        }
    }

    /// Row number of this process; 0 if not registered.
    pub(super) fn me(&self) -> i64 {
        self.process.as_ref().map_or(0, |process| process.id)
    }

    /// Converts an error of a query into one of the store.
    pub(super) fn read<T>(&self, result: rusqlite::Result<T>) -> Result<T, StoreError> {
        result.map_err(|error| StoreError::sqlite(&self.path, error, self.process.is_some()))
    }

    /// The rows of a query.
    pub(super) fn rows<T, C: FromIterator<T>>(
        &self,
        query: &str,
        parameters: impl rusqlite::Params,
        read: impl FnMut(&rusqlite::Row<'_>) -> rusqlite::Result<T>,
    ) -> Result<C, StoreError> {
        self.read(self.connection.all(query, parameters, read))
    }

    /// The rows of a query, by the names of their columns.
    pub(super) fn named<T: serde::de::DeserializeOwned>(
        &self,
        query: &str,
        parameters: impl rusqlite::Params,
    ) -> Result<Vec<T>, StoreError> {
        self.read(self.connection.named(query, parameters))
    }

    /// The number returned by a query.
    pub(super) fn number(
        &self,
        query: &str,
        parameters: impl rusqlite::Params,
    ) -> Result<u64, StoreError> {
        self.read(self.connection.one(query, parameters, |row| row.get(0)))
    }
}

/// Time to wait for a lock before its owner is determined.
const WAIT: Duration = if cfg!(test) {
    Duration::from_millis(500)
} else {
    Duration::from_secs(5)
};
/// Number of such waits, where no owner is known to live.
pub(super) const WAITS: u32 = if cfg!(test) { 4 } else { 12 };
/// Number of further waits between notes to the user.
pub(super) const WAITS_BETWEEN_NOTES: u32 = 60;
/// Time to wait for a lock once a stop was requested.
const WAIT_WHEN_STOPPING: Duration = Duration::from_millis(500);
/// Interval between checks of a lock.
const LOOK: Duration = Duration::from_millis(5);
/// Whether a stop was requested.
static STOP_REQUESTED: AtomicBool = AtomicBool::new(false);

/// Shortens the wait for locks, after a stop request.
pub(crate) fn shorten_lock_wait() {
    STOP_REQUESTED.store(true, Ordering::Relaxed);
}

/// Whether a stop was requested.
pub(super) fn is_stopping() -> bool {
    STOP_REQUESTED.load(Ordering::Relaxed)
}

/// Waits a moment for a lock; returns whether to continue.
pub(super) fn wait_for_lock(looks: i32) -> bool {
    let patience = if is_stopping() {
        WAIT_WHEN_STOPPING
    } else {
        WAIT
    };
    if LOOK.saturating_mul(looks.unsigned_abs()) >= patience {
        return false;
    }
    std::thread::sleep(LOOK);
    true
}

impl Store {
    /// Opens a store for reading only, while others may write to it. The reader sees one consistent
    /// state. Where the log cannot be read, as on a read-only or a full disk, the store is shown
    /// without it, with a warning.
    ///
    /// # Errors
    /// A file that is missing, not a store, or of another schema.
    pub fn open_read_only(path: &Path) -> Result<Self, StoreError> {
        refuse_other_than_files(path)?;
        match Self::read_only(path, None) {
            // SQLite creates an index of the log beside it, which fails without write access, on a
            // read-only disk or a full one.
            Err(error) if needs_snapshot_or_copy(&error) || is_full(path) => {
                let mut store = Self::read_only(path, Some("immutable=1")).map_err(|_| error)?;
                if has_log(path) {
                    store.warning = Some(format!(
                        "the log {} cannot be read here: the last changes are not shown",
                        log_of(path).display()
                    ));
                }
                Ok(store)
            }
            other => other,
        }
    }

    /// Opens the file of a store without its log and without locks, which some file systems lack.
    pub(super) fn open_without_log(path: &Path) -> Result<Self, StoreError> {
        refuse_other_than_files(path)?;
        Self::read_only(path, Some("immutable=1"))
    }

    /// Opens a shard. A published one never changes; one that still has a log may be in use.
    pub(crate) fn open_shard(path: &Path) -> Result<Self, StoreError> {
        if has_log(path) {
            return Self::open_read_only(path);
        }
        match Self::open_without_log(path) {
            Err(StoreError::Damaged { .. }) => {
                // With this SQLite reads a file whose end is missing.
                let connection = Self::connect(path, Some("immutable=1"))?;
                connection
                    .execute_batch("PRAGMA writable_schema = ON")
                    .map_err(|error| StoreError::sqlite(path, error, false))?;
                Self::on(connection, path)
            }
            opened => opened,
        }
    }

    /// Opens for reading with options of the `SQLite` URI.
    fn read_only(path: &Path, options: Option<&str>) -> Result<Self, StoreError> {
        let store = Self::on(Self::connect(path, options)?, path)?;
        // One transaction for all reads, so that they see one consistent state.
        store.read(store.connection.execute_batch("BEGIN"))?;
        let lack = store.read(Lack::of(&store.connection, false))?;
        store.read(lack.supply(&store.connection))?;
        store.refuse_later(lack.unknown)?;
        Ok(store)
    }

    fn connect(path: &Path, options: Option<&str>) -> Result<Connection, StoreError> {
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let failed = |error| StoreError::sqlite(path, error, false);
        let mut connection = match options {
            None => Connection::open_with_flags(path, flags),
            Some(options) => Connection::open_with_flags(
                address(path, options),
                flags | OpenFlags::SQLITE_OPEN_URI,
            ),
        }
        .map_err(failed)?;
        connection
            .busy_handler(Some(wait_for_lock))
            .map_err(failed)?;
        Ok(connection)
    }
}

/// Copies the present state of a store into a new file, while others continue to write to the
/// store.
pub(crate) fn snapshot(path: &Path, to: &Path) -> Result<(), StoreError> {
    let failed = |error| StoreError::sqlite(path, error, true);
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let mut connection = Connection::open_with_flags(path, flags).map_err(failed)?;
    connection
        .busy_handler(Some(wait_for_lock))
        .map_err(failed)?;
    connection
        .run("VACUUM INTO ?1", [to.to_string_lossy()])
        .map_err(|error| StoreError::sqlite(to, error, true))
}

/// Whether `SQLite` failed to open a file only because it had to write beside it.
fn needs_snapshot_or_copy(error: &StoreError) -> bool {
    match error {
        StoreError::Unwritable { .. } => true,
        StoreError::Sqlite { source, .. } => matches!(
            source.sqlite_error_code(),
            Some(ErrorCode::CannotOpen | ErrorCode::ReadOnly | ErrorCode::DiskFull)
        ),
        _ => false,
    }
}

/// The version of the physics that named the first case of a store, if it is an earlier one.
/// Damage is found later.
fn earlier_physics(connection: &Connection) -> Option<u32> {
    let first = "SELECT c.key, p.params, c.seed, c.sample_stride FROM cases c JOIN points p ON p.id = c.point
                 ORDER BY c.id LIMIT 1";
    let case = connection.query_row(first, [], |row| {
        Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?))
    });
    let (key, params, seed, stride): (String, String, u64, u64) = case.ok()?;
    (1..PHYSICS_VERSION)
        .find(|version| CaseKey::of_physics(*version, &params, seed, stride).to_string() == key)
}
