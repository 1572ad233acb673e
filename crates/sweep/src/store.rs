//! The store: one `SQLite` file per campaign, the only memory of the program.
//!
//! State changes are synced to the disk before they count; checkpoints survive a killed process at once and a power
//! cut up to the last few. Every change to a running case is made on condition that this process still owns it.

mod campaign;
mod checkpoint;
mod claims;
mod error;
mod frames;
mod process;
mod provenance;
mod query;
mod results;
mod story;

pub use checkpoint::{Checkpoint, Damage};
pub use claims::Claim;
pub use error::StoreError;
pub use frames::Kept;
pub use process::{HEARTBEAT_LIMIT, Identity};
pub use provenance::Provenance;
pub use query::{Counts, FailureLine, PointRun, ProcessLine};
pub use results::{Failure, Finished};
pub use story::{Attempt, Origin, Story};

use rusqlite::{Connection, ErrorCode, OpenFlags, Transaction, TransactionBehavior};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Marks the file as ours: `SWEP`.
const APPLICATION_ID: i32 = 0x5357_4550;
/// Version of the schema this program reads and writes.
const SCHEMA_VERSION: i32 = 2;
/// Oldest version that can be read as it is, and that is brought up to date when it is opened for writing.
const OLDEST_SCHEMA: i32 = 1;
/// How long a lock held by another program is waited for.
const PATIENCE: Duration = Duration::from_mins(1);

/// An open store.
#[derive(Debug)]
pub struct Store {
    /// The database.
    connection: Connection,
    /// Its file.
    path: PathBuf,
    /// This process, once it works on the store.
    process: Option<Registered>,
}

/// This process as the store knows it.
#[derive(Debug, Clone)]
struct Registered {
    /// Its row.
    id: i64,
    /// Who it is.
    identity: Identity,
}

