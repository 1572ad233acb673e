//! Samples of runs.

use super::checksum::{self, Kind};
use super::{count, integer};
use rusqlite::{Connection, Row, Transaction, params};
use sd_core::Sample;
use sd_core::simulation::Counters;

/// Whether a sample has the numbers that every row has. A viscosity that came out as none is kept as such.
pub(crate) fn can_be_kept(sample: &Sample) -> bool {
    sample.strain.is_finite() && sample.normal_velocity.is_finite()
}

/// Writes the samples of a case in place of any it had.
pub(super) fn write_samples(
    transaction: &Transaction<'_>,
    case: i64,
    samples: &[(u64, Sample)],
) -> Result<(), rusqlite::Error> {
    transaction.execute("DELETE FROM samples WHERE case_id = ?1", [case])?;
    let mut insert = transaction.prepare_cached(
        "INSERT INTO samples VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19,
             ?20, ?21, ?22)",
    )?;
    for (step, s) in samples {
        insert.execute(params![
            case,
            integer(*step),
            s.strain,
            s.viscosity,
            s.viscosity_stresslet,
            s.normal_stress_difference,
            s.dissipation,
            s.contacts,
            s.activated,
            s.rolling,
            s.slipping,
            s.normal_velocity,
            s.minimum_gap,
            integer(s.counters.stages),
            integer(s.counters.unconverged_stages),
            s.counters.worst_residual,
            s.counters.worst_friction_error,
            s.counters.minimum_gap,
            integer(s.counters.jam_events),
            integer(s.counters.jammed_steps),
            integer(s.counters.jammed_steps_running),
            integer(s.counters.jammed_stages),
        ])?;
    }
    checksum::seal(transaction, Kind::Samples, case)
}

/// The samples of a case before a step, or all of them, with their steps. What is not a number comes back as NaN.
///
/// # Errors
/// Those of the query, and [`Altered`](checksum::Altered) if they are not what was written.
pub(super) fn samples(
    connection: &Connection,
    case: i64,
    before: Option<u64>,
) -> Result<Vec<(u64, Sample)>, rusqlite::Error> {
    checksum::check(connection, Kind::Samples, case)?;
    unchecked(connection, case, before)
}

/// The same without a look at their checksum.
pub(super) fn unchecked(
    connection: &Connection,
    case: i64,
    before: Option<u64>,
) -> Result<Vec<(u64, Sample)>, rusqlite::Error> {
    let number = |row: &Row<'_>, column: usize| -> Result<f64, rusqlite::Error> {
        Ok(row.get::<_, Option<f64>>(column)?.unwrap_or(f64::NAN))
    };
    connection
        .prepare_cached("SELECT * FROM samples WHERE case_id = ?1 AND step < ?2 ORDER BY step")?
        .query_map([case, before.map_or(i64::MAX, integer)], |row| {
            Ok((
                count(row.get(1)?),
                Sample {
                    strain: number(row, 2)?,
                    viscosity: number(row, 3)?,
                    viscosity_stresslet: number(row, 4)?,
                    normal_stress_difference: number(row, 5)?,
                    dissipation: number(row, 6)?,
                    contacts: row.get(7)?,
                    activated: row.get(8)?,
                    rolling: row.get(9)?,
                    slipping: row.get(10)?,
                    normal_velocity: number(row, 11)?,
                    minimum_gap: number(row, 12)?,
                    counters: Counters {
                        stages: count(row.get(13)?),
                        unconverged_stages: count(row.get(14)?),
                        worst_residual: number(row, 15)?,
                        worst_friction_error: number(row, 16)?,
                        minimum_gap: number(row, 17)?,
                        jam_events: count(row.get(18)?),
                        jammed_steps: count(row.get(19)?),
                        jammed_steps_running: count(row.get(20)?),
                        jammed_stages: count(row.get(21)?),
                    },
                },
            ))
        })?
        .collect()
}
