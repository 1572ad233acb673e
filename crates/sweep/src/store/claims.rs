//! Claims and checkpoints: the life of a running case.

use super::points::CaseRow;
use super::runs::{LAST, StoredCheckpoint};
use super::statements::Statements;
use super::{BadCheckpoint, Checkpoint, Store, StoreError, frames, runs, samples};
use crate::model::case::Case;
use crate::model::spaces::AnyFrame;
use crate::system::process::now;
use rusqlite::{Connection, params};
use sd_core::Sample;
use serde::Deserialize;
use std::time::Duration;

/// Maximum number of short cases that are claimed together.
const BATCH_CASES: usize = 1024;

/// A case this process owns.
#[derive(Debug)]
pub struct Claim {
    pub(crate) id: i64,
    /// Its key.
    pub key: String,
    /// The case.
    pub case: Case,
    /// Its checkpoints, the newest first, and its last state, if it was finished at a shorter
    /// requested length.
    pub checkpoints: Vec<Result<Checkpoint, BadCheckpoint>>,
    /// Whether there is anything of it in the store.
    has_data: bool,
    /// Whether it keeps a frame with each sample.
    keeps_frames: bool,
}

/// The row of a case that was claimed.
#[derive(Deserialize)]
struct Claimed {
    key: String,
    #[serde(flatten)]
    case: CaseRow,
    steps_done: u64,
    has_samples: bool,
    keeps_frames: bool,
}

/// What a run measured since it was last stored.
#[derive(Debug, Default)]
pub struct NewRows {
    /// Samples, with their steps.
    pub samples: Vec<(u64, Sample)>,
    /// Digest of all samples of the run so far.
    pub samples_digest: Option<i64>,
    /// Frames, with their steps.
    pub frames: Vec<(u64, AnyFrame)>,
    /// First step whose frame is kept; `None` if none are.
    pub frames_from: Option<u64>,
}

impl NewRows {
    /// Adds a sample.
    pub fn add(&mut self, step: u64, sample: Sample) {
        self.samples_digest = Some(samples::extended(self.samples_digest, step, &sample));
        self.samples.push((step, sample));
    }

    /// Appends them to the rows of a case.
    pub(super) fn append(
        &self,
        connection: &Connection,
        claim: &Claim,
        steps: u64,
    ) -> rusqlite::Result<()> {
        samples::append(connection, claim.id, &self.samples, self.samples_digest)?;
        match self.frames_from {
            Some(from) => {
                let case = (claim.id, claim.key.as_str());
                frames::append(connection, case, &self.frames, from..steps)
            }
            None => Ok(()),
        }
    }
}

impl Store {
    /// Claims the next cases: started ones first, then in the order of work. Short cases are
    /// claimed together, up to an estimated time of `batch`; started and longer cases are claimed
    /// alone.
    ///
    /// # Errors
    /// An I/O or SQLite error, or an unreadable case.
    pub fn claim(&mut self, workers: usize, batch: Duration) -> Result<Vec<Claim>, StoreError> {
        let me = self.me();
        self.write(|connection| {
            let ids = next(connection, workers, batch.as_secs_f64())?;
            let own = "UPDATE cases SET state = 'running', owner = ?2, attempts = attempts + 1,
                     changed_at = ?3
                 WHERE id = ?1 RETURNING key, seed, steps, sample_stride, steps_done,
                     (SELECT params FROM points WHERE id = point) AS params,
                     samples_digest IS NOT NULL AS has_samples,
                     frames_from IS NOT NULL AS keeps_frames";
            let mut claims = Vec::with_capacity(ids.len());
            for id in ids {
                let claimed: Option<Claimed> = connection.first(own, params![id, me, now()])?;
                let claimed = claimed.ok_or(rusqlite::Error::QueryReturnedNoRows)?;
                let checkpoints = if claimed.steps_done > 0 {
                    runs::checkpoints(connection, id)?
                } else {
                    Vec::new()
                };
                claims.push(Claim {
                    id,
                    key: claimed.key,
                    case: claimed.case.into_case(),
                    has_data: claimed.has_samples || !checkpoints.is_empty(),
                    keeps_frames: claimed.keeps_frames,
                    checkpoints,
                });
            }
            Ok(claims)
        })
    }

    /// Prepares the rows of a case to continue from one of its checkpoints: later ones are deleted.
    /// `None` if the samples before it are not those that it was written with.
    ///
    /// # Errors
    /// [`StoreError::ClaimLost`], and I/O or SQLite errors.
    pub(crate) fn resume(
        &mut self,
        claim: &Claim,
        from: &Checkpoint,
    ) -> Result<Option<NewRows>, StoreError> {
        let steps = from.snapshot.steps();
        let digest = self.read(samples::digest_until(&self.connection, claim.id, steps))?;
        if digest != from.samples_digest {
            return Ok(None);
        }
        self.write_own(claim, |connection| {
            samples::cut(connection, claim.id, steps, digest)?;
            let later = "DELETE FROM checkpoints WHERE case_id = ?1 AND steps > ?2";
            connection.run(later, params![claim.id, steps])?;
            Ok(Some(NewRows {
                samples_digest: digest,
                frames_from: frames::resume(connection, claim.id, steps)?,
                ..NewRows::default()
            }))
        })
    }

