//! The table of points for people: which columns it has, and how their numbers are written.

use super::columns::{Column, measured_named};
use super::{Point, Report};
use crate::axes::{AXES, Axis, Value};
use crate::campaign::Discard;
use crate::format::{Uncertain, significant};

/// Columns of a table that is as wide as it needs to be: name, heading, significant digits, and how soon it is left out where there is
/// no room, the highest first.
#[rustfmt::skip]
const USUAL: [(&str, &str, i32, u8); 19] = [
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
    ("minimum_gap", "smallest\ngap", 3, 7),
    ("overlap", "largest\noverlap", 2, 2),
    ("mean_approach_velocity", "approach", 2, 9),
    ("worst_residual", "worst\nresidual", 2, 9),
    ("unconverged_fraction", "unconverged", 2, 9),
];
/// Columns of a terminal that a table fits into where nothing is known of it.
const USUAL_WIDTH: usize = 80;
/// Columns of a terminal between two columns of a table.
const GAP: usize = 3;

/// How numbers are written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum NumberFormat {
    /// 9.86 ± 0.79.
    #[default]
    Plain,
    /// 9.86(79): in brackets half the 95 % interval, in units of the last digit.
    Si,
}

/// Which columns a table for people has.
#[derive(Debug, Clone, Copy, Default)]
pub struct Shape {
    /// All the usual ones, and not only as many as fit.
    pub wide: bool,
    /// How numbers are written.
    pub format: NumberFormat,
}

/// A table of points.
#[derive(Debug)]
pub(super) struct Sheet {
    /// Columns of the axes, which every part of it begins with.
    axes: usize,
    columns: Vec<SheetColumn>,
    /// Whether there are more columns than it has.
    pub(super) is_cut: bool,
}

/// One column of it.
#[derive(Debug)]
pub(super) struct SheetColumn {
    /// Name in other tables.
    pub(super) name: &'static str,
    pub(super) heading: String,
    pub(super) unit: &'static str,
    pub(super) cells: Vec<Option<Uncertain>>,
    words: Vec<String>,
    rank: u8,
}

impl SheetColumn {
    fn width(&self) -> usize {
        let lines = self.words.iter().chain([&self.heading]);
        let lines = lines.flat_map(|words| words.lines());
        lines.map(|line| line.chars().count()).max().unwrap_or(0)
    }
}

/// The axes that tell the points of a report apart, and the others.
pub(super) fn axes_of(report: &Report) -> (Vec<&'static Axis>, Vec<&'static Axis>) {
    // The shear rate is what curves are drawn against: always a column.
    AXES.iter().partition(|axis| {
        axis.is_shear_rate() || axis.varies(report.points.iter().map(|point| &point.params))
    })
}

impl Sheet {
    /// The table of a report, for a terminal of this width.
    pub(super) fn of(report: &Report, shape: Shape, width: Option<u16>) -> Self {
        let (axes, _) = axes_of(report);
        let columns = axes.iter().map(|axis| of_axis(report, axis, shape));
        let mut columns: Vec<SheetColumn> = columns.collect();
        let axes = columns.len();
        if let Some(chosen) = report.columns.chosen() {
            let of = |column: &Column| of_column(report, column, column.name, (4, 0), shape);
            columns.extend(chosen.iter().map(of));
        } else {
            let usual = USUAL.iter().filter(|usual| is_there(report, usual.0));
            columns.extend(usual.filter_map(|(name, heading, digits, rank)| {
                let column = measured_named(name)?;
                Some(of_column(report, &column, heading, (*digits, *rank), shape))
            }));
        }
        let mut sheet = Self {
            axes,
            columns,
            is_cut: false,
        };
        if !shape.wide && report.columns.chosen().is_none() {
            sheet.fit(width.map_or(USUAL_WIDTH, usize::from));
        }
        sheet
    }

    /// All columns.
    pub(super) fn columns(&self) -> &[SheetColumn] {
        &self.columns
    }

    fn width(columns: &[SheetColumn]) -> usize {
        columns.iter().map(|column| column.width() + GAP).sum()
    }

    /// Leaves out columns until it fits.
    fn fit(&mut self, width: usize) {
        while Self::width(&self.columns) > width {
            let measured = self.columns.iter().enumerate().skip(self.axes);
            // Of those that matter as little the last one.
            let least = measured.max_by_key(|(_, column)| column.rank);
            match least {
                Some((place, column)) if column.rank > 0 => {
                    self.columns.remove(place);
                    self.is_cut = true;
                }
                _ => return,
            }
        }
    }

