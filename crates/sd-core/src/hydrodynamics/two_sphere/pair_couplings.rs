//! The blocks of a pair's term in three dimensions.

use super::pair_frame::{axial, odd, transverse};
use super::pair_term::PairTerm;
use crate::hydrodynamics::free_space::coupling::Coupling;

impl PairTerm {
    /// The blocks (i, i), (j, i) and (j, j) of the term in three dimensions, n from i to j;
    /// `twist`: entries (i, i), (i, j), (j, j) of X^C in mu·a³.
    #[inline(always)]
    pub(crate) fn couplings(&self, twist: [f64; 3]) -> [Coupling; 3] {
        let entries = self.entries();
        [(0, 0, twist[0]), (1, 0, twist[1]), (1, 1, twist[2])].map(|(p, q, twist)| {
            let axial = |row: usize, column: usize| entries[axial(2 * p + row, 2 * q + column)];
            let odd = |row: usize, column: usize| entries[odd(3 * p + row, 3 * q + column)];
            Coupling {
                force_velocity: [axial(0, 0), odd(0, 0)],
                // In the pair's frame n × Ω is −y for Ω along z.
                force_rotation: -odd(0, 1),
                force_strain: [axial(0, 1), odd(0, 2)],
                torque_velocity: odd(1, 0),
                torque_rotation: [twist, odd(1, 1)],
                torque_strain: odd(1, 2),
                stress_velocity: [axial(1, 0), odd(2, 0)],
                stress_rotation: -odd(2, 1),
                stress_strain: [axial(1, 1), odd(2, 2), entries[transverse(p, q)]],
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::modes::Vec2;
    use nalgebra::Vector3;

    /// A term with unrelated entries.
    fn term() -> PairTerm {
        PairTerm::new(&std::array::from_fn(|k| (1.7 * k as f64).sin()))
    }

    #[test]
    fn in_the_plane_a_coupling_is_that_of_the_layer() {
        let (sin, cos) = 0.7_f64.sin_cos();
        let n = Vector3::new(cos, sin, 0.0);
        let blocks = term().couplings([0.3, 0.5, -0.2]);
        // Planar modes (U_x, U_y, Ω, e1, e2, e3) among the eleven.
        let planar = [0, 1, 5, 6, 7, 8];
        for (block, (p, q)) in blocks.iter().zip([(0, 0), (1, 0), (1, 1)]) {
            let expected = term().mode_block(Vec2::new(cos, sin), p, q);
            let found = block.matrix(&n);
            for (column, &from) in planar.iter().enumerate() {
                for (row, &to) in planar.iter().enumerate() {
                    let error = (found[from][to] - expected[column][row]).abs();
                    assert!(error < 1e-14, "{p} {q} {row} {column}: {error:e}");
                }
            }
        }
    }
}
