//! The columns of all tables: the axes of the campaign, then what was measured.

use super::error::ReportError;
use super::points::{Point, Report};
use crate::axes::{AXES, Axis, Kind, Value};
use crate::data::{Cells, DataColumn};
use crate::model::stresses::STRESSES;
use crate::statistics::Estimate;

/// A column: a name for machines, a unit, a meaning, and a cell for every point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Column {
    /// Name, the same in CSV, Parquet and JSON.
    pub(super) name: &'static str,
    /// Unit; `1` where there is none, nothing for words.
    pub(super) unit: &'static str,
    /// Meaning.
    pub(super) meaning: &'static str,
    /// Label on the page; empty for columns that no curve shows.
    pub(super) label: &'static str,
    /// What is in it.
    content: Content,
}

/// What is in a column.
#[derive(Debug, Clone, Copy)]
enum Content {
    /// Values on an axis.
    Axis(&'static Axis),
    /// Counts.
    Count(fn(&Point) -> u64),
    /// Numbers; `None` where there is none.
    Number(fn(&Point) -> Option<f64>),
    /// A component or part of the stress, by its place in [`STRESSES`].
    Stress(usize),
    /// Half the width of its interval.
    StressInterval(usize),
}

/// Which columns tables have besides the axes. The default is all of them, or in tables for people the usual ones.
#[derive(Debug, Clone, Default)]
pub struct Columns(Option<Vec<Column>>);

impl Columns {
    /// The columns with these names, in this order; none is the default.
    ///
    /// # Errors
    /// [`ReportError::Argument`] on a name that no column has.
    pub fn named(names: &[String]) -> Result<Self, ReportError> {
        if names.is_empty() {
            return Ok(Self::default());
        }
        let mut chosen: Vec<Column> = Vec::new();
        for name in names {
            let name = name.trim().replace('-', "_");
            let Some(column) = measured().find(|column| column.name == name) else {
                if AXES.iter().any(|axis| axis.key == name) {
                    continue;
                }
                let known: Vec<&str> = measured().map(|column| column.name).collect();
                return Err(ReportError::Argument {
                    argument: "--columns",
                    message: format!(
                        "no column is called {name:?}; besides the axes there are {}",
                        known.join(", ")
                    ),
                });
            };
            if !chosen.iter().any(|known| known.name == column.name) {
                chosen.push(column);
            }
        }
        Ok(Self(Some(chosen)))
    }

    /// The columns that were chosen; `None` by default.
    pub(super) fn chosen(&self) -> Option<&[Column]> {
        self.0.as_deref()
    }
}

impl Column {
    /// The column of an axis.
    pub(super) fn of_axis(axis: &'static Axis) -> Self {
        column(axis.key, axis.unit, axis.meaning, Content::Axis(axis))
    }

    /// The same with a label, so that curves of the page can show it.
    const fn labelled(self, label: &'static str) -> Self {
        Self { label, ..self }
    }

    /// What all its cells are.
    pub(super) fn content(&self) -> Kind {
        match self.content {
            Content::Axis(axis) => axis.kind(),
            Content::Count(_) => Kind::Count,
            Content::Number(_) | Content::Stress(_) | Content::StressInterval(_) => Kind::Number,
        }
    }

