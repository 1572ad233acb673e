//! Results: averages of runs and their storage.

use super::digest::{self, Digest, DigestMismatch, whole};
use super::ends::RunEnd;
use super::statements::Statements;
use crate::measure::doubt::Doubt;
use crate::measure::sampled::{self, Number};
use crate::measure::{Averages, Distribution};
use crate::model::case::State;
use rusqlite::types::Value;
use rusqlite::{Connection, params_from_iter};
use sd_core::{Params, Sample};
use std::sync::LazyLock;

/// Columns of a result before the means of the stress and of the network, and after them.
const BEFORE: &str = "discard_step, samples, viscosity, viscosity_quartile_1, viscosity_median, viscosity_quartile_3, \
     viscosity_stresslet, viscosity_stresslet_quartile_1, viscosity_stresslet_median, viscosity_stresslet_quartile_3, \
     normal_stress_difference, dissipation, contacts_per_sphere, activated_fraction, rolling_fraction, \
     mean_approach_velocity, contacts, activated, rolling, approach, minimum_gap, stages, unconverged_stages, inexact_stages, \
     worst_residual, worst_friction_error, jam_events, jammed_strain, final_strain, wall_time_s, resumed, process, \
     finished_at, jammed_stages, doubts";
const AFTER: &str = "cpu_time_s, viscosity_part_1, viscosity_part_2, viscosity_part_3, viscosity_part_4, \
     viscosity_variance, viscosity_correlation";

/// Description of a result.
pub(super) const WORDS: &str = "the result of a run";

/// The columns covered by the digest of a result, from the tables `c` of cases, `p` of points and
/// `r` of results; then the digest.
pub(super) static COVERED: LazyLock<String> = LazyLock::new(|| {
    format!(
        "c.key, p.digest AS point_digest, c.state, c.steps_done, c.samples_digest, r.{}, r.digest",
        columns().replace(", ", ", r.")
    )
});

/// The columns of a result.
pub(super) fn columns() -> String {
    format!(
        "{BEFORE}, {}, {AFTER}",
        sampled::listed(Number::has_mean, "", "")
    )
}

/// Writes a result.
static INSERT: LazyLock<String> = LazyLock::new(|| {
    let columns = columns();
    let places = vec!["?"; columns.split(", ").count() + 2].join(", ");
    format!("INSERT OR REPLACE INTO results (case_id, {columns}, digest) VALUES ({places})")
});

/// The part of a case that the digest of its result covers.
pub(super) struct Covered {
    pub(super) id: i64,
    pub(super) key: String,
    /// Digest of its point.
    pub(super) point: i64,
    pub(super) params: Params,
    /// Digest of its samples.
    pub(super) samples: Option<i64>,
}

/// Writes the result of the first `steps` of the run of a case, some of them discarded, and its
/// state.
pub(super) fn put(
    connection: &Connection,
    case: &Covered,
    (state, steps, discard): (State, u64, u64),
    end: &RunEnd,
    samples: &[(u64, Sample)],
) -> rusqlite::Result<()> {
    let samples = &samples[..samples.partition_point(|(step, _)| *step < steps)];
    let values = values(&case.params, (steps, discard), samples, end);
    let covered = [
        Value::Text(case.key.clone()),
        case.point.into(),
        Value::Text(state.name().to_owned()),
        whole(steps),
        case.samples.into(),
    ];
    let digest = Digest::default().with(&covered).with(&values).finish();
    let (id, digest) = (case.id.into(), digest.into());
    let row = std::iter::once(&id).chain(&values).chain([&digest]);
    connection.run(&INSERT, params_from_iter(row))
}

/// The values of a result, in the order of its columns.
fn values(
    params: &Params,
    (steps, discard): (u64, u64),
    samples: &[(u64, Sample)],
    end: &RunEnd,
) -> Vec<Value> {
    let counters = end.counters_at(steps, samples);
    let averages = Averages::of(samples, discard);
    let averaged: Vec<&Sample> = samples
        .iter()
        .filter(|(step, _)| *step >= discard)
        .map(|(_, sample)| sample)
        .collect();
    let doubts = Doubt::write(&Doubt::of(params, &counters, &averaged));
    let distribution = |d: &Option<Distribution>| {
        let d = d.as_ref();
        [
            d.map(|d| d.mean).into(),
            d.map(|d| d.quartile_1).into(),
            d.map(|d| d.median).into(),
            d.map(|d| d.quartile_3).into(),
        ]
    };
    let strain = |steps: u64| (steps as f64 * params.time_step).into();
    let mut values = vec![whole(discard), whole(averages.samples)];
    values.extend(distribution(&averages.viscosity));
    values.extend(distribution(&averages.viscosity_stresslet));
    values.extend([
        averages.normal_stress_difference.into(),
        averages.dissipation.into(),
        averages.contacts_per_sphere(params.spheres).into(),
        averages.activated_fraction().into(),
        averages.rolling_fraction().into(),
        averages.mean_approach_velocity().into(),
        whole(averages.contacts),
        whole(averages.activated),
        whole(averages.rolling),
        averages.approach.into(),
        counters.minimum_gap.into(),
        whole(counters.stages),
        whole(counters.unconverged_stages),
        whole(counters.inexact_stages),
        counters.worst_residual.into(),
        counters.worst_friction_error.into(),
        whole(counters.jam_events),
        strain(counters.jammed_steps),
        strain(steps),
        end.wall_time_s.into(),
        end.resumed.into(),
        end.process.into(),
        end.finished_at.into(),
        whole(counters.jammed_stages),
        Value::Text(doubts),
    ]);
    values.extend(averages.means.map(Value::from));
    let steady = averages.steadiness;
    values.push(end.cpu_time_s.into());
    values.extend((0..4).map(|part| Value::from(steady.map(|s| s.parts[part]))));
    values.push(steady.map(|s| s.variance).into());
    values.push(steady.map(|s| s.correlation).into());
    values
}

/// Checks the digest of the result of a case.
pub(super) fn check(connection: &Connection, case: i64) -> rusqlite::Result<()> {
    let query = format!("{} AND c.id = ?1", select());
    digest::each(connection, &query, [case], |_, is_whole, _| {
        DigestMismatch::unless(is_whole, WORDS)
    })
}

/// Selects the columns covered by the digests of all results that count, the digests, and the row
/// numbers.
pub(super) fn select() -> String {
    format!(
        "SELECT {}, r.rowid FROM results r JOIN cases c ON c.id = r.case_id JOIN points p ON p.id = c.point
         WHERE c.state IN ('done', 'jammed')",
        *COVERED
    )
}
