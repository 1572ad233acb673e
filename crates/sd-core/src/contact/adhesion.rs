//! Pairs that adhere, by the law of [`crate::law::adhesion`].
//!
//! Which pairs touch is known before a stage is solved: in the middle of a step of rigid contacts those that touched where the step began.
//! So the attraction is a force on the spheres like one from outside.

use super::laws::{Laws, Span};
use super::pair::Contact;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::law::adhesion;
use crate::space::Space;

/// Adhering pairs of a stage.
#[derive(Debug)]
pub struct Adhering<S: Space> {
    /// The pairs; their normal force is −F_A.
    pub pairs: Vec<Contact<S>>,
}

impl<S: Space> Default for Adhering<S> {
    fn default() -> Self {
        Self { pairs: Vec::new() }
    }
}

impl<S: Fluid> Adhering<S> {
    /// Adds the attraction to `forces` `[3N]`.
    pub(crate) fn add(
        &mut self,
        laws: &Laws,
        resistance: &Resistance<S>,
        background: &S::Background,
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
