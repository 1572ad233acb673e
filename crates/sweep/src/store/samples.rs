//! Samples of runs.

use super::digest::{Altered, Digest, whole};
use super::statements::Statements;
use crate::model::stresses;
use rusqlite::types::Value;
use rusqlite::{Connection, Row, params, params_from_iter};
use sd_core::Sample;
use sd_core::simulation::Counters;
use std::collections::HashMap;
use std::sync::LazyLock;

/// Columns of a sample after its case, before those of the stresses, which are made from their declarations.
const COLUMNS: &str = "step, strain, viscosity, viscosity_stresslet, normal_stress_difference, dissipation, contacts, activated, \
     rolling, slipping, normal_velocity, minimum_gap, stages, unconverged_stages, worst_residual, worst_friction_error, \
     minimum_gap_so_far, jam_events, jammed_steps, jammed_steps_running, jammed_stages, inexact_stages, shear_rate";
/// How many these are.
const COLUMN_COUNT: usize = 23;

/// Reads the samples of a case up to a step.
static SELECT: LazyLock<String> = LazyLock::new(|| {
    let names = stresses::names(stresses::parts(), "");
    format!("SELECT {COLUMNS}, {names} FROM samples WHERE case_id = ?1 ORDER BY step")
});
/// Writes one.
static INSERT: LazyLock<String> = LazyLock::new(|| {
    let names = stresses::names(stresses::parts(), "");
    let places = vec!["?"; 1 + COLUMN_COUNT + stresses::parts().count()].join(", ");
    format!("INSERT INTO samples (case_id, {COLUMNS}, {names}) VALUES ({places})")
});

/// Writes the samples of a case in place of any it had, and their digest with the case.
pub(super) fn write(
    connection: &Connection,
    case: i64,
    samples: &[(u64, Sample)],
) -> rusqlite::Result<()> {
    connection.run("DELETE FROM samples WHERE case_id = ?1", [case])?;
    let mut insert = connection.prepare_cached(&INSERT)?;
    let mut digest = Digest::default();
    let case_id = Value::Integer(case);
    for (step, sample) in samples {
        let values = values(*step, sample);
        digest = digest.with(&values);
        insert.execute(params_from_iter(std::iter::once(&case_id).chain(&values)))?;
    }
    let digest = (!samples.is_empty()).then(|| digest.finish());
    connection.run(
        "UPDATE cases SET samples_digest = ?2 WHERE id = ?1",
        params![case, digest],
    )
}

/// The samples of a case, with their steps. What is not a number comes back as NaN.
///
/// # Errors
/// Those of the query, and [`Altered`] if they are not what was written.
pub(super) fn of(connection: &Connection, case: i64) -> rusqlite::Result<Vec<(u64, Sample)>> {
    let written = "SELECT samples_digest FROM cases WHERE id = ?1";
    let written: Option<i64> = connection.value(written, [case])?.flatten();
    let mut query = connection.prepare_cached(&SELECT)?;
    let columns = query.column_count();
    let (mut digest, mut samples) = (Digest::default(), Vec::new());
    let mut rows = query.query([case])?;
    while let Some(row) = rows.next()? {
        digest = digest.with_row(row, 0..columns)?;
        samples.push(sample(row)?);
    }
    if (!samples.is_empty()).then(|| digest.finish()) == written {
        Ok(samples)
    } else {
        Err(Altered::error(
            "the samples of a run are not what was written",
        ))
    }
}

/// The digests of the samples of all cases as they are now.
pub(super) fn digests(connection: &Connection) -> rusqlite::Result<HashMap<i64, i64>> {
    let names = stresses::names(stresses::parts(), "");
    let mut query = connection.prepare(&format!(
        "SELECT {COLUMNS}, {names}, case_id FROM samples ORDER BY case_id, step"
    ))?;
    let case = query.column_count() - 1;
    let mut rows = query.query([])?;
    let mut digests = HashMap::new();
    let mut current: Option<(i64, Digest)> = None;
    while let Some(row) = rows.next()? {
        let id = row.get(case)?;
        if current.as_ref().is_some_and(|(known, _)| *known != id) {
            digests.extend(current.take().map(|(id, digest)| (id, digest.finish())));
        }
        let (_, digest) = current.unwrap_or((id, Digest::default()));
        current = Some((id, digest.with_row(row, 0..case)?));
    }
    digests.extend(current.map(|(id, digest)| (id, digest.finish())));
    Ok(digests)
}

