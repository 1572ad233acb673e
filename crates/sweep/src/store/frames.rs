//! Frames of runs.
//!
//! A run that keeps frames has one of each sampled step in an interval of its steps, which is
//! stored with its case: so a missing one is noticed.

use super::digest::{DigestMismatch, Sealed, whole};
use super::statements::{Statements, json};
use super::{Store, StoreError, runs};
use crate::model::spaces::AnyFrame;
use crate::trajectory::{self, FrameError};
use rusqlite::{Connection, Row, params};
use sd_core::Params;
use serde::Deserialize;
use std::ops::Range;

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

/// Selects, from cases `c`, the number of frames that a run must have.
const EXPECTED: &str = "((c.frames_until + c.sample_stride - 1) / c.sample_stride
     - (c.frames_from + c.sample_stride - 1) / c.sample_stride)";

/// Stores a frame of a case, by its number and its key, replacing any other of its step.
pub(super) fn put(
    connection: &Connection,
    (case, key): (i64, &str),
    step: u64,
    strain: f64,
    data: Vec<u8>,
) -> rusqlite::Result<()> {
    let frame = [whole(step), strain.into(), data.into()];
    let put = SEALED.put(connection, Some(key), &frame, &[("case_id", case.into())]);
    put.map(drop)
}

/// Appends frames to those of a case, which then has all from a step until another.
pub(super) fn append(
    connection: &Connection,
    (case, key): (i64, &str),
    frames: &[(u64, AnyFrame)],
    kept: Range<u64>,
) -> rusqlite::Result<()> {
    for (step, frame) in frames {
        let data = trajectory::encode(frame)
            .map_err(|error| rusqlite::Error::ToSqlConversionFailure(Box::new(error)))?;
        put(connection, (case, key), *step, frame.strain(), data)?;
    }
    set_kept(connection, case, Some(kept))
}

/// The steps of whose samples a case has frames: empty where none are kept yet, but are to be.
pub(super) fn kept(connection: &Connection, case: i64) -> rusqlite::Result<Option<Range<u64>>> {
    let kept = "SELECT frames_from, frames_until FROM cases WHERE id = ?1";
    let kept: (Option<u64>, Option<u64>) = connection.one(kept, [case], |row| row.try_into())?;
    Ok(kept.0.zip(kept.1).map(|(from, until)| from..until))
}

/// Sets these steps.
fn set_kept(connection: &Connection, case: i64, kept: Option<Range<u64>>) -> rusqlite::Result<()> {
    let (from, until) = kept.map(|kept| (kept.start, kept.end)).unzip();
    let set = "UPDATE cases SET frames_from = ?2, frames_until = ?3 WHERE id = ?1";
    connection.run(set, params![case, from, until])
}

/// Prepares the frames of a case to continue from a step: deletes later ones. Returns the step from
/// which it has all of them; `None` if it keeps none.
pub(super) fn resume(
    connection: &Connection,
    case: i64,
    steps: u64,
) -> rusqlite::Result<Option<u64>> {
    let from = match kept(connection, case)? {
        None => return Ok(None),
        Some(kept) if kept.is_empty() => steps,
        Some(kept) if kept.end < steps => return Ok(None),
        Some(kept) => kept.start.min(steps),
    };
    let rest = "DELETE FROM frames WHERE case_id = ?1 AND step >= ?2";
    connection.run(rest, params![case, steps])?;
    set_kept(connection, case, Some(from..steps))?;
    Ok(Some(from))
}

/// Frames of a run in another store: their steps; step, strain and data of each.
pub(super) type KeptFrames = (Range<u64>, Vec<(u64, f64, Vec<u8>)>);

/// The frames of a case.
///
/// # Errors
/// Those of the queries, and [`DigestMismatch`] if frames were changed or are missing.
pub(super) fn of(connection: &Connection, case: i64) -> rusqlite::Result<Option<KeptFrames>> {
    let Some(kept) = kept(connection, case)?.filter(|kept| !kept.is_empty()) else {
        return Ok(None);
    };
    check(connection, "c.id = ?1", [case])?;
    let frames = SEALED.all(connection, "t.case_id = ?1", [case], |row| row.try_into())?;
    Ok(Some((kept, frames)))
}

/// Adds frames of the same run to a case, unless it has more that are not connected with these.
pub(super) fn take(
    connection: &Connection,
    (case, key): (i64, &str),
    (theirs, frames): KeptFrames,
) -> rusqlite::Result<()> {
    let ours = kept(connection, case)?.filter(|kept| !kept.is_empty());
    let both = match ours {
        Some(ours) if theirs.start <= ours.end && ours.start <= theirs.end => {
            ours.start.min(theirs.start)..ours.end.max(theirs.end)
        }
        Some(ours) if ours.end - ours.start >= theirs.end - theirs.start => return Ok(()),
        _ => {
            connection.run("DELETE FROM frames WHERE case_id = ?1", [case])?;
            theirs
        }
    };
    for (step, strain, data) in frames {
        put(connection, (case, key), step, strain, data)?;
    }
    set_kept(connection, case, Some(both))
}

