//! Which pairs take part in a contact problem.

use super::super::laws::Overlap;
use super::super::memory::WarmStart;
use super::super::pair::Contact;
use super::{ContactSolver, StageInput};
use crate::hydrodynamics::resistance::Fluid;

/// Approach velocity, in a·rate, at which a pair that would touch within the stage is a candidate from the first. With 1 in its place more
/// pairs are found to close when all is solved, and layers of 1000 take 14 % more linear systems.
const LIKELY_APPROACH: f64 = 3.0;

impl<S: Fluid> ContactSolver<S> {
    /// The first candidates: pairs that bore forces in the stage before, and those that are near.
    pub(super) fn choose(&mut self, input: &StageInput<'_, S>, warm_start: &WarmStart<S>) {
        let (radii, pairs) = (input.resistance.radii(), input.resistance.neighbours());
        self.list.clear();
        if !input.laws.normal.law.touches() {
            return;
        }
        let reach = input.laws.surface.roughness + LIKELY_APPROACH * input.span.time;
        let mut known = warm_start.known(pairs).peekable();
        for pair in pairs {
            let forces = known.next_if(|(other, _)| other.key() == pair.key());
            if forces.is_some() || pair.gap < reach {
                let mut contact = Contact::new(*pair, radii, input.background);
                if let Some((_, (f, t))) = forces {
                    let across = |force| S::projected(&force, &pair.normal);
                    (contact.normal_force, contact.tangential_force) = (f, across(t));
                    contact.rolling_force = across(warm_start.rolling.of(&contact));
                }
                self.list.push(contact);
            }
        }
    }

    /// Adds to `list` the pairs left out that would close within the time span after all; whether there were any.
    ///
    /// Remembers the forces of the others.
    pub(super) fn add_closing(
        &mut self,
        input: &StageInput<'_, S>,
        velocities: &[f64],
        warm_start: &mut WarmStart<S>,
    ) -> bool {
        warm_start.clear();
        if !input.laws.normal.law.touches() {
            return false;
        }
        let radii = input.resistance.radii();
        let before = self.list.len();
        let mut known = 0;
        // Pairs and list are both ordered by (i, j).
        for pair in input.resistance.neighbours() {
            if let Some(contact) = self.list[..before].get(known)
                && contact.pair.key() == pair.key()
            {
                known += 1;
                if contact.normal_force > 0.0 {
                    warm_start.keep(contact);
                }
                continue;
            }
            let contact = Contact::new(*pair, radii, input.background);
            if contact.approach(velocities) < parting_velocity(input, &contact) {
                self.list.push(contact);
            }
        }
        let closes = self.list.len() > before;
        if closes {
            self.list.sort_unstable_by_key(|contact| contact.pair.key());
        }
        closes
    }
}

/// How much nearer than h a pair is, by the gap that counts.
pub(super) fn overlap_of<S: Fluid>(input: &StageInput<'_, S>, contact: &Contact<S>) -> Overlap {
    let roughness = input.laws.surface.roughness;
    let now = roughness - input.span.gap(contact, input.background);
    Overlap {
        now,
        reference: now,
        touching: contact.pair.gap < roughness,
        background: contact.background_approach,
    }
}

/// The normal velocity above which a pair bears no force.
fn parting_velocity<S: Fluid>(input: &StageInput<'_, S>, contact: &Contact<S>) -> f64 {
    let (overlap, held) = (
        overlap_of(input, contact),
        input.span.corrects_overlap_immediately(),
    );
    let normal = &input.laws.normal;
    normal.parting_velocity(&overlap, input.span.time, held)
}
