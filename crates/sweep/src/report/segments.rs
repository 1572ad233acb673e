//! Results of each segment of the runs of a campaign, point by point.

use super::axis_words::columns_of_axes;
use super::columns::point_row;
use super::curves::{Shared, labels};
use super::error::ReportError;
use super::figure::{GraphForm, MeasuredGraph, Origin, draw_graphs_of, mean_trace};
use super::points::Report;
use super::selection::Selection;
use super::sheet::{Head, NumberFormat, Shape, Sheet, SheetColumn};
use crate::data::DataColumn;
use crate::data::{Kind, Value};
use crate::measure::Estimate;
use crate::measure::segments::{Cycle, RunSegment};
use crate::model::axes::{AXES, Axis};
use crate::model::protocol::PlannedSegment;
use crate::store::Store;
use crate::text::format::{Uncertain, short};
use sd_core::Params;
use serde_json::{Map, Value as Json, json};

/// The segments of the runs of a campaign.
#[derive(Debug)]
pub struct SegmentReport {
    /// Its points.
    report: Report,
    segments: Vec<PlannedSegment>,
    /// Each segment of each point with averaged runs.
    rows: Vec<Row>,
}

/// A segment of a point: indices of the point and of the segment, and results of the runs.
type Row = (usize, usize, PointSegment);

/// A segment of the runs of a point.
#[derive(Debug)]
struct PointSegment {
    runs: u64,
    /// Of these, runs that have recovered after a reversal.
    recovered: Option<u64>,
    /// In the order of [`NUMBERS`].
    numbers: Vec<Option<Estimate>>,
    /// Cycle by cycle of an oscillation, in the order of [`OF_CYCLES`].
    cycles: Vec<[Option<Estimate>; 4]>,
    /// Strain since its start, and viscosity.
    trace: Vec<(f64, Estimate)>,
}

/// A number of a segment.
struct Number {
    name: &'static str,
    heading: &'static str,
    meaning: &'static str,
    /// Rank at which it is dropped on a narrow terminal, the highest first.
    rank: u8,
    of: fn(&RunSegment) -> Option<f64>,
}

/// All of them.
const NUMBERS: [Number; 10] = [
    Number {
        name: "viscosity",
        heading: "viscosity",
        meaning: "relative viscosity over what is kept of the segment",
        rank: 0,
        of: |s| s.number("viscosity"),
    },
    Number {
        name: "viscosity_stresslet",
        heading: "stresslet\nviscosity",
        meaning: "the same without contact stress",
        rank: 2,
        of: |s| s.number("viscosity_stresslet"),
    },
    Number {
        name: "normal_stress_difference",
        heading: "N1",
        meaning: "first normal stress difference, in mu times the rate",
        rank: 3,
        of: |s| s.number("normal_stress_difference"),
    },
    Number {
        name: "contacts_per_sphere",
        heading: "contacts\n/ N",
        meaning: "pairs in contact per sphere",
        rank: 3,
        of: |s| s.number("contacts_per_sphere"),
    },
    Number {
        name: "hydrodynamic_share",
        heading: "left by the\nreversal",
        meaning: "viscosity in the first sample after a reversal over its mean before: the hydrodynamic part",
        rank: 1,
        of: |s| Some(s.reversal?.hydrodynamic_share),
    },
    Number {
        name: "recovery_strain",
        heading: "strain of\nrecovery",
        meaning: "strain after which half of the drop at a reversal has recovered; mean over the runs that have recovered it",
        rank: 1,
        of: recovery,
    },
    Number {
        name: "eta_prime",
        heading: "η′",
        meaning: "viscous part of the first harmonic of an oscillation, in mu",
        rank: 0,
        of: |s| Some(s.oscillation()?.viscosity[0]),
    },
    Number {
        name: "eta_double_prime",
        heading: "η″",
        meaning: "elastic part of the first harmonic of an oscillation, in mu: G′/ω",
        rank: 0,
        of: |s| Some(s.oscillation()?.viscosity[1]),
    },
    Number {
        name: "third_harmonic",
        heading: "3rd/1st\nharmonic",
        meaning: "third over first harmonic of the stress",
        rank: 1,
        of: |s| Some(s.oscillation()?.third_over_first()),
    },
    Number {
        name: "yield_strain",
        heading: "yield\nstrain",
        meaning: "strain after a turning point at which the viscosity has risen half way to its largest value of the half cycle",
        rank: 1,
        of: |s| s.oscillation()?.yield_strain,
    },
];

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
    let values: Option<Vec<f64>> = runs
        .iter()
        .map(|run| of(run).filter(|v| v.is_finite()))
        .collect();
    Estimate::of(&values?)
}

