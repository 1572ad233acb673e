//! The contact problem of large systems: no matrix of contacts is formed, and the preconditioner is
//! one sparse factor in which closed contacts are stiff springs.
//!
//! For a given active set, velocities and forces are the solution of one linear system. Slipping
//! rows are eliminated from the unknowns:
//!
//! ```text
//! R v − Cᵀ f + Dᵀ t = F                    all spheres
//! C v + κ f = −b                           closed contacts
//! D v − μ t = −d                           sticking rows; t = ±ν (f − f₀) on slipping ones
//! R v_N − Cᵀ f = F_N                       where friction depends on the motion v_N under normal
//!                                          forces alone, instead of v
//! ```
//!
//! It is solved by [`Gmres`] in double precision. The preconditioner is the same system with only
//! the near-field part of R and without the unsymmetric terms. Elimination of the forces leaves the
//! Schur complement `R + Cᵀ S C + Dᵀ S D`, with the stiffnesses S = 1/κ of springs over the time
//! span, or a large stiffness for rigid contacts. It is factored by a sparse Cholesky factorisation
//! in single precision. Soft and rigid contacts therefore have the same cost.

mod active;
mod assembly;
mod linear;

use self::active::ActiveTerms;
use self::linear::{BothMotions, Linear, Preconditioner};
use super::statement::{
    AppliedForces, Forces, FrictionState, Problem, RoundoffThresholds, States, System,
    TYPICAL_MOBILITY, largest,
};
use crate::error::Error;
use crate::hydrodynamics::resistance::{
    Fluid, NearMatrix, NearPattern, PairwiseResistance, Resistance,
};
use crate::linalg::StopCriteria;
use crate::linalg::dense::{add_scaled, dot};
use crate::linalg::error::BadPivot;
use crate::linalg::gmres::Gmres;
use crate::space::Layer;
use std::f64::consts::PI;

/// Minimum compliance in the preconditioner, in a/(mu·a²·rate): its inverse is well represented in
/// single precision.
const MIN_COMPLIANCE: f64 = 1e-6;
/// Maximum stiffness in the preconditioner, that of rigid contacts.
const MAX_STIFFNESS: f64 = 1.0 / MIN_COMPLIANCE;
/// Weight of velocities relative to forces in the norm of the residual, in mu·a.
const VELOCITY_WEIGHT: f64 = 30.0;
/// Factor by which one call reduces the residual. With 1e-3, layers of 1000 spheres require 20 %
/// more linear systems; with 1e-5, an eighth more iterations.
const RESIDUAL_REDUCTION: f64 = 1e-4;
/// Residual that is accurate enough, over the norm of all forces.
const RESIDUAL_TOLERANCE: f64 = 1e-11;
/// Residual velocity, in a·rate, that is accurate enough however large the forces are,
/// unless it is below rounding error.
const VELOCITY_TOLERANCE: f64 = 1e-9;
/// Residual due to rounding, over the norm of all forces.
const ROUNDOFF_RESIDUAL: f64 = 1e-14;
/// Maximum number of iterations of one call.
const MAX_ITERATIONS: usize = 40;
/// Maximum number of calls for the motion under given forces, from which their residual is
/// computed.
const MAX_MEASURE_CALLS: u32 = 8;
/// Minimum norm of the forces relative to which residuals are measured: the drag on one sphere, in
/// mu·a²·rate.
const MIN_FORCE: f64 = 6.0 * PI;

/// Availability of the near-field part of R.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
enum NearFieldStatus {
    #[default]
    Missing,
    Matrix,
    /// Both the matrix and its factor.
    Factor,
}

/// Velocities, factors and workspace.
#[derive(Default)]
pub(crate) struct SparseSystem<S: Fluid = Layer> {
    /// v, `[3N]`.
    velocities: Vec<f64>,
    /// v_N, `[3N]`, where friction depends on it.
    frictionless: Vec<f64>,
    /// Whether these velocities are those of a solution.
    has_motion: bool,
    /// F and F_N, `[3N]` each.
    applied: [Vec<f64>; 2],
    /// Index of each candidate's pair in the pattern.
    numbers: Vec<Option<usize>>,
    /// Factor of the preconditioner, the near-field part of `R + Cᵀ S C + Dᵀ S D`.
    stiff_factor: NearMatrix<S>,
    /// Stiffnesses of the candidates and rows in that factor, and whether it was computed in this
    /// stage.
    factored: Vec<f64>,
    is_factored: bool,
    /// Whether the matrix has the current candidates and rows; spheres whose stiffness has changed
    /// since.
    is_same: bool,
    changed: Vec<bool>,
    /// Stiffnesses for the current active set.
    stiffness: Vec<f64>,
    /// Memory for the terms of the linear system, of no meaning between solutions.
    active: ActiveTerms<S>,
    /// The near-field part of R, and whether it belongs to the current stage.
    near: NearMatrix<S>,
    near_status: NearFieldStatus,
    /// Solver of the system.
    gmres: Gmres,
    /// Residual and correction, each of v, v_N, f and t.
    residual: Vec<f64>,
    correction: Vec<f64>,
    /// Forces on the spheres, `[3N]`.
    work: Vec<f64>,
    both: BothMotions<S>,
    /// Workspace for the motion under given forces: applied and contact forces together, all
    /// contacts open, no contact forces.
    given: [Vec<f64>; 2],
    open_states: States<S>,
    no_forces: Forces<S>,
}

