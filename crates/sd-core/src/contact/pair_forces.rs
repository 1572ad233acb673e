//! Forces of pairs that are in contact.

use super::contact_pair::Contact;
use crate::space::{Layer, Space};
use serde::{Deserialize, Serialize};

/// Forces of pairs (i, j) with i < j, ordered by (i, j).
///
/// A list that is collected gets this order, whatever it had.
///
/// ```
/// use sd_core::Layer;
/// use sd_core::contact::PairForces;
///
/// let springs: PairForces<Layer> = [(1, 2, 3.0), (0, 1, 2.0)].into_iter().collect();
/// assert_eq!(springs.0, [(0, 1, 2.0), (1, 2, 3.0)]);
/// ```
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct PairForces<S: Space = Layer>(pub Vec<(u32, u32, S::Tangent)>);

impl<S: Space> FromIterator<(u32, u32, S::Tangent)> for PairForces<S> {
    fn from_iter<I: IntoIterator<Item = (u32, u32, S::Tangent)>>(forces: I) -> Self {
        let mut forces: Vec<_> = forces.into_iter().collect();
        forces.sort_by_key(|force| (force.0, force.1));
        Self(forces)
    }
}

impl<S: Space> PairForces<S> {
    /// The first pair that these spheres cannot have, or whose force is not finite, or that is not
    /// after the one before it; with the reason.
    pub(crate) fn fault(&self, spheres: usize) -> Option<([usize; 2], &'static str)> {
        let mut last = None;
        for &(i, j, ref force) in &self.0 {
            let reason = if i >= j {
                "must have its first sphere before its second"
            } else if j as usize >= spheres {
                "names a sphere that is not there"
            } else if !S::is_finite(force) {
                "has a force that is not finite"
            } else if last >= Some((i, j)) {
                "is out of order, or there twice"
            } else {
                last = Some((i, j));
                continue;
            };
            return Some(([i as usize, j as usize], reason));
        }
        None
    }

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
