//! Results of each segment of the runs of a campaign, point by point.

use super::error::ReportError;
use super::figure::{Curve, CurveKind, Origin, draw_curves, mean_trace};
use super::points::{Point, Report, shown};
use super::selection::Selection;
use super::sheet::{Shape, Sheet, SheetColumn, View};
use super::table::{TableOf, axis_table};
use super::units::Units;
use crate::data::{Cell, DataColumn, Object, Value};
use crate::measure::segments::{Cycle, RunSegment};
use crate::measure::{Estimate, Trend};
use crate::model::axes::{AXES, Axis};
use crate::model::protocol::PlannedSegment;
use crate::store::Store;
use crate::text::format::{counted, short};
use serde_json::{Value as Json, json};

/// The segments of the runs of a campaign.
#[derive(Debug)]
pub struct SegmentReport {
    /// Its points.
    report: Report,
    segments: Vec<PlannedSegment>,
    /// Each segment of each point with averaged runs.
    rows: Vec<Row>,
    /// The points of these rows, each with the rate or stress of its segment.
    points: Vec<Point>,
}

/// A segment of a point: indices of the point and of the segment, and results of the runs.
type Row = (usize, usize, PointSegment);

/// The point at which a run would be in steady shear under one of its segments, by its number from
/// 0, with the viscosity there.
fn point_of(point: &Point, number: usize, viscosity: Option<Estimate>) -> Point {
    Point {
        params: shown(&point.params, number + 1),
        viscosity,
        ..point.clone()
    }
}

/// A segment of the runs of a point.
#[derive(Debug)]
struct PointSegment {
    runs: u64,
    /// Of these, runs that have recovered after a reversal.
    recovered: Option<u64>,
    /// How they change over the segment, if they are not in steady state.
    trend: Option<Trend>,
    /// In the order of [`NUMBERS`].
    numbers: Vec<Option<Estimate>>,
    /// Cycle by cycle of an oscillation, in the order of [`OF_CYCLES`].
    cycles: Vec<[Option<Estimate>; 4]>,
    /// Strain since its start, and viscosity.
    trace: Vec<(f64, Estimate)>,
}

/// A number of a segment: its name, its heading, the rank at which it is dropped on a narrow
/// terminal, its unit, and its meaning.
type Number = (
    &'static str,
    &'static str,
    u8,
    &'static str,
    &'static str,
    OfSegment,
);
type OfSegment = fn(&RunSegment) -> Option<f64>;

/// A number of a segment as planned.
type OfPlanned = fn(&PlannedSegment) -> Option<f64>;

/// All of them.
#[rustfmt::skip]
const NUMBERS: [Number; 10] = [
    ("viscosity", "viscosity", 0, "mu", "relative viscosity over what is kept of the segment", |s| s.number("viscosity")),
    ("viscosity_stresslet", "stresslet\nviscosity", 2, "mu", "the same without contact stress", |s| s.number("viscosity_stresslet")),
    ("normal_stress_difference", "N1", 3, "mu rate", "first normal stress difference; in an oscillation its mean over that of the absolute rate", |s| s.number("normal_stress_difference")),
    ("contacts_per_sphere", "contacts\n/ N", 3, "1", "pairs in contact per sphere", |s| s.number("contacts_per_sphere")),
    ("reversal_ratio", "η after /\nbefore", 1, "1",
        "viscosity in the first sample after a reversal over its mean before", |s| Some(s.reversal?.ratio)),
    ("recovery_strain", "strain to\nrecover half", 1, "1",
        "strain after which half of the drop at a reversal has recovered; mean over the runs that have recovered it", recovery),
    ("eta_prime", "η′", 0, "mu", "viscous part of the first harmonic of an oscillation", |s| Some(s.oscillation()?.viscosity[0])),
    ("eta_double_prime", "η″", 0, "mu", "elastic part of the first harmonic of an oscillation: G′/ω", |s| Some(s.oscillation()?.viscosity[1])),
    ("third_harmonic", "3rd/1st\nharmonic", 1, "1", "third over first harmonic of the stress", |s| Some(s.oscillation()?.third_over_first())),
    ("yield_strain", "yield\nstrain", 1, "1",
        "strain after a turning point at which the viscosity has risen half way from its minimum to its maximum of the half cycle; \
         none unless it rises by a tenth in every run, and where its interval reaches 0",
        |s| s.oscillation()?.yield_strain),
];

/// Whether a column of axes has the shear of the segment in its row.
fn is_of_segment(name: &str) -> bool {
    Axis::of_key(name).is_some_and(Axis::is_of_shear)
}

/// The recovery strain, the only number that averages leave out where a run does not have it.
fn recovery(segment: &RunSegment) -> Option<f64> {
    segment.reversal?.recovery_strain
}

