//! Stokesian Dynamics of large layers: the far field is iterated on top of Ball-Melrose hydrodynamics.
//!
//! ```text
//! x = (−E; v),   q the force modes of the far field, M its mobility, M₀ that of isolated spheres
//! M q = x − V c,   Vᵀ q = 0,   q_F + R_n v − R_n,FE E = F        V: translations of the layer; R_n: the pair terms
//! q = M₀⁻¹ x + δ:   R_BM v = F + R_n,FE E − δ_F,   R_BM = M₀⁻¹ + R_n      Ball-Melrose under forces −δ_F more
//! y = M₀ δ:         y + (M − M₀) (q₀ + W y) + V c = 0,   W = M₀⁻¹ − M₀⁻¹ R_BM⁻¹ M₀⁻¹ on velocity rows, M₀⁻¹ on strains
//! ```
//!
//! W is symmetric, positive semidefinite and at most M₀⁻¹, and `z = W y` obeys `(W⁺ + M − M₀) z + V c = −(M − M₀) q₀`, `Vᵀ z = 0`,
//! whose operator is at least M: positive definite. Conjugate gradients with W as preconditioner, less the part that would break
//! the constraint, need one product with M and one Ball-Melrose solve per iteration. Where M is far above M₀, in long waves, the
//! pair terms resist little and W all but vanishes, so iterations hardly depend on N.
//!
//! The far field leaves a translation of the layer alone, but the pair terms resist it a little, as their two parts are not of one
//! order of multipoles: `Vᵀ W V` is small, and the mean velocity what balances the forces on the layer as a whole.
//!
//! The relative residual is `√(rᵀ W r)/√(qᵀ M₀ q)`, r = x − M q − V c. A remaining r is a flow that the spheres are subjected to
//! besides the background.

mod ball_melrose;
pub(crate) mod fixed_point;
mod split;
mod uniform;

use crate::error::Error;
use crate::geometry::cell::Cell;
use crate::geometry::modes::Vec2;
use crate::hydrodynamics::far_field::operator::FarOperator;
use crate::hydrodynamics::far_field::unbounded::self_mobility;
use crate::hydrodynamics::resistance::Resistance;
use crate::linalg::dense::{add_scaled, dot};
use ball_melrose::BallMelroseSolver;
use nalgebra::Vector3;
use split::SplitMotion;
use uniform::{Uniform, translation, translations};

/// Tolerance of M over the relative residual asked for; test `linear_motion_is_that_of_the_dense_far_field`.
const OPERATOR_TOLERANCE: f64 = 0.1;

/// How an iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Convergence {
    /// Iterations, each with one product with M and one Ball-Melrose solve for each part of the motion.
    pub iterations: u32,
    /// Evaluations of the map of contacts; 0 without contacts.
    pub evaluations: u32,
    /// Relative residual reached.
    pub residual: f64,
}

/// The far field of Stokesian Dynamics, iterated on top of a factored Ball-Melrose [`Resistance`]. Memory is O(N).
pub struct IterativeFarField {
    /// M.
    operator: FarOperator,
    /// Diagonal of M₀⁻¹, `[6N]`, strains first.
    drag: Vec<f64>,
    /// Relative residual to be reached.
    residual: f64,
    /// Limit of the iterations of one solve.
    most: u32,
    /// δ of the last solve, `[6N]`.
    excess: Vec<f64>,
    work: Work,
    split: SplitMotion,
}

/// Vectors of the conjugate gradients, `[6N]` but where said otherwise.
#[derive(Default)]
struct Work {
    /// q.
    densities: Vec<f64>,
    /// r.
    residual: Vec<f64>,
    /// `W r`.
    preconditioned: Vec<f64>,
    /// `R_BM⁻¹ M₀⁻¹ r`, `[3N]`.
    lag: Vec<f64>,
    /// u, the search direction of y.
    direction: Vec<f64>,
    /// `p = W u`.
    step: Vec<f64>,
    /// `R_BM⁻¹ M₀⁻¹ u`, `[3N]`.
    step_lag: Vec<f64>,
    /// `M p + R_BM⁻¹ M₀⁻¹ u`.
    image: Vec<f64>,
    /// Translations of the layer.
    uniform: Uniform,
    ball_melrose: BallMelroseSolver,
}

