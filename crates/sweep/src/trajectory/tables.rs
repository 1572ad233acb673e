//! Frames as tables, for spreadsheets and data frames.

use super::{Kept, STATES, by_space, state_number};
use crate::axes::{Kind, Value};
use crate::data::{Cells, DataColumn};
use crate::spaces::AnyFrame;
use sd_core::simulation::Frame;
use sd_core::{Bulk, Layer};

/// A column of a table of frames: its name, its unit, and its cell of one row of a frame.
struct FrameColumn<S: Kept> {
    name: &'static str,
    unit: &'static str,
    kind: Kind,
    cell: fn(u64, &Frame<S>, usize) -> Value,
}

/// A column of whole numbers.
const fn count<S: Kept>(
    name: &'static str,
    cell: fn(u64, &Frame<S>, usize) -> Value,
) -> FrameColumn<S> {
    FrameColumn {
        name,
        unit: "1",
        kind: Kind::Count,
        cell,
    }
}

/// A column of numbers in that unit.
const fn number<S: Kept>(
    name: &'static str,
    unit: &'static str,
    cell: fn(u64, &Frame<S>, usize) -> Value,
) -> FrameColumn<S> {
    FrameColumn {
        name,
        unit,
        kind: Kind::Number,
        cell,
    }
}

/// Columns that tell a row of a table of spheres.
fn sphere_columns<S: Kept>() -> Vec<FrameColumn<S>> {
    vec![
        count("step", |step, _, _| Value::Count(step)),
        number("strain", "1", |_, f, _| Value::Number(f.strain)),
        count("sphere", |_, _, i| Value::Count(i as u64)),
        number("x", "a", |_, f, i| Value::Number(f.centres[i][0])),
        number("y", "a", |_, f, i| Value::Number(f.centres[i][1])),
    ]
}

/// Unit of stresslets.
const STRESSLET: &str = "mu a^3 rate";

/// Columns of the stresslets that layers and suspensions have.
fn stresslet_columns<S: Kept>() -> Vec<FrameColumn<S>> {
    vec![
        number("stresslet_xx", STRESSLET, |_, f, i| {
            Value::Number(f.stresslets[i][0])
        }),
        number("stresslet_yy", STRESSLET, |_, f, i| {
            Value::Number(f.stresslets[i][1])
        }),
        number("stresslet_xy", STRESSLET, |_, f, i| {
            Value::Number(f.stresslets[i][2])
        }),
    ]
}

/// Columns of the spheres of a layer.
fn layer_spheres() -> Vec<FrameColumn<Layer>> {
    let mut all = sphere_columns();
    all.extend([
        number("radius", "a", |_, f, i| Value::Number(f.radii[i])),
        number("orientation", "rad", |_, f, i| {
            Value::Number(f.orientations[i])
        }),
    ]);
    all.extend(stresslet_columns());
    all
}

/// Columns of the spheres of a suspension, orientations as quaternions.
#[rustfmt::skip]
fn suspended_spheres() -> Vec<FrameColumn<Bulk>> {
    let mut all = sphere_columns();
    all.extend([
        number("z", "a", |_, f: &Frame<Bulk>, i| Value::Number(f.centres[i][2])),
        number("radius", "a", |_, f, i| Value::Number(f.radii[i])),
        number("orientation_w", "1", |_, f, i| Value::Number(f.orientations[i][0])),
        number("orientation_x", "1", |_, f, i| Value::Number(f.orientations[i][1])),
        number("orientation_y", "1", |_, f, i| Value::Number(f.orientations[i][2])),
        number("orientation_z", "1", |_, f, i| Value::Number(f.orientations[i][3])),
    ]);
    all.extend(stresslet_columns());
    all.extend([
        number("stresslet_xz", STRESSLET, |_, f: &Frame<Bulk>, i| Value::Number(f.stresslets[i][3])),
        number("stresslet_yz", STRESSLET, |_, f, i| Value::Number(f.stresslets[i][4])),
    ]);
    all
}

