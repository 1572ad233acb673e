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
mod linear;
mod preconditioner;

use self::active::ActiveTerms;
use self::linear::{BothMotions, Linear};
use self::preconditioner::Preconditioner;
use super::statement::{
    AppliedForces, FORCE_ROUNDOFF, Forces, FrictionState, Problem, RoundoffThresholds, States,
    System, TYPICAL_MOBILITY, largest,
};
use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, PairwiseResistance, Resistance};
use crate::linalg::StopCriteria;
use crate::linalg::dense::{add_scaled, dot};
use crate::linalg::gmres::Gmres;
use crate::space::Layer;
use std::f64::consts::PI;

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
/// Rounding error of velocities, in a·rate: those of contacts are of order one.
const MIN_VELOCITY: f64 = 1e-13;
/// Maximum number of iterations of one call.
const MAX_ITERATIONS: usize = 40;
/// Maximum number of calls for the motion under given forces, from which their residual is
/// computed.
const MAX_MEASURE_CALLS: u32 = 8;
/// Minimum norm of the forces relative to which residuals are measured: the drag on one sphere, in
/// mu·a²·rate.
const MIN_FORCE: f64 = 6.0 * PI;

/// The motion of the last solution, the preconditioner and workspace.
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
    preconditioner: Preconditioner<S>,
    /// Memory for the terms of the linear system, of no meaning between solutions.
    active: ActiveTerms<S>,
    gmres: Gmres,
    /// The velocities per rate of dilation, weighted as residuals, and what the preconditioner
    /// makes of them.
    dilation_column: Vec<f64>,
    dilation_response: Vec<f64>,
    /// Residual and correction, each of v, v_N, f and t.
    residual: Vec<f64>,
    correction: Vec<f64>,
    both: BothMotions<S>,
    /// Workspace for the motion under given forces: the applied forces without them, all contacts
    /// open, no contact forces.
    given: [Vec<f64>; 2],
    open_states: States<S>,
    no_forces: Forces<S>,
    /// Workspace of [`SparseSystemView::free_motion`].
    spare: Vec<f64>,
}

impl<S: Fluid> SparseSystem<S> {
    /// Starts a stage at new positions.
    pub(crate) fn begin_stage(&mut self) {
        self.preconditioner.begin_stage();
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
        } else if self.velocities.iter().any(|&v| v != 0.0) {
            let work = &mut self.both.work_of_one;
            linear.resistance.apply(&self.velocities, r_v, work);
        }
        for (r, applied) in [&mut *r_v, &mut *r_n].into_iter().zip(&self.applied) {
            for (r, f) in r.iter_mut().zip(applied) {
                *r = f - *r;
            }
        }
        let dilation = problem.dilation.rate(forces);
        for entry in &linear.active.closed {
            let (k, row) = (entry.index as usize, entry.row());
            let f = forces.normal[k];
            row.add(f, r_v);
            if problem.uses_frictionless_slip {
                row.add(f, r_n);
            }
            let mut moved = row.read(&self.velocities) + entry.compliance * f;
            if let Some(c) = problem.dilation.openings.get(k) {
                moved += c * dilation;
            }
            r_f[k] = -VELOCITY_WEIGHT * (moved + problem.normal[k].bias);
        }
        for (entry, t) in problem.friction.iter().zip(&forces.tangential) {
            for (row, &t) in entry.rows.as_ref().iter().zip(t.as_ref()) {
                if t != 0.0 {
                    row.add(-t, r_v);
                }
            }
        }
        let (flow, dilation) = if problem.uses_frictionless_slip {
            let rate = problem.dilation.frictionless_rate(forces);
            (&self.frictionless, rate)
        } else {
            (&self.velocities, dilation)
        };
        for entry in &linear.active.sticking {
            let m = entry.index;
            let mut moved =
                entry.row.read(flow) - entry.compliance * entry.force(&forces.tangential);
            if !problem.dilation.shiftings.is_empty() {
                moved += entry.shifting(&problem.dilation) * dilation;
            }
            r_t[m] = -VELOCITY_WEIGHT * (moved + entry.shift);
        }
    }
}

