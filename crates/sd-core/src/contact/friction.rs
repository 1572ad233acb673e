//! Friction with a critical load, and the iteration that makes it consistent with the normal forces.
//!
//! ```text
//! F_roll = K u_t,   K > 0 the inverse slip mobility of the isolated pair, u_t the slip that normal forces alone would leave
//! f ≤ F_crit: F_t = 0;   |F_roll| ≤ ν f: F_t = F_roll (rolls);   else F_t = ν f sign(u_t) (slips)
//! ```
//!
//! Steps 4 to 6 of the paper, with the sign of (19) mended: friction opposes slip.

use super::newton::{self, Outcome};
use super::{ContactState, Contacts, Quality, Surface};
use crate::linalg::dense::{add_scaled, dot};

/// Largest number of passes between friction and normal forces.
const MOST_PASSES: u32 = 200;
/// Passes in which the set of activated contacts is still decided; then it is held, since the law jumps at `F_crit` and a
/// self-consistent set need not exist.
pub(super) const DECIDING_PASSES: u32 = 4;
/// Change of the friction forces, over the largest force, at which they stand still.
pub(super) const STANDSTILL: f64 = 1e-11;
/// Depth of the Anderson acceleration.
const DEPTH: usize = 5;

/// The friction force and what the contact does.
///
/// `slip`: u_t under normal forces alone, in a·rate. `normal_force`: f > `F_crit`. Returns `F_t`, with the sign of the slip.
pub fn law(
    slip: f64,
    slip_resistance: f64,
    friction: f64,
    normal_force: f64,
) -> (f64, ContactState) {
    let roll = slip_resistance * slip;
    let limit = friction * normal_force;
    if roll.abs() <= limit {
        (roll, ContactState::Rolling)
    } else {
        (limit.copysign(roll), ContactState::Slipping)
    }
}

/// Vectors of the friction iteration, one entry per frictional candidate but where said otherwise.
#[derive(Default)]
pub(super) struct Workspace {
    /// Friction forces that went into the last normal problem.
    pub(super) applied: Vec<f64>,
    /// What the law makes of the result.
    pub(super) wanted: Vec<f64>,
    /// Best of `applied` so far.
    best: Vec<f64>,
    /// Whether friction acts.
    pub(super) activated: Vec<bool>,
    /// Bias of every candidate: what w has besides `v_n`.
    pub(super) bias: Vec<f64>,
    /// Load taken off before friction: 0 for the paper's law.
    pub(super) offset: f64,
    /// q of the normal problem, one entry per candidate.
    pub(super) q: Vec<f64>,
    /// Newton's method, which comes first.
    pub(super) newton: newton::Workspace,
    /// Acceleration.
    anderson: Anderson,
}

impl Workspace {
    /// Room for that many candidates.
    pub(super) fn new(candidates: usize) -> Self {
        let vector = || Vec::with_capacity(candidates);
        Self {
            applied: vector(),
            wanted: vector(),
            best: vector(),
            activated: Vec::with_capacity(candidates),
            bias: vector(),
            offset: 0.0,
            q: vector(),
            newton: newton::Workspace::new(candidates),
            anderson: Anderson::new(candidates),
        }
    }
}

impl Contacts {
    /// Normal forces without friction, w = `v_n` + bias.
    pub(super) fn solve_frictionless(&mut self) {
        let work = &mut self.friction;
        work.q.clear();
        work.q
            .extend(self.free_normal.iter().zip(&work.bias).map(|(v, b)| v + b));
        self.normal_forces.resize(self.list.len(), 0.0);
        self.normal
            .solve(&self.g_nn, &work.q, &mut self.normal_forces);
    }

    /// Residual of the normal problem last solved.
    pub(super) fn normal_residual(&mut self) -> f64 {
        self.normal
            .residual(&self.g_nn, &self.friction.q, &self.normal_forces)
    }

    /// Normal forces, w = `v_n` + bias, and friction that agree, put into `list`: by Newton's method, or by alternating the normal
    /// problem with the friction law until the forces stand still.
    ///
    /// Slip must have been reduced. Starts from the friction forces in `list`. `None` if a candidate whose slip was not
    /// reduced exceeds the critical load: it has then joined `frictional`.
    pub(super) fn solve_frictional(&mut self, surface: &Surface) -> Option<Quality> {
        match self.solve_by_newton(surface) {
            Outcome::Solved(systems, error) => Some(self.take_frictional(systems, error)),
            Outcome::Admitted => None,
            Outcome::Cycled(systems) => self.iterate(surface, systems, false),
        }
    }