/// Requests the frames of a case without any.
pub(super) fn request(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    match kept(connection, case)? {
        None => set_kept(connection, case, Some(0..0)),
        Some(_) => Ok(()),
    }
}

/// Numbers of cases that meet a condition on `c` and lack some of their frames.
pub(super) fn incomplete(
    connection: &Connection,
    condition: &str,
    parameters: impl rusqlite::Params,
) -> rusqlite::Result<Vec<i64>> {
    connection.values(
        &format!(
            "SELECT c.id FROM cases c WHERE ({condition}) AND coalesce({EXPECTED}, 0) !=
                 (SELECT count(*) FROM frames f WHERE f.case_id = c.id
                  AND f.step >= c.frames_from AND f.step < c.frames_until)"
        ),
        parameters,
    )
}

/// Checks that cases that meet a condition on `c` have all their frames.
fn check(
    connection: &Connection,
    condition: &str,
    parameters: impl rusqlite::Params,
) -> rusqlite::Result<()> {
    if incomplete(connection, condition, parameters)?.is_empty() {
        return Ok(());
    }
    Err(DigestMismatch::error("frames of a run are missing"))
}

/// A run that is to keep frames, with the steps that it has.
#[derive(Deserialize)]
struct Framed {
    id: i64,
    #[serde(deserialize_with = "json")]
    params: Params,
    frames_from: Option<u64>,
    frames_until: Option<u64>,
    steps: u64,
    is_done: bool,
}

impl Store {
    /// Requests the frames of all runs of the campaign. Started and finished ones without those of
    /// all averaged samples are computed again, from their start, with the same digits. Returns
    /// their number.
    pub(crate) fn request_frames(&mut self) -> Result<u64, StoreError> {
        let protocol = self.protocol()?;
        self.write(|connection| {
            let cases: Vec<Framed> = connection.named(
                "SELECT c.id, p.params, c.frames_from, c.frames_until,
                     min(c.steps, max(c.steps_done, coalesce(r.computed, 0))) AS steps,
                     c.state IN ('done', 'jammed') AS is_done
                 FROM cases c JOIN points p ON p.id = c.point LEFT JOIN results r ON r.case_id = c.id
                 WHERE c.position IS NOT NULL AND c.state NOT IN ('running', 'failed')",
                [],
            )?;
            let mut again = 0;
            for case in cases {
                let averaged = protocol.with_time_step(case.params.time_step);
                let averaged = averaged.discard_steps();
                let kept = case.frames_from.zip(case.frames_until);
                let covers = match kept {
                    Some((from, until)) if from < until => {
                        from <= averaged && until >= case.steps
                    }
                    // They begin where the run continues.
                    _ => case.steps <= averaged && !case.is_done,
                };
                if covers && kept.is_some() {
                    continue;
                }
                if !covers {
                    runs::forget(connection, case.id)?;
                    again += 1;
                }
                set_kept(connection, case.id, Some(0..0))?;
            }
            Ok(again)
        })
    }

    /// Every `stride`-th frame of a case, in the order of steps; at least one.
    ///
    /// # Errors
    /// [`StoreError::NoFrames`] without frames, an I/O or SQLite error, or an unreadable entry.
    pub fn frames(&self, key: &str, stride: usize) -> Result<Vec<StoredFrame>, StoreError> {
        self.read(check(&self.connection, "c.key = ?1", [key]))?;
        let row = |row: &Row<'_>| Ok((row.get(0)?, row.get(2)?));
        let which = "c.key = ?1 AND t.step < c.steps ORDER BY t.step";
        let rows: Vec<(u64, Vec<u8>)> =
            self.read(SEALED.all(&self.connection, which, [key], row))?;
        if rows.is_empty() {
            return Err(StoreError::NoFrames { key: key.into() });
        }
        rows.into_iter()
            .step_by(stride.max(1))
            .map(|(step, data)| {
                let frame = trajectory::decode(&data).map_err(|error| match error {
                    FrameError::Earlier => StoreError::EarlierFrames { key: key.into() },
                    FrameError::Unreadable => {
                        let what = format!("the frame of step {step} of case {key}");
                        StoreError::unreadable(&self.path, &what)
                    }
                })?;
                Ok(StoredFrame { step, frame })
            })
            .collect()
    }

    /// Whether a case has the frames of all its samples from a step on; if not, the first step of
    /// whose sample it has one, if any.
    ///
    /// # Errors
    /// An I/O or SQLite error.
    pub(crate) fn has_frames(
        &self,
        key: &str,
        from: u64,
    ) -> Result<Result<(), Option<u64>>, StoreError> {
        let case = "SELECT id, steps_done FROM cases WHERE key = ?1";
        let found = || {
            let (case, steps): (i64, u64) =
                self.connection.one(case, [key], |row| row.try_into())?;
            let kept = kept(&self.connection, case)?.filter(|kept| !kept.is_empty());
            Ok(match kept {
                Some(kept) if kept.start <= from && kept.end >= steps => Ok(()),
                kept => Err(kept.map(|kept| kept.start)),
            })
        };
        self.read(found())
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
