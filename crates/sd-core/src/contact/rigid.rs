//! The rigid scheme: all contact forces of a stage at once, with gaps held at the roughness height.
//!
//! ```text
//! f ≥ 0,   w = v_n + max(g − h, 0)/τ + β min(g − h, 0)/τ ≥ 0,   f·w = 0
//! ```
//!
//! for every pair that could close within the stage's time span τ, velocities with friction included. A pair above h may
//! approach just far enough to touch; one below h is pushed out at the rate β/τ.

use super::{Contact, ContactState, Contacts, Quality, Surface};
use crate::geometry::modes::Background;
use crate::hydrodynamics::resistance::Resistance;

/// β: share of an overlap taken back within one time span.
pub const RESTITUTION: f64 = 0.2;
/// Approach velocity, in a·rate, that the first choice of candidates allows for.
pub(super) const EXPECTED_APPROACH: f64 = 3.0;
/// Change of a normal velocity from one stage to the next, in a·rate, that the next choice of candidates allows for.
const EXPECTED_CHANGE: f64 = 0.3;
/// Rounds of adding pairs that turned out to close after all.
pub(super) const MOST_ROUNDS: u32 = 20;

/// Forces remembered from the stage before: where to start.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Memory {
    /// `(i, j, f, F_t)` of pairs with a force, and of others about to touch, without; ordered by (i, j).
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

/// What w has besides `v_n`, for a gap that exceeds h by `excess`.
pub(super) fn bias(excess: f64, time_span: f64) -> f64 {
    let share = if excess < 0.0 { RESTITUTION } else { 1.0 };
    share * excess / time_span
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
        self.choose_candidates(resistance, background, surface, time_span, memory);
        let mut worst = Quality::default();
        for _ in 0..MOST_ROUNDS {
            let quality = self.solve_candidates(resistance, surface, time_span, forces, memory);
            worst.residual = quality.residual;
            worst.friction_error = quality.friction_error;
            worst.passes += quality.passes;
            self.finish(resistance, velocities);
            if !self.add_closing(
                resistance, background, surface, time_span, velocities, memory,
            ) {
                return worst;
            }
        }
        worst.residual = worst.residual.max(self.fastest_closing(surface, time_span));
        worst
    }

    /// Where rounds of adding pairs have not ended: by how much they still close, as a violation of the normal problem.
    pub(super) fn fastest_closing(&self, surface: &Surface, time_span: f64) -> f64 {
        let closing = |c: &Contact| {
            let span = (c.pair.gap - surface.roughness) / time_span;
            -(c.normal_velocity + span.max(0.0))
        };
        self.list.iter().map(closing).fold(0.0, f64::max)
    }

    /// The first candidates: pairs that touched or were about to in the stage before, or all near ones where there was none.
    pub(super) fn choose_candidates(
        &mut self,
        resistance: &Resistance,
        background: &Background,
        surface: &Surface,
        time_span: f64,
        memory: &Memory,
    ) {
        let (radii, pairs) = (resistance.radii(), resistance.neighbours());
        self.list.clear();
        if memory.forces.is_empty() {
            let reach = surface.roughness + EXPECTED_APPROACH * time_span;
            let near = pairs.iter().filter(|pair| pair.gap < reach);
            let near = near.map(|pair| Contact::new(*pair, radii, background));
            self.list.extend(near);
            return;
        }
        // Pairs and memory are both ordered by (i, j).
        let mut known = memory.forces.iter().peekable();
        for pair in pairs {
            let place = (pair.i, pair.j);
            let key = |entry: &(u32, u32, f64, f64)| (entry.0 as usize, entry.1 as usize);
            while known.next_if(|entry| key(entry) < place).is_some() {}
            if known.next_if(|entry| key(entry) == place).is_some() {
                self.list.push(Contact::new(*pair, radii, background));
            }
        }
    }

    /// Adds to `list` the pairs left out that would pass through h within the time span after all; whether there were any.
    ///
    /// Remembers the forces of all others, and who may touch in the next stage.
    pub(super) fn add_closing(
        &mut self,
        resistance: &Resistance,
        background: &Background,
        surface: &Surface,
        time_span: f64,
        velocities: &[f64],
        memory: &mut Memory,
    ) -> bool {
        let (radii, before) = (resistance.radii(), self.list.len());
        let mut known = 0;
        memory.forces.clear();
        // Pairs and list are both ordered by (i, j).
        for pair in resistance.neighbours() {
            let bias = bias(pair.gap - surface.roughness, time_span);
            let (normal, tangential, slack);
            if let Some(contact) = self.list[..before].get(known)
                && (contact.pair.i, contact.pair.j) == (pair.i, pair.j)
            {
                known += 1;
                (normal, tangential) = (contact.normal_force, contact.tangential_force);
                slack = contact.normal_velocity + bias;
            } else {
                let contact = Contact::new(*pair, radii, background);
                (normal, tangential) = (0.0, 0.0);
                slack = contact.background[0] + contact.normal_row(velocities) + bias;
                if slack < 0.0 {
                    self.list.push(contact);
                }
            }
            // The next time span may be twice as long.
            if normal > 0.0 || slack - 0.5 * bias.max(0.0) < EXPECTED_CHANGE {
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "sphere numbers fit 32 bits"
                )]
                let (i, j) = (pair.i as u32, pair.j as u32);
                memory.forces.push((i, j, normal, tangential));
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
            bias.push(self::bias(contact.pair.gap - surface.roughness, time_span));
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
        let load = surface.critical_load;
        self.frictional.clear();
        let loaded_before = |k: &usize| self.list[*k].normal_force > load;
        if surface.has_friction() && (0..self.list.len()).any(|k| loaded_before(&k)) {
            // Those loaded before; the solution says which others it needs.
            let count = self.list.len();
            self.frictional.extend((0..count).filter(loaded_before));
            if 10 * self.frictional.len() >= 9 * count {
                // The few others cost less now than later.
                self.frictional.clear();
                self.frictional.extend(0..count);
            }
            self.normal_forces.clear();
            self.normal_forces
                .extend(self.list.iter().map(|contact| contact.normal_force));
            return self.solve_roll_slip(resistance, surface);
        }
        self.solve_frictionless();
        if surface.has_friction() && self.normal_forces.iter().any(|&f| f > load) {
            let loaded = |k: &usize| self.normal_forces[*k] > load;
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
