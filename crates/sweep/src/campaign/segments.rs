//! Reads and checks the segments of a protocol, `[[protocol.segment]]`.

use super::error::Problem;
use super::protocol::{DISCARDED, LENGTH};
use super::reader::{Located, Table, Values, number, whole, wrong_type};
use crate::data::Value;
use crate::model::axes::Axis;
use crate::model::protocol::PlannedSegment;
use sd_core::model::{CrossShear, Form, Range, Segment};
use std::ops;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The key of the segments.
pub(super) const SEGMENT: &str = "segment";
/// Allowed numbers of segments.
const SEGMENT_LIMIT: usize = 1000;
/// Angular frequencies of a cross shear, over the rate of the primary shear.
const RATIO: Range = Range::above_to(0.0, 1e7);
/// Allowed numbers of cycles.
const CYCLES: Range = Range::from_to(1.0, 1e6);

/// A segment and the places of its values.
pub(super) struct WrittenSegment {
    pub(super) segment: PlannedSegment,
    pub(super) place: ops::Range<usize>,
    places: Vec<(&'static str, ops::Range<usize>)>,
}

impl WrittenSegment {
    /// Place of a value, or of its table.
    fn place_of(&self, key: &str) -> &ops::Range<usize> {
        let found = self.places.iter().find(|(name, _)| *name == key);
        found.map_or(&self.place, |(_, place)| place)
    }

    /// The rate or stress that it imposes, if any, with its axis.
    fn shear(&self) -> Option<(&'static str, Values)> {
        let imposed = &self.segment.imposed;
        let named = [
            ("shear_rate", imposed.shear_rate),
            ("shear_stress", imposed.shear_stress),
        ];
        let (key, value) = named
            .into_iter()
            .find_map(|(key, value)| Some((key, value?)))?;
        let span = self.place_of(key).clone();
        let all = vec![Located {
            value: Value::Number(value),
            span: span.clone(),
        }];
        Some((key, Values { all, span }))
    }

    /// Sets the oscillation of the table.
    fn oscillate(&mut self, oscillation: Oscillation, problems: &mut Vec<Problem>) {
        for (key, instead) in [
            (
                "strain",
                "`cycles`, each with 4 times the amplitude of strain",
            ),
            ("discard", "`average_last`, a number of cycles"),
        ] {
            if self.places.iter().any(|(name, _)| *name == key) {
                problems.push(
                    Problem::at(
                        self.place_of(key),
                        format!("`{key}` has no meaning in an oscillation"),
                        format!("in `oscillation`: {instead}"),
                    )
                    .of_key(key),
                );
            }
        }
        let cycle = 4.0 * oscillation.amplitude;
        self.segment.imposed.amplitude = Some(oscillation.amplitude);
        self.segment.strain = cycle * oscillation.cycles;
        self.segment.discard = cycle * (oscillation.cycles - oscillation.averaged);
        self.places.push(("amplitude", oscillation.place));
    }

    /// The problem of a segment without averages.
    fn keeps_nothing(&self) -> Option<Problem> {
        let PlannedSegment {
            strain, discard, ..
        } = self.segment;
        (discard >= strain).then(|| {
            Problem::at(
                self.place_of("discard"),
                format!("`discard` = {discard} leaves nothing to average of a segment of strain {strain}"),
                format!("`discard` is from 0 to below {strain}"),
            )
            .of_key("discard")
            .also(self.place_of("strain"), "the length of the segment")
        })
    }

    /// Strains that must be multiples of the step, each with its key and its place.
    pub(super) fn lengths(&self) -> impl Iterator<Item = (&'static str, f64, &ops::Range<usize>)> {
        self.places.iter().filter_map(|(key, place)| match *key {
            "strain" => Some((*key, self.segment.strain, place)),
            "amplitude" => Some((*key, self.segment.imposed.amplitude?, place)),
            _ => None,
        })
    }

    /// A problem of parameters in this segment, at its value.
    pub(super) fn problem(&self, mut problem: Problem) -> Problem {
        let key = problem.about.key.clone().unwrap_or_default();
        match self.places.iter().find(|(name, _)| *name == key) {
            Some((_, place)) => {
                problem.labels.clear();
                problem.also(place, "here")
            }
            // The fault is in a value of the grid.
            None => problem,
        }
    }
}

/// State of reading a segment.
struct Reader<'t, 'p> {
    table: Table<'t>,
    places: Vec<(&'static str, ops::Range<usize>)>,
    problems: &'p mut Vec<Problem>,
}

impl<'t> Reader<'t, '_> {
    fn get(&mut self, key: &'static str) -> Option<&'t Spanned<DeValue<'t>>> {
        let written = self.table.get(key)?;
        self.places.push((key, written.span()));
        Some(written)
    }

