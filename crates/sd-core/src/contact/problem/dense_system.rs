//! The contact problem of few spheres: with a factored `R_FU`, it is reduced to dense matrices of
//! the contacts.
//!
//! ```text
//! R_FU = L Lᵀ,   Y_n = L⁻¹ Cᵀ,   Y_t = L⁻¹ Dᵀ,   G_nn = Y_nᵀ Y_n, …
//! w = w⁰ + G_nn f − G_nt t,   z = z⁰ + G_tn f − G_tt t
//! ```
//!
//! G_nn is the Delassus matrix; w⁰ and z⁰ belong to the motion without contact forces. Where
//! friction depends on the motion under normal forces alone, G_tt is absent. With p = −t on
//! sticking rows, the linear system of an active set is symmetric except for the columns of
//! slipping contacts, whose friction is proportional to the load: `t = ±ν (f − f₀)`.

use super::statement::{
    Dilation, FORCE_ROUNDOFF, Forces, FrictionState, Problem, RoundoffThresholds, States, System,
    largest,
};
use crate::contact::row::Row;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::linalg::dense::Matrix;
use crate::linalg::lu::LuSolver;
use crate::linalg::staggered::StaggeredColumns;
use crate::space::Space;

/// Rounding error of velocities of a solved linear system, over the largest velocity.
const VELOCITY_ROUNDOFF: f64 = 1e-12;

/// Matrices, columns and workspace. Components of friction forces are numbered one after another,
/// M in all.
#[derive(Default)]
pub(crate) struct DenseSystem {
    /// `L⁻¹ F` with the forces F other than contact forces.
    free: Vec<f64>,
    /// `Y_n`, `[3N × K]`.
    normal_columns: StaggeredColumns,
    /// `Y_t`, `[3N × M]`.
    tangential_columns: StaggeredColumns,
    /// `[K × K]`, both triangles.
    g_nn: Matrix,
    /// `[M × K]`.
    g_tn: Matrix,
    /// `[M × M]`; absent where friction depends on the motion under normal forces alone.
    g_tt: Matrix,
    /// `g_tn` and `g_tt` with the rows of slides rotated to their frames, in a suspension.
    rotated: [Matrix; 2],
    /// v_n and u_t without contact forces.
    free_normal: Vec<f64>,
    free_slip: Vec<f64>,
    /// Unknowns of the linear system: closed candidates, then sticking components.
    unknowns: [Vec<usize>; 2],
    /// Right-hand side and solution.
    solution: Vec<f64>,
    /// p = −t.
    opposite: Vec<f64>,
    solver: LuSolver,
}

impl DenseSystem {
    /// Sets up the candidates of a stage. `forces`: all forces on the spheres other than contact
    /// forces.
    pub(crate) fn set_up<S: Fluid>(
        &mut self,
        resistance: &Resistance<S>,
        problem: &Problem<S>,
        forces: &[f64],
    ) {
        self.free.clear();
        self.free.extend_from_slice(forces);
        resistance.solver().solve_lower_vector(&mut self.free);
        let (rows, columns) = (
            problem.normal.iter().map(|entry| entry.row),
            &mut self.normal_columns,
        );
        fill(columns, resistance, rows);
        columns.gram(&mut self.g_nn);
        self.free_normal.clear();
        columns.add_transposed_product(&self.free, &mut self.free_normal);
        let Dilation {
            openings,
            mobility,
            free,
            shiftings: _,
        } = &problem.dilation;
        for (k, c) in openings.iter().enumerate() {
            self.free_normal[k] += c * free;
            for (entry, other) in self.g_nn.column_mut(k).iter_mut().zip(openings) {
                *entry += mobility * c * other;
            }
        }
        self.set_up_friction(resistance, problem);
    }

    /// Sets up the friction forces of the problem, whose candidates are already set up.
    pub(crate) fn set_up_friction<S: Fluid>(
        &mut self,
        resistance: &Resistance<S>,
        problem: &Problem<S>,
    ) {
        let entries = problem.friction.iter();
        let rows = entries.flat_map(|entry| entry.rows.as_ref().iter().copied());
        let columns = &mut self.tangential_columns;
        fill(columns, resistance, rows);
        columns.transposed_product(&self.normal_columns, &mut self.g_tn);
        if !problem.uses_frictionless_slip {
            columns.gram(&mut self.g_tt);
        }
        self.free_slip.clear();
        columns.add_transposed_product(&self.free, &mut self.free_slip);
        let dilation = &problem.dilation;
        for (m, s) in dilation.shiftings.iter().enumerate() {
            self.free_slip[m] += s * dilation.free;
            for (k, c) in dilation.openings.iter().enumerate() {
                self.g_tn[(m, k)] += dilation.mobility * s * c;
            }
            if !problem.uses_frictionless_slip {
                for (l, other) in dilation.shiftings.iter().enumerate() {
                    self.g_tt[(m, l)] += dilation.mobility * s * other;
                }
            }
        }
    }