    /// Its cell of a point; `None` if nothing was measured.
    pub(super) fn cell(&self, point: &Point) -> Option<Value> {
        match self.content {
            // What is not imposed follows from the other.
            Content::Axis(axis) if axis.is_shear_rate() => number(point.shear_rate()),
            Content::Axis(axis) if axis.is_shear_stress() => number(point.params.shear_stress),
            Content::Axis(axis) => Some(axis.value(&point.params)),
            Content::Count(read) => Some(Value::Count(read(point))),
            Content::Number(read) => number(read(point)),
            Content::Stress(place) => number(mean(point.stresses[place])),
            Content::StressInterval(place) => number(ci95(point.stresses[place])),
        }
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

    /// What it is called in print.
    pub(super) fn title(&self) -> String {
        let before = |words: &str| words.split(',').next().unwrap_or(words).to_owned();
        match (self.label, self.name.strip_suffix("_ci95")) {
            ("", Some(of)) => match measured_named(of) {
                Some(column) => format!("95 % interval of {}", column.title()),
                None => self.name.replace('_', " "),
            },
            ("", None) => self.name.replace('_', " "),
            (label, _) => before(label),
        }
    }

    /// Whether tables for people leave it out unless it is asked for.
    pub(super) fn is_detail(&self) -> bool {
        match self.content {
            Content::Stress(place) => STRESSES[place].is_part() || STRESSES[place].name == "n1",
            Content::StressInterval(_) => true,
            _ => false,
        }
    }

    /// The column with the half width of its interval, if there is one.
    pub(super) fn interval(&self) -> Option<Self> {
        let name = format!("{}_ci95", self.name);
        measured_named(&name)
    }
}

/// A number that is one.
fn number(value: Option<f64>) -> Option<Value> {
    value.filter(|n| !n.is_nan()).map(Value::Number)
}

/// All columns.
pub(super) fn columns() -> impl Iterator<Item = Column> {
    AXES.iter().map(Column::of_axis).chain(measured())
}

/// The columns that tables of a report have.
pub(super) fn columns_of(report: &Report) -> Vec<Column> {
    match report.columns.chosen() {
        Some(chosen) => {
            let axes = AXES.iter().map(Column::of_axis);
            axes.chain(chosen.iter().copied()).collect()
        }
        None => columns().collect(),
    }
}

/// All columns but those of the axes.
fn measured() -> impl Iterator<Item = Column> {
    let stresses = STRESSES.iter().enumerate().flat_map(|(place, stress)| {
        let mean = column(
            stress.name,
            "mu rate",
            stress.meaning,
            Content::Stress(place),
        );
        let width = Content::StressInterval(place);
        [
            mean.labelled(stress.meaning),
            column(
                stress.interval,
                "mu rate",
                "half width of its 95 % interval",
                width,
            ),
        ]
    });
    MEASURED.into_iter().chain(stresses)
}

/// The measured column of this name.
pub(super) fn measured_named(name: &str) -> Option<Column> {
    measured().find(|column| column.name == name)
}

/// Measured quantities that curves can show.
pub(super) fn quantities() -> impl Iterator<Item = Column> {
    measured().filter(|column| !column.label.is_empty())
}

/// Shorthand for [`MEASURED`].
const fn column(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    content: Content,
) -> Column {
    Column {
        name,
        unit,
        meaning,
        label: "",
        content,
    }
}

/// Mean of an estimate.
fn mean(estimate: Option<Estimate>) -> Option<f64> {
    estimate.map(|e| e.mean)
}

/// Half the 95 % interval of an estimate.
fn ci95(estimate: Option<Estimate>) -> Option<f64> {
    estimate.and_then(|e| e.ci95)
}

/// What was measured.
#[rustfmt::skip]
const MEASURED: [Column; 32] = [
    column("seeds", "1", "runs averaged", Content::Count(|p| p.seeds)),
    column("jammed", "1", "runs that ended jammed: not averaged", Content::Count(|p| p.jammed)),
    column("failed", "1", "runs that failed: not averaged", Content::Count(|p| p.failed)),
    column("doubtful", "1", "finished runs with doubtful numbers: averaged only if asked for", Content::Count(|p| p.doubtful)),
    column("viscosity", "mu", "viscosity in full, mean over runs of their means in time", Content::Number(|p| mean(p.viscosity))).labelled("viscosity"),
    column("viscosity_ci95", "mu", "half width of its 95 % Student interval", Content::Number(|p| ci95(p.viscosity))),
    column("viscosity_median", "mu", "median over runs of their medians in time", Content::Number(|p| p.viscosity_median)).labelled("median viscosity"),
    column("viscosity_median_quartile_1", "mu", "first quartile over runs of their medians in time", Content::Number(|p| p.viscosity_quartiles.map(|q| q[0]))),
    column("viscosity_median_quartile_3", "mu", "third quartile over runs of their medians in time", Content::Number(|p| p.viscosity_quartiles.map(|q| q[1]))),
    column("viscosity_stresslet", "mu", "viscosity without contact stress", Content::Number(|p| mean(p.viscosity_stresslet))).labelled("stresslet viscosity"),
    column("viscosity_stresslet_ci95", "mu", "half width of its 95 % interval", Content::Number(|p| ci95(p.viscosity_stresslet))),
    column("normal_stress_difference", "mu rate", "first normal stress difference, contacts included", Content::Number(|p| mean(p.normal_stress_difference))).labelled("normal stress difference N₁"),
    column("normal_stress_difference_ci95", "mu rate", "half width of its 95 % interval", Content::Number(|p| ci95(p.normal_stress_difference))),
    column("contacts_per_sphere", "1", "pairs with a contact force over spheres", Content::Number(|p| p.contacts_per_sphere)).labelled("contacts per sphere"),
    column("activated_fraction", "1", "contacts above the critical load over contacts", Content::Number(|p| p.activated_fraction)).labelled("activated fraction"),
    column("rolling_fraction", "1", "rolling contacts over activated ones", Content::Number(|p| p.rolling_fraction)).labelled("rolling fraction"),
    column("minimum_gap", "a", "smallest gap of any run", Content::Number(|p| p.minimum_gap)).labelled("smallest gap"),
    column("overlap", "a", "largest overlap of rough surfaces in any run: roughness height less smallest gap", Content::Number(Point::overlap)).labelled("largest overlap"),
    column("mean_approach_velocity", "a rate", "over all contacts, positive for approach", Content::Number(|p| p.mean_approach_velocity)).labelled("mean approach velocity"),
    column("worst_residual", "a rate", "of the contact problem, over all runs", Content::Number(|p| p.worst_residual)),
    column("unconverged_fraction", "1", "contact problems that did not converge over all", Content::Number(|p| p.unconverged_fraction)),
    column("inexact_fraction", "1", "contact problems with friction off by more than 1e-3 of the largest force over all", Content::Number(|p| p.inexact_fraction)),
    column("jammed_stages", "1", "contact problems without an admissible motion, over all runs averaged", Content::Count(|p| p.jammed_stages)),
    column("wall_time_s", "s", "mean computing time of a run", Content::Number(|p| p.wall_time_s)),
    column("cpu_time_s", "s", "mean time of the processor of a run", Content::Number(|p| p.cpu_time_s)),
    column("seeds_wanted", "1", "seeds that count: of a precision those of its batches so far", Content::Count(|p| p.seeds_wanted)),
    column("precision", "1", "half width of the 95 % interval over the mean, of the quantity asked for or the viscosity", Content::Number(|p| p.precision)),
    column("discard", "1", "strain discarded at the start of every run", Content::Number(|p| p.discard)),
    column("drift", "1", "viscosity over the second half of the strain kept less that over the first, over the mean", Content::Number(|p| p.drift.map(|d| d.halves.mean))),
    column("drift_ci95", "1", "half width of its 95 % interval over runs", Content::Number(|p| p.drift.and_then(|d| d.halves.ci95))),
    column("correlation_strain", "1", "strain after which the viscosity of a run counts as independent", Content::Number(|p| p.correlation_strain)),
    column("effective_samples", "1", "independent samples all runs together are worth", Content::Number(|p| p.effective_samples)),
];

/// The points as a table, with the columns that were chosen or all, in the units of the report.
pub fn point_table(report: &Report) -> Vec<DataColumn> {
    columns_of(report)
        .into_iter()
        .map(|column| {
            let mut cells = Cells::with_capacity(column.content(), report.points.len());
            for point in &report.points {
                cells.push(column.shown(report, point));
            }
            DataColumn {
                name: column.name.into(),
                unit: column.unit_in(report),
                meaning: column.meaning,
                cells,
            }
        })
        .collect()
}
