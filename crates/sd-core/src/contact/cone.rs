//! All normal and tangential forces of a stage at once: complementarity in boxes that grow with the normal forces.
//!
//! ```text
//! w = q_n + G_nn f − G_nt F ≥ 0,   f ≥ 0,   f·w = 0
//! z = q_t + G_tn f − G_tt F,       |F| ≤ ρ(f),   z > 0 only where F = ρ,   z < 0 only where F = −ρ
//! ρ(f) = ν max(f − f0, 0) on rows where friction acts, 0 on others; ν = ∞: any force while f > 0
//! ```
//!
//! In the plane Coulomb's cone is this box: a quasi-complementarity problem, linear once each contact is known to be open, to
//! stick or to slip to either side. A semi-smooth Newton method (Alart & Curnier 1991) guesses these states, solves the linear system
//! they give, and mends the states that its solution contradicts; started from the last states it mostly needs one or two systems.
//! Where it cycles, compliance is added about the forces at hand, which makes the problem an easy one, and taken away again step by
//! step: the proximal point method. What is accepted is measured: the residual below vanishes exactly at a solution.
//!
//! Compliance of springs and offsets of their history are part of G and q: see [`super::laws`].

use crate::linalg::dense::{Matrix, add_scaled};
use crate::linalg::lu::LuSolver;

/// Newton steps before other ways are tried.
const FIRST_STEPS: u32 = 8;
/// Newton steps of a proximal problem.
const MOST_STEPS: u32 = 12;
/// Steps without fewer contradictions after which only some of them are mended at a time, chosen by chance: that ends most cycles.
const PATIENCE: u32 = 2;
/// Proximal problems before the best forces so far are given back, with their residual.
const MOST_ROUNDS: u32 = 60;
/// Compliance of the first proximal problem, over the largest entry of the diagonal.
const FIRST_COMPLIANCE: f64 = 3.0;
/// What it is divided by after the first problem that is solved; at most.
const STIFFENING: [f64; 2] = [10.0, 1e3];
/// At least, after some that are not.
const LEAST_STIFFENING: f64 = 2.0;
/// Residual over the largest velocity at which proximal problems end.
const SOLVED: f64 = 1e-12;

/// What a tangential row does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Grip {
    /// No force: friction does not act, or there is no load.
    Off,
    /// Within the box, z = 0.
    Stick,
    /// F = ρ.
    Plus,
    /// F = −ρ.
    Minus,
}

/// One problem: K contacts, M tangential rows.
pub(super) struct Problem<'p> {
    /// `[K × K]`, symmetric.
    pub(super) g_nn: &'p Matrix,
    /// `[M × K]`.
    pub(super) g_tn: &'p Matrix,
    /// `[M × M]`, symmetric.
    pub(super) g_tt: &'p Matrix,
    /// q_n, one per contact.
    pub(super) q_n: &'p [f64],
    /// q_t, one per row.
    pub(super) q_t: &'p [f64],
    /// Contact of each row.
    pub(super) contact: &'p [usize],
    /// Whether friction acts, for each row.
    pub(super) acts: &'p [bool],
    /// ν, or infinity.
    pub(super) friction: f64,
    /// f0.
    pub(super) offset: f64,
    /// Compliance on both diagonals besides.
    pub(super) compliance: f64,
}

impl Problem<'_> {
    /// Half width ρ of the box of a row.
    fn limit(&self, row: usize, f: &[f64]) -> f64 {
        let load = f[self.contact[row]] - self.offset;
        if load > 0.0 && self.acts[row] {
            self.friction * load
        } else {
            0.0
        }
    }

    /// w and z.
    fn velocities(&self, f: &[f64], t: &[f64], w: &mut Vec<f64>, z: &mut Vec<f64>) {
        w.clear();
        w.extend_from_slice(self.q_n);
        self.g_nn.add_product(f, w);
        self.g_tn.subtract_transposed_product(t, w);
        add_scaled(w, f, self.compliance);
        z.clear();
        z.extend_from_slice(self.q_t);
        self.g_tn.add_product(f, z);
        self.g_tt.subtract_transposed_product(t, z);
        add_scaled(z, t, -self.compliance);
    }
}

/// How well a problem is solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Merit {
    /// `max |min(G_kk f, w)|` and `max |G_mm (F − clamp(F + z/G_mm, −ρ, ρ))|`, whichever is larger.
    pub(super) residual: f64,
    /// `max |F − clamp(F + z/G_mm, −ρ, ρ)|` over the largest normal force.
    pub(super) friction_error: f64,
}

