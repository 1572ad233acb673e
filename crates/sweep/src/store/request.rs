//! What a version of a campaign file requests of its store, and what it finds there.

use super::registry::AtWork;
use super::statements::Statements;
use super::{Store, StoreError, count};
use crate::model::campaign::Campaign;
use crate::protocol::Discard;
use crate::statistics::Precision;
use rusqlite::Connection;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// About what a run takes in the store without its samples, in bytes; measured.
const CASE_BYTES: u32 = 1200;
/// About what a sample takes, index included, in bytes; measured.
const SAMPLE_BYTES: u32 = 145;

/// What one version of a campaign file requests: which runs, how long, and what of them is averaged.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Request {
    /// Equal exactly for versions that request the same, in whatever order and words.
    pub(super) hash: String,
    /// Number and sum of the keys of the runs.
    pub(super) grid: String,
    pub(super) file: PathBuf,
}

impl Request {
    pub(super) fn of(campaign: &Campaign) -> Self {
        let grid = grid(campaign.cases.iter().map(|(key, _)| key.number()));
        let mut hasher = blake3::Hasher::new();
        hasher.update(&campaign.protocol.strain.to_bits().to_le_bytes());
        match campaign.protocol.discard {
            Discard::Strain(strain) => hasher.update(&strain.to_bits().to_le_bytes()),
            Discard::Auto => hasher.update(b"auto"),
        };
        hasher.update(grid.as_bytes());
        for rule in &campaign.rules {
            let first = campaign.cases[rule.cases.start].0;
            let Precision {
                precision,
                quantity,
                at_least,
                at_most,
            } = rule.precision;
            let words = format!(
                "{first} {precision:?} {} {at_least} {at_most}",
                quantity.name()
            );
            hasher.update(words.as_bytes());
        }
        Self {
            hash: hasher.finalize().to_hex()[..32].to_owned(),
            grid,
            file: campaign.file.clone(),
        }
    }

    /// The file whose version of the campaign a store now holds, if that requests something else.
    fn displaced_by(&self, connection: &Connection) -> rusqlite::Result<Option<PathBuf>> {
        connection
            .find(
                "SELECT file FROM campaign WHERE request != ?1",
                [&self.hash],
                |row| row.get::<_, String>(0),
            )
            .map(|file| file.map(PathBuf::from))
    }
}

/// Number and sum of some keys, whatever their order.
pub(super) fn grid(keys: impl Iterator<Item = u128>) -> String {
    let (number, sum) = keys.fold((0_u64, 0_u128), |(number, sum), key| {
        (number + 1, sum.wrapping_add(key))
    });
    format!("{number} {sum:032x}")
}

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
    pub(super) fn at_work(&self, request: &Request, other: AtWork) -> StoreError {
        StoreError::AtWork {
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
            let mut inventory = self.connection.query_row(
                &format!(
                    "SELECT total(counts), total(counts AND state IN ('done', 'jammed', 'failed')),
                         total(counts AND state IN ('pending', 'running')
                         AND steps_done > 0), total({ORPHANED}) FROM cases c"
                ),
                [],
                |row| {
                    let number = |column| row.get::<_, f64>(column).map(number);
                    Ok(Inventory {
                        runs: number(0)?,
                        ended: number(1)?,
                        begun: number(2)?,
                        orphans: number(3)?,
                        ..Inventory::default()
                    })
                },
            )?;
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
                inventory.orphan_bytes = self.connection.query_row(&bytes, [], |row| row.get(0))?;
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

/// A whole number that `SQLite` summed up as a float.
pub(super) fn number(sum: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, reason = "a count")]
    count(sum as i64)
}

/// What is true of a case that does not count of which something was computed.
pub(super) const ORPHANED: &str = "(NOT c.counts AND (c.state != 'pending' OR c.steps_done > 0
     OR EXISTS (SELECT 1 FROM ends WHERE case_id = c.id)))";
