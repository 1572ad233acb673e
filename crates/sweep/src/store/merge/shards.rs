//! Checks of shards before a merge: integrity, build, changes since the last merge.

use crate::store::check::SIZE;
use crate::store::database::Statements;
use crate::store::{Store, StoreError, database};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// Identity of a shard in the record of merged shards.
pub(super) struct Stamp {
    pub(super) name: String,
    pub(super) size: u64,
    /// Time of its last change, in nanoseconds since 1970.
    pub(super) modified: i64,
    /// Whether it has a log, so that its contents may change without a change of the file.
    pub(super) changing: bool,
}

impl Stamp {
    /// The identity of the present file of this name.
    pub(super) fn of(path: &Path) -> Result<Self, StoreError> {
        let file = std::fs::metadata(path).map_err(|_| StoreError::Missing {
            path: path.to_owned(),
        })?;
        let since = file.modified().ok();
        let since = since.and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        let name = path.file_name().unwrap_or(path.as_os_str());
        Ok(Self {
            name: name.to_string_lossy().into_owned(),
            size: file.len(),
            changing: database::has_log(path),
            modified: since.map_or(0, |since| {
                i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
            }),
        })
    }
}

/// A candidate for a merge.
pub(super) struct Shard {
    /// The file. It is closed between the check and the merge, since there may be thousands.
    pub(super) path: PathBuf,
    /// The campaign it belongs to, if readable.
    pub(super) campaign: Option<String>,
    /// The file as it was when it was opened.
    pub(super) stamp: Stamp,
    /// Builds of the program that computed it.
    pub(super) builds: BTreeSet<String>,
    /// Its damage.
    pub(super) damage: Option<String>,
}

/// Indices of shards with an unknown build. If none is known, all must be equal.
pub(super) fn foreign(known: &BTreeSet<String>, shards: &[Shard]) -> Vec<(usize, String)> {
    let known = if known.is_empty() {
        let first = shards.iter().find_map(|shard| shard.builds.first());
        first.cloned().into_iter().collect()
    } else {
        known.clone()
    };
    shards
        .iter()
        .enumerate()
        .flat_map(|(number, shard)| {
            let foreign = shard.builds.difference(&known);
            foreign.map(move |build| (number, build.clone()))
        })
        .collect()
}

impl Shard {
    /// Checks a shard. The intact cases of a damaged one are still merged.
    pub(super) fn look(path: &Path) -> Result<Self, StoreError> {
        // Before it is opened: if it is replaced meanwhile, the next merge reads the new one.
        let stamp = Stamp::of(path)?;
        let store = Store::open_shard(path)?;
        let mut damage = None;
        let found = store.connection.value("PRAGMA quick_check(1)", []);
        let found = found.map(|found: Option<String>| found.unwrap_or_default());
        match found {
            Ok(found) if found == "ok" => {}
            Ok(found) => damage = Some(format!("half-written or damaged: {}", found.trim())),
            Err(error) => damage = Some(format!("half-written or damaged: {error}")),
        }
        // SQLite reads a missing end of the last page as zeros.
        let whole = store.number(SIZE, []).unwrap_or(stamp.size);
        if !stamp.changing && whole != stamp.size {
            damage = Some(format!("half-written: {} bytes of {whole}", stamp.size));
        }
        Ok(Self {
            path: path.to_owned(),
            campaign: store.campaign_name().ok(),
            builds: store.builds().unwrap_or_default(),
            stamp,
            damage,
        })
    }
}