/// A number of one cycle.
type OfCycle = fn(&Cycle) -> Option<f64>;

/// Numbers of single cycles: name and value.
const OF_CYCLES: [(&str, OfCycle); 4] = [
    ("eta_prime", |cycle| Some(cycle.viscosity[0])),
    ("eta_double_prime", |cycle| Some(cycle.viscosity[1])),
    ("third_harmonic", |cycle| Some(cycle.third_over_first())),
    ("yield_strain", |cycle| cycle.yield_strain),
];

/// Mean over runs; `None` unless all of them have a finite value.
fn over_runs(runs: &[RunSegment], of: impl Fn(&RunSegment) -> Option<f64>) -> Option<Estimate> {
    let values = runs.iter().map(|run| of(run).filter(|v| v.is_finite()));
    Estimate::of(&values.collect::<Option<Vec<f64>>>()?)
}

impl PointSegment {
    /// Averages the runs of a point.
    fn of(runs: &[RunSegment]) -> Self {
        let cycles = runs.iter().map(|run| run.cycles.len()).min().unwrap_or(0);
        let of_cycle = |cycle: usize| {
            OF_CYCLES.map(|(_, of)| over_runs(runs, |run| of(run.cycles.get(cycle)?)))
        };
        let recovered = runs.iter().filter(|run| recovery(run).is_some());
        let recovered: Vec<RunSegment> = recovered.cloned().collect();
        let is_reversed = runs.iter().any(|run| run.reversal.is_some());
        let number = |number: &Number| match number.0 {
            "recovery_strain" => over_runs(&recovered, number.5),
            "yield_strain" => {
                let found = over_runs(runs, number.5);
                found.filter(|strain| strain.ci95.is_none_or(|half| half < strain.mean))
            }
            _ => over_runs(runs, number.5),
        };
        Self {
            runs: runs.len() as u64,
            recovered: is_reversed.then_some(recovered.len() as u64),
            trend: RunSegment::trend(runs),
            numbers: NUMBERS.iter().map(number).collect(),
            cycles: (0..cycles).map(of_cycle).collect(),
            trace: mean_trace(runs.iter().map(|run| run.trace.clone())),
        }
    }
}

impl SegmentReport {
    /// Reads the points selected.
    ///
    /// # Errors
    /// An I/O or SQLite error; [`ReportError::Argument`] on a selection that no point meets, a
    /// campaign without segments, and no finished run.
    pub fn of(store: &Store, selection: &Selection) -> Result<Self, ReportError> {
        let (report, runs, places) = Report::with_runs(store, selection)?;
        let segments = store.protocol()?.segments;
        if segments.is_empty() {
            return Err(ReportError::Refused(
                "the campaign has no segments: [[protocol.segment]] in its file defines them, see docs/protocols.md".into(),
            ));
        }
        let mut of_segments = vec![Vec::new(); report.points.len() * segments.len()];
        for (run, place) in runs.iter().zip(places) {
            if !selection.averages(run) {
                continue;
            }
            let samples = store.samples(&run.key)?;
            for number in 0..segments.len() {
                let of_run = RunSegment::of(&run.params, &segments, number, &samples);
                of_segments[place * segments.len() + number].extend(of_run);
            }
        }
        let rows = of_segments.iter().enumerate().filter(|of| !of.1.is_empty());
        let rows = rows.map(|(place, runs): (usize, &Vec<RunSegment>)| {
            let (point, number) = (place / segments.len(), place % segments.len());
            (point, number, PointSegment::of(runs))
        });
        let rows: Vec<Row> = rows.collect();
        if rows.is_empty() {
            return Err(ReportError::Refused(
                "no run of these points is finished without doubtful numbers".into(),
            ));
        }
        let points = rows.iter().map(|(place, number, of)| {
            let viscosity = NUMBERS.iter().position(|number| number.0 == "viscosity");
            let viscosity = viscosity.and_then(|viscosity| of.numbers[viscosity]);
            point_of(&report.points[*place], *number, viscosity)
        });
        Ok(Self {
            points: points.collect(),
            report,
            segments,
            rows,
        })
    }

    fn points(&self) -> impl Iterator<Item = &Point> + Clone {
        self.points.iter()
    }

