//! The linear system of given states, as products with it and with its preconditioner.

use super::active::Active;
use super::{MIN_COMPLIANCE, WEIGHT};
use crate::contact::row::Row;
use crate::contact::solve::problem::{Problem, States};
use crate::hydrodynamics::resistance::{
    Fluid, Motion, NearMatrix, NearPattern, PairwiseResistance, side_by_side_mut,
};
use crate::space::Space;

/// The spheres, contacts and what they do: all that the linear system is made of.
pub(super) struct Linear<'a, S: Fluid> {
    pub(super) network: &'a PairwiseResistance<S>,
    pub(super) problem: &'a Problem<S>,
    pub(super) states: &'a States,
    pub(super) active: &'a Active<S>,
}

/// Candidate and row of a contact or friction row, numbered as stiffnesses are: candidates come first. Rows of slides are turned.
pub(super) fn row_of<S: Space>(
    problem: &Problem<S>,
    states: &States,
    at: usize,
) -> (usize, Row<S>) {
    match at.checked_sub(problem.normal.len()) {
        None => (at, problem.normal[at].row),
        Some(m) => {
            let entry = &problem.tangential[m];
            let turned = states
                .slide(m)
                .map(|slide| problem.turned_row(slide, m).row);
            (entry.contact, turned.unwrap_or(entry.row))
        }
    }
}

/// What the preconditioner is made of.
pub(super) struct Preconditioner<'a, S: Fluid> {
    pub(super) pattern: &'a NearPattern<S>,
    /// Factor of the near part of `R + Cᵀ S C + Dᵀ S D`.
    pub(super) held: &'a mut NearMatrix<S>,
    /// The near part of R, factored.
    pub(super) near: &'a mut NearMatrix<S>,
    /// Stiffness of each candidate, then of each row.
    pub(super) stiffness: &'a [f64],
    /// Forces on the spheres, `[3N]`.
    pub(super) work: &'a mut [f64],
}

/// Workspace for v and v_N side by side, and for the forces of both.
#[derive(Default)]
pub(super) struct BothMotions<S: Fluid> {
    velocities: Vec<Motion<S, 2>>,
    forces: Vec<Motion<S, 2>>,
}

impl<S: Fluid> BothMotions<S> {
    /// The forces R v and R v_N.
    pub(super) fn multiply(&mut self, network: &PairwiseResistance<S>, v: &[f64], v_n: &[f64]) {
        for both in [&mut self.velocities, &mut self.forces] {
            both.resize(network.spheres(), S::each([0.0; 2]));
        }
        let parts = S::by_sphere(v).iter().zip(S::by_sphere(v_n));
        for (both, (v, v_n)) in self.velocities.iter_mut().zip(parts) {
            for k in 0..S::MODES {
                both[k] = [v[k], v_n[k]];
            }
        }
        network.multiply(&self.velocities, &mut self.forces);
    }

    /// Puts the forces into vectors `[3N]`.
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
    /// Splits a vector into its parts: v, v_N, f, t.
    pub(super) fn split<'x>(&self, x: &'x [f64]) -> [&'x [f64]; 4] {
        let n = S::MODES * self.network.spheres();
        let (v, rest) = x.split_at(n);
        let (v_n, rest) = rest.split_at(if self.problem.uses_frictionless_slip {
            n
        } else {
            0
        });
        let (f, t) = rest.split_at(self.problem.normal.len());
        [v, v_n, f, t]
    }

    /// The same, to write.
    pub(super) fn split_mut<'x>(&self, x: &'x mut [f64]) -> [&'x mut [f64]; 4] {
        let n = S::MODES * self.network.spheres();
        let (v, rest) = x.split_at_mut(n);
        let (v_n, rest) = rest.split_at_mut(if self.problem.uses_frictionless_slip {
            n
        } else {
            0
        });
        let (f, t) = rest.split_at_mut(self.problem.normal.len());
        [v, v_n, f, t]
    }

    /// `y = A x` of the linear system; rows of velocities times [`WEIGHT`].
    pub(super) fn apply(&self, x: &[f64], y: &mut [f64], both: &mut BothMotions<S>) {
        let [v, v_n, _, _] = self.split(x);
        let [y_v, y_n, y_f, y_t] = self.split_mut(y);
        if self.problem.uses_frictionless_slip {
            both.multiply(self.network, v, v_n);
            self.add_contacts(x, &mut both.forces, y_f, y_t);
            both.read(y_v, y_n);
        } else {
            self.network.apply(v, y_v);
            self.add_contacts(x, side_by_side_mut::<S>(y_v), y_f, y_t);
        }
    }

    /// What contacts and their forces add to `y = A x`; normal forces act in all L motions, friction in the first.
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
            let (k, row) = (closed.at as usize, closed.row());
            row.add_to_first::<L, L>(-f[k], y);
            y_f[k] = WEIGHT * (row.read(v) + closed.compliance * f[k]);
        }
        for acting in &self.active.acting {
            let force = acting.factor * forces[acting.force];
            acting.row.add_to_first::<1, L>(force, y);
        }
        y_t.fill(0.0);
        let flow = if self.problem.uses_frictionless_slip {
            v_n
        } else {
            v
        };
        for sticking in &self.active.sticking {
            let m = sticking.at;
            y_t[m] = WEIGHT * (sticking.row.read(flow) - sticking.compliance * t[m]);
        }
    }

    /// Stiffness of each candidate, then of each row, in the preconditioner.
    pub(super) fn stiffnesses(&self, stiffness: &mut Vec<f64>) {
        let of = |compliance: f64| compliance.max(MIN_COMPLIANCE).recip();
        let (contacts, rows) = (self.problem.normal.len(), self.problem.tangential.len());
        stiffness.clear();
        stiffness.resize(contacts + rows, 0.0);
        for closed in &self.active.closed {
            stiffness[closed.at as usize] = of(closed.compliance);
        }
        for sticking in &self.active.sticking {
            stiffness[contacts + sticking.at] = of(sticking.compliance);
        }
    }

    /// `z = P⁻¹ r`.
    pub(super) fn precondition(&self, by: &mut Preconditioner<'_, S>, r: &[f64], z: &mut [f64]) {
        let (pattern, work) = (by.pattern, &mut *by.work);
        let [r_v, r_n, r_f, r_t] = self.split(r);
        let [z_v, z_n, z_f, z_t] = self.split_mut(z);
        let (normal, tangential) = by.stiffness.split_at(self.problem.normal.len());
        let isolated = self.problem.uses_frictionless_slip;
        let Active {
            closed, sticking, ..
        } = self.active;
        work.copy_from_slice(r_v);
        for entry in closed {
            let k = entry.at as usize;
            entry.row().add(normal[k] * r_f[k] / WEIGHT, work);
        }
        if !isolated {
            for entry in sticking {
                let m = entry.at;
                entry.row.add(tangential[m] * r_t[m] / WEIGHT, work);
            }
        }
        by.held.solve(pattern, work, z_v);
        if isolated {
            work.copy_from_slice(r_n);
        }
        z_f.fill(0.0);
        for entry in closed {
            let (k, row) = (entry.at as usize, entry.row());
            z_f[k] = normal[k] * (r_f[k] / WEIGHT - row.read(z_v));
            if isolated {
                row.add(z_f[k], work);
            }
        }
        if isolated {
            by.near.solve(pattern, work, z_n);
        }
        let read_from: &[f64] = if isolated { z_n } else { z_v };
        z_t.fill(0.0);
        for entry in sticking {
            let m = entry.at;
            z_t[m] = tangential[m] * (entry.row.read(read_from) - r_t[m] / WEIGHT);
        }
    }
}
