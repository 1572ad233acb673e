//! Stokesian Dynamics of large layers: the far field is iterated on top of a sparse resistance that
//! has its near part.
//!
//! ```text
//! x = (−E; v),   q the force modes of the far field, M its mobility, M₀ that of isolated spheres, P a sparse approximation of M⁻¹
//! M q = x − V c,   Vᵀ q = 0,   q_F + R_n v − R_n,FE E = F        V: translations of the layer; R_n: the pair terms
//! q = P x + δ:     R_P v = F + (R_n + P)_FE E − δ_F,   R_P = P_FU + R_n         sparse, under forces −δ_F more
//! δ = P y:         y + (M − P⁻¹) (q₀ + W y) + V c = 0,   W = P − P (0; R_P⁻¹ (P ·)_F)
//! ```
//!
//! P is M₀⁻¹ and the inverse mobilities of near pairs ([`Resistance`] includes it in its terms);
//! M₀⁻¹ alone would suffice, with twice as many iterations, and R_P is then that of Ball-Melrose
//! hydrodynamics.
//!
//! W is symmetric, positive semidefinite and at most P, and `z = W y` obeys
//! `(W⁺ + M − P⁻¹) z + V c = −(M − P⁻¹) q₀`, `Vᵀ z = 0`, whose operator is at least M: positive
//! definite. Conjugate gradients, preconditioned with W minus the part that would violate the
//! constraint, need one product with M and one solve with R_P per iteration. Where M is far above
//! P⁻¹, in long waves, the pair terms resist little and W nearly vanishes, so the number of
//! iterations hardly depends on N.
//!
//! The far field does not resist a translation of the layer, but the pair terms resist it slightly,
//! as their two parts are not of the same order of multipoles: `Vᵀ W V` is small, and the mean
//! velocity balances the net force on the layer.
//!
//! The relative residual is `√(rᵀ W r)/√(qᵀ M₀ q)`, r = x − M q − V c. A remaining r acts on the
//! spheres like an additional background flow.

pub(crate) mod fixed_point;
mod local;
mod near_solver;
mod split;
mod uniform;

use crate::error::Error;
use crate::hydrodynamics::resistance::{FarProduct, Fluid, Resistance};
use crate::linalg::dense::{add_scaled, dot};
use crate::space::Layer;
use crate::space::cell::Cell;
use local::LocalResistance;
pub(crate) use near_solver::NearSolver;
use split::SplitMotion;
use uniform::{Uniform, translation, translations};

/// Tolerance of M over the requested relative residual; test
/// `linear_motion_is_that_of_the_dense_far_field`.
const OPERATOR_TOLERANCE: f64 = 0.1;

/// Outcome of an iteration.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Convergence {
    /// Iterations, each with one product with M and one solve with R_P for each part of the motion.
    pub iterations: u32,
    /// Evaluations of the map of contacts; 0 without contacts.
    pub evaluations: u32,
    /// Relative residual reached.
    pub residual: f64,
    /// Whether it is within the tolerance.
    pub converged: bool,
}

/// The far field of Stokesian Dynamics, iterated on top of a [`Resistance`] without it. Memory is
/// O(N).
pub struct IterativeFarField<S: Fluid = Layer> {
    /// M.
    operator: S::Operator,
    /// Diagonal of M₀⁻¹, strains first.
    drag: Vec<f64>,
    /// P.
    local: LocalResistance<S>,
    /// Relative residual to be reached.
    residual: f64,
    /// Limit of the iterations of one solve without contacts.
    most: u32,
    /// δ of the last solve.
    excess: Vec<f64>,
    work: Work<S>,
    split: SplitMotion<S>,
}