impl<S: Fluid> SparseSystem<S> {
    /// Starts a stage at new positions.
    pub(crate) fn begin_stage(&mut self) {
        self.near_status = NearFieldStatus::Missing;
        self.is_factored = false;
    }

    /// Discards the motion of the preceding stage: the next solution starts from spheres that move
    /// with the background.
    pub(crate) fn clear_motion(&mut self) {
        self.velocities.clear();
        self.frictionless.clear();
        self.has_motion = false;
    }

    /// Disturbance velocities `[3N]` of the last solution, and those under normal forces alone.
    pub(crate) fn velocities(&self) -> [&[f64]; 2] {
        [&self.velocities, &self.frictionless]
    }
}

impl<S: Fluid> SparseSystem<S> {
    /// Computes the residual of the linear system at the current velocities and forces.
    fn compute_residual(&mut self, linear: &Linear<'_, S>, forces: &Forces<S>) {
        let problem = linear.problem;
        self.residual.clear();
        self.residual.resize(linear.size(), 0.0);
        let [r_v, r_n, r_f, r_t] = linear.split_mut(&mut self.residual);
        if problem.uses_frictionless_slip {
            let both = &mut self.both;
            both.multiply(linear.resistance, &self.velocities, &self.frictionless);
            both.read(r_v, r_n);
        } else {
            linear.resistance.apply(&self.velocities, r_v);
        }
        for (r, applied) in [&mut *r_v, &mut *r_n].into_iter().zip(&self.applied) {
            for (r, f) in r.iter_mut().zip(applied) {
                *r = f - *r;
            }
        }
        for entry in &linear.active.closed {
            let (k, row) = (entry.index as usize, entry.row());
            let f = forces.normal[k];
            row.add(f, r_v);
            if problem.uses_frictionless_slip {
                row.add(f, r_n);
            }
            let moved = row.read(&self.velocities) + entry.compliance * f;
            r_f[k] = -VELOCITY_WEIGHT * (moved + problem.normal[k].bias);
        }
        for (entry, t) in problem.friction.iter().zip(&forces.tangential) {
            for (row, &t) in entry.rows.as_ref().iter().zip(t.as_ref()) {
                if t != 0.0 {
                    row.add(-t, r_v);
                }
            }
        }
        let flow = if problem.uses_frictionless_slip {
            &self.frictionless
        } else {
            &self.velocities
        };
        for entry in &linear.active.sticking {
            let m = entry.index;
            let moved = entry.row.read(flow) - entry.compliance * entry.force(&forces.tangential);
            r_t[m] = -VELOCITY_WEIGHT * (moved + entry.shift);
        }
    }

    /// Sets the forces that the active set prescribes: zero, or by the load.
    fn set_dependent_forces(linear: &Linear<'_, S>, forces: &mut Forces<S>) {
        let problem = linear.problem;
        forces.normal.resize(problem.normal.len(), 0.0);
        let zero = S::each_tangent(0.0);
        forces.tangential.resize(problem.friction.len(), zero);
        for (f, closed) in forces.normal.iter_mut().zip(&linear.states.closed) {
            if !closed {
                *f = 0.0;
            }
        }
        problem.prescribe(linear.states, forces, false);
    }

    /// Updates the preconditioner for the current active set, if necessary.
    fn update_preconditioner(
        &mut self,
        linear: &Linear<'_, S>,
        pattern: &NearPattern<S>,
    ) -> Result<(), BadPivot> {
        linear.stiffnesses(&mut self.stiffness);
        let problem = linear.problem;
        let rows = if problem.uses_frictionless_slip {
            problem.normal.len()
        } else {
            self.stiffness.len()
        };
        // A slide whose direction or compliance changes affects the matrix little.
        let slides = |at: usize| {
            let component = at.checked_sub(problem.normal.len());
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
                self.stiff_factor.factor_again(pattern)?;
            } else {
                self.stiff_factor.factor(pattern)?;
            }
            self.is_factored = true;
            self.factored.clear();
            self.factored.extend_from_slice(&self.stiffness[..rows]);
        }
        Ok(())
    }
}

