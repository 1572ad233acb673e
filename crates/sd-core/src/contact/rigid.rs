//! The rigid scheme: all contact forces of a stage at once, with gaps held at the roughness height.
//!
//! ```text
//! f ≥ 0,   w = v_n + max(g − h, 0)/τ + β min(g − h, 0)/τ ≥ 0,   f·w = 0
//! ```
//!
//! for every pair that could close within the stage's time span τ, velocities with friction included. A pair above h may
//! approach just far enough to touch; one below h is pushed out at the rate β/τ.

use super::{Contact, ContactState, Contacts, Quality, Surface};
use crate::modes::Background;
use crate::resistance::Resistance;

/// β: share of an overlap taken back within one time span.
pub const RESTITUTION: f64 = 0.2;
/// Approach velocity, in a·rate, that the first choice of candidates allows for.
pub(super) const EXPECTED_APPROACH: f64 = 3.0;
/// Rounds of adding pairs that turned out to close after all.
pub(super) const MOST_ROUNDS: u32 = 20;

/// Forces remembered from the stage before: where to start.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Memory {
    /// `(i, j, f, F_t)` of pairs with a force, ordered by (i, j).
    pub forces: Vec<(u32, u32, f64, f64)>,
}

impl Memory {
    /// The forces of a pair, zero if it had none.
    pub(super) fn forces(&self, i: usize, j: usize) -> (f64, f64) {
        let key = |entry: &(u32, u32, f64, f64)| (entry.0 as usize, entry.1 as usize);
        match self.forces.binary_search_by_key(&(i, j), key) {
            Ok(at) => (self.forces[at].2, self.forces[at].3),
            Err(_) => (0.0, 0.0),
        }
    }

    /// Replaces the forces by those of a solved stage.
    pub(super) fn store(&mut self, contacts: &Contacts) {
        self.forces.clear();
        for c in contacts.list.iter().filter(|c| c.normal_force > 0.0) {
            #[expect(
                clippy::cast_possible_truncation,
                reason = "sphere numbers fit 32 bits"
            )]
            let (i, j) = (c.pair.i as u32, c.pair.j as u32);
            self.forces.push((i, j, c.normal_force, c.tangential_force));
        }
    }
}

impl Contacts {
    /// Solves one stage by the rigid scheme. Velocities `[3N]` are the disturbances; forces `[3N]` all but contact's.
    #[expect(
        clippy::too_many_arguments,
        reason = "what drives the spheres, what holds them apart, what comes out"
    )]
    pub fn solve_rigid(
        &mut self,
        resistance: &Resistance,
        background: &Background,
        surface: &Surface,
        time_span: f64,
        forces: &[f64],
        memory: &mut Memory,
        velocities: &mut [f64],
    ) -> Quality {
        let radii = resistance.radii();
        let pairs = resistance.neighbours();
        let reach = surface.roughness + EXPECTED_APPROACH * time_span;
        self.list.clear();
        for pair in pairs.iter().filter(|p| p.gap < reach) {
            self.list.push(Contact::new(*pair, radii, background));
        }
        let mut worst = Quality::default();
        for _ in 0..MOST_ROUNDS {
            let quality = self.solve_candidates(resistance, surface, time_span, forces, memory);
            worst.residual = quality.residual;
            worst.friction_error = quality.friction_error;
            worst.passes += quality.passes;
            self.finish(resistance, velocities);
            memory.store(self);
            if !self.add_closing(
                resistance, background, surface, time_span, reach, velocities,
            ) {
                return worst;
            }
        }
        // Still closing pairs: report by how much, as a violation of the normal problem.
        for c in &self.list {
            let span = (c.pair.gap - surface.roughness) / time_span;
            worst.residual = worst.residual.max(-(c.normal_velocity + span.max(0.0)));
        }
        worst
    }

    /// Adds to the candidates the pairs beyond `reach` that would pass through h within the time span after all; whether there are any.
    pub(super) fn add_closing(
        &mut self,
        resistance: &Resistance,
        background: &Background,
        surface: &Surface,
        time_span: f64,
        reach: f64,
        velocities: &[f64],
    ) -> bool {
        let before = self.list.len();
        for pair in resistance.neighbours().iter().filter(|p| p.gap >= reach) {
            let contact = Contact::new(*pair, resistance.radii(), background);
            let approach = contact.background[0] + contact.normal_row(velocities);
            if approach + (pair.gap - surface.roughness) / time_span >= 0.0 {
                continue;
            }
            let known = |c: &Contact| (c.pair.i, c.pair.j) == (pair.i, pair.j);
            if !self.list[..before].iter().any(known) {
                self.list.push(contact);
            }
        }
        let added = self.list.len() > before;
        if added {
            self.list.sort_unstable_by_key(|c| (c.pair.i, c.pair.j));
        }
        added
    }

    /// Forces of the candidates at hand, put into `list`.
    fn solve_candidates(
        &mut self,
        resistance: &Resistance,
        surface: &Surface,
        time_span: f64,
        forces: &[f64],
        memory: &Memory,
    ) -> Quality {
        self.reduce_normal(resistance, forces);
        let bias = &mut self.friction.bias;
        bias.clear();
        for contact in &mut self.list {
            let excess = contact.pair.gap - surface.roughness;
            let share = if excess < 0.0 { RESTITUTION } else { 1.0 };
            bias.push(share * excess / time_span);
            let (f, f_t) = memory.forces(contact.pair.i, contact.pair.j);
            contact.normal_force = f;
            contact.tangential_force = f_t;
            contact.state = ContactState::Frictionless;
        }
        let started = self
            .list
            .iter()
            .zip(self.free_normal.iter().zip(bias.iter()))
            .map(|(c, (v, b))| c.normal_force > 0.0 || v + b < 0.0);
        self.normal.start(started);
        self.solve_frictionless();
        let load = surface.critical_load;
        self.frictional.clear();
        if surface.has_friction() && self.normal_forces.iter().any(|&f| f > load) {
            // Those loaded now or before; the iteration says which others it needs.
            let loaded =
                |k: &usize| self.normal_forces[*k] > load || self.list[*k].normal_force > load;
            self.frictional.extend((0..self.list.len()).filter(loaded));
            return self.solve_roll_slip(resistance, surface);
        }
        self.take_frictionless()
    }

    /// Forces with the paper's friction on `frictional`, and on those that turn out to need it.
    pub(super) fn solve_roll_slip(
        &mut self,
        resistance: &Resistance,
        surface: &Surface,
    ) -> Quality {
        loop {
            self.reduce_slip(resistance);
            if let Some(quality) = self.solve_frictional(surface) {
                return quality;
            }
        }
    }

    /// Puts the normal forces into `list`, where none is loaded enough for friction.
    pub(super) fn take_frictionless(&mut self) -> Quality {
        for (contact, &f) in self.list.iter_mut().zip(&self.normal_forces) {
            contact.normal_force = f;
            contact.tangential_force = 0.0;
            contact.state = ContactState::Frictionless;
        }
        Quality {
            residual: self.normal_residual(),
            friction_error: 0.0,
            passes: 1,
        }
    }
}
