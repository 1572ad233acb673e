//! Contacts as bonds between spheres, in a separate file, since extended XYZ has no bonds.

use super::extxyz::in_space;
use super::{Kept, state_number};
use crate::model::spaces::{AnyFrame, of_either};
use sd_core::simulation::Frame;
use std::io::{self, Write};

/// Writes the contacts of frames, each with its step, as the dump of local data that LAMMPS writes
/// and OVITO loads as bonds: numbers of both spheres from 0, normal and tangential force and the
/// quasi-force of rolling friction in mu·a²·rate (in a suspension the magnitudes of the last two),
/// gap in a, and 1 frictionless, 2 rolling, 3 slipping.
pub(crate) fn write_bonds(frames: &[(u64, &AnyFrame)], out: &mut dyn Write) -> io::Result<()> {
    for (step, frame) in frames {
        of_either!(frame, frame => write_frame(*step, frame, out))?;
    }
    Ok(())
}

fn write_frame<S: Kept>(step: u64, frame: &Frame<S>, out: &mut dyn Write) -> io::Result<()> {
    let (side, tilt, cross) = (frame.side, frame.offset, frame.cross_offset);
    writeln!(out, "ITEM: TIMESTEP\n{step}")?;
    writeln!(out, "ITEM: NUMBER OF ENTRIES\n{}", frame.contacts.len())?;
    let height = frame.radii.iter().copied().fold(1.0, f64::max);
    let (ends, low, high) = match S::DIMENSIONS {
        2 => ("ff", -height, height),
        _ => ("pp", 0.0, side),
    };
    if !frame.is_sheared() {
        writeln!(out, "ITEM: BOX BOUNDS abc origin pp pp {ends}")?;
        for vector in frame.lattice() {
            let [x, y, z] = in_space(vector.as_ref());
            writeln!(out, "{x} {y} {z} 0")?;
        }
        if S::DIMENSIONS < 3 {
            writeln!(out, "0 0 {} {low}", high - low)?;
        }
    } else if cross == 0.0 {
        // LAMMPS names the ends of the box around the tilted cell.
        writeln!(out, "ITEM: BOX BOUNDS xy xz yz pp pp {ends}")?;
        let (left, right) = (tilt.min(0.0), side + tilt.max(0.0));
        writeln!(out, "{left} {right} {tilt}\n0 {side} 0\n{low} {high} 0")?;
    } else {
        // A cell whose second vector has a z has no such box: LAMMPS names the three vectors, each
        // with a component of the corner.
        writeln!(out, "ITEM: BOX BOUNDS abc origin pp pp {ends}")?;
        writeln!(out, "{side} 0 0 0\n{tilt} {side} {cross} 0\n0 0 {side} 0")?;
    }
    writeln!(
        out,
        "ITEM: ENTRIES first second normal_force tangential_force rolling_force gap state"
    )?;
    for contact in &frame.contacts {
        writeln!(
            out,
            "{} {} {} {} {} {} {}",
            contact.i,
            contact.j,
            contact.normal_force,
            S::amount(&contact.tangential_force),
            S::amount(&contact.rolling_force),
            contact.gap,
            state_number(contact.state) + 1
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::spaces::InSpace;
    use crate::test_support::{frame, suspension};

    #[test]
    fn bonds_have_an_entry_per_contact() {
        let mut text = Vec::new();
        write_bonds(&[(25, &frame()), (50, &frame())], &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let half = "ITEM: NUMBER OF ENTRIES\n1\nITEM: BOX BOUNDS xy xz yz pp pp ff\n-2 8 -2\n0 8 0\n-1.5 1.5 0\n\
                    ITEM: ENTRIES first second normal_force tangential_force rolling_force gap state\n0 1 12.5 -2 0.5 0.0078125 3\n";
        assert_eq!(
            text,
            format!("ITEM: TIMESTEP\n25\n{half}ITEM: TIMESTEP\n50\n{half}")
        );
    }

    #[test]
    fn a_cell_that_is_sheared_along_both_axes_is_written_by_its_vectors() {
        let InSpace::Suspension(frame) = suspension(0.5, [1.0, 2.0, 7.5]) else {
            panic!("no suspension");
        };
        let crossed = InSpace::Suspension(Frame {
            cross_offset: 1.5,
            ..frame
        });
        let mut text = Vec::new();
        write_bonds(&[(25, &crossed)], &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let bounds = "ITEM: BOX BOUNDS abc origin pp pp pp\n8 0 0 0\n-2 8 1.5 0\n0 0 8 0\n";
        assert!(text.contains(bounds), "{text}");
    }
}
