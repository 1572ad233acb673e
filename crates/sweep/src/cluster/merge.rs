//! Joining shards into the store of their campaign.

use super::{ClusterError, shard};
use crate::model::campaign::Campaign;
use crate::store::{Counts, Merged, MergedCases, Store, StoreError, StoreSource};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// The outcome of a merge.
#[derive(Serialize)]
pub(crate) struct Joined {
    #[serde(flatten)]
    pub(crate) merged: Merged,
    pub(crate) cases: Counts,
    /// Runs of the store that belong to other versions of the campaign.
    pub(crate) orphans: u64,
    /// Builds of the program that computed the results.
    pub(crate) builds: Vec<String>,
}

/// The shards published in a folder.
pub(crate) fn paths(folder: &Path) -> Vec<PathBuf> {
    let shards = shard::published(folder).into_iter();
    shards.map(|shard| shard.path).collect()
}

/// The shards given, and all shards in the folders given; without arguments, those in the folder
/// beside the store.
pub(crate) fn shards_in(given: &[PathBuf], store: &Path) -> Result<Vec<PathBuf>, ClusterError> {
    let usual = [shard::folder_of(store)];
    let given = if given.is_empty() { &usual } else { given };
    let mut all = Vec::new();
    for path in given {
        if path.is_dir() {
            all.extend(paths(path));
        } else if path.exists() {
            all.push(path.clone());
        } else {
            return Err(ClusterError::Vanished { path: path.clone() });
        }
    }
    Ok(all)
}

/// Merges shards.
pub(crate) fn join(store: &mut Store, shards: &[PathBuf]) -> Result<Joined, StoreError> {
    Ok(Joined {
        merged: store.merge(MergedCases::All, shards)?,
        cases: store.counts()?,
        orphans: store.orphans()?,
        builds: store.builds()?,
    })
}

/// Opens the store. A new one gets the campaign of the file given, or else that of the first
/// readable shard; it is not made for shards of several campaigns.
pub(crate) fn store_for(source: &StoreSource, shards: &[PathBuf]) -> Result<Store, ClusterError> {
    let path = source.path();
    if path.exists() {
        return Ok(Store::open(path)?);
    }
    let enter = |campaign: &Campaign| {
        Store::readable(&campaign.name, shards)?;
        Ok(Store::enter(path, campaign)?.0)
    };
    if let Some(campaign) = source.campaign() {
        return enter(campaign);
    }
    if shards.is_empty() {
        return Err(ClusterError::NoShards {
            store: path.to_owned(),
        });
    }
    let mut first = None;
    for shard in shards {
        match Store::campaign_of(shard) {
            Ok(text) => {
                let campaign = crate::campaign::parse(&shard.display().to_string(), text)?;
                return enter(&campaign);
            }
            Err(error) => first = first.or(Some(error)),
        }
    }
    let missing = || StoreError::Missing {
        path: path.to_owned(),
    };
    Err(first.unwrap_or_else(missing).into())
}
