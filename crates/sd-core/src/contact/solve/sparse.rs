//! The contact problem of large layers: no matrix of contacts, one sparse factor in which closed contacts are stiff.
//!
//! For given states the velocities and forces solve one linear system, here with rows that slide left out of the unknowns:
//!
//! ```text
//! R v − Cᵀ f + Dᵀ t = F                    all spheres
//! C v + κ f = −b                           closed candidates
//! D v − μ t = −d                           sticking rows; t = ±ν (f − f₀) on sliding ones
//! R v_N − Cᵀ f = F_N                       where rows read the motion v_N that normal forces alone leave, in place of v
//! ```
//!
//! It is solved by [`Gmres`] in double precision. The preconditioner is the same system with the near part of R and without what makes it
//! unsymmetric; eliminating the forces from it leaves `R + Cᵀ S C + Dᵀ S D` with the stiffnesses S = 1/κ of springs over the time
//! ahead, or a large one for rigid contacts: a sparse Cholesky factor in single precision. So soft and rigid contacts cost the same.

mod active;
mod assembly;
mod linear;

use self::active::Active;
use self::linear::{BothMotions, Linear, Preconditioner};
use super::problem::{
    AppliedForces, Forces, FrictionState, Problem, RoundoffThresholds, States, System, largest,
};
use crate::error::Error;
use crate::hydrodynamics::resistance::{
    Fluid, NearMatrix, NearPattern, PairwiseResistance, Resistance,
};
use crate::linalg::Until;
use crate::linalg::dense::{add_scaled, dot};
use crate::linalg::error::BadPivot;
use crate::linalg::gmres::Gmres;
use crate::space::Layer;
use std::f64::consts::PI;

/// Smallest compliance in the preconditioner, in a/(mu·a²·rate): single precision holds its inverse well.
const MIN_COMPLIANCE: f64 = 1e-6;
/// Largest stiffness in the preconditioner, that of rigid contacts.
const STIFF: f64 = 1.0 / MIN_COMPLIANCE;
/// What a velocity counts in the norm of the residual: the force that it takes, in mu·a.
const WEIGHT: f64 = 30.0;
/// By how much one call lowers the residual. With 1e-3 layers of 1000 take a fifth more linear systems, with 1e-5 an eighth more iterations.
const GAIN: f64 = 1e-4;
/// Residual that is small enough, over the norm of all forces.
const ROUNDING: f64 = 1e-11;
/// Velocity, in a·rate, below which it is small enough however large the forces are, unless it is lost in rounding.
const SLOW: f64 = 1e-9;
/// Residual that is rounding, over the norm of all forces.
const MIN_ROUNDING: f64 = 1e-14;
/// Most iterations of one call.
const MAX_ITERATIONS: usize = 40;
/// Calls for the motion under given forces, whose residual is measured by it.
const MAX_CALLS: u32 = 8;
/// Forces are never judged against less than the drag on a sphere, in mu·a²·rate.
const MIN_FORCE: f64 = 6.0 * PI;
/// Mobility of a contact, about, in 1/(mu·a).
const MOBILITY: f64 = 0.02;

/// What is at hand of the near part of R.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
enum NearFieldStatus {
    #[default]
    Nothing,
    Matrix,
    /// The matrix too.
    Factor,
}

/// Velocities, factors and workspace.
#[derive(Default)]
pub(crate) struct SparseSystem<S: Fluid = Layer> {
    /// v, `[3N]`.
    velocities: Vec<f64>,
    /// v_N, `[3N]`, where tangential rows read it.
    frictionless: Vec<f64>,
    /// Whether these are a solution's.
    has_motion: bool,
    /// F and F_N, `[3N]` each.
    applied: [Vec<f64>; 2],
    /// Number of each candidate's pair in the pattern.
    numbers: Vec<Option<usize>>,
    /// Factor of the near part of `R + Cᵀ S C + Dᵀ S D`.
    held: NearMatrix<S>,
    /// Stiffnesses of the candidates and rows in it, and whether it was made in this stage.
    factored: Vec<f64>,
    is_factored: bool,
    /// Whether the matrix is of the candidates and rows at hand; spheres whose stiffness in it is another now.
    is_same: bool,
    changed: Vec<bool>,
    /// Stiffnesses that the states ask for.
    stiffness: Vec<f64>,
    /// What the states put into the system.
    active: Active<S>,
    /// The near part of R, and what of it is that of the stage.
    near: NearMatrix<S>,
    has_near: NearFieldStatus,
    /// Solver of the system.
    gmres: Gmres,
    /// Residual and correction: of v, of v_N, of f, of t.
    residual: Vec<f64>,
    correction: Vec<f64>,
    /// Forces on the spheres, `[3N]`.
    work: Vec<f64>,
    both: BothMotions<S>,
    /// What belongs to the motion under given forces: applied forces with those of contacts, contacts that are open, no forces.
    given: [Vec<f64>; 2],
    open: States,
    none: Forces,
}

