//! Reads and checks the `[protocol]` table.

use super::axis_values::axis_values;
use super::error::Problem;
use super::reader::{Reader, Values, word, wrong_type};
use super::segments::{self, DISCARDED, LENGTH, SEGMENT, WrittenSegment};
use crate::data::Value;
use crate::model::axes::Axis;
use crate::model::protocol::{PlannedSegment, Protocol};
use std::ops;
use toml::de::DeValue;

/// Its name in the file.
pub(super) const NAME: &str = "[protocol]";
/// The axis whose value for all grids may stand in `[protocol]`.
const TIME_STEP: &str = "time_step";
/// Longest run, in steps.
const STEP_LIMIT: f64 = 1e8;
/// Most samples of one run.
const SAMPLE_LIMIT: u64 = 1_000_000;
/// Key of further quantities that samples record.
const OBSERVE: &str = "observe";
/// Its only value.
const NETWORK: &str = "network";
/// Key of the unit of times.
pub(super) const TIME_UNIT: &str = "time_unit";
/// Its keys.
pub(super) const KEYS: [&str; 8] = [
    TIME_STEP,
    TIME_UNIT,
    "strain",
    "discard",
    "checkpoint_every",
    "sample_every",
    OBSERVE,
    SEGMENT,
];

/// A protocol and the tables of its values.
pub(super) struct WrittenProtocol<'t> {
    pub(super) protocol: Protocol,
    table: Reader<'t>,
    time_step: Option<Values>,
    segments: Vec<WrittenSegment<'t>>,
    /// The rate or stress of grids that impose none, with its axis.
    shear: Option<(&'static str, Values)>,
    /// Strain in one unit of time of the file.
    unit: f64,
}

impl<'t> WrittenProtocol<'t> {
    /// Reads and checks the protocol; `unit`: strain in one unit of its times.
    pub(super) fn read(table: Reader<'t>, unit: f64) -> Self {
        let preset = Protocol::default();
        let of = |key: &str, range, preset: f64| {
            unit * table.number(key, range, " (a strain)").unwrap_or(preset)
        };
        let mut protocol = Protocol {
            strain: of("strain", &LENGTH, preset.strain),
            discard: of("discard", &DISCARDED, preset.discard),
            checkpoint_every: of("checkpoint_every", &LENGTH, preset.checkpoint_every),
            sample_every: of("sample_every", &LENGTH, preset.sample_every),
            observes_network: observes_network(&table),
            segments: Vec::new(),
        };
        let time_step = table
            .get(TIME_STEP)
            .and_then(|written| axis_values(written, Axis::of_key(TIME_STEP)?, table.faults))
            .map(|values| in_strain(values, unit));
        let before = table.faults.count();
        if let Some(segments) = table.get(SEGMENT) {
            for key in ["strain", "discard"] {
                if table.get(key).is_some() {
                    let problem = format!("`{key}` of the whole run together with segments");
                    let allowed = format!("`{key}` in each [[protocol.segment]]");
                    table.faults.push(
                        Problem::at(&table.place(key), problem, allowed)
                            .of_key(key)
                            .also(&segments.span(), "the segments"),
                    );
                }
            }
        }
        let mut segments = segments::read(&table);
        let shear = segments::shear(&segments);
        if table.faults.count() > before {
            // Their faults are reported once, not for every grid.
            segments.clear();
        }
        protocol.segments = segments.iter().map(|one| one.segment).collect();
        if let Some(last) = protocol.segments.last() {
            protocol.strain = last.end();
            protocol.discard = last.kept_from();
        }
        let written = Self {
            protocol,
            table,
            time_step,
            segments,
            shear,
            unit,
        };
        if written.table.is_whole() {
            written.check_averages();
        }
        written
    }

