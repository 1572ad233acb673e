//! The table of the points of a report.

use super::{Head, NumberFormat, Shape, Sheet, SheetColumn};
use crate::data::Value;
use crate::model::axes::{AXES, Axis};
use crate::model::protocol::Discard;
use crate::report::axis_words::AxisWords;
use crate::report::columns::Column;
use crate::report::points::{Point, Report};
use crate::text::format::{Uncertain, significant};

/// Columns of a wide table: name, heading, significant digits, and rank at which it is dropped, the
/// highest first.
#[rustfmt::skip]
const DEFAULT: [(&str, &str, i32, u8); 24] = [
    ("seeds", "runs", 4, 1),
    ("seeds_wanted", "wanted", 4, 3),
    ("precision", "precision", 2, 3),
    ("discard", "discard", 3, 3),
    ("jammed", "jammed", 4, 1),
    ("failed", "failed", 4, 1),
    ("doubtful", "doubtful", 4, 1),
    ("viscosity", "viscosity", 4, 0),
    ("viscosity_median", "median", 4, 4),
    ("effective_samples", "independent\nsamples", 2, 8),
    ("viscosity_stresslet", "stresslet\nviscosity", 4, 5),
    ("contacts_per_sphere", "contacts\n/ N", 3, 6),
    ("activated_fraction", "activated", 3, 6),
    ("rolling_fraction", "rolling", 3, 6),
    ("coordination", "coordi-\nnation", 3, 3),
    ("largest_cluster", "largest\ncluster", 3, 3),
    ("percolating_y", "percolates\nalong y", 3, 3),
    ("core_fraction", "core", 3, 3),
    ("minimum_gap", "smallest\ngap", 3, 7),
    ("overlap", "largest\noverlap", 2, 2),
    ("mean_approach_velocity", "approach", 2, 9),
    ("worst_residual", "worst\nresidual", 2, 9),
    ("unconverged_fraction", "unconverged", 2, 9),
    ("inexact_fraction", "inexact\nfriction", 2, 9),
];

impl Report {
    /// The axes that distinguish its points, and the others.
    pub(in crate::report) fn axes(&self) -> (Vec<&'static Axis>, Vec<&'static Axis>) {
        // The shear rate is the axis of curves, so it is always a column.
        AXES.iter().partition(|axis| {
            axis.is_shear_rate() || axis.varies(self.points.iter().map(|point| &point.params))
        })
    }

    /// Format of the values on one of them.
    pub(in crate::report) fn words_of(&self, axis: &'static Axis) -> AxisWords<'_> {
        let params = self.points.iter().map(|point| &point.params);
        AxisWords::of(axis, self.units, &self.starts, params)
    }
}

impl Sheet {
    /// The table of a report, for a terminal of this width.
    pub(in crate::report) fn of(report: &Report, shape: Shape, width: Option<u16>) -> Self {
        let (axes, _) = report.axes();
        let columns = axes.iter().filter_map(|axis| of_axis(report, axis, shape));
        let mut columns: Vec<SheetColumn> = columns.collect();
        let axes = columns.len();
        let Some(chosen) = report.columns.chosen() else {
            let usual = DEFAULT.iter().filter(|usual| is_there(report, usual.0));
            columns.extend(usual.filter_map(|(name, heading, digits, rank)| {
                let column = Column::named(name)?;
                let head = Head::new(&column.name, *heading, "", *rank);
                Some(of_column(report, column, head, *digits, shape.format))
            }));
            return Self::new(axes, columns, shape.format).shaped(shape, width);
        };
        columns.extend(chosen.iter().map(|column| {
            // On the screen by its name as requested, which is explained below.
            let head = Head {
                title: title(column),
                ..Head::new(&column.name, column.name.as_ref(), "", 0)
            };
            of_column(report, column, head, 4, shape.format)
        }));
        Self::new(axes, columns, shape.format)
    }
}

/// Name of a column in print.
fn title(column: &Column) -> String {
    match DEFAULT.iter().find(|usual| usual.0 == column.name) {
        Some((_, heading, ..)) => heading.replace('\n', " "),
        None => column.title(),
    }
}

/// Whether a default column has content.
fn is_there(report: &Report, name: &str) -> bool {
    match name {
        "seeds_wanted" | "precision" => report.points.iter().any(|point| point.rule.is_some()),
        "discard" => report.discard == Discard::Auto,
        "coordination" | "largest_cluster" | "percolating_y" | "core_fraction" => report
            .points
            .iter()
            .any(|point| point.number(name).is_some()),
        "jammed" => report.counts.jammed > 0,
        "failed" => report.counts.failed > 0,
        "doubtful" => report.doubtful > 0,
        "overlap" => report.points.iter().any(Point::overlaps_too_much),
        _ => true,
    }
}

/// With the unit of its numbers: on the screen only after conversion, in print unless numbers are
/// relative.
fn with_unit(head: Head, own: &'static str, shown: &'static str) -> Head {
    let unit = match shown {
        "" | "1" | "mu" | "mu rate" | "a rate" => "",
        unit => unit,
    };
    let head = Head { unit, ..head };
    if shown == own {
        head
    } else {
        head.with_unit_shown()
    }
}

fn of_axis(report: &Report, axis: &'static Axis, shape: Shape) -> Option<SheetColumn> {
    let column = Column::named(axis.key)?;
    let words = report.words_of(axis);
    let cell = |point: &Point| match column.shown(report, point)? {
        // A measured rate has no more digits than its viscosity.
        Value::Number(number) if axis.is_shear_rate() && point.params.shear_stress.is_some() => {
            Some(Uncertain::of(number, 4))
        }
        _ => Some(words.cell(&point.params)),
    };
    let cells: Vec<Option<Uncertain>> = report.points.iter().map(cell).collect();
    let head = Head::new(axis.key, axis.symbol(), "", 0);
    let head = with_unit(head, column.unit, column.unit_in(report));
    Some(SheetColumn::new(head, cells, shape.format))
}

/// A measured column, with its interval if any.
fn of_column(
    report: &Report,
    column: &Column,
    head: Head,
    digits: i32,
    format: NumberFormat,
) -> SheetColumn {
    let interval = column.interval();
    let number = |column: &Column, point: &Point| match column.shown(report, point) {
        Some(Value::Number(number)) => Some(number),
        _ => None,
    };
    let cell = |point: &Point| {
        let value = column.shown(report, point)?;
        let half = interval
            .as_ref()
            .and_then(|interval| number(interval, point));
        Some(match (value, half) {
            (Value::Number(value), Some(half)) => Uncertain::Interval(value, half),
            (Value::Number(value), None) if column.name == "precision" => {
                Uncertain::Quantity(format!("{} %", significant(100.0 * value, digits)))
            }
            (Value::Number(value), None) => Uncertain::of(value, digits),
            (Value::Count(count), _) => Uncertain::Count(count),
            (Value::Word(word), _) => Uncertain::word(word),
        })
    };
    let cells: Vec<Option<Uncertain>> = report.points.iter().map(cell).collect();
    let head = with_unit(head, column.unit, column.unit_in(report));
    SheetColumn::new(head, cells, format)
}
