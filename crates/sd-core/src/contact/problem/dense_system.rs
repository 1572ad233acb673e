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
    Forces, FrictionState, Problem, RoundoffThresholds, States, System, largest,
};
use crate::contact::row::Row;
use crate::hydrodynamics::resistance::{Fluid, Resistance};
use crate::linalg::dense::Matrix;
use crate::linalg::lu::LuSolver;
use crate::linalg::staggered::StaggeredColumns;
use crate::space::Space;

/// Matrices, columns and workspace. Components of friction forces are numbered one after another.
pub(crate) struct DenseSystem {
    /// `L⁻¹ F` with the forces F other than contact forces.
    free: Vec<f64>,
    /// `Y_n`, `[3N × K]`, ordered by the first nonzero row.
    normal_columns: StaggeredColumns,
    /// `Y_t`, `[3N × M]`, ordered likewise.
    tangential_columns: StaggeredColumns,
    /// Candidate of each normal column, and component of each tangential column.
    order: [Vec<usize>; 2],
    /// Normal column of each candidate, and tangential column of each component.
    place: [Vec<usize>; 2],
    /// `[K × K]`, both triangles.
    g_nn: Matrix,
    /// `[M × K]`.
    g_tn: Matrix,
    /// `[M × M]`.
    g_tt: Matrix,
    /// `g_tn` and `g_tt` with the rows of slides rotated to their frames, in a suspension.
    rotated: [Matrix; 2],
    /// v_n and u_t without contact forces, by column.
    free_normal: Vec<f64>,
    free_slip: Vec<f64>,
    /// Unknowns of the linear system, by their columns: closed candidates, then sticking
    /// components.
    unknowns: [Vec<usize>; 2],
    /// Right-hand side and solution.
    solution: Vec<f64>,
    /// Forces by column, and the contact velocities that they cause.
    by_column: [Vec<f64>; 2],
    velocities: [Vec<f64>; 2],
    solver: LuSolver,
    /// Whether `g_tt` is absent.
    uses_frictionless_slip: bool,
}

/// Two vectors with memory for that many elements.
fn two_with_capacity<T>(capacity: usize) -> [Vec<T>; 2] {
    [0, 1].map(|_| Vec::with_capacity(capacity))
}

impl DenseSystem {
    /// Reserves memory for that many candidates of that many spheres.
    pub(crate) fn new<S: Space>(spheres: usize, candidates: usize) -> Self {
        let (rows, components) = (S::MODES * spheres, S::TANGENTS * candidates);
        let matrix = |entries| {
            let mut matrix = Matrix::default();
            matrix.reserve(entries);
            matrix
        };
        let columns = |count| {
            let mut columns = StaggeredColumns::default();
            columns.reserve(rows, count);
            columns
        };
        Self {
            free: Vec::with_capacity(rows),
            normal_columns: columns(candidates),
            tangential_columns: columns(components),
            order: two_with_capacity(2 * candidates),
            place: two_with_capacity(2 * candidates),
            g_nn: matrix(candidates * candidates),
            g_tn: matrix(components * candidates),
            g_tt: matrix(components * components),
            rotated: [Matrix::default(), Matrix::default()],
            free_normal: Vec::with_capacity(2 * candidates),
            free_slip: Vec::with_capacity(2 * candidates),
            unknowns: two_with_capacity(2 * candidates),
            solution: Vec::with_capacity(2 * candidates),
            by_column: two_with_capacity(2 * candidates),
            velocities: two_with_capacity(2 * candidates),
            solver: LuSolver::new(candidates + components),
            uses_frictionless_slip: false,
        }
    }

