//! The normal problem of many contacts without a matrix of contacts.
//!
//! ```text
//! R v = F + Cᵀ f,   f ≥ 0,   w = C v + b ≥ 0,   f·w = 0
//! ```
//!
//! The forces f are the multipliers of a convex quadratic problem in v, solved by the method of multipliers (Hestenes 1969, Powell
//! 1969): pairs with a trial force p = f − ρ w > 0 get a stiffness ρ,
//!
//! ```text
//! H δ = F − R v + Cᵀ max(0, p),   H = R + ρ C_Aᵀ C_A,   A = {p > 0};      v ← v + δ,   f ← max(0, f − ρ w)
//! ```
//!
//! Whole steps end soonest; where they cycle, as they may near jamming, f is held while steps of the best length along δ lower
//! the augmented function, whose gradient is the right-hand side: that converges from anywhere (its Newton steps are finite in number),
//! and then f moves on. H is solved with by conjugate gradients, preconditioned by a sparse factor of its near part; one with an
//! older set A serves until the iterations lost by it would have paid for another.

use super::{COMPLIANCE, Contact};
use crate::error::Error;
use crate::hydrodynamics::resistance::PairwiseResistance;
use crate::linalg::cholesky::sparse::{BlockCholesky, BlockPattern};
use crate::linalg::conjugate_gradients::{ConjugateGradients, largest};
use crate::linalg::dense::dot;

/// ρ, in mu·a. Larger ones need fewer updates of f near jamming; single precision holds it well.
const STIFFNESS: f64 = 1e6;
/// Whole steps before the search along each of them begins.
const PATIENCE: u32 = 10;
/// Steps in one call, after which it is given up as unconverged.
const MOST_STEPS: u32 = 60;
/// Changes of the set that a factor outlives.
const MOST_CHANGES: usize = 20;
/// Iterations that may be lost to an old set before it is factored anew; measured at N = 400 and 1000.
const FACTOR_COST: u32 = 2;
/// Iterations that a fresh factor needs.
const FRESH: u32 = 2;
/// Most iterations of conjugate gradients.
const MOST_ITERATIONS: u32 = 60;
/// Gain of one solve; what it leaves is taken up by the next.
const MOST_GAIN: f64 = 1e-9;

/// The spheres and candidates of one stage.
#[derive(Clone, Copy)]
pub(super) struct System<'a> {
    /// `R_FU`.
    pub(super) network: &'a PairwiseResistance,
    /// Pattern of its near part.
    pub(super) pattern: &'a BlockPattern,
    /// The candidates.
    pub(super) list: &'a [Contact],
}

/// When to stop.
#[derive(Clone, Copy)]
pub(super) struct Goal {
    /// Largest force left over on a sphere, in mu·a²·rate.
    pub(super) force: f64,
    /// Largest violation of w ≥ 0 or f·w = 0, in a·rate.
    pub(super) velocity: f64,
    /// Whether one more look after two steps is enough, since what drives them will change.
    pub(super) passing: bool,
}

/// Where the slope of the augmented function along a step changes.
#[derive(Clone, Copy)]
struct Bend {
    /// Share of the step.
    at: f64,
    /// Change of the slope's constant part there, and of its slope.
    change: [f64; 2],
}

/// Forces, velocities and workspace of the problem.
#[derive(Default)]
pub(super) struct Augmented {
    /// Normal force f of each candidate.
    pub(super) forces: Vec<f64>,
    /// Disturbance velocities v, `[3N]`.
    pub(super) velocities: Vec<f64>,
    /// b of each candidate.
    bias: Vec<f64>,
    /// A.
    active: Vec<bool>,
    /// The set whose H was factored, and whether one was.
    factored: (Vec<bool>, bool),
    /// Iterations lost to it since.
    lost: u32,
    /// Number of each candidate in the pattern, which has all that are near.
    numbers: Vec<Option<usize>>,
    /// max(0, p).
    trial: Vec<f64>,
    /// Force left over, `[3N]`.
    residual: Vec<f64>,
    /// δ, `[3N]`.
    step: Vec<f64>,
    /// R times a vector, `[3N]`.
    image: Vec<f64>,
    /// Bends along a step.
    bends: Vec<Bend>,
    /// Factor of the near part of H.
    factor: BlockCholesky,
    /// Iteration with H.
    gradients: ConjugateGradients,
}

