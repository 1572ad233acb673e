//! Conversion of the laws of the candidates to coefficients of the contact problem, and of its
//! solution to contact forces and states.

use super::super::contact_pair::ContactState;
use super::super::laws::{COMPLIANCE, Laws, Overlap};
use super::super::memory::ContactMemory;
use super::super::problem::statement::{self, Forces, FrictionState, Problem};
use super::super::row::Row;
use super::candidates::overlap_of;
use super::{ContactSolver, ImposedPressure, SolvePass, StageInput};
use crate::hydrodynamics::resistance::Fluid;
use crate::law::FrictionConstraint;
use crate::model::PressureKind;

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
        let has_friction = laws.surface.has_friction();
        self.problem.uses_frictionless_slip =
            has_friction && laws.tangential.constraint() == FrictionConstraint::IsolatedSlip;
        let updates = matches!(pass, SolvePass::First | SolvePass::Repeat) && !laws.is_smooth();
        self.problem.critical_load = updates.then_some(laws.surface.critical_load);
        self.problem.friction.clear();
        self.problem.normal.clear();
        self.overlaps.clear();
        self.solver.forces.normal.clear();
        self.solver.forces.tangential.clear();
        for contact in &self.list {
            let mut overlap = overlap_of(input, contact);
            overlap.reference = laws
                .normal
                .first_reference(overlap.now, contact.normal_force);
            let [bias, compliance] = laws.normal.entry(&overlap, &input.span);
            self.overlaps.push(overlap);
            self.problem.normal.push(statement::Normal {
                row: contact.normal_row(),
                bias,
                compliance,
            });
            self.solver.forces.normal.push(contact.normal_force);
        }
        self.set_up_dilation();
        if has_friction {
            for k in 0..self.list.len() {
                self.add_friction(input, memory, pass, k);
            }
        }
        self.solver.infer_states(&self.problem);
    }

    /// Sets up the rate at which the cell dilates under an imposed pressure.
    fn set_up_dilation(&mut self) {
        let dilation = &mut self.problem.dilation;
        dilation.openings.clear();
        dilation.shiftings.clear();
        (dilation.mobility, dilation.free) = (0.0, 0.0);
        let Some(ImposedPressure {
            pressure,
            volume,
            resistance,
            kind,
        }) = self.pressure
        else {
            return;
        };
        let each = self.list.iter();
        dilation.openings.extend(each.map(|c| c.opening(kind)));
        let [work, slope] = self.distant_work;
        dilation.mobility = (volume * resistance + slope).recip();
        dilation.free = dilation.mobility * (work - volume * pressure);
    }

    /// Adds the friction forces of one candidate.
    fn add_friction(
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
        let ahead = laws.tangential_stiffness * laws.spring_time(&input.span);
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
        let dilates = self.pressure.map_or_else(PressureKind::default, |p| p.kind);
        let mut shifting = contact.shifting(dilates, &contact.directions());
        let mut add = |rows: S::PerTangent<Row<S>>,
                       [shift, force]: [S::Tangent; 2],
                       compliance: f64,
                       coefficient: f64| {
            let directions = contact.directions();
            if dilates == PressureKind::Gradient {
                let shiftings = &mut self.problem.dilation.shiftings;
                shiftings.extend_from_slice(shifting.as_ref());
                // Further forces of the contact act on rotations, which the cell does not change.
                shifting = S::each_tangent(0.0);
            }
            self.problem.friction.push(statement::Friction {
                contact: k,
                rows,
                shift: S::along(&directions, &shift),
                compliance,
                coefficient,
                intercept: laws.intercept(coefficient),
                active,
                was_deactivated: false,
            });
            let force = S::along(&directions, &force);
            self.solver.forces.tangential.push(force);
        };
        let ([friction, rolling], slip) = (laws.friction_coefficients(), contact.slip_rows());
        let initial = [shift, contact.tangential_force];
        add(slip, initial, compliance, friction);
        let zero = S::Tangent::default();
        if laws.tangential.constraint() == FrictionConstraint::SlipAndRotation {
            let initial = [contact.background_spin, zero];
            add(contact.rotation_rows(), initial, compliance, friction);
        }
        if rolling > 0.0 {
            let (mut shift, mut compliance) = (contact.background_rolling(), COMPLIANCE);
            if laws.tangential.has_spring() {
                compliance += ahead.recip();
                shift += memory.rolling_springs.base(contact, kind) / ahead;
            }
            let initial = [shift, contact.rolling_force];
            add(contact.rolling_rows(), initial, compliance, rolling);
        }
    }

    /// Stores which contacts have active friction; returns whether that set changed.
    pub(super) fn store_activation(&mut self) -> bool {
        let mut changed = false;
        let mut friction = self.problem.friction.iter().peekable();
        for (k, contact) in self.list.iter_mut().enumerate() {
            let mut acts = false;
            while let Some(entry) = friction.next_if(|entry| entry.contact == k) {
                acts = entry.active;
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
        let solver = &self.solver;
        let found = solver.forces.tangential.iter().zip(&solver.states.friction);
        for (entry, (components, state)) in self.problem.friction.iter().zip(found) {
            let first = before != Some(entry.contact);
            before = Some(entry.contact);
            let contact = &mut self.list[entry.contact];
            let force = S::tangent(&contact.directions(), components);
            // The second force of a contact is that on relative rotation, or rolling friction.
            if first {
                contact.tangential_force = force;
                contact.state = match state {
                    FrictionState::Inactive => ContactState::Frictionless,
                    FrictionState::Stick => ContactState::Sticking,
                    FrictionState::Slip(_) => ContactState::Slipping,
                };
            } else if laws.rolling_friction > 0.0 {
                contact.rolling_force = force;
                contact.rolling_sticks = matches!(state, FrictionState::Stick);
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
    forces: &Forces<S>,
    tolerance: f64,
) -> usize {
    let law = &input.laws.normal;
    if law.is_rigid() {
        return 0;
    }
    let largest = forces
        .normal
        .iter()
        .fold(1.0_f64, |largest, f| largest.max(*f));
    let accepted = LINEARISATION_TOLERANCE.max(tolerance) * largest;
    let mut refined_count = 0;
    for (k, (entry, overlap)) in problem.normal.iter_mut().zip(overlaps).enumerate() {
        let f = forces.normal[k];
        let velocity = forces.slack[k] - entry.bias - entry.compliance * f + overlap.background;
        if let Some(refined) = law.refine(overlap, [velocity, f.max(0.0)], &input.span, accepted) {
            [entry.bias, entry.compliance] = refined;
            refined_count += 1;
        }
    }
    refined_count
}
