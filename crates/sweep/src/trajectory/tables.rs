//! Frames as tables, for spreadsheets and data frames.

use super::{STATES, state_number};
use crate::axes::{Kind, Value};
use crate::data::{Cells, DataColumn};
use sd_core::simulation::Frame;

/// A column of a table of frames: its name, its unit, and its cell of one row of a frame.
struct FrameColumn {
    name: &'static str,
    unit: &'static str,
    kind: Kind,
    cell: fn(u64, &Frame, usize) -> Value,
}

/// A column of whole numbers.
const fn count(name: &'static str, cell: fn(u64, &Frame, usize) -> Value) -> FrameColumn {
    FrameColumn {
        name,
        unit: "1",
        kind: Kind::Count,
        cell,
    }
}

/// A column of numbers in that unit.
const fn number(
    name: &'static str,
    unit: &'static str,
    cell: fn(u64, &Frame, usize) -> Value,
) -> FrameColumn {
    FrameColumn {
        name,
        unit,
        kind: Kind::Number,
        cell,
    }
}

/// Columns of the table of spheres.
#[rustfmt::skip]
const SPHERE_COLUMNS: [FrameColumn; 10] = [
    count("step", |step, _, _| Value::Count(step)),
    number("strain", "1", |_, f, _| Value::Number(f.strain)),
    count("sphere", |_, _, i| Value::Count(i as u64)),
    number("x", "a", |_, f, i| Value::Number(f.centres[i][0])),
    number("y", "a", |_, f, i| Value::Number(f.centres[i][1])),
    number("radius", "a", |_, f, i| Value::Number(f.radii[i])),
    number("orientation", "rad", |_, f, i| Value::Number(f.orientations[i])),
    number("stresslet_xx", "mu a^3 rate", |_, f, i| Value::Number(f.stresslets[i][0])),
    number("stresslet_yy", "mu a^3 rate", |_, f, i| Value::Number(f.stresslets[i][1])),
    number("stresslet_xy", "mu a^3 rate", |_, f, i| Value::Number(f.stresslets[i][2])),
];
/// Columns of the table of contacts.
#[rustfmt::skip]
const CONTACT_COLUMNS: [FrameColumn; 11] = [
    count("step", |step, _, _| Value::Count(step)),
    number("strain", "1", |_, f, _| Value::Number(f.strain)),
    count("i", |_, f, k| Value::Count(f.contacts[k].i as u64)),
    count("j", |_, f, k| Value::Count(f.contacts[k].j as u64)),
    number("normal_x", "1", |_, f, k| Value::Number(f.contacts[k].normal[0])),
    number("normal_y", "1", |_, f, k| Value::Number(f.contacts[k].normal[1])),
    number("gap", "a", |_, f, k| Value::Number(f.contacts[k].gap)),
    number("normal_force", "mu a^2 rate", |_, f, k| Value::Number(f.contacts[k].normal_force)),
    number("tangential_force", "mu a^2 rate", |_, f, k| Value::Number(f.contacts[k].tangential_force)),
    number("rolling_force", "mu a^2 rate", |_, f, k| Value::Number(f.contacts[k].rolling_force)),
    FrameColumn {
        name: "state",
        unit: "",
        kind: Kind::Word,
        cell: |_, f, k| Value::Word(STATES[usize::from(state_number(f.contacts[k].state))]),
    },
];

/// The spheres of frames, each with its step, as a table with a row per sphere and frame.
pub fn sphere_table(frames: &[(u64, &Frame)]) -> Vec<DataColumn> {
    table(&SPHERE_COLUMNS, frames, |frame| frame.centres.len())
}

/// The contacts of frames, each with its step, as a table with a row per contact and frame.
pub fn contact_table(frames: &[(u64, &Frame)]) -> Vec<DataColumn> {
    table(&CONTACT_COLUMNS, frames, |frame| frame.contacts.len())
}

/// A table with so many rows of each frame.
fn table(
    columns: &[FrameColumn],
    frames: &[(u64, &Frame)],
    rows: fn(&Frame) -> usize,
) -> Vec<DataColumn> {
    let all = frames.iter().map(|(_, frame)| rows(frame)).sum();
    columns
        .iter()
        .map(|column| {
            let mut cells = Cells::with_capacity(column.kind, all);
            for (step, frame) in frames {
                for row in 0..rows(frame) {
                    cells.push(Some((column.cell)(*step, frame, row)));
                }
            }
            DataColumn {
                unit: column.unit,
                cells,
                ..DataColumn::named(column.name, column.kind, 0)
            }
        })
        .collect()
}