/// A [`SparseSystem`] with the hydrodynamic resistance of its stage.
pub(crate) struct SparseSystemView<'a, S: Fluid> {
    /// R as a sum over pairs.
    pub(crate) resistance: &'a PairwiseResistance<S>,
    /// Sparsity pattern of its near-field part.
    pub(crate) pattern: &'a NearPattern<S>,
    /// Velocities, factors and workspace.
    pub(crate) system: &'a mut SparseSystem<S>,
    /// Terms of the linear system for the current active set, lent by `system`.
    active: ActiveTerms<S>,
    /// Residual that is accurate enough, over the norm of the applied forces; 0: as
    /// accurate as possible.
    pub(crate) relative_tolerance: f64,
}

impl<S: Fluid> System<S> for SparseSystemView<'_, S> {
    fn solve(
        &mut self,
        problem: &Problem<S>,
        states: &States<S>,
        last: bool,
        forces: &mut Forces<S>,
    ) -> Option<RoundoffThresholds> {
        self.active.list(problem, states);
        let linear = Linear {
            resistance: self.resistance,
            problem,
            states,
            active: &self.active,
        };
        let system = &mut *self.system;
        SparseSystem::set_dependent_forces(&linear, forces);
        system.compute_residual(&linear, forces);
        let square = |x: &[f64]| dot(x, x);
        let size = square(&system.applied[0])
            + square(&forces.normal)
            + square(S::components(&forces.tangential))
            + MIN_FORCE * MIN_FORCE;
        // Self-balanced contact forces do not count in the tolerance relative to the applied
        // forces.
        let driven = square(&system.applied[0]).sqrt() + MIN_FORCE;
        let size = size.sqrt();
        let floor = (RESIDUAL_TOLERANCE * size)
            .min(VELOCITY_WEIGHT * VELOCITY_TOLERANCE)
            .max(ROUNDOFF_RESIDUAL * size)
            .max(self.relative_tolerance * driven);
        let before = square(&system.residual).sqrt();
        let goal = if last {
            floor
        } else {
            floor.max(RESIDUAL_REDUCTION * before)
        };
        let mut residual_norm = before;
        if before > floor {
            system.update_preconditioner(&linear, self.pattern).ok()?;
            system.correction.clear();
            system.correction.resize(system.residual.len(), 0.0);
            let mut preconditioner = Preconditioner {
                pattern: self.pattern,
                stiff_factor: &mut system.stiff_factor,
                near: &mut system.near,
                stiffness: &system.stiffness,
                work: &mut system.work,
            };
            let info = system.gmres.solve(
                &system.residual,
                &mut system.correction,
                StopCriteria::new(goal, MAX_ITERATIONS),
                |x, y| linear.apply(x, y, &mut system.both),
                |r, z| linear.precondition(&mut preconditioner, r, z),
            );
            residual_norm = info.residual;
            let [v, v_n, f, t] = linear.split(&system.correction);
            let add = |x: &mut [f64], dx: &[f64]| add_scaled(&mut x[..dx.len()], dx, 1.0);
            add(&mut system.velocities, v);
            add(&mut system.frictionless, v_n);
            add(&mut forces.normal, f);
            for entry in &linear.active.sticking {
                entry.add(t[entry.index], &mut forces.tangential);
            }
            SparseSystem::set_dependent_forces(&linear, forces);
        }
        if !residual_norm.is_finite() {
            return None;
        }
        system.has_motion = true;
        self.read(problem, forces);
        Some(RoundoffThresholds {
            force: residual_norm.max(1e-13 * largest(&forces.normal)),
            velocity: (residual_norm / VELOCITY_WEIGHT).max(1e-13),
            exact: residual_norm <= floor,
        })
    }

    fn measure(&mut self, problem: &Problem<S>, forces: &mut Forces<S>) {
        // The motion under these forces: no contact is closed, and all forces are applied.
        let mut open = std::mem::take(&mut self.system.open_states);
        open.closed.clear();
        open.closed.resize(problem.normal.len(), false);
        open.friction.clear();
        open.friction
            .resize(problem.friction.len(), FrictionState::Inactive);
        for (given, applied) in self.system.given.iter_mut().zip(&self.system.applied) {
            given.clone_from(applied);
        }
        for (entry, &f) in problem.normal.iter().zip(&forces.normal) {
            for given in &mut self.system.given {
                entry.row.add(f, given);
            }
        }
        for (entry, t) in problem.friction.iter().zip(&forces.tangential) {
            for (row, &t) in entry.rows.as_ref().iter().zip(t.as_ref()) {
                row.add(-t, &mut self.system.given[0]);
            }
        }
        let swap_applied = |system: &mut SparseSystem<S>| {
            std::mem::swap(&mut system.applied, &mut system.given);
        };
        swap_applied(self.system);
        let mut no_forces = std::mem::take(&mut self.system.no_forces);
        for _ in 0..MAX_MEASURE_CALLS {
            let roundoff = self.solve(problem, &open, true, &mut no_forces);
            if roundoff.is_none_or(|roundoff| roundoff.exact) {
                break;
            }
        }
        swap_applied(self.system);
        (self.system.open_states, self.system.no_forces) = (open, no_forces);
        self.read(problem, forces);
    }

    fn read_motion(&self, problem: &Problem<S>, forces: &mut Forces<S>) -> bool {
        if self.system.has_motion {
            self.read(problem, forces);
        }
        self.system.has_motion
    }

    fn mobility(&self, _: usize) -> f64 {
        TYPICAL_MOBILITY
    }
}