    /// Deletes all of a case that is computed from its start.
    ///
    /// # Errors
    /// As [`Store::resume`].
    pub(crate) fn restart(&mut self, claim: &Claim) -> Result<NewRows, StoreError> {
        let new = || NewRows {
            frames_from: claim.keeps_frames.then_some(0),
            ..NewRows::default()
        };
        if !claim.has_data {
            return Ok(new());
        }
        self.write_own(claim, |connection| {
            runs::delete_data(connection, claim.id)?;
            Ok(new())
        })
    }

    /// Stores a checkpoint of a running case in place of the older of its two, with what the run
    /// measured before it.
    ///
    /// Not synced immediately: a killed process loses none, a power cut the last few.
    ///
    /// # Errors
    /// [`StoreError::ClaimLost`], and I/O or SQLite errors.
    pub fn keep(
        &mut self,
        claim: &Claim,
        steps: u64,
        data: &[u8],
        rows: &NewRows,
    ) -> Result<(), StoreError> {
        let me = self.me();
        let owned = self.write_relaxed(|connection| {
            let changed = connection.change(
                "UPDATE cases SET steps_done = ?3, deaths = 0
                 WHERE id = ?1 AND owner = ?2 AND state = 'running'",
                params![claim.id, me, steps],
            )?;
            if changed == 0 {
                return Ok(false);
            }
            rows.append(connection, claim, steps)?;
            let newest: Option<i64> = connection.value(
                "SELECT generation FROM checkpoints WHERE case_id = ?1 AND generation != ?2
                 ORDER BY steps DESC, written_at DESC LIMIT 1",
                [claim.id, LAST],
            )?;
            let generation = i64::from(newest == Some(0));
            let checkpoint = StoredCheckpoint {
                generation,
                steps,
                process: me,
                data: data.to_vec(),
            };
            checkpoint.put(connection, claim.id)?;
            Ok(true)
        })?;
        owned.then_some(()).ok_or_else(|| claim.lost())
    }

    /// Changes the rows of a running case.
    fn write_own<T>(
        &mut self,
        claim: &Claim,
        work: impl FnOnce(&Connection) -> rusqlite::Result<T>,
    ) -> Result<T, StoreError> {
        let me = self.me();
        let written = self.write(|connection| {
            let is_own = owns(connection, claim, me)?;
            is_own.then(|| work(connection)).transpose()
        })?;
        written.ok_or_else(|| claim.lost())
    }

    /// Whether cases are pending or running, also in other processes, whose cases return here if
    /// they die.
    pub(crate) fn has_open_cases(&self) -> Result<bool, StoreError> {
        self.read(self.connection.has(
            "SELECT 1 WHERE EXISTS (SELECT 1 FROM cases WHERE state = 'pending' AND counts)
                 OR EXISTS (SELECT 1 FROM cases WHERE state = 'running' AND counts)",
            [],
        ))
    }

    /// Releases cases: they become pending, to continue from their last checkpoints.
    pub(crate) fn release<'c>(
        &mut self,
        claims: impl IntoIterator<Item = &'c Claim>,
    ) -> Result<(), StoreError> {
        let me = self.me();
        self.write(|connection| {
            for claim in claims {
                runs::free_where(connection, "id = ?2 AND owner = ?3", &[claim.id, me])?;
            }
            Ok(())
        })
    }
}

impl Claim {
    /// The error that this process no longer owns the case.
    pub(crate) fn lost(&self) -> StoreError {
        StoreError::ClaimLost {
            key: self.key.clone(),
        }
    }
}

/// Whether this process still owns a case that it computes.
pub(super) fn owns(connection: &Connection, claim: &Claim, me: i64) -> rusqlite::Result<bool> {
    connection.has(
        "SELECT 1 FROM cases WHERE id = ?1 AND owner = ?2 AND state = 'running'",
        [claim.id, me],
    )
}

/// The next cases in the order of work: one, or a batch of short ones.
fn next(connection: &Connection, workers: usize, batch_s: f64) -> rusqlite::Result<Vec<i64>> {
    let mut query = connection.prepare_cached(
        "SELECT id, cost, steps_done > 0 OR deaths > 0 FROM cases WHERE state = 'pending' AND counts
         ORDER BY turn, gain DESC, position LIMIT ?1",
    )?;
    let mut rows = query.query([BATCH_CASES * workers.max(1)])?;
    let (mut batch, mut work, mut others) = (Vec::new(), 0.0, 0.0);
    while let Some(row) = rows.next()? {
        // A case that was started, or whose process died, is claimed alone, to identify a case that
        // kills processes.
        let (id, cost, is_alone): (i64, f64, bool) = (row.get(0)?, row.get(1)?, row.get(2)?);
        if batch.is_empty() {
            (work, batch) = (cost, vec![id]);
            if is_alone {
                break;
            }
        } else if others < work * (workers as f64 - 1.0) {
            // The other workers get equal shares.
            others += cost;
        } else if is_alone || work + cost > batch_s || batch.len() >= BATCH_CASES {
            break;
        } else {
            work += cost;
            batch.push(id);
        }
    }
    Ok(batch)
}
