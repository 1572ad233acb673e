//! Comparison of a campaign file with its store, and removal of runs that are not in the file.

use super::check::OF_CASES;
use super::statements::Statements;
use super::{Store, StoreError};
use serde::Serialize;
use std::path::Path;

/// Approximate bytes of a run in the store without its samples; measured.
pub(crate) const CASE_BYTES: u32 = 1200;
/// Approximate bytes of a sample, index included; measured.
pub(crate) const SAMPLE_BYTES: u32 = 145;

/// Runs of a campaign file in its store.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Inventory {
    /// Runs that the file requests.
    pub runs: u64,
    /// Of these, runs that have ended: done, jammed or failed.
    pub ended: u64,
    /// Runs to be continued: started ones, or ones finished at a shorter strain.
    pub begun: u64,
    /// Runs without any stored data.
    pub new: u64,
    /// Runs in the store that the file does not request.
    pub orphans: u64,
    /// Their approximate size in bytes.
    pub orphan_bytes: f64,
}

impl Inventory {
    /// Summary of the runs of the file.
    pub fn words(&self) -> String {
        format!(
            "{} new runs, {} reused, {} extended",
            self.new, self.ended, self.begun
        )
    }
}

/// Effect of entering a campaign file into a store.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adoption {
    /// Whether the store held another version of the campaign before.
    pub changed: bool,
    /// The present contents.
    pub inventory: Inventory,
}

impl Store {
    /// Counts the runs in the store that the campaign requests, and the others.
    pub(crate) fn inventory(&self) -> Result<Inventory, StoreError> {
        let inventory = || {
            let number = |which: &str| format!("count(*) FILTER (WHERE {which})");
            let ended = number("counts AND state IN ('done', 'jammed', 'failed')");
            let begun = number("counts AND state IN ('pending', 'running') AND steps_done > 0");
            let (runs, orphans) = (number("counts"), number(ORPHANED));
            let query = format!("SELECT {runs}, {ended}, {begun}, {orphans} FROM cases c");
            let mut inventory = self.connection.one(&query, [], |row| {
                Ok(Inventory {
                    runs: row.get(0)?,
                    ended: row.get(1)?,
                    begun: row.get(2)?,
                    orphans: row.get(3)?,
                    ..Inventory::default()
                })
            })?;
            inventory.new = inventory.runs - inventory.ended - inventory.begun;
            if inventory.orphans > 0 {
                let bytes = format!(
                    "SELECT total({CASE_BYTES} + {SAMPLE_BYTES} * (SELECT count(*)
                         FROM samples WHERE case_id = c.id)
                         + coalesce((SELECT sum(length(data)) FROM frames WHERE case_id = c.id), 0)
                         + coalesce((SELECT sum(length(data)) FROM checkpoints
                         WHERE case_id = c.id), 0))
                     FROM cases c WHERE {ORPHANED}"
                );
                inventory.orphan_bytes = self.connection.one(&bytes, [], |row| row.get(0))?;
            }
            Ok(inventory)
        };
        self.read(inventory())
    }

    /// Number of runs in the store that are not requested.
    pub(crate) fn orphans(&self) -> Result<u64, StoreError> {
        let query = format!("SELECT count(*) FROM cases c WHERE {ORPHANED}");
        self.number(&query, [])
    }

    /// The file last run on this store, if it was another version than the one shown.
    pub fn last_run_with(&self) -> Option<&Path> {
        self.last_run_with.as_deref()
    }
}

/// Condition on a case with data that is not in the campaign.
pub(super) const ORPHANED: &str = "(NOT c.counts AND (c.state != 'pending' OR c.steps_done > 0
     OR EXISTS (SELECT 1 FROM results WHERE case_id = c.id)))";

impl Store {
    /// Removes all runs that are not in the grid, with their data, and frees their disk space.
    /// Returns the number of those with data.
    pub(crate) fn prune(&mut self) -> Result<u64, StoreError> {
        let removed = self.write(|connection| {
            let removed = format!("SELECT count(*) FROM cases c WHERE {ORPHANED}");
            let removed = connection.one(&removed, [], |row| row.get(0))?;
            let orphans = "SELECT id FROM cases WHERE NOT counts AND state != 'running'";
            for table in OF_CASES.iter().chain(&["slices", "disagreements"]) {
                connection.execute(
                    &format!("DELETE FROM {table} WHERE case_id IN ({orphans})"),
                    [],
                )?;
            }
            // Seeds that a precision may still need stay.
            connection.execute(
                "UPDATE cases SET state = 'pending', steps_done = 0, attempts = 0, deaths = 0,
                     samples_digest = NULL, frames_from = NULL, frames_until = NULL,
                     digest = NULL
                 WHERE NOT counts AND state != 'running'",
                [],
            )?;
            connection.execute(
                "DELETE FROM cases WHERE position IS NULL AND state != 'running'",
                [],
            )?;
            connection.execute(
                "DELETE FROM points WHERE id NOT IN (SELECT point FROM cases)",
                [],
            )?;
            Ok(removed)
        })?;
        self.read(
            self.connection
                .execute_batch("VACUUM; PRAGMA wal_checkpoint(RESTART)"),
        )?;
        Ok(removed)
    }
}
