//! How far runs were computed, and what of it is the result the campaign asks for.
//!
//! A run is computed once: its beginning is the run of less strain, and from its last state it goes on to more.

use super::checksum::{self, Kind};
use super::{Checkpoint, Damage, Store, StoreError, count, integer, process, rules, samples};
use crate::axes::identity;
use crate::campaign::{Discard, Protocol};
use crate::case::State;
use crate::doubt::Doubt;
use crate::statistics::{Averages, Distribution, mser_5};
use crate::stresses::STRESSES;
use rusqlite::{Connection, OptionalExtension, Row, ToSql, Transaction, params, params_from_iter};
use sd_core::simulation::Counters;
use sd_core::{Params, Sample};
use std::collections::HashMap;

/// How far a run was computed.
pub(super) struct RunEnd<'e> {
    pub(super) steps: u64,
    pub(super) jammed: bool,
    /// What all these steps met.
    pub(super) counters: &'e Counters,
    /// A checkpoint of the last state, without samples.
    pub(super) state: &'e [u8],
}

impl RunEnd<'_> {
    /// Keeps it in place of any other of the case.
    pub(super) fn write(
        &self,
        transaction: &Transaction<'_>,
        case: i64,
    ) -> Result<(), rusqlite::Error> {
        let counters = self.counters;
        transaction
            .prepare_cached(
                "INSERT OR REPLACE INTO ends (case_id, steps, jammed, minimum_gap, stages, unconverged_stages,
                     worst_residual, worst_friction_error, jam_events, jammed_steps, jammed_stages, state)
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12)",
            )?
            .execute(params![
                case,
                integer(self.steps),
                self.jammed,
                counters.minimum_gap,
                integer(counters.stages),
                integer(counters.unconverged_stages),
                counters.worst_residual,
                counters.worst_friction_error,
                integer(counters.jam_events),
                integer(counters.jammed_steps),
                integer(counters.jammed_stages),
                self.state,
            ])?;
        checksum::seal(transaction, Kind::End, case)
    }
}

/// A case that was computed to an end, and what is asked of it.
struct Computed {
    id: i64,
    params: Params,
    asked: u64,
    state: String,
    /// Steps of its result now.
    steps_done: u64,
    /// Discarded steps of its result now; `None` if nothing was averaged yet.
    discarded: Option<u64>,
    steps: u64,
    jammed: bool,
    /// Whether it can go on from there.
    continues: bool,
    /// Counters of all steps computed.
    counters: Counters,
}

/// What becomes of a case.
enum Verdict {
    /// A result of so many steps.
    Result(State, u64),
    /// More is asked than was computed.
    Short,
}

impl Computed {
    /// Those of the condition on `c`.
    fn of(connection: &Connection, condition: &str) -> Result<Vec<Self>, rusqlite::Error> {
        connection
            .prepare(&format!(
                "SELECT c.id, c.params, c.steps, c.state, c.steps_done, r.discard_step, e.steps, e.jammed,
                     e.state IS NOT NULL, e.minimum_gap, e.stages, e.unconverged_stages, e.worst_residual,
                     e.worst_friction_error, e.jam_events, e.jammed_steps, e.jammed_stages
                 FROM ends e JOIN cases c ON c.id = e.case_id JOIN results r ON r.case_id = c.id WHERE {condition}"
            ))?
            .query_map([], Self::read)?
            .collect()
    }

    fn read(row: &Row<'_>) -> Result<Self, rusqlite::Error> {
        let number = |column: usize| -> Result<f64, rusqlite::Error> {
            Ok(row.get::<_, Option<f64>>(column)?.unwrap_or(f64::NAN))
        };
        Ok(Self {
            id: row.get(0)?,
            params: super::query::params(row, 1)?,
            asked: count(row.get(2)?),
            state: row.get(3)?,
            steps_done: count(row.get(4)?),
            discarded: u64::try_from(row.get::<_, i64>(5)?).ok(),
            steps: count(row.get(6)?),
            jammed: row.get(7)?,
            continues: row.get(8)?,
            counters: Counters {
                minimum_gap: number(9)?,
                stages: count(row.get(10)?),
                unconverged_stages: count(row.get(11)?),
                worst_residual: number(12)?,
                worst_friction_error: number(13)?,
                jam_events: count(row.get(14)?),
                jammed_steps: count(row.get(15)?),
                jammed_stages: count(row.get(16)?),
                ..Counters::default()
            },
        })
    }

