//! What is known from the stage before: where the next one starts, and which pairs may touch in it.

use super::pair::Contact;
use crate::space::pair::{Neighbours, PairKey};
use serde::{Deserialize, Serialize};

/// Forces of the stage before.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WarmStart {
    /// `(i, j, f, t)` of pairs with a force, and of others about to touch, without; ordered by (i, j).
    pub forces: Vec<(u32, u32, f64, f64)>,
    /// Quasi-forces of rolling friction, of pairs that have one.
    #[serde(default)]
    pub rolling: SpringForces,
}

/// The key of an entry.
fn key(entry: &(u32, u32, f64, f64)) -> PairKey {
    (entry.0, entry.1)
}

impl WarmStart {
    /// The pairs among `pairs`, ordered by (i, j), that touched in the stage before or were about to.
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

    /// Remembers a pair; pairs come in order.
    ///
    /// `forces`: f, t and the quasi-force of rolling friction.
    pub(crate) fn keep(&mut self, pair: &Neighbours, [f, t, rolling]: [f64; 3]) {
        let (i, j) = pair.key();
        self.forces.push((i, j, f, t));
        if rolling != 0.0 {
            self.rolling.0.push((i, j, rolling));
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

    /// Whether nothing is known.
    pub(crate) fn is_empty(&self) -> bool {
        self.forces.is_empty()
    }
}

/// Forces of springs, by pair.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SpringForces(pub Vec<(u32, u32, f64)>);

impl SpringForces {
    /// The force of a pair's spring, zero if it has none.
    pub(crate) fn of(&self, contact: &Contact) -> f64 {
        let found = self
            .0
            .binary_search_by_key(&contact.pair.key(), |entry| (entry.0, entry.1));
        found.map_or(0.0, |at| self.0[at].2)
    }

    /// Brings all forces into another unit.
    pub(crate) fn rescale(&mut self, factor: f64) {
        for entry in &mut self.0 {
            entry.2 *= factor;
        }
    }

    /// Remembers a spring; pairs come in order.
    pub(crate) fn keep(&mut self, contact: &Contact, force: f64) {
        let (i, j) = contact.pair.key();
        self.0.push((i, j, force));
    }
}
