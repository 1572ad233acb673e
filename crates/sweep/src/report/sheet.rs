//! Tables for people: views of columns of data.

use super::columns::Column;
use super::labels::AxisWords;
use super::points::{Point, Report};
use crate::data::{Cells, DataColumn};
use crate::measure::Trend;
use crate::model::axes::{AXES, Axis};
use crate::text::format::{NumberFormat, significant, uncertain};
use crate::text::table::styled;
use comfy_table::CellAlignment;
use sd_core::Params;

/// Default width of the terminal in columns.
const DEFAULT_WIDTH: usize = 80;
/// Spaces between two columns of a table, by default and in tables that would be too wide.
const GAP: usize = 3;
const NARROW_GAP: usize = 2;

/// Options of a table for people.
#[derive(Debug, Clone, Copy, Default)]
pub struct Shape {
    /// Whether all default columns are shown, not only as many as fit.
    pub wide: bool,
    /// How numbers are written.
    pub format: NumberFormat,
}

/// A view of a column: its name, its heading of one or two lines, significant digits of numbers
/// without an interval, and the rank at which it is dropped in a narrow table, the highest first, 0
/// for never.
pub(crate) type View<'v> = (&'v str, &'v str, i32, u8);

/// The views of the points.
#[rustfmt::skip]
const OF_POINTS: [View<'_>; 25] = [
    ("seeds", "runs", 4, 1),
    ("seeds_wanted", "wanted", 4, 3),
    ("precision", "precision", 2, 3),
    ("jammed", "jammed", 4, 1),
    ("fraction", "fraction", 4, 1),
    ("arrested_fraction", "arrested\nat", 4, 1),
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

/// The view of a measured column.
pub(super) fn view_of(name: &str) -> View<'_> {
    let known = OF_POINTS.into_iter().find(|view| view.0 == name);
    known.unwrap_or((name, name, 4, 0))
}

/// A table.
#[derive(Debug)]
pub(crate) struct Sheet {
    /// Number of leading columns that every part repeats.
    fixed: usize,
    columns: Vec<SheetColumn>,
    /// Spaces between two of its columns.
    gap: usize,
    /// Whether columns were left out.
    pub(crate) is_cut: bool,
}

/// A column as text.
#[derive(Debug)]
pub(crate) struct SheetColumn {
    pub(super) name: String,
    pub(super) heading: String,
    rank: u8,
    /// `None` for an empty cell.
    pub(super) cells: Vec<Option<String>>,
    /// Whether it holds words and not numbers.
    is_of_words: bool,
}

impl SheetColumn {
    /// A column of texts.
    pub(crate) fn of_words(name: &str, rank: u8, cells: Vec<Option<String>>) -> Self {
        Self {
            name: name.to_owned(),
            heading: name.to_owned(),
            rank,
            cells,
            is_of_words: true,
        }
    }

    /// Trends, if there are any.
    pub(super) fn of_trends(trends: impl Iterator<Item = Option<Trend>>) -> Option<Self> {
        let words = trends.map(|trend| Some(trend?.name().to_owned()));
        let column = Self::of_words("trend", 1, words.collect());
        (!column.is_empty()).then_some(column)
    }

    /// A view of a column and of the half widths of its intervals, if it has any.
    pub(crate) fn of(
        (name, heading, digits, rank): View<'_>,
        data: &DataColumn,
        interval: Option<&DataColumn>,
        format: NumberFormat,
    ) -> Self {
        let half = |row| interval.and_then(|interval| interval.cells.number(row));
        let cell = |row| match &data.cells {
            Cells::Number(cells) => Some(match (cells[row]?, half(row)) {
                (number, Some(half)) => uncertain(number, half, format),
                (number, None) if name == "precision" => {
                    format!("{} %", significant(100.0 * number, digits))
                }
                (number, None) => significant(number, digits),
            }),
            cells => (!cells.is_missing(row)).then(|| cells.text(row)),
        };
        let column = Self::of_words(name, rank, (0..data.cells.len()).map(cell).collect());
        Self {
            heading: heading.to_owned(),
            is_of_words: column.is_empty() || matches!(data.cells, Cells::Word(_)),
            ..column
        }
    }

