//! Pair distribution functions: g(r), and g(r, θ) in the plane of shear.

use super::bins::Bins;
use super::network::Network;
use sd_core::Space;
use sd_core::cell::{Cell, Lattice};
use std::f64::consts::PI;

/// Maximum distance of g(r), in a, limited by half the shortest side of the cell.
const FARTHEST: f64 = 10.0;
/// Maximum distance of g(r, θ), in a.
const FARTHEST_WITH_ANGLE: f64 = 6.0;
/// Bins of the angle over half a turn: a pair has two opposite ones.
pub(super) const ANGLES: usize = 36;
/// Pairs of a suspension count for g(r, θ) if the vorticity component of the unit vector between
/// them is at most this: a quarter of all pairs in an isotropic suspension.
const IN_PLANE: f64 = 0.25;

/// The pair distributions of one instant.
#[derive(Debug, Clone)]
pub(super) struct Pairs {
    /// g(r) in each bin of [`Distances::radial`].
    pub(super) radial: Vec<f64>,
    /// g(r, θ) in each bin of [`Distances::with_angle`] and of the angle, the angles of a distance
    /// one after the other.
    pub(super) with_angle: Vec<f64>,
}

/// Distance below which all pairs are found by their nearest images, in a; 0 without a cell.
pub(crate) fn reach<S: Space>(cell: &Cell<S>) -> f64 {
    cell.lattice().map_or(0.0, Lattice::reach)
}

/// The bins of the distances of pairs, the same for all frames that are averaged.
#[derive(Debug, Clone)]
pub(super) struct Distances {
    /// Pairs farther apart are not counted, in a.
    reach: f64,
    /// Those of g(r), in a: of width 0.001 around contact of equal spheres, where their first peak
    /// is, and of 0.02 beyond and down to 1, where smaller spheres touch.
    pub(super) radial: Bins,
    /// Those of g(r, θ), in a: of width 0.05, from contact of spheres of half the mean radius.
    pub(super) with_angle: Bins,
}

impl Distances {
    /// Bins up to the smallest [`reach`] of the frames: beyond it some of them lack pairs.
    pub(super) fn within(reach: f64) -> Self {
        Self {
            reach,
            radial: Bins::equal(0.0, 1.0, 10)
                .and_then(1.9, 0.02)
                .and_then(2.1, 1e-3)
                .and_then(reach.min(FARTHEST), 0.02),
            with_angle: Bins::equal(1.0, 2.0, 20).and_then(reach.min(FARTHEST_WITH_ANGLE), 0.05),
        }
    }
}

/// Angles from the flow direction towards the gradient direction, in [0, π).
pub(super) fn angle_bins() -> Bins {
    Bins::equal(0.0, PI, ANGLES)
}

/// The angle of a direction and its opposite from the flow direction towards the gradient
/// direction, in [0, π).
pub(super) fn angle_of<S: Space>(direction: &S::Vector) -> f64 {
    let angle = direction[1].atan2(direction[0]);
    let half_turn = if angle < 0.0 { angle + PI } else { angle };
    // π itself, up to rounding, becomes 0.
    if half_turn >= PI { 0.0 } else { half_turn }
}

/// Area or volume of a shell, in a² or a³.
fn shell<S: Space>(from: f64, to: f64) -> f64 {
    if S::DIMENSIONS == 2 {
        PI * (to * to - from * from)
    } else {
        4.0 / 3.0 * PI * (to.powi(3) - from.powi(3))
    }
}

/// Pair distributions of spheres in a periodic cell, normalized to 1 for uncorrelated spheres.
pub(super) fn pairs<S: Space>(network: &Network<S>, distances: &Distances) -> Pairs {
    let (bins, with_angle) = (&distances.radial, &distances.with_angle);
    let angles = angle_bins();
    let mut radial = vec![0.0; bins.len()];
    let mut both = vec![0.0; with_angle.len() * ANGLES];
    let n = network.spheres();
    let Some(content) = network.cell.content().filter(|_| n > 1) else {
        return Pairs {
            radial,
            with_angle: both,
        };
    };
    for i in 0..n {
        for j in i + 1..n {
            let (separation, _) = network
                .cell
                .nearest(network.centres[j] - network.centres[i]);
            let distance = S::norm_squared(&separation).sqrt();
            if distance >= distances.reach {
                continue;
            }
            if let Some(place) = bins.place(distance) {
                radial[place] += 1.0;
            }
            let off_plane = if S::DIMENSIONS > 2 {
                separation[2].abs() / distance
            } else {
                0.0
            };
            if off_plane <= IN_PLANE
                && let Some(place) = with_angle.place(distance)
                && let Some(angle) = angles.place(angle_of::<S>(&separation))
            {
                both[place * ANGLES + angle] += 1.0;
            }
        }
    }
    // Expected pairs in a shell of unit content, each counted once.
    let density = 0.5 * n as f64 * (n - 1) as f64 / content;
    for (count, (low, high)) in radial.iter_mut().zip(bins.ends()) {
        *count /= density * shell::<S>(low, high);
    }
    let in_plane = if S::DIMENSIONS > 2 { IN_PLANE } else { 1.0 };
    for (counts, (low, high)) in both.chunks_exact_mut(ANGLES).zip(with_angle.ends()) {
        for count in counts {
            *count *= ANGLES as f64 / (density * in_plane * shell::<S>(low, high));
        }
    }
    Pairs {
        radial,
        with_angle: both,
    }
}
