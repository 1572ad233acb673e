//! Frames of a run: their compact form in the store, and the files they are exported to.
//!
//! Stored numbers have single precision: seven digits are more than a picture needs, and gaps are
//! stored explicitly, not as differences of positions. A run never depends on a stored frame.

mod bonds;
mod extxyz;
mod tables;

pub(crate) use bonds::write_bonds;
pub(crate) use extxyz::{FrameSource, write_extxyz};
pub use tables::{contact_table, sphere_table};

use crate::model::spaces::{AnyFrame, InSpace};
use sd_core::contact::ContactState;
use sd_core::simulation::{Frame, FrameContact};
use sd_core::{Bulk, Layer, Space};
use serde::{Deserialize, Serialize};

/// First byte of a stored frame of a layer.
const LAYER: u8 = 5;
/// First byte of a stored frame of a suspension.
const SUSPENSION: u8 = 6;
/// What a frame in a lattice that is no sheared cell adds to its first byte; its vectors follow.
const IN_LATTICE: u8 = 2;

/// Why bytes are not a usable frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// A format of an earlier version, without velocities.
    #[error("a frame of an earlier version, without velocities")]
    Earlier,
    /// Torn, or something else.
    #[error("no frame, or a torn one")]
    Unreadable,
}

/// A stored frame.
#[derive(Serialize, Deserialize)]
struct Stored {
    strain: f64,
    side: f32,
    /// Offset of the upper image cell.
    offset: f32,
    /// Its offset along the vorticity.
    cross_offset: f32,
    /// Radii; a single one if all are equal.
    radii: Vec<f32>,
    /// For each sphere: centre, orientation, stresslet.
    spheres: Vec<f32>,
    /// For each sphere: velocity, angular velocity.
    motion: Vec<f32>,
    /// Positions that are not wrapped grow with the strain, so they keep their precision.
    unwrapped: Vec<f64>,
    /// i, j, state of each contact.
    contacts: Vec<(u32, u32, u8)>,
    /// For each contact: normal, gap, normal force, tangential force.
    forces: Vec<f32>,
    /// Quasi-force of rolling friction of each contact; none without such friction.
    rolling: Vec<f32>,
}

/// A space with stored frames: its orientations and tangents as numbers.
pub trait Kept: Space {
    /// First byte of its stored frames.
    const VERSION: u8;
    /// Number of components of an orientation.
    const ORIENTATION: usize;
    /// Number of components of an angular velocity.
    const SPIN: usize;
    /// Number of components of a vector perpendicular to a line of centres.
    const TANGENT: usize;

    /// The components of an orientation.
    fn orientation(orientation: &Self::Orientation) -> &[f64];

    /// The orientation with these components.
    fn orientation_of(numbers: &[f64]) -> Self::Orientation;

    /// The components of an angular velocity.
    fn spin(spin: &Self::Spin) -> &[f64];

    /// The angular velocity with these components.
    fn spin_of(numbers: &[f64]) -> Self::Spin;

    /// The components of a vector perpendicular to a line of centres.
    fn across(tangent: &Self::Tangent) -> &[f64];

    /// The vector with these components.
    fn tangent_of(numbers: &[f64]) -> Self::Tangent;

    /// The component of a force perpendicular to a line of centres: signed in a layer, else its
    /// magnitude.
    fn amount(tangent: &Self::Tangent) -> f64;

    /// The angle in the plane of flow and gradient of a line that lay along the flow at strain 0.
    fn angle(orientation: &Self::Orientation) -> f64;

    /// The vorticity component of the rotation between two orientations; in a suspension that by
    /// less than half a turn.
    fn turned_by(from: &Self::Orientation, to: &Self::Orientation) -> f64;
}

impl Kept for Layer {
    const VERSION: u8 = LAYER;
    const ORIENTATION: usize = 1;
    const SPIN: usize = 1;
    const TANGENT: usize = 1;

    fn orientation(orientation: &f64) -> &[f64] {
        std::slice::from_ref(orientation)
    }

    fn orientation_of(numbers: &[f64]) -> f64 {
        numbers[0]
    }

    fn spin(spin: &f64) -> &[f64] {
        std::slice::from_ref(spin)
    }