    /// Sets up the candidates of a stage. `forces`: all forces on the spheres other than contact
    /// forces.
    pub(crate) fn set_up<S: Fluid>(
        &mut self,
        resistance: &Resistance<S>,
        problem: &Problem<S>,
        forces: &[f64],
    ) {
        let solver = resistance.solver();
        self.free.clear();
        self.free.extend_from_slice(forces);
        solver.solve_lower_vector(&mut self.free);
        let rows = problem.normal.iter().map(|entry| entry.row);
        let ([order, _], [place, _]) = (&mut self.order, &mut self.place);
        sort(rows, order, place);
        let columns = &mut self.normal_columns;
        fill(columns, resistance, self.free.len(), order, |k| {
            problem.normal[k].row
        });
        columns.gram(&mut self.g_nn);
        self.free_normal.clear();
        columns.add_transposed_product(&self.free, &mut self.free_normal);
        self.set_up_friction(resistance, problem);
    }

    /// Sets up the friction forces of the problem, whose candidates are already set up.
    pub(crate) fn set_up_friction<S: Fluid>(
        &mut self,
        resistance: &Resistance<S>,
        problem: &Problem<S>,
    ) {
        let rows = problem.friction.iter().flat_map(|entry| {
            let rows = entry.rows;
            (0..S::TANGENTS).map(move |d| rows[d])
        });
        let ([_, order], [_, place]) = (&mut self.order, &mut self.place);
        sort(rows, order, place);
        let columns = &mut self.tangential_columns;
        fill(columns, resistance, self.free.len(), order, |m| {
            problem.friction[m / S::TANGENTS].rows[m % S::TANGENTS]
        });
        columns.transposed_product(&self.normal_columns, &mut self.g_tn);
        self.uses_frictionless_slip = problem.uses_frictionless_slip;
        if !self.uses_frictionless_slip {
            columns.gram(&mut self.g_tt);
        }
        self.free_slip.clear();
        columns.add_transposed_product(&self.free, &mut self.free_slip);
    }

    /// Sets the disturbance velocities under the given contact forces.
    pub(crate) fn finish<S: Fluid>(
        &mut self,
        resistance: &Resistance<S>,
        forces: &Forces<S>,
        velocities: &mut [f64],
    ) {
        self.gather(forces);
        velocities.copy_from_slice(&self.free);
        self.normal_columns
            .add_product(&self.by_column[0], velocities);
        for t in &mut self.by_column[1] {
            *t = -*t;
        }
        self.tangential_columns
            .add_product(&self.by_column[1], velocities);
        resistance.solver().solve_upper_vector(velocities);
    }

    /// Copies forces to the order of the columns.
    fn gather<S: Space>(&mut self, forces: &Forces<S>) {
        let given = [&forces.normal[..], S::components(&forces.tangential)];
        for ((target, order), given) in self.by_column.iter_mut().zip(&self.order).zip(given) {
            target.clear();
            target.extend(order.iter().map(|&at| given[at]));
        }
    }

    /// Rotates the rows of slides to their frames, in a suspension.
    fn rotate_slides<S: Space>(&mut self, states: &States<S>) {
        let [g_tn, g_tt] = &mut self.rotated;
        for (rotated, fixed) in [(&mut *g_tn, &self.g_tn), (&mut *g_tt, &self.g_tt)] {
            rotated.reshape(fixed.rows(), fixed.columns());
            rotated.values_mut().copy_from_slice(fixed.values());
        }
        for (state, places) in states
            .friction
            .iter()
            .zip(self.place[1].chunks(S::TANGENTS))
        {
            let FrictionState::Slip(slide) = state else {
                continue;
            };
            let rotate = |entries: &mut [f64], at: &dyn Fn(usize) -> usize| {
                let mut slip = S::each_tangent(0.0);
                for (x, &place) in slip.as_mut().iter_mut().zip(places) {
                    *x = entries[at(place)];
                }
                for (x, &place) in slide.rotate(&slip).as_ref().iter().zip(places) {
                    entries[at(place)] = *x;
                }
            };
            for matrix in [&mut *g_tn, &mut *g_tt] {
                for column in 0..matrix.columns() {
                    rotate(matrix.column_mut(column), &|place| place);
                }
            }
            let rows = g_tt.rows();
            for row in 0..rows {
                rotate(g_tt.values_mut(), &|place| rows * place + row);
            }
        }
    }
}

