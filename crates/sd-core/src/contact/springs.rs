//! Tangential and rolling springs, from step to step and from stage to stage within a step.
//!
//! In a suspension their forces are vectors perpendicular to the line of centres. Within a step
//! they are transported with it as it rotates. At the start of a step they are projected, since the
//! line of centres has rotated by O(τ²) since the second stage of the preceding step.

use super::contact_pair::Contact;
use super::laws::StageKind;
use super::pair_forces::PairForces;
use crate::law::tangential::stick_slide::TangentialSpring;
use crate::space::pair::PairKey;
use crate::space::{Layer, Space};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_SQRT_2;

/// γ of two-stage steps: the time span of implicit contact forces, in steps.
pub(crate) const GAMMA: f64 = 1.0 - FRAC_1_SQRT_2;

/// A spring within a step, with its pair and the line of centres at the first stage.
type SpringEntry<S> = (
    PairKey,
    <S as Space>::Vector,
    TangentialSpring<<S as Space>::Tangent>,
);

/// The springs of one kind of friction, tangential or rolling.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(transparent, bound = "")]
pub struct Springs<S: Space = Layer> {
    /// Spring forces at the start of the step, in mu·a²·rate.
    pub forces: PairForces<S>,
    /// Springs between the two stages of a step.
    #[serde(skip)]
    within_step: Vec<SpringEntry<S>>,
}

/// Between steps, springs are determined by their forces.
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
            within_step: Vec::new(),
        }
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.forces.0.clone_from(&other.forces.0);
        self.within_step.clone_from(&other.within_step);
    }

    /// Multiplies all forces by a factor, to change their unit.
    pub(crate) fn rescale(&mut self, factor: f64) {
        for entry in &mut self.forces.0 {
            entry.2 = entry.2 * factor;
        }
        for (.., spring) in &mut self.within_step {
            *spring = spring.map(|force| force * factor);
        }
    }

    /// The spring of a pair within the step; undeformed if it has none.
    fn spring_of(&self, contact: &Contact<S>) -> TangentialSpring<S::Tangent> {
        let found = self
            .within_step
            .binary_search_by_key(&contact.pair.key(), |entry| entry.0);
        found.map_or_else(
            |_| TangentialSpring::default(),
            |at| {
                let (_, normal, spring) = &self.within_step[at];
                spring.map(|force| S::transported(&force, normal, &contact.pair.normal))
            },
        )
    }

    /// The spring force of a pair at the start of the step.
    fn at_start(&self, contact: &Contact<S>) -> S::Tangent {
        S::projected(&self.forces.of(contact), &contact.pair.normal)
    }

    /// The friction force of a stage without the term `k_t s u_t`.
    pub(crate) fn base(&self, contact: &Contact<S>, kind: StageKind) -> S::Tangent {
        match kind {
            StageKind::Second => self.spring_of(contact).base(GAMMA),
            StageKind::Single | StageKind::Midpoint | StageKind::First => self.at_start(contact),
        }
    }

    /// Records the friction forces of a solved stage, which `force` extracts from a contact. After
    /// the first stage they are kept for the second; after the second, springs are advanced to the
    /// end of the step.
    pub(crate) fn record(
        &mut self,
        contacts: &[Contact<S>],
        kind: StageKind,
        force: fn(&Contact<S>) -> S::Tangent,
    ) {
        let zero = S::Tangent::default();
        match kind {
            StageKind::Single | StageKind::Midpoint => {}
            StageKind::First => {
                self.within_step.clear();
                for contact in contacts {
                    let (start, first) = (self.at_start(contact), force(contact));
                    if start != zero || first != zero {
                        let spring = TangentialSpring { start, first };
                        let entry = (contact.pair.key(), contact.pair.normal, spring);
                        self.within_step.push(entry);
                    }
                }
            }
            StageKind::Second => {
                self.forces.0.clear();
                for contact in contacts.iter().filter(|c| c.normal_force > 0.0) {
                    let end = self.spring_of(contact).end(force(contact), GAMMA);
                    if end != zero {
                        self.forces.keep(contact, end);
                    }
                }
            }
        }
    }
}