    fn spin_of(numbers: &[f64]) -> f64 {
        numbers[0]
    }

    fn across(tangent: &f64) -> &[f64] {
        std::slice::from_ref(tangent)
    }

    fn tangent_of(numbers: &[f64]) -> f64 {
        numbers[0]
    }

    fn amount(tangent: &f64) -> f64 {
        *tangent
    }

    fn angle(orientation: &f64) -> f64 {
        *orientation
    }

    fn turned_by(from: &f64, to: &f64) -> f64 {
        to - from
    }
}

impl Kept for Bulk {
    const VERSION: u8 = SUSPENSION;
    const ORIENTATION: usize = 4;
    const SPIN: usize = 3;
    const TANGENT: usize = 3;

    fn orientation(orientation: &Self::Orientation) -> &[f64] {
        orientation
    }

    fn orientation_of(numbers: &[f64]) -> Self::Orientation {
        std::array::from_fn(|k| numbers[k])
    }

    fn spin(spin: &Self::Spin) -> &[f64] {
        spin.as_slice()
    }

    fn spin_of(numbers: &[f64]) -> Self::Spin {
        Self::Spin::from_iterator(numbers.iter().copied())
    }

    fn across(tangent: &Self::Tangent) -> &[f64] {
        tangent.as_slice()
    }

    fn tangent_of(numbers: &[f64]) -> Self::Tangent {
        let mut tangent = Self::Tangent::default();
        for (place, number) in numbers.iter().enumerate() {
            tangent[place] = *number;
        }
        tangent
    }

    fn amount(tangent: &Self::Tangent) -> f64 {
        Self::tangent_dot(tangent, tangent).sqrt()
    }

    fn angle([w, x, y, z]: &Self::Orientation) -> f64 {
        (2.0 * (x * y + w * z)).atan2(1.0 - 2.0 * (y * y + z * z))
    }

    fn turned_by([a, b, c, d]: &Self::Orientation, [w, x, y, z]: &Self::Orientation) -> f64 {
        // The product of the second and the inverse of the first.
        let cosine = w * a + x * b + y * c + z * d;
        let vector = [
            x * a - w * b - y * d + z * c,
            y * a - w * c - z * b + x * d,
            z * a - w * d - x * c + y * b,
        ];
        let sine = vector.iter().map(|part| part * part).sum::<f64>().sqrt();
        let half = sine.atan2(cosine.abs());
        // Of a small angle the sine itself.
        let ratio = if sine > 0.0 { half / sine } else { 1.0 };
        2.0 * ratio * vector[2] * cosine.signum()
    }
}

/// Names of the states, by their stored number.
pub const STATES: [&str; 3] = ["frictionless", "rolling", "slipping"];