impl<S: Fluid> SparseSystem<S> {
    /// Begins a stage at new positions.
    pub(crate) fn start(&mut self) {
        self.has_near = NearFieldStatus::Nothing;
        self.is_factored = false;
    }

    /// Forgets the motion of the stage before: the next one begins with spheres at rest in the background.
    pub(crate) fn forget(&mut self) {
        self.velocities.clear();
        self.frictionless.clear();
        self.has_motion = false;
    }

    /// Disturbance velocities `[3N]` of the last solution, and those that normal forces alone leave.
    pub(crate) fn velocities(&self) -> [&[f64]; 2] {
        [&self.velocities, &self.frictionless]
    }
}

impl<S: Fluid> SparseSystem<S> {
    /// The residual of the linear system at the velocities and forces at hand.
    fn find_residual(&mut self, linear: &Linear<'_, S>, forces: &Forces) {
        let problem = linear.problem;
        let n = self.velocities.len();
        let flow = if problem.uses_frictionless_slip {
            2 * n
        } else {
            n
        };
        let size = flow + problem.normal.len() + problem.tangential.len();
        self.residual.clear();
        self.residual.resize(size, 0.0);
        let [r_v, r_n, r_f, r_t] = linear.split_mut(&mut self.residual);
        if problem.uses_frictionless_slip {
            let both = &mut self.both;
            both.multiply(linear.network, &self.velocities, &self.frictionless);
            both.read(r_v, r_n);
        } else {
            linear.network.apply(&self.velocities, r_v);
        }
        for (r, applied) in [&mut *r_v, &mut *r_n].into_iter().zip(&self.applied) {
            for (r, f) in r.iter_mut().zip(applied) {
                *r = f - *r;
            }
        }
        for entry in &linear.active.closed {
            let (k, row) = (entry.at as usize, entry.row());
            let f = forces.normal[k];
            row.add(f, r_v);
            if problem.uses_frictionless_slip {
                row.add(f, r_n);
            }
            let moved = row.read(&self.velocities) + entry.compliance * f;
            r_f[k] = -WEIGHT * (moved + problem.normal[k].bias);
        }
        for (entry, &t) in problem.tangential.iter().zip(&forces.tangential) {
            if t != 0.0 {
                entry.row.add(-t, r_v);
            }
        }
        let flow = if problem.uses_frictionless_slip {
            &self.frictionless
        } else {
            &self.velocities
        };
        for entry in &linear.active.sticking {
            let m = entry.at;
            let moved = entry.row.read(flow) - entry.compliance * entry.force(&forces.tangential);
            r_t[m] = -WEIGHT * (moved + entry.shift);
        }
    }

    /// Forces of states that carry none or that follow the load.
    fn follow(linear: &Linear<'_, S>, forces: &mut Forces) {
        let problem = linear.problem;
        forces.normal.resize(problem.normal.len(), 0.0);
        forces.tangential.resize(problem.tangential.len(), 0.0);
        for (f, closed) in forces.normal.iter_mut().zip(&linear.states.closed) {
            if !closed {
                *f = 0.0;
            }
        }
        let slips = S::by_slip_mut(&mut forces.tangential).iter_mut();
        for (k, t) in slips.enumerate() {
            let m = S::TANGENTS * k;
            let state = linear.states.friction[m];
            if state == FrictionState::Stick {
                continue;
            }
            let row = &problem.tangential[m];
            let force = row.slipping_force(state, forces.normal[row.contact]);
            match (linear.states.slide(m), t.as_mut()) {
                (Some(slide), [x, y]) => {
                    let [_, across] = slide.turned([*x, *y]);
                    [*x, *y] = slide.turned_back([force, across]);
                }
                (_, t) => t.fill(force),
            }
        }
    }