/// Which contradictions a step mends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Chance {
    /// All of them.
    All,
    /// Each with an even chance; the state of a generator whose numbers are the same on every machine.
    Some(u64),
}

impl Chance {
    /// Whether the next one is mended.
    pub(super) fn draw(&mut self) -> bool {
        match self {
            Self::All => true,
            Self::Some(state) => {
                // Knuth's MMIX generator; its high bits are the good ones.
                *state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                *state >> 63 == 1
            }
        }
    }
}

/// States, forces and workspace of the solver.
#[derive(Default)]
pub(super) struct Cone {
    /// Whether each contact is closed.
    pub(super) closed: Vec<bool>,
    /// What each row does.
    pub(super) grip: Vec<Grip>,
    /// Normal forces.
    pub(super) normal: Vec<f64>,
    /// Tangential forces.
    pub(super) tangential: Vec<f64>,
    /// w of the forces at hand.
    w: Vec<f64>,
    /// z of the forces at hand.
    z: Vec<f64>,
    /// Unknowns of the linear system: closed contacts, then sticking rows.
    unknowns: [Vec<usize>; 2],
    /// Right-hand side and solution.
    solution: Vec<f64>,
    /// One column of the system over all contacts and rows.
    column: [Vec<f64>; 2],
    /// Normal and tangential forces about which a proximal problem is.
    centre: [Vec<f64>; 2],
    /// Its q.
    shifted: [Vec<f64>; 2],
    /// Best normal and tangential forces so far.
    best: [Vec<f64>; 2],
    /// Solver of the linear systems.
    solver: LuSolver,
}

impl Cone {
    /// Room for that many contacts.
    pub(super) fn new(contacts: usize) -> Self {
        let vector = || Vec::with_capacity(2 * contacts);
        Self {
            closed: Vec::with_capacity(contacts),
            grip: Vec::with_capacity(2 * contacts),
            normal: vector(),
            tangential: vector(),
            w: vector(),
            z: vector(),
            unknowns: [
                Vec::with_capacity(contacts),
                Vec::with_capacity(2 * contacts),
            ],
            solution: Vec::with_capacity(3 * contacts),
            column: [vector(), vector()],
            centre: [vector(), vector()],
            shifted: [vector(), vector()],
            best: [vector(), vector()],
            solver: LuSolver::new(contacts),
        }
    }

    /// w of the solution.
    pub(super) fn slack(&self) -> &[f64] {
        &self.w
    }

    /// Solves from the states at hand; the forces and states are then those of the solution, or of the best found.
    ///
    /// Returns how well, and the number of linear systems.
    pub(super) fn solve(&mut self, problem: &Problem<'_>) -> (Merit, u32) {
        let mut best = Merit {
            residual: f64::INFINITY,
            friction_error: f64::INFINITY,
        };
        self.normal.resize(problem.q_n.len(), 0.0);
        self.tangential.resize(problem.q_t.len(), 0.0);
        self.keep_best(problem, &mut best);
        let (done, mut passes) = self.newton(problem, FIRST_STEPS);
        self.keep_best(problem, &mut best);
        if !done {
            passes += self.approach(problem, &mut best);
        }
        self.restore_best();
        self.read_states(problem);
        problem.velocities(&self.normal, &self.tangential, &mut self.w, &mut self.z);
        (best, passes)
    }

