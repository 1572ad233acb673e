//! What a campaign file finds in its store, and taking out of it what the file does not ask for.

use super::check::OF_CASES;
use super::processes::ActiveProcess;
use super::request::Request;
use super::statements::Statements;
use super::{Store, StoreError};
use serde::Serialize;
use std::path::Path;

/// About what a run takes in the store without its samples, in bytes; measured.
pub(crate) const CASE_BYTES: u32 = 1200;
/// About what a sample takes, index included, in bytes; measured.
pub(crate) const SAMPLE_BYTES: u32 = 145;

/// What a campaign file finds in its store.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Inventory {
    /// Runs that the file requests.
    pub runs: u64,
    /// Of these, runs that have ended: done, jammed or failed.
    pub ended: u64,
    /// Runs that go on from where they are: begun, or finished when less strain was requested.
    pub begun: u64,
    /// Runs of which there is nothing yet.
    pub new: u64,
    /// Runs in the store that the file does not request.
    pub orphans: u64,
    /// What these take there, in bytes, about.
    pub orphan_bytes: f64,
}

impl Inventory {
    /// What becomes of the runs that the file requests, in a few words.
    pub fn words(&self) -> String {
        format!(
            "{} new runs, {} reused, {} extended",
            self.new, self.ended, self.begun
        )
    }
}

/// What it means to take a campaign file into a store.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adoption {
    /// Whether the store held another version of the campaign before.
    pub changed: bool,
    /// What there is now.
    pub inventory: Inventory,
}

impl Store {
    /// The error about a process that computes another version of the campaign.
    pub(super) fn at_work(&self, request: &Request, other: ActiveProcess) -> StoreError {
        StoreError::ActiveProcess {
            path: self.path.clone(),
            ours: request.file.clone(),
            theirs: other.file.unwrap_or_default().into(),
            pid: other.identity.pid,
            host: other.identity.host,
        }
    }

    /// Makes sure that the store still holds the version of the campaign that was taken into it here. It does for as long as this
    /// process counts as alive.
    ///
    /// # Errors
    /// [`StoreError::Displaced`] if another version was taken into it since, and trouble with the file.
    pub fn check_campaign(&self) -> Result<(), StoreError> {
        let Some(request) = &self.request else {
            return Ok(());
        };
        match self.read(request.displaced_by(&self.connection))? {
            None => Ok(()),
            Some(theirs) => Err(StoreError::Displaced {
                path: self.path.clone(),
                ours: request.file.clone(),
                theirs,
            }),
        }
    }

    /// What there is in the store of what the campaign requests, and besides.
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
                         WHERE case_id = c.id), 0)
                         + coalesce((SELECT length(state) FROM ends WHERE case_id = c.id), 0))
                     FROM cases c WHERE {ORPHANED}"
                );
                inventory.orphan_bytes = self.connection.one(&bytes, [], |row| row.get(0))?;
            }
            Ok(inventory)
        };
        self.read(inventory())
    }

    /// How many runs in the store are not requested.
    pub(crate) fn orphans(&self) -> Result<u64, StoreError> {
        let query = format!("SELECT count(*) FROM cases c WHERE {ORPHANED}");
        self.number(&query, [])
    }

    /// The file last run on this store, if what is read is not what that file requested: another version of it.
    pub fn last_run_with(&self) -> Option<&Path> {
        self.last_run_with.as_deref()
    }
}

/// What is true of a case that does not count of which something was computed.
pub(super) const ORPHANED: &str = "(NOT c.counts AND (c.state != 'pending' OR c.steps_done > 0
     OR EXISTS (SELECT 1 FROM ends WHERE case_id = c.id)))";

impl Store {
    /// Removes all runs that are not in the grid, with all they have, and gives the disk back what they took. Says how many of
    /// them something had been computed of.
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
            // Seeds that a precision may still take keep their place.
            connection.execute(
                "UPDATE cases SET state = 'pending', steps_done = 0, attempts = 0, deaths = 0,
                     samples_digest = NULL
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
