//! Merging shards: copies results from other stores of the same campaign, case by case, in any
//! order and repeatedly.
//!
//! A complete run outranks a failed one, that one a partial one, more steps outrank fewer. Two
//! complete runs of one case must have the same bits; if not, the later attempt is kept.

mod case;

use super::entered::Entered;
use super::statements::Statements;
use super::{Store, StoreError, files, rules};
use case::Merging;
use serde::Serialize;
use std::collections::HashMap;
use std::fmt;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// Outcome of a merge.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Merged {
    /// Shards read.
    pub shards: u64,
    /// Results copied.
    pub results: u64,
    /// Results already present, with the same bits.
    pub duplicates: u64,
    /// Failures copied.
    pub failures: u64,
    /// Running cases whose checkpoints were copied.
    pub checkpoints: u64,
    /// Damaged entries of shards.
    pub unreadable: u64,
    /// Unreadable shards, with the reason.
    pub damaged: Vec<Damaged>,
    /// Results that differ from those of another attempt.
    pub disagreements: Vec<Disagreement>,
}

/// An unreadable shard.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Damaged {
    /// The file.
    pub path: PathBuf,
    /// The reason.
    pub reason: String,
}

impl Damaged {
    fn of(path: &Path, reason: &dyn fmt::Display) -> Self {
        Self {
            path: path.to_owned(),
            reason: reason.to_string(),
        }
    }
}

impl fmt::Display for Damaged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} cannot be used: {}", self.path.display(), self.reason)
    }
}

/// Two results of one case with different bits.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Disagreement {
    /// Key of the case.
    pub key: String,
    /// Process of the result that is kept.
    pub kept: String,
    /// Process of the other result.
    pub other: String,
    /// First difference.
    pub what: String,
}

/// Which cases a merge takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MergedCases {
    /// All that the shards have something of.
    All,
    /// Those of the store, which is that of one task.
    Own,
}

impl Store {
    /// Merges shards. The campaigns of all of them are compared before the first is merged.
    pub(crate) fn merge(
        &mut self,
        cases: MergedCases,
        shards: &[PathBuf],
    ) -> Result<Merged, StoreError> {
        let (readable, damaged) = Self::readable(&self.campaign_name()?, shards)?;
        let mut merged = Merged {
            damaged,
            ..Merged::default()
        };
        let entered = self.entered()?;
        for path in readable {
            self.merge_one(cases, path, &entered, &mut merged)?;
        }
        Ok(merged)
    }

    /// The readable shards, and the others.
    ///
    /// # Errors
    /// A shard of another campaign than that of this name.
    pub(crate) fn readable<'s>(
        name: &str,
        shards: &'s [PathBuf],
    ) -> Result<(Vec<&'s PathBuf>, Vec<Damaged>), StoreError> {
        let (mut readable, mut damaged) = (Vec::new(), Vec::new());
        for path in shards {
            // Closed again: there may be thousands.
            match Store::open_shard(path).map(|shard| shard.campaign_name()) {
                Ok(Ok(found)) if found != name => {
                    return Err(StoreError::OtherCampaign {
                        path: path.clone(),
                        found,
                        wanted: name.to_owned(),
                    });
                }
                // The key of a case tells what it is, where the name cannot be read.
                Ok(_) => readable.push(path),
                Err(error) => damaged.push(Damaged::of(path, &error)),
            }
        }
        Ok((readable, damaged))
    }

    /// Merges one shard in one transaction.
    fn merge_one(
        &mut self,
        cases: MergedCases,
        path: &Path,
        entered: &Entered,
        merged: &mut Merged,
    ) -> Result<(), StoreError> {
        let shard = match Store::open_shard(path) {
            Ok(shard) => shard,
            Err(error) => {
                merged.damaged.push(Damaged::of(path, &error));
                return Ok(());
            }
        };
        let mut damage = shard.missing_end();
        let mut after = merged.clone();
        self.write(|connection| {
            let mut merging = Merging {
                other: &shard.connection,
                connection,
                cases,
                protocol: &entered.protocol,
                processes: HashMap::new(),
                merged: &mut after,
            };
            let ids = "SELECT id FROM cases";
            match shard.connection.values::<i64, Vec<_>>(ids, []) {
                Ok(ids) => ids.into_iter().try_for_each(|id| merging.case(id))?,
                Err(error) => damage = Some(error.to_string()),
            }
            if after == *merged {
                return Ok(());
            }
            rules::apply_all(connection, &entered.rules)
        })?;
        *merged = after;
        merged.shards += 1;
        let damage = damage.map(|reason| Damaged::of(path, &reason));
        merged.damaged.extend(damage);
        Ok(())
    }

    /// Says how much of the file is there, if its end is missing by its header. `SQLite` does not
    /// always tell; other damage is found by digests.
    fn missing_end(&self) -> Option<String> {
        let mut header = [0; 32];
        let mut file = File::open(&self.path).ok()?;
        file.read_exact(&mut header).ok()?;
        let page = match u16::from_be_bytes([header[16], header[17]]) {
            1 => 1 << 16,
            size => u64::from(size),
        };
        let pages = [header[28], header[29], header[30], header[31]];
        let whole = page * u64::from(u32::from_be_bytes(pages));
        let there = file.metadata().ok()?.len();
        let is_cut = there < whole && !files::has_log(&self.path);
        is_cut.then(|| format!("half-written: {there} bytes of {whole}"))
    }

    /// The text of the campaign file of a shard, or of a damaged store.
    pub(crate) fn campaign_of(shard: &Path) -> Result<String, StoreError> {
        Store::open_shard(shard)?.campaign_text()
    }

    /// Builds of the program that computed stored results. Bits repeat on the same build only.
    pub(crate) fn builds(&self) -> Result<Vec<String>, StoreError> {
        let builds = "SELECT DISTINCT build FROM processes WHERE id IN
             (SELECT process FROM results UNION SELECT process FROM checkpoints
              UNION SELECT process FROM failures) ORDER BY build";
        self.read(self.connection.values(builds, []))
    }
}