/// First rows of the two spheres of a row among those of all spheres.
fn starts<S: Space>(row: &Row<S>) -> [usize; 2] {
    row.spheres.map(|sphere| S::MODES * sphere)
}

/// Sorts rows by the first nonzero row of their columns; also returns the inverse permutation.
fn sort<S: Space>(
    rows: impl Iterator<Item = Row<S>>,
    order: &mut Vec<usize>,
    place: &mut Vec<usize>,
) {
    place.clear();
    place.extend(rows.map(|row| {
        let [i, j] = starts(&row);
        i.min(j)
    }));
    order.clear();
    order.extend(0..place.len());
    order.sort_unstable_by_key(|&at| (place[at], at));
    for (column, &at) in order.iter().enumerate() {
        place[at] = column;
    }
}

/// Computes the columns `L⁻¹ rowᵀ` in that order.
fn fill<S: Fluid>(
    columns: &mut StaggeredColumns,
    resistance: &Resistance<S>,
    size: usize,
    order: &[usize],
    row: impl Fn(usize) -> Row<S>,
) {
    let begin = |&at: &usize| {
        let [i, j] = starts(&row(at));
        i.min(j)
    };
    columns.reset(size, order.iter().map(begin));
    for (column, &at) in order.iter().enumerate() {
        let row = row(at);
        row.add_at(1.0, starts(&row), columns.column_mut(column));
    }
    columns.solve_lower(resistance.solver());
}

