//! P, the approximation of the far field's resistance by near pairs: see `far_pairs` of the
//! resistance.

use crate::hydrodynamics::resistance::{Fluid, ModeBlock, NearTerm as _, Resistance};
use crate::linalg::simd::vectorised;

/// P in blocks, at one set of positions.
#[derive(Default)]
pub(super) struct LocalResistance<S: Fluid> {
    /// Block of each sphere with itself.
    own: Vec<ModeBlock<S>>,
    /// Pairs (i, j) and their blocks: rows of j, columns of i.
    couplings: Vec<([usize; 2], ModeBlock<S>)>,
}

impl<S: Fluid> LocalResistance<S> {
    /// Modes of a sphere.
    const MODES: usize = S::STRAINS + S::MODES;

    /// Sets the drag of isolated spheres, strains first, and the terms of near pairs of `near`.
    pub(super) fn update(&mut self, drag: &[f64], near: &Resistance<S>) {
        let spheres = near.radii().len();
        let (strains, velocities) = drag.split_at(S::STRAINS * spheres);
        self.own.clear();
        let spheres = strains.chunks_exact(S::STRAINS);
        self.own
            .extend(spheres.zip(S::by_sphere(velocities)).map(|(e, v)| {
                let mut block = S::each_mode(S::each_mode(0.0));
                for (k, drag) in e.iter().chain(v.as_ref()).enumerate() {
                    block[k][k] = *drag;
                }
                block
            }));
        self.couplings.clear();
        for (pair, term) in near.far_pairs() {
            for (p, sphere) in [pair.i, pair.j].into_iter().enumerate() {
                let added = term.mode_block(&pair.normal, p, p);
                let columns = self.own[sphere].as_mut().iter_mut();
                for (own, added) in columns.zip(added.as_ref()) {
                    for (own, added) in own.as_mut().iter_mut().zip(added.as_ref()) {
                        *own += added;
                    }
                }
            }
            let coupling = term.mode_block(&pair.normal, 1, 0);
            self.couplings.push(([pair.i, pair.j], coupling));
        }
    }

    /// `y = P x`, strains first.
    pub(super) fn apply(&self, x: &[f64], y: &mut [f64]) {
        let strains = S::STRAINS * self.own.len();
        let place = |sphere: usize, k: usize| {
            if k < S::STRAINS {
                S::STRAINS * sphere + k
            } else {
                strains + S::MODES * sphere + k - S::STRAINS
            }
        };
        let read = |sphere: usize| -> S::PerAnyMode<f64> {
            let mut modes = S::each_mode(0.0);
            for k in 0..Self::MODES {
                modes[k] = x[place(sphere, k)];
            }
            modes
        };
        vectorised(
            #[inline(always)]
            || {
                for (sphere, block) in self.own.iter().enumerate() {
                    let from = read(sphere);
                    for k in 0..Self::MODES {
                        y[place(sphere, k)] = (0..Self::MODES).map(|c| block[c][k] * from[c]).sum();
                    }
                }
                for ([i, j], block) in &self.couplings {
                    let (of_i, of_j) = (read(*i), read(*j));
                    for k in 0..Self::MODES {
                        let to_j: f64 = (0..Self::MODES).map(|c| block[c][k] * of_i[c]).sum();
                        let to_i: f64 = (0..Self::MODES).map(|c| block[k][c] * of_j[c]).sum();
                        y[place(*j, k)] += to_j;
                        y[place(*i, k)] += to_i;
                    }
                }
            },
        );
    }
}
