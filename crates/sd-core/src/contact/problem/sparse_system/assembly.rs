//! Assembly of the preconditioner.

use super::SparseSystem;
use super::active::ActiveTerms;
use crate::contact::problem::statement::Problem;
use crate::contact::row::Row;
use crate::hydrodynamics::resistance::{Fluid, NearMatrix, NearPattern};
use crate::space::FixedArray;

impl<S: Fluid> SparseSystem<S> {
    /// Assembles the preconditioner: the near-field part of R, and the stiffnesses of the terms of
    /// the linear system among the first `rows` candidates and components of friction.
    ///
    /// If the preceding matrix had the same candidates, only the blocks of spheres whose stiffness
    /// changed are assembled.
    ///
    /// In a suspension all blocks are assembled, since the directions of slides change in every
    /// system.
    pub(super) fn assemble(
        &mut self,
        (problem, terms): (&Problem<S>, &ActiveTerms<S>),
        pattern: &NearPattern<S>,
        rows: usize,
    ) {
        let is_update = self.is_factored && self.is_same && S::TANGENTS == 1;
        self.is_same = true;
        self.changed.clear();
        self.changed.resize(pattern.spheres(), !is_update);
        let (matrix, changed) = (&mut self.stiff_factor, &mut self.changed);
        let contacts = problem.normal.len();
        if is_update {
            for (at, (old, new)) in self.factored.iter().zip(&self.stiffness).enumerate() {
                if old != new {
                    let contact = at.checked_sub(contacts).map_or(at, |component| {
                        problem.friction[component / S::TANGENTS].contact
                    });
                    for sphere in problem.normal[contact].row.spheres {
                        changed[sphere] = true;
                    }
                }
            }
            for (sphere, _) in changed.iter().enumerate().filter(|(_, changed)| **changed) {
                matrix.copy_own(pattern, &self.near, sphere);
            }
            for (entry, &number) in problem.normal.iter().zip(&self.numbers) {
                let both = entry.row.spheres.iter().all(|&sphere| changed[sphere]);
                if let Some(number) = number.filter(|_| both) {
                    matrix.copy_coupling(pattern, &self.near, number);
                }
            }
        } else {
            matrix.copy_matrix(&self.near);
        }
        let mut add = |row: &Row<S>, contact: usize, at: usize| {
            let selected = row.spheres.map(|sphere| changed[sphere]);
            if at < rows && selected != [false, false] {
                let (number, stiffness) = (self.numbers[contact], self.stiffness[at]);
                add_stiffness(matrix, pattern, row, number, stiffness, selected);
            }
        };
        for closed in &terms.closed {
            let k = closed.index as usize;
            add(&closed.row(), k, k);
        }
        for sticking in &terms.sticking {
            add(&sticking.row, sticking.contact, contacts + sticking.index);
        }
    }
}

