//! Products and solves with the mobility and the resistance of a configuration, planned once for
//! any number of positions.
//!
//! ```text
//! (U, Ω, −E) = M (F, T, S~)     Mobility: the far field of all spheres, without lubrication
//! (F, T) = R (U, Ω), E = 0      Resistance: lubrication included; spheres under forces move by R⁻¹ (F, T)
//! ```
//! The fluid is at rest but for the spheres, unless [`Resistance::set_flow`] puts them into an
//! incident flow; [`crate::instant::solve`] has contacts too. M and R are symmetric and positive
//! definite.
//!
//! # Vectors
//! A vector is one list of numbers, sphere by sphere:
//!
//! | | layer | suspension |
//! | --- | --- | --- |
//! | forces and torques, in mu·a²·rate and mu·a³·rate | `[3N]`: `(F_x, F_y, T)` | `[6N]`: `(F, T)` |
//! | velocities and angular velocities, in a·rate and rate | `[3N]`: `(U_x, U_y, Ω)` | `[6N]`: `(U, Ω)` |
//! | all force modes of [`Mobility`], S~ in mu·a³·rate | `[6N]`: `(F_x, F_y, T, s1, s2, s3)` | `[11N]`: `(F, T, s1, …, s5)` |
//! | all velocity modes of [`Mobility`], −E in rate | `[6N]`: `(U_x, U_y, Ω, −e1, −e2, −e3)` | `[11N]`: `(U, Ω, −e1, …, −e5)` |
//!
//! The components of strains and stresslets are those of [`crate::modes`] and [`crate::bulk`]. The
//! rate is any unit of time: without a background flow, forces set it.
//!
//! # Net forces
//! In a periodic suspension the mean flow of spheres and fluid is zero; velocities are relative to
//! it. A periodic layer in unbounded fluid would move infinitely fast under a net force in the full
//! far field: forces must then sum to zero, and only differences of velocities have a meaning, as a
//! translation common to all spheres meets no resistance. Without a far field (Ball-Melrose and
//! lubrication) every sphere has a drag of its own against the fluid at rest, and net forces are
//! allowed.

use crate::contact::SolvePass;
use crate::error::Error;
use crate::hydrodynamics::applied_forces::{
    check_centres, check_net_force, check_numbers, check_spheres,
};
use crate::hydrodynamics::far_field::far_operator::FarOperator;
use crate::hydrodynamics::inverse_mobility::InverseMobility;
use crate::hydrodynamics::resistance::{
    Fluid, NearFields, NearTerm as _, isolated, modes_in_strain,
};
use crate::model::{Hydrodynamics, SolverSettings};
use crate::space::cell::Cell;
use crate::space::neighbours::NeighbourList;
use crate::space::{IncidentFlow, Layer, VelocityGradient};
use crate::stage::{Method, StageContacts, StageSolver};
use std::fmt;

/// The mobility of all force modes of the spheres: forces, torques and stresslets, without
/// lubrication. A product takes O(N log N) in a periodic cell, and O(N²) in unbounded fluid, where
/// the blocks of all pairs are kept.
///
/// ```
/// use sd_core::cell::Cell;
/// use sd_core::modes::Vec2;
/// use sd_core::products::Mobility;
/// use sd_core::Layer;
///
/// let cell = Cell::<Layer>::periodic(Vec2::new(12.0, 12.0), 0.0)?;
/// let centres = [Vec2::new(0.0, 0.0), Vec2::new(3.0, 0.0)];
/// let mut mobility = Mobility::new(&cell, &[1.0, 1.0], &centres, 1e-8)?;
/// // Opposite forces along the line of centres: (F_x, F_y, T, s1, s2, s3) of each sphere.
/// let forces = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
/// let mut velocities = [0.0; 12];
/// mobility.apply(&forces, &mut velocities)?;
/// assert!(velocities[0] > 0.0 && (velocities[0] + velocities[6]).abs() < 1e-9);
///
/// mobility.set_positions(&cell, &[Vec2::new(0.0, 0.0), Vec2::new(2.1, 0.0)])?;
/// let slower = velocities[0];
/// mobility.apply(&forces, &mut velocities)?;
/// assert!(velocities[0] < slower);
/// # Ok::<(), sd_core::Error>(())
/// ```
pub struct Mobility<S: Fluid = Layer> {
    operator: FarOperator<S>,
    inverse: InverseMobility<S>,
    radii: Vec<f64>,
    tolerance: f64,
    cell: Cell<S>,
    list: NeighbourList<S>,
}

