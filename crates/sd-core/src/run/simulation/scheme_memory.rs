//! What contacts remember from one step to the next.

use crate::contact::ContactMemory;
use crate::contact::pair_forces::PairForces;
use crate::contact::springs::Springs;
use crate::model::ContactScheme;
use crate::procedure::ContactList;
use crate::run::start::Start;
use crate::space::{Layer, Space};
use serde::{Deserialize, Serialize};

/// Memory of contacts between steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, bound = "")]
pub enum SchemeMemory<S: Space = Layer> {
    /// Under laws.
    Laws(ContactMemory<S>),
    /// Under the paper's steps.
    Procedure {
        /// Pairs in contact.
        #[serde(rename = "listed")]
        contact_list: ContactList,
        /// Mean disturbance velocities `[3N]` of the last step; empty before it.
        velocities: Vec<f64>,
    },
}

impl<S: Space> SchemeMemory<S> {
    /// An empty memory.
    pub(super) fn new(scheme: &ContactScheme) -> Self {
        match scheme {
            ContactScheme::Rigid | ContactScheme::Laws(_) => Self::Laws(ContactMemory::default()),
            ContactScheme::Procedure => Self::Procedure {
                contact_list: ContactList::default(),
                velocities: Vec::new(),
            },
        }
    }

    /// Sets the springs of friction, of this stiffness, to the stretches of a start; no effect
    /// without springs.
    pub(super) fn stretch(&mut self, start: &Start<S>, stiffness: f64) {
        if let Self::Laws(memory) = self
            && stiffness > 0.0
        {
            let springs = |stretches: &[(u32, u32, S::Tangent)]| {
                let forces = stretches.iter().map(|&(i, j, x)| (i, j, x * stiffness));
                Springs::new(forces.collect::<PairForces<S>>())
            };
            memory.springs = springs(&start.springs);
            memory.rolling_springs = springs(&start.rolling_springs);
        }
    }

    /// Copies another memory of the same scheme, without allocating if the capacity suffices.
    pub(super) fn copy_from(&mut self, other: &Self) {
        match (self, other) {
            (Self::Laws(memory), Self::Laws(other)) => memory.copy_from(other),
            (
                Self::Procedure {
                    contact_list,
                    velocities,
                },
                Self::Procedure {
                    contact_list: other_list,
                    velocities: other_velocities,
                },
            ) => {
                contact_list.pairs.clone_from(&other_list.pairs);
                velocities.clone_from(other_velocities);
            }
            (this, other) => *this = other.clone(),
        }
    }

    /// The reason why this is not the memory of a run of that scheme with this number of spheres,
    /// if any.
    pub(super) fn fault(&self, scheme: &ContactScheme, spheres: usize) -> Option<&'static str> {
        let there = |&(i, j): &(u32, u32)| i < j && (j as usize) < spheres;
        match (self, scheme) {
            (Self::Laws(memory), ContactScheme::Rigid | ContactScheme::Laws(_)) => {
                let forces = &memory.warm_start.forces;
                let springs = [
                    &memory.springs.forces,
                    &memory.rolling_springs.forces,
                    &memory.warm_start.rolling,
                ];
                if !forces.iter().all(|f| there(&(f.0, f.1))) {
                    return Some("contacts of missing spheres");
                }
                let finite = forces.iter().all(|f| f.2.is_finite() && S::is_finite(&f.3));
                if !finite {
                    return Some("not all numbers are finite");
                }
                let faulty = springs.iter().any(|list| list.fault(spheres).is_some());
                faulty.then_some("springs of missing spheres, out of order or not finite")
            }
            (
                Self::Procedure {
                    contact_list,
                    velocities,
                },
                ContactScheme::Procedure,
            ) => {
                if !(velocities.is_empty() || velocities.len() == S::MODES * spheres) {
                    return Some("velocities of another number of spheres");
                }
                if !contact_list.pairs.iter().all(there) {
                    return Some("contacts of missing spheres");
                }
                let finite = velocities.iter().all(|v| v.is_finite());
                (!finite).then_some("not all numbers are finite")
            }
            _ => Some("contacts of another scheme"),
        }
    }
}
