//! Normal forces and the paper's friction at once, by a semismooth Newton method (Alart & Curnier 1991).
//!
//! Once each contact is known to be open, to roll, to slip to one side or to be without friction, its friction force follows the
//! normal forces, and these are the solution of one linear system:
//!
//! ```text
//! rolls:  F_t = K (u_t⁰ + G_tn f)        q + G_nn f − G_nt F_t = 0 on closed contacts, f = 0 on open ones
//! slips:  F_t = ±ν (f − f0)
//! ```
//!
//! The states that its solution contradicts are mended, and the system is solved anew. Started from the states of the stage before it
//! mostly needs one or two systems, where the fixed point of [`super::friction`] needs a dozen passes. Where it cycles, that takes over.

use super::cone::Chance;
use super::friction::{DECIDING_PASSES, STANDSTILL, law};
use super::{COMPLIANCE, Contact, ContactState, Contacts, Surface};
use crate::linalg::dense::{Matrix, add_scaled, symmetric_product};
use crate::linalg::lu::LuSolver;

/// Systems after which the fixed point takes over.
const MOST_SYSTEMS: u32 = 40;
/// Systems without fewer contradictions after which only some of them are mended at a time, chosen by chance.
const PATIENCE: u32 = 4;

/// How the friction force of a contact follows the normal forces.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Follows {
    /// Not at all: there is none.
    Not,
    /// The slip.
    Slip,
    /// The contact's own load, times this: ν or −ν.
    Load(f64),
}

/// What came of the method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Outcome {
    /// Solved after so many systems, with this friction error.
    Solved(u32, f64),
    /// Candidates without slip reduced exceed the critical load: they have joined `frictional`.
    Admitted,
    /// It cycled, or met a singular system, after so many systems.
    Cycled(u32),
}

/// States and workspace of the method.
#[derive(Default)]
pub(super) struct Workspace {
    /// Whether each candidate is closed.
    closed: Vec<bool>,
    /// Friction of each frictional candidate.
    follows: Vec<Follows>,
    /// Closed candidates, ascending.
    active: Vec<usize>,
    /// Frictional candidates that roll when a stage begins, as places in `frictional`, with √K.
    rolling: Vec<(usize, f64)>,
    /// `√K G_tn` of those, on all candidates; then of one.
    couplings: Matrix,
    /// `G_tn`ᵀ K `G_tn` of those that roll, lower triangle.
    square: Matrix,
    /// `G_nn` less that, both triangles.
    symmetric: Matrix,
    /// Whether each frictional candidate is among those; empty if `symmetric` is not of this stage.
    counted: Vec<bool>,
    /// F_t at f = 0, one per frictional candidate.
    constant: Vec<f64>,
    /// Right-hand side and solution of the system.
    solution: Vec<f64>,
    /// Solver of the systems.
    solver: LuSolver,
}

impl Workspace {
    /// Room for that many candidates.
    pub(super) fn new(candidates: usize) -> Self {
        let matrix = || {
            let mut matrix = Matrix::default();
            matrix.reserve(candidates * candidates);
            matrix
        };
        Self {
            closed: Vec::with_capacity(candidates),
            follows: Vec::with_capacity(candidates),
            active: Vec::with_capacity(candidates),
            rolling: Vec::with_capacity(candidates),
            couplings: matrix(),
            square: matrix(),
            symmetric: matrix(),
            counted: Vec::with_capacity(candidates),
            constant: Vec::with_capacity(candidates),
            solution: Vec::with_capacity(candidates),
            solver: LuSolver::new(candidates),
        }
    }

    /// Brings the symmetric part of the system, `G_nn` less what follows the slip, up to date: all of it at first, then by those
    /// that began or ceased to roll.
    fn follow_slip(
        &mut self,
        g_nn: &Matrix,
        g_tn: &Matrix,
        frictional: &[usize],
        list: &[Contact],
    ) {
        let count = g_nn.columns();
        let rolls = |follows: &Follows| *follows == Follows::Slip;
        let root = |m: usize| list[frictional[m]].slip_resistance.sqrt();
        if self.counted.is_empty() {
            self.counted.extend(self.follows.iter().map(rolls));
            self.rolling.clear();
            self.rolling.extend(
                (0..frictional.len())
                    .filter(|&m| self.counted[m])
                    .map(|m| (m, root(m))),
            );
            self.couplings.reshape(self.rolling.len(), count);
            for k in 0..count {
                let slips = g_tn.column(k);
                let target = self.couplings.column_mut(k);
                for (entry, &(m, root)) in target.iter_mut().zip(&self.rolling) {
                    *entry = root * slips[m];
                }
            }
            symmetric_product(&self.couplings, &self.couplings, &mut self.square);
            self.symmetric.reshape(count, count);
            for k in 0..count {
                let (normal, square) = (g_nn.column(k), self.square.column(k));
                let target = self.symmetric.column_mut(k);
                for (row, entry) in target.iter_mut().enumerate().skip(k) {
                    *entry = normal[row] - square[row];
                }
            }
            self.symmetric.mirror_lower();
            return;
        }
        for m in 0..frictional.len() {
            let now = rolls(&self.follows[m]);
            if now == self.counted[m] {
                continue;
            }
            self.counted[m] = now;
            let root = root(m);
            self.couplings.reshape(count, 1);
            for (k, entry) in self.couplings.column_mut(0).iter_mut().enumerate() {
                *entry = root * g_tn[(m, k)];
            }
            let coupling = self.couplings.column(0);
            let sign = if now { -1.0 } else { 1.0 };
            for (k, &weight) in coupling.iter().enumerate() {
                add_scaled(self.symmetric.column_mut(k), coupling, sign * weight);
            }
        }
    }
}

