//! Reads and checks the segments of a protocol, `[[protocol.segment]]`.

use super::axis_values::{FLOW, flow};
use super::error::Problem;
use super::reader::{Located, Reader, Values};
use crate::data::Value;
use crate::model::axes::Axis;
use crate::model::protocol::PlannedSegment;
use sd_core::model::{CrossShear, Form, Range, Segment};
use std::ops;
use toml::Spanned;

/// The key of the segments.
pub(super) const SEGMENT: &str = "segment";
/// Their name in the file.
const NAME: &str = "[[protocol.segment]]";
/// Allowed numbers of segments.
const SEGMENT_LIMIT: usize = 1000;
/// Allowed lengths, as strains.
pub(super) const LENGTH: Range = Range::above_to(0.0, 1e7);
/// Strains that may be discarded.
pub(super) const DISCARDED: Range = Range::from_to(0.0, 1e7);
/// Angular frequencies of a cross shear, over the rate of the primary shear.
const RATIO: Range = Range::above_to(0.0, 1e7);
/// Allowed numbers of cycles.
const CYCLES: Range = Range::from_to(1.0, 1e6);
/// The meaning of a length.
const STRAIN: &str = " (a strain)";

/// A segment and the tables of its values.
pub(super) struct WrittenSegment<'t> {
    pub(super) segment: PlannedSegment,
    pub(super) table: Reader<'t>,
    oscillation: Option<Reader<'t>>,
    cross_shear: Option<Reader<'t>>,
}

impl<'t> WrittenSegment<'t> {
    /// Reads a segment, which begins at a strain.
    fn read(table: Reader<'t>, start: f64) -> Self {
        let strain = table.number("strain", &LENGTH, STRAIN);
        let discard = table.number("discard", &DISCARDED, STRAIN);
        let [direction, shear_rate, shear_stress] =
            ["direction", "shear_rate", "shear_stress"].map(|key| imposed(&table, key));
        let flow = table
            .get(FLOW)
            .and_then(|written| table.faults.ok(flow(written)));
        let known = ["amplitude", "cycles", "average_last"];
        let example = "{ amplitude = 0.5, cycles = 6 }";
        let oscillation = table.table("oscillation", "oscillation", &known, example);
        let example = "{ amplitude = 0.05, ratio = 20 }";
        let cross = table.table(
            "cross_shear",
            "cross_shear",
            &["amplitude", "ratio"],
            example,
        );
        if shear_rate.is_some() && shear_stress.is_some() {
            table.faults.push(
                Problem::at(
                    &table.place("shear_stress"),
                    "`shear_rate` and `shear_stress` are both imposed in a segment",
                    "give one of them: the other follows from the viscosity",
                )
                .of_key("shear_stress")
                .also(&table.place("shear_rate"), "and here"),
            );
        }
        let mut written = Self {
            segment: PlannedSegment {
                imposed: Segment {
                    start,
                    flow,
                    direction,
                    shear_rate,
                    shear_stress,
                    amplitude: None,
                    cross_shear: cross.as_ref().and_then(cross_shear),
                },
                strain: strain.unwrap_or(1.0),
                discard: discard.unwrap_or(0.0),
            },
            table,
            oscillation,
            cross_shear: cross,
        };
        if written.oscillation.is_some() {
            written.oscillate();
        } else if written.table.get("oscillation").is_none() {
            let example = "2.0` or `oscillation = { amplitude = 0.5, cycles = 6 }";
            if written.table.need("strain", example).is_some() {
                written.check_averages();
            }
        }
        written
    }

    /// Place of a value of the segment, if it has one.
    fn place_of(&self, key: &str) -> Option<ops::Range<usize>> {
        let (table, key) = match key.strip_prefix("cross_shear.") {
            Some(key) => (self.cross_shear.as_ref()?, key),
            None if key == "amplitude" => (self.oscillation.as_ref()?, key),
            None => (&self.table, key),
        };
        table.get(key).map(Spanned::span)
    }

    /// The rate or stress that it imposes, if any, with its axis.
    fn shear(&self) -> Option<(&'static str, Values)> {
        let imposed = &self.segment.imposed;
        let rate = imposed.shear_rate.map(|value| ("shear_rate", value));
        let stress = imposed.shear_stress.map(|value| ("shear_stress", value));
        let (key, value) = rate.or(stress)?;
        let span = self.table.place(key);
        let value = Value::Number(value);
        let all = vec![Located {
            value,
            span: span.clone(),
        }];
        Some((key, Values { all, span }))
    }

