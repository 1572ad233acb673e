//! Frames of a run: their compact form in the store, and the files they are exported to.
//!
//! Stored numbers have single precision: seven digits are more than a picture needs, and gaps are stored themselves, not
//! as differences of positions. What decides a run is never read back from a frame.

mod bonds;
mod extxyz;
mod tables;

pub(crate) use bonds::write_bonds;
pub(crate) use extxyz::{Filmed, write_extxyz};
pub use tables::{contact_table, sphere_table};

use sd_core::contact::ContactState;
use sd_core::simulation::{Frame, FrameContact};
use serde::{Deserialize, Serialize};

/// First byte of a stored frame.
const VERSION: u8 = 1;

/// A frame as it is stored.
#[derive(Serialize, Deserialize)]
struct Stored {
    strain: f64,
    side: f32,
    /// Offset of the upper image cell.
    offset: f32,
    /// Radii; a single one if all are equal.
    radii: Vec<f32>,
    /// x, y, orientation, and the stresslet's xx, yy, xy of each sphere.
    spheres: Vec<[f32; 6]>,
    /// i, j, state, and normal x and y, gap, normal and tangential force of each contact.
    contacts: Vec<(u32, u32, u8, [f32; 5])>,
    /// Quasi-force of rolling friction of each contact; none without such friction.
    rolling: Vec<f32>,
}

/// Names of the states, by their stored number.
pub const STATES: [&str; 3] = ["frictionless", "rolling", "slipping"];

/// The number of a state in [`STATES`].
pub fn state_number(state: ContactState) -> u8 {
    match state {
        ContactState::Frictionless => 0,
        ContactState::Rolling => 1,
        ContactState::Slipping => 2,
    }
}

/// A number in single precision.
#[expect(clippy::cast_possible_truncation, reason = "for pictures")]
fn single(value: f64) -> f32 {
    value as f32
}

/// A frame as bytes.
///
/// # Errors
/// Those of the encoder, which is given nothing it cannot encode.
pub fn encode(frame: &Frame) -> Result<Vec<u8>, postcard::Error> {
    let alike = frame
        .radii
        .windows(2)
        .all(|pair| pair[0].to_bits() == pair[1].to_bits());
    let radii = &frame.radii[..if alike {
        frame.radii.len().min(1)
    } else {
        frame.radii.len()
    }];
    let number = |sphere: usize| u32::try_from(sphere).unwrap_or(u32::MAX);
    let stored = Stored {
        strain: frame.strain,
        side: single(frame.side),
        offset: single(frame.offset),
        radii: radii.iter().copied().map(single).collect(),
        spheres: frame
            .centres
            .iter()
            .zip(&frame.orientations)
            .zip(&frame.stresslets)
            .map(|((x, angle), s)| [x[0], x[1], *angle, s[0], s[1], s[2]].map(single))
            .collect(),
        contacts: frame
            .contacts
            .iter()
            .map(|c| {
                let numbers = [
                    c.normal[0],
                    c.normal[1],
                    c.gap,
                    c.normal_force,
                    c.tangential_force,
                ];
                (
                    number(c.i),
                    number(c.j),
                    state_number(c.state),
                    numbers.map(single),
                )
            })
            .collect(),
        rolling: if frame.contacts.iter().any(|c| c.rolling_force != 0.0) {
            let forces = frame.contacts.iter().map(|c| c.rolling_force);
            forces.map(single).collect()
        } else {
            Vec::new()
        },
    };
    postcard::to_extend(&stored, vec![VERSION])
}

/// A frame from bytes; `None` if they are none of this version.
pub fn decode(bytes: &[u8]) -> Option<Frame> {
    let (&VERSION, content) = bytes.split_first()? else {
        return None;
    };
    let stored: Stored = postcard::from_bytes(content).ok()?;
    let n = stored.spheres.len();
    let radii: Vec<f64> = match stored.radii.as_slice() {
        [one] => vec![f64::from(*one); n],
        all => all.iter().copied().map(f64::from).collect(),
    };
    let column = |place: usize| stored.spheres.iter().map(move |s| f64::from(s[place]));
    let contacts: Option<Vec<FrameContact>> = stored
        .contacts
        .iter()
        .enumerate()
        .map(|(k, (i, j, state, numbers))| {
            let [nx, ny, gap, normal_force, tangential_force] = numbers.map(f64::from);
            Some(FrameContact {
                i: usize::try_from(*i).ok().filter(|i| *i < n)?,
                j: usize::try_from(*j).ok().filter(|j| *j < n)?,
                normal: [nx, ny],
                gap,
                normal_force,
                tangential_force,
                rolling_force: stored.rolling.get(k).copied().map_or(0.0, f64::from),
                state: match state {
                    0 => ContactState::Frictionless,
                    1 => ContactState::Rolling,
                    2 => ContactState::Slipping,
                    _ => return None,
                },
            })
        })
        .collect();
    let frame = Frame {
        strain: stored.strain,
        side: f64::from(stored.side),
        offset: f64::from(stored.offset),
        centres: column(0).zip(column(1)).map(|(x, y)| [x, y]).collect(),
        orientations: column(2).collect(),
        stresslets: column(3)
            .zip(column(4))
            .zip(column(5))
            .map(|((xx, yy), xy)| [xx, yy, xy])
            .collect(),
        contacts: contacts?,
        radii,
    };
    (frame.radii.len() == n).then_some(frame)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::write_csv;
    use crate::test_support::frame;

    #[test]
    fn frame_comes_back() {
        let bytes = encode(&frame()).unwrap();
        assert_eq!(decode(&bytes), Some(frame()));
        assert!(bytes.len() < 120);
        for length in 0..bytes.len() {
            assert_eq!(decode(&bytes[..length]), None, "torn at {length}");
        }
    }

    #[test]
    fn tables_have_a_row_per_sphere_and_per_contact() {
        let frame = frame();
        let mut spheres = Vec::new();
        write_csv(&sphere_table(&[(25, &frame), (50, &frame)]), &mut spheres).unwrap();
        assert_eq!(
            String::from_utf8(spheres).unwrap(),
            "step,strain,sphere,x,y,radius,orientation,stresslet_xx,stresslet_yy,stresslet_xy\n\
             25,0.5,0,1,2,1,0,1,-1,20.5\n\
             25,0.5,1,3.5,2,1.5,-0.25,0,0.5,19\n\
             50,0.5,0,1,2,1,0,1,-1,20.5\n\
             50,0.5,1,3.5,2,1.5,-0.25,0,0.5,19\n"
        );
        let mut contacts = Vec::new();
        write_csv(&contact_table(&[(25, &frame)]), &mut contacts).unwrap();
        assert_eq!(
            String::from_utf8(contacts).unwrap(),
            "step,strain,i,j,normal_x,normal_y,gap,normal_force,tangential_force,rolling_force,state\n\
             25,0.5,0,1,1,0,0.0078125,12.5,-2,0.5,slipping\n"
        );
    }
}
