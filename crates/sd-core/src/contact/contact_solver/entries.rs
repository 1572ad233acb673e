//! Conversion of the laws of the candidates to coefficients of the contact problem, and of its
//! solution to contact forces and states.

use super::super::contact_pair::ContactState;
use super::super::laws::{COMPLIANCE, Laws, Overlap};
use super::super::memory::ContactMemory;
use super::super::problem::statement::{self, Forces, FrictionState, Problem};
use super::super::row::Row;
use super::candidates::overlap_of;
use super::{ContactSolver, SolvePass, StageInput};
use crate::hydrodynamics::resistance::Fluid;
use crate::law::FrictionConstraint;

/// Largest accepted difference between a force and its nonlinear law, over the largest force or 1.
const LINEARISATION_TOLERANCE: f64 = 1e-9;

impl<S: Fluid> ContactSolver<S> {
    /// Sets up the coefficients of the current candidates and the initial forces.
    pub(super) fn set_up_problem(
        &mut self,
        input: &StageInput<'_, S>,
        memory: &ContactMemory<S>,
        pass: SolvePass,
    ) {
        let laws = input.laws;
        let immediately = input.span.corrects_overlap_immediately();
        let has_friction = laws.surface.has_friction();
        self.problem.uses_frictionless_slip = laws.uses_frictionless_slip() && has_friction;
        self.problem.tangential.clear();
        self.problem.normal.clear();
        self.overlaps.clear();
        self.solver.forces.clear();
        for contact in &self.list {
            let mut overlap = overlap_of(input, contact);
            overlap.reference = laws
                .normal
                .first_reference(overlap.now, contact.normal_force);
            let [bias, compliance] = laws.normal.entry(&overlap, input.span.time, immediately);
            self.overlaps.push(overlap);
            self.problem.normal.push(statement::Normal {
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
        self.solver.infer_states(&self.problem);
    }

    /// Adds the friction rows of one candidate.
    fn add_rows(
        &mut self,
        input: &StageInput<'_, S>,
        memory: &ContactMemory<S>,
        pass: SolvePass,
        k: usize,
    ) {
        let (laws, contact) = (input.laws, &mut self.list[k]);
        let load = laws.surface.critical_load;
        let active = laws.is_smooth()
            || match pass {
                SolvePass::First | SolvePass::Repeat => contact.normal_force > load,
                SolvePass::FixedActivation | SolvePass::FixedBounds => contact.friction_acts,
            };
        // A tangential spring contributes to the compliance of its rows, and its force without the
        // implicit term contributes to their shifts.
        let ahead = laws.tangential_stiffness * input.span.time;
        let kind = input.span.kind;
        let mut compliance = COMPLIANCE;
        let mut shift = contact.background_slip;
        match laws.tangential.constraint() {
            FrictionConstraint::IsolatedSlip => {
                if contact.slip_resistance == 0.0 {
                    contact.slip_resistance = input.resistance.slip_resistance(&contact.pair);
                }
                compliance = contact.slip_resistance.recip();
            }
            FrictionConstraint::SpringSlip => {
                compliance += ahead.recip();
                shift += memory.springs.base(contact, kind) / ahead;
            }
            FrictionConstraint::Slip | FrictionConstraint::SlipAndRotation => {}
        }
        let contact = &self.list[k];
        let directions = contact.directions();
        let mut add = |rows: &dyn Fn(&S::Vector) -> Row<S>,
                       [shift, force]: [S::Tangent; 2],
                       compliance: f64,
                       (coefficient, intercept): (f64, f64)| {
            let shifts = S::along(&directions, &shift);
            let forces = S::along(&directions, &force);
            for d in 0..S::TANGENTS {
                self.problem.tangential.push(statement::Tangential {
                    contact: k,
                    row: rows(&directions[d]),
                    shift: shifts[d],
                    compliance,
                    coefficient,
                    intercept,
                    active,
                    was_deactivated: false,
                });
                self.solver.forces.tangential.push(forces[d]);
            }
        };
        let bound = laws.friction_bound();
        let slip = |d: &S::Vector| contact.slip_row(d);
        add(&slip, [shift, contact.tangential_force], compliance, bound);
        let zero = S::Tangent::default();
        if laws.tangential.constraint() == FrictionConstraint::SlipAndRotation {
            // The background rotates both spheres equally.
            let spin = |d: &S::Vector| contact.spin_row(d);
            add(&spin, [zero; 2], compliance, bound);
        }
        if laws.rolling_friction > 0.0 {
            let (mut shift, mut compliance) = (zero, COMPLIANCE);
            if laws.tangential.has_spring() {
                compliance += ahead.recip();
                shift = memory.rolling_springs.base(contact, kind) / ahead;
            }
            let rolling = |d: &S::Vector| contact.rolling_row(d);
            let initial = [shift, contact.rolling_force];
            add(&rolling, initial, compliance, laws.rolling_bound());
        }
    }

    /// Stores which contacts have active friction; returns whether that set changed.
    pub(super) fn store_activation(&mut self) -> bool {
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

    /// Stores the forces of the solution and the friction states in `list`.
    pub(super) fn store_forces(&mut self, laws: &Laws) {
        for (contact, &f) in self.list.iter_mut().zip(&self.solver.forces.normal) {
            contact.normal_force = f;
            contact.tangential_force = S::Tangent::default();
            contact.state = ContactState::Frictionless;
            (contact.rolling_force, contact.rolling_sticks) = (S::Tangent::default(), false);
        }
        let mut before = None;
        let slips = S::by_slip(&self.solver.forces.tangential);
        for (m, components) in slips.iter().enumerate() {
            let row = &self.problem.tangential[S::TANGENTS * m];
            let state = self.solver.states.friction[S::TANGENTS * m];
            let first = before != Some(row.contact);
            before = Some(row.contact);
            let contact = &mut self.list[row.contact];
            let force = S::tangent(&contact.directions(), components);
            // The second vector of a contact is the relative rotation, or rolling friction.
            if first {
                contact.tangential_force = force;
                contact.state = match state {
                    FrictionState::Inactive => ContactState::Frictionless,
                    FrictionState::Stick => ContactState::Sticking,
                    FrictionState::SlipPositive | FrictionState::SlipNegative => {
                        ContactState::Slipping
                    }
                };
            } else if laws.rolling_friction > 0.0 {
                contact.rolling_force = force;
                contact.rolling_sticks = state == FrictionState::Stick;
            }
        }
    }
}

/// Linearises nonlinear laws again about the current overlaps where the forces do not satisfy them;
/// returns their number.
pub(super) fn refine<S: Fluid>(
    input: &StageInput<'_, S>,
    problem: &mut Problem<S>,
    overlaps: &mut [Overlap],
    forces: &Forces,
    tolerance: f64,
) -> usize {
    let law = &input.laws.normal;
    if law.is_rigid() {
        return 0;
    }
    let time = input.span.time;
    let largest = forces
        .normal
        .iter()
        .fold(1.0_f64, |largest, f| largest.max(*f));
    let accepted = LINEARISATION_TOLERANCE.max(tolerance) * largest;
    let mut refined_count = 0;
    for (k, (entry, overlap)) in problem.normal.iter_mut().zip(overlaps).enumerate() {
        let f = forces.normal[k];
        let velocity = forces.slack[k] - entry.bias - entry.compliance * f + overlap.background;
        if let Some(refined) = law.refine(overlap, [velocity, f.max(0.0)], time, accepted) {
            [entry.bias, entry.compliance] = refined;
            refined_count += 1;
        }
    }
    refined_count
}
