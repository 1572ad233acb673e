//! Forces of pairs that are in contact.

use super::contact_pair::Contact;
use crate::space::{Layer, Space};
use serde::{Deserialize, Serialize};

/// Forces of pairs, ordered by (i, j).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct PairForces<S: Space = Layer>(pub Vec<(u32, u32, S::Tangent)>);

impl<S: Space> PairForces<S> {
    /// The force of a pair, zero if it has none.
    pub(crate) fn of(&self, contact: &Contact<S>) -> S::Tangent {
        let found = self
            .0
            .binary_search_by_key(&contact.pair.key(), |entry| (entry.0, entry.1));
        found.map_or_else(|_| S::Tangent::default(), |at| self.0[at].2)
    }

    /// Stores a force. Pairs must be passed in order of (i, j).
    pub(crate) fn keep(&mut self, contact: &Contact<S>, force: S::Tangent) {
        let (i, j) = contact.pair.key();
        self.0.push((i, j, force));
    }
}
