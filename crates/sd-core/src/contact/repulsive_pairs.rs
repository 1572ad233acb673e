//! Pairs with a repulsion at a distance, by the law of [`crate::law::repulsion`].
//!
//! The force is implicit over the time span s of the stage: its slope is added to R_FU, which has
//! the same pairs.
//!
//! ```text
//! F = F0 exp(−g/l) (1 − s v_n / l),   R_FU ← R_FU + Σ s F0 exp(−g/l)/l n nᵀ
//! ```

use super::contact_pair::Contact;
use super::laws::Span;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::law::repulsion::ExponentialRepulsion;
use crate::space::{Space, VelocityGradient};

/// Largest g/l at which the force is included; beyond it the force is below 1e-13 F0.
const MAX_EXPONENT: f64 = 30.0;

/// Repulsive pairs of a stage.
#[derive(Default, Debug)]
pub struct RepulsivePairs<S: Space> {
    /// The pairs; their forces and normal velocities are valid once the stage is solved.
    pub pairs: Vec<Contact<S>>,
    /// For each pair the slope times the time span, `s F/l`, and the force without motion.
    linearised: Vec<[f64; 2]>,
}

impl<S: Fluid> RepulsivePairs<S> {
    /// Adds the slopes to the assembled resistance, which must then be factored, and the forces to
    /// `forces`.
    pub fn add(
        &mut self,
        repulsion: &ExponentialRepulsion,
        resistance: &mut Resistance<S>,
        background: &VelocityGradient<S>,
        span: &Span<'_>,
        forces: &mut [f64],
    ) {
        self.pairs.clear();
        self.linearised.clear();
        for pair in resistance.neighbours() {
            if pair.gap > MAX_EXPONENT * repulsion.length {
                continue;
            }
            let contact = Contact::new(*pair, resistance.radii(), background);
            let force = repulsion.at(pair.gap);
            let damping = span.time * force / repulsion.length;
            // f = force − damping (v_n − twice_first_approach), where v_n includes the background.
            let twice_first_approach = span.twice_first_approach(&contact);
            let at_rest = force + damping * (twice_first_approach - contact.background_approach);
            contact.normal_row().add(at_rest, forces);
            self.pairs.push(contact);
            self.linearised
                .push([damping, force + damping * twice_first_approach]);
        }
        for (contact, coefficients) in self.pairs.iter().zip(&self.linearised) {
            resistance.add_spring(&contact.pair, coefficients[0]);
        }
    }

    /// Sets the forces and normal velocities of the solved motion.
    pub fn finish(&mut self, velocities: &[f64]) {
        for (contact, [damping, at_rest]) in self.pairs.iter_mut().zip(&self.linearised) {
            contact.normal_velocity = contact.approach(velocities);
            contact.normal_force = at_rest - damping * contact.normal_velocity;
        }
    }
}
