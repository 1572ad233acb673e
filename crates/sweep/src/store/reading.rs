//! Opening a store to read it: while others write, without write access, on a full disk.

use super::place::{is_full, refuse_folder};
use super::schema::{self, Kind, identify};
use super::{Store, StoreError, wait_for_lock};
use crate::campaign::Campaign;
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
        let store = Self::open_as_it_is(path)?;
        store.read(schema::show_up_to_date(&store.connection))?;
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
        refuse_folder(path)?;
        if !path.exists() {
            return Err(StoreError::Missing {
                path: path.to_owned(),
            });
        }
        match Self::read_only(path, None, false) {
            // Without write access to the directory SQLite cannot make its index of the log; without a log it needs none.
            Err(StoreError::Trouble { ref source, .. })
                if matches!(
                    source.sqlite_error_code(),
                    Some(ErrorCode::CannotOpen | ErrorCode::ReadOnly)
                ) && !log_of(path).exists() =>
            {
                Self::read_only(path, Some("immutable=1"), false)
            }
            // Nor can it on a full disk; a copy elsewhere can be read.
            Err(error @ StoreError::Trouble { passing: true, .. }) if is_full(path) => {
                Self::read_copy(path).map_err(|_| error)
            }
            other => other,
        }
    }

    /// Opens a copy, in memory or among the temporary files, of a store nobody writes to. The copy has no name any more
    /// when this returns.
    fn read_copy(path: &Path) -> Result<Self, StoreError> {
        let failed = |source| StoreError::Unwritable {
            path: path.to_owned(),
            source,
        };
        let mut last = std::io::Error::other("no place for a copy");
        for place in [PathBuf::from("/dev/shm"), std::env::temp_dir()] {
            let directory = place.join(format!("sweep-copy-{}", std::process::id()));
            let copied = copy_unchanged(path, &directory);
            let store = copied.map(|copy| Self::read_only(&copy, None, false));
            let _ = std::fs::remove_dir_all(&directory);
            match store {
                Ok(store) => return store,
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
            Self::read_only(path, Some("immutable=1"), false)
        }
    }

    /// Opens a damaged store for what can be read of it.
    pub(super) fn open_damaged(path: &Path) -> Result<Self, StoreError> {
        if !path.exists() {
            return Err(StoreError::Missing {
                path: path.to_owned(),
            });
        }
        Self::read_only(path, None, true)
    }

    /// Opens for reading with options of the `SQLite` URI.
    fn read_only(path: &Path, options: Option<&str>, damaged: bool) -> Result<Self, StoreError> {
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let failed = |error| StoreError::sqlite(path, error, false);
        let mut connection = match options {
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
        connection
            .busy_handler(Some(wait_for_lock))
            .map_err(failed)?;
        if damaged {
            // Otherwise a file shorter than it says is refused as a whole.
            connection
                .pragma_update(None, "writable_schema", true)
                .map_err(failed)?;
        }
        let store = Self {
            connection,
            path: path.to_owned(),
            file: None,
            process: None,
            task: None,
            asks: None,
            last_run_with: None,
        };
        match identify(&store.connection).map_err(failed)? {
            Kind::Ours(1..=schema::VERSION) => {
                // Tables of the connection alone refer to others in the file, and take no room on its disk.
                store
                    .connection
                    .execute_batch("PRAGMA foreign_keys = OFF; PRAGMA temp_store = MEMORY")
                    .map_err(failed)?;
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

/// Copies a database and its log, neither of which may change meanwhile, into a new directory of our own.
fn copy_unchanged(path: &Path, directory: &Path) -> io::Result<PathBuf> {
    use std::os::unix::fs::DirBuilderExt as _;
    std::fs::DirBuilder::new().mode(0o700).create(directory)?;
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

/// The write-ahead log beside a database.
pub(super) fn log_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push("-wal");
    PathBuf::from(name)
}