/// Where two samples differ first, bit for bit, if they do.
pub(super) fn difference(one: &(u64, Sample), two: &(u64, Sample)) -> Option<String> {
    let names = stresses::names(stresses::parts(), "");
    let names = COLUMNS.split(", ").chain(names.split(", "));
    let values = values(one.0, &one.1).into_iter().zip(values(two.0, &two.1));
    names.zip(values).find_map(|(name, (one, two))| {
        let same = match (&one, &two) {
            (Value::Real(one), Value::Real(two)) => one.to_bits() == two.to_bits(),
            (one, two) => one == two,
        };
        (!same).then(|| format!("{name} is {}, and {}", shown(&one), shown(&two)))
    })
}

/// A value with all its digits.
fn shown(value: &Value) -> String {
    match value {
        Value::Real(real) => format!("{real:?}"),
        Value::Integer(whole) => whole.to_string(),
        _ => "nothing".into(),
    }
}

/// The values of a sample, in the order of the columns.
fn values(step: u64, s: &Sample) -> Vec<Value> {
    let mut values = vec![
        whole(step),
        s.strain.into(),
        s.viscosity.into(),
        s.viscosity_stresslet.into(),
        s.normal_stress_difference.into(),
        s.dissipation.into(),
        s.contacts.into(),
        s.activated.into(),
        s.rolling.into(),
        s.slipping.into(),
        s.normal_velocity.into(),
        s.minimum_gap.into(),
        whole(s.counters.stages),
        whole(s.counters.unconverged_stages),
        s.counters.worst_residual.into(),
        s.counters.worst_friction_error.into(),
        s.counters.minimum_gap.into(),
        whole(s.counters.jam_events),
        whole(s.counters.jammed_steps),
        whole(s.counters.jammed_steps_running),
        whole(s.counters.jammed_stages),
        whole(s.counters.inexact_stages),
        s.shear_rate.into(),
    ];
    values.extend(stresses::parts().map(|column| Value::from(column.read(s))));
    values
}

/// A row of [`SELECT`].
fn sample(row: &Row<'_>) -> rusqlite::Result<(u64, Sample)> {
    let number = |column| row.get(column).map(|n: Option<f64>| n.unwrap_or(f64::NAN));
    let parts = COLUMN_COUNT..COLUMN_COUNT + stresses::parts().count();
    let parts = parts.map(number).collect::<Result<Vec<_>, _>>()?;
    let sample = Sample {
        strain: number(1)?,
        viscosity: number(2)?,
        viscosity_stresslet: number(3)?,
        normal_stress_difference: number(4)?,
        stress: stresses::of_parts(parts),
        dissipation: number(5)?,
        contacts: row.get(6)?,
        activated: row.get(7)?,
        rolling: row.get(8)?,
        slipping: row.get(9)?,
        normal_velocity: number(10)?,
        minimum_gap: number(11)?,
        counters: Counters {
            stages: row.get(12)?,
            unconverged_stages: row.get(13)?,
            worst_residual: number(14)?,
            worst_friction_error: number(15)?,
            minimum_gap: number(16)?,
            jam_events: row.get(17)?,
            jammed_steps: row.get(18)?,
            jammed_steps_running: row.get(19)?,
            jammed_stages: row.get(20)?,
            inexact_stages: row.get(21)?,
        },
        shear_rate: number(22)?,
    };
    Ok((row.get(0)?, sample))
}

/// Drops the samples of a case from a step on.
pub(super) fn cut(connection: &Connection, case: i64, from: u64) -> rusqlite::Result<()> {
    let mut samples = of(connection, case)?;
    samples.retain(|(step, _)| *step < from);
    write(connection, case, &samples)
}