    fn verdict(&self) -> Verdict {
        if self.jammed && self.asked >= self.steps {
            Verdict::Result(State::Jammed, self.steps)
        } else if self.steps >= self.asked {
            Verdict::Result(State::Done, self.asked)
        } else {
            Verdict::Short
        }
    }

    /// Gives it the state and the result that is asked for, where every run discards the same strain.
    fn settle_alone(
        &self,
        connection: &Connection,
        protocol: &Protocol,
    ) -> Result<(), rusqlite::Error> {
        let steps = protocol.with_time_step(self.params.time_step);
        self.settle(connection, steps.discard_steps().unwrap_or(0))
    }

    /// Gives it the state and the result that is asked for.
    fn settle(&self, connection: &Connection, discard: u64) -> Result<(), rusqlite::Error> {
        let (state, steps) = match self.verdict() {
            Verdict::Result(state, steps) => (state, steps),
            Verdict::Short if matches!(self.state.as_str(), "done" | "jammed") => {
                return self.reopen(connection);
            }
            // It waits already, or failed on its way on.
            Verdict::Short => return Ok(()),
        };
        if self.state == state.name() && self.steps_done == steps && self.discarded == Some(discard)
        {
            return Ok(());
        }
        checksum::check(connection, Kind::End, self.id)?;
        let samples = samples::samples(connection, self.id, Some(steps))?;
        let averages = Averages::of(&samples, discard);
        write_averages(connection, self.id, discard, &averages, self.params.spheres)?;
        let counters = self.counters_at(steps, &samples);
        connection
            .prepare_cached(
                "UPDATE results SET minimum_gap = ?2, stages = ?3, unconverged_stages = ?4, worst_residual = ?5,
                     worst_friction_error = ?6, jam_events = ?7, jammed_strain = ?8, final_strain = ?9,
                     jammed_stages = ?10, doubts = ?11
                 WHERE case_id = ?1",
            )?
            .execute(params![
                self.id,
                counters.minimum_gap,
                integer(counters.stages),
                integer(counters.unconverged_stages),
                counters.worst_residual,
                counters.worst_friction_error,
                integer(counters.jam_events),
                counters.jammed_steps as f64 * self.params.time_step,
                steps as f64 * self.params.time_step,
                integer(counters.jammed_stages),
                doubts(&self.params, &counters, &samples, discard),
            ])?;
        connection
            .prepare_cached(
                "UPDATE cases SET state = ?2, owner = NULL, steps_done = ?3, changed_at = ?4 WHERE id = ?1",
            )?
            .execute(params![
                self.id,
                state.name(),
                integer(steps),
                process::now()
            ])?;
        checksum::seal(connection, Kind::Result, self.id)
    }

    /// Counters of the first `steps` of them: of a run cut short those of its last sample.
    fn counters_at(&self, steps: u64, samples: &[(u64, Sample)]) -> Counters {
        match samples.last() {
            Some((_, last)) if steps < self.steps => last.counters,
            _ => self.counters,
        }
    }

    /// Lets it go on, as more is asked than was computed: from its last state, or where that was not kept from the beginning.
    fn reopen(&self, connection: &Connection) -> Result<(), rusqlite::Error> {
        let end = if self.continues { self.steps } else { 0 };
        connection
            .prepare_cached(
                "UPDATE cases SET state = 'pending', deaths = 0, changed_at = ?3, steps_done = max(?2,
                     coalesce((SELECT max(steps) FROM checkpoints WHERE case_id = ?1), 0)) WHERE id = ?1",
            )?
            .execute(params![self.id, integer(end), process::now()])?;
        Ok(())
    }
}

/// Names of the rules that a run of these samples broke, of which the first steps are discarded.
fn doubts(params: &Params, counters: &Counters, samples: &[(u64, Sample)], discard: u64) -> String {
    let averaged: Vec<&Sample> = samples
        .iter()
        .filter(|(step, _)| *step >= discard)
        .map(|(_, sample)| sample)
        .collect();
    Doubt::write(&Doubt::of(params, counters, &averaged))
}