/// Columns of contacts, with those that only their space has: of the normal, and of vectors across it.
#[rustfmt::skip]
fn contact_columns<S: Kept>(normals: Vec<FrameColumn<S>>, across: Vec<FrameColumn<S>>) -> Vec<FrameColumn<S>> {
    let mut all: Vec<FrameColumn<S>> = vec![
        count("step", |step, _, _| Value::Count(step)),
        number("strain", "1", |_, f, _| Value::Number(f.strain)),
        count("i", |_, f, k| Value::Count(f.contacts[k].i as u64)),
        count("j", |_, f, k| Value::Count(f.contacts[k].j as u64)),
        number("normal_x", "1", |_, f, k| Value::Number(f.contacts[k].normal[0])),
        number("normal_y", "1", |_, f, k| Value::Number(f.contacts[k].normal[1])),
    ];
    all.extend(normals);
    all.extend([
        number("gap", "a", |_, f: &Frame<S>, k| Value::Number(f.contacts[k].gap)),
        number("normal_force", FORCE, |_, f, k| Value::Number(f.contacts[k].normal_force)),
    ]);
    all.extend(across);
    all.push(FrameColumn {
        name: "state",
        unit: "",
        kind: Kind::Word,
        cell: |_, f, k| Value::Word(STATES[usize::from(state_number(f.contacts[k].state))]),
    });
    all
}

/// Unit of forces.
const FORCE: &str = "mu a^2 rate";

/// Columns of the contacts of a layer.
#[rustfmt::skip]
fn layer_contacts() -> Vec<FrameColumn<Layer>> {
    contact_columns(Vec::new(), vec![
        number("tangential_force", FORCE, |_, f, k| Value::Number(f.contacts[k].tangential_force)),
        number("rolling_force", FORCE, |_, f, k| Value::Number(f.contacts[k].rolling_force)),
    ])
}

/// Columns of the contacts of a suspension, where forces across the line of centres are vectors.
#[rustfmt::skip]
fn suspended_contacts() -> Vec<FrameColumn<Bulk>> {
    contact_columns(vec![number("normal_z", "1", |_, f, k| Value::Number(f.contacts[k].normal[2]))], vec![
        number("tangential_force_x", FORCE, |_, f, k| Value::Number(f.contacts[k].tangential_force[0])),
        number("tangential_force_y", FORCE, |_, f, k| Value::Number(f.contacts[k].tangential_force[1])),
        number("tangential_force_z", FORCE, |_, f, k| Value::Number(f.contacts[k].tangential_force[2])),
        number("rolling_force_x", FORCE, |_, f, k| Value::Number(f.contacts[k].rolling_force[0])),
        number("rolling_force_y", FORCE, |_, f, k| Value::Number(f.contacts[k].rolling_force[1])),
        number("rolling_force_z", FORCE, |_, f, k| Value::Number(f.contacts[k].rolling_force[2])),
    ])
}

/// The spheres of frames of a run, each with its step, as a table with a row per sphere and frame.
pub fn sphere_table(frames: &[(u64, &AnyFrame)]) -> Vec<DataColumn> {
    let (layers, suspensions) = by_space(frames);
    if suspensions.is_empty() {
        table(&layer_spheres(), &layers, |frame| frame.centres.len())
    } else {
        table(&suspended_spheres(), &suspensions, |frame| {
            frame.centres.len()
        })
    }
}

/// The contacts of frames of a run, each with its step, as a table with a row per contact and frame.
pub fn contact_table(frames: &[(u64, &AnyFrame)]) -> Vec<DataColumn> {
    let (layers, suspensions) = by_space(frames);
    if suspensions.is_empty() {
        table(&layer_contacts(), &layers, |frame| frame.contacts.len())
    } else {
        table(&suspended_contacts(), &suspensions, |frame| {
            frame.contacts.len()
        })
    }
}

/// A table with so many rows of each frame.
fn table<S: Kept>(
    columns: &[FrameColumn<S>],
    frames: &[(u64, &Frame<S>)],
    rows: fn(&Frame<S>) -> usize,
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