impl<S: Fluid> fmt::Debug for Mobility<S> {
    /// The spheres and their cell: plans are large.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mobility")
            .field("cell", &self.cell)
            .field("radii", &self.radii)
            .field("tolerance", &self.tolerance)
            .finish_non_exhaustive()
    }
}

impl<S: Fluid> Mobility<S> {
    /// Plans for cells of the sides of this one and for these spheres, at their first positions.
    ///
    /// # Arguments
    /// - `cell`: periodic or unbounded.
    /// - `radii`: one per sphere, in a.
    /// - `centres`: one per sphere, in a.
    /// - `tolerance`: error of products over the largest entry of M, which in unbounded fluid have
    ///   none, and relative residual of solves, 1e-8 to 1e-3.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a radius or the tolerance; [`Error::Length`];
    /// [`Error::OfSphere`] for a position that is not finite; [`Error::Overlap`].
    pub fn new(
        cell: &Cell<S>,
        radii: &[f64],
        centres: &[S::Vector],
        tolerance: f64,
    ) -> Result<Self, Error> {
        let mut mobility = Self {
            operator: FarOperator::new(cell, radii, tolerance)?,
            inverse: InverseMobility::new(cell, radii),
            radii: radii.to_vec(),
            tolerance,
            cell: *cell,
            list: NeighbourList::new(radii.len()),
        };
        mobility.set_positions(cell, centres)?;
        Ok(mobility)
    }

    /// Moves the spheres. Products have the bits of a new plan at these positions.
    ///
    /// # Arguments
    /// - `cell`: of the planned sides; its offsets are free.
    /// - `centres`: one per sphere, in a; any images.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OutOfRange`] for a cell of another area or volume;
    /// [`Error::OfSphere`] for a position that is not finite; [`Error::Overlap`]. The positions are
    /// then those before.
    pub fn set_positions(&mut self, cell: &Cell<S>, centres: &[S::Vector]) -> Result<(), Error> {
        check_centres::<S>(centres, self.radii.len())?;
        // Surfaces that touch have a gap of zero: up to that, M is positive definite.
        self.list.find_all(cell, centres, &self.radii, 2.0);
        if let Some(pair) = self.list.pairs().iter().find(|pair| pair.gap < 0.0) {
            return Err(pair.overlap());
        }
        self.operator.update(cell, centres)?;
        self.cell = *cell;
        Ok(())
    }

    /// Velocity modes from force modes, in the order of the [module](self).
    ///
    /// # Accuracy
    /// The tolerance of the plan, relative to the largest entry of M.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OfSphere`] for a number that is not finite; [`Error::NetForce`]
    /// in a periodic layer.
    pub fn apply(&mut self, forces: &[f64], velocities: &mut [f64]) -> Result<(), Error> {
        let modes = S::ALL_MODES;
        check_lengths(forces, velocities, modes, self.radii.len())?;
        check_numbers("forces", forces, modes)?;
        check_net_force::<S>(Hydrodynamics::StokesianDynamics, &self.cell, forces, modes)?;
        self.operator.apply(forces, velocities);
        Ok(())
    }

    /// Force modes from velocity modes: the inverse of [`Mobility::apply`], by conjugate gradients.
    /// In a periodic layer the forces sum to zero, and a translation common to all spheres takes
    /// none.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OfSphere`] for a number that is not finite;
    /// [`Error::NotConverged`].
    pub fn solve(&mut self, velocities: &[f64], forces: &mut [f64]) -> Result<(), Error> {
        check_lengths(forces, velocities, S::ALL_MODES, self.radii.len())?;
        check_numbers("velocities", velocities, S::ALL_MODES)?;
        let operator = &mut self.operator;
        let solved = self.inverse.solve(operator, velocities, self.tolerance)?;
        forces.copy_from_slice(solved);
        Ok(())
    }
}

