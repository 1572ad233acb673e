//! Opening a store to read it: while others write, without write access, on a full disk.

use super::log::Fault;
use super::place::{address, is_full, log_of};
use super::schema::{self, Kind, identify};
use super::source::{Files, FoundWhole};
use super::{Store, StoreError, guard, log, wait_for_lock};
use crate::campaign::Campaign;
use rusqlite::config::DbConfig;
use rusqlite::{Connection, ErrorCode, OpenFlags};
use std::io;
use std::path::{Path, PathBuf};

/// Times a file that changes while it is copied is tried.
const TRIES: usize = 3;

impl Store {
    /// Opens a store for reading only, while others may write to it. What is read is the state of one moment.
    ///
    /// # Errors
    /// A file that is missing, no store, or of another schema.
    pub fn open_read_only(path: &Path) -> Result<Self, StoreError> {
        Self::open_as_known(path, &FoundWhole::default())
    }

    /// The same of a store that may have been found whole before.
    pub(super) fn open_as_known(path: &Path, known: &FoundWhole) -> Result<Self, StoreError> {
        let before = Files::of(path);
        let store = Self::open_as_it_is(path)?;
        // With this the moment is fixed of which all is read.
        store.read(schema::show_up_to_date(&store.connection))?;
        let files = Files::of(path).filter(|now| before.as_ref() == Some(now));
        if !known.are(files.as_ref()) {
            store.verify()?;
            known.remember(files);
        }
        Ok(store)
    }

    /// Opens a store for reading only, and shows of it what a campaign file asks for, done or not, whatever it was last run
    /// with.
    ///
    /// # Errors
    /// As [`Store::open_read_only`], and [`StoreError::OtherCampaign`].
    pub fn open_as_asked(path: &Path, campaign: &Campaign) -> Result<Self, StoreError> {
        let mut store = Self::open_read_only(path)?;
        store.show_as_asked(campaign)?;
        Ok(store)
    }

    /// Opens a store for reading only, in the schema it has.
    fn open_as_it_is(path: &Path) -> Result<Self, StoreError> {
        Self::refuse_what_is_none(path)?;
        let fault = log::check(path)?;
        Self::open_beside(path, fault, false)
    }

    /// Opens a store for reading that has such a log.
    fn open_beside(path: &Path, fault: Option<Fault>, damaged: bool) -> Result<Self, StoreError> {
        let mut store = match fault {
            // So that the next one that reads it can tell as well.
            Some(Fault::Cut(_)) => {
                Self::read_copy(path, damaged).or_else(|_| Self::open_or_copy(path, damaged))
            }
            _ => Self::open_or_copy(path, damaged),
        }?;
        store.warning = fault.map(Fault::into_words);
        Ok(store)
    }

    /// Refuses what is no file, or not there.
    fn refuse_what_is_none(path: &Path) -> Result<(), StoreError> {
        guard::refuse_other_than_files(path)?;
        if path.exists() {
            return Ok(());
        }
        Err(StoreError::Missing {
            path: path.to_owned(),
        })
    }

    /// Opens for reading in one of the ways there are: as others do who write to it; without a log, as a file that never
    /// changes; with one that cannot be read where it is, as a copy.
    fn open_or_copy(path: &Path, damaged: bool) -> Result<Self, StoreError> {
        let error = match Self::read_only(path, None, damaged) {
            // SQLite makes an index of the log beside it: it cannot without write access, on a read-only disk or a full one.
            Err(error) if needs_another_way(&error) || is_full(path) => error,
            other => return other,
        };
        if log_of(path).exists() {
            Self::read_copy(path, damaged).map_err(|_| error)
        } else {
            Self::read_only(path, Some("immutable=1"), damaged).map_err(|_| error)
        }
    }

    /// Opens a copy, in memory or among the temporary files, of a store nobody writes to. The copy has no name any more
    /// when this returns.
    fn read_copy(path: &Path, damaged: bool) -> Result<Self, StoreError> {
        let failed = |source| StoreError::Unwritable {
            path: path.to_owned(),
            source,
        };
        let mut last = std::io::Error::other("no place for a copy");
        for place in [PathBuf::from("/dev/shm"), std::env::temp_dir()] {
            let directory = tempfile::Builder::new()
                .prefix("sweep-copy-")
                .tempdir_in(place);
            let store = directory.and_then(|directory| {
                let copy = copy_unchanged(path, directory.path())?;
                Ok(Self::read_only(&copy, None, damaged))
            });
            match store {
                Ok(store) => {
                    return store.map(|mut store| {
                        path.clone_into(&mut store.path);
                        store
                    });
                }
                Err(error) => last = error,
            }
        }
        Err(failed(last))
    }

