//! Constraints of the force network, counted from the active set of contacts.
//!
//! ```text
//! (Σ constraints of loaded contacts − Σ degrees of freedom of spheres in the network)/spheres
//! ```
//! A loaded contact constrains the normal velocity, and one that sticks also the slip: one
//! component in a layer, two in a suspension. A sphere is in the network if it has a loaded
//! contact. It has its translations, and its rotations if one of its contacts sticks: the rotation
//! of any other sphere is in no constraint. Rolling friction is not counted.
//!
//! By the theorem of ranks the difference is that of the numbers of redundant constraints and of
//! motions that no constraint resists (Roux, Phys. Rev. E 61, 6802, 2000). Two motions of a layer
//! as a whole and three of a suspension are always among the latter.

use super::network::Network;
use sd_core::Space;
use sd_core::contact::ContactState;

/// Degree of hyperstaticity of a sphere in the network; NaN without loaded contacts.
pub(super) fn hyperstaticity<S: Space>(network: &Network<S>) -> f64 {
    let (constraints, freedoms, spheres) = counts(network);
    (constraints as f64 - freedoms as f64) / spheres as f64
}

/// Constraints, degrees of freedom and spheres of the force network.
fn counts<S: Space>(network: &Network<S>) -> (usize, usize, usize) {
    let mut is_there = vec![false; network.spheres()];
    let mut turns = is_there.clone();
    let mut constraints = 0;
    for link in &network.links {
        let sticks = link.state == ContactState::Sticking;
        constraints += 1 + if sticks { S::TANGENTS } else { 0 };
        for sphere in [link.i, link.j] {
            is_there[sphere] = true;
            turns[sphere] |= sticks;
        }
    }
    let number = |of: &[bool]| of.iter().filter(|is| **is).count();
    let spheres = number(&is_there);
    let rotations = (S::MODES - S::DIMENSIONS) * number(&turns);
    (constraints, S::DIMENSIONS * spheres + rotations, spheres)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use sd_core::cell::Cell;
    use sd_core::{Bulk, Layer};

    use ContactState::{Frictionless, Slipping, Sticking};

    /// Spheres of radius 1, with contacts of these states.
    fn network<S: Space>(
        cell: Cell<S>,
        centres: Vec<S::Vector>,
        pairs: &[(usize, usize, ContactState)],
    ) -> Network<S> {
        let radii = vec![1.0; centres.len()];
        let pairs = pairs.iter().map(|&(i, j, state)| (i, j, 1.0, 0.1, state));
        Network::new(cell, centres, radii, pairs)
    }

    /// Redundant constraints and free motions by the rank of the matrix of the contacts of a layer.
    fn by_rank(layer: &Network<Layer>) -> (usize, usize) {
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for link in &layer.links {
            let n = link.normal();
            let t = [-n.y, n.x];
            let mut row = vec![0.0; 3 * layer.spheres()];
            for (sphere, sign) in [(link.i, -1.0), (link.j, 1.0)] {
                row[3 * sphere] += sign * n.x;
                row[3 * sphere + 1] += sign * n.y;
            }
            rows.push(row);
            if link.state == Sticking {
                let mut row = vec![0.0; 3 * layer.spheres()];
                for (sphere, sign) in [(link.i, -1.0), (link.j, 1.0)] {
                    row[3 * sphere] += sign * t[0];
                    row[3 * sphere + 1] += sign * t[1];
                    // The surface at the contact moves by Ω × (± n).
                    row[3 * sphere + 2] -= 1.0;
                }
                rows.push(row);
            }
        }
        let columns = 3 * layer.spheres();
        let matrix = DMatrix::from_fn(rows.len(), columns, |row, column| rows[row][column]);
        let rank = matrix.rank(1e-9);
        // Columns of zeros are no motions of the network.
        let moving = (0..columns).filter(|&c| rows.iter().any(|row| row[c] != 0.0));
        (rows.len() - rank, moving.count() - rank)
    }

    /// Rows of touching spheres that fill a sheared cell.
    fn hexagonal(columns: usize, rows: usize, state: ContactState) -> Network<Layer> {
        let height = 3.0_f64.sqrt();
        let sides = [2.0 * columns as f64, height * rows as f64];
        let cell = Cell::<Layer>::periodic(sides.into(), 0.0).unwrap();
        let centres: Vec<sd_core::modes::Vec2> = (0..columns * rows)
            .map(|k| {
                let (row, column) = (k / columns, k % columns);
                [2.0 * column as f64 + (row % 2) as f64, height * row as f64].into()
            })
            .collect();
        let mut pairs = Vec::new();
        for i in 0..centres.len() {
            for j in i + 1..centres.len() {
                if cell.nearest(centres[j] - centres[i]).0.norm() < 2.01 {
                    pairs.push((i, j, state));
                }
            }
        }
        network(cell, centres, &pairs)
    }

    #[test]
    fn a_hexagonal_layer_is_hyperstatic_by_what_its_rank_leaves() {
        for state in [Frictionless, Slipping, Sticking] {
            let layer = hexagonal(6, 6, state);
            let (redundant, free) = by_rank(&layer);
            assert_eq!(free, 2, "a periodic layer moves as a whole along x and y");
            let wanted = (redundant as f64 - 2.0) / 36.0;
            assert!((hyperstaticity(&layer) - wanted).abs() < 1e-12, "{state:?}");
        }
        // Three contacts a sphere: against two translations, and against three motions where each
        // contact is two constraints.
        assert_eq!(hyperstaticity(&hexagonal(6, 6, Frictionless)), 1.0);
        assert_eq!(hyperstaticity(&hexagonal(6, 6, Sticking)), 3.0);
    }

    #[test]
    fn small_networks_have_the_counts_found_by_hand() {
        let triangle = vec![
            [0.0, 0.0].into(),
            [2.0, 0.0].into(),
            [1.0, 3.0_f64.sqrt()].into(),
            [9.0, 9.0].into(),
        ];
        let of = |states: [ContactState; 3]| {
            let [a, b, c] = states;
            let pairs = [(0, 1, a), (1, 2, b), (0, 2, c)];
            network(Cell::<Layer>::Unbounded, triangle.clone(), &pairs)
        };
        // A frictionless triangle: three constraints of six translations, and it still moves as a
        // body. The fourth sphere is in no network.
        assert_eq!(counts(&of([Frictionless; 3])), (3, 6, 3));
        assert_eq!(by_rank(&of([Frictionless; 3])), (0, 3));
        // Three gears that all stick cannot turn: six constraints of nine freedoms, and only the
        // body moves.
        assert_eq!(counts(&of([Sticking; 3])), (6, 9, 3));
        assert_eq!(by_rank(&of([Sticking; 3])), (0, 3));
        // One contact that slides lets them turn.
        assert_eq!(counts(&of([Sticking, Sticking, Slipping])), (5, 9, 3));
        assert_eq!(by_rank(&of([Sticking, Sticking, Slipping])), (0, 4));
        // The third sphere has no contact that sticks: its rotation does not count.
        assert_eq!(counts(&of([Sticking, Slipping, Slipping])), (4, 8, 3));
        assert!(hyperstaticity(&network(Cell::<Layer>::Unbounded, triangle, &[])).is_nan());
        // A pair in space: three constraints of twelve freedoms.
        let pair = vec![[0.0; 3].into(), [0.0, 2.0, 0.0].into()];
        let pair = network(Cell::<Bulk>::Unbounded, pair, &[(0, 1, Sticking)]);
        assert_eq!(counts(&pair), (3, 12, 2));
        assert_eq!(hyperstaticity(&pair), -4.5);
    }
}