/// Judges the results that no program has judged yet.
pub(super) fn judge_all(connection: &Connection) -> Result<(), rusqlite::Error> {
    for case in Computed::of(
        connection,
        "c.state IN ('done', 'jammed') AND r.doubts IS NULL",
    )? {
        let samples = samples::unchecked(connection, case.id, Some(case.steps_done))?;
        let counters = case.counters_at(case.steps_done, &samples);
        connection
            .prepare_cached("UPDATE results SET doubts = ?2 WHERE case_id = ?1")?
            .execute(params![
                case.id,
                doubts(
                    &case.params,
                    &counters,
                    &samples,
                    case.discarded.unwrap_or(0)
                )
            ])?;
    }
    Ok(())
}

/// Gives every case of the grid that was computed to an end the state and the result the protocol asks for. Cases under way
/// are left alone.
pub(super) fn settle_all(
    connection: &Connection,
    protocol: &Protocol,
) -> Result<(), rusqlite::Error> {
    let computed = Computed::of(
        connection,
        "(c.position IS NOT NULL OR c.point IS NOT NULL) AND c.state != 'running'",
    )?;
    if protocol.discard == Discard::Auto {
        let mut points: HashMap<_, Vec<Computed>> = HashMap::new();
        for case in computed {
            points.entry(identity(&case.params)).or_default().push(case);
        }
        return points
            .values()
            .try_for_each(|point| settle_point(connection, point));
    }
    computed
        .iter()
        .try_for_each(|case| case.settle_alone(connection, protocol))
}

/// The same for one case, and where the strain discarded is that of its point, for all of the point.
pub(super) fn settle(
    connection: &Connection,
    case: i64,
    protocol: &Protocol,
) -> Result<(), rusqlite::Error> {
    if protocol.discard == Discard::Auto {
        let point = Computed::of(
            connection,
            &format!(
                "c.id = {case} OR (c.params = (SELECT params FROM cases WHERE id = {case}) AND c.state != 'running'
                     AND (c.position IS NOT NULL OR c.point IS NOT NULL))"
            ),
        )?;
        return settle_point(connection, &point);
    }
    Computed::of(connection, &format!("c.id = {case}"))?
        .iter()
        .try_for_each(|case| case.settle_alone(connection, protocol))
}

/// The same for one case, whose first steps are discarded as somebody else did.
pub(super) fn settle_as(
    connection: &Connection,
    case: i64,
    discard: u64,
) -> Result<(), rusqlite::Error> {
    Computed::of(connection, &format!("c.id = {case}"))?
        .iter()
        .try_for_each(|case| case.settle(connection, discard))
}

/// Settles the runs of a point, leaving out as much as MSER-5 picks from the mean over those that are done. Where a precision
/// decides on the seeds, these are those of the first batch: so what is left out does not change under the rule's feet.
fn settle_point(connection: &Connection, point: &[Computed]) -> Result<(), rusqlite::Error> {
    let Some(first) = point.first() else {
        return Ok(());
    };
    let batch = rules::first_batch(connection, first.id)?;
    let mut total: Vec<f64> = Vec::new();
    let mut steps: Vec<u64> = Vec::new();
    for case in point {
        let Verdict::Result(State::Done, end) = case.verdict() else {
            continue;
        };
        if batch
            .as_ref()
            .is_some_and(|batch| !batch.contains(&case.id))
        {
            continue;
        }
        let samples = samples::samples(connection, case.id, Some(end))?;
        if steps.is_empty() {
            steps = samples.iter().map(|(step, _)| *step).collect();
            total = vec![0.0; steps.len()];
        }
        for (total, (_, sample)) in total.iter_mut().zip(&samples) {
            *total += sample.viscosity;
        }
    }
    let left_out = mser_5(&total).map_or(0, |(samples, _)| samples);
    let discard = steps.get(left_out).copied().unwrap_or(0);
    point
        .iter()
        .try_for_each(|case| case.settle(connection, discard))
}

