//! The paper's steps 1 to 6 of section II A, to the letter.
//!
//! 1. New contacts: pairs that approached with the last step's velocities and have `g ≤ h`. The list is kept between steps.
//! 2. One simultaneous solve for the normal forces that halt all listed pairs, (12)-(13).
//! 3. Pairs whose force would pull are dropped from the list.
//! 4. to 6. Friction by [`super::friction::law`] from the motion under the remaining normal forces, added after.
//!
//! Friction pushes pairs together after f was found, and a pair enters below h by up to a step's motion: gaps drift. That is
//! the scheme's own error, kept here for comparison; [`super::rigid`] has none of it.

use super::{Contact, Contacts, Quality, Surface, friction};
use crate::geometry::modes::Background;
use crate::hydrodynamics::resistance::Resistance;

/// Listed pairs, ordered by (i, j).
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct ContactList {
    /// The pairs.
    pub pairs: Vec<(u32, u32)>,
}

impl ContactList {
    /// Step 1: adds pairs with `g ≤ h` that approach in the given disturbance velocities `[3N]`.
    pub fn add_approaching(
        &mut self,
        resistance: &Resistance,
        background: &Background,
        roughness: f64,
        velocities: &[f64],
    ) {
        for pair in resistance.neighbours() {
            if pair.gap <= roughness {
                let contact = Contact::new(*pair, resistance.radii(), background);
                if contact.background[0] + contact.normal_row(velocities) < 0.0 {
                    self.add(pair.i, pair.j);
                }
            }
        }
    }

    /// Adds one pair, i < j.
    pub fn add(&mut self, i: usize, j: usize) {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "sphere numbers fit 32 bits"
        )]
        let key = (i as u32, j as u32);
        if let Err(at) = self.pairs.binary_search(&key) {
            self.pairs.insert(at, key);
        }
    }

    /// Whether a pair is listed.
    fn contains(&self, i: usize, j: usize) -> bool {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "sphere numbers fit 32 bits"
        )]
        self.pairs.binary_search(&(i as u32, j as u32)).is_ok()
    }
}

impl Contacts {
    /// Solves one stage by steps 2 to 6. Velocities `[3N]` are the disturbances; forces `[3N]` all but contact's.
    ///
    /// Pairs that would be pulled leave the list (step 3). A listed pair out of lubrication range has left, too.
    pub fn solve_procedure(
        &mut self,
        resistance: &Resistance,
        background: &Background,
        surface: &Surface,
        forces: &[f64],
        listed: &mut ContactList,
        velocities: &mut [f64],
    ) -> Quality {
        self.list.clear();
        for pair in resistance.neighbours() {
            if listed.contains(pair.i, pair.j) {
                self.list
                    .push(Contact::new(*pair, resistance.radii(), background));
            }
        }
        self.reduce_normal(resistance, forces);
        self.normal_forces.resize(self.list.len(), 0.0);
        let residual = self
            .normal
            .halt_all(&self.g_nn, &self.free_normal, &mut self.normal_forces);
        listed.pairs.clear();
        for (contact, f) in self.list.iter_mut().zip(&mut self.normal_forces) {
            *f = f.max(0.0);
            contact.normal_force = *f;
            if *f > 0.0 {
                listed.add(contact.pair.i, contact.pair.j);
            }
        }
        let load = surface.critical_load;
        self.frictional.clear();
        if surface.has_friction() {
            let loaded = |k: &usize| self.normal_forces[*k] > load;
            self.frictional.extend((0..self.list.len()).filter(loaded));
        }
        if !self.frictional.is_empty() {
            self.reduce_slip(resistance);
            self.g_tn
                .add_product(&self.normal_forces, &mut self.free_slip);
            for (&k, &slip) in self.frictional.iter().zip(&self.free_slip) {
                let contact = &mut self.list[k];
                (contact.tangential_force, contact.state) = friction::law(
                    slip,
                    contact.slip_resistance,
                    surface.friction,
                    contact.normal_force,
                );
            }
        }
        self.finish(resistance, velocities);
        Quality {
            residual,
            friction_error: 0.0,
            passes: 1,
        }
    }
}
