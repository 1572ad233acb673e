//! Frames as tables, for spreadsheets and data frames.

use super::{Frames, Kept, STATES, by_space, state_number};
use crate::data::DataColumn;
use crate::data::{Kind, Value};
use crate::model::spaces::AnyFrame;
use sd_core::simulation::Frame;
use std::slice::from_ref;

/// Unit of stresslets.
const STRESSLET: &str = "mu a^3 rate";
/// Unit of forces.
const FORCE: &str = "mu a^2 rate";

/// The meaning of a column, whose name may end with a component.
fn meaning(name: &str) -> &'static str {
    let name = ["_w", "_xx", "_yy", "_xy", "_xz", "_yz", "_x", "_y", "_z"]
        .iter()
        .find_map(|component| name.strip_suffix(component))
        .unwrap_or(name);
    match name {
        "step" => "steps from the start of the run",
        "strain" => "strain from the start of the run",
        "cell_side" => "side of the cell",
        "cell_offset" => "shift along the flow of the images above",
        "cell_cross_offset" => "shift along the vorticity of the images above",
        "lattice_1" | "lattice_2" | "lattice_3" => "component of a lattice vector of the cell",
        "sphere" => "number of the sphere, from 0",
        "i" => "number of the first sphere of the contact, from 0",
        "j" => "number of the second sphere of the contact, from 0",
        "x" | "y" | "z" => "centre, in the cell",
        "unwrapped" => "centre, followed over the edges of the cell from the start of the run",
        "radius" => "radius",
        "orientation" => "rotation since the start of the run",
        "velocity" => "velocity, with that of the background at the centre in the cell",
        "angular_velocity" => "angular velocity, with that of the background",
        "stresslet" => "stresslet",
        "normal" => "unit vector from the first sphere to the second",
        "gap" => "gap between the surfaces of smooth spheres",
        "normal_force" => "normal force, positive for repulsion",
        "tangential_force" => "tangential force, perpendicular to the normal",
        "rolling_force" => "quasi-force of rolling friction",
        _ => "frictionless, rolling or slipping",
    }
}

/// A table of frames, with a row per sphere or per contact.
struct FrameTable<'f, S: Kept> {
    /// Step, frame, and index of the sphere or the contact in it.
    rows: Vec<(u64, &'f Frame<S>, usize)>,
    columns: Vec<DataColumn>,
}

impl<'f, S: Kept> FrameTable<'f, S> {
    /// A table with a number of rows per frame, and columns that identify the frame.
    fn of(frames: &Frames<'f, S>, rows: fn(&Frame<S>) -> usize) -> Self {
        let rows = frames.iter().flat_map(|(step, frame)| {
            let all = 0..rows(frame);
            all.map(|row| (*step, *frame, row))
        });
        let mut table = Self {
            rows: rows.collect(),
            columns: Vec::new(),
        };
        table.add("step", "1", Kind::Count, |step, _, _| Value::Count(step));
        table.numbers(&["strain"], "1", |frame, _| from_ref(&frame.strain));
        table
    }

