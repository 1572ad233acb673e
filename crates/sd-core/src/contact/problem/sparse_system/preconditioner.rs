//! The preconditioner: factors of near-field matrices, in which closed contacts are springs.

use super::VELOCITY_WEIGHT;
use super::active::ActiveTerms;
use super::linear::Linear;
use crate::contact::problem::statement::{FrictionState, Problem};
use crate::contact::row::Row;
use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, NearMatrix, NearPattern, PairwiseResistance};
use crate::linalg::error::BadPivot;
use crate::space::{FixedArray, Layer};

/// Minimum compliance of a spring, in a/(mu·a²·rate): its inverse is well represented in single
/// precision.
const MIN_COMPLIANCE: f64 = 1e-6;
/// Maximum stiffness of a spring, that of rigid contacts.
const MAX_STIFFNESS: f64 = 1.0 / MIN_COMPLIANCE;

/// The near-field parts of R and of `R + Cᵀ S C + Dᵀ S D` with their factors, and the stiffnesses
/// S.
#[derive(Default)]
pub(super) struct Preconditioner<S: Fluid = Layer> {
    /// The near-field part of R, and whether the matrix and its factor are those of this stage.
    near: NearMatrix<S>,
    has_near: bool,
    has_near_factor: bool,
    /// The matrix with springs, their stiffnesses in its factor, and whether that was computed in
    /// this stage.
    stiff: NearMatrix<S>,
    factored: Vec<f64>,
    is_factored: bool,
    /// Whether the stiffness of each sphere has changed since; empty unless the matrix has the
    /// current candidates and rows.
    changed: Vec<bool>,
    /// For the current active set: of each candidate, then of each component of friction.
    stiffness: Vec<f64>,
    /// Index of each candidate's pair in the pattern.
    numbers: Vec<Option<usize>>,
    /// Forces on the spheres, `[3N]`.
    work: Vec<f64>,
}

impl<S: Fluid> Preconditioner<S> {
    /// Starts a stage at new positions.
    pub(super) fn begin_stage(&mut self) {
        (self.has_near, self.has_near_factor, self.is_factored) = (false, false, false);
    }

