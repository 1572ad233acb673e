//! Random forces whose covariance is the resistance, as Brownian motion needs them.
//!
//! Without a far field R_FU is a sum of the drags of isolated spheres and of pair terms, each
//! positive semidefinite, so these forces have exactly its covariance, at a cost in O(N):
//!
//! ```text
//! F = Σ_i √(drag of i) z_i + Σ_pairs L z_ij,   L Lᵀ = pair term,   z of independent components
//! ```

use super::Resistance;
use super::fluid::{Fluid, NearTerm as _};
use super::isolated::isolated;
use crate::space::Space;

/// Pivot, over the diagonal entry that it is left of, that is zero but for rounding: rigid motions
/// of a pair are not resisted.
const ROUNDING: f64 = 1e-12;

impl<S: Fluid> Resistance<S> {
    /// Adds random forces and torques on all spheres, `[3N]`, whose covariance is `scale`² `R_FU`.
    ///
    /// `normal`: independent numbers of mean 0 and variance 1.
    pub(crate) fn add_random_forces(
        &self,
        scale: f64,
        mut normal: impl FnMut() -> f64,
        forces: &mut [f64],
    ) {
        let forces = S::by_sphere_mut(forces);
        for (force, &radius) in forces.iter_mut().zip(&self.radii) {
            let drag = isolated::<S>(radius);
            for k in 0..S::MODES {
                force[k] += scale * drag[k].sqrt() * normal();
            }
        }
        for (pair, term) in self.neighbours.pairs().iter().zip(&self.terms) {
            let root = root_of::<S>(&term.blocks(&pair.normal));
            for column in &root[..2 * S::MODES] {
                // A mode that is not resisted has no force, but the same numbers follow.
                let z = scale * normal();
                for (row, entry) in column.iter().enumerate().take(2 * S::MODES) {
                    let sphere = if row < S::MODES { pair.i } else { pair.j };
                    forces[sphere][row % S::MODES] += z * entry;
                }
            }
        }
    }
}

/// Most velocities of a pair.
const PAIR_MODES: usize = 12;

/// L of `L Lᵀ`, by columns, of a positive semidefinite pair matrix from its blocks (i, i), (j, i)
/// and (j, j).
fn root_of<S: Space>(blocks: &[S::Block; 3]) -> [[f64; PAIR_MODES]; PAIR_MODES] {
    let (modes, size) = (S::MODES, 2 * S::MODES);
    let mut columns = [[0.0; PAIR_MODES]; PAIR_MODES];
    let places = [(0, 0), (modes, 0), (modes, modes)];
    for (block, (row, column)) in blocks.iter().zip(places) {
        for (k, entries) in block.as_ref().chunks_exact(modes).enumerate() {
            columns[column + k][row..row + modes].copy_from_slice(entries);
        }
    }
    for k in 0..size {
        let diagonal = columns[k][k];
        let (before, rest) = columns.split_at_mut(k);
        let column = &mut rest[0];
        for other in before {
            let factor = other[k];
            for row in k..size {
                column[row] -= factor * other[row];
            }
        }
        let pivot = column[k];
        column[..k].fill(0.0);
        if pivot <= ROUNDING * diagonal {
            column.fill(0.0);
            continue;
        }
        let scale = pivot.sqrt().recip();
        for entry in &mut column[k..size] {
            *entry *= scale;
        }
    }
    columns
}