/// Vectors of the conjugate gradients, all modes of all spheres, strains first.
struct Work<S: Fluid> {
    /// q.
    densities: Vec<f64>,
    /// r.
    residual: Vec<f64>,
    /// `W r`.
    preconditioned: Vec<f64>,
    /// `P r`.
    pushed: Vec<f64>,
    /// `R_P⁻¹ (P r)_F`, as `(0; ·)`.
    lag: Vec<f64>,
    /// `P u`, u the search direction of y.
    direction: Vec<f64>,
    /// `p = W u`.
    step: Vec<f64>,
    /// `R_P⁻¹ (P u)_F`, as `(0; ·)`.
    step_lag: Vec<f64>,
    /// `M p + R_P⁻¹ (P u)_F`.
    image: Vec<f64>,
    /// Translations of the layer.
    uniform: Uniform<S>,
    solver: NearSolver<S>,
}

impl IterativeFarField {
    /// Default limit of the iterations of one solve without contacts.
    pub const MAX_ITERATIONS: u32 = 300;
}

impl<S: Fluid> IterativeFarField<S> {
    /// Plans for cells of the given sides.
    ///
    /// # Arguments
    /// - `cell`: periodic.
    /// - `radii`: one per sphere, in a.
    /// - `residual`: relative residual to be reached, 1e-7 to 1e-2; see the module.
    ///
    /// # Errors
    /// [`Error::NoSpheres`]; [`Error::OutOfRange`] for unbounded fluid, a radius or the residual.
    pub fn new(cell: &Cell<S>, radii: &[f64], residual: f64) -> Result<Self, Error> {
        if !(1e-7..=1e-2).contains(&residual) {
            return Err(Error::OutOfRange {
                field: "residual",
                value: residual,
                allowed: "1e-7 to 1e-2",
            });
        }
        let operator = S::Operator::new(cell, radii, OPERATOR_TOLERANCE * residual)?;
        let n = radii.len();
        let mut drag = vec![0.0; (S::STRAINS + S::MODES) * n];
        let (strains, velocities) = drag.split_at_mut(S::STRAINS * n);
        let spheres = strains.chunks_exact_mut(S::STRAINS);
        for ((e, v), &radius) in spheres.zip(S::by_sphere_mut(velocities)).zip(radii) {
            let single = S::far_drag(radius);
            let (of_e, of_v) = single.as_ref().split_at(S::STRAINS);
            e.copy_from_slice(of_e);
            v.as_mut().copy_from_slice(of_v);
        }
        let split = SplitMotion::new(&drag);
        let vector = || vec![0.0; drag.len()];
        Ok(Self {
            operator,
            local: LocalResistance::default(),
            residual,
            most: IterativeFarField::MAX_ITERATIONS,
            excess: vector(),
            work: Work {
                densities: vector(),
                residual: vector(),
                preconditioned: vector(),
                pushed: vector(),
                lag: vector(),
                direction: vector(),
                step: vector(),
                step_lag: vector(),
                image: vector(),
                uniform: Uniform::default(),
                solver: NearSolver::default(),
            },
            split,
            drag,
        })
    }

    /// Sets a limit of the iterations of one solve without contacts other than
    /// [`IterativeFarField::MAX_ITERATIONS`].
    pub fn limit_iterations(&mut self, most: u32) {
        self.most = most;
    }

    /// Discards the last solution: the next solve starts from Ball-Melrose.
    pub fn forget(&mut self) {
        self.excess.fill(0.0);
        self.split.forget();
    }

    /// Rounds the last solution with contacts to single precision, as in
    /// [`IterativeFarField::found`], so that the next solve starts from the same numbers after a
    /// restart.
    pub(crate) fn round(&mut self) {
        self.split.round();
    }

    /// Keeps the initial guess of the next solve with contacts for
    /// [`IterativeFarField::restore`].
    pub(crate) fn save(&mut self) {
        self.split.save();
    }

    /// Restores the initial guess as it was saved.
    pub(crate) fn restore(&mut self) {
        self.split.restore();
    }

    /// Initial guess of the next solve with contacts, in single precision: force modes and
    /// translations, scaled; `[12N + 4]`.
    pub(crate) fn found(&self) -> Vec<f32> {
        self.split.found()
    }

    /// Sets the initial guess of the next solve with contacts to the value of
    /// [`IterativeFarField::found`]; zero if that is empty.
    pub(crate) fn start_from(&mut self, found: &[f32]) {
        self.forget();
        self.split.start_from(found);
    }