    /// Solves a row of proximal problems, each about the solution of the one before; returns the number of linear systems.
    fn approach(&mut self, problem: &Problem<'_>, best: &mut Merit) -> u32 {
        let diagonal = (0..problem.q_n.len()).map(|k| problem.g_nn[(k, k)]);
        let mut compliance = FIRST_COMPLIANCE * diagonal.fold(0.0, f64::max);
        let velocities = problem.q_n.iter().chain(problem.q_t);
        let solved = SOLVED * velocities.fold(0.0, |m: f64, q| m.max(q.abs()));
        let mut passes = 0;
        let (mut factor, mut growth) = (STIFFENING[0], STIFFENING[0]);
        self.restore_best();
        self.read_states(problem);
        self.centre[0].clone_from(&self.normal);
        self.centre[1].clone_from(&self.tangential);
        for _ in 0..MOST_ROUNDS {
            let [mut q_n, mut q_t] = std::mem::take(&mut self.shifted);
            q_n.clear();
            q_n.extend_from_slice(problem.q_n);
            add_scaled(&mut q_n, &self.centre[0], -compliance);
            q_t.clear();
            q_t.extend_from_slice(problem.q_t);
            add_scaled(&mut q_t, &self.centre[1], compliance);
            let proximal = Problem {
                q_n: &q_n,
                q_t: &q_t,
                compliance,
                ..*problem
            };
            let (done, steps) = self.newton(&proximal, MOST_STEPS);
            passes += steps;
            if done {
                self.admit(problem);
                self.centre[0].clone_from(&self.normal);
                self.centre[1].clone_from(&self.tangential);
                if steps == 1 {
                    // Where the states stand, only the last digits are missing.
                    factor = (factor * growth).min(STIFFENING[1]);
                }
                compliance /= factor;
            } else {
                self.normal.clone_from(&self.centre[0]);
                self.tangential.clone_from(&self.centre[1]);
                compliance *= STIFFENING[0].max(factor);
                factor = factor.sqrt().max(LEAST_STIFFENING);
                growth = growth.sqrt();
            }
            self.read_states(problem);
            self.shifted = [q_n, q_t];
            self.keep_best(problem, best);
            if best.residual <= solved {
                break;
            }
        }
        passes
    }

    /// Brings the best forces so far back.
    fn restore_best(&mut self) {
        let [normal, tangential] = &self.best;
        self.normal.clone_from(normal);
        self.tangential.clone_from(tangential);
    }

    /// Makes the forces at hand admissible.
    fn admit(&mut self, problem: &Problem<'_>) {
        for f in &mut self.normal {
            *f = f.max(0.0);
        }
        for m in 0..self.tangential.len() {
            let limit = problem.limit(m, &self.normal);
            self.tangential[m] = self.tangential[m].clamp(-limit, limit);
        }
    }

    /// Measures the forces at hand, made admissible, and keeps them if there were none better.
    fn keep_best(&mut self, problem: &Problem<'_>, best: &mut Merit) {
        self.admit(problem);
        let merit = self.merit(problem);
        // Also from not-a-number, which a broken system leaves.
        if merit.residual < best.residual || best.residual.is_infinite() {
            *best = merit;
            self.best[0].clone_from(&self.normal);
            self.best[1].clone_from(&self.tangential);
        }
    }

    /// Merit of the forces at hand.
    fn merit(&mut self, problem: &Problem<'_>) -> Merit {
        problem.velocities(&self.normal, &self.tangential, &mut self.w, &mut self.z);
        let mut residual: f64 = 0.0;
        let mut error: f64 = 0.0;
        let mut largest = f64::MIN_POSITIVE;
        for (k, &f) in self.normal.iter().enumerate() {
            let violation = (problem.g_nn[(k, k)] * f).min(self.w[k]).abs();
            residual = if violation.is_nan() {
                f64::INFINITY
            } else {
                residual.max(violation)
            };
            largest = largest.max(f);
        }
        for (m, &t) in self.tangential.iter().enumerate() {
            let (limit, own) = (problem.limit(m, &self.normal), problem.g_tt[(m, m)]);
            let off = (t - (t + self.z[m] / own).clamp(-limit, limit)).abs();
            residual = if off.is_nan() {
                f64::INFINITY
            } else {
                residual.max(own * off)
            };
            error = error.max(off);
        }
        Merit {
            residual,
            friction_error: error / largest,
        }
    }

    /// Newton steps until no state is contradicted; whether that was reached, and how many.
    fn newton(&mut self, problem: &Problem<'_>, most: u32) -> (bool, u32) {
        let mut fewest = usize::MAX;
        let mut patience = PATIENCE;
        let mut chance = Chance::All;
        for step in 1..=most {
            if !self.solve_states(problem) {
                return (false, step);
            }
            problem.velocities(&self.normal, &self.tangential, &mut self.w, &mut self.z);
            let contradictions = self.mend(problem, &mut chance);
            if contradictions == 0 {
                return (true, step);
            }
            if contradictions < fewest {
                fewest = contradictions;
                patience = PATIENCE;
                chance = Chance::All;
            } else {
                patience = patience.saturating_sub(1);
                if patience == 0 && chance == Chance::All {
                    chance = Chance::Some(u64::from(step));
                }
            }
        }
        (false, most)
    }

