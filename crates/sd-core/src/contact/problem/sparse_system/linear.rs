//! Products with the linear system of an active set and with its preconditioner.

use super::VELOCITY_WEIGHT;
use super::active::ActiveTerms;
use crate::contact::problem::statement::{Problem, States};
use crate::hydrodynamics::resistance::{Fluid, Motion, PairwiseResistance, side_by_side_mut};
use crate::linalg::dense::add_scaled;
use crate::threads;
use std::ops::Range;

/// The data that define the linear system.
pub(super) struct Linear<'a, S: Fluid> {
    pub(super) resistance: &'a PairwiseResistance<S>,
    pub(super) problem: &'a Problem<S>,
    pub(super) states: &'a States<S>,
    pub(super) active: &'a ActiveTerms<S>,
}

/// Workspace for v and v_N, interleaved, and for the forces of both.
#[derive(Default)]
pub(super) struct BothMotions<S: Fluid> {
    velocities: Vec<Motion<S, 2>>,
    forces: Vec<Motion<S, 2>>,
    /// Workspace of products.
    work: Vec<Motion<S, 2>>,
    pub(super) work_of_one: Vec<Motion<S, 1>>,
}

/// Fewest spheres whose velocities a thread copies.
const LEAST_SPHERES: usize = 1500;

impl<S: Fluid> BothMotions<S> {
    /// Computes R v and R v_N.
    pub(super) fn multiply(&mut self, resistance: &PairwiseResistance<S>, v: &[f64], v_n: &[f64]) {
        for both in [&mut self.velocities, &mut self.forces] {
            both.resize(resistance.spheres(), S::each([0.0; 2]));
        }
        let (v, v_n) = (S::by_sphere(v), S::by_sphere(v_n));
        threads::divide(&mut self.velocities, LEAST_SPHERES, &|first, both| {
            let parts = v[first..].iter().zip(&v_n[first..]);
            for (both, (v, v_n)) in both.iter_mut().zip(parts) {
                for k in 0..S::MODES {
                    both[k] = [v[k], v_n[k]];
                }
            }
        });
        let forces = &mut self.forces;
        resistance.multiply(&self.velocities, forces, &mut self.work);
    }

    /// Copies the forces to vectors `[3N]`.
    pub(super) fn read(&self, y: &mut [f64], y_n: &mut [f64]) {
        let parts = S::by_sphere_mut(y).iter_mut().zip(S::by_sphere_mut(y_n));
        for ((y, y_n), both) in parts.zip(&self.forces) {
            for k in 0..S::MODES {
                [y[k], y_n[k]] = both[k];
            }
        }
    }
}

