//! Reads and checks the `[protocol]` table.

use super::error::Problem;
use super::reader::{Table, Values, number, of_axis, values, word, wrong_type};
use super::segments::{self, SEGMENT, WrittenSegment};
use crate::model::axes::Axis;
use crate::model::protocol::{Discard, PlannedSegment, Protocol};
use sd_core::model::Range;
use std::collections::HashMap;
use std::ops;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The axis whose value for all grids may stand in `[protocol]`.
const TIME_STEP: &str = "time_step";
/// Longest run, in steps.
const STEP_LIMIT: f64 = 1e8;
/// Most samples of one run.
const SAMPLE_LIMIT: u64 = 1_000_000;
/// Fewest samples of a run from which MSER-5 chooses the strain to discard.
const MIN_SAMPLES: f64 = 40.0;
/// Allowed lengths, as strains.
pub(super) const LENGTH: Range = Range::above_to(0.0, 1e7);
/// Strains that may be discarded.
pub(super) const DISCARDED: Range = Range::from_to(0.0, 1e7);

/// Key of further quantities that samples record.
const OBSERVE: &str = "observe";
/// Its only value.
const NETWORK: &str = "network";

/// Whether samples record the contact network.
fn observes_network(written: &Spanned<DeValue<'_>>, problems: &mut Vec<Problem>) -> bool {
    let DeValue::Array(words) = written.get_ref() else {
        let allowed = format!("`{OBSERVE}` is a list: `{OBSERVE} = [\"{NETWORK}\"]`");
        problems.push(wrong_type(written, OBSERVE, allowed));
        return false;
    };
    let words = words
        .iter()
        .map(|written| word(written, OBSERVE, &[NETWORK]));
    let (known, wrong): (Vec<_>, Vec<_>) = words.partition(Result::is_ok);
    problems.extend(wrong.into_iter().filter_map(Result::err));
    !known.is_empty()
}

/// A protocol and the places of its values.
pub(super) struct Written {
    pub(super) protocol: Protocol,
    time_step: Option<Values>,
    /// The table, or the first line where there is none.
    table: ops::Range<usize>,
    places: HashMap<&'static str, ops::Range<usize>>,
    segments: Vec<WrittenSegment>,
    /// The rate or stress of grids that impose none, with its axis.
    shear: Option<(&'static str, Values)>,
}

impl Written {
    /// The default protocol; problems about it point at `table`.
    pub(super) fn default_at(table: ops::Range<usize>) -> Self {
        Self {
            protocol: Protocol::default(),
            time_step: None,
            table,
            places: HashMap::new(),
            segments: Vec::new(),
            shear: None,
        }
    }

    /// Reads and checks the protocol.
    pub(super) fn read(
        entries: &DeTable<'_>,
        span: ops::Range<usize>,
        problems: &mut Vec<Problem>,
    ) -> Self {
        let known = [
            TIME_STEP,
            "strain",
            "discard",
            "checkpoint_every",
            "sample_every",
            OBSERVE,
            SEGMENT,
        ];
        let table = Table::new(entries, span.clone(), "[protocol]", &known, problems);
        let before = problems.len();
        let preset = Protocol::default();
        let mut places = HashMap::new();
        let mut read = |key: &'static str, default: f64, range: &Range| {
            let Some(written) = table.get(key) else {
                return default;
            };
            places.insert(key, written.span());
            let or = if key == "discard" {
                ", or \"auto\""
            } else {
                ""
            };
            let read = number(written, key, range, &format!("{range} (a strain){or}"));
            read.unwrap_or_else(|problem| {
                problems.push(problem);
                default
            })
        };
        let mut strain = read("strain", preset.strain, &LENGTH);
        let auto = table.get("discard").filter(
            |written| matches!(written.get_ref(), DeValue::String(word) if word.as_ref() == "auto"),
        );
        let mut discard = match preset.discard {
            _ if auto.is_some() => Discard::Auto,
            Discard::Strain(usual) => Discard::Strain(read("discard", usual, &DISCARDED)),
            Discard::Auto => Discard::Strain(read("discard", 0.0, &DISCARDED)),
        };
        let checkpoint_every = read("checkpoint_every", preset.checkpoint_every, &LENGTH);
        let sample_every = read("sample_every", preset.sample_every, &LENGTH);
        places.extend(auto.map(|written| ("discard", written.span())));
        let time_step = table.get(TIME_STEP).and_then(|written| {
            let axis = Axis::of_key(TIME_STEP)?;
            values(written, TIME_STEP, problems, |value| of_axis(value, axis))
        });
        let observes_network = table
            .get(OBSERVE)
            .is_some_and(|written| observes_network(written, problems));
        let before_segments = problems.len();
        let mut segments = table.get(SEGMENT).map_or_else(Vec::new, |written| {
            for key in ["strain", "discard"] {
                if let Some(place) = places.get(key) {
                    problems.push(
                        Problem::at(
                            place,
                            format!("`{key}` of the whole run together with segments"),
                            format!("`{key}` in each [[protocol.segment]]"),
                        )
                        .of_key(key)
                        .also(&written.span(), "the segments"),
                    );
                }
            }
            segments::read(written, problems)
        });
        let shear = segments::shear(&segments);
        if problems.len() > before_segments {
            // Their faults are reported once, not for every grid.
            segments.clear();
        }
        let planned: Vec<PlannedSegment> = segments.iter().map(|one| one.segment).collect();
        if let Some(last) = planned.last() {
            strain = last.end();
            discard = Discard::Strain(last.kept_from());
        }
        let written = Self {
            protocol: Protocol {
                strain,
                discard,
                checkpoint_every,
                sample_every,
                observes_network,
                segments: planned,
            },
            time_step,
            table: span,
            places,
            segments,
            shear,
        };
        if problems.len() == before {
            written.check_averages(problems);
        }
        written
    }