    /// Products with M at the current positions.
    pub(crate) fn operator(&mut self) -> &mut S::Operator {
        &mut self.operator
    }

    /// Sets new positions. The next solve starts from the last solution.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OutOfRange`] for a cell of other sides.
    pub fn update(&mut self, cell: &Cell<S>, centres: &[S::Vector]) -> Result<(), Error> {
        self.operator.update(cell, centres)
    }

    /// Disturbance velocities `[3N]` under forces, without contacts. Allocates nothing after the
    /// first call.
    ///
    /// # Arguments
    /// - `near`: Ball-Melrose with or without the far field of near pairs, factored or held pair by
    ///   pair, updated at the positions of [`IterativeFarField::update`].
    /// - `strain`: background `(e1, e2, e3)`.
    /// - `forces`: external ones and those of [`Resistance::background_forces`] of `near`, `[3N]`.
    ///   External ones should sum to zero, since their sum meets hardly any resistance.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::NotConverged`].
    pub fn solve(
        &mut self,
        near: &Resistance<S>,
        strain: &S::Strain,
        forces: &[f64],
        velocities: &mut [f64],
    ) -> Result<Convergence, Error> {
        let half = self.check_lengths(near, forces, velocities)?;
        let Self {
            operator,
            drag,
            local,
            excess,
            work,
            ..
        } = self;
        local.update(drag, near);
        for ((v, f), excess) in velocities.iter_mut().zip(forces).zip(&excess[half..]) {
            *v = f - excess;
        }
        work.solver.start(near)?;
        work.solver.solve(near, velocities)?;
        if S::DRIFTS > 0 {
            work.uniform.update(near, local, &drag[half..]);
            work.uniform.solve(near, local, &mut work.solver)?;
        }
        // q = P x + δ, and the translation that makes the force on the layer zero.
        let x = &mut work.residual;
        for e in x[..half].chunks_exact_mut(S::STRAINS) {
            for (k, e) in e.iter_mut().enumerate() {
                *e = -strain[k];
            }
        }
        x[half..].copy_from_slice(velocities);
        local.apply(x, &mut work.densities);
        add_scaled(&mut work.densities, excess, 1.0);
        let c = work
            .uniform
            .against(translations::<S>(&work.densities[half..]));
        for (k, v) in velocities.iter_mut().enumerate() {
            *v += translation::<S>(c, k) - work.uniform.answer(c, k);
        }
        for (k, excess) in excess.iter_mut().enumerate() {
            *excess -= work.uniform.pushed(c, k);
        }
        // r = x − M q.
        x[half..].copy_from_slice(velocities);
        local.apply(x, &mut work.densities);
        add_scaled(&mut work.densities, excess, 1.0);
        operator.apply(&work.densities, &mut work.image);
        add_scaled(x, &work.image, -1.0);
        let mut before = 0.0;
        let mut reached = f64::INFINITY;
        for iterations in 0..=self.most {
            let square = work.precondition(near, local)?;
            let whole: f64 = weighted_square(&work.densities, drag);
            reached = if square > 0.0 {
                (square / whole).sqrt()
            } else {
                0.0
            };
            if reached <= self.residual {
                return Ok(Convergence {
                    iterations,
                    evaluations: 0,
                    residual: reached,
                    converged: true,
                });
            }
            if !reached.is_finite() || iterations == self.most {
                break;
            }
            let share = if iterations == 0 {
                0.0
            } else {
                square / before
            };
            before = square;
            work.turn(share);
            operator.apply(&work.step, &mut work.image);
            add_scaled(&mut work.image, &work.step_lag, 1.0);
            let length = square / dot(&work.step, &work.image);
            add_scaled(&mut work.densities, &work.step, length);
            add_scaled(&mut work.residual, &work.image, -length);
            add_scaled(velocities, &work.step_lag[half..], -length);
            add_scaled(excess, &work.direction, length);
        }
        let iterations = self.most;
        self.forget();
        Err(Error::NotConverged {
            quantity: "the far field",
            iterations,
            residual: reached,
            wanted: self.residual,
        })
    }

