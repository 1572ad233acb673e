//! What contacts remember: the forces from which the next stage starts, and springs.

use super::pair::Contact;
use super::springs::Springs;
use crate::space::pair::{Neighbours, PairKey};
use serde::{Deserialize, Serialize};

/// What contacts remember from stage to stage and from step to step.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactMemory {
    /// Forces of the stage before: where the next begins.
    pub warm_start: WarmStart,
    /// Springs of friction; none under laws without.
    pub springs: Springs,
    /// Springs of rolling friction.
    #[serde(default)]
    pub rolling_springs: Springs,
}

impl ContactMemory {
    /// Becomes equal to the other, without allocating once there is room.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.warm_start.copy_from(&other.warm_start);
        self.springs.copy_from(&other.springs);
        self.rolling_springs.copy_from(&other.rolling_springs);
    }

    /// Room for that many contacts.
    pub(crate) fn reserve(&mut self, contacts: usize) {
        self.warm_start.forces.reserve(contacts);
        self.warm_start.rolling.0.reserve(contacts);
        self.springs.reserve(contacts);
        self.rolling_springs.reserve(contacts);
    }
}

/// Forces of the stage before.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WarmStart {
    /// `(i, j, f, t)` of pairs with a force, ordered by (i, j).
    pub forces: Vec<(u32, u32, f64, f64)>,
    /// Quasi-forces of rolling friction, of pairs that have one.
    #[serde(default)]
    pub rolling: PairForces,
}

/// The key of an entry.
fn key(entry: &(u32, u32, f64, f64)) -> PairKey {
    (entry.0, entry.1)
}

impl WarmStart {
    /// The pairs among `pairs`, ordered by (i, j), that bore forces in the stage before.
    pub(crate) fn known<'p>(
        &self,
        pairs: &'p [Neighbours],
    ) -> impl Iterator<Item = (&'p Neighbours, [f64; 2])> {
        let mut entries = self.forces.iter().peekable();
        pairs.iter().filter_map(move |pair| {
            while entries.next_if(|entry| key(entry) < pair.key()).is_some() {}
            let entry = entries.next_if(|entry| key(entry) == pair.key())?;
            Some((pair, [entry.2, entry.3]))
        })
    }

    /// Remembers the forces of a contact; contacts come in order.
    pub(crate) fn keep(&mut self, contact: &Contact) {
        let (i, j) = contact.pair.key();
        self.forces
            .push((i, j, contact.normal_force, contact.tangential_force));
        if contact.rolling_force != 0.0 {
            self.rolling.keep(contact, contact.rolling_force);
        }
    }

    /// Becomes equal to the other, without allocating once there is room.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.forces.clone_from(&other.forces);
        self.rolling.0.clone_from(&other.rolling.0);
    }

    /// Forgets all.
    pub(crate) fn clear(&mut self) {
        self.forces.clear();
        self.rolling.0.clear();
    }
}

/// One force of each pair that has one, ordered by (i, j).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PairForces(pub Vec<(u32, u32, f64)>);

impl PairForces {
    /// The force of a pair, zero if it has none.
    pub(crate) fn of(&self, contact: &Contact) -> f64 {
        let found = self
            .0
            .binary_search_by_key(&contact.pair.key(), |entry| (entry.0, entry.1));
        found.map_or(0.0, |at| self.0[at].2)
    }

    /// Remembers a force; pairs come in order.
    pub(crate) fn keep(&mut self, contact: &Contact, force: f64) {
        let (i, j) = contact.pair.key();
        self.0.push((i, j, force));
    }
}