    /// The table for people, for a terminal of this width.
    pub(crate) fn sheet(&self, shape: Shape, width: Option<u16>) -> Sheet {
        let words = |name, rank, text: &dyn Fn(usize, &PlannedSegment) -> String| {
            let cells = self
                .rows
                .iter()
                .map(|row| Some(text(row.1, &self.segments[row.1])));
            SheetColumn::of_words(name, rank, cells.collect())
        };
        let mut words = vec![
            words("segment", 0, &|number, segment| {
                format!("{} {}", number + 1, segment.imposed_words())
            }),
            words("strain", 1, &|_, segment| {
                let ends = [segment.kept_from(), segment.end()];
                ends.map(|strain| short(strain, 6)).join(" to ")
            }),
        ];
        let trends = self.rows.iter().map(|row| row.2.trend);
        words.extend(SheetColumn::of_trends(trends));
        let mut views: Vec<View<'_>> = vec![("runs", "runs", 3, 2)];
        for (name, heading, rank, ..) in NUMBERS {
            views.push((name, heading, 3, rank));
            if name == "recovery_strain" {
                views.push(("recovered", "runs that\nrecovered", 3, 1));
            }
        }
        let table = self.table();
        let of = (table.as_slice(), views.as_slice());
        Sheet::of_rows(&self.report, &self.points(), words, of, shape).shaped(shape, width)
    }

    /// The report with its tables in these units.
    #[must_use]
    pub fn with_units(mut self, units: Units) -> Self {
        self.report.units = units;
        self
    }

    /// The points with runs, by index in the report.
    fn places(&self) -> Vec<usize> {
        let mut places: Vec<usize> = self.rows.iter().map(|row| row.0).collect();
        places.dedup();
        places
    }

    /// Name of the campaign, number of its segments, and number of points with runs.
    pub fn summary(&self) -> String {
        let (segments, points) = (self.segments.len(), self.places().len());
        let campaign = &self.report.campaign;
        format!(
            "{campaign}: {} at {}",
            counted(segments, "segment"),
            counted(points, "point")
        )
    }

    /// The object for programs, a stable interface.
    pub fn json(&self) -> Json {
        let table = self.table_in(Units::default());
        let (axes, numbers) = table.split_at(AXES.len());
        let mut points: Vec<Json> = Vec::new();
        let mut last = None;
        for (row, (place, _, of)) in self.rows.iter().enumerate() {
            let is_of_point = |axis: &&DataColumn| !is_of_segment(axis.name.as_ref());
            if last.replace(*place) != Some(*place) {
                let axes = axes.iter().filter(is_of_point).cloned();
                let mut point = json!(Object(&axes.collect::<Vec<_>>(), row));
                point["segments"] = json!([]);
                points.push(point);
            }
            // In the object of a segment, its own values need no prefix.
            let shear = axes.iter().filter(|axis| !is_of_point(axis));
            let own = numbers.iter().chain(shear).map(|column| {
                let name = column.name.as_ref();
                let name = name.strip_prefix("segment_").unwrap_or(name);
                (name.to_owned(), json!(Cell(&column.cells, row)))
            });
            let mut object = Json::Object(own.collect());
            let value = |number: Option<f64>| json!(number.map(Value::Number));
            let cycles = of.cycles.iter().map(|cycle| {
                let mut object = json!({});
                for ((name, _), estimate) in OF_CYCLES.iter().zip(cycle) {
                    object[*name] = value(estimate.map(|e| e.mean));
                    object[format!("{name}_ci95")] = value(estimate.and_then(|e| e.ci95));
                }
                object
            });
            object["cycles"] = cycles.collect();
            let trace = |of: fn(&(f64, Estimate)) -> Option<f64>| -> Vec<Option<Value>> {
                let values = self.rows[row].2.trace.iter().map(of);
                values.map(|value| value.map(Value::Number)).collect()
            };
            object["trace"] = json!({
                "strain": trace(|spot| Some(spot.0)), "viscosity": trace(|spot| Some(spot.1.mean)),
                "viscosity_ci95": trace(|spot| spot.1.ci95),
            });
            if let Some(segments) = points.last_mut().and_then(|p| p["segments"].as_array_mut()) {
                segments.push(object);
            }
        }
        json!({ "campaign": self.report.campaign, "points": points })
    }

    /// One row per segment of each point: all axes, the segment, numbers and their intervals.
    pub fn table(&self) -> Vec<DataColumn> {
        self.table_in(self.report.units)
    }

