//! Springs of friction and of rolling friction from step to step, and from stage to stage within one.

use super::laws::Phase;
use super::pair::Contact;
use super::warm_start::SpringForces;
use crate::law::tangential::stick_slide::TangentialSpring;
use crate::space::pair::PairKey;
use std::f64::consts::FRAC_1_SQRT_2;

/// γ of two-stage steps: how far contact forces look ahead, in steps.
pub const GAMMA: f64 = 1.0 - FRAC_1_SQRT_2;

/// Springs under way within a step.
#[derive(Debug, Clone, Default)]
pub struct Stretches {
    /// By pair, ordered by (i, j).
    entries: Vec<(PairKey, TangentialSpring)>,
}

impl Stretches {
    /// Room for that many contacts.
    pub(crate) fn reserve(&mut self, contacts: usize) {
        self.entries.reserve(contacts);
    }

    /// Brings all forces into another unit.
    pub(crate) fn rescale(&mut self, factor: f64) {
        for (_, spring) in &mut self.entries {
            spring.start *= factor;
            spring.first *= factor;
        }
    }

    /// The spring of a pair, unstretched if it had none.
    fn of(&self, contact: &Contact) -> TangentialSpring {
        self.entries
            .binary_search_by_key(&contact.pair.key(), |entry| entry.0)
            .map_or_else(|_| TangentialSpring::default(), |at| self.entries[at].1)
    }

    /// What the friction force at a stage adds `k_t s u_t` to.
    pub(crate) fn base(&self, contact: &Contact, forces: &SpringForces, phase: Phase) -> f64 {
        match phase {
            Phase::Second => self.of(contact).base(GAMMA),
            Phase::Alone | Phase::Middle | Phase::First => forces.of(contact),
        }
    }

    /// Takes the friction forces of a solved stage, which `force` reads off a contact: springs move on at the end of a step, and within one wait for its second stage.
    pub(crate) fn take(
        &mut self,
        contacts: &[Contact],
        forces: &mut SpringForces,
        phase: Phase,
        force: fn(&Contact) -> f64,
    ) {
        match phase {
            Phase::Alone | Phase::Middle => {}
            Phase::First => {
                self.entries.clear();
                for contact in contacts {
                    let (start, first) = (forces.of(contact), force(contact));
                    if start != 0.0 || first != 0.0 {
                        let spring = TangentialSpring { start, first };
                        self.entries.push((contact.pair.key(), spring));
                    }
                }
            }
            Phase::Second => {
                forces.0.clear();
                for contact in contacts.iter().filter(|c| c.normal_force > 0.0) {
                    let end = self.of(contact).end(force(contact), GAMMA);
                    if end != 0.0 {
                        forces.keep(contact, end);
                    }
                }
            }
        }
    }
}
