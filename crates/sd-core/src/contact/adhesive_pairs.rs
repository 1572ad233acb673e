//! Adhesive pairs, by the law of [`crate::law::adhesion`].
//!
//! The set of touching pairs is known before a stage is solved; at the midpoint of a step of rigid
//! contacts it is the set at the start of the step. The attraction is therefore treated as an
//! external force.

use super::contact_pair::Contact;
use super::laws::{Laws, Span};
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::law::adhesion;
use crate::space::{Space, VelocityGradient};

/// Adhesive pairs of a stage.
#[derive(Default, Debug)]
pub struct AdhesivePairs<S: Space> {
    /// The pairs; their normal force is −F_A.
    pub pairs: Vec<Contact<S>>,
}

impl<S: Fluid> AdhesivePairs<S> {
    /// Adds the attraction to `forces` `[3N]` and lists the pairs.
    pub(crate) fn add(
        &mut self,
        laws: &Laws,
        resistance: &Resistance<S>,
        background: &VelocityGradient<S>,
        span: &Span<'_>,
        forces: &mut [f64],
    ) {
        let range = adhesion::range(laws.surface.roughness, laws.normal.is_rigid());
        for pair in resistance.neighbours() {
            let mut contact = Contact::new(*pair, resistance.radii(), background);
            let gap = if laws.normal.is_rigid() {
                span.gap(&contact, background)
            } else {
                pair.gap
            };
            if gap < range {
                contact.normal_force = -laws.adhesion;
                contact.normal_row().add(-laws.adhesion, forces);
                self.pairs.push(contact);
            }
        }
    }
}