    /// Makes the factor that the states need, unless it is there.
    fn prepare(
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
        // A slide that turns, or slips faster, changes little.
        let slides = |at: usize| {
            let row = at.checked_sub(problem.normal.len());
            row.is_some_and(|m| linear.states.slide(m).is_some())
        };
        let is_soft = |stiffness: f64| stiffness > 0.0 && stiffness < STIFF;
        let mut pairs = self.factored.iter().zip(&self.stiffness).enumerate();
        let fits = self.is_factored
            && self.factored.len() == rows
            && pairs
                .all(|(at, (&old, &new))| old == new || is_soft(old) && is_soft(new) && slides(at));
        if !fits {
            self.assemble((problem, linear.states), pattern, rows);
            // Where it fails there is none.
            if std::mem::take(&mut self.is_factored) {
                self.held.factor_again(pattern)?;
            } else {
                self.held.factor(pattern)?;
            }
            self.is_factored = true;
            self.factored.clear();
            self.factored.extend_from_slice(&self.stiffness[..rows]);
        }
        Ok(())
    }
}

/// A [`SparseSystem`] with the network it belongs to.
pub(crate) struct SparseSystemView<'a, S: Fluid> {
    /// R pair by pair.
    pub(crate) network: &'a PairwiseResistance<S>,
    /// Its pattern.
    pub(crate) pattern: &'a NearPattern<S>,
    /// Velocities, factors and workspace.
    pub(crate) system: &'a mut SparseSystem<S>,
    /// The residual that is enough, over the forces that drive the spheres; 0: as exact as can be.
    pub(crate) enough: f64,
}

impl<S: Fluid> System<S> for SparseSystemView<'_, S> {
    fn solve(
        &mut self,
        problem: &Problem<S>,
        states: &States,
        last: bool,
        forces: &mut Forces,
    ) -> Option<RoundoffThresholds> {
        let mut active = std::mem::take(&mut self.system.active);
        active.list(problem, states);
        let linear = Linear {
            network: self.network,
            problem,
            states,
            active: &active,
        };
        let roundoff = self.solve_linear(&linear, last, forces);
        self.system.active = active;
        roundoff
    }

    fn measure(&mut self, problem: &Problem<S>, forces: &mut Forces) {
        // The motion under these forces: no contact is closed, all forces are given.
        let mut open = std::mem::take(&mut self.system.open);
        open.closed.clear();
        open.closed.resize(problem.normal.len(), false);
        open.friction.clear();
        open.friction
            .resize(problem.tangential.len(), FrictionState::Inactive);
        for (given, applied) in self.system.given.iter_mut().zip(&self.system.applied) {
            given.clone_from(applied);
        }
        for (entry, &f) in problem.normal.iter().zip(&forces.normal) {
            for given in &mut self.system.given {
                entry.row.add(f, given);
            }
        }
        for (entry, &t) in problem.tangential.iter().zip(&forces.tangential) {
            entry.row.add(-t, &mut self.system.given[0]);
        }
        let exchange = |system: &mut SparseSystem<S>| {
            std::mem::swap(&mut system.applied, &mut system.given);
        };
        exchange(self.system);
        let mut none = std::mem::take(&mut self.system.none);
        for _ in 0..MAX_CALLS {
            let roundoff = self.solve(problem, &open, true, &mut none);
            if roundoff.is_none_or(|roundoff| roundoff.exact) {
                break;
            }
        }
        exchange(self.system);
        (self.system.open, self.system.none) = (open, none);
        self.read(problem, forces);
    }

    fn read_motion(&self, problem: &Problem<S>, forces: &mut Forces) -> bool {
        if self.system.has_motion {
            self.read(problem, forces);
        }
        self.system.has_motion
    }

    fn mobility(&self, _: usize) -> f64 {
        MOBILITY
    }
}

