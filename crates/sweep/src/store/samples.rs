//! Samples of runs.

use super::checksum::{self, Kind};
use super::{count, integer};
use crate::stresses;
use rusqlite::{Connection, Row, ToSql, Transaction, params_from_iter};
use sd_core::Sample;
use sd_core::simulation::Counters;

/// Columns of a sample before those of the stresses, which are made from their declarations.
const COLUMNS: &str = "case_id, step, strain, viscosity, viscosity_stresslet, normal_stress_difference, dissipation, contacts, activated, \
     rolling, slipping, normal_velocity, minimum_gap, stages, unconverged_stages, worst_residual, worst_friction_error, \
     minimum_gap_so_far, jam_events, jammed_steps, jammed_steps_running, jammed_stages, shear_rate";
/// How many these are.
const COLUMN_COUNT: usize = 23;
/// Writes the samples of a case in place of any it had.
pub(super) fn write_samples(
    transaction: &Transaction<'_>,
    case: i64,
    samples: &[(u64, Sample)],
) -> Result<(), rusqlite::Error> {
    transaction.execute("DELETE FROM samples WHERE case_id = ?1", [case])?;
    let names = stresses::names(stresses::parts(), "");
    let places = vec!["?"; COLUMN_COUNT + stresses::parts().count()].join(", ");
    let mut insert = transaction.prepare_cached(&format!(
        "INSERT INTO samples ({COLUMNS}, {names}) VALUES ({places})"
    ))?;
    for (step, s) in samples {
        let fixed: [&dyn ToSql; COLUMN_COUNT] = [
            &case,
            &integer(*step),
            &s.strain,
            &s.viscosity,
            &s.viscosity_stresslet,
            &s.normal_stress_difference,
            &s.dissipation,
            &s.contacts,
            &s.activated,
            &s.rolling,
            &s.slipping,
            &s.normal_velocity,
            &s.minimum_gap,
            &integer(s.counters.stages),
            &integer(s.counters.unconverged_stages),
            &s.counters.worst_residual,
            &s.counters.worst_friction_error,
            &s.counters.minimum_gap,
            &integer(s.counters.jam_events),
            &integer(s.counters.jammed_steps),
            &integer(s.counters.jammed_steps_running),
            &integer(s.counters.jammed_stages),
            &s.shear_rate,
        ];
        let parts: Vec<f64> = stresses::parts().map(|column| column.read(s)).collect();
        let parts = parts.iter().map(|part| part as &dyn ToSql);
        insert.execute(params_from_iter(fixed.into_iter().chain(parts)))?;
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
    let names = stresses::names(stresses::parts(), "");
    connection
        .prepare_cached(&format!(
            "SELECT {COLUMNS}, {names} FROM samples WHERE case_id = ?1 AND step < ?2 ORDER BY step"
        ))?
        .query_map([case, before.map_or(i64::MAX, integer)], |row| {
            let parts = COLUMN_COUNT..COLUMN_COUNT + stresses::parts().count();
            let parts = parts.map(|column| number(row, column));
            let stress = stresses::of_parts(parts.collect::<Result<Vec<_>, _>>()?);
            Ok((
                count(row.get(1)?),
                Sample {
                    strain: number(row, 2)?,
                    viscosity: number(row, 3)?,
                    viscosity_stresslet: number(row, 4)?,
                    normal_stress_difference: number(row, 5)?,
                    stress,
                    shear_rate: number(row, 22)?,
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