    fn add(
        &mut self,
        name: &'static str,
        unit: &'static str,
        kind: Kind,
        cell: impl Fn(u64, &'f Frame<S>, usize) -> Value,
    ) {
        let rows = self.rows.iter();
        let cells = rows.map(|(step, frame, row)| Some(cell(*step, frame, *row)));
        self.columns.push(DataColumn {
            unit,
            ..DataColumn::of(name, kind, meaning(name), cells)
        });
    }

    /// A column for each of several numbers.
    fn numbers(
        &mut self,
        names: &[&'static str],
        unit: &'static str,
        of: impl Fn(&'f Frame<S>, usize) -> &'f [f64],
    ) {
        for (place, name) in names.iter().enumerate() {
            self.add(name, unit, Kind::Number, |_, frame, row| {
                Value::Number(of(frame, row)[place])
            });
        }
    }
}

/// The spheres of frames and their cell, whose lattice vectors are `(cell_side, 0)` and
/// `(cell_offset, cell_side)`, in a suspension `(cell_offset, cell_side, cell_cross_offset)`; in
/// flows other than shear they have columns of their own. Orientations are angles, or quaternions.
fn spheres<S: Kept>(frames: &Frames<'_, S>) -> Vec<DataColumn> {
    let mut table = FrameTable::of(frames, |frame| frame.centres.len());
    if frames.iter().all(|(_, frame)| frame.is_sheared()) {
        table.numbers(&["cell_side"], "a", |f, _| from_ref(&f.side));
        table.numbers(&["cell_offset"], "a", |f, _| from_ref(&f.offset));
        if S::DIMENSIONS > 2 {
            table.numbers(&["cell_cross_offset"], "a", |f, _| {
                from_ref(&f.cross_offset)
            });
        }
    } else {
        let names = [
            ["lattice_1_x", "lattice_1_y", "lattice_1_z"],
            ["lattice_2_x", "lattice_2_y", "lattice_2_z"],
            ["lattice_3_x", "lattice_3_y", "lattice_3_z"],
        ];
        for (row, names) in names.iter().enumerate().take(S::DIMENSIONS) {
            table.numbers(&names[..S::DIMENSIONS], "a", |f, _| f.vectors[row].as_ref());
        }
    }
    table.add("sphere", "1", Kind::Count, |_, _, i| Value::Count(i as u64));
    let centre = ["x", "y", "z"];
    table.numbers(&centre[..S::DIMENSIONS], "a", |f, i| f.centres[i].as_ref());
    let unwrapped = ["unwrapped_x", "unwrapped_y", "unwrapped_z"];
    let unwrapped = &unwrapped[..S::DIMENSIONS];
    table.numbers(unwrapped, "a", |f, i| f.unwrapped[i].as_ref());
    table.numbers(&["radius"], "a", |f, i| from_ref(&f.radii[i]));
    let (orientation, unit): (&[&str], &str) = match S::ORIENTATION {
        1 => (&["orientation"], "rad"),
        _ => (
            &[
                "orientation_w",
                "orientation_x",
                "orientation_y",
                "orientation_z",
            ],
            "1",
        ),
    };
    table.numbers(orientation, unit, |f, i| S::orientation(&f.orientations[i]));
    let velocity = ["velocity_x", "velocity_y", "velocity_z"];
    let velocity = &velocity[..S::DIMENSIONS];
    table.numbers(velocity, "a rate", |f, i| f.velocities[i].as_ref());
    let spin: &[&str] = match S::SPIN {
        1 => &["angular_velocity"],
        _ => &[
            "angular_velocity_x",
            "angular_velocity_y",
            "angular_velocity_z",
        ],
    };
    table.numbers(spin, "rate", |f, i| S::spin(&f.angular_velocities[i]));
    let stresslet = [
        "stresslet_xx",
        "stresslet_yy",
        "stresslet_xy",
        "stresslet_xz",
        "stresslet_yz",
    ];
    let stresslet = &stresslet[..S::STRAINS];
    table.numbers(stresslet, STRESSLET, |f, i| f.stresslets[i].as_ref());
    table.columns
}

/// The contacts of frames; in a suspension with the vectors of the forces perpendicular to the line
/// of centres.
fn contacts<S: Kept>(frames: &Frames<'_, S>) -> Vec<DataColumn> {
    let mut table = FrameTable::of(frames, |frame| frame.contacts.len());
    for (name, of) in [("i", 0), ("j", 1)] {
        table.add(name, "1", Kind::Count, |_, frame, k| {
            let contact = &frame.contacts[k];
            Value::Count([contact.i, contact.j][of] as u64)
        });
    }
    let normal = ["normal_x", "normal_y", "normal_z"];
    let normal = &normal[..S::DIMENSIONS];
    table.numbers(normal, "1", |f, k| f.contacts[k].normal.as_ref());
    table.numbers(&["gap"], "a", |f, k| from_ref(&f.contacts[k].gap));
    table.numbers(&["normal_force"], FORCE, |f, k| {
        from_ref(&f.contacts[k].normal_force)
    });
    let (tangential, rolling): (&[&str], &[&str]) = match S::TANGENT {
        1 => (&["tangential_force"], &["rolling_force"]),
        _ => (
            &[
                "tangential_force_x",
                "tangential_force_y",
                "tangential_force_z",
            ],
            &["rolling_force_x", "rolling_force_y", "rolling_force_z"],
        ),
    };
    table.numbers(tangential, FORCE, |f, k| {
        S::across(&f.contacts[k].tangential_force)
    });
    table.numbers(rolling, FORCE, |f, k| {
        S::across(&f.contacts[k].rolling_force)
    });
    table.add("state", "", Kind::Word, |_, frame, k| {
        Value::Word(STATES[usize::from(state_number(frame.contacts[k].state))])
    });
    table.columns
}

/// The spheres of frames of a run, each with its step, as a table with a row per sphere and frame.
pub fn sphere_table(frames: &[(u64, &AnyFrame)]) -> Vec<DataColumn> {
    let (layers, suspensions) = by_space(frames);
    if suspensions.is_empty() {
        spheres(&layers)
    } else {
        spheres(&suspensions)
    }
}

/// The contacts of frames of a run, each with its step, as a table with a row per contact and
/// frame.
pub fn contact_table(frames: &[(u64, &AnyFrame)]) -> Vec<DataColumn> {
    let (layers, suspensions) = by_space(frames);
    if suspensions.is_empty() {
        contacts(&layers)
    } else {
        contacts(&suspensions)
    }
}
