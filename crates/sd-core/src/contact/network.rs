//! The rigid scheme in large layers under Ball-Melrose hydrodynamics: the problem of [`super::rigid`] and the friction of
//! [`super::friction`], without any matrix of contacts.
//!
//! ```text
//! R v = F + Cᵀ f − Dᵀ F_t,      f from F_t: see `augmented`,      F_t from f and the slip D (v − v_t) + d that normal forces alone leave,
//! R v_t = −Dᵀ F_t
//! ```
//! Passes between f and F_t end when F_t stands still, accelerated as there. Each pass need only be solved a little better than F_t
//! still moves.

pub mod passing;

use super::augmented::{Augmented, Goal, System, not_positive};
use super::friction::{Anderson, law};
use super::rigid::{MOST_ROUNDS, Memory, bias};
use super::{Contact, ContactState, Contacts, Quality, Surface};
use crate::error::Error;
use crate::geometry::modes::Background;
use crate::hydrodynamics::resistance::{PairwiseResistance, Resistance};
use crate::linalg::cholesky::sparse::{BlockCholesky, BlockPattern};
use crate::linalg::conjugate_gradients::{ConjugateGradients, largest};
use std::f64::consts::PI;

/// Largest number of passes between friction and normal forces.
const MOST_PASSES: u32 = 100;
/// Passes in which the set of activated contacts is still decided.
const DECIDING_PASSES: u32 = 4;
/// Passes whose normal forces need not be exact, as friction is still far off.
const PASSING: u32 = 3;
/// Change of the friction forces, over the largest force, at which they stand still.
const STANDSTILL: f64 = 1e-8;
/// How much better a pass is solved than the last change of the friction forces.
const SHARE: f64 = 0.3;
/// Largest violation asked of the normal problem, first and last, in a·rate.
const VIOLATION: [f64; 2] = [1e-4, 1e-9];
/// Force left over that is rounding, over the largest force.
const ROUNDING: f64 = 1e-11;
/// Most iterations of conjugate gradients with R.
const MOST_ITERATIONS: u32 = 100;
/// Forces are never judged against less than the drag on a sphere, in mu·a²·rate.
const LEAST_FORCE: f64 = 6.0 * PI;

/// What drives the spheres besides contacts, `[3N]` each.
#[derive(Clone, Copy)]
pub struct Driving<'a> {
    /// All external and background forces.
    pub forces: &'a [f64],
    /// What of it belongs to the motion by friction, and so not to the slip that decides about rolling; empty: nothing.
    pub by_friction: &'a [f64],
}

/// Workspace of the scheme.
#[derive(Default)]
pub(super) struct Workspace {
    /// The normal problem.
    normal: Augmented,
    /// Factor of the near part of R, and whether it is that of the stage.
    free: (BlockCholesky, bool),
    /// Motion by friction, `[3N]`.
    by_friction: Vec<f64>,
    /// All forces but the normal ones, `[3N]`.
    driving: Vec<f64>,
    /// Force left over, step and image of the motion by friction, `[3N]`.
    vectors: [Vec<f64>; 3],
    /// Iteration with R.
    gradients: ConjugateGradients,
    /// Friction forces applied, by candidate.
    applied: Vec<f64>,
    /// What the law makes of them.
    wanted: Vec<f64>,
    /// The best applied so far.
    best: Vec<f64>,
    /// Whether friction acts.
    activated: Vec<bool>,
    /// Acceleration.
    anderson: Anderson,
}

impl Workspace {
    /// `x ← x + R⁻¹ (forces − R x)`, to a force left over.
    fn solve_free(
        &mut self,
        network: &PairwiseResistance,
        pattern: &BlockPattern,
        tolerance: f64,
    ) -> Result<(), Error> {
        let (factor, ready) = &mut self.free;
        if !*ready {
            network.fill(pattern, factor);
            factor.factor(pattern).map_err(not_positive)?;
            *ready = true;
        }
        let [left, step, image] = &mut self.vectors;
        network.apply(&self.by_friction, image);
        for (left, image) in left.iter_mut().zip(&*image) {
            *left -= image;
        }
        self.gradients.solve(
            left,
            step,
            (tolerance, MOST_ITERATIONS),
            |v, y| network.apply(v, y),
            |r, z| factor.solve(pattern, r, z),
        );
        for (x, step) in self.by_friction.iter_mut().zip(&*step) {
            *x += step;
        }
        Ok(())
    }