    /// Sets up the candidates of a problem.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`], if the resistance cannot be factored.
    pub(super) fn begin(
        &mut self,
        resistance: &PairwiseResistance<S>,
        problem: &Problem<S>,
    ) -> Result<(), Error> {
        self.work.resize(S::MODES * resistance.spheres(), 0.0);
        self.numbers.clear();
        let numbers = problem.normal.iter().map(|entry| {
            let [i, j] = entry.row.spheres;
            #[expect(
                clippy::cast_possible_truncation,
                reason = "sphere numbers fit 32 bits"
            )]
            resistance.number_of((i as u32, j as u32))
        });
        self.numbers.extend(numbers);
        self.changed.clear();
        let pattern = resistance.pattern();
        if !self.has_near {
            resistance.fill(pattern, &mut self.near);
            self.has_near = true;
        }
        if problem.uses_frictionless_slip && !self.has_near_factor {
            let factored = self.near.factor(pattern);
            factored.map_err(|bad| Error::NotPositiveDefinite {
                matrix: "near part of the resistance",
                pivot: bad.pivot,
                sphere: bad.pivot / S::MODES,
            })?;
            self.has_near_factor = true;
        }
        Ok(())
    }

    /// Factors the matrix of the current active set, if necessary.
    pub(super) fn update(&mut self, linear: &Linear<'_, S>) -> Result<(), BadPivot> {
        let (problem, pattern) = (linear.problem, linear.resistance.pattern());
        let contacts = problem.normal.len();
        let stiffness_of = |compliance: f64| compliance.max(MIN_COMPLIANCE).recip();
        self.stiffness.clear();
        self.stiffness
            .resize(contacts + problem.friction_rows(), 0.0);
        for closed in &linear.active.closed {
            self.stiffness[closed.index as usize] = stiffness_of(closed.compliance);
        }
        for sticking in &linear.active.sticking {
            self.stiffness[contacts + sticking.index] = stiffness_of(sticking.compliance);
        }
        let rows = if problem.uses_frictionless_slip {
            contacts
        } else {
            self.stiffness.len()
        };
        // A slide whose direction or compliance changes affects the matrix little.
        let slides = |at: usize| {
            let component = at.checked_sub(contacts);
            component.is_some_and(|m| {
                let state = &linear.states.friction[m / S::TANGENTS];
                matches!(state, FrictionState::Slip(_))
            })
        };
        let is_soft = |stiffness: f64| stiffness > 0.0 && stiffness < MAX_STIFFNESS;
        let mut pairs = self.factored.iter().zip(&self.stiffness).enumerate();
        let fits = self.is_factored
            && self.factored.len() == rows
            && pairs
                .all(|(at, (&old, &new))| old == new || is_soft(old) && is_soft(new) && slides(at));
        if !fits {
            self.assemble((problem, linear.active), pattern, rows);
            // If the factorisation fails, there is no factor.
            if std::mem::take(&mut self.is_factored) {
                self.stiff.factor_again(pattern)?;
            } else {
                self.stiff.factor(pattern)?;
            }
            self.is_factored = true;
            self.factored.clear();
            self.factored.extend_from_slice(&self.stiffness[..rows]);
        }
        Ok(())
    }

    /// `z = P⁻¹ r`.
    pub(super) fn apply(&mut self, linear: &Linear<'_, S>, r: &[f64], z: &mut [f64]) {
        let (pattern, work) = (linear.resistance.pattern(), &mut self.work);
        let [r_v, r_n, r_f, r_t] = linear.split(r);
        let [z_v, z_n, z_f, z_t] = linear.split_mut(z);
        let (normal, tangential) = self.stiffness.split_at(linear.problem.normal.len());
        let frictionless = linear.problem.uses_frictionless_slip;
        let ActiveTerms {
            closed, sticking, ..
        } = linear.active;
        work.copy_from_slice(r_v);
        for entry in closed {
            let k = entry.index as usize;
            entry.row().add(normal[k] * r_f[k] / VELOCITY_WEIGHT, work);
        }
        if !frictionless {
            for entry in sticking {
                let m = entry.index;
                entry
                    .row
                    .add(tangential[m] * r_t[m] / VELOCITY_WEIGHT, work);
            }
        }
        self.stiff.solve(pattern, work, z_v);
        if frictionless {
            work.copy_from_slice(r_n);
        }
        z_f.fill(0.0);
        for entry in closed {
            let (k, row) = (entry.index as usize, entry.row());
            z_f[k] = normal[k] * (r_f[k] / VELOCITY_WEIGHT - row.read(z_v));
            if frictionless {
                row.add(z_f[k], work);
            }
        }
        if frictionless {
            self.near.solve(pattern, work, z_n);
        }
        let read_from: &[f64] = if frictionless { z_n } else { z_v };
        z_t.fill(0.0);
        for entry in sticking {
            let m = entry.index;
            z_t[m] = tangential[m] * (entry.row.read(read_from) - r_t[m] / VELOCITY_WEIGHT);
        }
    }

    /// Assembles the matrix: the near-field part of R, and the stiffnesses of the terms of the
    /// linear system among the first `rows` candidates and components of friction.
    ///
    /// If the preceding matrix had the same candidates, only the blocks of spheres whose stiffness
    /// changed are assembled.
    ///
    /// In a suspension all blocks are assembled, since the directions of slides change in every
    /// system.
    fn assemble(
        &mut self,
        (problem, terms): (&Problem<S>, &ActiveTerms<S>),
        pattern: &NearPattern<S>,
        rows: usize,
    ) {
        let is_update = self.is_factored && !self.changed.is_empty() && S::TANGENTS == 1;
        self.changed.clear();
        self.changed.resize(pattern.spheres(), !is_update);
        let (matrix, changed) = (&mut self.stiff, &mut self.changed);
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
    use crate::space::modes::Vec2;

    /// A ring of spheres, each in contact with the next, with friction on every second contact.
    fn ring(n: u32) -> (Problem, NearPattern<Layer>, Preconditioner) {
        let next = |i: u32| (i + 1) % n;
        let mut pairs: Vec<_> = (0..n).map(|i| (i.min(next(i)), i.max(next(i)))).collect();
        pairs.sort_unstable();
        let n = n as usize;
        let pattern = NearPattern::new(n, &pairs).unwrap();
        let mut system = Preconditioner::<Layer>::default();
        system.near.reset(&pattern);
        for i in 0..n {
            let own_block = [9.0, 0.5, 0.1, 0.5, 8.0, -0.3, 0.1, -0.3, 10.0 + i as f64];
            system.near.add_own(&pattern, i, &own_block);
        }
        let mut problem = Problem::<Layer>::default();
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
        system: &mut Preconditioner,
        problem: &Problem,
        pattern: &NearPattern<Layer>,
        number: usize,
    ) -> Vec<f64> {
        let (contacts, rows) = (problem.normal.len(), problem.friction_rows());
        let is_missing = |at: usize| at / 5 == number;
        let mut states = States::default();
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
        system.stiff.factor(pattern).unwrap();
        system.is_factored = true;
        system.factored.clone_from(&system.stiffness);
        let forces: Vec<f64> = (0..3 * pattern.spheres())
            .map(|k| (k as f64).cos())
            .collect();
        let mut velocities = vec![0.0; forces.len()];
        system.stiff.solve(pattern, &forces, &mut velocities);
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
