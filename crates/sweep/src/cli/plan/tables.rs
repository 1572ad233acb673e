//! The tables of a plan: its axes, and its kinds of runs.

use crate::error::Error;
use crate::plan::{Kind, Plan, Source, Values};
use crate::report::{Head, Shape, Sheet, SheetColumn, room};
use crate::text::format::{Digits, Uncertain, bytes, duration, significant};
use std::io::{self, Write};

/// Maximum characters of a kind on one line.
const ONE_LINE: usize = 34;
/// Columns of a terminal apart from the values of an axis: its name, their number, the spaces
/// between.
const COLUMNS_WITHOUT_VALUES: usize = 6;

/// A column of the kinds of runs: name, heading, unit, rank at which it is dropped, and content.
type Column = (
    &'static str,
    &'static str,
    &'static str,
    u8,
    fn(&Kind) -> Uncertain,
);

/// All columns but those that name a kind. Names are those of JSON.
const COLUMNS: [Column; 7] = [
    ("steps", "steps", "", 3, |kind| Uncertain::Count(kind.steps)),
    ("cases", "runs", "", 0, |kind| {
        Uncertain::Count(kind.cases as u64)
    }),
    ("step_s", "step", "ms", 0, step),
    ("run_s", "run", "", 4, |kind| {
        about(kind, duration(kind.step_s * kind.steps as f64))
    }),
    ("computing_time_s", "all runs", "", 0, |kind| {
        about(kind, duration(kind.computing_time_s))
    }),
    ("memory_bytes", "memory", "", 1, |kind| {
        Uncertain::Quantity(bytes(kind.memory_bytes))
    }),
    ("source", "known from", "", 2, |kind| {
        Uncertain::word(match kind.source {
            Source::Runs => "runs here",
            Source::Trial => "a short run",
            Source::Rough => "other runs",
        })
    }),
];

/// CPU milliseconds per step, with their interval where it is known.
fn step(kind: &Kind) -> Uncertain {
    match kind.step_ci95_s.filter(|half| *half > 0.0) {
        Some(half) => Uncertain::Interval(1e3 * kind.step_s, 1e3 * half),
        None if kind.measured => Uncertain::of(1e3 * kind.step_s, 3),
        None => about(kind, significant(1e3 * kind.step_s, 3)),
    }
}

/// Text, marked where no similar run was measured.
fn about(kind: &Kind, words: String) -> Uncertain {
    Uncertain::Quantity(if kind.measured {
        words
    } else {
        format!("≈ {words}")
    })
}

/// The columns with these names; all of them without names.
///
/// # Errors
/// A name that no column has.
pub(super) fn columns_named(names: &[String]) -> Result<Vec<Column>, Error> {
    let of = |name: &String| {
        let name = name.trim().replace('-', "_");
        let column = COLUMNS.iter().find(|column| column.0 == name);
        column.copied().ok_or_else(|| Error::Argument {
            argument: "--columns",
            message: format!(
                "no column is called {name:?}; besides those that name the runs there are {}",
                COLUMNS.map(|column| column.0).join(", ")
            ),
        })
    };
    names.iter().map(of).collect()
}

/// The tables of a plan.
pub(super) struct Sheets {
    axes: Sheet,
    /// Empty without remaining work.
    kinds: Option<Sheet>,
}

impl Sheets {
    /// The tables for a terminal of this width, with the columns chosen or else as many as fit.
    pub(super) fn of(plan: &Plan, chosen: &[Column], shape: Shape, width: Option<u16>) -> Self {
        Self {
            axes: axes(plan, shape, width),
            kinds: (!plan.kinds.is_empty()).then(|| kinds(&plan.kinds, chosen, shape, width)),
        }
    }

    /// Writes them as text.
    pub(super) fn write(&self, width: Option<u16>, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{}", self.axes.text(None))?;
        if let Some(kinds) = &self.kinds {
            writeln!(out, "{}", kinds.text(width))?;
            if kinds.is_cut {
                let all = COLUMNS.map(|column| column.0).join(", ");
                writeln!(out, "more columns: --wide, or those of --columns: {all}")?;
            }
        }
        Ok(())
    }