    /// A problem of the value of a key.
    fn problem(
        &self,
        key: &str,
        message: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Problem {
        Problem::at(&self.table.place(key), message, allowed)
    }

    /// Values of an axis for grids without their own; `imposes`: whether they impose a rate or a
    /// stress.
    pub(super) fn value_of(&self, axis: &Axis, imposes: bool) -> Option<Values> {
        if axis.key == TIME_STEP {
            return self.time_step.clone();
        }
        let (key, values) = self.shear.as_ref().filter(|_| !imposes)?;
        (*key == axis.key).then(|| values.clone())
    }

    /// Values of an axis that a grid has, in strain if they are times.
    pub(super) fn converted(&self, axis: &Axis, values: Values) -> Values {
        if axis.key == TIME_STEP {
            in_strain(values, self.unit)
        } else {
            values
        }
    }

    /// Refuses a time step at which runs are too long, or of which lengths are no multiples;
    /// `place` is that of the step.
    pub(super) fn check_lengths(
        &self,
        time_step: f64,
        place: Option<&ops::Range<usize>>,
    ) -> Result<(), Problem> {
        let p = &self.protocol;
        let place = place.unwrap_or(&self.table.span);
        let in_steps = p.with_time_step(time_step);
        let steps = p.strain / time_step;
        if steps > STEP_LIMIT {
            let allowed =
                format!("at most {STEP_LIMIT:e} steps: a shorter strain or a longer step");
            return Err(self
                .problem("strain", format!("a run of {steps:.3e} steps"), allowed)
                .also(place, "the time step"));
        }
        let segments = self.segments.iter().flat_map(WrittenSegment::lengths);
        let own = [("strain", p.strain), ("sample_every", p.sample_every)];
        let own = own.map(|(key, value)| (key, value, self.table.place(key)));
        for (key, value, span) in segments.chain(own) {
            if in_steps.whole_steps(value).is_none_or(|n| n == 0) {
                let whole = format!("a whole number of time steps, {time_step} each");
                let problem = format!("`{key}` = {value} is not {whole}");
                return Err(Problem::at(&span, problem, format!("`{key}` is {whole}"))
                    .of_key(key)
                    .also(place, "the time step"));
            }
        }
        let every = p.checkpoint_every;
        if every < time_step {
            let problem = format!("`checkpoint_every` = {every} is less than a step");
            let allowed = format!("at least the time step, {time_step}");
            return Err(self.problem("checkpoint_every", problem, allowed));
        }
        if in_steps.steps() / in_steps.sample_stride() > SAMPLE_LIMIT {
            let allowed = format!("at most {SAMPLE_LIMIT}: sample less often");
            return Err(self.problem("sample_every", "too many samples in a run", allowed));
        }
        Ok(())
    }

    /// A problem of parameters in one of the segments, at the value in that segment if it has one.
    pub(super) fn of_segment(&self, number: usize, problem: Problem) -> Problem {
        match self.segments.get(number) {
            Some(segment) => segment.problem(problem),
            None => problem,
        }
    }

    /// Refuses runs without samples to average.
    fn check_averages(&self) {
        let p = &self.protocol;
        let every = p.sample_every;
        let averaged = |one: &PlannedSegment| one.strain - one.discard;
        let short = |one: &&WrittenSegment<'_>| every > averaged(&one.segment);
        if let Some(one) = self.segments.iter().find(short) {
            let problem = format!("`sample_every` = {every} may give a segment no sample");
            let averaged = averaged(&one.segment);
            let allowed = format!("at most {averaged}, the strain of the segment that is averaged");
            self.table.faults.push(
                self.problem("sample_every", problem, allowed)
                    .also(&one.table.span, "this segment"),
            );
        }
        if !self.segments.is_empty() {
            return;
        }
        let (strain, discard) = (p.strain, p.discard);
        if discard >= strain {
            let problem = format!(
                "`discard` = {discard} leaves nothing to average of a run of strain {strain}"
            );
            let allowed = format!("`discard` is from 0 to below {strain}");
            self.table.faults.push(
                self.problem("discard", problem, allowed)
                    .also(&self.table.place("strain"), "the length of a run"),
            );
        } else if every > strain - discard {
            let problem =
                format!("`sample_every` = {every} may give no sample after the discarded strain");
            let allowed = format!("at most {}", strain - discard);
            let problem = self.problem("sample_every", problem, allowed);
            self.table.faults.push(problem);
        }
    }
}

/// Times as strains; `unit`: strain in one unit of them.
fn in_strain(mut values: Values, unit: f64) -> Values {
    for one in &mut values.all {
        if let Value::Number(time) = &mut one.value {
            *time *= unit;
        }
    }
    values
}

/// Whether samples record the contact network.
fn observes_network(table: &Reader<'_>) -> bool {
    let Some(written) = table.get(OBSERVE) else {
        return false;
    };
    let DeValue::Array(words) = written.get_ref() else {
        let allowed = format!("`{OBSERVE}` is a list: `{OBSERVE} = [\"{NETWORK}\"]`");
        table.faults.push(wrong_type(written, OBSERVE, allowed));
        return false;
    };
    let words = words.iter().map(|one| word(one, OBSERVE, &[NETWORK]));
    words.filter_map(|one| table.faults.ok(one)).count() > 0
}
