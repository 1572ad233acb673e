//! What a user wants to see of a store: all it holds, or what a campaign file asks of it.

use super::place::FileIdentity;
use super::place::log_of;
use super::{Store, StoreError};
use crate::campaign::Campaign;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime};

/// How long the files of a store must have been left alone before they are known by their times: file systems count time in steps,
/// of up to two seconds.
const SETTLED: Duration = Duration::from_secs(3);

/// A store, and the campaign file it is looked at with, if there is one. What is opened again and again, and was found whole
/// before, is compared with its checksums only once its files have changed.
#[derive(Debug, Clone)]
pub struct StoreSource {
    path: PathBuf,
    campaign: Option<Campaign>,
    found_whole: FoundWhole,
}

impl StoreSource {
    /// The store at this place, by its whole path; with a campaign file, as that is now, what it asks for. Without one the store is
    /// shown as it was last run.
    pub fn new(path: PathBuf, campaign: Option<Campaign>) -> Self {
        Self {
            path,
            campaign,
            found_whole: FoundWhole::default(),
        }
    }

    /// The store.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The campaign file.
    pub fn campaign(&self) -> Option<&Campaign> {
        self.campaign.as_ref()
    }

    /// Opens it for reading.
    ///
    /// # Errors
    /// As [`Store::open_as_asked`].
    pub fn open(&self) -> Result<Store, StoreError> {
        let mut store = Store::open_as_known(&self.path, &self.found_whole)?;
        if let Some(campaign) = &self.campaign {
            store.show_as_asked(campaign)?;
        }
        Ok(store)
    }
}

/// The files of a store as they were when all that is in them was what was written.
#[derive(Debug, Clone, Default)]
pub(super) struct FoundWhole(Arc<Mutex<Option<Files>>>);

impl FoundWhole {
    /// Whether these files are those.
    pub(super) fn are(&self, files: Option<&Files>) -> bool {
        let known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        files.is_some() && known.as_ref() == files
    }

    /// Remembers these files, unless they changed so lately that another change might not show.
    pub(super) fn remember(&self, files: Option<Files>) {
        let settled = files.filter(Files::are_settled);
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = settled;
    }
}

/// What tells the files of a store from others, and from themselves after a change.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Files {
    database: File,
    /// `None` without a log, or with one in which there is nothing.
    log: Option<File>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct File {
    identity: FileIdentity,
    bytes: u64,
    changed_at: SystemTime,
}

impl Files {
    /// As they are now; `None` if that cannot be told.
    pub(super) fn of(path: &Path) -> Option<Self> {
        Some(Self {
            database: File::of(path)?,
            log: File::of(&log_of(path)).filter(|log| log.bytes > 0),
        })
    }

    fn are_settled(&self) -> bool {
        let now = SystemTime::now();
        let is_settled = |file: &File| {
            now.duration_since(file.changed_at)
                .is_ok_and(|age| age > SETTLED)
        };
        is_settled(&self.database) && self.log.as_ref().is_none_or(is_settled)
    }
}

impl File {
    fn of(path: &Path) -> Option<Self> {
        let file = std::fs::metadata(path).ok()?;
        Some(Self {
            identity: FileIdentity::of_file(&file),
            bytes: file.len(),
            changed_at: file.modified().ok()?,
        })
    }
}