    /// The fixed point of [`Contacts::solve_frictional`], after so many passes `before`; from the friction in `list`, then from none.
    fn iterate(&mut self, surface: &Surface, before: u32, from_rest: bool) -> Option<Quality> {
        let count = self.frictional.len();
        let work = &mut self.friction;
        work.applied.clear();
        work.applied.extend(self.frictional.iter().map(|&k| {
            if from_rest {
                0.0
            } else {
                self.list[k].tangential_force
            }
        }));
        work.activated.clear();
        work.activated.resize(count, false);
        work.wanted.clear();
        work.wanted.resize(count, 0.0);
        work.anderson.restart();
        let mut best = f64::INFINITY;
        let mut error = f64::INFINITY;
        let mut passes = 0;
        while passes < MOST_PASSES {
            error = self.pass(surface, passes < DECIDING_PASSES);
            let admitting = passes < DECIDING_PASSES || self.friction.offset > 0.0;
            if admitting && self.admit_loaded(surface) {
                return None;
            }
            passes += 1;
            let decided = passes >= DECIDING_PASSES;
            if decided && error <= STANDSTILL {
                best = error;
                break;
            }
            let work = &mut self.friction;
            if decided {
                if error < best {
                    best = error;
                    work.best.clone_from(&work.applied);
                }
                work.anderson.advance(&mut work.applied, &work.wanted);
            } else {
                work.applied.clone_from(&work.wanted);
            }
        }
        if best > STANDSTILL {
            // The forces of the best pass, so that f is exact for the friction applied with it.
            let work = &mut self.friction;
            work.applied.clone_from(&work.best);
            error = self.pass(surface, false);
            if error > Quality::FRICTION_LIMIT {
                if let Some(solved) = self.solve_held(surface) {
                    error = solved;
                } else if !from_rest {
                    return self.iterate(surface, before + passes, true);
                } else {
                    let work = &mut self.friction;
                    work.applied.clone_from(&work.best);
                    error = self.pass(surface, false);
                }
            }
        }
        Some(self.take_frictional(before + passes, error))
    }

    /// Puts the forces found into `list`.
    fn take_frictional(&mut self, passes: u32, error: f64) -> Quality {
        for (contact, &f) in self.list.iter_mut().zip(&self.normal_forces) {
            contact.normal_force = f;
            contact.tangential_force = 0.0;
        }
        for (m, &k) in self.frictional.iter().enumerate() {
            let contact = &mut self.list[k];
            contact.tangential_force = self.friction.applied[m];
            if !self.friction.activated[m] || contact.normal_force == 0.0 {
                contact.state = ContactState::Frictionless;
            }
        }
        Quality {
            residual: self.normal_residual(),
            friction_error: error,
            passes,
        }
    }

    /// Adds to `frictional` the candidates above the critical load that it lacks; whether there were any.
    pub(super) fn admit_loaded(&mut self, surface: &Surface) -> bool {
        let before = self.frictional.len();
        for (k, &f) in self.normal_forces.iter().enumerate() {
            if f > surface.critical_load && self.frictional[..before].binary_search(&k).is_err() {
                self.frictional.push(k);
            }
        }
        self.frictional.sort_unstable();
        self.frictional.len() > before
    }

    /// Normal forces under the friction applied, and the friction the law then wants; returns the friction error.
    fn pass(&mut self, surface: &Surface, deciding: bool) -> f64 {
        let work = &mut self.friction;
        work.q.clear();
        work.q
            .extend(self.free_normal.iter().zip(&work.bias).map(|(v, b)| v + b));
        self.g_tn
            .subtract_transposed_product(&work.applied, &mut work.q);
        self.normal
            .solve(&self.g_nn, &work.q, &mut self.normal_forces);
        let f = &self.normal_forces;
        work.wanted.clone_from(&self.free_slip);
        self.g_tn.add_product(f, &mut work.wanted);
        let largest = f.iter().fold(0.0, |m: f64, x| m.max(*x));
        let mut change: f64 = 0.0;
        for (m, &k) in self.frictional.iter().enumerate() {
            let contact = &mut self.list[k];
            if deciding || work.offset > 0.0 {
                work.activated[m] = f[k] > surface.critical_load;
            }
            let (force, state) = if work.activated[m] {
                law(
                    work.wanted[m],
                    contact.slip_resistance,
                    surface.friction,
                    f[k] - work.offset,
                )
            } else {
                (0.0, ContactState::Frictionless)
            };
            contact.state = state;
            work.wanted[m] = force;
            change = change.max((force - work.applied[m]).abs());
        }
        if change == 0.0 { 0.0 } else { change / largest }
    }
}

/// Anderson acceleration of a fixed point x = g(x) (Walker & Ni 2011, type II), by modified Gram-Schmidt.
#[derive(Default)]
pub(super) struct Anderson {
    /// Last x.
    x: Vec<f64>,
    /// Last residual g(x) − x.
    r: Vec<f64>,
    /// Differences of g(x), newest last.
    image_steps: Vec<Vec<f64>>,
    /// Differences of the residual, newest last.
    residual_steps: Vec<Vec<f64>>,
    /// How many differences are kept at the moment.
    kept: usize,
    /// Whether x and r hold anything.
    started: bool,
    /// Orthonormal basis of the residual steps.
    basis: Vec<Vec<f64>>,
}