impl IterativeFarField {
    /// Default of the relative residual to be reached.
    pub const DEFAULT_RESIDUAL: f64 = 1e-6;
    /// Default limit of the iterations of one solve.
    pub const MOST_ITERATIONS: u32 = 300;

    /// Makes a plan for cells of the given sides.
    ///
    /// # Arguments
    /// - `cell`: periodic.
    /// - `radii`: one per sphere, in a.
    /// - `residual`: relative residual to be reached, 1e-7 to 1e-2; see the module.
    ///
    /// # Errors
    /// [`Error::NoSpheres`]; [`Error::OutOfRange`] for unbounded fluid, a radius or the residual.
    pub fn new(cell: &Cell, radii: &[f64], residual: f64) -> Result<Self, Error> {
        if !(1e-7..=1e-2).contains(&residual) {
            return Err(Error::OutOfRange {
                field: "residual",
                value: residual,
                allowed: "1e-7 to 1e-2",
            });
        }
        let operator = FarOperator::new(cell, radii, OPERATOR_TOLERANCE * residual)?;
        let n = radii.len();
        let mut drag = vec![0.0; 6 * n];
        for (i, &radius) in radii.iter().enumerate() {
            let single = self_mobility(radius);
            for k in 0..3 {
                drag[3 * i + k] = single[3 + k].recip();
                drag[3 * (n + i) + k] = single[k].recip();
            }
        }
        let split = SplitMotion::new(&drag);
        let vector = || vec![0.0; 6 * n];
        let half = || vec![0.0; 3 * n];
        Ok(Self {
            operator,
            drag,
            residual,
            most: Self::MOST_ITERATIONS,
            excess: vector(),
            work: Work {
                densities: vector(),
                residual: vector(),
                preconditioned: vector(),
                lag: half(),
                direction: vector(),
                step: vector(),
                step_lag: half(),
                image: vector(),
                uniform: Uniform::default(),
                ball_melrose: BallMelroseSolver::default(),
            },
            split,
        })
    }

    /// Sets another limit of the iterations of one solve than [`IterativeFarField::MOST_ITERATIONS`].
    pub fn limit_iterations(&mut self, most: u32) {
        self.most = most;
    }

    /// Forgets the last solve: the next one starts from Ball-Melrose.
    pub fn forget(&mut self) {
        self.excess.fill(0.0);
        self.split.forget();
    }

    /// Takes new positions. The next solve starts from what was found at the last ones.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::OutOfRange`] for a cell of other sides.
    pub fn update(&mut self, cell: &Cell, centres: &[Vec2]) -> Result<(), Error> {
        self.operator.update(cell, centres)
    }

