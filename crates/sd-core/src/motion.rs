//! One right-hand side: from positions to velocities, contact forces included.

use crate::cell::{Cell, Neighbours};
use crate::contact::procedure::ContactList;
use crate::contact::rigid::Memory;
use crate::contact::{Contacts, Quality, Surface};
use crate::error::Error;
use crate::modes::{Background, Vec2};
use crate::resistance::Resistance;

/// What keeps the spheres apart, with what it remembers from stage to stage.
pub enum ContactLaw<'a> {
    /// Nothing but the fluid.
    None,
    /// See [`crate::contact::rigid`].
    Rigid {
        /// Roughness and friction.
        surface: Surface,
        /// τ of the stage, in strain.
        time_span: f64,
        /// Forces of the stage before.
        memory: &'a mut Memory,
    },
    /// See [`crate::contact::procedure`].
    Procedure {
        /// Roughness and friction.
        surface: Surface,
        /// Pairs in contact.
        listed: &'a mut ContactList,
    },
}

/// Solver of the motion of one set of spheres, with its workspace.
pub struct Motion {
    /// Hydrodynamics.
    pub resistance: Resistance,
    /// Contact problem of the last solve; its list is empty without contact.
    pub contacts: Contacts,
    /// External and background forces `[3N]`.
    forces: Vec<f64>,
    /// Work vector in the order of the factor's rows, `[3N]`.
    rows: Vec<f64>,
    /// Disturbance velocities `[3N]` of the last solve.
    velocities: Vec<f64>,
}

impl Motion {
    /// Workspace for the spheres the resistance was made for.
    pub fn new(resistance: Resistance) -> Self {
        let n = 3 * resistance.radii().len();
        Self {
            contacts: Contacts::new(resistance.radii().len()),
            resistance,
            forces: vec![0.0; n],
            rows: Vec::with_capacity(n),
            velocities: vec![0.0; n],
        }
    }

    /// Disturbance velocities `(U − u∞, Ω − Ω∞)` of the last solve, `[3N]`.
    pub fn velocities(&self) -> &[f64] {
        &self.velocities
    }

    /// The pair with the smallest gap, if any is in lubrication range.
    pub fn closest(&self) -> Option<&Neighbours> {
        let pairs = self.resistance.neighbours().iter();
        pairs.min_by(|a, b| a.gap.total_cmp(&b.gap))
    }

    /// Solves for the velocities at the given centres under external forces and torques `[3N]` (empty: none).
    ///
    /// # Errors
    /// Overlaps, an indefinite matrix, velocities that are not finite.
    pub fn solve(
        &mut self,
        cell: &Cell,
        centres: &[Vec2],
        background: &Background,
        external: &[f64],
        law: ContactLaw<'_>,
    ) -> Result<Quality, Error> {
        self.resistance.update(cell, centres)?;
        self.solve_again(background, external, law)
    }

    /// [`Motion::solve`] at the centres of the last call.
    ///
    /// # Errors
    /// Velocities that are not finite.
    pub fn solve_again(
        &mut self,
        background: &Background,
        external: &[f64],
        law: ContactLaw<'_>,
    ) -> Result<Quality, Error> {
        self.resistance
            .background_forces(&background.strain(), &mut self.forces);
        for (force, x) in self.forces.iter_mut().zip(external) {
            *force += x;
        }
        let (resistance, forces) = (&self.resistance, &self.forces);
        let velocities = &mut self.velocities;
        let quality = match law {
            ContactLaw::None => {
                self.contacts.list.clear();
                resistance.to_rows(forces, &mut self.rows);
                resistance.solver().solve(&mut self.rows);
                resistance.from_rows(&self.rows, velocities);
                Quality::default()
            }
            ContactLaw::Rigid {
                surface,
                time_span,
                memory,
            } => self.contacts.solve_rigid(
                resistance, background, &surface, time_span, forces, memory, velocities,
            ),
            ContactLaw::Procedure { surface, listed } => self
                .contacts
                .solve_procedure(resistance, background, &surface, forces, listed, velocities),
        };
        match velocities.iter().position(|v| !v.is_finite()) {
            Some(at) => Err(Error::NotFinite {
                quantity: "the velocity",
                sphere: at / 3,
            }),
            None => Ok(quality),
        }
    }
}
