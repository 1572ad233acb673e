//! Frames of runs.

use super::claims::Claim;
use super::{Store, StoreError, count, integer};
use crate::trajectory;
use rusqlite::params;
use sd_core::simulation::Frame;

/// A kept frame.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredFrame {
    /// Its step.
    pub step: u64,
    /// The layer.
    pub frame: Frame,
}

impl Store {
    /// Keeps frames of a case. Frames of the same steps are the same, whoever computed them, so nobody need own the case.
    ///
    /// # Errors
    /// Trouble with the file.
    pub fn keep_frames(
        &mut self,
        claim: &Claim,
        frames: &[(u64, Frame)],
    ) -> Result<(), StoreError> {
        if frames.is_empty() {
            return Ok(());
        }
        self.write(|transaction| {
            let mut insert = transaction
                .prepare_cached("INSERT OR REPLACE INTO frames (case_id, step, strain, data) VALUES (?1, ?2, ?3, ?4)")?;
            for (step, frame) in frames {
                let data = trajectory::encode(frame)
                    .map_err(|error| rusqlite::Error::ToSqlConversionFailure(Box::new(error)))?;
                insert.execute(params![claim.id, integer(*step), frame.strain, data])?;
            }
            Ok(())
        })
    }

    /// The frames of a case, every `stride`-th of them, in the order of their steps; there is at least one.
    ///
    /// # Errors
    /// [`StoreError::NoFrames`] if none are kept, trouble with the file, or an entry that cannot be read.
    pub fn frames(&self, key: &str, stride: usize) -> Result<Vec<StoredFrame>, StoreError> {
        let rows: Result<Vec<(i64, Vec<u8>)>, _> = self
            .connection
            .prepare(
                "SELECT step, data FROM
                     (SELECT f.step, f.data, row_number() OVER (ORDER BY f.step) - 1 AS number
                      FROM cases c JOIN frames f ON f.case_id = c.id AND f.step < c.steps WHERE c.key = ?1)
                 WHERE number % ?2 = 0 ORDER BY step",
            )
            .and_then(|mut query| {
                query
                    .query_map(params![key, integer(stride.max(1) as u64)], |row| {
                        Ok((row.get(0)?, row.get(1)?))
                    })?
                    .collect()
            });
        let rows = self.read(rows)?;
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