    fn strain(&mut self, key: &'static str, range: &Range) -> Option<f64> {
        let written = self.get(key)?;
        let read = number(written, key, range, &format!("{range} (a strain)"));
        read.map_err(|problem| self.problems.push(problem)).ok()
    }

    /// A value of an axis in a segment.
    fn imposed(&mut self, key: &'static str) -> Option<f64> {
        let written = self.get(key)?;
        let Form::Number(of) = &Axis::of_key(key)?.form else {
            return None;
        };
        let read = number(written, key, &of.quantity.range, &of.quantity.allowed());
        read.map_err(|problem| self.problems.push(problem)).ok()
    }
}

/// The rate or stress of the first segment, for grids where each segment names its own.
pub(super) fn shear(segments: &[WrittenSegment]) -> Option<(&'static str, Values)> {
    let each = segments.iter().map(WrittenSegment::shear);
    each.collect::<Option<Vec<_>>>()?.into_iter().next()
}

/// Reads the segments of a protocol.
pub(super) fn read(
    written: &Spanned<DeValue<'_>>,
    problems: &mut Vec<Problem>,
) -> Vec<WrittenSegment> {
    let DeValue::Array(tables) = written.get_ref() else {
        let allowed = "write tables: [[protocol.segment]]";
        problems.push(wrong_type(written, SEGMENT, allowed));
        return Vec::new();
    };
    if tables.is_empty() || tables.len() > SEGMENT_LIMIT {
        problems.push(Problem::at(
            &written.span(),
            format!("a protocol of {} segments", tables.len()),
            format!("1 to {SEGMENT_LIMIT} tables [[protocol.segment]], or none of the key"),
        ));
        return Vec::new();
    }
    let mut segments = Vec::with_capacity(tables.len());
    let mut start = 0.0;
    for table in tables {
        let DeValue::Table(entries) = table.get_ref() else {
            let allowed = "write tables: [[protocol.segment]]";
            problems.push(wrong_type(table, SEGMENT, allowed));
            continue;
        };
        let segment = read_segment(entries, table.span(), start, problems);
        start = segment.segment.end();
        segments.push(segment);
    }
    segments
}

/// Reads one segment, which begins at a strain.
fn read_segment(
    entries: &DeTable<'_>,
    place: ops::Range<usize>,
    start: f64,
    problems: &mut Vec<Problem>,
) -> WrittenSegment {
    let known = [
        "strain",
        "direction",
        "shear_rate",
        "shear_stress",
        "discard",
        "oscillation",
        "cross_shear",
    ];
    let name = "[[protocol.segment]]";
    let table = Table::new(entries, place.clone(), name, &known, problems);
    let before = problems.len();
    let mut reader = Reader {
        table,
        places: Vec::new(),
        problems,
    };
    let strain = reader.strain("strain", &LENGTH);
    let discard = reader.strain("discard", &DISCARDED);
    let direction = reader.imposed("direction");
    let shear_rate = reader.imposed("shear_rate");
    let shear_stress = reader.imposed("shear_stress");
    let oscillation = reader.get("oscillation").map(oscillation);
    let cross_shear = reader.get("cross_shear").map(cross_shear);
    let Reader {
        table,
        mut places,
        problems,
    } = reader;
    let cross_shear = match cross_shear {
        None => None,
        Some(Ok((cross_shear, at))) => {
            places.extend(at);
            Some(cross_shear)
        }
        Some(Err(mut wrong)) => {
            problems.append(&mut wrong);
            None
        }
    };
    let mut written = WrittenSegment {
        segment: PlannedSegment {
            imposed: Segment {
                start,
                direction,
                shear_rate,
                shear_stress,
                amplitude: None,
                cross_shear,
            },
            strain: strain.unwrap_or(1.0),
            discard: discard.unwrap_or(0.0),
        },
        place,
        places,
    };
    if shear_rate.is_some() && shear_stress.is_some() {
        problems.push(
            Problem::at(
                written.place_of("shear_stress"),
                "`shear_rate` and `shear_stress` are both imposed in a segment",
                "give one of them: the other follows from the viscosity",
            )
            .of_key("shear_stress")
            .also(written.place_of("shear_rate"), "and here"),
        );
    }
    match oscillation {
        Some(Ok(oscillation)) => written.oscillate(oscillation, problems),
        Some(Err(mut wrong)) => problems.append(&mut wrong),
        None if strain.is_none() && problems.len() == before => problems.extend(table.missing(
            "strain",
            "2.0` or `oscillation = { amplitude = 0.5, cycles = 6 }",
        )),
        None => problems.extend(written.keeps_nothing()),
    }
    written
}

/// A cross shear and the places of its values.
type WrittenCrossShear = (CrossShear, [(&'static str, ops::Range<usize>); 2]);

/// Reads the table of a cross shear.
fn cross_shear(written: &Spanned<DeValue<'_>>) -> Result<WrittenCrossShear, Vec<Problem>> {
    let DeValue::Table(entries) = written.get_ref() else {
        let allowed = "write a table: { amplitude = 0.05, ratio = 20 }";
        return Err(vec![wrong_type(written, "cross_shear", allowed)]);
    };
    let mut problems = Vec::new();
    let known = ["amplitude", "ratio"];
    let table = Table::new(
        entries,
        written.span(),
        "cross_shear",
        &known,
        &mut problems,
    );
    let mut read = |key: &'static str, range: &Range, unit: &str, example: &str| {
        let Some(written) = table.get(key) else {
            problems.extend(table.missing(key, example));
            return None;
        };
        let read = number(written, key, range, &format!("{range} ({unit})"));
        let value = read.map_err(|problem| problems.push(problem)).ok()?;
        Some((value, written.span()))
    };
    let amplitude = read("amplitude", &LENGTH, "a strain", "0.05");
    let unit = "angular frequency over the rate of the primary shear";
    let ratio = read("ratio", &RATIO, unit, "20");
    match (amplitude, ratio) {
        (Some((amplitude, at)), Some((ratio, at_ratio))) if problems.is_empty() => Ok((
            CrossShear { amplitude, ratio },
            [
                ("cross_shear.amplitude", at),
                ("cross_shear.ratio", at_ratio),
            ],
        )),
        _ => Err(problems),
    }
}

/// An oscillation in the file.
struct Oscillation {
    amplitude: f64,
    cycles: f64,
    /// Number of last cycles that are averaged.
    averaged: f64,
    place: ops::Range<usize>,
}

/// Reads the table of an oscillation.
fn oscillation(written: &Spanned<DeValue<'_>>) -> Result<Oscillation, Vec<Problem>> {
    let DeValue::Table(entries) = written.get_ref() else {
        let allowed = "write a table: { amplitude = 0.5, cycles = 6 }";
        return Err(vec![wrong_type(written, "oscillation", allowed)]);
    };
    let mut problems = Vec::new();
    let known = ["amplitude", "cycles", "average_last"];
    let table = Table::new(
        entries,
        written.span(),
        "oscillation",
        &known,
        &mut problems,
    );
    let mut read = |key: &'static str, example: &str| {
        let Some(written) = table.get(key) else {
            problems.extend(table.missing(key, example));
            return None;
        };
        let read = if key == "amplitude" {
            number(written, key, &LENGTH, &format!("{LENGTH} (a strain)"))
        } else {
            let allowed = format!("{CYCLES} (cycles)");
            whole(written, key, &CYCLES, &allowed).map(|cycles| cycles as f64)
        };
        read.map_err(|problem| problems.push(problem)).ok()
    };
    let amplitude = read("amplitude", "0.5");
    let cycles = read("cycles", "6");
    let averaged = match table.get("average_last") {
        Some(_) => read("average_last", "3"),
        // The first cycle differs from those that follow.
        None => cycles.map(|cycles| (cycles - 1.0).max(1.0)),
    };
    if let (Some(cycles), Some(averaged), Some(written)) =
        (cycles, averaged, table.get("average_last"))
        && averaged > cycles
    {
        problems.push(
            Problem::at(
                &written.span(),
                format!("`average_last` = {averaged} of {cycles} cycles"),
                format!("`average_last` is a whole number from 1 to {cycles}"),
            )
            .of_key("average_last"),
        );
    }
    match (amplitude, cycles, averaged, table.get("amplitude")) {
        (Some(amplitude), Some(cycles), Some(averaged), Some(written)) if problems.is_empty() => {
            Ok(Oscillation {
                amplitude,
                cycles,
                averaged,
                place: written.span(),
            })
        }
        _ => Err(problems),
    }
}