    /// It as lines of text, in parts that fit into a width, each of which begins with the axes. No number is ever split.
    pub(super) fn text(&self, width: Option<u16>) -> String {
        let most = width.map_or(usize::MAX, usize::from);
        let (axes, rest) = self.columns.split_at(self.axes);
        let before = Self::width(axes);
        let mut parts: Vec<Vec<&SheetColumn>> = Vec::new();
        let mut used = usize::MAX;
        for column in rest {
            let wide = column.width() + GAP;
            if parts.is_empty() || used + wide > most {
                parts.push(axes.iter().collect());
                used = before;
            }
            used += wide;
            if let Some(part) = parts.last_mut() {
                part.push(column);
            }
        }
        if parts.is_empty() {
            parts.push(axes.iter().collect());
        }
        let parts: Vec<String> = parts.iter().map(|part| lines(part)).collect();
        parts.join("\n\n")
    }
}

/// Columns as lines of text.
fn lines(columns: &[&SheetColumn]) -> String {
    let mut table = super::table(None);
    table.set_header(columns.iter().map(|column| column.heading.as_str()));
    let rows = columns.first().map_or(0, |column| column.words.len());
    for row in 0..rows {
        table.add_row(columns.iter().map(|column| column.words[row].as_str()));
    }
    for column in table.column_iter_mut() {
        column.set_cell_alignment(comfy_table::CellAlignment::Right);
    }
    table.to_string()
}

/// Whether a usual column says anything.
fn is_there(report: &Report, name: &str) -> bool {
    match name {
        "seeds_wanted" | "precision" => report.points.iter().any(|point| point.rule.is_some()),
        "discard" => report.discard == Discard::Auto,
        "jammed" => report.counts.jammed > 0,
        "failed" => report.counts.failed > 0,
        "doubtful" => report.doubtful > 0,
        "overlap" => report.points.iter().any(Point::overlaps_too_much),
        _ => true,
    }
}

/// The column of an axis.
fn of_axis(report: &Report, axis: &'static Axis, shape: Shape) -> SheetColumn {
    let column = Column::of_axis(axis);
    let unit = column.unit_in(report);
    let cell = |point: &Point| {
        let value = column.shown(report, point)?;
        // A rate that is measured has no more digits than the viscosity it is from.
        let is_measured = axis.is_shear_rate() && point.params.shear_stress.is_some();
        Some(match value {
            Value::Number(number) if is_measured || unit != column.unit => Uncertain::of(number, 4),
            Value::Number(number) => Uncertain::exact(number),
            Value::Count(count) => Uncertain::exact(count as f64),
            Value::Word(word) => Uncertain::Word(word),
        })
    };
    let heading = match unit {
        _ if unit == column.unit => axis.symbol.to_owned(),
        unit => format!("{}\n{unit}", axis.symbol),
    };
    let cells: Vec<Option<Uncertain>> = report.points.iter().map(cell).collect();
    SheetColumn {
        name: axis.symbol,
        heading,
        unit,
        words: words(&cells, shape),
        cells,
        rank: 0,
    }
}

/// A measured column, with its interval if it has one.
fn of_column(
    report: &Report,
    column: &Column,
    heading: &str,
    (digits, rank): (i32, u8),
    shape: Shape,
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
                Uncertain::Percent(significant(100.0 * value, digits))
            }
            (Value::Number(value), None) => Uncertain::of(value, digits),
            (Value::Count(count), _) => Uncertain::exact(count as f64),
            (Value::Word(word), _) => Uncertain::Word(word),
        })
    };
    let unit = column.unit_in(report);
    let cells: Vec<Option<Uncertain>> = report.points.iter().map(cell).collect();
    SheetColumn {
        name: column.name,
        heading: if unit == column.unit {
            heading.to_owned()
        } else {
            format!("{heading}\n{unit}")
        },
        unit,
        words: words(&cells, shape),
        cells,
        rank,
    }
}

fn words(cells: &[Option<Uncertain>], shape: Shape) -> Vec<String> {
    let word = |cell: &Option<Uncertain>| match (cell, shape.format) {
        (None, _) => "–".into(),
        (Some(cell), NumberFormat::Plain) => cell.plain(),
        (Some(cell), NumberFormat::Si) => cell.si(),
    };
    cells.iter().map(word).collect()
}