    /// Puts together what drives the spheres besides normal forces, and solves for the motion by friction, to a force left over.
    fn drive(
        &mut self,
        system: &System<'_>,
        driving: Driving<'_>,
        tolerance: f64,
    ) -> Result<(), Error> {
        self.driving.clear();
        self.driving.extend_from_slice(driving.forces);
        let is_driven = self.applied.iter().any(|&f| f != 0.0)
            || !driving.by_friction.is_empty()
            || self.by_friction.iter().any(|&v| v != 0.0);
        if !is_driven {
            return Ok(());
        }
        let left = &mut self.vectors[0];
        left.fill(0.0);
        for (c, &f) in system.list.iter().zip(&self.applied) {
            if f != 0.0 {
                c.add_slip(-f, c.rows(), left);
            }
        }
        for (total, left) in self.driving.iter_mut().zip(&*left) {
            *total += left;
        }
        for (left, force) in left.iter_mut().zip(driving.by_friction) {
            *left += force;
        }
        self.solve_free(system.network, system.pattern, tolerance)
    }

    /// What the law of friction makes of the motion, put into `wanted`; the largest change of a force.
    ///
    /// `deciding`: whether the activated contacts are still chosen.
    fn apply_law(
        &mut self,
        list: &mut [Contact],
        resistance: &Resistance,
        surface: &Surface,
        deciding: bool,
    ) -> f64 {
        let forces = &self.normal.forces;
        let mut change: f64 = 0.0;
        for (k, c) in list.iter_mut().enumerate() {
            if deciding {
                self.activated[k] = forces[k] > surface.critical_load;
            }
            let (wanted, state) = if self.activated[k] {
                if c.slip_resistance == 0.0 {
                    c.slip_resistance = resistance.slip_resistance(&c.pair);
                }
                let slip = c.background[1] + c.slip_row(&self.normal.velocities)
                    - c.slip_row(&self.by_friction);
                law(slip, c.slip_resistance, surface.friction, forces[k])
            } else {
                (0.0, ContactState::Frictionless)
            };
            c.state = state;
            self.wanted[k] = wanted;
            change = change.max((wanted - self.applied[k]).abs());
        }
        change
    }

    /// Begins with the friction forces in the list.
    fn start_friction(&mut self, list: &[Contact]) {
        self.applied.clear();
        self.applied.extend(list.iter().map(|c| c.tangential_force));
        self.wanted.clear();
        self.wanted.resize(list.len(), 0.0);
        self.activated.clear();
        self.activated.resize(list.len(), false);
        self.anderson.restart();
    }

    /// Begins a stage at new positions.
    fn start(&mut self, size: usize) {
        self.free.1 = false;
        for vector in self.vectors.iter_mut().chain([&mut self.by_friction]) {
            vector.clear();
            vector.resize(size, 0.0);
        }
    }
}