impl<S: Fluid> Linear<'_, S> {
    /// Where v, v_N, f and t are in a vector of unknowns.
    fn ranges(&self) -> [Range<usize>; 4] {
        let n = S::MODES * self.resistance.spheres();
        let flow = if self.problem.uses_frictionless_slip {
            2 * n
        } else {
            n
        };
        let contacts = flow + self.problem.normal.len();
        let end = contacts + self.problem.friction_rows();
        [0..n, n..flow, flow..contacts, contacts..end]
    }

    pub(super) fn size(&self) -> usize {
        self.ranges()[3].end
    }

    /// Splits a vector into v, v_N, f and t.
    pub(super) fn split<'x>(&self, x: &'x [f64]) -> [&'x [f64]; 4] {
        self.ranges().map(|range| &x[range])
    }

    pub(super) fn split_mut<'x>(&self, x: &'x mut [f64]) -> [&'x mut [f64]; 4] {
        let parts = x.get_disjoint_mut(self.ranges());
        parts.unwrap_or_else(|_| unreachable!("successive ranges of a vector of this size"))
    }

    /// `y = A x`, the linear system with its velocity rows multiplied by [`VELOCITY_WEIGHT`].
    pub(super) fn apply(&self, x: &[f64], y: &mut [f64], both: &mut BothMotions<S>) {
        let [v, v_n, _, _] = self.split(x);
        let [y_v, y_n, y_f, y_t] = self.split_mut(y);
        if self.problem.uses_frictionless_slip {
            both.multiply(self.resistance, v, v_n);
            self.add_contacts(x, &mut both.forces, y_f, y_t);
            both.read(y_v, y_n);
        } else {
            self.resistance.apply(v, y_v, &mut both.work_of_one);
            self.add_contacts(x, side_by_side_mut::<S>(y_v), y_f, y_t);
        }
    }

    /// Sets the part of `A` that multiplies the rate of dilation.
    pub(super) fn set_dilation_column(&self, column: &mut Vec<f64>) {
        column.clear();
        column.resize(self.size(), 0.0);
        let dilation = &self.problem.dilation;
        let [.., f, t] = self.split_mut(column);
        for closed in &self.active.closed {
            let k = closed.index as usize;
            f[k] = VELOCITY_WEIGHT * dilation.openings[k];
        }
        if !dilation.shiftings.is_empty() {
            for sticking in &self.active.sticking {
                t[sticking.index] = VELOCITY_WEIGHT * sticking.shifting(dilation);
            }
        }
    }

    /// The work `Σ c f − Σ s t` of forces in a dilation.
    fn dilation_work(&self, x: &[f64]) -> f64 {
        let dilation = &self.problem.dilation;
        let [_, _, f, t] = self.split(x);
        let forces = &x[x.len() - f.len() - t.len()..];
        let closed = self
            .active
            .closed
            .iter()
            .map(|closed| closed.index as usize);
        let normal: f64 = closed.map(|k| dilation.openings[k] * f[k]).sum();
        let terms = self.active.force_terms.iter();
        let friction = terms.map(|term| term.shifting * term.factor * forces[term.force]);
        normal - friction.sum::<f64>()
    }

    /// Adds the dilation to what the preconditioner makes of a residual, which it leaves out: one
    /// more unknown, whose column of `A` it takes to `response`.
    pub(super) fn dilate(&self, response: &[f64], x: &mut [f64]) {
        let resistance = self.problem.dilation.mobility.recip();
        let rate = self.dilation_work(x) / (resistance + self.dilation_work(response));
        if rate.is_finite() {
            add_scaled(x, response, -rate);
        }
    }

    /// Adds the contributions of the contacts and their forces to `y = A x`. Normal forces act in
    /// all L motions, friction only in the first.
    fn add_contacts<const L: usize>(
        &self,
        x: &[f64],
        y: &mut [Motion<S, L>],
        y_f: &mut [f64],
        y_t: &mut [f64],
    ) {
        let [v, v_n, f, t] = self.split(x);
        let forces = &x[x.len() - f.len() - t.len()..];
        y_f.fill(0.0);
        for closed in &self.active.closed {
            let (k, row) = (closed.index as usize, closed.row());
            row.add_to_first::<L, L>(-f[k], y);
            y_f[k] = VELOCITY_WEIGHT * (row.read(v) + closed.compliance * f[k]);
        }
        let dilation = &self.problem.dilation;
        let [mut rate, mut frictionless] = [0.0; 2];
        if !dilation.openings.is_empty() {
            let closed = || {
                self.active
                    .closed
                    .iter()
                    .map(|closed| closed.index as usize)
            };
            let work: f64 = closed().map(|k| dilation.openings[k] * f[k]).sum();
            frictionless = dilation.mobility * work;
            let terms = self.active.force_terms.iter();
            let by_friction = terms.map(|term| term.shifting * term.factor * forces[term.force]);
            rate = frictionless - dilation.mobility * by_friction.sum::<f64>();
            for k in closed() {
                y_f[k] += VELOCITY_WEIGHT * dilation.openings[k] * rate;
            }
        }
        for term in &self.active.force_terms {
            let force = term.factor * forces[term.force];
            term.row.add_to_first::<1, L>(force, y);
        }
        y_t.fill(0.0);
        let (flow, rate) = if self.problem.uses_frictionless_slip {
            (v_n, frictionless)
        } else {
            (v, rate)
        };
        for sticking in &self.active.sticking {
            let m = sticking.index;
            let mut slip = sticking.row.read(flow) - sticking.compliance * t[m];
            if !dilation.shiftings.is_empty() {
                slip += sticking.shifting(dilation) * rate;
            }
            y_t[m] = VELOCITY_WEIGHT * slip;
        }
    }
}
