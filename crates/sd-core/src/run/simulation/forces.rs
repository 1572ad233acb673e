//! Forces and torques of the user on the spheres of a run.

use super::Simulation;
use crate::error::Error;
use crate::hydrodynamics::applied_forces::{check_net_force, check_numbers};
use crate::model::Hydrodynamics;
use crate::run::spaces::Starts;
use crate::space::cell::Cell;
use crate::space::{Layer, Space};

/// The spheres of a run at the instant at which their forces are requested.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Instant<'a, S: Space = Layer> {
    /// Time since the start of the run, in the unit of [`crate::Params::time_step`].
    pub time: f64,
    /// The periodic cell.
    pub cell: &'a Cell<S>,
    /// Centres, in a; within a step they may have left the cell.
    pub centres: &'a [S::Vector],
}

/// Sets the forces and torques at an instant, in a list of zeros.
type Function<S> =
    dyn Fn(&Instant<'_, S>, &mut [<S as Space>::PerMode<f64>]) + Send + Sync + 'static;

/// The function of the user and its last values.
#[derive(Default)]
pub(super) struct AppliedForces<S: Space> {
    function: Option<Box<Function<S>>>,
    /// `(F, T)` sphere by sphere; empty where all are zero.
    values: Vec<f64>,
}

impl<S: Starts> AppliedForces<S> {
    /// Evaluates the function.
    ///
    /// # Errors
    /// [`Error::OfSphere`] for a number that is not finite; [`Error::NetForce`].
    pub(super) fn update(
        &mut self,
        hydrodynamics: Hydrodynamics,
        instant: &Instant<'_, S>,
    ) -> Result<(), Error> {
        let Some(function) = &self.function else {
            return Ok(());
        };
        self.values.clear();
        self.values.resize(S::MODES * instant.centres.len(), 0.0);
        function(instant, S::by_sphere_mut(&mut self.values));
        check_numbers("forces", &self.values, S::MODES)?;
        check_net_force::<S>(hydrodynamics, instant.cell, &self.values, S::MODES)?;
        if self.values.iter().all(|value| *value == 0.0) {
            self.values.clear();
        }
        Ok(())
    }

    /// The values of the last update.
    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    /// Their power on disturbance velocities.
    pub(super) fn power(&self, velocities: &[f64]) -> f64 {
        let pairs = self.values.iter().zip(velocities);
        pairs.map(|(force, velocity)| force * velocity).sum()
    }
}

impl<S: Starts> Simulation<S> {
    /// Applies forces and torques to the spheres from the next step on: a function of time and
    /// positions. It is called at every stage of a step with a list of zeros, and adds `(F, T)` of
    /// each sphere, `[F_x, F_y, T]` in a layer, in mu·a²·rate and mu·a³·rate. Without a flow the
    /// forces set the unit of time: see [`crate::Params::at_rest`].
    ///
    /// It is no part of a snapshot: a run that is resumed needs it again. With the same function,
    /// which must depend on nothing else than its argument, it has the same bits. Forces that are
    /// zero leave the bits of a run without forces.
    ///
    /// In the cell of a suspension the mean flow of spheres and fluid is that of the background
    /// alone, so velocities under a net force are relative to a suspension that does not move as a
    /// whole, as in a vessel with a bottom. A layer in full Stokesian Dynamics cannot bear a net
    /// force: the unbounded fluid about it does not resist one. Without a far field (Ball-Melrose
    /// and lubrication) each sphere has a drag of its own against the background.
    ///
    /// Stresses have no part from the first moment of these forces.
    ///
    /// # Errors
    /// None here. [`Simulation::step`] then fails with [`Error::OfSphere`] for a number that is
    /// not finite, and [`Error::NetForce`].
    ///
    /// ```
    /// use sd_core::{Bulk, Hydrodynamics, LeadingOrder, NearFields, Params, Simulation};
    ///
    /// let params = Params::builder()
    ///     .spheres(20)
    ///     .volume_fraction(0.05)
    ///     .roughness(0.01)
    ///     .friction(0.0)
    ///     .shear_rate(0.0)
    ///     .hydrodynamics(Hydrodynamics::Lubrication(LeadingOrder::DEFAULT))
    ///     .at_rest()
    ///     .build()?;
    /// let mut run = Simulation::<Bulk>::new(&params, 1, &NearFields::default())?;
    /// // A spring of stiffness 2 along z to the height 0.
    /// run.use_forces(|instant, forces| {
    ///     for (force, x) in forces.iter_mut().zip(instant.centres) {
    ///         force[2] = -2.0 * x.z;
    ///     }
    /// });
    /// run.step()?;
    /// assert!(run.velocities().iter().all(|velocity| velocity[2] <= 0.0));
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn use_forces(
        &mut self,
        function: impl Fn(&Instant<'_, S>, &mut [S::PerMode<f64>]) + Send + Sync + 'static,
    ) {
        self.forces.function = Some(Box::new(function));
    }

    /// Applies constant forces and torques `(F, T)`, one per sphere; otherwise as
    /// [`Simulation::use_forces`].
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OfSphere`] for a number that is not finite; [`Error::NetForce`].
    ///
    /// ```
    /// use sd_core::{Bulk, Hydrodynamics, NearFields, Params, Simulation};
    ///
    /// let params = Params::builder()
    ///     .spheres(27)
    ///     .volume_fraction(0.1)
    ///     .roughness(0.01)
    ///     .friction(0.0)
    ///     .shear_rate(0.0)
    ///     .hydrodynamics(Hydrodynamics::StokesianDynamics)
    ///     .at_rest()
    ///     .build()?;
    /// let mut falling = Simulation::<Bulk>::new(&params, 1, &NearFields::default())?;
    /// // In units of the Stokes velocity of a single sphere.
    /// let weight = [0.0, 0.0, -6.0 * std::f64::consts::PI, 0.0, 0.0, 0.0];
    /// falling.use_constant_forces(&[weight; 27])?;
    /// falling.step()?;
    /// let mean = falling.velocities().iter().map(|u| u[2]).sum::<f64>() / 27.0;
    /// assert!(mean < 0.0 && mean > -1.0);
    /// assert_eq!((falling.time(), falling.strain()), (0.01, 0.0));
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn use_constant_forces(&mut self, forces: &[S::PerMode<f64>]) -> Result<(), Error> {
        let expected = self.state.centres.len();
        if forces.len() != expected {
            return Err(Error::Length {
                field: "forces",
                found: forces.len(),
                expected,
            });
        }
        let values: Vec<f64> = forces.iter().flat_map(|f| f.as_ref().to_vec()).collect();
        check_numbers("forces", &values, S::MODES)?;
        let cell = self.cell_at(self.time())?;
        check_net_force::<S>(self.params.hydrodynamics, &cell, &values, S::MODES)?;
        self.use_forces(move |_, forces| forces.copy_from_slice(S::by_sphere(&values)));
        Ok(())
    }

    /// Removes the forces.
    pub fn remove_forces(&mut self) {
        self.forces = AppliedForces::default();
    }
}
