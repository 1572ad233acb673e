//! P, the approximation of the far field's resistance by near pairs: see `far_pairs` of the
//! resistance.

use crate::hydrodynamics::part_of_pairs::{LEAST_SPHERES, for_pairs_of, list_starts};
use crate::hydrodynamics::resistance::{Fluid, ModeBlock, NearTerm as _, Resistance};
use crate::linalg::simd::vectorised;
use crate::space::FixedArray as _;
use crate::threads;

/// P in blocks, at one set of positions.
#[derive(Default)]
pub(super) struct LocalResistance<S: Fluid> {
    /// Block of each sphere with itself.
    own: Vec<ModeBlock<S>>,
    /// Pairs (i, j) and their blocks: rows of j, columns of i.
    couplings: Vec<([usize; 2], ModeBlock<S>)>,
    /// Where the pairs (i, j) of each sphere i start, then their number.
    starts: Vec<usize>,
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
        let firsts = self.couplings.iter().map(|([i, _], _)| *i);
        list_starts(drag.len(), firsts, &mut self.starts);
    }

    /// `y = P x`.
    pub(super) fn apply(&self, x: &[f64], y: &mut [f64]) {
        let (x, y) = (S::all_modes(x), S::all_modes_mut(y));
        threads::divide(y, LEAST_SPHERES, &|first, y| {
            let range = first..first + y.len();
            let second = |at: usize| self.couplings[at].0[1];
            vectorised(
                #[inline(always)]
                || {
                    let blocks = &self.own[range.clone()];
                    for ((x, y), block) in x[range.clone()].iter().zip(&mut *y).zip(blocks) {
                        for k in 0..S::ALL_MODES {
                            y[k] = (0..S::ALL_MODES).map(|c| block[c][k] * x[c]).sum();
                        }
                    }
                    for_pairs_of(
                        &range,
                        &self.starts,
                        second,
                        #[inline(always)]
                        |at, [has_i, has_j]| {
                            let ([i, j], block) = &self.couplings[at];
                            for k in 0..S::ALL_MODES {
                                if has_j {
                                    let to_j: f64 =
                                        (0..S::ALL_MODES).map(|c| block[c][k] * x[*i][c]).sum();
                                    y[j - first][k] += to_j;
                                }
                                if has_i {
                                    let to_i: f64 =
                                        (0..S::ALL_MODES).map(|c| block[k][c] * x[*j][c]).sum();
                                    y[i - first][k] += to_i;
                                }
                            }
                        },
                    );
                },
            );
        });
    }
}