/// A [`SparseSystem`] with the hydrodynamic resistance of its stage.
pub(crate) struct SparseSystemView<'a, S: Fluid> {
    resistance: &'a PairwiseResistance<S>,
    system: &'a mut SparseSystem<S>,
    /// Terms of the linear system for the current active set, lent by `system`.
    active: ActiveTerms<S>,
    /// [`AppliedForces::relative_tolerance`].
    relative_tolerance: f64,
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
        problem.prescribe(states, forces, false);
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
            system.preconditioner.update(&linear).ok()?;
            system.correction.clear();
            system.correction.resize(system.residual.len(), 0.0);
            let dilates = !problem.dilation.openings.is_empty();
            if dilates {
                linear.set_dilation_column(&mut system.dilation_column);
                let (column, response) = (&system.dilation_column, &mut system.dilation_response);
                response.clear();
                response.resize(column.len(), 0.0);
                system.preconditioner.apply(&linear, column, response);
            }
            let response = &system.dilation_response;
            let info = system.gmres.solve(
                &system.residual,
                &mut system.correction,
                StopCriteria::new(goal, MAX_ITERATIONS),
                |x, y| linear.apply(x, y, &mut system.both),
                |r, z| {
                    system.preconditioner.apply(&linear, r, z);
                    if dilates {
                        linear.dilate(response, z);
                    }
                },
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
            problem.prescribe(states, forces, false);
        }
        if !residual_norm.is_finite() {
            return None;
        }
        system.has_motion = true;
        self.read(problem, forces);
        Some(RoundoffThresholds {
            force: residual_norm.max(FORCE_ROUNDOFF * largest(&forces.normal)),
            velocity: (residual_norm / VELOCITY_WEIGHT).max(MIN_VELOCITY),
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
            for applied in &mut self.system.applied {
                entry.row.add(f, applied);
            }
        }
        for (entry, t) in problem.friction.iter().zip(&forces.tangential) {
            for (row, &t) in entry.rows.as_ref().iter().zip(t.as_ref()) {
                row.add(-t, &mut self.system.applied[0]);
            }
        }
        let mut no_forces = std::mem::take(&mut self.system.no_forces);
        no_forces.reset(problem);
        for _ in 0..MAX_MEASURE_CALLS {
            let roundoff = self.solve(problem, &open, true, &mut no_forces);
            if roundoff.is_none_or(|roundoff| roundoff.exact) {
                break;
            }
        }
        let system = &mut *self.system;
        std::mem::swap(&mut system.applied, &mut system.given);
        (system.open_states, system.no_forces) = (open, no_forces);
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
        system.preconditioner.begin(resistance, problem)?;
        Ok(Self {
            resistance,
            active: std::mem::take(&mut system.active),
            system,
            relative_tolerance: applied.relative_tolerance,
        })
    }

    /// The motion under given forces without contacts, from the given velocities. The contact
    /// problem starts from it unless it has a motion.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`], if the resistance cannot be factored.
    pub(crate) fn free_motion(
        resistance: &'a Resistance<S>,
        system: &'a mut SparseSystem<S>,
        applied: AppliedForces<'_>,
        velocities: &mut [f64],
    ) -> Result<(), Error> {
        let problem = Problem::default();
        let (mut contact_motion, has_motion) =
            (std::mem::take(&mut system.spare), system.has_motion);
        contact_motion.clone_from(&system.velocities);
        let mut view = Self::begin(resistance, system, &problem, applied)?;
        view.system.velocities.copy_from_slice(velocities);
        let (states, mut no_forces) = (States::default(), Forces::default());
        for _ in 0..MAX_MEASURE_CALLS {
            let roundoff = view.solve(&problem, &states, true, &mut no_forces);
            if roundoff.is_none_or(|roundoff| roundoff.exact) {
                break;
            }
        }
        velocities.copy_from_slice(&view.system.velocities);
        view.system.active = view.active;
        let system = view.system;
        if has_motion {
            system.velocities.clone_from(&contact_motion);
        } else {
            // The contact problem of the first stage starts from it.
            system.frictionless.copy_from_slice(velocities);
        }
        (system.spare, system.has_motion) = (contact_motion, has_motion);
        Ok(())
    }

    /// Ends the solution, whose disturbance velocities are copied to `velocities`.
    pub(crate) fn finish(self, velocities: &mut [f64]) {
        self.system.active = self.active;
        velocities.copy_from_slice(&self.system.velocities);
    }

    /// Computes slack and slip from the current velocities.
    fn read(&self, problem: &Problem<S>, forces: &mut Forces<S>) {
        let dilation = problem.dilation.rate(forces);
        let frictionless = problem.dilation.frictionless_rate(forces);
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
        for (w, c) in slack.iter_mut().zip(&problem.dilation.openings) {
            *w += c * dilation;
        }
        let (flow, dilation) = if problem.uses_frictionless_slip {
            (&self.system.frictionless, frictionless)
        } else {
            (v, dilation)
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
        let shiftings = problem.dilation.shiftings.iter();
        for (z, s) in S::components_mut(slip).iter_mut().zip(shiftings) {
            *z += s * dilation;
        }
    }
}
