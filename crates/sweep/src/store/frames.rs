//! Frames of runs.

use super::claims::Claim;
use super::digest::{Sealed, whole};
use super::statements::Statements;
use super::{Store, StoreError};
use crate::model::spaces::AnyFrame;
use crate::trajectory;
use rusqlite::{Connection, Row};

/// A kept frame.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredFrame {
    /// Its step.
    pub step: u64,
    /// The layer or suspension.
    pub frame: AnyFrame,
}

/// The frames.
pub(super) const SEALED: Sealed = Sealed {
    table: "frames",
    columns: "step, strain, data",
    with_key: true,
    words: "a frame of a run",
};

/// Stores a frame of a case, by its number and its key, replacing any other of its step.
pub(super) fn put(
    connection: &Connection,
    (case, key): (i64, &str),
    step: u64,
    strain: f64,
    data: Vec<u8>,
) -> rusqlite::Result<()> {
    SEALED.put(
        connection,
        Some(key),
        &[whole(step), strain.into(), data.into()],
        &[("case_id", case.into())],
    )
}

/// The frames of a case: step, strain and data.
pub(super) fn of(connection: &Connection, case: i64) -> rusqlite::Result<Vec<(u64, f64, Vec<u8>)>> {
    SEALED.all(connection, "t.case_id = ?1", [case], |row| row.try_into())
}

impl Store {
    /// Stores frames of a case. Frames of the same steps are identical in all processes, so the
    /// case need not be owned.
    pub(crate) fn keep_frames(
        &mut self,
        claim: &Claim,
        frames: &[(u64, AnyFrame)],
    ) -> Result<(), StoreError> {
        if frames.is_empty() {
            return Ok(());
        }
        self.write(|connection| {
            for (step, frame) in frames {
                let data = trajectory::encode(frame)
                    .map_err(|error| rusqlite::Error::ToSqlConversionFailure(Box::new(error)))?;
                put(
                    connection,
                    (claim.id, &claim.key),
                    *step,
                    frame.strain(),
                    data,
                )?;
            }
            Ok(())
        })
    }

    /// Every `stride`-th frame of a case, in the order of steps; at least one.
    ///
    /// # Errors
    /// [`StoreError::NoFrames`] without frames, an I/O or SQLite error, or an unreadable entry.
    pub fn frames(&self, key: &str, stride: usize) -> Result<Vec<StoredFrame>, StoreError> {
        let steps: Option<u64> = self.read(
            self.connection
                .value("SELECT steps FROM cases WHERE key = ?1", [key]),
        )?;
        let row = |row: &Row<'_>| Ok((row.get(0)?, row.get(2)?));
        let rows = SEALED.all(&self.connection, "c.key = ?1 ORDER BY t.step", [key], row);
        let mut rows: Vec<(u64, Vec<u8>)> = self.read(rows)?;
        rows.retain(|(step, _)| steps.is_some_and(|steps| *step < steps));
        if rows.is_empty() {
            return Err(StoreError::NoFrames { key: key.into() });
        }
        rows.into_iter()
            .step_by(stride.max(1))
            .map(|(step, data)| {
                let why = format!("the frame of step {step} of case {key}");
                let frame = trajectory::decode(&data)
                    .ok_or_else(|| StoreError::unreadable(&self.path, &why))?;
                Ok(StoredFrame { step, frame })
            })
            .collect()
    }

    /// Number of finished runs of the campaign without frames.
    pub(crate) fn done_without_frames(&self) -> Result<u64, StoreError> {
        self.number(
            "SELECT count(*) FROM cases c WHERE c.state = 'done' AND c.counts
                 AND NOT EXISTS (SELECT 1 FROM frames f WHERE f.case_id = c.id)",
            [],
        )
    }

    /// Number of frames of a case.
    pub(crate) fn frame_count(&self, key: &str) -> Result<u64, StoreError> {
        self.number(
            "SELECT count(*) FROM cases c JOIN frames f ON f.case_id = c.id
                 AND f.step < c.steps WHERE c.key = ?1",
            [key],
        )
    }
}