    /// Place of a value, or of the table.
    fn place(&self, key: &str) -> &ops::Range<usize> {
        self.places.get(key).unwrap_or(&self.table)
    }

    /// Values of an axis for grids without their own; `imposes`: whether they impose a rate or a
    /// stress.
    pub(super) fn value_of(&self, axis: &Axis, imposes: bool) -> Option<Values> {
        if axis.key == TIME_STEP {
            return self.time_step.clone();
        }
        let shear = self.shear.as_ref().filter(|_| !imposes);
        shear
            .filter(|(key, _)| *key == axis.key)
            .map(|(_, values)| values.clone())
    }

    /// Refuses a time step at which runs are too long, or of which lengths are no multiples;
    /// `place` is that of the step.
    pub(super) fn check_lengths(
        &self,
        time_step: f64,
        place: Option<&ops::Range<usize>>,
    ) -> Result<(), Problem> {
        let p = &self.protocol;
        let place = place.unwrap_or(&self.table);
        let in_steps = p.with_time_step(time_step);
        let steps = p.strain / time_step;
        if steps > STEP_LIMIT {
            return Err(Problem::at(
                self.place("strain"),
                format!("a run of {steps:.3e} steps"),
                format!("at most {STEP_LIMIT:e} steps: a shorter strain or a longer step"),
            )
            .also(place, "the time step"));
        }
        let whole = format!("a whole number of time steps, {time_step} each");
        for segment in &self.segments {
            for (key, value, span) in segment.lengths() {
                if in_steps.whole_steps(value).is_none_or(|n| n == 0) {
                    return Err(Problem::at(
                        span,
                        format!("`{key}` = {value} is not {whole}"),
                        format!("`{key}` is {whole}"),
                    )
                    .of_key(key)
                    .also(place, "the time step"));
                }
            }
        }
        for (key, value) in [("strain", p.strain), ("sample_every", p.sample_every)] {
            if in_steps.whole_steps(value).is_none_or(|n| n == 0) {
                return Err(Problem::at(
                    self.place(key),
                    format!("`{key}` = {value} is not {whole}"),
                    format!("`{key}` is {whole}"),
                )
                .also(place, "the time step"));
            }
        }
        if p.checkpoint_every < time_step {
            return Err(Problem::at(
                self.place("checkpoint_every"),
                format!(
                    "`checkpoint_every` = {} is less than a step",
                    p.checkpoint_every
                ),
                format!("at least the time step, {time_step}"),
            ));
        }
        if in_steps.steps() / in_steps.sample_stride() > SAMPLE_LIMIT {
            return Err(Problem::at(
                self.place("sample_every"),
                "too many samples in a run",
                format!("at most {SAMPLE_LIMIT}: sample less often"),
            ));
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
    fn check_averages(&self, problems: &mut Vec<Problem>) {
        if !self.segments.is_empty() {
            let every = self.protocol.sample_every;
            let short = |one: &&WrittenSegment| every > one.segment.strain - one.segment.discard;
            problems.extend(self.segments.iter().find(short).map(|one| {
                let kept = one.segment.strain - one.segment.discard;
                Problem::at(
                    self.place("sample_every"),
                    format!("`sample_every` = {every} may give a segment no sample"),
                    format!("at most {kept}, the strain of the segment that is averaged"),
                )
                .also(&one.place, "this segment")
            }));
            return;
        }
        let p = &self.protocol;
        let samples = p.strain / p.sample_every;
        if p.discard == Discard::Auto && samples < MIN_SAMPLES {
            problems.push(
                Problem::at(
                    self.place("discard"),
                    format!("`discard` = \"auto\" needs more than {samples:.0} samples of a run"),
                    format!("at least {MIN_SAMPLES}: sample more often, or write a strain"),
                )
                .also(self.place("sample_every"), "the strain between samples"),
            );
        }
        // MSER-5 discards at most half.
        let discard = match p.discard {
            Discard::Strain(strain) => strain,
            Discard::Auto => 0.5 * p.strain,
        };
        if discard >= p.strain {
            problems.push(
                Problem::at(
                    self.place("discard"),
                    format!(
                        "`discard` = {discard} leaves nothing to average of a run of strain {}",
                        p.strain
                    ),
                    format!("`discard` is from 0 to below {}, or \"auto\"", p.strain),
                )
                .also(self.place("strain"), "the length of a run"),
            );
        } else if p.sample_every > p.strain - discard {
            problems.push(Problem::at(
                self.place("sample_every"),
                format!(
                    "`sample_every` = {} may give no sample after the discarded strain",
                    p.sample_every
                ),
                format!("at most {}", p.strain - discard),
            ));
        }
    }
}
