//! The forces of states that change one at a time: a matrix solved once and changed by one rank per change.
//!
//! All forces x = (f, t) move all contacts by `y = (w, z) = q + M x`. Of each pair (x_i, y_i) one is given, zero for what the states say,
//! and the other follows: the force of a contact that is closed or sticks, the velocity of one that is open or slides. A tableau holds
//! what follows as `B u + c` of what is given, u. When a contact changes from one to the other, they exchange roles: one principal pivot,
//! n² multiplications where a system solved anew costs n³/3 (Cottle, Pang & Stone, *The Linear Complementarity Problem*, 1992, ch. 2.3 and 4).
//!
//! The force of a sliding row follows the load. Its variable is therefore `t − s ν (f − f₀)`, with s the sign of the force, 0 for other rows;
//! it is zero while the row slides. Another s is one more combination of rows or columns, and costs n.

use super::problem::{Forces, Grip, Problem, States, System, largest};
use crate::linalg::dense::{Matrix, add_outer, add_scaled, dot};

/// Pivots below this, over the largest entry of their column, are no pivots.
const LEAST_PIVOT: f64 = 1e-14;
/// Changes by one rank that are added to the matrix at once.
const PENDING: usize = 16;

/// A problem of n = K + M contacts and rows in the form of some states.
#[derive(Debug, Default)]
pub(super) struct Tableau {
    /// B, `[n × n]`, without what is pending; forces in units of velocities, see `unit`.
    matrix: Matrix,
    /// c, `[n]`.
    constant: Vec<f64>,
    /// What is pending: `B − U Vᵀ`, `[n × PENDING]` each, and how many columns of them.
    left: Matrix,
    right: Matrix,
    pending: usize,
    /// Exchanges since the matrix was filled.
    exchanges: usize,
    /// Velocity of a unit of force, about: entries of B are then about 1.
    unit: f64,
    /// Whether the force of each contact and row follows.
    follows: Vec<bool>,
    /// s of each row.
    signs: Vec<f64>,
    /// Bias and compliance of each contact, shift and compliance of each row, for which the tableau stands.
    entries: Vec<[f64; 2]>,
    /// No forces.
    none: Forces,
}

impl Tableau {
    /// Room for that many contacts and rows.
    pub(super) fn reserve(&mut self, size: usize) {
        self.matrix.reserve(size * size);
        for side in [&mut self.left, &mut self.right] {
            side.reserve(size * PENDING);
        }
        self.follows.reserve(size);
        self.entries.reserve(size);
        for values in [
            &mut self.constant,
            &mut self.signs,
            &mut self.none.normal,
            &mut self.none.tangential,
            &mut self.none.slack,
            &mut self.none.slip,
        ] {
            values.reserve(size);
        }
    }

    /// Forgets the problem.
    pub(super) fn clear(&mut self) {
        self.entries.clear();
    }

    /// Exchanges of what follows and what is given since the problem was taken.
    pub(super) fn exchanges(&self) -> usize {
        self.exchanges
    }

    /// Takes a problem with all its contacts open, or leaves the tableau as it is where it is of this problem already; `false` where
    /// the system has no matrix.
    pub(super) fn begin(&mut self, problem: &Problem, system: &mut impl System) -> bool {
        let normal = problem.normal.iter().map(|e| [e.bias, e.compliance]);
        let rows = problem.tangential.iter().map(|e| [e.shift, e.compliance]);
        let (contacts, size) = (normal.len(), normal.len() + rows.len());
        if size > 0
            && self
                .entries
                .iter()
                .copied()
                .eq(normal.clone().chain(rows.clone()))
        {
            return true;
        }
        self.entries.clear();
        if !system.fill_matrix(problem, &mut self.matrix) {
            return false;
        }
        self.entries.extend(normal.chain(rows));
        for (at, [_, compliance]) in self.entries.iter().enumerate() {
            let sign = if at < contacts { 1.0 } else { -1.0 };
            self.matrix[(at, at)] += sign * compliance;
        }
        let diagonal = (0..contacts).map(|k| self.matrix[(k, k)]);
        self.unit = diagonal.sum::<f64>() / contacts as f64;
        for entry in self.matrix.values_mut() {
            *entry /= self.unit;
        }
        for (forces, count) in [
            (&mut self.none.normal, contacts),
            (&mut self.none.tangential, size - contacts),
        ] {
            forces.clear();
            forces.resize(count, 0.0);
        }
        system.measure(problem, &mut self.none);
        self.constant.clear();
        self.constant.extend_from_slice(&self.none.slack);
        self.constant.extend_from_slice(&self.none.slip);
        for side in [&mut self.left, &mut self.right] {
            side.reset(size, PENDING);
        }
        self.pending = 0;
        self.exchanges = 0;
        self.follows.clear();
        self.follows.resize(size, false);
        self.signs.clear();
        self.signs.resize(size - contacts, 0.0);
        true
    }