impl Contacts {
    /// Solves for normal forces and friction, from the forces in `list` and, for the support, `normal_forces`.
    ///
    /// Leaves normal forces, the friction applied, whom it acts on, and states as the fixed point does.
    pub(super) fn solve_by_newton(&mut self, surface: &Surface) -> Outcome {
        self.guess(surface);
        self.solve_guessed(surface, DECIDING_PASSES)
    }

    /// Another attempt, from forces that the fixed point left and with the contacts on which it let friction act; the friction error
    /// if it succeeds.
    pub(super) fn solve_held(&mut self, surface: &Surface) -> Option<f64> {
        let friction = &mut self.friction;
        let work = &mut friction.newton;
        work.closed.clear();
        work.closed
            .extend(self.normal_forces.iter().map(|&f| f > 0.0));
        work.follows.clear();
        for (&k, &applied) in self.frictional.iter().zip(&friction.applied) {
            work.follows.push(match self.list[k].state {
                ContactState::Frictionless => Follows::Not,
                ContactState::Rolling => Follows::Slip,
                ContactState::Slipping => Follows::Load(surface.friction.copysign(applied)),
            });
        }
        match self.solve_guessed(surface, 0) {
            Outcome::Solved(_, error) => Some(error),
            Outcome::Admitted | Outcome::Cycled(_) => None,
        }
    }

    /// Solves from the states at hand; in the first systems it is decided whom friction acts on.
    fn solve_guessed(&mut self, surface: &Surface, deciding_systems: u32) -> Outcome {
        let mut fewest = usize::MAX;
        let mut patience = PATIENCE;
        let mut chance = Chance::All;
        for count in 1..=MOST_SYSTEMS {
            if !self.solve_states() {
                return Outcome::Cycled(count);
            }
            let deciding =
                count <= deciding_systems || self.friction.offset > 0.0 && deciding_systems > 0;
            if deciding && self.admit_loaded(surface) {
                return Outcome::Admitted;
            }
            let (contradictions, error) = self.mend(surface, deciding, &mut chance);
            if contradictions == 0 {
                return Outcome::Solved(count, error);
            }
            if contradictions < fewest {
                fewest = contradictions;
                patience = PATIENCE;
                chance = Chance::All;
            } else {
                patience = patience.saturating_sub(1);
                if patience == 0 && chance == Chance::All {
                    chance = Chance::Some(u64::from(count));
                }
            }
        }
        Outcome::Cycled(MOST_SYSTEMS)
    }

    /// States to start from.
    fn guess(&mut self, surface: &Surface) {
        let friction = &mut self.friction;
        let work = &mut friction.newton;
        work.closed.clear();
        if self.list.iter().any(|contact| contact.normal_force > 0.0) {
            work.closed
                .extend(self.list.iter().map(|contact| contact.normal_force > 0.0));
        } else {
            work.closed
                .extend(self.normal_forces.iter().map(|&f| f > 0.0));
        }
        work.follows.clear();
        work.counted.clear();
        friction.activated.clear();
        for &k in &self.frictional {
            let contact = &self.list[k];
            let (f, t) = (contact.normal_force, contact.tangential_force);
            // Those that carried nothing before roll, to begin with.
            let known = f > 0.0;
            let load = if known { f } else { self.normal_forces[k] };
            let acts = load > surface.critical_load;
            let limit = surface.friction * (f - friction.offset);
            friction.activated.push(acts);
            work.follows.push(if !acts {
                Follows::Not
            } else if known && t.abs() >= limit * (1.0 - 1e-9) {
                Follows::Load(surface.friction.copysign(t))
            } else {
                Follows::Slip
            });
        }
    }