    /// Sets the disturbance velocities under the given contact forces.
    pub(crate) fn finish<S: Fluid>(
        &mut self,
        resistance: &Resistance<S>,
        forces: &Forces<S>,
        velocities: &mut [f64],
    ) {
        velocities.copy_from_slice(&self.free);
        self.normal_columns.add_product(&forces.normal, velocities);
        self.opposite.clear();
        let components = S::components(&forces.tangential).iter();
        self.opposite.extend(components.map(|t| -t));
        self.tangential_columns
            .add_product(&self.opposite, velocities);
        resistance.solver().solve_upper_vector(velocities);
    }

    /// Rotates the rows of slides to their frames, in a suspension.
    fn rotate_slides<S: Space>(&mut self, states: &States<S>) {
        let [g_tn, g_tt] = &mut self.rotated;
        for (rotated, fixed) in [(&mut *g_tn, &self.g_tn), (&mut *g_tt, &self.g_tt)] {
            rotated.reshape(fixed.rows(), fixed.columns());
            rotated.values_mut().copy_from_slice(fixed.values());
        }
        for (k, state) in states.friction.iter().enumerate() {
            let FrictionState::Slip(slide) = state else {
                continue;
            };
            // The components of the slip are this far apart among the values of a matrix.
            let rotate = |values: &mut [f64], first: usize, apart: usize| {
                let mut slip = S::each_tangent(0.0);
                for (d, x) in slip.as_mut().iter_mut().enumerate() {
                    *x = values[first + d * apart];
                }
                for (d, x) in slide.rotate(&slip).as_ref().iter().enumerate() {
                    values[first + d * apart] = *x;
                }
            };
            let (m, rows) = (S::TANGENTS * k, g_tt.rows());
            for matrix in [&mut *g_tn, &mut *g_tt] {
                for column in 0..matrix.columns() {
                    rotate(matrix.column_mut(column), m, 1);
                }
            }
            for row in 0..rows {
                rotate(g_tt.values_mut(), rows * m + row, rows);
            }
        }
    }

    /// Assembles the linear system of the active set and its right-hand side.
    fn assemble<S: Space>(&mut self, problem: &Problem<S>, states: &States<S>) {
        if S::TANGENTS > 1 {
            self.rotate_slides(states);
        }
        let [g_tn, g_tt] = if S::TANGENTS > 1 {
            self.rotated.each_ref()
        } else {
            [&self.g_tn, &self.g_tt]
        };
        let split = |m: usize| (m / S::TANGENTS, m % S::TANGENTS);
        let [active, sticking] = &mut self.unknowns;
        active.clear();
        active.extend((0..states.closed.len()).filter(|&k| states.closed[k]));
        sticking.clear();
        sticking.extend((0..problem.friction_rows()).filter(|&m| {
            let (k, d) = split(m);
            states.friction[k].sticks(d)
        }));
        let (first, size) = (active.len(), active.len() + sticking.len());
        let matrix = self.solver.matrix_mut();
        matrix.reshape(size, size);
        for (column, &k) in active.iter().enumerate() {
            let target = matrix.column_mut(column);
            let (normal, tangential) = (self.g_nn.column(k), g_tn.column(k));
            for (entry, &l) in target.iter_mut().zip(active.iter()) {
                *entry = normal[l];
            }
            target[column] += problem.normal[k].compliance;
            for (entry, &m) in target[first..].iter_mut().zip(sticking.iter()) {
                *entry = tangential[m];
            }
        }
        // Adds a multiple of the column of component m, for its force p = −t.
        let is_coupled = !problem.uses_frictionless_slip;
        let add_column = |factor: f64, m: usize, target: &mut [f64]| {
            let (upper, lower) = target.split_at_mut(first);
            for (x, &k) in upper.iter_mut().zip(active.iter()) {
                *x += factor * g_tn[(m, k)];
            }
            if is_coupled {
                for (x, &l) in lower.iter_mut().zip(sticking.iter()) {
                    *x += factor * g_tt[(l, m)];
                }
            }
        };
        self.solution.clear();
        let closed = active.iter();
        self.solution
            .extend(closed.map(|&k| -problem.normal[k].bias - self.free_normal[k]));
        for (column, &m) in (first..).zip(sticking.iter()) {
            let (k, d) = split(m);
            let entry = &problem.friction[k];
            let target = matrix.column_mut(column);
            target.fill(0.0);
            add_column(1.0, m, target);
            target[column] += entry.compliance;
            let mut given = entry.shift;
            for (x, free) in given.as_mut().iter_mut().zip(&self.free_slip[m - d..]) {
                *x += free;
            }
            if let FrictionState::Slip(slide) = &states.friction[k] {
                target[column] += slide.compliance;
                given = slide.rotate(&given);
            }
            self.solution.push(-given[d]);
        }
        for (k, (entry, state)) in problem.friction.iter().zip(&states.friction).enumerate() {
            let FrictionState::Slip(slide) = state else {
                continue;
            };
            let (sign, m) = (slide.sign(), S::TANGENTS * k);
            if entry.intercept != 0.0 {
                add_column(sign * entry.intercept, m, &mut self.solution);
            }
            // Friction that is proportional to the load is added to the column of the load.
            let load = active.binary_search(&entry.contact);
            if let (Ok(column), true) = (load, entry.follows_load()) {
                let target = matrix.column_mut(column);
                add_column(-(sign * entry.coefficient), m, target);
            }
        }
    }
}

