//! Contacts of one instant: their directions, their forces, the fabric.

use super::bins::Bins;
use super::network::Network;
use super::pairs::{ANGLES, angle_bins, angle_of};
use sd_core::Space;

/// Bins of forces over their mean, and the largest.
const FORCES: usize = 60;
const LARGEST_FORCE: f64 = 6.0;

/// Sums over the contacts of one instant.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Contacts {
    /// Contacts by the angle of their normals, in the bins of [`angle_bins`].
    pub(super) angles: Vec<f64>,
    /// Normal forces by the angle of the normals, in the same bins.
    pub(super) forces_by_angle: Vec<f64>,
    /// Sum of n n over the contacts.
    pub(super) fabric: [[f64; 3]; 3],
    pub(super) number: f64,
    /// Normal forces over their mean at this instant, by the bins of [`force_bins`].
    pub(super) normal: Vec<f64>,
    /// Friction forces over their mean, where friction acts, by the bins of [`force_bins`].
    pub(super) tangential: Vec<f64>,
}

/// Forces over their mean.
pub(super) fn force_bins() -> Bins {
    Bins::equal(0.0, LARGEST_FORCE, FORCES)
}

/// The contacts of a network.
pub(super) fn contacts<S: Space>(network: &Network<S>) -> Contacts {
    let bins = angle_bins();
    let mut sums = Contacts {
        angles: vec![0.0; ANGLES],
        forces_by_angle: vec![0.0; ANGLES],
        number: network.links.len() as f64,
        ..Contacts::default()
    };
    for link in &network.links {
        let normal = link.normal();
        if let Some(place) = bins.place(angle_of::<S>(&normal)) {
            sums.angles[place] += 1.0;
            sums.forces_by_angle[place] += link.normal_force;
        }
        for a in 0..S::DIMENSIONS {
            for b in 0..S::DIMENSIONS {
                sums.fabric[a][b] += normal[a] * normal[b];
            }
        }
    }
    sums.normal = over_mean(network.links.iter().map(|link| link.normal_force));
    sums.tangential = over_mean(network.frictional().map(|link| link.tangential_force));
    sums
}

/// Numbers over their mean, counted by [`force_bins`].
fn over_mean(forces: impl Iterator<Item = f64>) -> Vec<f64> {
    let bins = force_bins();
    let mut counts = vec![0.0; bins.len()];
    let forces: Vec<f64> = forces.collect();
    let mean = forces.iter().sum::<f64>() / forces.len().max(1) as f64;
    if mean > 0.0 {
        for place in forces.iter().filter_map(|force| bins.place(force / mean)) {
            counts[place] += 1.0;
        }
    }
    counts
}

/// Deviation of a fabric from that of isotropic contacts: in a layer the difference of its
/// principal values, in general √(d/(d−1) F':F') of its traceless part F'.
pub(super) fn deviator(fabric: &[[f64; 3]; 3], dimensions: usize) -> f64 {
    let d = dimensions as f64;
    let trace: f64 = (0..dimensions).map(|k| fabric[k][k]).sum();
    let mut squares = 0.0;
    for (a, row) in fabric.iter().enumerate().take(dimensions) {
        for (b, value) in row.iter().enumerate().take(dimensions) {
            let off = value - if a == b { trace / d } else { 0.0 };
            squares += off * off;
        }
    }
    (squares * d / (d - 1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviators_of_one_direction_and_of_none() {
        let along = [[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]];
        assert_eq!(deviator(&along, 2), 1.0);
        assert!((deviator(&along, 3) - 1.0).abs() < 1e-15);
        let diagonal = [[0.5, 0.5, 0.0], [0.5, 0.5, 0.0], [0.0; 3]];
        assert!((deviator(&diagonal, 2) - 1.0).abs() < 1e-15);
        let third = 1.0 / 3.0;
        let none = [[third, 0.0, 0.0], [0.0, third, 0.0], [0.0, 0.0, third]];
        assert_eq!(deviator(&none, 3), 0.0);
    }
}