    /// The values of some points of a report on an axis.
    pub(crate) fn of_axis<'p>(
        axis: &'static Axis,
        report: &Report,
        points: &(impl Iterator<Item = &'p Point> + Clone),
    ) -> Self {
        let params = points.clone().map(|point| &point.params);
        let words = AxisWords::of(axis, report.units, &report.starts, params.clone());
        let data = Column::Axis(axis).data(points.clone(), report.units);
        let cell = |(row, point): (usize, &Point)| match data.cells.number(row) {
            // A measured rate has no more digits than its viscosity.
            Some(rate) if axis.is_shear_rate() && point.params.shear_stress.is_some() => {
                Some(significant(rate, 4))
            }
            _ if axis.is_absent(&point.params) => None,
            _ => (!data.cells.is_missing(row)).then(|| words.plain(&point.params)),
        };
        let is_named = |params| report.starts.name_on(axis, params).is_some();
        let cells = points.clone().enumerate().map(cell).collect();
        let column = Self::of_words(axis.symbol(), 0, cells);
        let is_of_words = !axis.is_numeric() || column.is_empty() || params.clone().all(is_named);
        let column = Self {
            is_of_words,
            ..column
        };
        column.with_unit(axis.unit, data.unit)
    }

    /// With the unit of its numbers after a conversion.
    fn with_unit(mut self, own: &str, shown: &str) -> Self {
        if shown != own {
            self.heading = format!("{}\n{shown}", self.heading);
        }
        self
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.cells.iter().all(Option::is_none)
    }

    fn text(&self, row: usize) -> &str {
        self.cells[row].as_deref().unwrap_or("–")
    }

    fn width(&self) -> usize {
        let cells = (0..self.cells.len()).map(|row| self.text(row));
        let lines = cells.chain([self.heading.as_str()]).flat_map(str::lines);
        lines.map(|line| line.chars().count()).max().unwrap_or(0)
    }
}

impl Report {
    /// The axes that distinguish its points, and the others.
    pub(super) fn axes(&self) -> (Vec<&'static Axis>, Vec<&'static Axis>) {
        // The shear rate is the axis of curves, so it is always a column.
        AXES.iter()
            .partition(|axis| axis.is_shear_rate() || axis.varies(self.params()))
    }

    /// Format of the values on one of them.
    pub(super) fn words_of(&self, axis: &'static Axis) -> AxisWords<'_> {
        AxisWords::of(axis, self.units, &self.starts, self.params())
    }

    /// A view of one of its columns.
    pub(super) fn view(&self, column: Column, view: View<'_>, format: NumberFormat) -> SheetColumn {
        let data = self.column(column);
        let interval = column.interval().map(|interval| self.column(interval));
        SheetColumn::of(view, &data, interval.as_ref(), format).with_unit(column.unit(), data.unit)
    }

    /// A column with the trends of some points, if any of them is not in steady state.
    pub(super) fn trends<'p>(points: impl Iterator<Item = &'p Point>) -> Option<SheetColumn> {
        SheetColumn::of_trends(points.map(|point| Some(point.trend.as_ref()?.0)))
    }

    /// Whether it has something to show in a default column.
    fn shows(&self, name: &str) -> bool {
        match name {
            "seeds_wanted" | "precision" => self.points.iter().any(|point| point.rule.is_some()),
            "coordination" | "largest_cluster" | "percolating_y" | "core_fraction" => {
                self.points.iter().any(|point| point.number(name).is_some())
            }
            "fraction" => self.params().any(Params::imposes_pressure),
            "jammed" => self.counts.jammed > 0,
            "arrested_fraction" => self.counts.arrested > 0,
            "failed" => self.counts.failed > 0,
            "doubtful" => self.doubtful > 0,
            "overlap" => self.points.iter().any(Point::overlaps_too_much),
            _ => true,
        }
    }

    /// Its table, for a terminal of this width.
    pub(super) fn sheet(&self, shape: Shape, width: Option<u16>) -> Sheet {
        let (axes, _) = self.axes();
        let points = self.points.iter();
        let columns = axes
            .iter()
            .map(|axis| SheetColumn::of_axis(axis, self, &points));
        let mut columns: Vec<SheetColumn> = columns.collect();
        let fixed = columns.len();
        columns.extend(Self::trends(self.points.iter()));
        let Some(chosen) = &self.columns.0 else {
            for view in OF_POINTS.into_iter().filter(|view| self.shows(view.0)) {
                let column = Column::named(view.0);
                columns.extend(column.map(|column| self.view(column, view, shape.format)));
            }
            return Sheet::new(fixed, columns).shaped(shape, width);
        };
        // By its name as requested, which is explained below.
        columns.extend(chosen.iter().map(|column| {
            let name = column.name();
            self.view(*column, (&name, &name, 4, 0), shape.format)
        }));
        Sheet::new(fixed, columns)
    }
}

