//! Frames of other programs: spheres in a periodic cell, and their contacts.

use super::constraints::hyperstaticity;
use super::order::{concentration, layering, psi_6, q_6};
use super::{Network, RunStructure, reach};
use sd_core::cell::{Cell, Lattice};
use sd_core::contact::ContactState;
use sd_core::simulation::StructureSample;
use sd_core::{Bulk, Error, Layer, Space};

/// A frame that may come from another program. Lengths are in the mean radius, forces in any one
/// unit.
#[derive(Debug, Clone, PartialEq)]
pub struct OutsideFrame {
    /// Lattice vectors of the cell, one after the other: along the flow, to the cell above along
    /// the gradient, and in a suspension along the vorticity.
    pub lattice: Vec<f64>,
    /// Centres, one after the other.
    pub centres: Vec<f64>,
    /// Radii.
    pub radii: Vec<f64>,
    /// Contacts: both spheres, normal force, size of the friction force, state.
    pub contacts: Vec<(usize, usize, f64, f64, ContactState)>,
}

impl RunStructure {
    /// The structure of each run of another program that has frames.
    ///
    /// # Errors
    /// [`Error::Refused`] about a lattice, and [`Error::Length`] about a list of another length.
    pub(crate) fn of_outside(runs: &[Vec<OutsideFrame>]) -> Result<Vec<Self>, Error> {
        let mut least = f64::INFINITY;
        for frame in runs.iter().flatten() {
            least = least.min(match frame.lattice.len() {
                4 => reach(&network::<Layer>(frame)?.cell),
                _ => reach(&network::<Bulk>(frame)?.cell),
            });
        }
        let of_run = |frames: &Vec<OutsideFrame>| {
            let mut sums: Option<Self> = None;
            for frame in frames {
                match frame.lattice.len() {
                    4 => add::<Layer>(&mut sums, frame, least)?,
                    _ => add::<Bulk>(&mut sums, frame, least)?,
                }
            }
            Ok(sums)
        };
        runs.iter()
            .filter_map(|run| of_run(run).transpose())
            .collect()
    }
}

/// Adds a frame to sums up to that reach, which it begins.
fn add<S: Space>(
    sums: &mut Option<RunStructure>,
    frame: &OutsideFrame,
    reach: f64,
) -> Result<(), Error> {
    let network = network::<S>(frame)?;
    let sums = sums.get_or_insert_with(|| RunStructure::new(&network, reach));
    sums.add(&network, &sampled(frame, &network));
    Ok(())
}

/// The numbers of a frame that need no velocities and no start; of order only in a cell of shear,
/// whose first side is along the flow.
fn sampled<S: Space>(frame: &OutsideFrame, network: &Network<S>) -> StructureSample {
    let (is_layer, rows) = (S::DIMENSIONS == 2, S::DIMENSIONS + 1);
    let mut found = StructureSample {
        hyperstaticity: hyperstaticity(network),
        ..StructureSample::NONE
    };
    if frame.lattice[1..S::DIMENSIONS].iter().any(|x| *x != 0.0) {
        return found;
    }
    let height = frame.lattice[rows];
    found.layering = layering(network, height);
    found.concentration_y = concentration(network, height, 1);
    if is_layer {
        found.psi_6 = psi_6(network, height);
    } else {
        found.q_6 = q_6(network, height);
    }
    // Images across the gradient may lie apart along the vorticity.
    if !is_layer && frame.lattice[rows + 1] == 0.0 {
        found.concentration_z = concentration(network, frame.lattice[2 * rows], 2);
    }
    found
}

/// The network of a frame.
fn network<S: Space>(frame: &OutsideFrame) -> Result<Network<S>, Error> {
    let n = frame.radii.len();
    let vectors = |field, numbers: &[f64], expected: usize| {
        if numbers.len() != S::DIMENSIONS * expected {
            return Err(Error::Length {
                field,
                found: numbers.len() / S::DIMENSIONS,
                expected,
            });
        }
        let vector = |numbers: &[f64]| {
            let mut vector = S::Vector::default();
            for (k, number) in numbers.iter().enumerate() {
                vector[k] = *number;
            }
            vector
        };
        Ok(numbers.chunks_exact(S::DIMENSIONS).map(vector).collect())
    };
    let lattice: Vec<S::Vector> = vectors("lattice", &frame.lattice, S::DIMENSIONS)?;
    let centres: Vec<S::Vector> = vectors("positions", &frame.centres, n)?;
    let check = |field, values: &mut dyn Iterator<Item = f64>, least: f64| {
        let bad = values
            .enumerate()
            .find(|(_, x)| !(x.is_finite() && *x > least));
        bad.map_or(Ok(()), |(sphere, value)| {
            let allowed = "a finite number above 0";
            Err(Error::OfSphere {
                field,
                sphere,
                value,
                allowed,
            })
        })
    };
    check("radii", &mut frame.radii.iter().copied(), 0.0)?;
    let coordinates = frame.centres.iter().copied().map(f64::abs);
    check("positions", &mut coordinates.map(|x| x + 1.0), 0.0)?;
    for &(i, j, ..) in &frame.contacts {
        if i >= n || j >= n || i == j {
            let reason = "is no pair of spheres of the frame";
            return Err(Error::BadPair { i, j, reason });
        }
    }
    let loaded = frame
        .contacts
        .iter()
        .copied()
        .filter(|contact| contact.2 > 0.0);
    let cell = Cell::Periodic(Lattice::new(&lattice)?);
    Ok(Network::new(cell, centres, frame.radii.clone(), loaded))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::spaces::InSpace;
    use crate::test_support::suspension;

    #[test]
    fn a_frame_has_the_same_structure_as_one_of_another_program() {
        let InSpace::Suspension(frame) = suspension(0.5, [1.0, 2.0, 7.5]) else {
            panic!("no suspension");
        };
        let own = Network::<Bulk>::try_from(&frame).unwrap();
        let (side, offset) = (frame.side, frame.offset);
        let outside = OutsideFrame {
            lattice: vec![side, 0.0, 0.0, offset, side, 0.0, 0.0, 0.0, side],
            centres: frame.centres.iter().flatten().copied().collect(),
            radii: frame.radii.clone(),
            contacts: frame
                .contacts
                .iter()
                .map(|c| (c.i, c.j, c.normal_force, 5.0, c.state))
                .collect(),
        };
        let other = network::<Bulk>(&outside).unwrap();
        assert_eq!(own.links.len(), other.links.len());
        for (a, b) in own.links.iter().zip(&other.links) {
            assert!((a.separation - b.separation).norm() < 1e-12);
            assert_eq!((a.i, a.j, a.image), (b.i, b.j, b.image));
            assert_eq!(a.tangential_force, b.tangential_force);
        }
        for bad in [
            OutsideFrame {
                centres: vec![0.0; 5],
                ..outside.clone()
            },
            OutsideFrame {
                lattice: vec![0.0; 9],
                ..outside.clone()
            },
            OutsideFrame {
                contacts: vec![(0, 9, 1.0, 0.0, ContactState::Frictionless)],
                ..outside.clone()
            },
            OutsideFrame {
                radii: vec![1.0, -1.0],
                ..outside.clone()
            },
        ] {
            assert!(
                RunStructure::of_outside(&[vec![bad.clone()]]).is_err(),
                "{bad:?}"
            );
        }
        assert!(RunStructure::of_outside(&[vec![]]).unwrap().is_empty());
    }
}