    /// Adds the far field, beyond P, to the result of [`Resistance::apply`] of `near` for the
    /// velocities of the last solve: counterforces `[3N]`, and stresslets of each sphere.
    pub fn correct(&self, forces: &mut [f64], stresslets: &mut [S::Strain]) {
        let (strains, velocities) = self.excess.split_at(self.excess.len() - forces.len());
        for (force, excess) in forces.iter_mut().zip(velocities) {
            *force += excess;
        }
        let excesses = strains.chunks_exact(S::STRAINS);
        for (stresslet, excess) in stresslets.iter_mut().zip(excesses) {
            for (k, excess) in excess.iter().enumerate() {
                stresslet[k] -= excess;
            }
        }
    }

    /// Refuses vectors of other lengths; returns the index of the first velocity.
    fn check_lengths(
        &self,
        near: &Resistance<S>,
        forces: &[f64],
        velocities: &[f64],
    ) -> Result<usize, Error> {
        let spheres = self.drag.len() / (S::STRAINS + S::MODES);
        for (field, found) in [
            ("forces", forces.len() / S::MODES),
            ("velocities", velocities.len() / S::MODES),
            ("near field", near.radii().len()),
        ] {
            if found != spheres {
                return Err(Error::Length {
                    field,
                    found,
                    expected: spheres,
                });
            }
        }
        Ok(S::STRAINS * spheres)
    }
}

impl<S: Fluid> Work<S> {
    /// `W r` and the corresponding lag; returns `rᵀ W r`.
    fn precondition(
        &mut self,
        near: &Resistance<S>,
        local: &LocalResistance<S>,
    ) -> Result<f64, Error> {
        let half = S::STRAINS * near.radii().len();
        if S::DRIFTS > 0 {
            centre::<S>(&mut self.residual[half..]);
        }
        local.apply(&self.residual, &mut self.pushed);
        self.lag[half..].copy_from_slice(&self.pushed[half..]);
        self.solver.solve(near, &mut self.lag[half..])?;
        local.apply(&self.lag, &mut self.preconditioned);
        for (z, pushed) in self.preconditioned.iter_mut().zip(&self.pushed) {
            *z = pushed - *z;
        }
        // The translation of y that keeps the force on the layer zero.
        let c = self
            .uniform
            .against(translations::<S>(&self.preconditioned[half..]));
        for k in 0..self.lag.len() - half {
            let (moved, answer) = (translation::<S>(c, k), self.uniform.answer(c, k));
            self.residual[half + k] -= moved;
            self.lag[half + k] -= moved - answer;
        }
        for (k, pushed) in self.pushed.iter_mut().enumerate() {
            *pushed -= self.uniform.pushed(c, k);
            self.preconditioned[k] -= self.uniform.pushed_answer(c, k);
        }
        Ok(dot(&self.residual, &self.preconditioned))
    }

    /// The next direction: the preconditioned residual plus a multiple of the last one.
    fn turn(&mut self, share: f64) {
        for (next, last) in [
            (&self.pushed, &mut self.direction),
            (&self.preconditioned, &mut self.step),
            (&self.lag, &mut self.step_lag),
        ] {
            for (last, next) in last.iter_mut().zip(next) {
                *last = next + share * *last;
            }
        }
    }
}

/// `Σ q²/drag`.
fn weighted_square(q: &[f64], drag: &[f64]) -> f64 {
    q.iter().zip(drag).map(|(q, drag)| q * q / drag).sum()
}

/// Subtracts the mean translation from velocities.
fn centre<S: Fluid>(velocities: &mut [f64]) {
    let spheres = (velocities.len() / S::MODES) as f64;
    let mean = translations::<S>(velocities).map(|sum| sum / spheres);
    for v in S::by_sphere_mut(velocities) {
        v[0] -= mean[0];
        v[1] -= mean[1];
    }
}
