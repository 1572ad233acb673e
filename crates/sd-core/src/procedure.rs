//! The paper's steps 1 to 6 of section II A.
//!
//! 1. New contacts: pairs that approached with the last step's velocities and have `g ≤ h`. The
//!    list is kept between steps.
//! 2. One simultaneous solve for the normal forces that stop all contact_list pairs, (12)-(13).
//! 3. Pairs whose force would pull are dropped from the list.
//! 4. to 6. Friction from the motion under the remaining normal forces, added after:
//!
//! ```text
//! F_roll = K u_t,   K > 0 the inverse slip mobility of the isolated pair, u_t the slip under normal forces alone
//! f ≤ F_crit: F_t = 0;   |F_roll| ≤ ν f: F_t = F_roll (rolls);   else F_t = ν f sign(u_t) (slips)
//! ```
//!
//! with the sign of (19) corrected: friction opposes slip. It pushes pairs together after f was
//! computed, and pairs enter below h by up to a step's motion: gaps drift. This error of the scheme
//! is kept for comparison.

use crate::contact::problem::dense_system::DenseSystem;
use crate::contact::problem::statement::{self, Forces, Problem, States, System};
use crate::contact::{Contact, ContactState, Quality};
use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::law::tangential::roll_slip;
use crate::model::Surface;
use crate::space::pair::PairKey;
use crate::space::{IncidentFlow, Layer};

/// Compliance of the simultaneous solve: just enough to factor a hyperstatic network.
const CONSTRAINT_COMPLIANCE: f64 = 1e-13;

/// Listed pairs, ordered by (i, j).
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct ContactList {
    /// The pairs.
    pub pairs: Vec<PairKey>,
}

impl ContactList {
    /// Step 1: adds pairs with `g ≤ h` that approach in the given disturbance velocities `[3N]`.
    pub fn add_approaching<S: Fluid>(
        &mut self,
        resistance: &Resistance<S>,
        flow: &IncidentFlow<S>,
        roughness: f64,
        velocities: &[f64],
    ) {
        for pair in resistance.neighbours() {
            if pair.gap <= roughness {
                let contact = Contact::new(*pair, resistance.radii(), flow);
                if contact.approach(velocities) < 0.0 {
                    self.add(pair.key());
                }
            }
        }
    }

    /// Adds one pair, i < j.
    pub fn add(&mut self, pair: PairKey) {
        if let Err(at) = self.pairs.binary_search(&pair) {
            self.pairs.insert(at, pair);
        }
    }

    /// Whether a pair is contact_list.
    fn contains(&self, pair: PairKey) -> bool {
        self.pairs.binary_search(&pair).is_ok()
    }
}

/// Input of a stage.
#[derive(Clone, Copy)]
pub(crate) struct ProcedureInput<'a, S: Fluid = Layer> {
    /// Hydrodynamics, factored.
    pub resistance: &'a Resistance<S>,
    /// The incident flow.
    pub flow: &'a IncidentFlow<S>,
    /// Roughness, friction and critical load.
    pub surface: &'a Surface,
    /// All forces except contact forces, `[3N]`.
    pub forces: &'a [f64],
}

/// Solver of the steps, with its workspace.
#[derive(Default)]
pub(crate) struct ProcedureSolver<S: Fluid = Layer> {
    problem: Problem<S>,
    states: States<S>,
    forces: Forces<S>,
    system: DenseSystem,
}

