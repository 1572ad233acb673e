//! Forces of pairs that do not depend on the contact problem: a repulsion, by the law of
//! [`crate::law::repulsion`], van der Waals attraction, by that of [`crate::law::van_der_waals`],
//! and adhesion, by that of [`crate::law::adhesion`].
//!
//! The repulsion is implicit over the time span s of the stage: its slope is added to R_FU, which
//! has the same pairs.
//!
//! ```text
//! F = F0 exp(−g/l) (1 − s v_n / l),   R_FU ← R_FU + Σ s F0 exp(−g/l)/l n nᵀ
//! ```
//!
//! The attraction is explicit: an implicit one would resist less than the fluid does. Methods of
//! second order are so with any slope.
//!
//! The set of touching pairs is known before a stage is solved; at the midpoint of a step of rigid
//! contacts it is the set at the start of the step. Adhesion is therefore treated as an external
//! force.

use super::contact_pair::Contact;
use super::laws::{Laws, Span};
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::law::adhesion;
use crate::law::repulsion::ExponentialRepulsion;
use crate::law::rolling_friction;
use crate::law::van_der_waals::VanDerWaals;
use crate::model::PressureKind;
use crate::space::pair::Neighbours;
use crate::space::{IncidentFlow, Space};

/// Largest g/l at which the repulsion is included; beyond it the force is below 1e-13 F0.
const MAX_EXPONENT: f64 = 30.0;

/// Pairs of a stage with a repulsion, attraction or adhesion. Their forces and velocities are valid
/// once the stage is solved.
#[derive(Default, Debug)]
pub struct DistantForces<S: Space> {
    /// Repulsive pairs.
    pub repulsive: Vec<Contact<S>>,
    /// Pairs with van der Waals attraction; their normal force is negative.
    pub attractive: Vec<Contact<S>>,
    /// Adhesive pairs; their normal force is −F_A.
    pub adhesive: Vec<Contact<S>>,
    /// For each repulsive pair the slope times the time span, `s F/l`, and the force without
    /// motion.
    linearised: Vec<[f64; 2]>,
}

impl<S: Fluid> DistantForces<S> {
    pub(crate) fn clear(&mut self) {
        self.repulsive.clear();
        self.attractive.clear();
        self.adhesive.clear();
        self.linearised.clear();
    }

    /// Lists the pairs. Adds their forces to `forces` `[3N]`, and the slopes of repulsions to the
    /// assembled resistance, which must then be factored.
    pub(crate) fn add(
        &mut self,
        laws: &Laws,
        resistance: &mut Resistance<S>,
        flow: &IncidentFlow<S>,
        span: &Span<'_>,
        forces: &mut [f64],
    ) {
        if let Some(repulsion) = &laws.repulsion {
            self.add_repulsion(repulsion, resistance, flow, span, forces);
        }
        if let Some(attraction) = &laws.attraction {
            self.add_attraction(attraction, resistance, flow, forces);
        }
        if laws.adhesion == 0.0 {
            return;
        }
        let range = adhesion::range(laws.surface.roughness, laws.normal.is_rigid());
        for pair in resistance.neighbours() {
            let mut contact = Contact::new(*pair, resistance.radii(), flow);
            let gap = if laws.normal.is_rigid() {
                span.gap(&contact, flow)
            } else {
                pair.gap
            };
            if gap < range {
                contact.normal_force = -laws.adhesion;
                contact.normal_row().add(-laws.adhesion, forces);
                self.adhesive.push(contact);
            }
        }
    }

    fn add_repulsion(
        &mut self,
        repulsion: &ExponentialRepulsion,
        resistance: &mut Resistance<S>,
        flow: &IncidentFlow<S>,
        span: &Span<'_>,
        forces: &mut [f64],
    ) {
        for pair in resistance.neighbours() {
            if pair.gap > MAX_EXPONENT * repulsion.length {
                continue;
            }
            let contact = Contact::new(*pair, resistance.radii(), flow);
            let force = repulsion.at(pair.gap, mean_radius(resistance, pair));
            let damping = span.time * force / repulsion.length;
            // f = force − damping (v_n − twice_first_approach), where v_n includes the background.
            let twice_first_approach = span.twice_first_approach(&contact);
            let at_rest = force + damping * (twice_first_approach - contact.background_approach);
            contact.normal_row().add(at_rest, forces);
            self.repulsive.push(contact);
            self.linearised
                .push([damping, force + damping * twice_first_approach]);
        }
        for (contact, coefficients) in self.repulsive.iter().zip(&self.linearised) {
            resistance.add_spring(&contact.pair, coefficients[0]);
        }
    }

    fn add_attraction(
        &mut self,
        attraction: &VanDerWaals,
        resistance: &Resistance<S>,
        flow: &IncidentFlow<S>,
        forces: &mut [f64],
    ) {
        for pair in resistance.neighbours() {
            let mut contact = Contact::new(*pair, resistance.radii(), flow);
            contact.normal_force = attraction.at(pair.gap, mean_radius(resistance, pair));
            contact.normal_row().add(contact.normal_force, forces);
            self.attractive.push(contact);
        }
    }

    /// `Σ r f/d` of the forces before the motion is solved, in mu·a³·rate, and by how much it
    /// decreases per rate of dilation.
    pub(crate) fn work(&self, kind: PressureKind) -> [f64; 2] {
        let [mut work, mut slope] = [0.0; 2];
        for (contact, [damping, at_rest]) in self.repulsive.iter().zip(&self.linearised) {
            work += contact.opening(kind) * at_rest;
            slope += contact.opening(kind).powi(2) * damping;
        }
        for contact in self.attractive.iter().chain(&self.adhesive) {
            work += contact.opening(kind) * contact.normal_force;
        }
        [work, slope]
    }

    /// Sets the forces and velocities of the solved motion, with the rate at which the cell
    /// dilates.
    pub(crate) fn finish(&mut self, velocities: &[f64], kind: PressureKind, dilation: f64) {
        for (contact, [damping, at_rest]) in self.repulsive.iter_mut().zip(&self.linearised) {
            contact.normal_velocity =
                contact.approach(velocities) + contact.opening(kind) * dilation;
            contact.normal_force = at_rest - damping * contact.normal_velocity;
        }
        for contact in self.attractive.iter_mut().chain(&mut self.adhesive) {
            contact.set_velocities(velocities);
        }
    }
}

/// a_ij of a pair, in a: the radius of equal spheres.
fn mean_radius<S: Fluid>(resistance: &Resistance<S>, pair: &Neighbours<S>) -> f64 {
    rolling_friction::radius([pair.i, pair.j].map(|sphere| resistance.radii()[sphere]))
}
