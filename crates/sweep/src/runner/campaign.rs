//! A campaign from its file to its store, and to the last of its cases.

use super::{Options, RunnerError, compute_campaign};
use crate::model::campaign::Campaign;
use crate::store::{self, Adoption, Counts, Finding, Store, StoreError};
use std::path::Path;

/// Options of the start of a campaign.
#[derive(Debug, Clone, Copy)]
pub struct StartOptions {
    /// Whether failed runs are computed again.
    pub retry_failed: bool,
    /// Whether all runs are to keep a frame with each sample: those that lack some are computed
    /// again.
    pub trajectory: bool,
}

/// A campaign in its store, ready to be computed.
#[derive(Debug)]
pub struct StartedCampaign {
    /// Its store.
    pub store: Store,
    /// What the store held before.
    pub adoption: Adoption,
    /// Damaged runs of the store, which are computed again.
    pub damaged: Vec<Finding>,
    /// Number of runs that are computed again for their frames.
    pub without_frames: u64,
}

/// Enters a campaign into its store and prepares everything that precedes computing.
///
/// # Errors
/// An I/O or SQLite error of the store.
pub fn begin(
    path: &Path,
    campaign: &Campaign,
    beginning: StartOptions,
) -> Result<StartedCampaign, StoreError> {
    let damaged = if store::is_free(path) {
        Vec::new()
    } else {
        Store::open(path)?.forget_damaged()?
    };
    let (mut store, adoption) = Store::enter(path, campaign)?;
    if beginning.retry_failed {
        store.retry_failed()?;
    }
    let without_frames = if beginning.trajectory {
        store.request_frames()?
    } else {
        0
    };
    Ok(StartedCampaign {
        store,
        adoption,
        damaged,
        without_frames,
    })
}

/// Computes the open cases of a campaign in its store, which must hold that campaign to the end.
/// Returns the number of cases by state.
///
/// # Errors
/// Those of [`compute_campaign`], and a store that now holds another version of the campaign or is
/// no longer at its path.
pub fn complete(
    store: &mut Store,
    campaign: &Campaign,
    options: Options<'_>,
) -> Result<Counts, RunnerError> {
    let counts = store.counts()?;
    if counts.pending + counts.running > 0 {
        compute_campaign(store, campaign, options)?;
    } else {
        // A process may have died after its last case.
        store.release_dead()?;
    }
    store.check_campaign()?;
    store.make_sure_of_the_file()?;
    Ok(store.counts()?)
}
