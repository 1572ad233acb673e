//! Opening a store to read it: while others write, without write access, on a full disk.

use super::lock::wait_for_lock;
use super::place::{self, address, refuse_other_than_files};
use super::schema::Lack;
use super::statements::Statements;
use super::{Store, StoreError};
use crate::model::campaign::Campaign;
use crate::system::disk::is_full;
use rusqlite::{Connection, ErrorCode, OpenFlags};
use std::path::{Path, PathBuf};

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
                if place::has_log(path) {
                    store.warning = Some(format!(
                        "the log {} cannot be read here: the last changes are not shown",
                        place::log_of(path).display()
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
        if place::has_log(path) {
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

/// A store, and the campaign file by which it is shown, if any.
#[derive(Debug, Clone)]
pub struct StoreSource {
    path: PathBuf,
    campaign: Option<Campaign>,
}

impl StoreSource {
    /// The store at this path, made absolute; with a campaign file, its present request. Without
    /// one the store is shown as last run.
    pub fn new(path: PathBuf, campaign: Option<Campaign>) -> Self {
        Self { path, campaign }
    }

    /// The store.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The campaign file.
    pub fn campaign(&self) -> Option<&Campaign> {
        self.campaign.as_ref()
    }

    /// Opens it for reading, and shows the runs that the campaign file requests, done or not,
    /// regardless of the version last run.
    ///
    /// # Errors
    /// As [`Store::open_read_only`], and [`StoreError::OtherCampaign`].
    pub fn open(&self) -> Result<Store, StoreError> {
        let mut store = Store::open_read_only(&self.path)?;
        if let Some(campaign) = &self.campaign {
            store.show_as_requested(campaign)?;
        }
        Ok(store)
    }

    /// Opens it for reading, and shows the runs up to one of their segments, by its number from 1,
    /// whose kept strain is averaged.
    ///
    /// # Errors
    /// As [`StoreSource::open`]; the inner error is a message about a missing segment.
    pub fn open_segment(&self, number: usize) -> Result<Result<Store, String>, StoreError> {
        let mut store = Store::open_read_only(&self.path)?;
        let campaign = match &self.campaign {
            Some(campaign) => campaign.clone(),
            None => store.campaign()?,
        };
        Ok(match campaign.of_segment(number) {
            Ok(campaign) => {
                store.show_as_requested(&campaign)?;
                Ok(store)
            }
            Err(message) => Err(message),
        })
    }
}
