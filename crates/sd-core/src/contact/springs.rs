//! Tangential and rolling springs, from step to step and from stage to stage within a step.
//!
//! In a suspension their forces are vectors perpendicular to the line of centres. Within a step
//! they are transported with it as it rotates. At the start of a step they are projected, since the
//! line of centres has rotated by O(τ²) since the second stage of the preceding step, or differs by
//! O(τ²) from that expected in the middle of a step of rigid contacts.

use super::contact_pair::Contact;
use super::laws::{GAMMA, StageKind};
use super::pair_forces::PairForces;
use crate::law::tangential::stick_slide::TangentialSpring;
use crate::space::pair::PairKey;
use crate::space::{Layer, Space};
use serde::{Deserialize, Serialize};

/// Largest factor by which the bound of friction at the end of a step of rigid contacts may differ
/// from that in its middle, from which and from that at the start it is extrapolated.
const MAX_EXTRAPOLATION: f64 = 2.0;
/// Difference from its bound, over the bound, below which friction slides.
const BOUND_TOLERANCE: f64 = 1e-9;

/// A spring within a step.
#[derive(Debug, Clone, Copy)]
struct SpringEntry<S: Space> {
    pair: PairKey,
    /// Line of centres and bound of friction at the first stage.
    normal: S::Vector,
    bound: f64,
    spring: TangentialSpring<S::Tangent>,
}

/// The springs of one kind of friction, tangential or rolling.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(transparent, bound = "")]
pub struct Springs<S: Space = Layer> {
    /// Spring forces at the start of the step, in mu·a²·rate.
    pub forces: PairForces<S>,
    /// Springs between the two stages of a step.
    #[serde(skip)]
    within_step: Vec<SpringEntry<S>>,
    /// Forces at the start of the step of rigid contacts that is attempted.
    #[serde(skip)]
    before: PairForces<S>,
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
            ..Self::default()
        }
    }

    /// Keeps the forces at the start of a step of rigid contacts.
    pub(crate) fn begin_attempt(&mut self) {
        self.before.0.clone_from(&self.forces.0);
    }

    /// Returns to the start of the step of rigid contacts.
    pub(crate) fn undo_attempt(&mut self) {
        self.forces.0.clone_from(&self.before.0);
    }

    pub(crate) fn clear(&mut self) {
        self.forces.0.clear();
    }

    /// Ends a step of rigid contacts whose first stage alone moved the spheres.
    pub(crate) fn end_with_first_stage(&mut self) {
        self.forces.0.clear();
        for entry in &self.within_step {
            let end = limited::<S>(entry.spring.end_of_first(GAMMA), entry.bound);
            if end != S::Tangent::default() {
                self.forces.0.push((entry.pair.0, entry.pair.1, end));
            }
        }
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.forces.0.clone_from(&other.forces.0);
        self.within_step.clone_from(&other.within_step);
    }

    /// Multiplies all forces by a factor, to change their unit.
    pub(crate) fn rescale(&mut self, factor: f64) {
        for entry in self.forces.0.iter_mut().chain(&mut self.before.0) {
            entry.2 = entry.2 * factor;
        }
        for entry in &mut self.within_step {
            entry.spring = entry.spring.map(|force| force * factor);
        }
    }

    fn entry_of(&self, contact: &Contact<S>) -> Option<&SpringEntry<S>> {
        let key = contact.pair.key();
        let found = self
            .within_step
            .binary_search_by_key(&key, |entry| entry.pair);
        found.ok().map(|at| &self.within_step[at])
    }

    /// The spring of a pair within the step; undeformed if it has none.
    fn spring_of(&self, contact: &Contact<S>) -> TangentialSpring<S::Tangent> {
        self.entry_of(contact)
            .map_or_else(TangentialSpring::default, |entry| {
                let transported =
                    |force| S::transported(&force, &entry.normal, &contact.pair.normal);
                entry.spring.map(transported)
            })
    }

    /// The spring force of a pair at the end of a step of rigid contacts, from the friction in its
    /// middle and its bound there.
    fn end_of_middle(&self, contact: &Contact<S>, force: S::Tangent, bound: f64) -> S::Tangent {
        let spring = self.spring_of(contact);
        let entry = self.entry_of(contact).filter(|entry| entry.bound > 0.0);
        let least = bound / MAX_EXTRAPOLATION;
        let last = entry.map_or(bound, |entry| {
            (2.0 * bound - entry.bound).clamp(least, MAX_EXTRAPOLATION * bound)
        });
        let slides = S::tangent_dot(&force, &force).sqrt() >= bound * (1.0 - BOUND_TOLERANCE);
        let end = if slides && bound > 0.0 {
            force * (last / bound)
        } else {
            limited::<S>(spring.end_of_middle(force, GAMMA), last)
        };
        entry.map_or(end, |entry| {
            // The line of centres turns on as far as from the first stage.
            let middle = contact.pair.normal;
            let expected = middle * (2.0 * S::dot(&middle, &entry.normal)) - entry.normal;
            S::transported(&end, &middle, &expected)
        })
    }

    /// The spring force of a pair at the start of the step.
    fn at_start(&self, contact: &Contact<S>) -> S::Tangent {
        S::projected(&self.forces.of(contact), &contact.pair.normal)
    }

    /// The friction force of a stage without the term `k_t s u_t`.
    pub(crate) fn base(&self, contact: &Contact<S>, kind: StageKind) -> S::Tangent {
        match kind {
            StageKind::Second => self.spring_of(contact).base(GAMMA),
            StageKind::Midpoint => self.spring_of(contact).middle(GAMMA),
            StageKind::Single | StageKind::First => self.at_start(contact),
        }
    }

    /// Records the friction forces of a solved stage, which `force` extracts from a contact. After
    /// the first stage they are kept for the second; after the second, springs are advanced to the
    /// end of the step.
    ///
    /// `bound`: the bound of such a force.
    pub(crate) fn record(
        &mut self,
        contacts: &[Contact<S>],
        kind: StageKind,
        force: fn(&Contact<S>) -> S::Tangent,
        bound: impl Fn(&Contact<S>) -> f64,
    ) {
        let zero = S::Tangent::default();
        if matches!(kind, StageKind::Single | StageKind::First) {
            self.within_step.clear();
            for contact in contacts {
                let (start, first) = (self.at_start(contact), force(contact));
                if start != zero || first != zero {
                    self.within_step.push(SpringEntry {
                        pair: contact.pair.key(),
                        normal: contact.pair.normal,
                        bound: bound(contact),
                        spring: TangentialSpring { start, first },
                    });
                }
            }
            return;
        }
        self.forces.0.clear();
        for contact in contacts.iter().filter(|c| c.normal_force > 0.0) {
            let end = if kind == StageKind::Midpoint {
                self.end_of_middle(contact, force(contact), bound(contact))
            } else {
                self.spring_of(contact).end(force(contact), GAMMA)
            };
            if end != zero {
                self.forces.keep(contact, end);
            }
        }
    }
}

/// A force shortened to a bound.
fn limited<S: Space>(force: S::Tangent, bound: f64) -> S::Tangent {
    let length = S::tangent_dot(&force, &force).sqrt();
    if length > bound {
        force * (bound / length)
    } else {
        force
    }
}
