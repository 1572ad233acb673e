//! Selection of the pairs that take part in a contact problem.

use super::super::contact_pair::Contact;
use super::super::laws::Overlap;
use super::super::memory::WarmStart;
use super::{ContactSolver, StageInput};
use crate::hydrodynamics::resistance::Fluid;
use crate::space::pair::Neighbours;
use crate::threads;

/// Approach velocity, in a·rate: a pair that would touch within the stage at this velocity is an
/// initial candidate. With 1 instead of 3, more pairs close only in the solution, and layers of
/// 1000 spheres require 14 % more linear systems.
const EXPECTED_APPROACH: f64 = 3.0;
/// Fewest pairs of which a thread finds those that close.
const LEAST_PAIRS: usize = 1000;

impl<S: Fluid> ContactSolver<S> {
    /// Selects the initial candidates: pairs that had forces in the preceding stage, and close
    /// pairs.
    pub(super) fn choose_candidates(
        &mut self,
        input: &StageInput<'_, S>,
        warm_start: &WarmStart<S>,
    ) {
        let (radii, pairs) = (input.resistance.radii(), input.resistance.neighbours());
        self.list.clear();
        if !input.laws.normal.law.touches() {
            return;
        }
        let range = input.laws.surface.roughness + EXPECTED_APPROACH * input.span.time;
        // Both lists are ordered by (i, j).
        let mut known = warm_start.forces.iter().peekable();
        for pair in pairs {
            while known.next_if(|&&(i, j, ..)| (i, j) < pair.key()).is_some() {}
            let forces = known.next_if(|&&(i, j, ..)| (i, j) == pair.key());
            let is_close = || {
                pair.gap < range
                    || !input.random_motion.is_empty() && {
                        let contact = Contact::approaching(*pair, radii, input.flow);
                        let approach = random_approach(input, &contact);
                        approach < 0.0 && pair.gap + approach * input.span.time < range
                    }
            };
            if forces.is_some() || is_close() {
                let mut contact = Contact::new(*pair, radii, input.flow);
                if let Some((.., f, t)) = forces {
                    let across = |force| S::projected(force, &pair.normal);
                    (contact.normal_force, contact.tangential_force) = (*f, across(t));
                    contact.rolling_force = across(&warm_start.rolling.of(&contact));
                }
                self.list.push(contact);
            }
        }
    }

    /// Adds to `list` the omitted pairs that would close within the time span, and stores the
    /// forces of the others for the next stage; returns whether pairs were added.
    pub(super) fn add_closing_pairs(
        &mut self,
        input: &StageInput<'_, S>,
        velocities: &[f64],
        warm_start: &mut WarmStart<S>,
    ) -> bool {
        warm_start.clear();
        if !input.laws.normal.law.touches() {
            return false;
        }
        let (radii, pairs) = (input.resistance.radii(), input.resistance.neighbours());
        let before = self.list.len();
        let mut closing = std::mem::take(&mut self.closing);
        closing.resize(pairs.len(), false);
        let (list, kind, dilation) = (&self.list, self.dilates(), self.dilation);
        let flow = input.flow;
        let closes = |pair: &Neighbours<S>| {
            let contact = Contact::approaching(*pair, radii, flow);
            let (overlap, normal) = (overlap_of(input, &contact), &input.laws.normal);
            let approach = contact.approach(velocities) + contact.opening(kind) * dilation;
            approach < normal.separation_velocity(&overlap, &input.span)
        };
        // Both lists are ordered by (i, j).
        threads::divide(&mut closing, LEAST_PAIRS, &|first, closing| {
            let pairs = &pairs[first..first + closing.len()];
            let before = |first: &Neighbours<S>| {
                list.partition_point(|contact| contact.pair.key() < first.key())
            };
            let mut known = list[pairs.first().map_or(0, before)..].iter().peekable();
            for (closing, pair) in closing.iter_mut().zip(pairs) {
                let same = known.next_if(|contact| contact.pair.key() == pair.key());
                *closing = same.is_none() && closes(pair);
            }
        });
        let mut known = 0;
        for (pair, &closes) in pairs.iter().zip(&closing) {
            if let Some(contact) = self.list[..before].get(known)
                && contact.pair.key() == pair.key()
            {
                known += 1;
                if contact.normal_force > 0.0 {
                    warm_start.keep(contact);
                }
                continue;
            }
            if closes {
                self.list.push(Contact::new(*pair, radii, flow));
            }
        }
        self.closing = closing;
        let closes = self.list.len() > before;
        if closes {
            self.list.sort_unstable_by_key(|contact| contact.pair.key());
        }
        closes
    }
}

/// The overlap h − g of a pair, from the gap that enters its law.
pub(super) fn overlap_of<S: Fluid>(input: &StageInput<'_, S>, contact: &Contact<S>) -> Overlap {
    let roughness = input.laws.surface.roughness;
    let now = roughness - input.span.gap(contact, input.flow);
    let kicked = now.min(0.0) - input.span.time * random_approach(input, contact);
    Overlap {
        now,
        reflected: kicked.max(0.0),
        reference: now,
        touching: contact.pair.gap < roughness,
        background: contact.background_approach,
    }
}

/// The normal velocity of a pair due to random forces, were there no contacts.
fn random_approach<S: Fluid>(input: &StageInput<'_, S>, contact: &Contact<S>) -> f64 {
    if input.random_motion.is_empty() {
        0.0
    } else {
        contact.normal_row().read(input.random_motion)
    }
}