    /// Writes them as LaTeX, one after the other.
    pub(super) fn write_latex(&self, plan: &Plan, out: &mut dyn Write) -> io::Result<()> {
        let origin = format!(
            "plan of campaign {}: {} runs at {} points\nmade by sweep {}",
            plan.campaign,
            plan.cases,
            plan.points,
            env!("CARGO_PKG_VERSION")
        );
        self.axes.write_latex(&origin, out)?;
        if let Some(kinds) = &self.kinds {
            writeln!(out)?;
            kinds.write_latex(&origin, out)?;
        }
        Ok(())
    }
}

/// The axes with as many of their values as fit.
fn axes(plan: &Plan, shape: Shape, width: Option<u16>) -> Sheet {
    let widest = plan.axes.iter().map(|(name, _)| name.len()).max();
    let besides = widest.unwrap_or(0) + "number".len() + COLUMNS_WITHOUT_VALUES;
    let most = if shape.wide {
        usize::MAX
    } else {
        room(width).saturating_sub(besides)
    };
    let column = |name, heading: &str, cell: &dyn Fn(&Values) -> Uncertain| {
        let cells = plan.axes.iter().map(|axis| Some(cell(axis))).collect();
        SheetColumn::new(Head::new(name, heading, "", 0), cells, shape.format)
    };
    let columns = vec![
        column("axis", "axis", &|(name, _)| Uncertain::word(*name)),
        column("number", "number", &|(_, values)| {
            Uncertain::Count(values.len() as u64)
        }),
        column("values", "values", &|(_, values)| {
            Uncertain::word(listed(values, most))
        }),
    ];
    Sheet::new(1, columns, shape.format)
}

/// Values as a list of limited length that includes the last one.
fn listed(values: &[serde_json::Value], most: usize) -> String {
    let numbers = values.iter().filter(|value| value.is_f64());
    let digits = Digits::of(numbers.filter_map(serde_json::Value::as_f64));
    let word = |value: &serde_json::Value| match (value.as_str(), value.as_f64()) {
        (Some(word), _) => word.to_owned(),
        (None, Some(number)) if value.is_f64() => digits.write(number),
        _ => value.to_string(),
    };
    let words: Vec<String> = values.iter().map(word).collect();
    let whole = words.join(", ");
    if whole.chars().count() <= most {
        return whole;
    }
    let last = words.last().cloned().unwrap_or_default();
    let with = |number: usize| format!("{}, … {last}", words[..number].join(", "));
    let fits = |number: &usize| with(*number).chars().count() <= most;
    with((1..words.len()).rev().find(fits).unwrap_or(1))
}

/// The kinds of runs.
fn kinds(kinds: &[Kind], chosen: &[Column], shape: Shape, width: Option<u16>) -> Sheet {
    let name = |kind: &Kind| {
        let contacts = match kind.tangential {
            "roll-slip" => kind.contact.to_owned(),
            other => format!("{}, {other}", kind.contact),
        };
        let line = format!("{}, {contacts}", kind.hydrodynamics);
        if line.len() > ONE_LINE {
            format!("{},\n{contacts}", kind.hydrodynamics)
        } else {
            line
        }
    };
    let column = |head, cell: &dyn Fn(&Kind) -> Uncertain| {
        let cells = kinds.iter().map(|kind| Some(cell(kind))).collect();
        SheetColumn::new(head, cells, shape.format)
    };
    let mut columns = vec![
        column(Head::new("spheres", "N", "", 0), &|kind| {
            Uncertain::Count(kind.spheres as u64)
        }),
        column(
            Head::new("kind", "hydrodynamics and contacts", "", 0),
            &|kind| Uncertain::word(name(kind)),
        ),
    ];
    // Otherwise kinds that differ only in their step would look the same.
    if kinds
        .iter()
        .any(|kind| kind.time_step != kinds[0].time_step)
    {
        let digits = Digits::of(kinds.iter().map(|kind| kind.time_step));
        columns.push(column(Head::new("time_step", "Δt", "", 0), &|kind| {
            Uncertain::Short(kind.time_step, digits)
        }));
    }
    let fixed = columns.len();
    let is_chosen = !chosen.is_empty();
    let wanted = if is_chosen { chosen } else { &COLUMNS[..] };
    columns.extend(wanted.iter().map(|(name, heading, unit, rank, cell)| {
        let head = Head::new(name, *heading, unit, *rank);
        let head = if unit.is_empty() {
            head
        } else {
            head.with_unit_shown()
        };
        column(head, cell)
    }));
    let sheet = Sheet::new(fixed, columns, shape.format);
    if is_chosen || shape.wide {
        sheet
    } else {
        sheet.fitted(width)
    }
}