impl Contacts {
    /// Velocities `[3N]` of a network without contacts, under forces `[3N]`.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub fn solve_free_network(
        &mut self,
        network: &PairwiseResistance,
        forces: &[f64],
        velocities: &mut [f64],
    ) -> Result<(), Error> {
        let pattern = network.pattern();
        self.list.clear();
        let work = &mut self.network;
        work.start(forces.len());
        work.vectors[0].copy_from_slice(forces);
        let tolerance = ROUNDING * largest(forces).max(LEAST_FORCE);
        work.solve_free(network, pattern, tolerance)?;
        velocities.copy_from_slice(&work.by_friction);
        Ok(())
    }

    /// As [`Contacts::solve_rigid`], for a network.
    ///
    /// # Errors
    /// As [`Contacts::solve_free_network`].
    #[expect(
        clippy::too_many_arguments,
        reason = "what drives the spheres, what holds them apart, what comes out"
    )]
    pub fn solve_rigid_network(
        &mut self,
        resistance: &Resistance,
        network: &PairwiseResistance,
        background: &Background,
        surface: &Surface,
        time_span: f64,
        driving: Driving<'_>,
        memory: &mut Memory,
        velocities: &mut [f64],
    ) -> Result<Quality, Error> {
        let pattern = network.pattern();
        self.choose_candidates(resistance, background, surface, time_span, memory);
        self.network.start(driving.forces.len());
        let mut worst = Quality::default();
        for _ in 0..MOST_ROUNDS {
            self.begin_network((network, pattern), surface, time_span, memory);
            let quality = self.solve_network(resistance, network, pattern, surface, driving)?;
            worst.residual = quality.residual;
            worst.friction_error = quality.friction_error;
            worst.passes += quality.passes;
            velocities.copy_from_slice(&self.network.normal.velocities);
            self.take_velocities(velocities);
            if !self.add_closing(
                resistance, background, surface, time_span, velocities, memory,
            ) {
                return Ok(worst);
            }
        }
        worst.residual = worst.residual.max(self.fastest_closing(surface, time_span));
        Ok(worst)
    }

    /// Forces of the candidates at hand, put into `list`, and the motion.
    fn solve_network(
        &mut self,
        resistance: &Resistance,
        network: &PairwiseResistance,
        pattern: &BlockPattern,
        surface: &Surface,
        driving: Driving<'_>,
    ) -> Result<Quality, Error> {
        let work = &mut self.network;
        let list = &mut self.list;
        let friction = surface.has_friction();
        let mut quality = Quality::default();
        let mut error = if friction { 1.0 } else { 0.0 };
        let mut least = f64::INFINITY;
        let mut largest_force = LEAST_FORCE;
        loop {
            // After the last pass, that with the least error once more.
            let last = quality.passes == MOST_PASSES;
            let share = if last { STANDSTILL } else { SHARE * error };
            let goal = Goal {
                force: (share * largest_force).max(ROUNDING * largest_force),
                velocity: share.clamp(VIOLATION[1], VIOLATION[0]),
                passing: friction && quality.passes < PASSING,
            };
            let system = System {
                network,
                pattern,
                list,
            };
            work.drive(&system, driving, goal.force)?;
            quality.residual = work.normal.solve(&system, &work.driving, goal)?;
            let forces = &work.normal.forces;
            largest_force = forces.iter().fold(LEAST_FORCE, |m: f64, f| m.max(*f));
            quality.passes += 1;
            if !friction {
                break;
            }
            let deciding = quality.passes <= DECIDING_PASSES;
            let change = work.apply_law(list, resistance, surface, deciding);
            error = change / largest_force;
            quality.friction_error = error;
            let settled = change == 0.0 && goal.velocity == VIOLATION[1] && !goal.passing;
            if last || settled || !deciding && error <= STANDSTILL {
                break;
            }
            if !deciding && error < least {
                least = error;
                work.best.clone_from(&work.applied);
            }
            if quality.passes == MOST_PASSES {
                work.applied.clone_from(&work.best);
            } else if deciding {
                work.applied.clone_from(&work.wanted);
            } else {
                work.anderson.advance(&mut work.applied, &work.wanted);
            }
        }
        self.take_network_forces(surface);
        Ok(quality)
    }

    /// Begins with the forces of the stage before.
    fn begin_network(
        &mut self,
        (network, pattern): (&PairwiseResistance, &BlockPattern),
        surface: &Surface,
        time_span: f64,
        memory: &Memory,
    ) {
        for c in &mut self.list {
            (c.normal_force, c.tangential_force) = memory.forces(c.pair.i, c.pair.j);
        }
        let (work, list) = (&mut self.network, &self.list);
        let bias = |c: &Contact| c.background[0] + bias(c.pair.gap - surface.roughness, time_span);
        let system = System {
            network,
            pattern,
            list,
        };
        work.normal.start(&system, list.iter().map(bias));
        work.start_friction(list);
    }

    /// The forces found, put into `list`.
    fn take_network_forces(&mut self, surface: &Surface) {
        let work = &self.network;
        for (k, c) in self.list.iter_mut().enumerate() {
            c.normal_force = work.normal.forces[k];
            c.tangential_force = work.applied[k];
            if c.normal_force == 0.0 || !surface.has_friction() {
                c.state = ContactState::Frictionless;
            }
        }
    }
}
