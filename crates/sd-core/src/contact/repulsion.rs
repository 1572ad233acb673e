//! Pairs that repel each other at a distance, by the law of [`crate::law::repulsion`].
//!
//! The slope of the force over the time s that a stage looks ahead is added to R_FU, whose pairs it shares:
//!
//! ```text
//! F = F0 exp(−g/l) (1 − s v_n / l),   R_FU ← R_FU + Σ s F0 exp(−g/l)/l n nᵀ
//! ```

use super::laws::Span;
use super::pair::Contact;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::law::repulsion::ExponentialRepulsion;
use crate::space::Space;

/// Exponents beyond which the force is left out: 1e-13 of F0.
const FARTHEST: f64 = 30.0;

/// Repelling pairs of a stage.
#[derive(Debug)]
pub struct Repelled<S: Space> {
    /// The pairs; force and normal velocity are those of the stage once it is solved.
    pub pairs: Vec<Contact<S>>,
    /// Slope over the time ahead `s F/l` and the force without motion, of each.
    lines: Vec<[f64; 2]>,
}

impl<S: Space> Default for Repelled<S> {
    fn default() -> Self {
        Self {
            pairs: Vec::new(),
            lines: Vec::new(),
        }
    }
}

impl<S: Fluid> Repelled<S> {
    /// Adds the slopes to the assembled resistance, which must be factored after, and the forces to `forces`.
    ///
    /// `first`: disturbance velocities of the first stage, at the second one.
    pub fn add(
        &mut self,
        repulsion: &ExponentialRepulsion,
        resistance: &mut Resistance<S>,
        background: &S::Background,
        span: &Span<'_>,
        forces: &mut [f64],
    ) {
        self.pairs.clear();
        self.lines.clear();
        for pair in resistance.neighbours() {
            if pair.gap > FARTHEST * repulsion.length {
                continue;
            }
            let contact = Contact::new(*pair, resistance.radii(), background);
            let force = repulsion.at(pair.gap);
            let ahead = span.time * force / repulsion.length;
            // f = force − ahead (v_n − taken back), v_n with the background's part.
            let taken_back = span.taken_back(&contact);
            let still = force + ahead * (taken_back - contact.background_approach);
            contact.normal_row().add(still, forces);
            self.pairs.push(contact);
            self.lines.push([ahead, force + ahead * taken_back]);
        }
        for (contact, line) in self.pairs.iter().zip(&self.lines) {
            resistance.add_spring(&contact.pair, line[0]);
        }
    }

    /// Forces and velocities that belong to the solved motion.
    pub fn finish(&mut self, velocities: &[f64]) {
        for (contact, [ahead, still]) in self.pairs.iter_mut().zip(&self.lines) {
            contact.normal_velocity = contact.approach(velocities);
            contact.normal_force = still - ahead * contact.normal_velocity;
        }
    }
}
