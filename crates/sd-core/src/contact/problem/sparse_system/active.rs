//! Terms of the linear system for a given active set, listed once for all matrix-vector products.
//!
//! About a third of the candidates and rows is absent from the system. Testing each of them in
//! every product would cost more than the arithmetic, as the branches are unpredictable.

use crate::contact::problem::statement::{Problem, States};
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

/// A sticking row, or the row across the direction of a slide, which sticks with a compliance.
pub(super) struct StickingRow<S: Space> {
    pub(super) index: usize,
    pub(super) compliance: f64,
    pub(super) shift: f64,
    pub(super) row: Row<S>,
    /// First row of its friction vector, and the components of this row in the rows of the vector.
    first: usize,
    components: S::PerTangent<f64>,
}

/// A row whose force is a factor times an element of (f, t): of its own force if it sticks, of its
/// normal force if it slips.
pub(super) struct ForceTerm<S: Space> {
    pub(super) force: usize,
    pub(super) factor: f64,
    pub(super) row: Row<S>,
}

/// Terms of the linear system.
#[derive(Default)]
pub(super) struct ActiveTerms<S: Space> {
    pub(super) closed: Vec<ClosedContact<S>>,
    pub(super) sticking: Vec<StickingRow<S>>,
    pub(super) force_terms: Vec<ForceTerm<S>>,
}

impl<S: Space> StickingRow<S> {
    /// Its force, from the forces of all rows.
    pub(super) fn force(&self, forces: &[f64]) -> f64 {
        let mut sum = self.components[0] * forces[self.first];
        for k in 1..S::TANGENTS {
            sum += self.components[k] * forces[self.first + k];
        }
        sum
    }

    /// Adds a force to it.
    pub(super) fn add(&self, force: f64, forces: &mut [f64]) {
        for k in 0..S::TANGENTS {
            forces[self.first + k] += self.components[k] * force;
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
    pub(super) fn list(&mut self, problem: &Problem<S>, states: &States) {
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
        for (m, entry) in problem.tangential.iter().enumerate() {
            let (first, k) = (m - m % S::TANGENTS, m % S::TANGENTS);
            let factor = slope(problem, states, m);
            let mut components = S::each_tangent(0.0);
            components[k] = 1.0;
            let mut sticking = StickingRow {
                index: m,
                compliance: entry.compliance,
                shift: entry.shift,
                row: entry.row,
                first,
                components,
            };
            if let Some(slide) = states.slide(m) {
                let rotated = problem.rotated_row(slide, m);
                (sticking.row, sticking.shift) = (rotated.row, rotated.shift);
                sticking.compliance += slide.compliance;
                components.as_mut().copy_from_slice(&rotated.components);
                sticking.components = components;
            }
            if factor != 0.0 {
                self.force_terms.push(ForceTerm {
                    force: entry.contact,
                    factor,
                    row: sticking.row,
                });
            } else if states.sticks(m) && sticking.compliance.is_finite() {
                self.force_terms.push(ForceTerm {
                    force: contacts + m,
                    factor: 1.0,
                    row: sticking.row,
                });
                self.sticking.push(sticking);
            }
        }
    }
}

/// Ratio of friction to load of a slipping row of a closed candidate; 0 for others.
pub(super) fn slope<S: Space>(problem: &Problem<S>, states: &States, m: usize) -> f64 {
    let sign = states.sign(m);
    if sign == 0.0 || !states.closed[problem.tangential[m].contact] {
        0.0
    } else {
        sign * problem.tangential[m].coefficient
    }
}

/// There are fewer than 2^32 spheres and candidates.
#[expect(clippy::cast_possible_truncation, reason = "they are fewer")]
fn number(value: usize) -> u32 {
    value as u32
}