/// The resistance of spheres to velocities and angular velocities, with all hydrodynamics of the
/// choice, and its inverse.
///
/// The far field of many spheres in a cell is iterated to
/// [`SolverSettings::far_field_residual`]; otherwise products and solves are exact to rounding,
/// and to the tolerance of the periodic sums.
///
/// ```
/// use sd_core::cell::Cell;
/// use sd_core::model::SolverSettings;
/// use sd_core::products::Resistance;
/// use sd_core::{Bulk, Hydrodynamics, NearFields};
/// use std::f64::consts::PI;
///
/// // Two spheres side by side sink faster than one, whose velocity is 1/(6π).
/// let centres = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]].map(Into::into);
/// let mut pair = Resistance::<Bulk>::new(
///     Hydrodynamics::StokesianDynamics,
///     &Cell::Unbounded,
///     &[1.0, 1.0],
///     &centres,
///     &NearFields::default(),
///     &SolverSettings::precise(),
/// )?;
/// let weights = [0.0, 0.0, -1.0, 0.0, 0.0, 0.0].repeat(2);
/// let mut velocities = vec![0.0; 12];
/// pair.solve(&weights, &mut velocities)?;
/// assert!(-6.0 * PI * velocities[2] > 1.2);
///
/// let mut forces = vec![0.0; 12];
/// pair.apply(&velocities, &mut forces)?;
/// assert!((forces[2] + 1.0).abs() < 1e-12);
/// # Ok::<(), sd_core::Error>(())
/// ```
pub struct Resistance<S: Fluid = Layer> {
    stage: StageSolver<S>,
    inverse: InverseMobility<S>,
    hydrodynamics: Hydrodynamics,
    /// Relative residual of an iterated far field.
    residual: f64,
    cell: Cell<S>,
    centres: Vec<S::Vector>,
    stresslets: Vec<S::Strain>,
    flow: IncidentFlow<S>,
    /// Velocities and strains, as [`Mobility`] has them.
    modes: Vec<f64>,
    work: Vec<f64>,
    forces: Vec<f64>,
}

impl<S: Fluid> fmt::Debug for Resistance<S> {
    /// The spheres and their cell: plans are large.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Resistance")
            .field("hydrodynamics", &self.hydrodynamics)
            .field("cell", &self.cell)
            .field("radii", &self.stage.resistance.radii())
            .finish_non_exhaustive()
    }
}

impl<S: Fluid> Resistance<S> {
    /// Plans for cells of the sides of this one and for these spheres, at their first positions.
    ///
    /// # Arguments
    /// - `cell`: periodic or unbounded.
    /// - `radii`: one per sphere, in a.
    /// - `centres`: one per sphere, in a.
    /// - `tables`: missing ones are computed, which takes seconds per size ratio.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a radius; [`Error::Length`]; [`Error::OfSphere`] for a position
    /// that is not finite; [`Error::CellTooSmall`]; [`Error::Overlap`]; those of
    /// [`SolverSettings::validate`].
    pub fn new(
        hydrodynamics: Hydrodynamics,
        cell: &Cell<S>,
        radii: &[f64],
        centres: &[S::Vector],
        tables: &NearFields,
        settings: &SolverSettings,
    ) -> Result<Self, Error> {
        settings.validate()?;
        check_spheres::<S>(hydrodynamics, radii, centres)?;
        let method = Method::of_instant(hydrodynamics, cell, radii, false);
        let mut stage = method.solver(hydrodynamics, cell, radii, tables, &[], settings)?;
        if hydrodynamics.admits_overlap() {
            stage.resistance.regularise(0.0, f64::INFINITY);
        }
        stage.assemble(cell, centres)?;
        Ok(Self {
            stage,
            inverse: InverseMobility::new(cell, radii),
            hydrodynamics,
            residual: settings.far_field_residual,
            cell: *cell,
            centres: centres.to_vec(),
            stresslets: vec![S::Strain::default(); radii.len()],
            flow: VelocityGradient::at_rest().into(),
            modes: Vec::new(),
            work: Vec::new(),
            forces: Vec::new(),
        })
    }

    /// Moves the spheres. Products and solves have the bits of a new plan at these positions.
    ///
    /// # Arguments
    /// - `cell`: of the planned sides; its offsets are free.
    /// - `centres`: one per sphere, in a; any images.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::CellTooSmall`] and [`Error::LatticeTooShort`];
    /// [`Error::OutOfRange`] for a cell of another area or volume under full Stokesian Dynamics;
    /// [`Error::OfSphere`] for a position that is not finite; [`Error::Overlap`]. The positions are
    /// then those before.
    pub fn set_positions(&mut self, cell: &Cell<S>, centres: &[S::Vector]) -> Result<(), Error> {
        check_centres::<S>(centres, self.centres.len())?;
        let range = crate::hydrodynamics::resistance::Resistance::<S>::range(self.hydrodynamics);
        cell.check_range(self.stage.resistance.radii(), range)?;
        self.stage.resistance.forget_pattern();
        if let Err(error) = self.stage.assemble(cell, centres) {
            self.stage.resistance.forget_pattern();
            self.stage.assemble(&self.cell, &self.centres)?;
            return Err(error);
        }
        self.cell = *cell;
        self.centres.copy_from_slice(centres);
        Ok(())
    }

