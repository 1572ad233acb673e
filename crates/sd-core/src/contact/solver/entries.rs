//! What the laws of the candidates come down to: entries of the contact problem, and what its solution says of them.

use super::super::laws::{COMPLIANCE, Overlap};
use super::super::pair::{Contact, ContactState};
use super::super::row::Row;
use super::super::solve::newton::Deciding;
use super::super::solve::problem::{self, Forces, Grip, Problem};
use super::candidates::overlap_of;
use super::{ContactMemory, ContactSolver, Posed};
use crate::law::Halt;

/// Distance of a force from a curved law, over the largest force or 1, at which linearisations end.
const LINEARISED: f64 = 1e-9;

impl ContactSolver {
    /// The normal entries of the candidates at hand.
    pub(super) fn pose(&mut self, posed: &Posed<'_>) {
        let laws = posed.laws;
        let held = posed.span.takes_back_at_once();
        let has_friction = laws.surface.has_friction();
        self.problem.friction = if has_friction { laws.friction() } else { 0.0 };
        self.problem.offset = laws.offset();
        self.problem.isolated = laws.reads_isolated_motion() && has_friction;
        self.problem.tangential.clear();
        self.problem.normal.clear();
        self.overlaps.clear();
        for contact in &self.list {
            let mut overlap = overlap_of(posed, contact);
            overlap.reference = laws
                .normal
                .first_reference(overlap.now, contact.normal_force);
            let [bias, compliance] = laws.normal.entry(&overlap, posed.span.time, held);
            self.overlaps.push(overlap);
            self.problem.normal.push(problem::Normal {
                row: contact.normal_row(),
                bias,
                compliance,
            });
        }
    }

    /// The tangential rows of the candidates that `wanted` names.
    pub(super) fn add_rows(
        &mut self,
        posed: &Posed<'_>,
        memory: &ContactMemory,
        deciding: Deciding,
        wanted: impl Fn(usize, &Contact) -> bool,
    ) {
        let rows = &mut self.problem.tangential;
        rows.clear();
        for (k, contact) in self.list.iter_mut().enumerate() {
            if !wanted(k, contact) {
                continue;
            }
            if contact.slip_resistance == 0.0 {
                contact.slip_resistance = posed.resistance.slip_resistance(&contact.pair);
            }
            let mut row = problem::Tangential {
                contact: k,
                row: contact.slip_row(),
                shift: contact.background[1],
                compliance: COMPLIANCE,
                acts: false,
                ceased: false,
            };
            match posed.laws.tangential.halts() {
                Halt::IsolatedSlip => row.compliance = contact.slip_resistance.recip(),
                Halt::SpringSlip => {
                    let (springs, phase) = (&memory.springs, posed.span.phase);
                    let base = self.stretches.base(contact, springs, phase);
                    let ahead = posed.laws.tangential_stiffness * posed.span.time;
                    row.compliance += ahead.recip();
                    row.shift += base / ahead;
                }
                Halt::Slip => {}
                Halt::SlipAndRotation => {
                    rows.push(row);
                    // The background turns both spheres alike.
                    row.shift = 0.0;
                    row.row = Row::spin([contact.pair.i, contact.pair.j]);
                }
            }
            rows.push(row);
        }
        let load = posed.laws.surface.critical_load;
        for row in rows {
            let contact = &self.list[row.contact];
            let loaded = contact.normal_force > load;
            row.acts = posed.laws.is_smooth()
                || match deciding {
                    Deciding::Late | Deciding::Early => loaded,
                    Deciding::Held | Deciding::Again => contact.friction_acts,
                };
            row.ceased = deciding == Deciding::Again && row.acts && !loaded;
        }
    }

    /// Remembers on which contacts friction acts; whether that has changed.
    pub(super) fn keep_activity(&mut self) -> bool {
        let mut changed = false;
        let mut rows = self.problem.tangential.iter().peekable();
        for (k, contact) in self.list.iter_mut().enumerate() {
            let mut acts = false;
            while let Some(row) = rows.next_if(|row| row.contact == k) {
                acts = row.acts;
            }
            changed |= acts != contact.friction_acts;
            contact.friction_acts = acts;
        }
        changed
    }

    /// Tangential forces to begin with, and the states that all forces show.
    pub(super) fn take_rows(&mut self) {
        let (list, rows) = (&self.list, &self.problem.tangential);
        let forces = &mut self.solver.forces;
        forces.tangential.clear();
        let mut before = None;
        forces.tangential.extend(rows.iter().map(|row| {
            let first = before != Some(row.contact);
            before = Some(row.contact);
            if first {
                list[row.contact].tangential_force
            } else {
                0.0
            }
        }));
        self.solver.read_states(&self.problem);
    }

    /// Puts the forces found, and what their contacts do, into `list`.
    pub(super) fn keep_forces(&mut self) {
        for (contact, &f) in self.list.iter_mut().zip(&self.solver.forces.normal) {
            contact.normal_force = f;
            contact.tangential_force = 0.0;
            contact.state = ContactState::Frictionless;
        }
        let mut before = None;
        for (m, row) in self.problem.tangential.iter().enumerate() {
            let first = before != Some(row.contact);
            before = Some(row.contact);
            // The second row of a contact is that of its spin.
            if first {
                let contact = &mut self.list[row.contact];
                contact.tangential_force = self.solver.forces.tangential[m];
                contact.state = match self.solver.states.grip[m] {
                    Grip::Off => ContactState::Frictionless,
                    Grip::Stick => ContactState::Rolling,
                    Grip::Plus | Grip::Minus => ContactState::Slipping,
                };
            }
        }
    }
}

/// Linearises curved laws about where the contacts are now, where they are not near enough; how many were not.
pub(super) fn refine(
    posed: &Posed<'_>,
    problem: &mut Problem,
    overlaps: &mut [Overlap],
    forces: &Forces,
    enough: f64,
) -> usize {
    let law = &posed.laws.normal;
    if law.is_rigid() {
        return 0;
    }
    let time = posed.span.time;
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
