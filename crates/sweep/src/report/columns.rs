//! The columns of all tables: the axes of the campaign, then measured quantities. Tables, JSON,
//! figures and the page use this list.

use super::error::ReportError;
use super::figure::scale::count;
use super::points::{Point, Report, Runs};
use crate::data::{DataColumn, Word};
use crate::data::{Kind, Value};
use crate::measure::sampled;
use crate::measure::{Estimate, mean, ratio};
use crate::model::axes::{AXES, Axis};
use crate::model::case::State;
use crate::store::PointRun;
use std::sync::LazyLock;

/// A column: a name for machines, a unit, a meaning, and a cell for every point.
#[derive(Debug)]
pub(super) struct Column {
    /// Name, the same in CSV, Parquet and JSON.
    pub(super) name: Word,
    /// Unit; `1` for pure numbers, empty for text.
    pub(super) unit: &'static str,
    /// Meaning.
    pub(super) meaning: &'static str,
    /// Label on the page; empty for columns without curves.
    pub(super) label: &'static str,
    content: Content,
    /// Its index among all columns.
    place: usize,
}

/// Content of a column.
#[derive(Debug, Clone, Copy)]
enum Content {
    /// Values on an axis.
    Axis(&'static Axis),
    /// Counts.
    Count(fn(&Runs<'_>) -> u64),
    /// Numbers; `None` for missing ones.
    Number(fn(&Runs<'_>) -> Option<f64>),
    /// The mean over runs of one of their numbers, or of the number of a sample with this index in
    /// [`sampled::means`]. The half width of its 95 % interval is in the next column, `NAME_ci95`.
    Mean(fn(&PointRun, usize) -> Option<f64>, usize),
    /// Half width of that interval.
    Interval,
}

/// Measured quantities, without the means of numbers of samples.
#[rustfmt::skip]
#[expect(clippy::redundant_closure_for_method_calls, reason = "a method is one of runs of one lifetime")]
const MEASURED: [(&str, &str, &str, &str, Content); 29] = {
    use Content::{Count, Mean, Number};
    [
        ("seeds", "1", "runs averaged", "", Count(|r| r.averaged.len() as u64)),
        ("jammed", "1", "runs that ended jammed: not averaged", "", Count(|r| r.number_of(|run| run.state == State::Jammed))),
        ("failed", "1", "runs that failed: not averaged", "", Count(|r| r.number_of(|run| run.state == State::Failed))),
        ("doubtful", "1", "finished runs with doubtful numbers: averaged only on request", "", Count(|r| r.number_of(PointRun::is_doubtful))),
        ("viscosity", "mu", "viscosity in full, mean over runs of their means in time", "viscosity", Mean(|run, _| run.viscosity, 0)),
        ("viscosity_median", "mu", "median over runs of their medians in time", "median viscosity", Number(|r| Some(r.medians()?.median))),
        ("viscosity_median_quartile_1", "mu", "first quartile over runs of their medians in time", "", Number(|r| Some(r.quartiles()?.quartile_1))),
        ("viscosity_median_quartile_3", "mu", "third quartile over runs of their medians in time", "", Number(|r| Some(r.quartiles()?.quartile_3))),
        ("viscosity_stresslet", "mu", "viscosity without contact stress", "stresslet viscosity", Mean(|run, _| run.viscosity_stresslet, 0)),
        ("normal_stress_difference", "mu rate", "first normal stress difference, contacts included", "normal stress difference N₁", Mean(|run, _| run.normal_stress_difference, 0)),
        ("contacts_per_sphere", "1", "pairs with a contact force over spheres", "contacts per sphere", Number(|r| ratio(r.sum(|run| run.contacts), r.sum(|run| run.samples * run.params.spheres as u64)))),
        ("activated_fraction", "1", "contacts above the critical load over contacts", "activated fraction", Number(|r| ratio(r.sum(|run| run.activated), r.sum(|run| run.contacts)))),
        ("rolling_fraction", "1", "rolling contacts over activated ones", "rolling fraction", Number(|r| ratio(r.sum(|run| run.rolling), r.sum(|run| run.activated)))),
        ("minimum_gap", "a", "smallest gap of any run", "smallest gap", Number(|r| r.gap())),
        ("overlap", "a", "largest overlap of rough surfaces in any run: roughness height less smallest gap", "largest overlap", Number(|r| Some((r.all[0].params.roughness - r.gap()?).max(0.0)))),
        ("mean_approach_velocity", "a rate", "over all contacts, positive for approach", "mean approach velocity", Number(|r| ratio(r.values(|run| Some(run.approach)).iter().sum(), r.sum(|run| run.contacts)))),
        ("worst_residual", "a rate", "of the contact problem, over all runs", "", Number(|r| r.values(|run| run.worst_residual).into_iter().reduce(f64::max))),
        ("unconverged_fraction", "1", "contact problems that did not converge over all", "", Number(|r| ratio(r.sum(|run| run.unconverged_stages), r.sum(|run| run.stages)))),
        ("inexact_fraction", "1", "contact problems with friction off by more than 1e-3 of the largest force over all", "", Number(|r| ratio(r.sum(|run| run.inexact_stages), r.sum(|run| run.stages)))),
        ("jammed_stages", "1", "contact problems without an admissible motion, over all runs averaged", "", Count(|r| r.total(|run| run.jammed_stages))),
        ("wall_time_s", "s", "mean wall time of a run", "", Number(|r| mean(&r.values(|run| run.wall_time_s)))),
        ("cpu_time_s", "s", "mean CPU time of a run", "", Number(|r| mean(&r.values(|run| run.cpu_time_s)))),
        ("seeds_wanted", "1", "seeds that count: of a precision those of its batches so far", "", Count(|r| r.wanted())),
        ("precision", "1", "half width of the 95 % interval over the mean, of the requested quantity or the viscosity", "", Number(|r| r.precision())),
        ("discard", "1", "strain discarded at the start of every run", "", Number(|r| r.values(|run| run.discard).into_iter().reduce(f64::max))),
        ("drift", "1", "viscosity over the second half of the strain kept less that over the first, over the mean", "", Number(|r| Some(r.drift()?.halves.mean))),
        ("drift_ci95", "1", "half width of its 95 % interval over runs", "", Number(|r| r.drift()?.halves.ci95)),
        ("correlation_strain", "1", "strain after which the viscosity of a run counts as independent", "", Number(|r| mean(&r.values(|run| Some(run.steadiness?.correlation * run.sample_every))))),
        ("effective_samples", "1", "independent samples all runs together are worth", "", Number(|r| r.values(|run| Some(run.samples as f64 / run.steadiness?.correlation)).into_iter().reduce(|a, b| a + b))),
    ]
};

/// All columns.
pub(super) static COLUMNS: LazyLock<Vec<Column>> = LazyLock::new(|| {
    let axis = |axis: &'static Axis| (axis.key, axis.unit, axis.meaning, "", Content::Axis(axis));
    let means = sampled::means().enumerate().map(|(place, number)| {
        let mean = Content::Mean(|run, place| run.means[place], place);
        let meaning = number.meaning;
        (number.name, number.unit, meaning, meaning, mean)
    });
    let mut all: Vec<Column> = Vec::new();
    let mut add = |name: Word, unit, meaning, label, content| {
        let place = all.len();
        all.push(Column {
            name,
            unit,
            meaning,
            label,
            content,
            place,
        });
    };
    for (name, unit, meaning, label, content) in AXES.iter().map(axis).chain(MEASURED).chain(means)
    {
        add(name.into(), unit, meaning, label, content);
        if matches!(content, Content::Mean(..)) {
            let name = format!("{name}_ci95");
            let meaning = "half width of its 95 % Student interval";
            add(name.into(), unit, meaning, "", Content::Interval);
        }
    }
    all
});

/// Measured values of a point, by column; NaN for missing ones and for the axes.
pub(super) fn measure(runs: &Runs<'_>) -> Box<[f64]> {
    let mut numbers = Vec::with_capacity(COLUMNS.len());
    for column in COLUMNS.iter() {
        match column.content {
            Content::Axis(_) => numbers.push(f64::NAN),
            Content::Count(read) => numbers.push(read(runs) as f64),
            Content::Number(read) => numbers.push(read(runs).unwrap_or(f64::NAN)),
            Content::Mean(read, place) => {
                let estimate = Estimate::of(&runs.values(|run| read(run, place)));
                numbers.push(estimate.map_or(f64::NAN, |e| e.mean));
                numbers.push(estimate.and_then(|e| e.ci95).unwrap_or(f64::NAN));
            }
            // Added together with its mean.
            Content::Interval => {}
        }
    }
    numbers.into()
}

/// The columns of tables besides the axes: by default all of them, in tables for people the main
/// ones.
#[derive(Debug, Clone, Default)]
pub struct Columns(Option<Vec<&'static Column>>);

impl Columns {
    /// The columns with these names, in this order; none is the default.
    ///
    /// # Errors
    /// [`ReportError::Argument`] on a name that no column has.
    pub fn named(names: &[String]) -> Result<Self, ReportError> {
        if names.is_empty() {
            return Ok(Self::default());
        }
        let mut chosen: Vec<&Column> = Vec::new();
        for name in names {
            let name = name.trim().replace('-', "_");
            let axis = Axis::named(&name).map(|axis| axis.key);
            let meant = match name.as_str() {
                "η" | "eta" => "viscosity",
                name => axis.unwrap_or(name),
            };
            match Column::named(meant) {
                Some(column) if column.is_axis() || chosen.iter().any(|c| c.name == meant) => {}
                Some(column) => chosen.push(column),
                None => {
                    let measured = COLUMNS.iter().filter(|column| !column.is_axis());
                    let known: Vec<&str> = measured.map(|column| column.name.as_ref()).collect();
                    let known = known.join(", ");
                    return Err(ReportError::argument(
                        "columns",
                        format!("no column is called {name:?}; besides the axes there are {known}"),
                    ));
                }
            }
        }
        Ok(Self(Some(chosen)))
    }

    /// The columns that were chosen; `None` by default.
    pub(super) fn chosen(&self) -> Option<&[&'static Column]> {
        self.0.as_deref()
    }

    /// The axes, then the columns that were chosen or all.
    pub(super) fn all(&self) -> Vec<&'static Column> {
        let axes = COLUMNS.iter().filter(|column| column.is_axis());
        match &self.0 {
            Some(chosen) => axes.chain(chosen.iter().copied()).collect(),
            None => COLUMNS.iter().collect(),
        }
    }
}

impl Column {
    /// The column of this name.
    pub(super) fn named(name: &str) -> Option<&'static Self> {
        COLUMNS.iter().find(|column| column.name == name)
    }

    fn is_axis(&self) -> bool {
        matches!(self.content, Content::Axis(_))
    }

    /// Type of its cells.
    fn kind(&self) -> Kind {
        match self.content {
            Content::Axis(axis) => axis.kind(),
            Content::Count(_) => Kind::Count,
            _ => Kind::Number,
        }
    }

    /// Its cell at a point; `None` if nothing was measured.
    pub(super) fn cell(&self, point: &Point) -> Option<Value> {
        let measured = point.measured[self.place];
        let number = match self.content {
            // Of rate and stress, the one that is not imposed is a result.
            Content::Axis(axis) if axis.is_shear_rate() => point.shear_rate()?,
            Content::Axis(axis) if axis.is_shear_stress() => point.params.shear_stress?,
            Content::Axis(axis) if axis.is_fraction() && !axis.means_something(&point.params) => {
                return None;
            }
            Content::Axis(axis) => return Some(axis.value(&point.params)),
            Content::Count(_) => return Some(Value::Count(count(measured) as u64)),
            _ => measured,
        };
        (!number.is_nan()).then_some(Value::Number(number))
    }

    /// The same in the units of a report.
    pub(super) fn shown(&self, report: &Report, point: &Point) -> Option<Value> {
        match self.cell(point)? {
            Value::Number(number) => {
                let at = point.at();
                let number = match self.content {
                    Content::Axis(axis) => report.units.along(axis, at, number),
                    _ => report.units.factor(self.unit, at)? * number,
                };
                (!number.is_nan()).then_some(Value::Number(number))
            }
            value => Some(value),
        }
    }

    /// Its unit in a report.
    pub(super) fn unit_in(&self, report: &Report) -> &'static str {
        match self.content {
            Content::Axis(axis) => report.units.of_axis(axis).unwrap_or(self.unit),
            _ => report.units.word(self.unit),
        }
    }

    /// Its name in print.
    pub(super) fn title(&self) -> String {
        match (self.label.split_once(','), self.content) {
            (Some((label, _)), _) => label.into(),
            (None, Content::Interval) => {
                format!("95 % interval of {}", COLUMNS[self.place - 1].title())
            }
            (None, _) if self.label.is_empty() => self.name.replace('_', " "),
            (None, _) => self.label.into(),
        }
    }

    /// Whether tables for people show it only on request.
    pub(super) fn is_detail(&self) -> bool {
        let mean_of = |name| sampled::means().find(|number| number.name == name);
        match self.content {
            Content::Mean(..) => {
                mean_of(&self.name).is_some_and(|mean| !mean.is_sum() || mean.name == "n1")
            }
            Content::Interval => mean_of(&COLUMNS[self.place - 1].name).is_some(),
            _ => false,
        }
    }

    /// The column with the half width of its interval, if there is one.
    pub(super) fn interval(&self) -> Option<&'static Self> {
        Self::named(&format!("{}_ci95", self.name))
    }
}

/// The axes of a point as an object, by their names.
pub(super) fn point_row(point: &Point) -> serde_json::Map<String, serde_json::Value> {
    let axes = COLUMNS.iter().filter(|column| column.is_axis());
    axes.map(|column| {
        (
            column.name.to_string(),
            serde_json::json!(column.cell(point)),
        )
    })
    .collect()
}

/// The points as a table, with the columns that were chosen or all, in the units of the report.
pub fn point_table(report: &Report) -> Vec<DataColumn> {
    let table = |column: &'static Column| {
        let points = report.points.iter();
        let cells = points.map(|point| column.shown(report, point));
        DataColumn {
            unit: column.unit_in(report),
            ..DataColumn::of(column.name.clone(), column.kind(), column.meaning, cells)
        }
    };
    report.columns.all().into_iter().map(table).collect()
}
