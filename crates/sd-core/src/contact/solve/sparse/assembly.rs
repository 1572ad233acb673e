//! The matrix of the preconditioner.

use super::SparseSystem;
use super::linear::row_of;
use crate::contact::row::Row;
use crate::contact::solve::problem::{Problem, States};
use crate::hydrodynamics::resistance::{Fluid, NearMatrix, NearPattern};

impl<S: Fluid> SparseSystem<S> {
    /// The matrix of the preconditioner: the near part of R, and the stiffnesses of so many candidates and rows.
    ///
    /// Where the one before was of the same candidates, only blocks of spheres are made anew that have another stiffness now.
    ///
    /// Directions of slides turn in each system: in a suspension all blocks are made anew.
    pub(super) fn assemble(
        &mut self,
        (problem, states): (&Problem<S>, &States),
        pattern: &NearPattern<S>,
        rows: usize,
    ) {
        let again = self.is_factored && self.is_same && S::TANGENTS == 1;
        self.is_same = true;
        self.changed.clear();
        self.changed.resize(pattern.spheres(), !again);
        let (held, changed) = (&mut self.held, &mut self.changed);
        if again {
            for (at, (old, new)) in self.factored.iter().zip(&self.stiffness).enumerate() {
                if old != new {
                    for sphere in row_of(problem, states, at).1.spheres {
                        changed[sphere] = true;
                    }
                }
            }
            for (sphere, _) in changed.iter().enumerate().filter(|(_, changed)| **changed) {
                held.copy_own(pattern, &self.near, sphere);
            }
            for (entry, &number) in problem.normal.iter().zip(&self.numbers) {
                let both = entry.row.spheres.iter().all(|&sphere| changed[sphere]);
                if let Some(number) = number.filter(|_| both) {
                    held.copy_coupling(pattern, &self.near, number);
                }
            }
        } else {
            held.copy_matrix(&self.near);
        }
        for (at, &s) in self.stiffness[..rows].iter().enumerate() {
            if s != 0.0 {
                let (contact, row) = row_of(problem, states, at);
                let meant = row.spheres.map(|sphere| changed[sphere]);
                if meant != [false, false] {
                    add_stiffness(held, pattern, &row, self.numbers[contact], s, meant);
                }
            }
        }
    }
}

/// Adds `s rowᵀ row` to the diagonal blocks of those of its two spheres that are meant, and to the block between them where both are.
fn add_stiffness<S: Fluid>(
    matrix: &mut NearMatrix<S>,
    pattern: &NearPattern<S>,
    row: &Row<S>,
    number: Option<usize>,
    s: f64,
    meant: [bool; 2],
) {
    let [i, j] = row.halves();
    let block = |rows: &S::PerMode<f64>, columns: &S::PerMode<f64>| {
        let mut block = S::no_block();
        for column in 0..S::MODES {
            for row in 0..S::MODES {
                block[S::MODES * column + row] = s * rows[row] * columns[column];
            }
        }
        block
    };
    for ((sphere, weights), is_meant) in row.spheres.into_iter().zip([i, j]).zip(meant) {
        if is_meant {
            matrix.add_own(pattern, sphere, &block(weights, weights));
        }
    }
    if let (Some(number), [true, true]) = (number, meant) {
        matrix.add_coupling(pattern, number, &block(j, i));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::solve::problem::{Normal, Tangential};
    use crate::space::Layer;
    use crate::space::modes::Vec2;

    /// A ring of spheres, each in contact with the next, with friction at every second contact.
    fn ring(n: usize) -> (Problem, NearPattern<Layer>, SparseSystem) {
        let next = |i: usize| (i + 1) % n;
        let mut pairs: Vec<_> = (0..n)
            .map(|i| (i.min(next(i)) as u32, i.max(next(i)) as u32))
            .collect();
        pairs.sort_unstable();
        let pattern = NearPattern::new(n, &pairs).unwrap();
        let mut system = SparseSystem::<Layer>::default();
        system.near.reset(&pattern);
        for i in 0..n {
            let own = [9.0, 0.5, 0.1, 0.5, 8.0, -0.3, 0.1, -0.3, 10.0 + i as f64];
            system.near.add_own(&pattern, i, &own);
        }
        let mut problem = Problem::<Layer>::default();
        for (k, &(i, j)) in pairs.iter().enumerate() {
            let block = std::array::from_fn(|m| (0.7 * k as f64 + m as f64).sin());
            system.near.add_coupling(&pattern, k, &block);
            let (y, x) = (k as f64).sin_cos();
            problem.normal.push(Normal {
                row: Row::normal([i, j].map(|i| i as usize), &Vec2::new(x, y)),
                bias: 0.0,
                compliance: 0.0,
            });
            if k % 2 == 0 {
                problem.tangential.push(Tangential {
                    contact: k,
                    row: Row::slip(
                        [i, j].map(|i| i as usize),
                        &Vec2::new(x, y),
                        &Vec2::new(-y, x),
                        [1.0, 1.0],
                    ),
                    shift: 0.0,
                    compliance: 0.0,
                    coefficient: 0.3,
                    intercept: 0.0,
                    active: true,
                    was_deactivated: false,
                });
            }
        }
        // One pair is none of the pattern's.
        system.numbers = (0..n).map(|k| (k != 5).then_some(k)).collect();
        (problem, pattern, system)
    }

    /// The matrix of these stiffnesses, factored, read by a solve.
    fn read(
        system: &mut SparseSystem,
        problem: &Problem,
        pattern: &NearPattern<Layer>,
    ) -> Vec<f64> {
        let rows = system.stiffness.len();
        system.assemble((problem, &States::default()), pattern, rows);
        system.held.factor(pattern).unwrap();
        system.is_factored = true;
        system.factored.clone_from(&system.stiffness);
        let forces: Vec<f64> = (0..3 * pattern.spheres())
            .map(|k| (k as f64).cos())
            .collect();
        let mut velocities = vec![0.0; forces.len()];
        system.held.solve(pattern, &forces, &mut velocities);
        velocities
    }

    #[test]
    fn a_matrix_of_other_stiffnesses_has_the_bits_of_one_made_anew() {
        let (problem, pattern, mut system) = ring(24);
        let rows = problem.normal.len() + problem.tangential.len();
        // Five contacts are open, each time others.
        let stiffness = |number: usize| {
            let of = |at: usize| {
                if at / 5 == number {
                    0.0
                } else {
                    30.0 + at as f64
                }
            };
            (0..rows).map(of).collect()
        };
        let mut last = Vec::new();
        for number in 0..4 {
            system.stiffness = stiffness(number);
            let found = read(&mut system, &problem, &pattern);
            let kept = system.changed.iter().any(|changed| !changed);
            assert_eq!(kept, number > 0, "only blocks that changed are made anew");
            let (_, _, mut new) = ring(24);
            new.stiffness = stiffness(number);
            assert_eq!(found, read(&mut new, &problem, &pattern));
            assert_ne!(found, last);
            last = found;
        }
    }
}
