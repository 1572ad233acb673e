//! Which pairs take part in a contact problem.

use super::super::laws::Overlap;
use super::super::memory::WarmStart;
use super::super::pair::Contact;
use super::{ContactSolver, StageInput};

/// Approach velocity, in a·rate, that the first choice of candidates allows for.
const EXPECTED_APPROACH: f64 = 3.0;
/// Change of a normal velocity from one stage to the next, in a·rate, that the next choice of candidates allows for.
const EXPECTED_CHANGE: f64 = 0.3;
/// Approach velocity, in a·rate, that the choice of candidates allows for besides known ones.
const LIKELY_APPROACH: f64 = 1.0;
/// Velocity, in a·rate, by which pairs fail to close that are added nevertheless.
const NEARLY_CLOSING: f64 = 1.0;

impl ContactSolver {
    /// The first candidates: pairs that touched or were about to in the stage before, or all near ones where there was none. Where systems
    /// are dear, so that none had better be solved again for a pair that was left out, near ones are always among them.
    pub(super) fn choose(&mut self, input: &StageInput<'_>, warm_start: &WarmStart) {
        let (radii, pairs) = (input.resistance.radii(), input.resistance.neighbours());
        self.list.clear();
        if !input.laws.normal.law.touches() {
            return;
        }
        if warm_start.is_empty() {
            let reach = input.laws.surface.roughness + EXPECTED_APPROACH * input.span.time;
            let near = pairs.iter().filter(|pair| pair.gap < reach);
            self.list
                .extend(near.map(|pair| Contact::new(*pair, radii, input.background)));
            return;
        }
        let reach = input.laws.surface.roughness + LIKELY_APPROACH * input.span.time;
        let mut known = warm_start.known(pairs).peekable();
        for pair in pairs {
            let forces = known.next_if(|(other, _)| other.key() == pair.key());
            if forces.is_some() || pair.gap < reach {
                let mut contact = Contact::new(*pair, radii, input.background);
                if let Some((_, [f, t])) = forces {
                    (contact.normal_force, contact.tangential_force) = (f, t);
                    contact.rolling_force = warm_start.rolling.of(&contact);
                }
                self.list.push(contact);
            }
        }
    }

    /// Adds to `list` the pairs left out that would close within the time span after all; whether there were any.
    ///
    /// Where it takes long to solve the problem again, those that nearly would come with them: forces of new contacts push others together.
    /// In a layer that is `jammed` the velocities say little, and more pairs are added.
    ///
    /// Remembers the forces of all others, and who may touch in the next stage.
    pub(super) fn add_closing(
        &mut self,
        input: &StageInput<'_>,
        velocities: &[f64],
        warm_start: &mut WarmStart,
    ) -> bool {
        warm_start.clear();
        if !input.laws.normal.law.touches() {
            return false;
        }
        let radii = input.resistance.radii();
        let before = self.list.len();
        let (mut known, mut closes) = (0, false);
        // Pairs and list are both ordered by (i, j).
        for pair in input.resistance.neighbours() {
            let (forces, parting, velocity);
            if let Some(contact) = self.list[..before].get(known)
                && contact.pair.key() == pair.key()
            {
                known += 1;
                forces = [
                    contact.normal_force,
                    contact.tangential_force,
                    contact.rolling_force,
                ];
                parting = parting_velocity(input, contact);
                velocity = contact.normal_velocity;
            } else {
                let contact = Contact::new(*pair, radii, input.background);
                forces = [0.0; 3];
                parting = parting_velocity(input, &contact);
                velocity = contact.background[0] + contact.normal_row().read(velocities);
                closes |= velocity < parting;
                if velocity < parting + NEARLY_CLOSING {
                    self.list.push(contact);
                }
            }
            // The next time span may be twice as long.
            if forces[0] > 0.0 || velocity - parting.max(0.5 * parting) < EXPECTED_CHANGE {
                warm_start.keep(pair, forces);
            }
        }
        if closes {
            self.list.sort_unstable_by_key(|contact| contact.pair.key());
        } else {
            self.list.truncate(before);
        }
        closes
    }
}

/// How much nearer than h a pair is, by the gap that counts.
pub(super) fn overlap_of(input: &StageInput<'_>, contact: &Contact) -> Overlap {
    let roughness = input.laws.surface.roughness;
    let now = roughness - input.span.gap(contact, input.background);
    Overlap {
        now,
        reference: now,
        touching: contact.pair.gap < roughness,
        background: contact.background[0],
    }
}

/// The normal velocity above which a pair bears no force.
pub(super) fn parting_velocity(input: &StageInput<'_>, contact: &Contact) -> f64 {
    let (overlap, held) = (overlap_of(input, contact), input.span.takes_back_at_once());
    let normal = &input.laws.normal;
    normal.parting_velocity(&overlap, input.span.time, held)
}
