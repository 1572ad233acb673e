//! Springs of friction and of rolling friction from step to step, and from stage to stage within one.

use super::laws::Phase;
use super::memory::PairForces;
use super::pair::Contact;
use crate::law::tangential::stick_slide::TangentialSpring;
use crate::space::pair::PairKey;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_SQRT_2;

/// γ of two-stage steps: how far contact forces look ahead, in steps.
pub const GAMMA: f64 = 1.0 - FRAC_1_SQRT_2;

/// The springs of one kind of friction.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Springs {
    /// Their forces at the start of the step, in mu·a²·rate.
    pub forces: PairForces,
    /// Within a step of two stages: what the second one starts from.
    #[serde(skip)]
    stretched: Vec<(PairKey, TangentialSpring)>,
}

/// Between steps the forces are all there is to springs.
impl PartialEq for Springs {
    fn eq(&self, other: &Self) -> bool {
        self.forces == other.forces
    }
}

impl Springs {
    /// Springs with these forces.
    pub fn new(forces: PairForces) -> Self {
        Self {
            forces,
            stretched: Vec::new(),
        }
    }

    /// Room for that many contacts.
    pub(crate) fn reserve(&mut self, contacts: usize) {
        self.forces.0.reserve(contacts);
        self.stretched.reserve(contacts);
    }

    /// Becomes equal to the other, without allocating once there is room.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.forces.0.clone_from(&other.forces.0);
        self.stretched.clone_from(&other.stretched);
    }

    /// Brings all forces into another unit.
    pub(crate) fn rescale(&mut self, factor: f64) {
        for entry in &mut self.forces.0 {
            entry.2 *= factor;
        }
        for (_, spring) in &mut self.stretched {
            spring.start *= factor;
            spring.first *= factor;
        }
    }

    /// The spring of a pair within the step, unstretched if it had none.
    fn of(&self, contact: &Contact) -> TangentialSpring {
        self.stretched
            .binary_search_by_key(&contact.pair.key(), |entry| entry.0)
            .map_or_else(|_| TangentialSpring::default(), |at| self.stretched[at].1)
    }

    /// What the friction force at a stage adds `k_t s u_t` to.
    pub(crate) fn base(&self, contact: &Contact, phase: Phase) -> f64 {
        match phase {
            Phase::Second => self.of(contact).base(GAMMA),
            Phase::Alone | Phase::Middle | Phase::First => self.forces.of(contact),
        }
    }

    /// Takes the friction forces of a solved stage, which `force` reads off a contact: springs move on at the end of a step, and within
    /// one wait for its second stage.
    pub(crate) fn take(&mut self, contacts: &[Contact], phase: Phase, force: fn(&Contact) -> f64) {
        match phase {
            Phase::Alone | Phase::Middle => {}
            Phase::First => {
                self.stretched.clear();
                for contact in contacts {
                    let (start, first) = (self.forces.of(contact), force(contact));
                    if start != 0.0 || first != 0.0 {
                        let spring = TangentialSpring { start, first };
                        self.stretched.push((contact.pair.key(), spring));
                    }
                }
            }
            Phase::Second => {
                self.forces.0.clear();
                for contact in contacts.iter().filter(|c| c.normal_force > 0.0) {
                    let end = self.of(contact).end(force(contact), GAMMA);
                    if end != 0.0 {
                        self.forces.keep(contact, end);
                    }
                }
            }
        }
    }
}
