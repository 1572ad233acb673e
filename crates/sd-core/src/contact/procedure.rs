//! The paper's steps 1 to 6 of section II A, to the letter.
//!
//! 1. New contacts: pairs that approached with the last step's velocities and have `g ≤ h`. The list is kept between steps.
//! 2. One simultaneous solve for the normal forces that halt all listed pairs, (12)-(13).
//! 3. Pairs whose force would pull are dropped from the list.
//! 4. to 6. Friction from the motion under the remaining normal forces, added after:
//!
//! ```text
//! F_roll = K u_t,   K > 0 the inverse slip mobility of the isolated pair, u_t the slip that normal forces alone leave
//! f ≤ F_crit: F_t = 0;   |F_roll| ≤ ν f: F_t = F_roll (rolls);   else F_t = ν f sign(u_t) (slips)
//! ```
//!
//! with the sign of (19) mended: friction opposes slip. It pushes pairs together after f was found, and a pair enters below h by up to a
//! step's motion: gaps drift. That is the scheme's own error, kept here for comparison.

use super::pair::{Contact, ContactState};
use super::solver::ContactSolver;
use super::{Quality, solve::problem};
use crate::error::Error;
use crate::geometry::modes::Background;
use crate::geometry::pair::PairKey;
use crate::hydrodynamics::resistance::Resistance;
use crate::law::tangential::roll_slip;
use crate::model::Surface;

/// Compliance where all pairs are halted at once: just enough for a factor of a hyperstatic network.
const HALT_COMPLIANCE: f64 = 1e-13;

/// Listed pairs, ordered by (i, j).
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct ContactList {
    /// The pairs.
    pub pairs: Vec<PairKey>,
}

impl ContactList {
    /// Step 1: adds pairs with `g ≤ h` that approach in the given disturbance velocities `[3N]`.
    pub fn add_approaching(
        &mut self,
        resistance: &Resistance,
        background: &Background,
        roughness: f64,
        velocities: &[f64],
    ) {
        for pair in resistance.neighbours() {
            if pair.gap <= roughness {
                let contact = Contact::new(*pair, resistance.radii(), background);
                if contact.background[0] + contact.normal_row().read(velocities) < 0.0 {
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

    /// Whether a pair is listed.
    fn contains(&self, pair: PairKey) -> bool {
        self.pairs.binary_search(&pair).is_ok()
    }
}

impl ContactSolver {
    /// Solves one stage by steps 2 to 6. Velocities `[3N]` are the disturbances; forces `[3N]` all but contact's.
    ///
    /// Pairs that would be pulled leave the list (step 3). A listed pair out of lubrication range has left, too.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`]; [`Error::OutOfMemory`].
    pub fn solve_procedure(
        &mut self,
        resistance: &Resistance,
        background: &Background,
        surface: &Surface,
        forces: &[f64],
        listed: &mut ContactList,
        velocities: &mut [f64],
    ) -> Result<Quality, Error> {
        self.list.clear();
        let pairs = resistance.neighbours().iter();
        let pairs = pairs.filter(|pair| listed.contains(pair.key()));
        self.list
            .extend(pairs.map(|pair| Contact::new(*pair, resistance.radii(), background)));
        let problem = &mut self.problem;
        problem.isolated = true;
        problem.tangential.clear();
        problem.normal.clear();
        problem
            .normal
            .extend(self.list.iter().map(|contact| problem::Normal {
                row: contact.normal_row(),
                bias: contact.background[0],
                compliance: HALT_COMPLIANCE,
            }));
        let residual = self.halt_all(resistance, forces)?;
        listed.pairs.clear();
        for (contact, f) in self.list.iter_mut().zip(&mut self.solver.forces.normal) {
            *f = f.max(0.0);
            contact.normal_force = *f;
            if *f > 0.0 {
                listed.add(contact.pair.key());
            }
        }
        self.problem.tangential.clear();
        if surface.has_friction() {
            for (k, contact) in self.list.iter_mut().enumerate() {
                if contact.normal_force > surface.critical_load {
                    contact.slip_resistance = resistance.slip_resistance(&contact.pair);
                    contact.friction_acts = true;
                    self.problem.tangential.push(problem::Tangential {
                        contact: k,
                        row: contact.slip_row(),
                        shift: contact.background[1],
                        compliance: 0.0,
                        acts: true,
                        ceased: false,
                    });
                }
            }
        }
        self.measure_slip(resistance, forces)?;
        for (m, row) in self.problem.tangential.iter().enumerate() {
            let contact = &mut self.list[row.contact];
            let bound = roll_slip::bound(surface.friction, contact.normal_force);
            let (slip, resistance) = (self.solver.forces.slip[m], contact.slip_resistance);
            let (force, rolls) = roll_slip::force(slip, resistance, bound);
            contact.tangential_force = force;
            contact.state = if rolls {
                ContactState::Rolling
            } else {
                ContactState::Slipping
            };
            self.solver.forces.tangential[m] = contact.tangential_force;
        }
        self.move_under_forces(resistance, forces, velocities)?;
        Ok(Quality {
            residual,
            systems: 1,
            ..Quality::default()
        })
    }
}
