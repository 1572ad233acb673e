//! What the laws of the candidates come down to: entries of the contact problem, and what its solution says of them.

use super::super::laws::{COMPLIANCE, Laws, Overlap};
use super::super::memory::ContactMemory;
use super::super::pair::ContactState;
use super::super::row::Row;
use super::super::solve::problem::{self, Forces, FrictionState, Problem};
use super::candidates::overlap_of;
use super::{ContactSolver, Pass, StageInput};
use crate::law::Halt;

/// Distance of a force from a curved law, over the largest force or 1, at which linearisations end.
const LINEARISED: f64 = 1e-9;

impl ContactSolver {
    /// The entries of the present candidates, and the forces to start from.
    pub(super) fn pose(&mut self, input: &StageInput<'_>, memory: &ContactMemory, pass: Pass) {
        let laws = input.laws;
        let held = input.span.takes_back_at_once();
        let has_friction = laws.surface.has_friction();
        self.problem.uses_frictionless_slip = laws.reads_isolated_motion() && has_friction;
        self.problem.tangential.clear();
        self.problem.normal.clear();
        self.overlaps.clear();
        self.solver.forces.clear();
        for contact in &self.list {
            let mut overlap = overlap_of(input, contact);
            overlap.reference = laws
                .normal
                .first_reference(overlap.now, contact.normal_force);
            let [bias, compliance] = laws.normal.entry(&overlap, input.span.time, held);
            self.overlaps.push(overlap);
            self.problem.normal.push(problem::Normal {
                row: contact.normal_row(),
                bias,
                compliance,
            });
            self.solver.forces.normal.push(contact.normal_force);
        }
        if has_friction {
            for k in 0..self.list.len() {
                self.add_rows(input, memory, pass, k);
            }
        }
        self.solver.read_states(&self.problem);
    }

    /// Adds the friction rows of one candidate.
    fn add_rows(&mut self, input: &StageInput<'_>, memory: &ContactMemory, pass: Pass, k: usize) {
        let (laws, contact) = (input.laws, &mut self.list[k]);
        let load = laws.surface.critical_load;
        let (coefficient, intercept) = laws.friction_bound();
        let mut row = problem::Tangential {
            contact: k,
            row: contact.slip_row(),
            shift: contact.background[1],
            compliance: COMPLIANCE,
            coefficient,
            intercept,
            active: laws.is_smooth()
                || match pass {
                    Pass::First | Pass::Again => contact.normal_force > load,
                    Pass::Held => contact.friction_acts,
                },
            was_deactivated: false,
        };
        // What a spring of friction adds to the compliance and the shift of its row, if its force is `base` before it looks ahead.
        let ahead = laws.tangential_stiffness * input.span.time;
        let spring = |base: f64| [ahead.recip(), base / ahead];
        let phase = input.span.phase;
        match laws.tangential.halts() {
            Halt::IsolatedSlip => {
                if contact.slip_resistance == 0.0 {
                    contact.slip_resistance = input.resistance.slip_resistance(&contact.pair);
                }
                row.compliance = contact.slip_resistance.recip();
            }
            Halt::SpringSlip => {
                let base = memory.springs.base(contact, phase);
                let [compliance, stretch] = spring(base);
                row.compliance += compliance;
                row.shift += stretch;
            }
            Halt::Slip | Halt::SlipAndRotation => {}
        }
        let forces = &mut self.solver.forces.tangential;
        self.problem.tangential.push(row);
        forces.push(contact.tangential_force);
        if laws.tangential.halts() == Halt::SlipAndRotation {
            // The background turns both spheres alike.
            row.shift = 0.0;
            row.row = Row::spin([contact.pair.i, contact.pair.j]);
            self.problem.tangential.push(row);
            forces.push(0.0);
        }
        if laws.rolling_friction > 0.0 {
            let (coefficient, intercept) = laws.rolling_bound();
            let [compliance, shift] = if laws.tangential.has_spring() {
                spring(memory.rolling_springs.base(contact, phase))
            } else {
                [0.0, 0.0]
            };
            self.problem.tangential.push(problem::Tangential {
                row: contact.rolling_row(),
                shift,
                compliance: COMPLIANCE + compliance,
                coefficient,
                intercept,
                ..row
            });
            forces.push(contact.rolling_force);
        }
    }

    /// Remembers on which contacts friction acts; whether that has changed.
    pub(super) fn keep_activation(&mut self) -> bool {
        let mut changed = false;
        let mut rows = self.problem.tangential.iter().peekable();
        for (k, contact) in self.list.iter_mut().enumerate() {
            let mut acts = false;
            while let Some(row) = rows.next_if(|row| row.contact == k) {
                acts = row.active;
            }
            changed |= acts != contact.friction_acts;
            contact.friction_acts = acts;
        }
        changed
    }

    /// Puts the forces found, and what their contacts do, into `list`.
    pub(super) fn keep_forces(&mut self, laws: &Laws) {
        for (contact, &f) in self.list.iter_mut().zip(&self.solver.forces.normal) {
            contact.normal_force = f;
            contact.tangential_force = 0.0;
            contact.state = ContactState::Frictionless;
            (contact.rolling_force, contact.rolling_halted) = (0.0, false);
        }
        let mut before = None;
        for (m, row) in self.problem.tangential.iter().enumerate() {
            let first = before != Some(row.contact);
            before = Some(row.contact);
            let contact = &mut self.list[row.contact];
            // The second row of a contact is that of its spin, or of rolling friction.
            if first {
                contact.tangential_force = self.solver.forces.tangential[m];
                contact.state = match self.solver.states.friction[m] {
                    FrictionState::Inactive => ContactState::Frictionless,
                    FrictionState::Stick => ContactState::Rolling,
                    FrictionState::SlipPositive | FrictionState::SlipNegative => {
                        ContactState::Slipping
                    }
                };
            } else if laws.rolling_friction > 0.0 {
                contact.rolling_force = self.solver.forces.tangential[m];
                contact.rolling_halted = self.solver.states.friction[m] == FrictionState::Stick;
            }
        }
    }
}

/// Linearises curved laws about where the contacts are now, where they are not near enough; how many were not.
pub(super) fn refine(
    input: &StageInput<'_>,
    problem: &mut Problem,
    overlaps: &mut [Overlap],
    forces: &Forces,
    enough: f64,
) -> usize {
    let law = &input.laws.normal;
    if law.is_rigid() {
        return 0;
    }
    let time = input.span.time;
    let largest = forces.normal.iter().fold(1.0_f64, |most, f| most.max(*f));
    let near = LINEARISED.max(enough) * largest;
    let mut found = 0;
    for (k, (entry, overlap)) in problem.normal.iter_mut().zip(overlaps).enumerate() {
        let f = forces.normal[k];
        let velocity = forces.slack[k] - entry.bias - entry.compliance * f + overlap.background;
        if let Some(refined) = law.refine(overlap, [velocity, f.max(0.0)], time, near) {
            [entry.bias, entry.compliance] = refined;
            found += 1;
        }
    }
    found
}