    /// Forces (of either sign) that the states give, with their slack and slip; `false` where they have no solution.
    pub(super) fn solve(
        &mut self,
        problem: &Problem,
        states: &States,
        forces: &mut Forces,
    ) -> bool {
        let solved = self.enter(problem, states);
        if solved {
            self.read(problem, forces);
        } else {
            self.clear();
        }
        solved
    }

    /// Brings the tableau into the form of the states.
    fn enter(&mut self, problem: &Problem, states: &States) -> bool {
        let contacts = problem.normal.len();
        let rows = || problem.tangential.iter().enumerate();
        // Friction that ceases, before the load that it holds on to.
        for (m, row) in rows() {
            let at = contacts + m;
            let ceases = states.grip[m] != Grip::Stick && self.follows[at];
            if ceases || !self.follows[at] && !self.follows[row.contact] {
                self.turn(problem, m, states.grip[m].sign());
            }
            if ceases && !self.exchange(at) {
                return false;
            }
        }
        for (k, &closed) in states.closed.iter().enumerate() {
            if closed != self.follows[k] && !self.exchange(k) {
                return false;
            }
        }
        for (m, row) in rows() {
            let (at, sign) = (contacts + m, states.grip[m].sign());
            let sticks = states.grip[m] == Grip::Stick;
            if !sticks && self.signs[m] != sign {
                // What is given cannot be combined with what follows.
                let both = self.follows[row.contact];
                if both && !self.exchange(at) {
                    return false;
                }
                self.turn(problem, m, sign);
                if both && !self.exchange(at) {
                    return false;
                }
            } else if sticks && !self.follows[at] && !self.exchange(at) {
                return false;
            }
        }
        true
    }

    /// Changes the variable of a row, which follows or is given together with the load, or follows alone.
    fn turn(&mut self, problem: &Problem, m: usize, sign: f64) {
        let change = (sign - self.signs[m]) * problem.friction;
        if change == 0.0 {
            return;
        }
        self.signs[m] = sign;
        let (k, at) = (problem.tangential[m].contact, problem.normal.len() + m);
        let offset = change * problem.offset * self.unit;
        self.make_room();
        if self.follows[at] {
            // The row of the load, or the load itself, is taken off.
            if self.follows[k] {
                self.copy_row(k);
            } else {
                self.right_mut().fill(0.0);
                self.right_mut()[k] = 1.0;
            }
            let load = if self.follows[k] {
                self.constant[k]
            } else {
                0.0
            };
            self.constant[at] += offset - change * load;
            let left = self.left_mut();
            left.fill(0.0);
            left[at] = change;
        } else {
            self.copy_column(at);
            let pending = self.pending;
            add_scaled(&mut self.constant, self.left.column(pending), -offset);
            for x in self.left_mut() {
                *x *= -change;
            }
            let right = self.right_mut();
            right.fill(0.0);
            right[k] = 1.0;
        }
        self.pending += 1;
    }