impl<S: Fluid> ProcedureSolver<S> {
    /// Solves one stage by steps 2 to 6.
    ///
    /// Pairs with a tensile force are removed from the list (step 3), and so are pairs out of
    /// lubrication range.
    ///
    /// # Arguments
    /// - `contact_list`: pairs in contact; `contacts`: the same, with the forces found.
    /// - `velocities`: resulting disturbances `[3N]`.
    ///
    /// # Errors
    /// [`Error::ProcedureNeedsDense`], where the resistance is stored pair by pair.
    pub(crate) fn solve(
        &mut self,
        input: &ProcedureInput<'_, S>,
        contact_list: &mut ContactList,
        contacts: &mut Vec<Contact<S>>,
        velocities: &mut [f64],
    ) -> Result<Quality, Error> {
        let ProcedureInput {
            resistance,
            flow,
            surface,
            forces,
        } = *input;
        if resistance.pairwise().is_some() {
            return Err(Error::ProcedureNeedsDense);
        }
        contacts.clear();
        let pairs = resistance.neighbours().iter();
        let pairs = pairs.filter(|pair| contact_list.contains(pair.key()));
        contacts.extend(pairs.map(|pair| Contact::new(*pair, resistance.radii(), flow)));
        self.problem.uses_frictionless_slip = true;
        self.problem.friction.clear();
        self.problem.normal.clear();
        let normal = contacts.iter().map(|contact| statement::Normal {
            row: contact.normal_row(),
            bias: contact.background_approach,
            compliance: CONSTRAINT_COMPLIANCE,
        });
        self.problem.normal.extend(normal);
        self.system.set_up(resistance, &self.problem, forces);
        let residual = self.stop_normal_motion();
        contact_list.pairs.clear();
        for (contact, f) in contacts.iter_mut().zip(&mut self.forces.normal) {
            *f = f.max(0.0);
            contact.normal_force = *f;
            if *f > 0.0 {
                contact_list.add(contact.pair.key());
            }
        }
        if surface.has_friction() {
            self.add_friction(resistance, surface, contacts);
        }
        self.system.finish(resistance, &self.forces, velocities);
        Ok(Quality {
            residual,
            systems: 1,
            ..Quality::default()
        })
    }

    /// Step 2: forces of either sign that stop the normal motion of all pairs, without friction;
    /// returns the largest remaining velocity.
    fn stop_normal_motion(&mut self) -> f64 {
        self.states.closed.clear();
        self.states.closed.resize(self.problem.normal.len(), true);
        self.states.friction.clear();
        self.forces.reset(&self.problem);
        let solved = self
            .system
            .solve(&self.problem, &self.states, true, &mut self.forces);
        if solved.is_none() {
            self.forces.normal.fill(0.0);
            return f64::INFINITY;
        }
        statement::largest(&self.forces.slack)
    }

    /// Steps 4 to 6: friction from the slip under the normal forces.
    fn add_friction(
        &mut self,
        resistance: &Resistance<S>,
        surface: &Surface,
        contacts: &mut [Contact<S>],
    ) {
        for (k, contact) in contacts.iter_mut().enumerate() {
            if contact.normal_force > surface.critical_load {
                contact.slip_resistance = resistance.slip_resistance(&contact.pair);
                contact.friction_acts = true;
                self.problem.friction.push(statement::Friction {
                    contact: k,
                    rows: contact.slip_rows(),
                    shift: S::along(&contact.directions(), &contact.background_slip),
                    compliance: 0.0,
                    coefficient: surface.friction,
                    intercept: 0.0,
                    active: true,
                    was_deactivated: false,
                });
            }
        }
        self.system.set_up_friction(resistance, &self.problem);
        let count = self.problem.friction.len();
        self.forces.tangential.clear();
        self.forces.tangential.resize(count, S::each_tangent(0.0));
        self.system.measure(&self.problem, &mut self.forces);
        let found = self.forces.tangential.iter_mut().zip(&self.forces.slip);
        for (entry, (force, slip)) in self.problem.friction.iter().zip(found) {
            let contact = &mut contacts[entry.contact];
            let bound = roll_slip::bound(surface.friction, contact.normal_force);
            // The force of a slip has its direction.
            let size = S::length(slip);
            let (limited, rolls) = roll_slip::force(size, contact.slip_resistance, bound);
            for k in 0..S::TANGENTS {
                force[k] = if size > 0.0 {
                    slip[k] / size * limited
                } else {
                    0.0
                };
            }
            contact.tangential_force = S::tangent(&contact.directions(), force);
            contact.state = if rolls {
                ContactState::Sticking
            } else {
                ContactState::Slipping
            };
        }
    }
}
