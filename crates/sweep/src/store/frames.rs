//! Frames of runs.

use super::claims::Claim;
use super::digest::{self, number, whole};
use super::{Store, StoreError, count, integer};
use crate::trajectory;
use rusqlite::types::Value;
use rusqlite::{Connection, params};
use sd_core::simulation::Frame;

/// A kept frame.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredFrame {
    /// Its step.
    pub step: u64,
    /// The layer.
    pub frame: Frame,
}

/// Columns of a frame that its digest covers.
pub(super) const COLUMNS: &str = "f.step, f.strain, f.data";

/// Writes a frame in place of any other of its step.
pub(super) fn put(
    connection: &Connection,
    case: i64,
    step: u64,
    strain: f64,
    data: Vec<u8>,
) -> Result<(), rusqlite::Error> {
    let row = [whole(step), number(strain), Value::Blob(data)];
    let digest = digest::of(&row);
    let [step, strain, data] = row;
    connection
        .prepare_cached(
            "INSERT OR REPLACE INTO frames (case_id, step, strain, data, digest) VALUES (?1, ?2, ?3, ?4, ?5)",
        )?
        .execute(params![case, step, strain, data, digest])
        .map(|_| ())
}

/// Makes sure that the frames of a case are what was written.
fn check(connection: &Connection, case: i64) -> Result<(), rusqlite::Error> {
    digest::check(
        connection,
        &format!("SELECT {COLUMNS}, f.digest FROM frames f WHERE f.case_id = ?1"),
        [case],
        "a frame of a run",
    )
}

/// The frames of a case: step, strain and data.
pub(super) fn of(
    connection: &Connection,
    case: i64,
) -> Result<Vec<(u64, f64, Vec<u8>)>, rusqlite::Error> {
    check(connection, case)?;
    connection
        .prepare_cached("SELECT step, strain, data FROM frames WHERE case_id = ?1")?
        .query_map([case], |row| {
            Ok((count(row.get(0)?), row.get(1)?, row.get(2)?))
        })?
        .collect()
}

impl Store {
    /// Keeps frames of a case. Frames of the same steps are the same, whoever computed them, so nobody need own the case.
    pub(crate) fn keep_frames(
        &mut self,
        claim: &Claim,
        frames: &[(u64, Frame)],
    ) -> Result<(), StoreError> {
        if frames.is_empty() {
            return Ok(());
        }
        self.write(|connection| {
            for (step, frame) in frames {
                let data = trajectory::encode(frame)
                    .map_err(|error| rusqlite::Error::ToSqlConversionFailure(Box::new(error)))?;
                put(connection, claim.id, *step, frame.strain, data)?;
            }
            Ok(())
        })
    }

    /// The frames of a case, every `stride`-th of them, in the order of their steps; there is at least one.
    ///
    /// # Errors
    /// [`StoreError::NoFrames`] if none are kept, trouble with the file, or an entry that cannot be read.
    pub fn frames(&self, key: &str, stride: usize) -> Result<Vec<StoredFrame>, StoreError> {
        let rows = || -> Result<Vec<(i64, Vec<u8>)>, rusqlite::Error> {
            digest::check(
                &self.connection,
                &format!(
                    "SELECT {COLUMNS}, f.digest FROM frames f WHERE f.case_id = (SELECT id FROM cases WHERE key = ?1)"
                ),
                [key],
                "a frame of a run",
            )?;
            self.connection
                .prepare(
                    "SELECT step, data FROM
                         (SELECT f.step, f.data, row_number() OVER (ORDER BY f.step) - 1 AS number
                          FROM cases c JOIN frames f ON f.case_id = c.id AND f.step < c.steps WHERE c.key = ?1)
                     WHERE number % ?2 = 0 ORDER BY step",
                )?
                .query_map(params![key, integer(stride.max(1) as u64)], |row| {
                    Ok((row.get(0)?, row.get(1)?))
                })?
                .collect()
        };
        let rows = self.read(rows())?;
        if rows.is_empty() {
            return Err(StoreError::NoFrames { key: key.into() });
        }
        rows.into_iter()
            .map(|(step, data)| {
                let frame = trajectory::decode(&data).ok_or_else(|| StoreError::Entry {
                    path: self.path.clone(),
                    table: "frames",
                    reason: format!("step {step} of case {key}: damaged, or of a newer version"),
                })?;
                Ok(StoredFrame {
                    step: count(step),
                    frame,
                })
            })
            .collect()
    }

    /// How many frames a case has.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn frame_count(&self, key: &str) -> Result<u64, StoreError> {
        self.read(self.connection.query_row(
            "SELECT count(*) FROM cases c JOIN frames f ON f.case_id = c.id AND f.step < c.steps WHERE c.key = ?1",
            [key],
            |row| row.get(0),
        ))
        .map(count)
    }
}