    /// Counts the states that the forces at hand contradict, and changes them, all or some.
    fn mend(&mut self, problem: &Problem<'_>, chance: &mut Chance) -> usize {
        let largest = |values: &[f64]| values.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        // Forces below rounding of the largest, or velocities below rounding of theirs, decide nothing.
        let force_zero = 1e-13 * largest(&self.normal).max(largest(&self.tangential));
        let scale = 1e-12 * largest(problem.q_n).max(largest(problem.q_t));
        let mut found = 0;
        for k in 0..self.closed.len() {
            let wrong = if self.closed[k] {
                self.normal[k] < -force_zero
            } else {
                self.w[k] < -scale
            };
            if wrong {
                found += 1;
                self.closed[k] ^= chance.draw();
            }
        }
        for m in 0..self.grip.len() {
            let k = problem.contact[m];
            let load = self.normal[k] - problem.offset;
            let limit = problem.friction * load;
            let (t, z) = (self.tangential[m], self.z[m]);
            let gripped = problem.acts[m] && self.closed[k];
            let slipping = |towards: f64| {
                if towards > 0.0 {
                    Grip::Plus
                } else {
                    Grip::Minus
                }
            };
            let next = match self.grip[m] {
                _ if !gripped => Grip::Off,
                // A contact that has just closed grips; one whose load came over the offset slips as it did.
                Grip::Off if load <= force_zero && problem.offset > 0.0 => Grip::Off,
                Grip::Off if problem.offset > 0.0 && problem.friction.is_finite() => slipping(z),
                Grip::Off => Grip::Stick,
                _ if load < -force_zero && problem.offset > 0.0 => Grip::Off,
                Grip::Stick if problem.friction.is_finite() && t.abs() > limit + force_zero => {
                    slipping(t)
                }
                Grip::Plus if z < -scale => Grip::Stick,
                Grip::Minus if z > scale => Grip::Stick,
                same => same,
            };
            if next != self.grip[m] {
                found += 1;
                if chance.draw() {
                    self.grip[m] = next;
                }
            }
        }
        found
    }

    /// States that the forces at hand show.
    pub(super) fn read_states(&mut self, problem: &Problem<'_>) {
        self.closed.clear();
        self.closed.extend(self.normal.iter().map(|&f| f > 0.0));
        self.grip.clear();
        for (m, &t) in self.tangential.iter().enumerate() {
            let limit = problem.limit(m, &self.normal);
            self.grip.push(if limit == 0.0 {
                Grip::Off
            } else if t.abs() < limit * (1.0 - 1e-12) {
                Grip::Stick
            } else if t > 0.0 {
                Grip::Plus
            } else {
                Grip::Minus
            });
        }
    }