impl Sheet {
    /// A table of these columns; the first `fixed` are always shown.
    pub(crate) fn new(fixed: usize, columns: Vec<SheetColumn>) -> Self {
        Self {
            fixed,
            columns,
            gap: GAP,
            is_cut: false,
        }
    }

    /// A table with a row for each of some points of a report: the axes that distinguish them,
    /// columns of words of which the first is always shown, and views of a table that has these
    /// rows, without empty ones.
    pub(super) fn of_rows<'p>(
        report: &Report,
        points: &(impl Iterator<Item = &'p Point> + Clone),
        words: Vec<SheetColumn>,
        (table, views): (&[DataColumn], &[View<'_>]),
        shape: Shape,
    ) -> Self {
        let params = points.clone().map(|point| &point.params);
        let axes = AXES.iter().filter(|axis| axis.varies(params.clone()));
        let axes = axes.map(|axis| SheetColumn::of_axis(axis, report, points));
        let mut columns: Vec<SheetColumn> = axes.collect();
        let fixed = columns.len() + words.len().min(1);
        columns.extend(words);
        let named = |name: &str| table.iter().find(|column| column.name == name);
        columns.extend(views.iter().filter_map(|view| {
            let interval = named(&format!("{}_ci95", view.0));
            let data = named(view.0)?;
            let column = SheetColumn::of(*view, data, interval, shape.format);
            let is_converted = report.units.are_requested() && !["", "1"].contains(&data.unit);
            let column = column.with_unit("", if is_converted { data.unit } else { "" });
            (!column.is_empty()).then_some(column)
        }));
        Self::new(fixed, columns)
    }

    /// Whether it has a column of this name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.columns.iter().any(|column| column.name == name)
    }

    fn width(&self) -> usize {
        width(&self.columns, self.gap)
    }

    /// The whole table if wide, else the columns that fit a terminal of this width.
    pub(crate) fn shaped(mut self, shape: Shape, most: Option<u16>) -> Self {
        if shape.wide {
            return self;
        }
        let most = room(most);
        while self.width() > most {
            let others = self.columns.iter().enumerate().skip(self.fixed);
            // Among columns of equal rank, the last one.
            match others.max_by_key(|(_, column)| column.rank) {
                Some((place, column)) if column.rank > 0 => {
                    self.columns.remove(place);
                    self.is_cut = true;
                }
                _ => break,
            }
        }
        if self.width() > most {
            self.gap = NARROW_GAP;
        }
        self
    }

    /// The table as lines of text, in parts that fit into a width and begin with the same columns.
    /// Numbers are never split.
    pub(crate) fn text(&self, most: Option<u16>) -> String {
        let most = most.map_or(usize::MAX, usize::from);
        let (fixed, rest) = self.columns.split_at(self.fixed);
        let mut parts: Vec<Vec<&SheetColumn>> = vec![fixed.iter().collect()];
        let mut used = width(fixed, self.gap);
        for column in rest {
            let wide = column.width() + self.gap;
            if used + wide > most && parts[parts.len() - 1].len() > fixed.len() {
                parts.push(fixed.iter().collect());
                used = width(fixed, self.gap);
            }
            used += wide;
            if let Some(part) = parts.last_mut() {
                part.push(column);
            }
        }
        let parts: Vec<String> = parts.iter().map(|part| lines(part, self.gap)).collect();
        parts.join("\n\n")
    }
}

/// Maximum width of a table in columns of a terminal.
pub(crate) fn room(width: Option<u16>) -> usize {
    width.map_or(DEFAULT_WIDTH, usize::from)
}

fn width(columns: &[SheetColumn], gap: usize) -> usize {
    columns.iter().map(|column| column.width() + gap).sum()
}

/// Columns as lines of text.
fn lines(columns: &[&SheetColumn], gap: usize) -> String {
    let mut table = styled(None);
    table.set_header(columns.iter().map(|column| column.heading.as_str()));
    for row in 0..columns.first().map_or(0, |column| column.cells.len()) {
        table.add_row(columns.iter().map(|column| column.text(row)));
    }
    for (drawn, column) in table.column_iter_mut().zip(columns) {
        if gap == NARROW_GAP {
            drawn.set_padding((1, 0));
        }
        if !column.is_of_words {
            drawn.set_cell_alignment(CellAlignment::Right);
        }
    }
    table.to_string()
}
