//! Terms of the linear system for a given active set, listed once for all matrix-vector products.
//!
//! About a third of the candidates and rows is absent from the system. Testing each of them in
//! every product would cost more than the arithmetic, as the branches are unpredictable.

use crate::contact::problem::statement::{Dilation, FrictionState, Problem, States};
use crate::contact::row::Row;
use crate::space::Space;

/// A closed candidate, stored compactly, as every product reads all of them: its row consists of
/// the components of the line of centres.
pub(super) struct ClosedContact<S: Space> {
    pub(super) index: u32,
    spheres: [u32; 2],
    pub(super) compliance: f64,
    normal: S::Vector,
}

/// A sticking component, or the one across the direction of a slide, which sticks with a
/// compliance.
pub(super) struct StickingRow<S: Space> {
    /// Number of the component among those of all friction forces.
    pub(super) index: usize,
    pub(super) contact: usize,
    pub(super) compliance: f64,
    pub(super) shift: f64,
    pub(super) row: Row<S>,
    /// Its friction force, and the direction by its components in the rows of that.
    friction: usize,
    direction: S::PerTangent<f64>,
}

/// A row whose force is a factor times an element of (f, t): of its own force if it sticks, of its
/// normal force if it slips.
pub(super) struct ForceTerm<S: Space> {
    pub(super) force: usize,
    pub(super) factor: f64,
    pub(super) row: Row<S>,
    /// By how much the row slips per rate of dilation.
    pub(super) shifting: f64,
}

/// Terms of the linear system.
#[derive(Default)]
pub(super) struct ActiveTerms<S: Space> {
    pub(super) closed: Vec<ClosedContact<S>>,
    pub(super) sticking: Vec<StickingRow<S>>,
    pub(super) force_terms: Vec<ForceTerm<S>>,
}

impl<S: Space> StickingRow<S> {
    /// Its force, from all friction forces.
    pub(super) fn force(&self, forces: &[S::PerTangent<f64>]) -> f64 {
        component::<S>(&self.direction, &forces[self.friction])
    }

    /// By how much it slips per rate of dilation.
    pub(super) fn shifting(&self, dilation: &Dilation) -> f64 {
        component::<S>(&self.direction, &dilation.shifting::<S>(self.friction))
    }

    /// Adds a force to it.
    pub(super) fn add(&self, force: f64, forces: &mut [S::PerTangent<f64>]) {
        let force_vector = forces[self.friction].as_mut().iter_mut();
        for (x, direction) in force_vector.zip(self.direction.as_ref()) {
            *x += direction * force;
        }
    }
}

impl<S: Space> ClosedContact<S> {
    #[inline(always)]
    pub(super) fn row(&self) -> Row<S> {
        Row::normal(self.spheres.map(|sphere| sphere as usize), &self.normal)
    }
}

impl<S: Space> ActiveTerms<S> {
    /// Lists the terms of an active set.
    pub(super) fn list(&mut self, problem: &Problem<S>, states: &States<S>) {
        self.closed.clear();
        for (k, entry) in problem.normal.iter().enumerate() {
            if states.closed[k] {
                self.closed.push(ClosedContact {
                    index: number(k),
                    spheres: entry.row.spheres.map(number),
                    compliance: entry.compliance,
                    normal: S::translation(entry.row.sphere_weights()[1]),
                });
            }
        }
        self.sticking.clear();
        self.force_terms.clear();
        let contacts = problem.normal.len();
        for (friction, (entry, state)) in problem.friction.iter().zip(&states.friction).enumerate()
        {
            let contact = entry.contact;
            let shifting = problem.dilation.shifting::<S>(friction);
            let mut compliance = entry.compliance;
            if let FrictionState::Slip(slide) = state {
                compliance += slide.compliance;
                if states.closed[contact] && entry.coefficient != 0.0 {
                    self.force_terms.push(ForceTerm {
                        force: contact,
                        factor: entry.coefficient,
                        row: entry.row_along(&slide.direction),
                        shifting: component::<S>(&slide.direction, &shifting),
                    });
                }
            }
            for d in (0..S::TANGENTS).filter(|&d| state.sticks(d) && compliance.is_finite()) {
                let (direction, row, shift) = if let FrictionState::Slip(slide) = state {
                    let axis = slide.axis(d);
                    let shift = component::<S>(&axis, &entry.shift);
                    (axis, entry.row_along(&axis), shift)
                } else {
                    let mut axis = S::each_tangent(0.0);
                    axis[d] = 1.0;
                    (axis, entry.rows[d], entry.shift[d])
                };
                let index = S::TANGENTS * friction + d;
                self.force_terms.push(ForceTerm {
                    force: contacts + index,
                    factor: 1.0,
                    row,
                    shifting: component::<S>(&direction, &shifting),
                });
                self.sticking.push(StickingRow {
                    index,
                    contact,
                    compliance,
                    shift,
                    row,
                    friction,
                    direction,
                });
            }
        }
    }
}

/// Component of a vector along a direction.
fn component<S: Space>(direction: &S::PerTangent<f64>, vector: &S::PerTangent<f64>) -> f64 {
    let mut sum = direction[0] * vector[0];
    for k in 1..S::TANGENTS {
        sum += direction[k] * vector[k];
    }
    sum
}

/// There are fewer than 2^32 spheres and candidates.
#[expect(clippy::cast_possible_truncation, reason = "they are fewer")]
fn number(value: usize) -> u32 {
    value as u32
}
