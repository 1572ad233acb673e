//! A store that is looked at, with the campaign file whose version of it is shown.

use super::{Store, StoreError};
use crate::model::campaign::Campaign;
use std::path::{Path, PathBuf};

/// A store, and the campaign file it is looked at with, if there is one.
#[derive(Debug, Clone)]
pub struct StoreSource {
    path: PathBuf,
    campaign: Option<Campaign>,
}

impl StoreSource {
    /// The store at this place, by its whole path; with a campaign file, as that is now, what it requests. Without one the store is
    /// shown as it was last run.
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

    /// Opens it for reading, and shows of it what the campaign file requests, done or not, whatever it was last run with.
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
}
