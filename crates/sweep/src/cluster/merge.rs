//! Joining shards into the store of their campaign.

use super::{ClusterError, shard};
use crate::model::order::Order;
use crate::store::{Counts, Disagreement, Merged, Store, StoreError, StoreSource};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// The outcome of a merge.
#[derive(Serialize)]
pub(crate) struct Joined {
    #[serde(flatten)]
    pub(crate) merged: Merged,
    /// Cases of the store by state.
    pub(crate) cases: Counts,
    /// Results that disagree.
    pub(crate) disagreements: Vec<Disagreement>,
    /// Shards of other builds in the store.
    pub(crate) mixed_shards: u64,
}

/// The shards given, and all shards in the folders given; without arguments, those in the folder
/// beside the store.
pub(crate) fn shards_in(given: &[PathBuf], store: &Path) -> Result<Vec<PathBuf>, ClusterError> {
    if given.is_empty() {
        return in_folder(&shard::folder_of(store));
    }
    let mut all = Vec::new();
    for given in given {
        if given.is_dir() {
            all.extend(in_folder(given)?);
        } else if given.exists() {
            all.push(given.clone());
        } else {
            let path = given.clone();
            return Err(ClusterError::Vanished { path });
        }
    }
    Ok(all)
}

/// Merges shards.
pub(crate) fn join(
    store: &mut Store,
    shards: &[PathBuf],
    mixed: bool,
) -> Result<Joined, StoreError> {
    Ok(Joined {
        merged: store.merge(shards, mixed)?,
        cases: store.counts()?,
        disagreements: store.disagreements()?,
        mixed_shards: store.mixed_shards()?,
    })
}

/// The shards in a folder.
fn in_folder(folder: &Path) -> Result<Vec<PathBuf>, ClusterError> {
    if !folder.is_dir() {
        return Err(ClusterError::Vanished {
            path: folder.to_owned(),
        });
    }
    Ok(shard::published(folder)
        .into_iter()
        .map(|shard| shard.path)
        .collect())
}

/// Opens the store. A new one gets the campaign of the file given, or else that of the first
/// readable shard.
pub(crate) fn store_for(source: &StoreSource, shards: &[PathBuf]) -> Result<Store, ClusterError> {
    let path = source.path();
    if path.exists() {
        return Ok(Store::open(path)?);
    }
    if let Some(campaign) = source.campaign() {
        return Ok(Store::enter(path, campaign, Order::default())?.0);
    }
    let mut first = None;
    for shard in shards {
        match Store::campaign_of(shard) {
            Ok(text) => {
                let campaign = crate::campaign::parse(&shard.display().to_string(), text)?;
                return Ok(Store::enter(path, &campaign, Order::default())?.0);
            }
            Err(error) => first = first.or(Some(error)),
        }
    }
    Err(first
        .unwrap_or_else(|| StoreError::Missing {
            path: path.to_owned(),
        })
        .into())
}
