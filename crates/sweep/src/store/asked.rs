//! What a version of a campaign file asks of its store, what that changes there, and who asks for something else meanwhile.

use super::process::{self, Identity, Life};
use super::{Store, StoreError, count};
use crate::campaign::{Campaign, Discard};
use crate::statistics::Precision;
use rusqlite::{Connection, OptionalExtension, Row, params};
use serde::Serialize;
use std::path::PathBuf;

/// About what a run takes in the store without its samples, in bytes; measured.
const CASE_BYTES: u32 = 1200;
/// About what a sample takes, index included, in bytes; measured.
const SAMPLE_BYTES: u32 = 145;

/// What one version of a campaign file asks for: which runs, how long, and what of them is averaged.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Asks {
    /// Equal exactly for versions that ask for the same, in whatever order and words.
    pub(super) hash: String,
    pub(super) file: PathBuf,
}

impl Asks {
    pub(super) fn of(campaign: &Campaign) -> Self {
        let mut keys: Vec<_> = campaign.cases.iter().map(|(key, _)| *key).collect();
        keys.sort_unstable();
        let mut hasher = blake3::Hasher::new();
        hasher.update(&campaign.protocol.strain.to_bits().to_le_bytes());
        match campaign.protocol.discard {
            Discard::Strain(strain) => hasher.update(&strain.to_bits().to_le_bytes()),
            Discard::Auto => hasher.update(b"auto"),
        };
        for key in keys {
            hasher.update(key.to_string().as_bytes());
        }
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
            file: campaign.file.clone(),
        }
    }

    /// Who computes on a store what another version of the campaign asks for, other than the process `me`.
    pub(super) fn opponent(
        &self,
        connection: &Connection,
        me: i64,
    ) -> Result<Option<Opponent>, rusqlite::Error> {
        let here = Identity::of_this_process();
        let others: Vec<(Identity, i64, String)> = connection
            .prepare_cached(
                "SELECT host, boot, namespace, pid, start, heartbeat, file FROM processes
                 WHERE ended_at IS NULL AND asks IS NOT NULL AND asks != ?1 AND id != ?2",
            )?
            .query_map(params![self.hash, me], |row| {
                let identity = Identity {
                    host: row.get(0)?,
                    boot: row.get(1)?,
                    namespace: row.get(2)?,
                    pid: row.get(3)?,
                    start: row.get(4)?,
                };
                Ok((identity, row.get(5)?, row.get(6)?))
            })?
            .collect::<Result<_, _>>()?;
        let alive = |(identity, heartbeat, _): &(Identity, i64, String)| {
            here.judge(identity, process::silence(*heartbeat)) == Life::Alive
        };
        Ok(others
            .into_iter()
            .find(alive)
            .map(|(identity, _, file)| Opponent {
                host: identity.host,
                pid: identity.pid,
                file: file.into(),
            }))
    }

    /// The file whose version of the campaign a store now holds, if that asks for something else.
    pub(super) fn displaced_by(
        &self,
        connection: &Connection,
    ) -> Result<Option<PathBuf>, rusqlite::Error> {
        connection
            .query_row(
                "SELECT file FROM campaign WHERE asks != ?1",
                [&self.hash],
                |row| row.get::<_, String>(0),
            )
            .optional()
            .map(|file| file.map(PathBuf::from))
    }
}

/// A process that computes another version of the campaign.
pub(super) struct Opponent {
    host: String,
    /// Its number there.
    pid: u32,
    file: PathBuf,
}

/// What a campaign file finds in its store.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Inventory {
    /// Runs the file asks for.
    pub runs: u64,
    /// Of these, runs that have ended: done, jammed or failed.
    pub ended: u64,
    /// Runs that go on from where they are: begun, or finished when less strain was asked for.
    pub begun: u64,
    /// Runs of which there is nothing yet.
    pub new: u64,
    /// Runs in the store that the file does not ask for.
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
    pub(super) fn at_work(&self, asks: &Asks, opponent: Opponent) -> StoreError {
        StoreError::AtWork {
            path: self.path.clone(),
            ours: asks.file.clone(),
            theirs: opponent.file,
            pid: opponent.pid,
            host: opponent.host,
        }
    }

    /// Makes sure that the store still holds the version of the campaign that was taken into it here.
    ///
    /// # Errors
    /// [`StoreError::Displaced`] if another version was taken into it since, and trouble with the file.
    pub fn check_campaign(&self) -> Result<(), StoreError> {
        let Some(asks) = &self.asks else {
            return Ok(());
        };
        match self.read(asks.displaced_by(&self.connection))? {
            None => Ok(()),
            Some(theirs) => Err(StoreError::Displaced {
                path: self.path.clone(),
                ours: asks.file.clone(),
                theirs,
            }),
        }
    }

    /// What there is in the store of what the campaign asks for, and besides.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn inventory(&self) -> Result<Inventory, StoreError> {
        self.read(inventory(&self.connection))
    }

    /// The file last run on this store, if what is read is not what that file asked for: another version of it.
    pub fn last_run_with(&self) -> Option<&std::path::Path> {
        self.last_run_with.as_deref()
    }
}

/// See [`Store::inventory`].
pub(super) fn inventory(connection: &Connection) -> Result<Inventory, rusqlite::Error> {
    let number = |row: &Row<'_>, column: usize| row.get(column).map(count);
    let mut inventory = connection.query_row(
        "SELECT count(*), count(*) FILTER (WHERE state IN ('done', 'jammed', 'failed')),
             count(*) FILTER (WHERE state IN ('pending', 'running') AND steps_done > 0) FROM cases WHERE position IS NOT NULL",
        [],
        |row| {
            Ok(Inventory {
                runs: number(row, 0)?,
                ended: number(row, 1)?,
                begun: number(row, 2)?,
                ..Inventory::default()
            })
        },
    )?;
    inventory.new = inventory.runs - inventory.ended - inventory.begun;
    (inventory.orphans, inventory.orphan_bytes) = connection.query_row(
        &format!(
            "SELECT count(*), total({CASE_BYTES} + {SAMPLE_BYTES} * (SELECT count(*) FROM samples WHERE case_id = c.id)
                 + coalesce((SELECT sum(length(data)) FROM frames WHERE case_id = c.id), 0)
                 + coalesce((SELECT sum(length(data)) FROM checkpoints WHERE case_id = c.id), 0)
                 + coalesce((SELECT length(state) FROM ends WHERE case_id = c.id), 0))
             FROM cases c WHERE {ORPHANED}"
        ),
        [],
        |row| Ok((number(row, 0)?, row.get(1)?)),
    )?;
    Ok(inventory)
}

/// What is true of a case in no grid of which something was computed.
pub(super) const ORPHANED: &str = "position IS NULL AND (state != 'pending' OR steps_done > 0 OR id IN (SELECT case_id FROM ends))";