impl Augmented {
    /// Begins a stage: spheres at rest in the background. Forces begin as those in the list.
    ///
    /// `bias`: of each candidate.
    pub(super) fn start(&mut self, system: &System<'_>, bias: impl Iterator<Item = f64>) {
        let size = 3 * system.pattern.spheres();
        for vector in [
            &mut self.velocities,
            &mut self.residual,
            &mut self.step,
            &mut self.image,
        ] {
            vector.clear();
            vector.resize(size, 0.0);
        }
        self.bias.clear();
        self.bias.extend(bias);
        self.forces.clear();
        self.forces
            .extend(system.list.iter().map(|c| c.normal_force));
        self.active.clear();
        self.active.extend(self.forces.iter().map(|&f| f > 0.0));
        self.numbers.clear();
        let number = |c: &Contact| system.network.number_of(&c.pair);
        self.numbers.extend(system.list.iter().map(number));
        self.factored.1 = false;
    }

    /// Solves under `driving`, all forces `[3N]` but the normal ones. Returns the largest violation, in a·rate; a pair that closes
    /// no faster than the compliance of contacts allows violates nothing.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`].
    pub(super) fn solve(
        &mut self,
        system: &System<'_>,
        driving: &[f64],
        goal: Goal,
    ) -> Result<f64, Error> {
        let most = if goal.passing { 2 } else { MOST_STEPS };
        for taken in 0..=most {
            let searching = taken >= PATIENCE;
            let violation = self.look(system, driving, searching, goal.velocity);
            let begun = self.factored.1;
            let done = largest(&self.residual) <= goal.force && violation <= goal.velocity;
            if begun && done || taken == most {
                return Ok(violation);
            }
            // The forces left over with the trial forces: the gradient of the augmented function.
            for (c, (trial, f)) in system.list.iter().zip(self.trial.iter().zip(&self.forces)) {
                if trial != f {
                    c.add_normal(trial - f, c.rows(), &mut self.residual);
                }
            }
            let left = largest(&self.residual);
            if searching && left <= goal.force {
                self.forces.copy_from_slice(&self.trial);
                continue;
            }
            self.find_step(system, left, goal.force)?;
            let share = if searching {
                self.best_share(system)
            } else {
                1.0
            };
            for (v, step) in self.velocities.iter_mut().zip(&self.step) {
                *v += share * step;
            }
            if !searching {
                let trials = self.trial.iter().zip(&self.active);
                for ((f, c), (p, &active)) in self.forces.iter_mut().zip(system.list).zip(trials) {
                    let force = p - STIFFNESS * c.normal_row(&self.step);
                    *f = if active { force.max(0.0) } else { 0.0 };
                }
            }
        }
        Ok(f64::INFINITY)
    }

    /// A, trial forces, force left over with the forces at hand, largest violation.
    ///
    /// `slack`: closing velocity that does not yet make a pair join, unless `searching`.
    fn look(&mut self, system: &System<'_>, driving: &[f64], searching: bool, slack: f64) -> f64 {
        system.network.apply(&self.velocities, &mut self.image);
        for (left, (f, r)) in self
            .residual
            .iter_mut()
            .zip(driving.iter().zip(&self.image))
        {
            *left = f - r;
        }
        self.trial.clear();
        let mut violation: f64 = 0.0;
        for (k, c) in system.list.iter().enumerate() {
            let f = self.forces[k];
            if f != 0.0 {
                c.add_normal(f, c.rows(), &mut self.residual);
            }
            let w = self.bias[k] + c.normal_row(&self.velocities);
            let p = f - STIFFNESS * w;
            if self.factored.1 {
                self.active[k] = if f > 0.0 || searching {
                    p > 0.0
                } else {
                    w < -slack
                };
            }
            self.trial.push(if self.active[k] { p } else { 0.0 });
            let closing = -w - COMPLIANCE * f;
            violation = violation.max(if self.active[k] {
                closing.max(w)
            } else {
                closing
            });
        }
        violation
    }