    /// Exchanges what follows and what is given of a contact or row; `false` where that cannot be.
    ///
    /// With π = B_pp, `B ← B − c rᵀ/π`, where c is column p with π + 1 in place of π, and r is row p with π − 1.
    fn exchange(&mut self, p: usize) -> bool {
        self.make_room();
        self.copy_column(p);
        let pivot = self.left_mut()[p];
        // Not a number is no pivot either.
        let usable = pivot.abs() > LEAST_PIVOT * largest(self.left_mut());
        if !usable {
            return false;
        }
        self.copy_row(p);
        let right = self.right_mut();
        right[p] -= 1.0;
        for x in right {
            *x /= pivot;
        }
        self.left_mut()[p] += 1.0;
        let c = self.constant[p] / pivot;
        add_scaled(&mut self.constant, self.left.column(self.pending), -c);
        self.pending += 1;
        self.exchanges += 1;
        self.follows[p] ^= true;
        // Exactly, whatever rounding left.
        self.constant[p] = -c;
        true
    }

    /// Adds to the velocities of all contacts and rows without forces, and so to the bias and shift for which the tableau stands.
    pub(super) fn shift(&mut self, change: impl Iterator<Item = f64> + Clone) {
        for ([bias, _], change) in self.entries.iter_mut().zip(change.clone()) {
            *bias += change;
        }
        // A velocity that is given is given with the change in it.
        self.make_room();
        let taken = self.right.column_mut(self.pending).iter_mut();
        for (at, (taken, change)) in taken.zip(change).enumerate() {
            *taken = if self.follows[at] { -change } else { 0.0 };
            if !self.follows[at] {
                self.constant[at] += change;
            }
        }
        let taken = self.right.column(self.pending);
        self.matrix.add_product(taken, &mut self.constant);
        for l in 0..self.pending {
            let weight = dot(self.right.column(l), taken);
            add_scaled(&mut self.constant, self.left.column(l), -weight);
        }
    }

    /// The pending columns to write next.
    fn left_mut(&mut self) -> &mut [f64] {
        self.left.column_mut(self.pending)
    }

    fn right_mut(&mut self) -> &mut [f64] {
        self.right.column_mut(self.pending)
    }

    /// Adds what is pending to the matrix, if it is much.
    fn make_room(&mut self) {
        if self.pending == PENDING {
            add_outer(&mut self.matrix, &self.left, &self.right, -1.0);
            self.pending = 0;
        }
    }

    /// Puts a column of B into the next one on the left.
    fn copy_column(&mut self, column: usize) {
        let n = self.follows.len();
        let (done, next) = self.left.values_mut().split_at_mut(self.pending * n);
        let next = &mut next[..n];
        next.copy_from_slice(self.matrix.column(column));
        for (l, done) in done.chunks_exact(n).enumerate() {
            let weight = self.right[(column, l)];
            if weight != 0.0 {
                add_scaled(next, done, -weight);
            }
        }
    }

    /// Puts a row of B into the next one on the right.
    fn copy_row(&mut self, row: usize) {
        let n = self.follows.len();
        let (done, next) = self.right.values_mut().split_at_mut(self.pending * n);
        let next = &mut next[..n];
        let entries = self.matrix.values()[row..].iter().step_by(n);
        for (x, entry) in next.iter_mut().zip(entries) {
            *x = *entry;
        }
        for (l, done) in done.chunks_exact(n).enumerate() {
            let weight = self.left[(row, l)];
            if weight != 0.0 {
                add_scaled(next, done, -weight);
            }
        }
    }

    /// The forces that follow, and the velocities.
    fn read(&self, problem: &Problem, forces: &mut Forces) {
        let contacts = problem.normal.len();
        let split = |at: usize| {
            if self.follows[at] {
                (self.constant[at] / self.unit, 0.0)
            } else {
                (0.0, self.constant[at])
            }
        };
        forces.normal.clear();
        forces.slack.clear();
        for k in 0..contacts {
            let (f, w) = split(k);
            forces.normal.push(f);
            forces.slack.push(w);
        }
        forces.tangential.clear();
        forces.slip.clear();
        for (m, row) in problem.tangential.iter().enumerate() {
            let (u, z) = split(contacts + m);
            let load = forces.normal[row.contact] - problem.offset;
            let sliding = if self.signs[m] == 0.0 {
                0.0
            } else {
                self.signs[m] * problem.friction * load
            };
            forces.tangential.push(u + sliding);
            forces.slip.push(z);
        }
    }
}
