//! Merging shards: copies results from other stores of the same campaign, case by case, in any
//! order and repeatedly.
//!
//! A complete run outranks a failed one, that one a partial one, more steps outrank fewer. Two
//! complete runs of one case must have the same bits; if not, the later attempt is kept.

mod case;
mod shards;

use super::database::Statements;
use super::entry::Entered;
use super::{Store, StoreError, rules, settle};
use crate::system::process::now;
use case::Merging;
use rusqlite::params;
use serde::{Deserialize, Serialize};
use shards::{Shard, Stamp, foreign};
use std::collections::{BTreeSet, HashMap};
use std::fmt;
use std::path::{Path, PathBuf};

/// Outcome of a merge.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Merged {
    /// Shards read.
    pub shards: u64,
    /// Shards that had not changed since they were merged before.
    pub unchanged: u64,
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
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
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

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MergeMode {
    /// Into the store of the campaign: everything, with a record of the shard.
    Campaign,
    /// Into the store of one task: its own cases only, without record.
    Task,
    /// From any campaign: cases that this one has too, without record. The key of a case covers all
    /// that its bits depend on, including the version of the physics.
    Reuse,
}

impl Store {
    /// Merges shards. All of them are checked before the first is merged.
    pub(crate) fn merge(&mut self, shards: &[PathBuf], mixed: bool) -> Result<Merged, StoreError> {
        self.merge_as(MergeMode::Campaign, shards, mixed)
    }

    /// Copies runs of cases of this store from stores of any campaigns.
    pub(crate) fn reuse(&mut self, stores: &[PathBuf]) -> Result<Merged, StoreError> {
        self.merge_as(MergeMode::Reuse, stores, true)
    }

    /// [`Store::merge`] in some mode.
    pub(crate) fn merge_as(
        &mut self,
        mode: MergeMode,
        shards: &[PathBuf],
        mixed: bool,
    ) -> Result<Merged, StoreError> {
        let name = self.campaign_name()?;
        let mut merged = Merged::default();
        let mut readable = Vec::new();
        for path in shards {
            if let (MergeMode::Campaign, Ok(stamp)) = (mode, Stamp::of(path))
                && self.has_merged(&stamp)?
            {
                merged.unchanged += 1;
                continue;
            }
            match Shard::look(path) {
                Ok(shard) => match shard.campaign.clone() {
                    Some(found) if mode != MergeMode::Reuse && found != name => {
                        return Err(StoreError::OtherCampaign {
                            path: path.clone(),
                            found,
                            wanted: name,
                        });
                    }
                    _ => readable.push(shard),
                },
                Err(error) => merged.damaged.push(Damaged::of(path, &error)),
            }
        }
        let known = match mode {
            MergeMode::Campaign => self.known_builds()?,
            MergeMode::Task | MergeMode::Reuse => BTreeSet::from([crate::system::process::build()]),
        };
        let foreign = foreign(&known, &readable);
        if let Some((shard, build)) = foreign.first().filter(|_| !mixed) {
            return Err(StoreError::OtherBuild {
                path: readable[*shard].path.clone(),
                build: build.clone(),
                known: known.into_iter().collect::<Vec<_>>().join(", "),
            });
        }
        let entered = self.entered()?;
        for (number, shard) in readable.iter().enumerate() {
            let mixed = foreign.iter().any(|(of, _)| *of == number);
            // Once is enough: averages rarely differ in the discarded strain.
            let is_last = number + 1 == readable.len();
            self.merge_one(mode, shard, mixed, (&entered, is_last), &mut merged)?;
        }
        Ok(merged)
    }

    /// The text of the campaign file of a shard, or of a damaged store.
    pub(crate) fn campaign_of(shard: &Path) -> Result<String, StoreError> {
        Store::open_shard(shard)?.campaign_text()
    }

    /// Whether a shard is recorded as merged and has not changed since.
    fn has_merged(&self, stamp: &Stamp) -> Result<bool, StoreError> {
        if stamp.changing {
            return Ok(false);
        }
        self.read(self.connection.has(
            "SELECT 1 FROM shards WHERE name = ?1 AND size = ?2 AND modified = ?3",
            params![stamp.name, stamp.size, stamp.modified],
        ))
    }