impl PointSegment {
    /// Averages the runs of a point.
    fn of(runs: &[RunSegment]) -> Self {
        let cycles = runs.iter().map(|run| run.cycles.len()).min().unwrap_or(0);
        let of_cycle = |cycle: usize| {
            OF_CYCLES.map(|(_, of)| over_runs(runs, |run| of(run.cycles.get(cycle)?)))
        };
        let recovered: Vec<RunSegment> = runs
            .iter()
            .filter(|run| recovery(run).is_some())
            .cloned()
            .collect();
        let number = |number: &Number| {
            let known = match number.name {
                "recovery_strain" => &recovered,
                _ => runs,
            };
            over_runs(known, |run| (number.of)(run))
        };
        Self {
            runs: runs.len() as u64,
            recovered: runs
                .iter()
                .any(|run| run.reversal.is_some())
                .then_some(recovered.len() as u64),
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
        let mut of_point: Vec<Vec<Vec<RunSegment>>> =
            vec![vec![Vec::new(); segments.len()]; report.points.len()];
        for (run, place) in runs.iter().zip(places) {
            if !selection.averages(run) {
                continue;
            }
            let samples = store.samples(&run.key)?;
            for (number, of_segment) in of_point[place].iter_mut().enumerate() {
                of_segment.extend(RunSegment::of(&run.params, &segments, number, &samples));
            }
        }
        let mut rows = Vec::new();
        for (place, of_segments) in of_point.iter().enumerate() {
            for (number, runs) in of_segments.iter().enumerate() {
                if !runs.is_empty() {
                    rows.push((place, number, PointSegment::of(runs)));
                }
            }
        }
        if rows.is_empty() {
            return Err(ReportError::Refused(
                "no run of these points is finished without doubtful numbers".into(),
            ));
        }
        Ok(Self {
            report,
            segments,
            rows,
        })
    }

    fn params(&self) -> impl Iterator<Item = &Params> + Clone {
        let rows = self.rows.iter();
        rows.map(|(place, ..)| &self.report.points[*place].params)
    }

    /// The table for people, for a terminal of this width.
    pub(crate) fn sheet(&self, shape: Shape, width: Option<u16>) -> Sheet {
        let report = &self.report;
        let column = |head, cells| SheetColumn::new(head, cells, shape.format);
        let axes: Vec<&Axis> = AXES
            .iter()
            .filter(|axis| axis.varies(self.params()))
            .collect();
        let mut columns = columns_of_axes(&axes, report, &self.params(), shape.format);
        let mut add = |name, heading, rank, cell: &dyn Fn(&Row) -> Option<Uncertain>| {
            let cells: Vec<_> = self.rows.iter().map(cell).collect();
            if cells.iter().any(Option::is_some) {
                columns.push(column(Head::new(name, heading, "", rank), cells));
            }
        };
        add("segment", "segment", 0, &|(_, number, _)| {
            Some(Uncertain::Word(
                format!("{} {}", number + 1, self.segments[*number].imposed_words()).into(),
            ))
        });
        add("strain", "strain", 1, &|(_, number, _)| {
            let segment = &self.segments[*number];
            let [from, to] = [segment.kept_from(), segment.end()].map(|strain| short(strain, 6));
            Some(Uncertain::Word(format!("{from} to {to}").into()))
        });
        add("runs", "runs", 2, &|(.., of)| {
            Some(Uncertain::Count(of.runs))
        });
        for (k, number) in NUMBERS.iter().enumerate() {
            add(number.name, number.heading, number.rank, &|(.., of)| {
                let estimate = of.numbers[k]?;
                Some(Uncertain::measured(estimate.mean, estimate.ci95))
            });
            if number.name == "recovery_strain" {
                add("recovered", "runs\nrecovered", 1, &|(.., of)| {
                    of.recovered.map(Uncertain::Count)
                });
            }
        }
        let sheet = Sheet::new(axes.len() + 1, columns, NumberFormat::Plain);
        sheet.shaped(shape, width)
    }

    /// Name of the campaign, number of its segments, and number of points with runs.
    pub fn summary(&self) -> String {
        let mut places: Vec<usize> = self.rows.iter().map(|row| row.0).collect();
        places.dedup();
        format!(
            "{}: {} segments at {} points",
            self.report.campaign,
            self.segments.len(),
            places.len()
        )
    }

    /// The object for programs, a stable interface.
    pub fn json(&self) -> Json {
        let mut points: Vec<Map<String, Json>> = Vec::new();
        let mut last = None;
        for (place, number, of) in &self.rows {
            if last != Some(*place) {
                let mut point = point_row(&self.report.points[*place]);
                point.insert("segments".into(), json!([]));
                points.push(point);
                last = Some(*place);
            }
            let own = points
                .last_mut()
                .and_then(|point| point["segments"].as_array_mut());
            if let Some(own) = own {
                own.push(Json::Object(self.object(*number, of)));
            }
        }
        json!({ "campaign": self.report.campaign, "points": points })
    }

    fn object(&self, number: usize, of: &PointSegment) -> Map<String, Json> {
        let segment = &self.segments[number];
        let imposed = &segment.imposed;
        let value = |number: Option<f64>| json!(number.map(Value::Number));
        let mut object = Map::new();
        let mut put = |name: &str, value: Json| {
            object.insert(name.to_owned(), value);
        };
        put("segment", json!(number + 1));
        put("start", json!(imposed.start));
        put("kept_from", json!(segment.kept_from()));
        put("end", json!(segment.end()));
        put("direction", value(imposed.direction));
        put("shear_rate", value(imposed.shear_rate));
        put("shear_stress", value(imposed.shear_stress));
        put("amplitude", value(imposed.amplitude));
        put("runs", json!(of.runs));
        put("recovered", json!(of.recovered));
        for (number, estimate) in NUMBERS.iter().zip(&of.numbers) {
            put(number.name, value(estimate.map(|e| e.mean)));
            put(
                &format!("{}_ci95", number.name),
                value(estimate.and_then(|e| e.ci95)),
            );
        }
        let cycles = of.cycles.iter().map(|cycle| {
            let mut object = Map::new();
            for ((name, _), estimate) in OF_CYCLES.iter().zip(cycle) {
                object.insert((*name).to_owned(), value(estimate.map(|e| e.mean)));
                let half = value(estimate.and_then(|e| e.ci95));
                object.insert(format!("{name}_ci95"), half);
            }
            Json::Object(object)
        });
        put("cycles", cycles.collect());
        put(
            "trace",
            json!({
                "strain": of.trace.iter().map(|spot| spot.0).collect::<Vec<_>>(),
                "viscosity": of.trace.iter().map(|spot| Value::Number(spot.1.mean)).collect::<Vec<_>>(),
                "viscosity_ci95": of.trace.iter().map(|spot| spot.1.ci95).collect::<Vec<_>>(),
            }),
        );
        object
    }

    /// One row per segment of each point: all axes, the segment, numbers and their intervals.
    pub fn table(&self) -> Vec<DataColumn> {
        let mut table: Vec<DataColumn> =
            AXES.iter().map(|axis| axis.column(self.params())).collect();
        let number = |name: &'static str, meaning, of: &dyn Fn(&PlannedSegment) -> Option<f64>| {
            let cells = self.rows.iter().map(|row| of(&self.segments[row.1]));
            let cells = cells.map(|number| number.map(Value::Number));
            DataColumn::of(name, Kind::Number, meaning, cells)
        };
        let count = |name: &'static str, meaning, of: &dyn Fn(&Row) -> Option<u64>| {
            let cells = self.rows.iter().map(|row| of(row).map(Value::Count));
            DataColumn::of(name, Kind::Count, meaning, cells)
        };
        table.extend([
            count("segment", "number of the segment, from 1", &|row| {
                Some(row.1 as u64 + 1)
            }),
            // `start` is the name of an axis.
            number("segment_start", "strain of the run at its start", &|s| {
                Some(s.imposed.start)
            }),
            number(
                "kept_from",
                "strain of the run at which its averages start",
                &|s| Some(s.kept_from()),
            ),
            number("end", "strain of the run at its end", &|s| Some(s.end())),
            number(
                "segment_direction",
                "sense of its shear, if it has its own",
                &|s| s.imposed.direction,
            ),
            number(
                "segment_shear_rate",
                "its shear rate, if it has its own",
                &|s| s.imposed.shear_rate,
            ),
            number(
                "segment_shear_stress",
                "its shear stress, if it has its own",
                &|s| s.imposed.shear_stress,
            ),
            number("amplitude", "amplitude of its oscillation", &|s| {
                s.imposed.amplitude
            }),
            count("runs", "runs averaged", &|row| Some(row.2.runs)),
            count(
                "recovered",
                "of these, runs that have recovered half of the drop at a reversal",
                &|row| row.2.recovered,
            ),
        ]);
        for (k, number) in NUMBERS.iter().enumerate() {
            let mut add = |name: String, meaning, of: fn(Estimate) -> Option<f64>| {
                let cells = self.rows.iter().map(|row| of(row.2.numbers[k]?));
                let cells = cells.map(|number| number.map(Value::Number));
                table.push(DataColumn::of(name, Kind::Number, meaning, cells));
            };
            add(number.name.to_owned(), number.meaning, |e| Some(e.mean));
            let half = "half width of its 95 % Student interval over runs";
            add(format!("{}_ci95", number.name), half, |e| e.ci95);
        }
        table
    }

    /// Draws η′ and η″ of every point against the amplitude of its oscillations.
    ///
    /// # Errors
    /// [`ReportError::Argument`] without two oscillations, or with more points than a figure holds.
    pub fn draw(&self) -> Result<Vec<u8>, ReportError> {
        let amplitudes = self
            .segments
            .iter()
            .filter_map(|segment| segment.imposed.amplitude);
        if amplitudes.count() < 2 {
            return Err(ReportError::argument(
                "figure",
                "η′ and η″ are drawn against the amplitude of at least two oscillations; for the viscosity in time write `sweep report FILE \
                 --segment NUMBER --figure NAME --kind trace`",
            ));
        }
        let mut places: Vec<usize> = self.rows.iter().map(|row| row.0).collect();
        places.dedup();
        let all: Vec<(&str, &Params)> = places
            .iter()
            .map(|place| {
                (
                    self.report.campaign.as_str(),
                    &self.report.points[*place].params,
                )
            })
            .collect();
        let shared = Shared {
            along: None,
            panels: None,
            units: self.report.units,
            starts: &self.report.starts,
        };
        let mut graphs: Vec<(String, Vec<(f64, Estimate)>)> = Vec::new();
        for (label, place) in labels(&all, shared).iter().zip(&places) {
            for name in ["eta_prime", "eta_double_prime"] {
                let Some((k, number)) = NUMBERS.iter().enumerate().find(|(_, n)| n.name == name)
                else {
                    continue;
                };
                let own = self.rows.iter().filter(|row| row.0 == *place);
                let mut spots: Vec<(f64, Estimate)> = own
                    .filter_map(|(_, segment, of)| {
                        let amplitude = self.segments[*segment].imposed.amplitude?;
                        Some((amplitude, of.numbers[k]?))
                    })
                    .collect();
                spots.sort_by(|a, b| a.0.total_cmp(&b.0));
                let comma = if label.words.is_empty() { "" } else { ", " };
                graphs.push((format!("{}{comma}{}", label.words, number.heading), spots));
            }
        }
        let graphs: Vec<MeasuredGraph<'_>> = graphs
            .iter()
            .map(|(label, spots)| (label.as_str(), spots.clone()))
            .collect();
        let origin = Origin::of(std::slice::from_ref(&self.report));
        let axes = ["amplitude γ₀", "η′, η″ (μ)"];
        let form = GraphForm {
            has_markers: true,
            ..GraphForm::default()
        };
        Ok(draw_graphs_of(&graphs, axes, form, &origin))
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
            trace: Vec::new(),
            reversal: reversal.map(|recovery_strain| Reversal {
                hydrodynamic_share: 0.4,
                recovery_strain,
            }),
            cycles: Vec::new(),
            averaged_cycles: 0,
        };
        let number = |of: &PointSegment, name: &str| {
            let place = NUMBERS.iter().position(|number| number.name == name);
            of.numbers[place.unwrap()].map(|estimate| estimate.mean)
        };
        let runs = [Some(Some(1.0)), Some(None), Some(Some(2.0))].map(run);
        let of = PointSegment::of(&runs);
        assert_eq!((of.runs, of.recovered), (3, Some(2)));
        assert_eq!(number(&of, "recovery_strain"), Some(1.5));
        assert!((number(&of, "hydrodynamic_share").unwrap() - 0.4).abs() < 1e-12);
        let none = PointSegment::of(&[run(Some(None))]);
        assert_eq!(none.recovered, Some(0));
        assert_eq!(number(&none, "recovery_strain"), None);
        // Without a reversal there is nothing to recover from.
        assert_eq!(PointSegment::of(&[run(None)]).recovered, None);
    }
}
