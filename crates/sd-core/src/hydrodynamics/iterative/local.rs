//! P, the approximation of the far field's resistance by near pairs: see `far_pairs` of the
//! resistance.

use crate::hydrodynamics::resistance::{Fluid, ModeBlock, NearTerm as _, Resistance};
use crate::linalg::simd::vectorised;
use crate::space::FixedArray as _;

/// P in blocks, at one set of positions.
#[derive(Default)]
pub(super) struct LocalResistance<S: Fluid> {
    /// Block of each sphere with itself.
    own: Vec<ModeBlock<S>>,
    /// Pairs (i, j) and their blocks: rows of j, columns of i.
    couplings: Vec<([usize; 2], ModeBlock<S>)>,
}

impl<S: Fluid> LocalResistance<S> {
    /// Sets the drag of isolated spheres, and the terms of near pairs of `near`.
    pub(super) fn update(&mut self, drag: &[S::PerAnyMode<f64>], near: &Resistance<S>) {
        self.own.clear();
        self.own.extend(drag.iter().map(|drag| {
            let mut block = ModeBlock::<S>::each(S::PerAnyMode::each(0.0));
            for k in 0..S::ALL_MODES {
                block[k][k] = drag[k];
            }
            block
        }));
        self.couplings.clear();
        for (pair, term) in near.far_pairs() {
            let [of_i, coupling, of_j] = term.mode_blocks(&pair.normal);
            for (sphere, added) in [(pair.i, of_i), (pair.j, of_j)] {
                let columns = self.own[sphere].as_mut().iter_mut();
                for (own, added) in columns.zip(added.as_ref()) {
                    for (own, added) in own.as_mut().iter_mut().zip(added.as_ref()) {
                        *own += added;
                    }
                }
            }
            self.couplings.push(([pair.i, pair.j], coupling));
        }
    }

    /// `y = P x`.
    pub(super) fn apply(&self, x: &[f64], y: &mut [f64]) {
        let (x, y) = (S::all_modes(x), S::all_modes_mut(y));
        vectorised(
            #[inline(always)]
            || {
                for ((x, y), block) in x.iter().zip(&mut *y).zip(&self.own) {
                    for k in 0..S::ALL_MODES {
                        y[k] = (0..S::ALL_MODES).map(|c| block[c][k] * x[c]).sum();
                    }
                }
                for &([i, j], ref block) in &self.couplings {
                    for k in 0..S::ALL_MODES {
                        let to_j: f64 = (0..S::ALL_MODES).map(|c| block[c][k] * x[i][c]).sum();
                        let to_i: f64 = (0..S::ALL_MODES).map(|c| block[k][c] * x[j][c]).sum();
                        y[j][k] += to_j;
                        y[i][k] += to_i;
                    }
                }
            },
        );
    }
}