/// Computes the columns `L⁻¹ rowᵀ`, whose rows are ordered by their first sphere.
fn fill<S: Fluid>(
    columns: &mut StaggeredColumns,
    resistance: &Resistance<S>,
    rows: impl Iterator<Item = Row<S>> + Clone,
) {
    let starts = |row: &Row<S>| row.spheres.map(|sphere| S::MODES * sphere);
    let size = S::MODES * resistance.radii().len();
    columns.reset(size, rows.clone().map(|row| starts(&row)[0]));
    for (column, row) in rows.enumerate() {
        row.add_at(1.0, starts(&row), columns.column_mut(column));
    }
    columns.solve_lower(resistance.solver());
}

impl<S: Fluid> System<S> for DenseSystem {
    fn solve(
        &mut self,
        problem: &Problem<S>,
        states: &States<S>,
        _: bool,
        forces: &mut Forces<S>,
    ) -> Option<RoundoffThresholds> {
        self.assemble(problem, states);
        if self.solver.solve(&mut self.solution).is_err()
            || !self.solution.iter().all(|x| x.is_finite())
        {
            return None;
        }
        let [active, sticking] = &self.unknowns;
        let (normal, tangential) = self.solution.split_at(active.len());
        forces.reset(problem);
        for (&k, &f) in active.iter().zip(normal) {
            forces.normal[k] = f;
        }
        let components = S::components_mut(&mut forces.tangential);
        for (&m, &p) in sticking.iter().zip(tangential) {
            components[m] = -p;
        }
        problem.prescribe(states, forces, true);
        self.measure(problem, forces);
        let given = self.free_normal.iter().chain(&self.free_slip);
        let biases = problem.normal.iter().map(|entry| &entry.bias);
        let shifts = problem
            .friction
            .iter()
            .flat_map(|entry| entry.shift.as_ref());
        let velocities = given.chain(biases).chain(shifts);
        let friction = largest(S::components(&forces.tangential));
        Some(RoundoffThresholds {
            force: FORCE_ROUNDOFF * largest(&forces.normal).max(friction),
            velocity: VELOCITY_ROUNDOFF * velocities.fold(0.0, |most: f64, v| most.max(v.abs())),
            exact: true,
        })
    }

    fn measure(&mut self, problem: &Problem<S>, forces: &mut Forces<S>) {
        let t = S::components(&forces.tangential);
        let slack = &mut forces.slack;
        slack.clone_from(&self.free_normal);
        self.g_nn.add_product(&forces.normal, slack);
        self.g_tn.subtract_transposed_product(t, slack);
        forces
            .slip
            .resize(problem.friction.len(), S::each_tangent(0.0));
        let slip = S::components_mut(&mut forces.slip);
        slip.copy_from_slice(&self.free_slip);
        self.g_tn.add_product(&forces.normal, slip);
        if !problem.uses_frictionless_slip {
            self.g_tt.subtract_transposed_product(t, slip);
        }
        for ((w, f), entry) in slack.iter_mut().zip(&forces.normal).zip(&problem.normal) {
            *w = *w + entry.compliance * f + entry.bias;
        }
        let slips = forces.slip.iter_mut().zip(&forces.tangential);
        for ((z, t), entry) in slips.zip(&problem.friction) {
            for k in 0..S::TANGENTS {
                z[k] = z[k] - entry.compliance * t[k] + entry.shift[k];
            }
        }
    }

    fn mobility(&self, candidate: usize) -> f64 {
        self.g_nn[(candidate, candidate)]
    }
}