    /// Disturbance velocities `[3N]` under forces, without contacts. Allocates nothing after the first call.
    ///
    /// # Arguments
    /// - `near`: Ball-Melrose, factored or held pair by pair, updated at the positions of [`IterativeFarField::update`].
    /// - `strain`: background `(e1, e2, e3)`.
    /// - `forces`: external ones and those of [`Resistance::background_forces`] of `near`, `[3N]`. External ones should add up to
    ///   zero: hardly anything would resist their sum.
    ///
    /// # Errors
    /// [`Error::Length`]; [`Error::NotConverged`].
    pub fn solve(
        &mut self,
        near: &Resistance,
        strain: &Vector3<f64>,
        forces: &[f64],
        velocities: &mut [f64],
    ) -> Result<Convergence, Error> {
        let half = self.excess.len() / 2;
        check_length("forces", forces.len(), half)?;
        check_length("velocities", velocities.len(), half)?;
        check_length("near field", 3 * near.radii().len(), half)?;
        let Self {
            operator,
            drag,
            excess,
            work,
            ..
        } = self;
        for ((v, f), excess) in velocities.iter_mut().zip(forces).zip(&excess[half..]) {
            *v = f - excess;
        }
        work.ball_melrose.start(near)?;
        work.ball_melrose.solve(near, velocities);
        work.uniform.update(near, &drag[half..]);
        work.uniform
            .solve(near, &mut work.ball_melrose, &drag[half..]);
        let rows = velocities.iter().zip(&drag[half..]).zip(&excess[half..]);
        work.lag.clear();
        work.lag
            .extend(rows.map(|((v, drag), excess)| drag * v + excess));
        let c = work.uniform.against(translations(&work.lag));
        for (k, v) in velocities.iter_mut().enumerate() {
            *v += translation(c, k) - work.uniform.answer(c, k);
            excess[half + k] -= drag[half + k] * translation(c, k);
        }
        // r = x − M q with q = M₀⁻¹ x + δ.
        let x = &mut work.residual;
        for e in x[..half].chunks_exact_mut(3) {
            e.copy_from_slice((-strain).as_slice());
        }
        x[half..].copy_from_slice(velocities);
        for (k, q) in work.densities.iter_mut().enumerate() {
            *q = drag[k] * x[k] + excess[k];
        }
        operator.apply(&work.densities, &mut work.image);
        add_scaled(x, &work.image, -1.0);
        let mut before = 0.0;
        let mut reached = f64::INFINITY;
        for iterations in 0..=self.most {
            let square = work.precondition(near, drag);
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
            add_scaled(&mut work.image[half..], &work.step_lag, 1.0);
            let length = square / dot(&work.step, &work.image);
            add_scaled(&mut work.densities, &work.step, length);
            add_scaled(&mut work.residual, &work.image, -length);
            add_scaled(velocities, &work.step_lag, -length);
            for ((excess, drag), u) in excess.iter_mut().zip(&*drag).zip(&work.direction) {
                *excess += length * drag * u;
            }
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

    /// Adds the far field, beyond isolated drag, to what [`Resistance::apply`] of the Ball-Melrose `near` gave for the velocities of
    /// the last solve: counterforces `[3N]`, and stresslets of each sphere.
    pub fn correct(&self, forces: &mut [f64], stresslets: &mut [Vector3<f64>]) {
        let (strains, velocities) = self.excess.split_at(self.excess.len() / 2);
        for (force, excess) in forces.iter_mut().zip(velocities) {
            *force += excess;
        }
        for (stresslet, excess) in stresslets.iter_mut().zip(strains.chunks_exact(3)) {
            *stresslet -= Vector3::from_column_slice(excess);
        }
    }
}

impl Work {
    /// `W r` and the lag that belongs to it; returns `rᵀ W r`.
    fn precondition(&mut self, near: &Resistance, drag: &[f64]) -> f64 {
        let half = self.lag.len();
        centre(&mut self.residual[half..]);
        let drag_v = &drag[half..];
        let r = &self.residual[half..];
        for ((lag, r), drag) in self.lag.iter_mut().zip(r).zip(drag_v) {
            *lag = drag * r;
        }
        self.ball_melrose.solve(near, &mut self.lag);
        let (strains, velocities) = self.preconditioned.split_at_mut(half);
        for ((s, r), drag) in strains.iter_mut().zip(&self.residual).zip(drag) {
            *s = drag * r;
        }
        for (k, s) in velocities.iter_mut().enumerate() {
            *s = drag_v[k] * (r[k] - self.lag[k]);
        }
        // The translation of y that keeps the force on the layer zero.
        let c = self
            .uniform
            .against(translations(&self.preconditioned[half..]));
        for (k, drag) in drag_v.iter().enumerate() {
            let (moved, answer) = (translation(c, k), self.uniform.answer(c, k));
            self.residual[half + k] -= moved;
            self.lag[k] -= moved - answer;
            self.preconditioned[half + k] -= drag * answer;
        }
        dot(&self.residual, &self.preconditioned)
    }

    /// The next direction: that of the residual, and a share of the last one.
    fn turn(&mut self, share: f64) {
        for (next, last) in [
            (&self.residual, &mut self.direction),
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

fn mean(velocities: &[f64]) -> [f64; 2] {
    let spheres = (velocities.len() / 3) as f64;
    [0, 1].map(|c| velocities[c..].iter().step_by(3).sum::<f64>() / spheres)
}

/// Takes the mean translation off velocities `[3N]`.
fn centre(velocities: &mut [f64]) {
    let mean = mean(velocities);
    for v in velocities.chunks_exact_mut(3) {
        v[0] -= mean[0];
        v[1] -= mean[1];
    }
}

/// Refuses a vector of another length.
fn check_length(field: &'static str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected {
        return Ok(());
    }
    Err(Error::Length {
        field,
        found: found / 3,
        expected: expected / 3,
    })
}