impl Store {
    /// Opens a store for writing; makes it, and the directory it is in, if it is not there.
    ///
    /// # Errors
    /// A path that cannot be written, a file that is no store, or one of another schema. Such files are not touched.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(|source| StoreError::Unwritable {
                path: path.to_owned(),
                source,
            })?;
        }
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
            process: None,
        };
        store.set_up().map_err(|error| match error {
            Setup::Sqlite(error) => StoreError::sqlite(path, error, false),
            Setup::Refused(error) => error,
        })?;
        Ok(store)
    }

    /// Opens a store for reading only, while others may write to it. What is read is the state of one moment.
    ///
    /// # Errors
    /// A file that is missing, no store, or of another schema.
    pub fn open_read_only(path: &Path) -> Result<Self, StoreError> {
        if !path.exists() {
            return Err(StoreError::Missing {
                path: path.to_owned(),
            });
        }
        let plain = Self::read_only(path, None);
        match plain {
            // Without write access to the directory SQLite cannot make its index of the log; without a log it needs none.
            Err(StoreError::Trouble { ref source, .. })
                if matches!(
                    source.sqlite_error_code(),
                    Some(ErrorCode::CannotOpen | ErrorCode::ReadOnly)
                ) && !log_of(path).exists() =>
            {
                Self::read_only(path, Some("immutable=1"))
            }
            other => other,
        }
    }

    /// Opens for reading with options of the `SQLite` URI.
    fn read_only(path: &Path, options: Option<&str>) -> Result<Self, StoreError> {
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let failed = |error| StoreError::sqlite(path, error, false);
        let connection = match options {
            None => Connection::open_with_flags(path, flags),
            Some(options) => {
                let escaped = path
                    .to_string_lossy()
                    .replace('%', "%25")
                    .replace('?', "%3f")
                    .replace('#', "%23");
                Connection::open_with_flags(
                    format!("file:{escaped}?{options}"),
                    flags | OpenFlags::SQLITE_OPEN_URI,
                )
            }
        }
        .map_err(failed)?;
        let store = Self {
            connection,
            path: path.to_owned(),
            process: None,
        };
        store.connection.busy_timeout(PATIENCE).map_err(failed)?;
        match store.identify().map_err(failed)? {
            Kind::Ours(OLDEST_SCHEMA..=SCHEMA_VERSION) => {
                // One transaction for all that follows: what is read belongs to one moment.
                store.connection.execute_batch("BEGIN").map_err(failed)?;
                Ok(store)
            }
            Kind::Ours(found) => Err(store.other_schema(found)),
            Kind::Empty | Kind::Foreign => Err(StoreError::NotAStore {
                path: path.to_owned(),
            }),
        }
    }

    /// Makes or checks the schema, and sets the connection up.
    fn set_up(&mut self) -> Result<(), Setup> {
        self.connection.busy_timeout(PATIENCE)?;
        match self.identify()? {
            Kind::Ours(OLDEST_SCHEMA..=SCHEMA_VERSION) | Kind::Empty => {}
            Kind::Ours(found) => return Err(Setup::Refused(self.other_schema(found))),
            Kind::Foreign => {
                return Err(Setup::Refused(StoreError::NotAStore {
                    path: self.path.clone(),
                }));
            }
        }
        self.use_write_ahead_log()?;
        self.connection.pragma_update(None, "synchronous", "FULL")?;
        self.connection.pragma_update(None, "foreign_keys", true)?;
        let transaction = self
            .connection
            .transaction_with_behavior(TransactionBehavior::Immediate)?;
        // Looked at again under the lock: another process may have made it meanwhile.
        let version = version_of(&transaction)?;
        if version == 0 {
            transaction.execute_batch(include_str!("store/schema.sql"))?;
            transaction.pragma_update(None, "application_id", APPLICATION_ID)?;
        }
        if version < 2 {
            transaction.execute_batch(include_str!("store/schema_2.sql"))?;
        }
        if version < SCHEMA_VERSION {
            transaction.pragma_update(None, "user_version", SCHEMA_VERSION)?;
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
                        && begun.elapsed() < PATIENCE =>
                {
                    std::thread::sleep(Duration::from_millis(20));
                }
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// What the file is.
    fn identify(&self) -> Result<Kind, rusqlite::Error> {
        let application: i32 =
            self.connection
                .pragma_query_value(None, "application_id", |row| row.get(0))?;
        let tables: i64 =
            self.connection
                .query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))?;
        Ok(match (application, tables) {
            (APPLICATION_ID, _) => Kind::Ours(version_of(&self.connection)?),
            (0, 0) => Kind::Empty,
            _ => Kind::Foreign,
        })
    }

    /// The error about a store of another schema.
    fn other_schema(&self, found: i32) -> StoreError {
        StoreError::Schema {
            path: self.path.clone(),
            found,
            known: SCHEMA_VERSION,
            what: if found > SCHEMA_VERSION {
                "made by a newer version of sweep: use that version"
            } else {
                "made by an older version of sweep: use that version, or another --store"
            },
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
        let result = self
            .connection
            .transaction_with_behavior(TransactionBehavior::Immediate)
            .and_then(|transaction| {
                let value = work(&transaction)?;
                transaction.commit()?;
                Ok(value)
            });
        result.map_err(|error| StoreError::sqlite(&self.path, error, under_way))
    }

    /// Turns an error of a query into one of the store.
    fn read<T>(&self, result: Result<T, rusqlite::Error>) -> Result<T, StoreError> {
        result.map_err(|error| StoreError::sqlite(&self.path, error, self.process.is_some()))
    }
}

/// What a file is.
enum Kind {
    /// Nothing yet.
    Empty,
    /// A store of this schema version.
    Ours(i32),
    /// Something else.
    Foreign,
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

/// Version of the schema in a database, 0 if there is none.
fn version_of(connection: &Connection) -> Result<i32, rusqlite::Error> {
    connection.pragma_query_value(None, "user_version", |row| row.get(0))
}

/// The write-ahead log beside a database.
fn log_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push("-wal");
    PathBuf::from(name)
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
