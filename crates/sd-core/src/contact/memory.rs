//! State of the contacts between stages and steps: warm-start forces and springs.

use super::contact_pair::Contact;
use super::pair_forces::PairForces;
use super::springs::Springs;
use crate::space::{Layer, Space};
use serde::{Deserialize, Serialize};

/// State of the contacts between stages and steps.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct ContactMemory<S: Space = Layer> {
    /// Forces of the preceding stage, from which the next solution starts.
    pub warm_start: WarmStart<S>,
    /// Tangential springs; none under laws without them.
    pub springs: Springs<S>,
    /// Rolling springs.
    #[serde(default)]
    pub rolling_springs: Springs<S>,
}

impl<S: Space> ContactMemory<S> {
    /// Tangential and rolling springs.
    pub(crate) fn all_springs(&mut self) -> [&mut Springs<S>; 2] {
        [&mut self.springs, &mut self.rolling_springs]
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.warm_start.copy_from(&other.warm_start);
        self.springs.copy_from(&other.springs);
        self.rolling_springs.copy_from(&other.rolling_springs);
    }
}

/// Forces of the preceding stage.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct WarmStart<S: Space = Layer> {
    /// `(i, j, f, t)` of pairs with a normal force, ordered by (i, j).
    pub forces: Vec<(u32, u32, f64, S::Tangent)>,
    /// Quasi-forces of rolling friction, of pairs with a nonzero one.
    #[serde(default)]
    pub rolling: PairForces<S>,
}

impl<S: Space> WarmStart<S> {
    /// Stores the forces of a contact. Contacts must be passed in order of (i, j).
    pub(crate) fn keep(&mut self, contact: &Contact<S>) {
        let (i, j) = contact.pair.key();
        self.forces
            .push((i, j, contact.normal_force, contact.tangential_force));
        if contact.rolling_force != S::Tangent::default() {
            self.rolling.keep(contact, contact.rolling_force);
        }
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.forces.clone_from(&other.forces);
        self.rolling.0.clone_from(&other.rolling.0);
    }

    pub(crate) fn clear(&mut self) {
        self.forces.clear();
        self.rolling.0.clear();
    }
}
