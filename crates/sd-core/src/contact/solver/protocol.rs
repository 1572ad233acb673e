//! Parts of the contact problem that the paper's protocol asks for.

use super::super::solve::problem::{self, Driving, System};
use super::super::solve::sparse::OnNetwork;
use super::{Backend, ContactSolver};
use crate::error::Error;
use crate::hydrodynamics::resistance::Resistance;

impl ContactSolver {
    /// Forces of either sign that halt all candidates at once, without friction; the largest velocity left.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(in crate::contact) fn halt_all(
        &mut self,
        resistance: &Resistance,
        forces: &[f64],
    ) -> Result<f64, Error> {
        let (problem, solver) = (&mut self.problem, &mut self.solver);
        solver.states.closed.clear();
        solver.states.closed.resize(problem.normal.len(), true);
        solver.states.grip.clear();
        solver.forces.clear();
        let solved = match &mut self.backend {
            Backend::Dense(system) => {
                system.begin(resistance, problem, forces);
                solver.solve_states(problem, &mut **system).0
            }
            Backend::Sparse(system) => {
                system.start();
                let driving = Driving::by(forces);
                let mut on_network = OnNetwork::begin(resistance, system, problem, driving)?;
                solver.solve_states(problem, &mut on_network).0
            }
        };
        if !solved {
            solver.forces.normal.fill(0.0);
            return Ok(f64::INFINITY);
        }
        Ok(problem::largest(&solver.forces.slack))
    }

    /// The slip that the normal forces at hand leave, in the tangential rows of the problem.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(in crate::contact) fn measure_slip(
        &mut self,
        resistance: &Resistance,
        forces: &[f64],
    ) -> Result<(), Error> {
        let (problem, solver) = (&self.problem, &mut self.solver);
        solver.forces.tangential.clear();
        solver
            .forces
            .tangential
            .resize(problem.tangential.len(), 0.0);
        match &mut self.backend {
            Backend::Dense(system) => {
                system.begin_rows(resistance, problem);
                system.measure(problem, &mut solver.forces);
            }
            Backend::Sparse(system) => {
                let driving = Driving::by(forces);
                OnNetwork::begin(resistance, system, problem, driving)?
                    .measure(problem, &mut solver.forces);
            }
        }
        Ok(())
    }

    /// Velocities `[3N]` under the forces at hand.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(in crate::contact) fn move_under_forces(
        &mut self,
        resistance: &Resistance,
        forces: &[f64],
        velocities: &mut [f64],
    ) -> Result<(), Error> {
        match &mut self.backend {
            Backend::Dense(system) => system.finish(resistance, &self.solver.forces, velocities),
            Backend::Sparse(system) => {
                let driving = Driving::by(forces);
                OnNetwork::begin(resistance, system, &self.problem, driving)?
                    .measure(&self.problem, &mut self.solver.forces);
                velocities.copy_from_slice(system.velocities()[0]);
            }
        }
        self.take_motion(velocities);
        Ok(())
    }
}
