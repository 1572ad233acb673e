//! What a user wants to see of a store: all it holds, or what a campaign file asks of it.

use super::{Store, StoreError};
use crate::campaign::Campaign;
use std::path::PathBuf;

/// A store, and the campaign file it is looked at with, if there is one.
#[derive(Debug, Clone)]
pub struct StoreSource {
    /// The store, by its whole path.
    pub path: PathBuf,
    /// The campaign file as it is now. Without one the store is shown as it was last run.
    pub campaign: Option<Campaign>,
}

impl StoreSource {
    /// Opens it for reading.
    ///
    /// # Errors
    /// As [`Store::open_as_asked`].
    pub fn open(&self) -> Result<Store, StoreError> {
        match &self.campaign {
            Some(campaign) => Store::open_as_asked(&self.path, campaign),
            None => Store::open_read_only(&self.path),
        }
    }
}