impl DenseSystem {
    /// Assembles the linear system of the active set and its right-hand side.
    fn assemble<S: Space>(&mut self, problem: &Problem<S>, states: &States<S>) {
        if S::TANGENTS > 1 {
            self.rotate_slides(states);
        }
        let [order, row_order] = &self.order;
        // Friction force and its component at a tangential column.
        let component = |s: usize| (row_order[s] / S::TANGENTS, row_order[s] % S::TANGENTS);
        let [g_tn, g_tt] = if S::TANGENTS > 1 {
            self.rotated.each_ref()
        } else {
            [&self.g_tn, &self.g_tt]
        };
        let [active, sticking] = &mut self.unknowns;
        active.clear();
        active.extend((0..order.len()).filter(|&c| states.closed[order[c]]));
        sticking.clear();
        sticking.extend((0..row_order.len()).filter(|&s| {
            let (k, d) = component(s);
            states.friction[k].sticks(d)
        }));
        let (first, size) = (active.len(), active.len() + sticking.len());
        let matrix = self.solver.matrix_mut();
        matrix.reshape(size, size);
        for (column, &b) in active.iter().enumerate() {
            let target = matrix.column_mut(column);
            let (normal, tangential) = (self.g_nn.column(b), g_tn.column(b));
            for (entry, &a) in target.iter_mut().zip(active.iter()) {
                *entry = normal[a];
            }
            target[column] += problem.normal[order[b]].compliance;
            for (entry, &s) in target[first..].iter_mut().zip(sticking.iter()) {
                *entry = tangential[s];
            }
        }
        // Adds a multiple of the column of one component, for its force p = −t.
        let is_coupled = !self.uses_frictionless_slip;
        let add_column = |factor: f64, component: usize, target: &mut [f64]| {
            let (upper, lower) = target.split_at_mut(first);
            for (x, &a) in upper.iter_mut().zip(active.iter()) {
                *x += factor * g_tn[(component, a)];
            }
            if is_coupled {
                for (x, &s) in lower.iter_mut().zip(sticking.iter()) {
                    *x += factor * g_tt[(s, component)];
                }
            }
        };
        for (column, &s) in sticking.iter().enumerate() {
            let target = matrix.column_mut(first + column);
            target.fill(0.0);
            add_column(1.0, s, target);
            let (k, _) = component(s);
            target[first + column] += problem.friction[k].compliance;
            if let FrictionState::Slip(slide) = &states.friction[k] {
                target[first + column] += slide.compliance;
            }
        }
        self.solution.clear();
        self.solution.extend(
            active
                .iter()
                .map(|&a| -problem.normal[order[a]].bias - self.free_normal[a]),
        );
        self.solution.extend(sticking.iter().map(|&s| {
            let (k, d) = component(s);
            let shift = &problem.friction[k].shift;
            let FrictionState::Slip(slide) = &states.friction[k] else {
                return -shift[d] - self.free_slip[s];
            };
            let mut given = *shift;
            for (d, x) in given.as_mut().iter_mut().enumerate() {
                *x += self.free_slip[self.place[1][S::TANGENTS * k + d]];
            }
            -slide.rotate(&given)[d]
        }));
        for (k, (row, state)) in problem.friction.iter().zip(&states.friction).enumerate() {
            let FrictionState::Slip(slide) = state else {
                continue;
            };
            let (sign, own_column) = (slide.sign(), self.place[1][S::TANGENTS * k]);
            if row.intercept != 0.0 {
                add_column(sign * row.intercept, own_column, &mut self.solution);
            }
            // Friction that is proportional to the load is added to the column of the load.
            let load = active.binary_search(&self.place[0][row.contact]);
            if let (Ok(column), true) = (load, row.follows_load()) {
                let target = matrix.column_mut(column);
                add_column(-(sign * row.coefficient), own_column, target);
            }
        }
    }
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
        let ([active, sticking], [order, row_order]) = (&self.unknowns, &self.order);
        let (normal, tangential) = self.solution.split_at(active.len());
        forces.reset(problem);
        for (&a, &f) in active.iter().zip(normal) {
            forces.normal[order[a]] = f;
        }
        let components = S::components_mut(&mut forces.tangential);
        for (&s, &p) in sticking.iter().zip(tangential) {
            components[row_order[s]] = -p;
        }
        problem.prescribe(states, forces, true);
        self.measure(problem, forces);
        let given = self.free_normal.iter().chain(&self.free_slip);
        let fastest = given.fold(0.0, |most: f64, v| most.max(v.abs()));
        let biases = problem.normal.iter().map(|entry| entry.bias.abs());
        let shifts = problem.friction.iter().flat_map(|entry| {
            let shift = entry.shift;
            (0..S::TANGENTS).map(move |d| shift[d].abs())
        });
        Some(RoundoffThresholds {
            force: 1e-13 * largest(&forces.normal).max(largest(S::components(&forces.tangential))),
            velocity: 1e-12 * biases.chain(shifts).fold(fastest, f64::max),
            exact: true,
        })
    }

    fn measure(&mut self, problem: &Problem<S>, forces: &mut Forces<S>) {
        self.gather(forces);
        let [f, t] = &self.by_column;
        let [slack, slip] = &mut self.velocities;
        slack.clone_from(&self.free_normal);
        self.g_nn.add_product(f, slack);
        self.g_tn.subtract_transposed_product(t, slack);
        slip.clone_from(&self.free_slip);
        self.g_tn.add_product(f, slip);
        if !self.uses_frictionless_slip {
            self.g_tt.subtract_transposed_product(t, slip);
        }
        forces.slack.clear();
        for (k, entry) in problem.normal.iter().enumerate() {
            let moved = slack[self.place[0][k]] + entry.compliance * forces.normal[k];
            forces.slack.push(moved + entry.bias);
        }
        forces.slip.clear();
        for (k, entry) in problem.friction.iter().enumerate() {
            let mut z = entry.shift;
            for d in 0..S::TANGENTS {
                let moved = slip[self.place[1][S::TANGENTS * k + d]];
                z[d] += moved - entry.compliance * forces.tangential[k][d];
            }
            forces.slip.push(z);
        }
    }

    fn mobility(&self, candidate: usize) -> f64 {
        let column = self.place[0][candidate];
        self.g_nn[(column, column)]
    }
}
