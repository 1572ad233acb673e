//! Rigid contacts of a network, solved as a whole in every iteration of the far field.

use super::super::super::Resistance;
use super::super::split::SplitMotion;
use crate::contact::network::Driving;
use crate::contact::rigid::Memory;
use crate::contact::{Contacts, Quality, Surface};
use crate::error::Error;
use crate::modes::Background;

/// The contact problem of one stage.
pub(super) struct RigidNetwork<'a> {
    /// Ball-Melrose, [`Resistance::as_network`], at the stage's positions.
    pub(super) near: &'a Resistance,
    /// Candidates and their forces.
    pub(super) contacts: &'a mut Contacts,
    /// Imposed flow.
    pub(super) background: &'a Background,
    /// Roughness and friction.
    pub(super) surface: Surface,
    /// τ of the stage, in strain.
    pub(super) time_span: f64,
    /// Forces of the stage before, then of this one.
    pub(super) memory: &'a mut Memory,
    /// Scratch.
    pub(super) total: &'a mut Vec<f64>,
    /// How well the last contact problem was solved.
    pub(super) quality: Quality,
}

impl SplitMotion for RigidNetwork<'_> {
    fn solve(&mut self, forces: &[f64], _: u32, velocities: &mut [f64]) -> Result<(), Error> {
        let network = self.near.network().ok_or(Error::OnlyRigidContacts)?;
        let (normal, by_friction) = forces.split_at(forces.len() / 2);
        self.total.clear();
        self.total
            .extend(normal.iter().zip(by_friction).map(|(n, t)| n + t));
        let driving = Driving {
            forces: self.total,
            by_friction,
        };
        let (v, v_t) = velocities.split_at_mut(by_friction.len());
        self.quality = self.contacts.solve_rigid_network(
            self.near,
            network,
            self.background,
            &self.surface,
            self.time_span,
            driving,
            self.memory,
            v,
        )?;
        v_t.copy_from_slice(self.contacts.motion_by_friction());
        for (v, v_t) in v.iter_mut().zip(v_t) {
            *v -= *v_t;
        }
        Ok(())
    }

    fn respond(&mut self, _: &[f64], _: &mut [f64]) -> Result<bool, Error> {
        Ok(false)
    }
}