/// Adds `s rowᵀ row` to the diagonal blocks of the selected spheres among its two, and to the block
/// that couples them if both are selected.
fn add_stiffness<S: Fluid>(
    matrix: &mut NearMatrix<S>,
    pattern: &NearPattern<S>,
    row: &Row<S>,
    number: Option<usize>,
    s: f64,
    selected: [bool; 2],
) {
    let [i, j] = row.sphere_weights();
    let block = |rows: &S::PerMode<f64>, columns: &S::PerMode<f64>| {
        let mut block: S::Block = FixedArray::each(0.0);
        for column in 0..S::MODES {
            for row in 0..S::MODES {
                block[S::MODES * column + row] = s * rows[row] * columns[column];
            }
        }
        block
    };
    for ((sphere, weights), is_selected) in row.spheres.into_iter().zip([i, j]).zip(selected) {
        if is_selected {
            matrix.add_own(pattern, sphere, &block(weights, weights));
        }
    }
    if let (Some(number), [true, true]) = (number, selected) {
        matrix.add_coupling(pattern, number, &block(j, i));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::problem::statement::{Friction, FrictionState, Normal, States};
    use crate::space::Layer;
    use crate::space::modes::Vec2;

    /// A ring of spheres, each in contact with the next, with friction on every second contact.
    fn ring(n: u32) -> (Problem, NearPattern<Layer>, SparseSystem) {
        let next = |i: u32| (i + 1) % n;
        let mut pairs: Vec<_> = (0..n).map(|i| (i.min(next(i)), i.max(next(i)))).collect();
        pairs.sort_unstable();
        let n = n as usize;
        let pattern = NearPattern::new(n, &pairs).unwrap();
        let mut system = SparseSystem::<Layer>::default();
        system.near.reset(&pattern);
        for i in 0..n {
            let own_block = [9.0, 0.5, 0.1, 0.5, 8.0, -0.3, 0.1, -0.3, 10.0 + i as f64];
            system.near.add_own(&pattern, i, &own_block);
        }
        let mut problem = Problem::<Layer>::new(n);
        for (k, &(i, j)) in pairs.iter().enumerate() {
            let block = std::array::from_fn(|m| (0.7 * k as f64 + m as f64).sin());
            system.near.add_coupling(&pattern, k, &block);
            let (y, x) = (k as f64).sin_cos();
            let (spheres, normal) = ([i, j].map(|i| i as usize), Vec2::new(x, y));
            problem.normal.push(Normal {
                row: Row::normal(spheres, &normal),
                bias: 0.0,
                compliance: 0.0,
            });
            if k % 2 == 0 {
                problem.friction.push(Friction {
                    contact: k,
                    rows: [Row::slip(spheres, &normal, &Vec2::new(-y, x), [1.0; 2])],
                    shift: [0.0],
                    compliance: 0.0,
                    coefficient: 0.3,
                    intercept: 0.0,
                    active: true,
                    was_deactivated: false,
                });
            }
        }
        // One pair is not in the pattern.
        system.numbers = (0..n).map(|k| (k != 5).then_some(k)).collect();
        (problem, pattern, system)
    }

    /// The solution of a system where five contacts or friction forces are missing, different ones
    /// for each number.
    fn read(
        system: &mut SparseSystem,
        problem: &Problem,
        pattern: &NearPattern<Layer>,
        number: usize,
    ) -> Vec<f64> {
        let (contacts, rows) = (problem.normal.len(), problem.friction_rows());
        let is_missing = |at: usize| at / 5 == number;
        let mut states = States::new(contacts);
        states.closed.extend((0..contacts).map(|k| !is_missing(k)));
        states.friction.extend((0..rows).map(|m| {
            if is_missing(contacts + m) {
                FrictionState::Inactive
            } else {
                FrictionState::Stick
            }
        }));
        let mut terms = ActiveTerms::default();
        terms.list(problem, &states);
        let stiffness = |at: usize| {
            if is_missing(at) {
                0.0
            } else {
                30.0 + at as f64
            }
        };
        system.stiffness = (0..contacts + rows).map(stiffness).collect();
        system.assemble((problem, &terms), pattern, contacts + rows);
        system.stiff_factor.factor(pattern).unwrap();
        system.is_factored = true;
        system.factored.clone_from(&system.stiffness);
        let forces: Vec<f64> = (0..3 * pattern.spheres())
            .map(|k| (k as f64).cos())
            .collect();
        let mut velocities = vec![0.0; forces.len()];
        system.stiff_factor.solve(pattern, &forces, &mut velocities);
        velocities
    }

    #[test]
    fn updated_matrix_has_the_bits_of_a_new_one() {
        let (problem, pattern, mut system) = ring(24);
        let mut last = Vec::new();
        for number in 0..6 {
            let found = read(&mut system, &problem, &pattern, number);
            let kept = system.changed.iter().any(|changed| !changed);
            assert_eq!(
                kept,
                number > 0,
                "only blocks that changed are assembled again"
            );
            let (_, _, mut new) = ring(24);
            assert_eq!(found, read(&mut new, &problem, &pattern, number));
            assert_ne!(found, last);
            last = found;
        }
    }
}