    /// Normal forces (of either sign) and friction that the states at hand give; `false` if their system is singular.
    fn solve_states(&mut self) -> bool {
        let (g_nn, g_tn) = (&self.g_nn, &self.g_tn);
        let friction = &mut self.friction;
        let work = &mut friction.newton;
        work.active.clear();
        work.active
            .extend((0..work.closed.len()).filter(|&k| work.closed[k]));
        let size = work.active.len();
        work.follow_slip(g_nn, g_tn, &self.frictional, &self.list);
        work.constant.clear();
        for ((&k, &slip), follows) in self
            .frictional
            .iter()
            .zip(&self.free_slip)
            .zip(&work.follows)
        {
            work.constant.push(match *follows {
                Follows::Not => 0.0,
                Follows::Slip => self.list[k].slip_resistance * slip,
                Follows::Load(factor) => -factor * friction.offset,
            });
        }
        friction.q.clear();
        friction.q.extend(
            self.free_normal
                .iter()
                .zip(&friction.bias)
                .map(|(v, b)| v + b),
        );
        // Until the solution is known: q with the constant part of the friction.
        g_tn.subtract_transposed_product(&work.constant, &mut friction.q);
        work.solution.clear();
        work.solution
            .extend(work.active.iter().map(|&k| -friction.q[k]));
        let matrix = work.solver.matrix_mut();
        matrix.reshape(size, size);
        for (column, &k) in work.active.iter().enumerate() {
            let target = matrix.column_mut(column);
            let source = work.symmetric.column(k);
            for (entry, &a) in target.iter_mut().zip(&work.active) {
                *entry = source[a];
            }
            target[column] += COMPLIANCE;
        }
        for (m, follows) in work.follows.iter().enumerate() {
            let Follows::Load(factor) = *follows else {
                continue;
            };
            if let Ok(column) = work.active.binary_search(&self.frictional[m]) {
                let target = matrix.column_mut(column);
                for (entry, &a) in target.iter_mut().zip(&work.active) {
                    *entry -= factor * g_tn[(m, a)];
                }
            }
        }
        if work.solver.solve(&mut work.solution).is_err()
            || !work.solution.iter().all(|x| x.is_finite())
        {
            return false;
        }
        self.normal_forces.clear();
        self.normal_forces.resize(work.closed.len(), 0.0);
        for (&k, &f) in work.active.iter().zip(&work.solution) {
            self.normal_forces[k] = f;
        }
        // Slip under the normal forces; friction follows.
        friction.wanted.clone_from(&self.free_slip);
        g_tn.add_product(&self.normal_forces, &mut friction.wanted);
        friction.applied.clear();
        for ((&k, &slip), follows) in self
            .frictional
            .iter()
            .zip(&friction.wanted)
            .zip(&work.follows)
        {
            let contact = &self.list[k];
            friction.applied.push(match *follows {
                Follows::Not => 0.0,
                Follows::Slip => contact.slip_resistance * slip,
                Follows::Load(factor) => factor * (self.normal_forces[k] - friction.offset),
            });
        }
        friction.q.clear();
        friction.q.extend(
            self.free_normal
                .iter()
                .zip(&friction.bias)
                .map(|(v, b)| v + b),
        );
        g_tn.subtract_transposed_product(&friction.applied, &mut friction.q);
        true
    }

    /// Counts the states that the forces at hand contradict, and changes them, all or some; with the friction error.
    fn mend(&mut self, surface: &Surface, deciding: bool, chance: &mut Chance) -> (usize, f64) {
        let friction = &mut self.friction;
        let work = &mut friction.newton;
        let closed = &mut work.closed;
        let mut found = self.normal.exchange(
            &self.g_nn,
            &friction.q,
            &mut self.normal_forces,
            closed,
            chance,
        );
        let f = &self.normal_forces;
        let largest = f.iter().fold(0.0, |m: f64, x| m.max(*x));
        let mut error: f64 = 0.0;
        for (m, &k) in self.frictional.iter().enumerate() {
            let contact = &mut self.list[k];
            let loaded = f[k] > surface.critical_load;
            if deciding && friction.activated[m] != loaded {
                friction.activated[m] = loaded;
                found += 1;
            }
            let slip = friction.wanted[m];
            let (force, state) = if friction.activated[m] {
                let load = f[k] - friction.offset;
                law(slip, contact.slip_resistance, surface.friction, load)
            } else {
                (0.0, ContactState::Frictionless)
            };
            contact.state = state;
            let change = (force - friction.applied[m]).abs();
            // A state that gives the force the law gives may stay, whatever it is called.
            if change <= STANDSTILL * largest {
                error = error.max(change);
                continue;
            }
            found += 1;
            if !chance.draw() {
                continue;
            }
            work.follows[m] = match state {
                ContactState::Frictionless => Follows::Not,
                ContactState::Rolling => Follows::Slip,
                ContactState::Slipping => Follows::Load(surface.friction.copysign(slip)),
            };
        }
        (found, if error == 0.0 { 0.0 } else { error / largest })
    }
}