/// Steps to which a case was computed, if it was computed to an end.
pub(super) fn steps_of(connection: &Connection, case: i64) -> Result<Option<u64>, rusqlite::Error> {
    connection
        .prepare_cached("SELECT steps FROM ends WHERE case_id = ?1")?
        .query_row([case], |row| row.get(0))
        .optional()
        .map(|steps| steps.map(count))
}

/// Writes the averages of a run into its result.
fn write_averages(
    connection: &Connection,
    case: i64,
    discard_step: u64,
    averages: &Averages,
    spheres: usize,
) -> Result<(), rusqlite::Error> {
    let of = |d: &Option<Distribution>, part: fn(&Distribution) -> f64| d.as_ref().map(part);
    let steady = averages.steadiness;
    let (full, stresslet) = (&averages.viscosity, &averages.viscosity_stresslet);
    connection
        .prepare_cached(
            "UPDATE results SET discard_step = ?2, samples = ?3, viscosity = ?4, viscosity_quartile_1 = ?5,
                 viscosity_median = ?6, viscosity_quartile_3 = ?7, viscosity_stresslet = ?8,
                 viscosity_stresslet_quartile_1 = ?9, viscosity_stresslet_median = ?10,
                 viscosity_stresslet_quartile_3 = ?11, normal_stress_difference = ?12, dissipation = ?13,
                 contacts_per_sphere = ?14, activated_fraction = ?15, rolling_fraction = ?16,
                 mean_approach_velocity = ?17, contacts = ?18, activated = ?19, rolling = ?20, approach = ?21,
                 viscosity_part_1 = ?22, viscosity_part_2 = ?23, viscosity_part_3 = ?24, viscosity_part_4 = ?25,
                 viscosity_variance = ?26, viscosity_correlation = ?27
             WHERE case_id = ?1",
        )?
        .execute(params![
            case,
            integer(discard_step),
            integer(averages.samples),
            of(full, |d| d.mean),
            of(full, |d| d.quartile_1),
            of(full, |d| d.median),
            of(full, |d| d.quartile_3),
            of(stresslet, |d| d.mean),
            of(stresslet, |d| d.quartile_1),
            of(stresslet, |d| d.median),
            of(stresslet, |d| d.quartile_3),
            averages.normal_stress_difference,
            averages.dissipation,
            averages.contacts_per_sphere(spheres),
            averages.activated_fraction(),
            averages.rolling_fraction(),
            averages.mean_approach_velocity(),
            integer(averages.contacts),
            integer(averages.activated),
            integer(averages.rolling),
            averages.approach,
            steady.map(|s| s.parts[0]),
            steady.map(|s| s.parts[1]),
            steady.map(|s| s.parts[2]),
            steady.map(|s| s.parts[3]),
            steady.map(|s| s.variance),
            steady.map(|s| s.correlation),
        ])?;
    let places: Vec<String> = STRESSES
        .iter()
        .zip(2..)
        .map(|(column, place)| format!("{} = ?{place}", column.name))
        .collect();
    let case: &dyn ToSql = &case;
    let means = averages.stresses.iter().map(|mean| mean as &dyn ToSql);
    connection
        .prepare_cached(&format!(
            "UPDATE results SET {} WHERE case_id = ?1",
            places.join(", ")
        ))?
        .execute(params_from_iter(std::iter::once(case).chain(means)))?;
    Ok(())
}

impl Store {
    /// The last state of a run that was computed to an end, with all its samples, so that it can go on.
    pub(super) fn end_to_go_on_from(
        &self,
        case: i64,
    ) -> Result<Option<Result<Checkpoint, Damage>>, StoreError> {
        let state: Option<Vec<u8>> = self.read(
            self.connection
                .prepare_cached("SELECT state FROM ends WHERE case_id = ?1 AND state IS NOT NULL")
                .and_then(|mut query| query.query_row([case], |row| row.get(0)).optional()),
        )?;
        if state.is_some() {
            self.read(checksum::check(&self.connection, Kind::End, case))?;
        }
        let mut end = match state.map(|state| Checkpoint::decode(&state)) {
            Some(Ok(end)) => end,
            other => return Ok(other),
        };
        end.samples = self.read(samples::samples(
            &self.connection,
            case,
            Some(end.snapshot.steps),
        ))?;
        Ok(Some(Ok(end)))
    }
}