    /// Opens a shard. A published one never changes, so it is read without locks, which not every file system has, and
    /// leaves nothing beside it; one that still has a log may be in use.
    pub(crate) fn open_shard(path: &Path) -> Result<Self, StoreError> {
        if log_of(path).exists() {
            Self::open_as_it_is(path)
        } else {
            Self::refuse_what_is_none(path)?;
            Self::read_only(path, Some("immutable=1"), false)
        }
    }

    /// Opens a damaged store for what can be read of it. A log that is not its own is left out.
    pub(super) fn open_damaged(path: &Path) -> Result<Self, StoreError> {
        Self::refuse_what_is_none(path)?;
        match log::check(path) {
            Ok(fault) => Self::open_beside(path, fault, true),
            Err(error) => {
                let mut store = Self::read_only(path, Some("immutable=1"), true)?;
                store.warning = Some(format!("{error}; it is left out"));
                Ok(store)
            }
        }
    }

    /// Opens for reading with options of the `SQLite` URI.
    fn read_only(path: &Path, options: Option<&str>, damaged: bool) -> Result<Self, StoreError> {
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
        guard::limit_time(&mut connection, path).map_err(failed)?;
        guard::distrust(&connection).map_err(failed)?;
        if damaged {
            // Otherwise a file shorter than it says is refused as a whole.
            connection
                .set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, false)
                .map_err(failed)?;
            connection
                .pragma_update(None, "writable_schema", true)
                .map_err(failed)?;
        }
        let store = Self {
            connection,
            path: path.to_owned(),
            files: None,
            warning: None,
            process: None,
            task: None,
            asks: None,
            last_run_with: None,
        };
        match identify(&store.connection).map_err(failed)? {
            Kind::Ours(1..=schema::VERSION) => {
                if !guard::has_plain_tables(&store.connection).map_err(failed)? {
                    return Err(StoreError::NotAStore {
                        path: path.to_owned(),
                    });
                }
                // Tables of the connection alone refer to others in the file, and take no room on its disk.
                store
                    .connection
                    .execute_batch("PRAGMA foreign_keys = OFF; PRAGMA temp_store = MEMORY")
                    .map_err(failed)?;
                guard::keep_pages(&store.connection).map_err(failed)?;
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
}

/// Writes all that a store holds at this moment into a new file, while others go on writing to the store.
pub(crate) fn snapshot(path: &Path, to: &Path) -> Result<(), StoreError> {
    let failed = |error| StoreError::sqlite(path, error, true);
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let mut connection = Connection::open_with_flags(path, flags).map_err(failed)?;
    connection
        .busy_handler(Some(wait_for_lock))
        .map_err(failed)?;
    connection
        .execute("VACUUM INTO ?1", [to.to_string_lossy()])
        .map(|_| ())
        .map_err(|error| StoreError::sqlite(to, error, true))
}

/// Whether `SQLite` could not open a file for reading only because it wanted to write beside it.
fn needs_another_way(error: &StoreError) -> bool {
    match error {
        StoreError::Unwritable { .. } => true,
        StoreError::Trouble { source, .. } => matches!(
            source.sqlite_error_code(),
            Some(ErrorCode::CannotOpen | ErrorCode::ReadOnly | ErrorCode::DiskFull)
        ),
        _ => false,
    }
}

/// Copies a database and its log, neither of which may change meanwhile, into a directory of our own.
fn copy_unchanged(path: &Path, directory: &Path) -> io::Result<PathBuf> {
    let copy = directory.join("store.sqlite");
    let state = || -> io::Result<_> {
        let one = |path: &Path| {
            std::fs::metadata(path).and_then(|file| Ok((file.len(), file.modified()?)))
        };
        Ok((one(path)?, one(&log_of(path)).ok()))
    };
    for _ in 0..TRIES {
        let before = state()?;
        std::fs::copy(path, &copy)?;
        match std::fs::copy(log_of(path), log_of(&copy)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        if state()? == before {
            return Ok(copy);
        }
    }
    Err(io::Error::other("it changes all the time"))
}