impl<'a, S: Fluid> SparseSystemView<'a, S> {
    /// Sets up the candidates of a stage and the applied forces.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`], if the resistance cannot be factored.
    pub(crate) fn begin(
        resistance: &'a Resistance<S>,
        system: &'a mut SparseSystem<S>,
        problem: &Problem<S>,
        applied: AppliedForces<'_>,
    ) -> Result<Self, Error> {
        let Some(resistance) = resistance.pairwise() else {
            unreachable!("a sparse system requires a pairwise resistance")
        };
        let given = [applied.all, applied.frictionless];
        for (target, given) in system.applied.iter_mut().zip(given) {
            target.clear();
            target.extend_from_slice(given);
        }
        let size = applied.all.len();
        for velocities in [&mut system.velocities, &mut system.frictionless] {
            velocities.resize(size, 0.0);
        }
        system.work.resize(size, 0.0);
        system.numbers.clear();
        let numbers = problem.normal.iter().map(|entry| {
            let [i, j] = entry.row.spheres;
            #[expect(
                clippy::cast_possible_truncation,
                reason = "sphere numbers fit 32 bits"
            )]
            resistance.number_of((i as u32, j as u32))
        });
        system.numbers.extend(numbers);
        system.is_same = false;
        let pattern = resistance.pattern();
        if system.near_status == NearFieldStatus::Missing {
            resistance.fill(pattern, &mut system.near);
            system.near_status = NearFieldStatus::Matrix;
        }
        if problem.uses_frictionless_slip && system.near_status < NearFieldStatus::Factor {
            let factored = system.near.factor(pattern);
            factored.map_err(|bad| Error::NotPositiveDefinite {
                matrix: "near part of the resistance",
                pivot: bad.pivot,
                sphere: bad.pivot / S::MODES,
            })?;
            system.near_status = NearFieldStatus::Factor;
        }
        Ok(Self {
            pattern,
            resistance,
            active: std::mem::take(&mut system.active),
            system,
            relative_tolerance: applied.relative_tolerance,
        })
    }

    /// Ends the solution, whose disturbance velocities are copied to `velocities`.
    pub(crate) fn finish(self, velocities: &mut [f64]) {
        self.system.active = self.active;
        velocities.copy_from_slice(&self.system.velocities);
    }

    /// Computes slack and slip from the current velocities.
    fn read(&self, problem: &Problem<S>, forces: &mut Forces<S>) {
        let Forces {
            normal,
            tangential,
            slack,
            slip,
        } = forces;
        let v = &self.system.velocities;
        slack.clear();
        let entries = problem.normal.iter().zip(&*normal);
        slack.extend(entries.map(|(e, f)| e.row.read(v) + e.bias + e.compliance * f));
        let flow = if problem.uses_frictionless_slip {
            &self.system.frictionless
        } else {
            v
        };
        slip.clear();
        let entries = problem.friction.iter().zip(&*tangential);
        slip.extend(entries.map(|(e, t)| {
            let mut z = e.shift;
            for k in 0..S::TANGENTS {
                z[k] = e.rows[k].read(flow) + z[k] - e.compliance * t[k];
            }
            z
        }));
    }
}