    /// Forces that the states at hand give; `false` if their system is singular.
    ///
    /// With p = −F on sticking rows the system is symmetric but for the columns of contacts that slip, whose friction
    /// follows the load: `F = ±ν (f − f0)`.
    fn solve_states(&mut self, problem: &Problem<'_>) -> bool {
        let [active, sticking] = &mut self.unknowns;
        active.clear();
        active.extend((0..self.closed.len()).filter(|&k| self.closed[k]));
        sticking.clear();
        sticking.extend((0..self.grip.len()).filter(|&m| self.grip[m] == Grip::Stick));
        let (first, size) = (active.len(), active.len() + sticking.len());
        let matrix = self.solver.matrix_mut();
        matrix.reshape(size, size);
        for (c, &b) in active.iter().enumerate() {
            let target = matrix.column_mut(c);
            let (normal, tangential) = (problem.g_nn.column(b), problem.g_tn.column(b));
            for (entry, &a) in target.iter_mut().zip(active.iter()) {
                *entry = normal[a];
            }
            target[c] += problem.compliance;
            for (entry, &s) in target[first..].iter_mut().zip(sticking.iter()) {
                *entry = tangential[s];
            }
        }
        for (c, &s) in sticking.iter().enumerate() {
            let target = matrix.column_mut(first + c);
            for (entry, &a) in target.iter_mut().zip(active.iter()) {
                *entry = problem.g_tn[(s, a)];
            }
            let own = problem.g_tt.column(s);
            for (entry, &r) in target[first..].iter_mut().zip(sticking.iter()) {
                *entry = own[r];
            }
            target[first + c] += problem.compliance;
        }
        self.solution.clear();
        self.solution
            .extend(active.iter().map(|&a| -problem.q_n[a]));
        self.solution
            .extend(sticking.iter().map(|&s| -problem.q_t[s]));
        for (m, grip) in self.grip.iter().enumerate() {
            let slope = match grip {
                Grip::Plus => problem.friction,
                Grip::Minus => -problem.friction,
                Grip::Off | Grip::Stick => continue,
            };
            let Ok(c) = active.binary_search(&problem.contact[m]) else {
                continue;
            };
            // The column of p for this row, weighted with dp/df = −slope.
            let [on_active, on_sticking] = &mut self.column;
            on_active.clear();
            on_active.extend(active.iter().map(|&a| problem.g_tn[(m, a)]));
            let own = problem.g_tt.column(m);
            on_sticking.clear();
            on_sticking.extend(sticking.iter().map(|&s| own[s]));
            let (upper, lower) = matrix.column_mut(c).split_at_mut(first);
            add_scaled(upper, on_active, -slope);
            add_scaled(lower, on_sticking, -slope);
            if problem.offset > 0.0 {
                let (upper, lower) = self.solution.split_at_mut(first);
                add_scaled(upper, on_active, -slope * problem.offset);
                add_scaled(lower, on_sticking, -slope * problem.offset);
            }
        }
        if self.solver.solve(&mut self.solution).is_err()
            || !self.solution.iter().all(|x| x.is_finite())
        {
            return false;
        }
        self.normal.fill(0.0);
        for (&a, &f) in active.iter().zip(&self.solution) {
            self.normal[a] = f;
        }
        self.tangential.fill(0.0);
        for (&s, &p) in sticking.iter().zip(&self.solution[first..]) {
            self.tangential[s] = -p;
        }
        for (m, grip) in self.grip.iter().enumerate() {
            let load = problem.friction * (self.normal[problem.contact[m]] - problem.offset);
            match grip {
                Grip::Plus => self.tangential[m] = load,
                Grip::Minus => self.tangential[m] = -load,
                Grip::Off | Grip::Stick => {}
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// `[K × K]`, `[M × K]`, `[M × M]` of random normal and tangential columns, with a little compliance.
    fn matrices(columns: &[Vec<f64>]) -> [Matrix; 3] {
        let k = columns.len() / 2;
        let product = |a: &[Vec<f64>], b: &[Vec<f64>], compliance: f64| {
            let mut g = Matrix::zeros(a.len(), b.len());
            for (i, x) in a.iter().enumerate() {
                for (j, y) in b.iter().enumerate() {
                    g[(i, j)] = x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
                    if i == j {
                        g[(i, j)] += compliance;
                    }
                }
            }
            g
        };
        let (n, t) = columns[..2 * k].split_at(k);
        [product(n, n, 1e-3), product(t, n, 0.0), product(t, t, 1e-3)]
    }

    proptest! {
        #[test]
        fn conditions_hold_for_random_networks(
            columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 4..20),
            q in prop::collection::vec(-1.0..1.0f64, 20),
            friction in prop::sample::select(vec![0.1, 0.5, 1.0]),
            offset in prop::sample::select(vec![0.0, 0.05]),
        ) {
            let [g_nn, g_tn, g_tt] = matrices(&columns);
            let k = columns.len() / 2;
            // G_tn as the product of different columns has no diagonal of its own.
            let contact: Vec<usize> = (0..k).collect();
            let acts: Vec<bool> = (0..k).map(|m| m % 4 != 3).collect();
            let problem = Problem {
                g_nn: &g_nn,
                g_tn: &g_tn,
                g_tt: &g_tt,
                q_n: &q[..k],
                q_t: &q[10..10 + k],
                contact: &contact,
                acts: &acts,
                friction,
                offset,
                compliance: 0.0,
            };
            let mut cone = Cone::default();
            cone.closed.resize(k, true);
            cone.grip.resize(k, Grip::Stick);
            let (merit, _) = cone.solve(&problem);
            prop_assert!(merit.residual < 1e-9, "residual {}", merit.residual);
            for (m, &active) in acts.iter().enumerate() {
                let (f, t) = (cone.normal[m], cone.tangential[m]);
                let limit = if active { friction * (f - offset).max(0.0) } else { 0.0 };
                prop_assert!(f >= 0.0 && t.abs() <= limit);
            }
        }
    }
}