    /// δ for the force left over.
    fn find_step(&mut self, system: &System<'_>, left: f64, goal: f64) -> Result<(), Error> {
        let (set, begun) = &self.factored;
        let changes = if *begun {
            let differ = self.active.iter().zip(set).filter(|(a, b)| a != b);
            differ.count()
        } else {
            usize::MAX
        };
        let fresh = changes > MOST_CHANGES || changes > 0 && self.lost > FACTOR_COST;
        if fresh {
            self.factor_held(system)?;
        }
        let (list, network, pattern) = (system.list, system.network, system.pattern);
        let (active, factor) = (&self.active, &mut self.factor);
        let iterations = self.gradients.solve(
            &self.residual,
            &mut self.step,
            ((0.3 * goal).max(MOST_GAIN * left), MOST_ITERATIONS),
            |v, y| {
                network.apply(v, y);
                for (c, _) in list.iter().zip(active).filter(|(_, active)| **active) {
                    c.add_normal(STIFFNESS * c.normal_row(v), c.rows(), y);
                }
            },
            |r, z| factor.solve(pattern, r, z),
        );
        if !fresh && changes > 0 {
            self.lost += iterations.saturating_sub(FRESH);
        }
        Ok(())
    }

    /// Factors the near part of H.
    fn factor_held(&mut self, system: &System<'_>) -> Result<(), Error> {
        let (pattern, factor) = (system.pattern, &mut self.factor);
        system.network.fill(pattern, factor);
        for (k, c) in system.list.iter().enumerate() {
            if self.active[k] {
                let n = c.pair.normal;
                let (xx, xy, yy) = (n.x * n.x, n.x * n.y, n.y * n.y);
                let block = [xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, 0.0].map(|x| STIFFNESS * x);
                factor.add_own(pattern, c.pair.i, &block);
                factor.add_own(pattern, c.pair.j, &block);
                if let Some(number) = self.numbers[k] {
                    factor.add_coupling(pattern, number, &block.map(|x| -x));
                }
            }
        }
        factor.factor(pattern).map_err(not_positive)?;
        self.factored.0.clone_from(&self.active);
        self.factored.1 = true;
        self.lost = 0;
        Ok(())
    }

    /// The share of the step at which the augmented function is least along it. Its slope is piecewise linear and rising.
    fn best_share(&mut self, system: &System<'_>) -> f64 {
        system.network.apply(&self.step, &mut self.image);
        // The slope at 0, and how it rises.
        let mut slope = [
            -dot(&self.residual, &self.step),
            dot(&self.step, &self.image),
        ];
        self.bends.clear();
        for (k, c) in system.list.iter().enumerate() {
            let rate = c.normal_row(&self.step);
            let w = self.bias[k] + c.normal_row(&self.velocities);
            let p = self.forces[k] - STIFFNESS * w;
            // While p − ρ t·rate > 0 the pair adds −rate (p − ρ t·rate) to the slope, of which that at t = 0 is counted already.
            let rise = STIFFNESS * rate * rate;
            if p > 0.0 {
                slope[1] += rise;
            }
            let at = p / (STIFFNESS * rate);
            if at > 0.0 {
                let change = if p > 0.0 {
                    [rate * p, -rise]
                } else {
                    [-rate * p, rise]
                };
                self.bends.push(Bend { at, change });
            }
        }
        self.bends.sort_unstable_by(|a, b| {
            a.at.total_cmp(&b.at)
                .then(a.change[0].total_cmp(&b.change[0]))
        });
        let mut share = -slope[0] / slope[1];
        for bend in &self.bends {
            if share <= bend.at {
                break;
            }
            slope[0] += bend.change[0];
            slope[1] += bend.change[1];
            share = -slope[0] / slope[1];
        }
        share
    }
}

/// The error for a factor that broke down.
pub(super) fn not_positive(bad: crate::linalg::error::BadPivot) -> Error {
    Error::NotPositiveDefinite {
        matrix: "near part of the resistance",
        pivot: bad.pivot,
        sphere: bad.pivot / 3,
    }
}
