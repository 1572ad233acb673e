//! Springs of friction and of rolling friction from step to step, and from stage to stage within one.
//!
//! In a suspension they are vectors across the line of centres: carried along where it turns within a step, and projected where a step
//! begins, since it has turned by O(τ²) from the second stage of the step before.

use super::laws::Phase;
use super::memory::PairForces;
use super::pair::Contact;
use crate::law::tangential::stick_slide::TangentialSpring;
use crate::space::pair::PairKey;
use crate::space::{Layer, Space};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_SQRT_2;

/// γ of two-stage steps: how far contact forces look ahead, in steps.
pub(crate) const GAMMA: f64 = 1.0 - FRAC_1_SQRT_2;

/// A spring within a step, of a pair with that line of centres.
type Stretched<S> = (
    PairKey,
    <S as Space>::Vector,
    TangentialSpring<<S as Space>::Tangent>,
);

/// The springs of one kind of friction.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(transparent, bound = "")]
pub struct Springs<S: Space = Layer> {
    /// Their forces at the start of the step, in mu·a²·rate.
    pub forces: PairForces<S>,
    /// Within a step of two stages: what the second one starts from, and the line of centres at the first.
    #[serde(skip)]
    stretched: Vec<Stretched<S>>,
}

/// Between steps the forces are all there is to springs.
impl<S: Space> PartialEq for Springs<S> {
    fn eq(&self, other: &Self) -> bool {
        self.forces == other.forces
    }
}

impl<S: Space> Springs<S> {
    /// Springs with these forces.
    pub fn new(forces: PairForces<S>) -> Self {
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
            entry.2 = entry.2 * factor;
        }
        for (.., spring) in &mut self.stretched {
            *spring = spring.map(|force| force * factor);
        }
    }

    /// The spring of a pair within the step, unstretched if it had none.
    fn of(&self, contact: &Contact<S>) -> TangentialSpring<S::Tangent> {
        let found = self
            .stretched
            .binary_search_by_key(&contact.pair.key(), |entry| entry.0);
        found.map_or_else(
            |_| TangentialSpring::default(),
            |at| {
                let (_, normal, spring) = &self.stretched[at];
                spring.map(|force| S::carried(&force, normal, &contact.pair.normal))
            },
        )
    }

    /// The force of a pair's spring at the start of the step.
    fn at_start(&self, contact: &Contact<S>) -> S::Tangent {
        S::projected(&self.forces.of(contact), &contact.pair.normal)
    }

    /// What the friction force at a stage adds `k_t s u_t` to.
    pub(crate) fn base(&self, contact: &Contact<S>, phase: Phase) -> S::Tangent {
        match phase {
            Phase::Second => self.of(contact).base(GAMMA),
            Phase::Alone | Phase::Middle | Phase::First => self.at_start(contact),
        }
    }

    /// Takes the friction forces of a solved stage, which `force` reads off a contact: springs move on at the end of a step, and within
    /// one wait for its second stage.
    pub(crate) fn take(
        &mut self,
        contacts: &[Contact<S>],
        phase: Phase,
        force: fn(&Contact<S>) -> S::Tangent,
    ) {
        let nothing = S::Tangent::default();
        match phase {
            Phase::Alone | Phase::Middle => {}
            Phase::First => {
                self.stretched.clear();
                for contact in contacts {
                    let (start, first) = (self.at_start(contact), force(contact));
                    if start != nothing || first != nothing {
                        let spring = TangentialSpring { start, first };
                        let entry = (contact.pair.key(), contact.pair.normal, spring);
                        self.stretched.push(entry);
                    }
                }
            }
            Phase::Second => {
                self.forces.0.clear();
                for contact in contacts.iter().filter(|c| c.normal_force > 0.0) {
                    let end = self.of(contact).end(force(contact), GAMMA);
                    if end != nothing {
                        self.forces.keep(contact, end);
                    }
                }
            }
        }
    }
}