    /// Puts the spheres into an incident flow. The velocities of [`Resistance::apply`] and
    /// [`Resistance::solve`] are then disturbances, relative to [`IncidentFlow::at`], and their
    /// forces and stresslets those of `R (U − u∞, Ω − Ω∞, −E∞)`. At first the fluid is at rest.
    ///
    /// # Errors
    /// [`Error::Length`] for departures at another number of spheres; [`Error::OutOfRange`] for a
    /// number that is not finite.
    pub fn set_flow(&mut self, flow: IncidentFlow<S>) -> Result<(), Error> {
        flow.check(self.centres.len())?;
        self.flow = flow;
        Ok(())
    }

    /// Forces and torques from velocities and angular velocities, in the order of the
    /// [module](self).
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OfSphere`] for a number that is not finite;
    /// [`Error::NotConverged`].
    pub fn apply(&mut self, velocities: &[f64], forces: &mut [f64]) -> Result<(), Error> {
        check_lengths(forces, velocities, S::MODES, self.centres.len())?;
        check_numbers("velocities", velocities, S::MODES)?;
        let near = &self.stage.resistance;
        let incident = self.flow.strains();
        near.apply(
            velocities,
            incident,
            &mut self.work,
            &mut self.forces,
            &mut self.stresslets,
        );
        forces.copy_from_slice(&self.forces);
        let Some(operator) = self.stage.far_operator() else {
            return Ok(());
        };
        // The sparse resistance approximates the far field by isolated drag and by near pairs;
        // these give way to the far field itself.
        self.modes.clear();
        for (sphere, velocity) in S::by_sphere(velocities).iter().enumerate() {
            let modes = modes_in_strain::<S>(velocity, incident.at(sphere));
            self.modes.extend_from_slice(modes.as_ref());
        }
        let far = self.inverse.solve(operator, &self.modes, self.residual)?;
        let near = &self.stage.resistance;
        let (of_spheres, modes) = (S::by_sphere_mut(forces), S::all_modes(&self.modes));
        for (pair, term) in near.far_pairs() {
            let both = [pair.i, pair.j];
            let approximate = term.apply(&pair.normal, &both.map(|sphere| modes[sphere]));
            for (sphere, approximate) in both.into_iter().zip(approximate) {
                for m in 0..S::MODES {
                    of_spheres[sphere][m] -= approximate[m];
                }
                for k in 0..S::STRAINS {
                    self.stresslets[sphere][k] += approximate[S::MODES + k];
                }
            }
        }
        for (sphere, (far, &radius)) in S::all_modes(far).iter().zip(near.radii()).enumerate() {
            let drag = isolated::<S>(radius);
            for k in 0..S::MODES {
                of_spheres[sphere][k] += far[k] - drag[k] * modes[sphere][k];
            }
            for k in S::MODES..S::ALL_MODES {
                self.stresslets[sphere][k - S::MODES] -= far[k] - drag[k] * modes[sphere][k];
            }
        }
        Ok(())
    }

    /// Velocities and angular velocities from forces and torques: the inverse of
    /// [`Resistance::apply`].
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OfSphere`] for a number that is not finite; [`Error::NetForce`];
    /// [`Error::NotPositiveDefinite`]; [`Error::NotConverged`].
    pub fn solve(&mut self, forces: &[f64], velocities: &mut [f64]) -> Result<(), Error> {
        check_lengths(forces, velocities, S::MODES, self.centres.len())?;
        check_numbers("forces", forces, S::MODES)?;
        check_net_force::<S>(self.hydrodynamics, &self.cell, forces, S::MODES)?;
        // The result depends on positions and forces alone, not on earlier solves.
        self.stage.begin_step();
        self.stage.start_far_field_from(&[]);
        self.stage
            .solve(&self.flow, forces, StageContacts::None, SolvePass::First)?;
        velocities.copy_from_slice(self.stage.velocities());
        self.stage.counterforces(
            self.flow.strains(),
            &mut self.work,
            &mut self.forces,
            &mut self.stresslets,
        );
        Ok(())
    }

    /// Stresslets S of (20) of the spheres in the last product or solve by their components, in
    /// mu·a³·rate.
    pub fn stresslets(&self) -> &[S::Strain] {
        &self.stresslets
    }
}

/// Refuses lists that are not of a number of spheres.
fn check_lengths(
    forces: &[f64],
    velocities: &[f64],
    modes: usize,
    spheres: usize,
) -> Result<(), Error> {
    for (field, list) in [("forces", forces), ("velocities", velocities)] {
        if list.len() != modes * spheres {
            return Err(Error::Length {
                field,
                found: list.len(),
                expected: spheres,
            });
        }
    }
    Ok(())
}