    /// Sets the length and the averages of an oscillation.
    fn oscillate(&mut self) {
        let faults = self.table.faults;
        for (key, instead) in [
            (
                "strain",
                "`cycles`, each with 4 times the amplitude of strain",
            ),
            ("discard", "`average_last`, a number of cycles"),
        ] {
            if let Some(place) = self.place_of(key) {
                let problem = format!("`{key}` has no meaning in an oscillation");
                let allowed = format!("in `oscillation`: {instead}");
                faults.push(Problem::at(&place, problem, allowed).of_key(key));
            }
        }
        let Some(table) = &self.oscillation else {
            return;
        };
        table.need("amplitude", "0.5");
        table.need("cycles", "6");
        let count = |key| {
            let count = table.whole(key, &CYCLES, " (cycles)");
            count.map(|cycles| cycles as f64)
        };
        let amplitude = table.number("amplitude", &LENGTH, STRAIN);
        let (cycles, averaged) = (count("cycles"), count("average_last"));
        let (Some(amplitude), Some(cycles)) = (amplitude, cycles) else {
            return;
        };
        // The first cycle differs from those that follow.
        let averaged = averaged.unwrap_or((cycles - 1.0).max(1.0));
        if averaged > cycles {
            let problem = format!("`average_last` = {averaged} of {cycles} cycles");
            let allowed = format!("`average_last` is a whole number from 1 to {cycles}");
            let place = table.place("average_last");
            faults.push(Problem::at(&place, problem, allowed).of_key("average_last"));
        }
        let cycle = 4.0 * amplitude;
        self.segment.imposed.amplitude = Some(amplitude);
        self.segment.strain = cycle * cycles;
        self.segment.discard = cycle * (cycles - averaged);
    }

    /// Refuses a segment without averages.
    fn check_averages(&self) {
        let PlannedSegment {
            strain, discard, ..
        } = self.segment;
        if discard >= strain && self.table.is_whole() {
            let problem = format!(
                "`discard` = {discard} leaves nothing to average of a segment of strain {strain}"
            );
            let allowed = format!("`discard` is from 0 to below {strain}");
            self.table.faults.push(
                Problem::at(&self.table.place("discard"), problem, allowed)
                    .of_key("discard")
                    .also(&self.table.place("strain"), "the length of the segment"),
            );
        }
    }

    /// Strains that must be multiples of the step, each with its key and its place.
    pub(super) fn lengths(&self) -> impl Iterator<Item = (&'static str, f64, ops::Range<usize>)> {
        let amplitude = self.segment.imposed.amplitude;
        let strain = amplitude.is_none().then_some(self.segment.strain);
        let all = [("strain", strain), ("amplitude", amplitude)].into_iter();
        all.filter_map(|(key, length)| Some((key, length?, self.place_of(key)?)))
    }

    /// A problem of parameters in this segment, at its value; else the fault is in a value of the
    /// grid.
    pub(super) fn problem(&self, mut problem: Problem) -> Problem {
        let key = problem.about.key.as_deref();
        match key.and_then(|key| self.place_of(key)) {
            Some(place) => {
                problem.labels.clear();
                problem.also(&place, "here")
            }
            None => problem,
        }
    }
}

/// Reads the segments of a protocol.
pub(super) fn read<'t>(protocol: &Reader<'t>) -> Vec<WrittenSegment<'t>> {
    let known = [
        "strain",
        FLOW,
        "direction",
        "shear_rate",
        "shear_stress",
        "discard",
        "oscillation",
        "cross_shear",
    ];
    let tables = protocol.tables(SEGMENT, NAME);
    if tables.len() > SEGMENT_LIMIT {
        let problem = format!("a protocol of {} segments", tables.len());
        let allowed = format!("1 to {SEGMENT_LIMIT} tables {NAME}, or none of the key");
        let place = protocol.place(SEGMENT);
        protocol.faults.push(Problem::at(&place, problem, allowed));
        return Vec::new();
    }
    let mut start = 0.0;
    let segment = |(span, entries)| {
        let table = Reader::new(entries, span, NAME, &known, protocol.faults);
        let segment = WrittenSegment::read(table, start);
        start = segment.segment.end();
        segment
    };
    tables.into_iter().map(segment).collect()
}

/// The rate or stress of the first segment, for grids where each segment names its own.
pub(super) fn shear(segments: &[WrittenSegment<'_>]) -> Option<(&'static str, Values)> {
    let each = segments.iter().map(WrittenSegment::shear);
    each.collect::<Option<Vec<_>>>()?.into_iter().next()
}

/// A value of an axis in a segment.
fn imposed(table: &Reader<'_>, key: &str) -> Option<f64> {
    match &Axis::of_key(key)?.form {
        Form::Number(of) => {
            let note = of.quantity.allowed();
            let range = &of.quantity.range;
            let read = super::reader::number(table.get(key)?, key, range, &note);
            table.faults.ok(read)
        }
        Form::Choice(_) => None,
    }
}

/// Reads a cross shear.
fn cross_shear(table: &Reader<'_>) -> Option<CrossShear> {
    table.need("amplitude", "0.05");
    table.need("ratio", "20");
    let unit = " (angular frequency over the rate of the primary shear)";
    let amplitude = table.number("amplitude", &LENGTH, STRAIN);
    let ratio = table.number("ratio", &RATIO, unit);
    let (amplitude, ratio) = (amplitude?, ratio?);
    Some(CrossShear { amplitude, ratio })
}