    /// Builds of the program that computed stored results or that jobs use.
    pub(crate) fn known_builds(&self) -> Result<BTreeSet<String>, StoreError> {
        let mut known = self.builds()?;
        known.extend(self.submissions()?.into_iter().map(|job| job.build));
        Ok(known)
    }

    /// Builds of the program that computed stored results.
    fn builds(&self) -> Result<BTreeSet<String>, StoreError> {
        let builds = "SELECT DISTINCT build FROM processes WHERE id IN
             (SELECT process FROM results UNION SELECT process FROM checkpoints UNION SELECT process FROM failures)";
        self.read(self.connection.values(builds, []))
    }

    /// Merges one shard in one transaction.
    fn merge_one(
        &mut self,
        mode: MergeMode,
        shard: &Shard,
        mixed: bool,
        (entered, is_last): (&Entered, bool),
        merged: &mut Merged,
    ) -> Result<(), StoreError> {
        let store = match Store::open_shard(&shard.path) {
            Ok(store) => store,
            Err(error) => {
                merged.damaged.push(Damaged::of(&shard.path, &error));
                return Ok(());
            }
        };
        let builds = self.json(serde_json::to_string(&shard.builds))?;
        let before = merged.clone();
        let mut damage = shard.damage.clone();
        let written = self.write(|connection| {
            let mut merging = Merging {
                other: &store.connection,
                connection,
                mode,
                protocol: &entered.protocol,
                processes: HashMap::new(),
                merged,
            };
            let ids: rusqlite::Result<Vec<i64>> =
                store.connection.values("SELECT id FROM cases", []);
            match ids {
                Ok(ids) => ids.into_iter().try_for_each(|id| merging.case(id))?,
                Err(error) => damage = Some(error.to_string()),
            }
            if is_last {
                settle::settle_all(connection, entered)?;
                rules::apply_all(connection, &entered.rules)?;
            }
            if mode == MergeMode::Campaign && damage.is_none() {
                connection.execute(
                    "INSERT OR REPLACE INTO shards (name, size, modified, builds, mixed, merged_at)
                     VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
                    params![
                        shard.stamp.name,
                        shard.stamp.size,
                        shard.stamp.modified,
                        builds,
                        mixed,
                        now()
                    ],
                )?;
            }
            Ok(())
        });
        if written.is_err() {
            *merged = before;
        }
        written?;
        merged.shards += 1;
        let damage = damage.map(|reason| Damaged::of(&shard.path, &reason));
        merged.damaged.extend(damage);
        Ok(())
    }

    /// Number of disagreeing results found so far.
    pub(crate) fn disagreements(&self) -> Result<Vec<Disagreement>, StoreError> {
        let who = |of: &str| {
            format!(
                "CASE WHEN {of}.job IS NULL THEN 'process ' || {of}.pid
                      ELSE 'job ' || {of}.job || ' task ' || {of}.task || ' restart ' || {of}.restart END || ' on ' || {of}.host"
            )
        };
        let query = format!(
            "SELECT c.key, {} AS kept, {} AS other, d.what FROM disagreements d JOIN cases c ON c.id = d.case_id
             JOIN processes k ON k.id = d.kept JOIN processes o ON o.id = d.other
             ORDER BY c.position, c.id",
            who("k"),
            who("o")
        );
        self.named(&query, [])
    }

    /// Number of these shards that were not merged, or have changed since.
    pub(crate) fn unmerged(&self, shards: &[PathBuf]) -> Result<u64, StoreError> {
        let mut number = 0;
        for shard in shards {
            let stamp = Stamp::of(shard).ok();
            let is_merged = stamp.map_or(Ok(false), |stamp| self.has_merged(&stamp))?;
            number += u64::from(!is_merged);
        }
        Ok(number)
    }

    /// Number of accepted shards of other builds.
    pub(crate) fn mixed_shards(&self) -> Result<u64, StoreError> {
        self.number("SELECT count(*) FROM shards WHERE mixed", [])
    }
}