impl Anderson {
    /// Room for that many unknowns.
    pub(super) fn new(unknowns: usize) -> Self {
        let vector = || Vec::with_capacity(unknowns);
        let vectors = || (0..DEPTH).map(|_| vector()).collect();
        Self {
            x: vector(),
            r: vector(),
            image_steps: vectors(),
            residual_steps: vectors(),
            basis: vectors(),
            ..Self::default()
        }
    }

    /// Forgets the past.
    pub(super) fn restart(&mut self) {
        self.kept = 0;
        self.started = false;
        for store in [
            &mut self.image_steps,
            &mut self.residual_steps,
            &mut self.basis,
        ] {
            store.resize_with(DEPTH, Vec::new);
        }
    }

    /// Replaces x by the next guess; `image` is g(x).
    pub(super) fn advance(&mut self, x: &mut [f64], image: &[f64]) {
        let n = x.len();
        if self.started {
            if self.kept == DEPTH {
                self.image_steps.rotate_left(1);
                self.residual_steps.rotate_left(1);
                self.kept -= 1;
            }
            let (dg, dr) = (
                &mut self.image_steps[self.kept],
                &mut self.residual_steps[self.kept],
            );
            dg.clear();
            dr.clear();
            for k in 0..n {
                let r = image[k] - x[k];
                dr.push(r - self.r[k]);
                dg.push(image[k] - (self.x[k] + self.r[k]));
            }
            self.kept += 1;
        }
        self.x.clear();
        self.x.extend_from_slice(x);
        self.r.clear();
        self.r
            .extend(image.iter().zip(x.iter()).map(|(g, x)| g - x));
        self.started = true;
        let gamma = self.least_squares();
        x.copy_from_slice(image);
        for (step, weight) in self.image_steps[..self.kept].iter().zip(gamma) {
            add_scaled(x, step, -weight);
        }
    }

    /// Weights γ that make |r − ΔR γ| least; nearly dependent steps get none.
    fn least_squares(&mut self) -> [f64; DEPTH] {
        let kept = self.kept;
        let mut triangle = [[0.0; DEPTH]; DEPTH];
        let mut rhs = [0.0; DEPTH];
        let mut used = [false; DEPTH];
        // Newest first: the older step is the one to drop when two agree.
        for column in (0..kept).rev() {
            let (basis, step) = (&mut self.basis, &self.residual_steps[column]);
            let mut q = std::mem::take(&mut basis[column]);
            q.clear();
            q.extend_from_slice(step);
            let before = dot(&q, &q).sqrt();
            for other in (column + 1..kept).rev() {
                if used[other] {
                    let projection = dot(&basis[other], &q);
                    triangle[other][column] = projection;
                    add_scaled(&mut q, &basis[other], -projection);
                }
            }
            let norm = dot(&q, &q).sqrt();
            if norm > 1e-10 * before {
                used[column] = true;
                triangle[column][column] = norm;
                for x in &mut q {
                    *x /= norm;
                }
                rhs[column] = dot(&q, &self.r);
            }
            basis[column] = q;
        }
        // Column c is Σ_{o ≥ c} triangle[o][c] q_o, so the oldest unknown stands alone in its own row.
        let mut gamma = [0.0; DEPTH];
        for row in 0..kept {
            if used[row] {
                let known: f64 = (0..row).map(|c| triangle[row][c] * gamma[c]).sum();
                gamma[row] = (rhs[row] - known) / triangle[row][row];
            }
        }
        gamma
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_has_the_sign_of_the_slip_and_is_limited() {
        assert_eq!(law(0.1, 20.0, 0.5, 10.0), (2.0, ContactState::Rolling));
        assert_eq!(law(-1.0, 20.0, 0.5, 10.0), (-5.0, ContactState::Slipping));
        assert_eq!(law(1.0, 20.0, 0.0, 10.0), (0.0, ContactState::Slipping));
    }

    #[test]
    fn anderson_solves_a_linear_fixed_point_in_as_many_steps_as_unknowns() {
        // g(x) = A x + b with spectral radius above 1: the plain iteration diverges.
        let g = |x: &[f64]| {
            vec![
                1.5 * x[0] - 0.3 * x[1] + 1.0,
                0.4 * x[0] + 0.2 * x[1] - 2.0,
                -2.0 * x[2] + 0.1 * x[0] + 0.5,
            ]
        };
        let mut anderson = Anderson::default();
        anderson.restart();
        let mut x = vec![0.0; 3];
        for _ in 0..5 {
            let image = g(&x);
            anderson.advance(&mut x, &image);
        }
        let image = g(&x);
        for k in 0..3 {
            assert!((image[k] - x[k]).abs() < 1e-9);
        }
    }
}