/// The index of a state in [`STATES`].
pub fn state_number(state: ContactState) -> u8 {
    match state {
        ContactState::Frictionless => 0,
        ContactState::Sticking => 1,
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
/// Those of the encoder, which cannot occur for this data.
pub fn encode(frame: &AnyFrame) -> Result<Vec<u8>, postcard::Error> {
    match frame {
        InSpace::Layer(frame) => encode_in(frame),
        InSpace::Suspension(frame) => encode_in(frame),
    }
}

fn encode_in<S: Kept>(frame: &Frame<S>) -> Result<Vec<u8>, postcard::Error> {
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
    let spheres = frame
        .centres
        .iter()
        .zip(&frame.orientations)
        .zip(&frame.stresslets);
    let contacts = &frame.contacts;
    let rolls = contacts
        .iter()
        .any(|c| c.rolling_force != S::Tangent::default());
    let stored = Stored {
        strain: frame.strain,
        side: single(frame.side),
        offset: single(frame.offset),
        cross_offset: single(frame.cross_offset),
        radii: radii.iter().copied().map(single).collect(),
        spheres: spheres
            .flat_map(|((x, orientation), stresslet)| {
                [x.as_ref(), S::orientation(orientation), stresslet.as_ref()]
            })
            .flatten()
            .copied()
            .map(single)
            .collect(),
        motion: frame
            .velocities
            .iter()
            .zip(&frame.angular_velocities)
            .flat_map(|(velocity, spin)| [velocity.as_ref(), S::spin(spin)])
            .flatten()
            .copied()
            .map(single)
            .collect(),
        unwrapped: frame
            .unwrapped
            .iter()
            .flat_map(AsRef::as_ref)
            .copied()
            .collect(),
        contacts: contacts
            .iter()
            .map(|c| (number(c.i), number(c.j), state_number(c.state)))
            .collect(),
        forces: contacts
            .iter()
            .flat_map(|c| {
                let along = c.normal.as_ref().iter().copied();
                let across = S::across(&c.tangential_force).iter().copied();
                along.chain([c.gap, c.normal_force]).chain(across)
            })
            .map(single)
            .collect(),
        rolling: contacts
            .iter()
            .filter(|_| rolls)
            .flat_map(|c| S::across(&c.rolling_force))
            .copied()
            .map(single)
            .collect(),
    };
    let mut bytes = vec![S::VERSION];
    if !frame.is_sheared() {
        bytes[0] += IN_LATTICE;
        let numbers = frame.vectors.iter().flat_map(AsRef::as_ref);
        bytes.extend(numbers.flat_map(|number| number.to_le_bytes()));
    }
    postcard::to_extend(&stored, bytes)
}

/// A frame from bytes.
///
/// # Errors
/// [`FrameError`] if they are not a whole frame of this version.
pub fn decode(bytes: &[u8]) -> Result<AnyFrame, FrameError> {
    let (version, content) = bytes.split_first().ok_or(FrameError::Unreadable)?;
    let frame = match *version {
        1..LAYER => return Err(FrameError::Earlier),
        LAYER => decode_in(&[], content).map(InSpace::Layer),
        SUSPENSION => decode_in(&[], content).map(InSpace::Suspension),
        LAYER_IN_LATTICE => decode_in_lattice(content).map(InSpace::Layer),
        SUSPENSION_IN_LATTICE => decode_in_lattice(content).map(InSpace::Suspension),
        _ => None,
    };
    frame.ok_or(FrameError::Unreadable)
}

/// First bytes of frames in lattices.
const LAYER_IN_LATTICE: u8 = LAYER + IN_LATTICE;
const SUSPENSION_IN_LATTICE: u8 = SUSPENSION + IN_LATTICE;

/// A frame after the vectors of its lattice.
fn decode_in_lattice<S: Kept>(bytes: &[u8]) -> Option<Frame<S>> {
    let length = S::DIMENSIONS * S::DIMENSIONS * size_of::<f64>();
    let (vectors, content) = bytes.split_at_checked(length)?;
    let (numbers, _) = vectors.as_chunks();
    let numbers: Vec<f64> = numbers
        .iter()
        .map(|bytes| f64::from_le_bytes(*bytes))
        .collect();
    decode_in(&numbers, content)
}

/// Frames with their steps.
pub(crate) type Frames<'f, S> = Vec<(u64, &'f Frame<S>)>;

/// Frames of layers, and frames of suspensions. One of the two is empty.
pub(crate) fn by_space<'f>(
    frames: &[(u64, &'f AnyFrame)],
) -> (Frames<'f, Layer>, Frames<'f, Bulk>) {
    let (mut layers, mut suspensions) = (Vec::new(), Vec::new());
    for (step, frame) in frames {
        match frame {
            InSpace::Layer(frame) => layers.push((*step, frame)),
            InSpace::Suspension(frame) => suspensions.push((*step, frame)),
        }
    }
    (layers, suspensions)
}

/// Numbers in rows of that length; `None` if the number of rows does not match.
fn rows<T: Copy + Into<f64>>(numbers: &[T], length: usize, count: usize) -> Option<Vec<Vec<f64>>> {
    let is_whole = Some(numbers.len()) == length.checked_mul(count);
    let row = |row: &[T]| row.iter().copied().map(T::into).collect();
    is_whole.then(|| numbers.chunks_exact(length).map(row).collect())
}

/// A vector of so many numbers.
fn few<T: Default + AsMut<[f64]>>(numbers: &[f64]) -> T {
    let mut all = T::default();
    all.as_mut().copy_from_slice(numbers);
    all
}

fn decode_in<S: Kept>(vectors: &[f64], content: &[u8]) -> Option<Frame<S>> {
    let stored: Stored = postcard::from_bytes(content).ok()?;
    let oriented = S::DIMENSIONS + S::ORIENTATION;
    let of_sphere = oriented + S::STRAINS;
    let n = stored.spheres.len() / of_sphere;
    let spheres = rows(&stored.spheres, of_sphere, n)?;
    let of_motion = S::DIMENSIONS + S::SPIN;
    let motion = rows(&stored.motion, of_motion, n)?;
    let unwrapped = rows(&stored.unwrapped, S::DIMENSIONS, n)?;
    let radii: Vec<f64> = match stored.radii.as_slice() {
        [one] => vec![f64::from(*one); n],
        all => all.iter().copied().map(f64::from).collect(),
    };
    let touching = stored.contacts.len();
    let forces = rows(&stored.forces, S::DIMENSIONS + 2 + S::TANGENT, touching)?;
    let rolls = !stored.rolling.is_empty();
    let rolling = rows(
        &stored.rolling,
        S::TANGENT,
        if rolls { touching } else { 0 },
    )?;
    let contacts: Option<Vec<FrameContact<S>>> = stored
        .contacts
        .iter()
        .zip(&forces)
        .enumerate()
        .map(|(k, ((i, j, state), numbers))| {
            let (normal, rest) = numbers.split_at(S::DIMENSIONS);
            let rolling_force = rolling.get(k).map(|force| S::tangent_of(force));
            Some(FrameContact {
                i: usize::try_from(*i).ok().filter(|i| *i < n)?,
                j: usize::try_from(*j).ok().filter(|j| *j < n)?,
                normal: few(normal),
                gap: rest[0],
                normal_force: rest[1],
                tangential_force: S::tangent_of(&rest[2..]),
                rolling_force: rolling_force.unwrap_or_default(),
                state: match state {
                    0 => ContactState::Frictionless,
                    1 => ContactState::Sticking,
                    2 => ContactState::Slipping,
                    _ => return None,
                },
            })
        })
        .collect();
    let frame = Frame {
        strain: stored.strain,
        side: f64::from(stored.side),
        vectors: vectors.chunks_exact(S::DIMENSIONS).map(few).collect(),
        offset: f64::from(stored.offset),
        cross_offset: f64::from(stored.cross_offset),
        unwrapped: unwrapped.iter().map(|x| few(x)).collect(),
        velocities: motion.iter().map(|m| few(&m[..S::DIMENSIONS])).collect(),
        angular_velocities: motion
            .iter()
            .map(|m| S::spin_of(&m[S::DIMENSIONS..]))
            .collect(),
        centres: spheres.iter().map(|s| few(&s[..S::DIMENSIONS])).collect(),
        orientations: spheres
            .iter()
            .map(|s| S::orientation_of(&s[S::DIMENSIONS..oriented]))
            .collect(),
        stresslets: spheres.iter().map(|s| few(&s[oriented..])).collect(),
        contacts: contacts?,
        radii,
    };
    (frame.radii.len() == n).then_some(frame)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::write_csv;
    use crate::test_support::{frame, suspension};

    #[test]
    fn frame_comes_back() {
        let bytes = encode(&frame()).unwrap();
        assert_eq!(decode(&bytes), Ok(frame()));
        assert!(bytes.len() < 180);
        for length in 0..bytes.len() {
            let torn = decode(&bytes[..length]);
            assert_eq!(torn, Err(FrameError::Unreadable), "torn at {length}");
        }
    }

    #[test]
    fn a_frame_of_an_earlier_version_is_refused_by_a_sentence() {
        let mut bytes = encode(&frame()).unwrap();
        for version in [2, 3, 4] {
            bytes[0] = version;
            assert_eq!(decode(&bytes), Err(FrameError::Earlier));
        }
        bytes[0] = 99;
        assert_eq!(decode(&bytes), Err(FrameError::Unreadable));
    }

    #[test]
    fn positions_that_are_not_wrapped_keep_their_precision_at_a_large_strain() {
        let InSpace::Layer(mut far) = frame() else {
            panic!("no layer");
        };
        far.unwrapped[0] = [123_456.789_012_345, -1_000.1];
        let far = InSpace::Layer(far);
        assert_eq!(decode(&encode(&far).unwrap()), Ok(far));
    }

    #[test]
    fn frame_of_a_suspension_comes_back() {
        let frame = suspension(0.5, [1.0, 2.0, 7.5]);
        let bytes = encode(&frame).unwrap();
        let back = decode(&bytes).unwrap();
        let (InSpace::Suspension(frame), InSpace::Suspension(back)) = (frame, back) else {
            panic!("no suspension");
        };
        assert_eq!(
            (&back.centres, &back.stresslets),
            (&frame.centres, &frame.stresslets)
        );
        assert_eq!(
            (&back.velocities, &back.angular_velocities, &back.unwrapped),
            (
                &frame.velocities,
                &frame.angular_velocities,
                &frame.unwrapped
            )
        );
        let crossed = Frame {
            cross_offset: 1.5,
            ..back.clone()
        };
        let crossed = InSpace::Suspension(crossed);
        let all = encode(&crossed).unwrap();
        assert_eq!(decode(&all), Ok(crossed));
        let contact = &back.contacts[0];
        assert_eq!(contact.tangential_force, frame.contacts[0].tangential_force);
        for (a, b) in back.orientations[0].iter().zip(frame.orientations[0]) {
            assert!((a - b).abs() < 1e-7);
        }
        for length in 0..bytes.len() {
            let torn = decode(&bytes[..length]);
            assert_eq!(torn, Err(FrameError::Unreadable), "torn at {length}");
        }
    }

    #[test]
    fn tables_of_suspensions_have_vectors() {
        let frame = suspension(0.5, [1.0, 2.0, 7.5]);
        let mut contacts = Vec::new();
        write_csv(&contact_table(&[(25, &frame)]), &mut contacts).unwrap();
        assert_eq!(
            String::from_utf8(contacts).unwrap(),
            "step,strain,i,j,normal_x,normal_y,normal_z,gap,normal_force,tangential_force_x,tangential_force_y,tangential_force_z,\
             rolling_force_x,rolling_force_y,rolling_force_z,state\n\
             25,0.5,0,1,0,0.6,0.8,0.0078125,12.5,3,0,-4,0,0,0,rolling\n"
        );
        let mut spheres = Vec::new();
        write_csv(&sphere_table(&[(25, &frame)]), &mut spheres).unwrap();
        let spheres = String::from_utf8(spheres).unwrap();
        assert!(
            spheres.starts_with(
                "step,strain,cell_side,cell_offset,cell_cross_offset,sphere,x,y,z,unwrapped_x,unwrapped_y,unwrapped_z,radius,\
                 orientation_w,orientation_x,orientation_y,orientation_z,velocity_x,velocity_y,velocity_z,\
                 angular_velocity_x,angular_velocity_y,angular_velocity_z,\
                 stresslet_xx,stresslet_yy,stresslet_xy,stresslet_xz,stresslet_yz\n\
                 25,0.5,8,-2,0,0,1,2,7.5,9,2,7.5,1,0.8,0,0.6,0,2.5,0.25,1,0.5,0,-0.25,1,-1,20.5,0.25,-0.5\n"
            ),
            "{spheres}"
        );
    }

    #[test]
    fn tables_have_a_row_per_sphere_and_per_contact() {
        let frame = frame();
        let mut spheres = Vec::new();
        write_csv(&sphere_table(&[(25, &frame), (50, &frame)]), &mut spheres).unwrap();
        assert_eq!(
            String::from_utf8(spheres).unwrap(),
            "step,strain,cell_side,cell_offset,sphere,x,y,unwrapped_x,unwrapped_y,radius,orientation,velocity_x,velocity_y,\
             angular_velocity,stresslet_xx,stresslet_yy,stresslet_xy\n\
             25,0.5,8,-2,0,1,2,9,2,1,0,2.5,0.25,-0.5,1,-1,20.5\n\
             25,0.5,8,-2,1,3.5,2,1.5,-6,1.5,-0.25,2,-0.25,-0.75,0,0.5,19\n\
             50,0.5,8,-2,0,1,2,9,2,1,0,2.5,0.25,-0.5,1,-1,20.5\n\
             50,0.5,8,-2,1,3.5,2,1.5,-6,1.5,-0.25,2,-0.25,-0.75,0,0.5,19\n"
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