    /// Its columns in some units.
    fn table_in(&self, units: Units) -> Vec<DataColumn> {
        let mut table = TableOf {
            columns: axis_table(&self.points()),
            rows: &self.rows,
        };
        table.count("segment", "number of the segment, from 1", |row| {
            Some(row.1 as u64 + 1)
        });
        // `start` is the name of an axis.
        #[rustfmt::skip]
        let of_segments: [(&str, &str, OfPlanned); 5] = [
            ("segment_start", "strain of the run at its start", |s| Some(s.imposed.start)),
            ("kept_from", "strain of the run at which its averages start", |s| Some(s.kept_from())),
            ("end", "strain of the run at its end", |s| Some(s.end())),
            ("segment_direction", "sense of its shear, if it has its own", |s| s.imposed.direction),
            ("amplitude", "amplitude of its oscillation", |s| s.imposed.amplitude),
        ];
        for (name, meaning, of) in of_segments {
            table.number(name, meaning, |row| of(&self.segments[row.1]));
        }
        table.count("runs", "runs averaged", |row| Some(row.2.runs));
        let meaning = "of these, runs that have recovered half of the drop at a reversal";
        table.count("recovered", meaning, |row| row.2.recovered);
        for (k, (name, _, _, _, meaning, _)) in NUMBERS.into_iter().enumerate() {
            table.estimate(name, meaning, |row| row.2.numbers[k]);
        }
        for (name, trend, meaning) in [
            (
                "not_steady",
                Trend::NotSteady,
                "1 if the viscosity drifts over the segment or remembers its start, order falls, or the fraction under an imposed pressure drifts",
            ),
            (
                "ordering",
                Trend::Ordering,
                "1 if order rises over the segment",
            ),
        ] {
            table.count(name, meaning, |row| {
                Some((row.2.trend == Some(trend)).into())
            });
        }
        for column in &mut table.columns {
            let name = column.name.strip_suffix("_ci95").unwrap_or(&column.name);
            if let Some(number) = NUMBERS.iter().find(|number| number.0 == name) {
                column.unit = number.3;
            }
            units.convert(column, self.points().map(Point::at));
        }
        table.columns
    }

    /// Draws η′ and η″ of every point against the amplitude of its oscillations.
    ///
    /// # Errors
    /// [`ReportError::Argument`] without two oscillations, or with more points than a figure holds.
    pub fn draw(&self) -> Result<String, ReportError> {
        let amplitudes = self.segments.iter().filter_map(|s| s.imposed.amplitude);
        if amplitudes.count() < 2 {
            return Err(ReportError::argument(
                "figure",
                "η′ and η″ are drawn against the amplitude of at least two oscillations; for the viscosity in time write `sweep report FILE \
                 --segment NUMBER --figure NAME --kind trace`",
            ));
        }
        let places = self.places();
        let params = places
            .iter()
            .map(|place| &self.report.points[*place].params);
        let labels = self.report.labels(params);
        let mut curves = Vec::new();
        for (label, place) in labels.iter().zip(&places) {
            let drawn = NUMBERS.iter().enumerate();
            for (k, number) in drawn.filter(|(_, number)| number.0.starts_with("eta_")) {
                let own = self.rows.iter().filter(|row| row.0 == *place);
                let spot = |(_, segment, of): &Row| {
                    let amplitude = self.segments[*segment].imposed.amplitude?;
                    Some(((amplitude, of.numbers[k]?), of.trend))
                };
                let mut spots: Vec<_> = own.filter_map(spot).collect();
                spots.sort_by(|(a, _), (b, _)| a.0.total_cmp(&b.0));
                let (spots, trends): (Vec<(f64, Estimate)>, Vec<_>) = spots.into_iter().unzip();
                let (label, kind) = (label.with(number.1), CurveKind::Markers);
                let curve = Curve::of_values(&label, spots.into_iter(), kind, curves.len());
                curves.push(curve.marked(&trends));
            }
        }
        let origin = Origin::of(&self.report);
        draw_curves(curves, ["amplitude γ₀", "η′, η″ (μ)"], [false; 2], &origin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::segments::Reversal;

    #[test]
    fn the_recovery_strain_is_that_of_the_runs_that_have_recovered() {
        let run = |reversal: Option<Option<f64>>| RunSegment {
            numbers: Vec::new(),
            parts: None,
            order: [None; 2],
            fraction_drift: None,
            trace: Vec::new(),
            reversal: reversal.map(|recovery_strain| Reversal {
                ratio: 0.4,
                recovery_strain,
            }),
            cycles: Vec::new(),
            averaged_cycles: 0,
        };
        let number = |of: &PointSegment, name: &str| {
            let place = NUMBERS.iter().position(|number| number.0 == name);
            of.numbers[place.unwrap()].map(|estimate| estimate.mean)
        };
        let runs = [Some(Some(1.0)), Some(None), Some(Some(2.0))].map(run);
        let of = PointSegment::of(&runs);
        assert_eq!((of.runs, of.recovered), (3, Some(2)));
        assert_eq!(number(&of, "recovery_strain"), Some(1.5));
        assert!((number(&of, "reversal_ratio").unwrap() - 0.4).abs() < 1e-12);
        let none = PointSegment::of(&[run(Some(None))]);
        assert_eq!(none.recovered, Some(0));
        assert_eq!(number(&none, "recovery_strain"), None);
        // Without a reversal there is nothing to recover from.
        assert_eq!(PointSegment::of(&[run(None)]).recovered, None);
    }
}
