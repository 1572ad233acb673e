//! Tables for people, on the screen and in LaTeX: selection of columns and format of numbers.

mod latex;
mod points;

pub(crate) use latex::write_latex;

use super::text::styled;
use crate::text::choices::choices;
use crate::text::format::Uncertain;
use comfy_table::CellAlignment;

/// Default width of the terminal in columns.
const DEFAULT_WIDTH: usize = 80;
/// Spaces between two columns of a table, by default and in tables that would be too wide.
const GAP: usize = 3;
const NARROW_GAP: usize = 2;

choices! {
    /// How numbers are written.
    NumberFormat {
        Plain = "plain", "9.86 ± 0.79";
        Si = "si", "9.86(79): in brackets half the 95 % interval, in units of the last digit";
    }
}

/// Options of a table for people.
#[derive(Debug, Clone, Copy, Default)]
pub struct Shape {
    /// Whether all default columns are shown, not only as many as fit.
    pub wide: bool,
    /// How numbers are written.
    pub format: NumberFormat,
}

/// A table.
#[derive(Debug)]
pub(crate) struct Sheet {
    /// Number of leading columns that every part repeats.
    fixed: usize,
    columns: Vec<SheetColumn>,
    format: NumberFormat,
    /// Spaces between two of its columns.
    gap: usize,
    /// Whether columns were left out.
    pub(crate) is_cut: bool,
}

/// Heading and rank of a column.
#[derive(Debug, Clone)]
pub(crate) struct Head {
    /// Its name in tables for machines.
    pub(crate) name: &'static str,
    /// Heading on the screen; may have two lines.
    pub(crate) heading: String,
    /// Heading in print; may be longer.
    pub(crate) title: String,
    /// Its unit in print; empty for none.
    pub(crate) unit: &'static str,
    /// Rank at which it is dropped in a narrow table, the highest first; 0 for never.
    pub(crate) rank: u8,
}

impl Head {
    /// A column with one heading on the screen and in print.
    pub(crate) fn new(
        name: &'static str,
        heading: impl Into<String>,
        unit: &'static str,
        rank: u8,
    ) -> Self {
        let heading = heading.into();
        Self {
            name,
            title: heading.replace('\n', " "),
            heading,
            unit,
            rank,
        }
    }

    /// With its unit on the screen too.
    pub(crate) fn with_unit_shown(self) -> Self {
        Self {
            heading: format!("{}\n{}", self.heading, self.unit),
            ..self
        }
    }
}

/// One column.
#[derive(Debug)]
pub(crate) struct SheetColumn {
    pub(crate) head: Head,
    cells: Vec<Option<Uncertain>>,
    words: Vec<String>,
}

impl SheetColumn {
    pub(crate) fn new(head: Head, cells: Vec<Option<Uncertain>>, format: NumberFormat) -> Self {
        let word = |cell: &Option<Uncertain>| match (cell, format) {
            (None, _) => "–".into(),
            (Some(cell), NumberFormat::Plain) => cell.plain(),
            (Some(cell), NumberFormat::Si) => cell.si(),
        };
        Self {
            head,
            words: cells.iter().map(word).collect(),
            cells,
        }
    }

    fn width(&self) -> usize {
        let lines = self.words.iter().chain([&self.head.heading]);
        let lines = lines.flat_map(|words| words.lines());
        lines.map(|line| line.chars().count()).max().unwrap_or(0)
    }

    /// Whether it holds only text.
    fn is_of_words(&self) -> bool {
        let mut cells = self.cells.iter().flatten();
        cells.all(|cell| matches!(cell, Uncertain::Word(_)))
    }
}

impl Sheet {
    /// A table of these columns; the first `fixed` are always shown.
    pub(crate) fn new(fixed: usize, columns: Vec<SheetColumn>, format: NumberFormat) -> Self {
        Self {
            fixed,
            columns,
            format,
            gap: GAP,
            is_cut: false,
        }
    }

    /// Whether it has a column of this name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.columns.iter().any(|column| column.head.name == name)
    }

    /// Its width in columns of a terminal.
    pub(crate) fn width(&self) -> usize {
        width(&self.columns, self.gap)
    }

    /// The whole table if wide, else the columns that fit a terminal of this width.
    pub(crate) fn shaped(self, shape: Shape, width: Option<u16>) -> Self {
        if shape.wide { self } else { self.fitted(width) }
    }

    /// Drops columns until it fits a terminal of this width.
    pub(crate) fn fitted(mut self, most: Option<u16>) -> Self {
        let most = room(most);
        while self.width() > most {
            let others = self.columns.iter().enumerate().skip(self.fixed);
            // Among columns of equal rank, the last one.
            match others.max_by_key(|(_, column)| column.head.rank) {
                Some((place, column)) if column.head.rank > 0 => {
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
        let before = width(fixed, self.gap);
        let mut parts: Vec<Vec<&SheetColumn>> = Vec::new();
        let mut used = usize::MAX;
        for column in rest {
            let wide = column.width() + self.gap;
            if parts.is_empty() || used + wide > most {
                parts.push(fixed.iter().collect());
                used = before;
            }
            used += wide;
            if let Some(part) = parts.last_mut() {
                part.push(column);
            }
        }
        if parts.is_empty() {
            parts.push(fixed.iter().collect());
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
    table.set_header(columns.iter().map(|column| column.head.heading.as_str()));
    let rows = columns.first().map_or(0, |column| column.words.len());
    for row in 0..rows {
        table.add_row(columns.iter().map(|column| column.words[row].as_str()));
    }
    for (drawn, column) in table.column_iter_mut().zip(columns) {
        if gap == NARROW_GAP {
            drawn.set_padding((1, 0));
        }
        if !column.is_of_words() {
            drawn.set_cell_alignment(CellAlignment::Right);
        }
    }
    table.to_string()
}