impl<'a, S: Fluid> SparseSystemView<'a, S> {
    /// Takes the candidates of a stage and what drives the spheres.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`], if the resistance cannot be factored.
    pub(crate) fn begin(
        resistance: &'a Resistance<S>,
        system: &'a mut SparseSystem<S>,
        problem: &Problem<S>,
        applied: AppliedForces<'_>,
    ) -> Result<Self, Error> {
        let Some(network) = resistance.pairwise() else {
            unreachable!("a sparse system is made for what is held pair by pair")
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
            network.number_of((i as u32, j as u32))
        });
        system.numbers.extend(numbers);
        system.is_same = false;
        let pattern = network.pattern();
        if system.has_near == NearFieldStatus::Nothing {
            network.fill(pattern, &mut system.near);
            system.has_near = NearFieldStatus::Matrix;
        }
        if problem.uses_frictionless_slip && system.has_near < NearFieldStatus::Factor {
            let factored = system.near.factor(pattern);
            factored.map_err(|bad| Error::NotPositiveDefinite {
                matrix: "near part of the resistance",
                pivot: bad.pivot,
                sphere: bad.pivot / S::MODES,
            })?;
            system.has_near = NearFieldStatus::Factor;
        }
        Ok(Self {
            pattern,
            network,
            system,
            enough: applied.relative_tolerance,
        })
    }

    /// See [`System::solve`].
    fn solve_linear(
        &mut self,
        linear: &Linear<'_, S>,
        last: bool,
        forces: &mut Forces,
    ) -> Option<RoundoffThresholds> {
        let (problem, system) = (linear.problem, &mut *self.system);
        SparseSystem::follow(linear, forces);
        system.find_residual(linear, forces);
        let square = |x: &[f64]| dot(x, x);
        let size = square(&system.applied[0])
            + square(&forces.normal)
            + square(&forces.tangential)
            + MIN_FORCE * MIN_FORCE;
        // Forces that contacts exchange among themselves, however large, are none of what an iteration from outside is wrong by.
        let driven = square(&system.applied[0]).sqrt() + MIN_FORCE;
        let size = size.sqrt();
        let floor = (ROUNDING * size)
            .min(WEIGHT * SLOW)
            .max(MIN_ROUNDING * size)
            .max(self.enough * driven);
        let before = square(&system.residual).sqrt();
        let goal = if last {
            floor
        } else {
            floor.max(GAIN * before)
        };
        let mut left = before;
        if before > floor {
            system.prepare(linear, self.pattern).ok()?;
            system.correction.clear();
            system.correction.resize(system.residual.len(), 0.0);
            let mut preconditioner = Preconditioner {
                pattern: self.pattern,
                held: &mut system.held,
                near: &mut system.near,
                stiffness: &system.stiffness,
                work: &mut system.work,
            };
            let reached = system.gmres.solve(
                &system.residual,
                &mut system.correction,
                Until::new(goal, MAX_ITERATIONS),
                |x, y| linear.apply(x, y, &mut system.both),
                |r, z| linear.precondition(&mut preconditioner, r, z),
            );
            left = reached.residual;
            let [v, v_n, f, t] = linear.split(&system.correction);
            let add = |x: &mut [f64], dx: &[f64]| add_scaled(&mut x[..dx.len()], dx, 1.0);
            add(&mut system.velocities, v);
            add(&mut system.frictionless, v_n);
            add(&mut forces.normal, f);
            for entry in &linear.active.sticking {
                entry.add(t[entry.at], &mut forces.tangential);
            }
            SparseSystem::follow(linear, forces);
        }
        if !left.is_finite() {
            return None;
        }
        system.has_motion = true;
        self.read(problem, forces);
        Some(RoundoffThresholds {
            force: left.max(1e-13 * largest(&forces.normal)),
            velocity: (left / WEIGHT).max(1e-13),
            exact: left <= floor,
        })
    }

    /// Slack and slip of the present velocities.
    fn read(&self, problem: &Problem<S>, forces: &mut Forces) {
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
        let entries = problem.tangential.iter().zip(&*tangential);
        slip.extend(entries.map(|(e, t)| e.row.read(flow) + e.shift - e.compliance * t));
    }
}
