//! The coefficients of the contact problem, to which every law reduces at one stage.

use crate::contact::row::Row;
use crate::contact::{Quality, Status};
use crate::space::{Layer, Space};

/// Normal condition of one candidate: `w = C v + bias + compliance f`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Normal<S: Space = Layer> {
    /// Row of C.
    pub(crate) row: Row<S>,
    /// Constant part of w, in a·rate: the background's contribution, and the gap over the time
    /// span.
    pub(crate) bias: f64,
    /// In a·rate per unit of force: the inverse of a spring's stiffness times the time span, or a
    /// very small value for a rigid contact.
    pub(crate) compliance: f64,
}

/// One friction force of one candidate: `z = D v + shift − compliance t`, `|t| ≤ ρ(f)`.
#[derive(Clone, Copy)]
pub(crate) struct Friction<S: Space = Layer> {
    /// Index of its candidate.
    pub(crate) contact: usize,
    /// Rows of D, along orthonormal directions.
    pub(crate) rows: S::PerTangent<Row<S>>,
    /// Constant part of z, in a·rate: the background's contribution, and that of the spring force
    /// over the time span.
    pub(crate) shift: S::PerTangent<f64>,
    /// In a·rate per unit of force.
    pub(crate) compliance: f64,
    /// Coefficient of the bound `ρ(f) = max(0, coefficient f + intercept)` while friction is
    /// active. An infinite coefficient means no bound while the contact is loaded.
    pub(crate) coefficient: f64,
    /// See `coefficient`; in mu·a²·rate.
    pub(crate) intercept: f64,
    /// Whether friction is active, i.e. the load is above the critical load.
    pub(crate) active: bool,
    /// Whether friction was deactivated in this problem, which is permitted once: where the load is
    /// above the critical load without friction and below it with friction, friction then stays
    /// active.
    pub(crate) was_deactivated: bool,
}

impl<S: Space> Friction<S> {
    /// Bound ρ on |t| at a normal force f.
    pub(crate) fn bound(&self, f: f64) -> f64 {
        if !self.active {
            return 0.0;
        }
        let load_part = if f > 0.0 { self.coefficient * f } else { 0.0 };
        (load_part + self.intercept).max(0.0)
    }

    /// Friction force along the direction of a slip, at a normal force of either sign.
    pub(crate) fn slipping_force(&self, f: f64) -> f64 {
        if self.follows_load() {
            self.coefficient * f + self.intercept
        } else {
            self.intercept
        }
    }

    /// Whether the bound is proportional to the load. Otherwise it is a constant, as where bounds
    /// are fixed.
    pub(crate) fn follows_load(&self) -> bool {
        self.coefficient > 0.0
    }

    /// The row along a direction, given by its components in the rows.
    pub(crate) fn row_along(&self, components: &S::PerTangent<f64>) -> Row<S> {
        let mut row = self.rows[0].times(components[0]);
        for k in 1..S::TANGENTS {
            row = row.plus(components[k], &self.rows[k]);
        }
        row
    }
}

/// The rate at which the cell dilates under an imposed pressure, as it follows from the forces:
/// `e = mobility (Σ c f − Σ s t) + free`. Candidates open at the rates c e, and slip at s e.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Dilation {
    /// c of each candidate, in a; empty where the volume is imposed.
    pub(crate) openings: Vec<f64>,
    /// s of each component of the friction forces, in a; empty where the volume is imposed.
    pub(crate) shiftings: Vec<f64>,
    /// In rate per unit of `Σ c f`.
    pub(crate) mobility: f64,
    /// The rate without contact forces.
    pub(crate) free: f64,
}

impl Dilation {
    /// e under these forces; 0 where the volume is imposed.
    pub(crate) fn rate<S: Space>(&self, forces: &Forces<S>) -> f64 {
        let frictionless = self.frictionless_rate(forces);
        let components = S::components(&forces.tangential);
        let work: f64 = self
            .shiftings
            .iter()
            .zip(components)
            .map(|(s, t)| s * t)
            .sum();
        frictionless - self.mobility * work
    }

    /// e under the normal forces alone.
    pub(crate) fn frictionless_rate<S: Space>(&self, forces: &Forces<S>) -> f64 {
        let normal = self.openings.iter().zip(&forces.normal);
        self.mobility * normal.map(|(c, f)| c * f).sum::<f64>() + self.free
    }

    /// s of the components of a friction force; 0 where there is none.
    pub(crate) fn shifting<S: Space>(&self, friction: usize) -> S::PerTangent<f64> {
        let mut shifting = S::each_tangent(0.0);
        if !self.shiftings.is_empty() {
            for k in 0..S::TANGENTS {
                shifting[k] = self.shiftings[S::TANGENTS * friction + k];
            }
        }
        shifting
    }
}

/// One contact problem; see [`super`].
#[derive(Default)]
pub(crate) struct Problem<S: Space = Layer> {
    /// Candidates, ordered by (i, j).
    pub(crate) normal: Vec<Normal<S>>,
    /// Friction forces, ordered by candidate; candidates without one have no friction.
    pub(crate) friction: Vec<Friction<S>>,
    /// How the cell dilates.
    pub(crate) dilation: Dilation,
    /// Whether friction depends on the motion v_N under normal forces alone, instead of v.
    pub(crate) uses_frictionless_slip: bool,
    /// Load above which friction is active; `None` where its activation is fixed. Where friction is
    /// continuous at the critical load, it is active on all contacts, and the bound determines the
    /// force.
    pub(crate) critical_load: Option<f64>,
}

impl<S: Space> Problem<S> {
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.normal.clone_from(&other.normal);
        self.friction.clone_from(&other.friction);
        self.dilation.clone_from(&other.dilation);
        self.uses_frictionless_slip = other.uses_frictionless_slip;
        self.critical_load = other.critical_load;
    }

    /// Number of components of all friction forces.
    pub(crate) fn friction_rows(&self) -> usize {
        S::TANGENTS * self.friction.len()
    }

    /// Sets the forces that an active set prescribes: zero, or friction by the load along the
    /// direction of a slip. `in_frame`: whether the forces of slips are given in their frames.
    pub(crate) fn prescribe(&self, states: &States<S>, forces: &mut Forces<S>, in_frame: bool) {
        for (f, closed) in forces.normal.iter_mut().zip(&states.closed) {
            if !closed {
                *f = 0.0;
            }
        }
        let entries = self.friction.iter().zip(&states.friction);
        for ((entry, state), t) in entries.zip(&mut forces.tangential) {
            match state {
                FrictionState::Stick => {}
                FrictionState::Inactive => *t = S::each_tangent(0.0),
                FrictionState::Slip(slide) => {
                    let mut rotated = if in_frame { *t } else { slide.rotate(t) };
                    rotated[0] = entry.slipping_force(forces.normal[entry.contact]);
                    *t = slide.rotate_back(&rotated);
                }
            }
        }
    }
}

/// The forces on the spheres other than contact forces, `[3N]` each.
#[derive(Clone, Copy)]
pub(crate) struct AppliedForces<'a> {
    /// All external and background forces.
    pub all: &'a [f64],
    /// The part that applies to the motion under normal forces alone.
    pub frictionless: &'a [f64],
    /// Residual at which the solution is accurate enough, relative to the norm of these forces; 0:
    /// as accurate as rounding permits.
    pub relative_tolerance: f64,
}

impl<'a> AppliedForces<'a> {
    /// These forces for both motions, to be solved as accurately as rounding permits.
    pub(crate) fn both(forces: &'a [f64]) -> Self {
        Self {
            all: forces,
            frictionless: forces,
            relative_tolerance: 0.0,
        }
    }
}

/// Difference from its bound, over the bound, below which a given friction force slips.
const BOUND_TOLERANCE: f64 = 1e-12;
/// Slip velocity, in a·rate, expected of a slide before the first linear system.
const EXPECTED_SLIP: f64 = 0.3;

/// State of one friction force.
#[derive(Clone, Copy)]
pub(crate) enum FrictionState<S: Space = Layer> {
    /// No friction force: friction is not active, or there is no load.
    Inactive,
    /// |t| below the bound and z = 0.
    Stick,
    /// t = ρ d, with the direction d of the slide.
    Slip(Slide<S>),
}

impl<S: Space> FrictionState<S> {
    /// The state that follows from an unbounded force.
    pub(crate) fn from_force(force: &S::PerTangent<f64>, bound: f64) -> Self {
        let length = S::length(force);
        if bound == 0.0 {
            Self::Inactive
        } else if length < bound * (1.0 - BOUND_TOLERANCE) {
            Self::Stick
        } else {
            Self::Slip(Slide::along(force, length, EXPECTED_SLIP / bound))
        }
    }

    /// Whether the other state differs, apart from the direction of a slide.
    pub(crate) fn differs_from(&self, other: &Self) -> bool {
        std::mem::discriminant(self) != std::mem::discriminant(other)
    }

    /// Whether component `d` sticks, in the frame of a slide: across its direction it does.
    pub(crate) fn sticks(&self, d: usize) -> bool {
        match self {
            Self::Inactive => false,
            Self::Stick => true,
            Self::Slip(_) => d > 0,
        }
    }
}

/// The active set: the state of each candidate and each friction force. For a given active set the
/// problem is linear.
#[derive(Default)]
pub(crate) struct States<S: Space = Layer> {
    /// Whether each candidate is closed.
    pub(crate) closed: Vec<bool>,
    pub(crate) friction: Vec<FrictionState<S>>,
}

impl<S: Space> States<S> {
    /// Infers the states from the loads of candidates, and from the friction forces without bounds
    /// by their numbers and entries.
    pub(crate) fn infer(
        &mut self,
        problem: &Problem<S>,
        load: impl Fn(usize) -> f64,
        trial: impl Fn(usize, &Friction<S>) -> S::PerTangent<f64>,
    ) {
        self.closed.clear();
        let candidates = 0..problem.normal.len();
        self.closed.extend(candidates.map(|k| load(k) > 0.0));
        self.friction.clear();
        let entries = problem.friction.iter().enumerate();
        self.friction.extend(entries.map(|(k, entry)| {
            let bound = entry.bound(load(entry.contact).max(0.0));
            FrictionState::from_force(&trial(k, entry), bound)
        }));
    }
}

/// Linearised slip. In a suspension its direction rotates with the forces. Vectors are given by
/// their components in the rows.
///
/// ```text
/// t = ρ(f) p/|p|,  p = t + z/G       linearised about the current p, with d = p/|p| and e ⟂ d:
/// t_d = ρ(f),      z_e = c t_e,      c = G (|p| − ρ)/ρ
/// ```
/// Along d the contact slips as in a layer; along e it sticks, with a compliance (Alart & Curnier
/// 1991).
#[derive(Clone, Copy)]
pub(crate) struct Slide<S: Space = Layer> {
    /// d; in a layer ±1.
    pub(crate) direction: S::PerTangent<f64>,
    /// c, in a·rate per unit of force.
    pub(crate) compliance: f64,
}

impl<S: Space> Slide<S> {
    /// A slide along a vector of the given length; along any direction if that is 0.
    fn along(vector: &S::PerTangent<f64>, length: f64, compliance: f64) -> Self {
        let mut direction = *vector;
        if length > 0.0 {
            for x in direction.as_mut() {
                *x /= length;
            }
        } else {
            direction[0] = -1.0;
        }
        Self {
            direction,
            compliance,
        }
    }

    /// The slide of a trial force p with a `length` above the bound ρ ≥ 0; `self_mobility` is G.
    pub(crate) fn from_trial(
        trial: &S::PerTangent<f64>,
        length: f64,
        bound: f64,
        self_mobility: f64,
    ) -> Self {
        let compliance = if bound > 0.0 {
            self_mobility * ((length - bound) / bound).max(0.0)
        } else {
            f64::INFINITY
        };
        Self::along(trial, length, compliance)
    }

    /// Components along d and e of a vector given by its components in the rows.
    pub(crate) fn rotate(&self, vector: &S::PerTangent<f64>) -> S::PerTangent<f64> {
        self.rotated(vector, 1.0)
    }

    /// The inverse of [`Slide::rotate`].
    pub(crate) fn rotate_back(&self, vector: &S::PerTangent<f64>) -> S::PerTangent<f64> {
        self.rotated(vector, -1.0)
    }

    /// A vector rotated by the angle of the direction times −`sense`.
    fn rotated(&self, vector: &S::PerTangent<f64>, sense: f64) -> S::PerTangent<f64> {
        let mut rotated = *vector;
        match (self.direction.as_ref(), rotated.as_mut()) {
            (&[c, s], [x, y]) => [*x, *y] = [c * *x + sense * s * *y, c * *y - sense * s * *x],
            (&[sign, ..], rotated) => rotated[0] *= sign,
            ([], _) => {}
        }
        rotated
    }

    /// Components in the rows of axis `k` of its frame: d, then e.
    pub(crate) fn axis(&self, k: usize) -> S::PerTangent<f64> {
        let mut unit = S::each_tangent(0.0);
        unit[k] = 1.0;
        self.rotate_back(&unit)
    }

    /// Sign of the force on rows that are rotated only where slip has several components.
    pub(crate) fn sign(&self) -> f64 {
        if S::TANGENTS == 1 {
            self.direction[0]
        } else {
            1.0
        }
    }
}

/// Forces, and the velocities that correspond to them.
pub(crate) struct Forces<S: Space = Layer> {
    /// f of each candidate, in mu·a²·rate.
    pub(crate) normal: Vec<f64>,
    /// t of each friction force.
    pub(crate) tangential: Vec<S::PerTangent<f64>>,
    /// w of each candidate, in a·rate.
    pub(crate) slack: Vec<f64>,
    /// z of each friction force.
    pub(crate) slip: Vec<S::PerTangent<f64>>,
}

impl<S: Space> Default for Forces<S> {
    fn default() -> Self {
        let (normal, tangential) = (Vec::new(), Vec::new());
        Self {
            normal,
            tangential,
            slack: Vec::new(),
            slip: Vec::new(),
        }
    }
}

impl<S: Space> Forces<S> {
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.normal.clone_from(&other.normal);
        self.tangential.clone_from(&other.tangential);
        self.slack.clone_from(&other.slack);
        self.slip.clone_from(&other.slip);
    }

    /// Sets all forces to zero, of as many candidates and friction forces as the problem has.
    pub(crate) fn reset(&mut self, problem: &Problem<S>) {
        self.normal.clear();
        self.normal.resize(problem.normal.len(), 0.0);
        self.tangential.clear();
        self.tangential
            .resize(problem.friction.len(), S::each_tangent(0.0));
    }

    pub(crate) fn project_onto_bounds(&mut self, problem: &Problem<S>) {
        for f in &mut self.normal {
            *f = f.max(0.0);
        }
        for (t, entry) in self.tangential.iter_mut().zip(&problem.friction) {
            *t = S::within(t, entry.bound(self.normal[entry.contact]));
        }
    }

    /// Halves the step from `from` to these forces, whose slack and slip are known.
    pub(crate) fn halve_step(&mut self, from: &Self) {
        self.combine(from, |x, x_from| 0.5 * (x + x_from));
    }

    /// Multiplies the step from `from` to these forces, whose slack and slip are known.
    pub(crate) fn scale_step(&mut self, from: &Self, factor: f64) {
        self.combine(from, |x, x_from| x_from + factor * (x - x_from));
    }

    fn combine(&mut self, from: &Self, combined: impl Fn(f64, f64) -> f64) {
        for (values, from) in [
            (&mut self.normal[..], &from.normal[..]),
            (&mut self.slack, &from.slack),
            (
                S::components_mut(&mut self.tangential),
                S::components(&from.tangential),
            ),
            (S::components_mut(&mut self.slip), S::components(&from.slip)),
        ] {
            for (x, x_from) in values.iter_mut().zip(from) {
                *x = combined(*x, *x_from);
            }
        }
    }

    /// Violations of the conditions by forces whose slack and slip are known: `min(G f, w)` of each
    /// candidate, with the G that `mobility` returns.
    fn normal_violations(&self, mobility: impl Fn(usize) -> f64) -> impl Iterator<Item = f64> {
        let pairs = self.normal.iter().zip(&self.slack).enumerate();
        pairs.map(move |(k, (f, w))| (mobility(k) * f).min(*w))
    }

    /// Violations `|t − P(t + z/G)|` of each friction force, where P projects onto the bound ρ.
    fn friction_violations(
        &self,
        problem: &Problem<S>,
        mobility: impl Fn(usize) -> f64,
    ) -> impl Iterator<Item = f64> {
        let pairs = self.tangential.iter().zip(&self.slip);
        pairs.zip(&problem.friction).map(move |((t, z), entry)| {
            let bound = entry.bound(self.normal[entry.contact]);
            let trial = trial_force::<S>(t, z, mobility(entry.contact) + entry.compliance);
            let mut difference = S::within(&trial, bound);
            for k in 0..S::TANGENTS {
                difference[k] = t[k] - difference[k];
            }
            S::length(&difference)
        })
    }

    /// Sum of the squared violations of the conditions by these forces, whose slack and slip are
    /// known.
    pub(crate) fn square_violation(&self, problem: &Problem<S>, system: &impl System<S>) -> f64 {
        let mobility = |k| system.mobility(k);
        let normal = self.normal_violations(mobility).enumerate();
        let normal: f64 = normal.map(|(k, x)| (x / mobility(k)).powi(2)).sum();
        let friction = self.friction_violations(problem, mobility);
        normal + friction.map(|x| x * x).sum::<f64>()
    }

    /// The quality of these forces, whose slack and slip are known, as a solution: it is measured
    /// alike for any linear algebra, with [`TYPICAL_MOBILITY`] as G.
    pub(crate) fn quality(&self, problem: &Problem<S>) -> Quality {
        let worse = |a: f64, b: f64| {
            if b.is_nan() {
                f64::INFINITY
            } else {
                a.max(b.abs())
            }
        };
        let mobility = |_| TYPICAL_MOBILITY;
        let residual = self.normal_violations(mobility).fold(0.0, worse);
        let error = self.friction_violations(problem, mobility).fold(0.0, worse);
        let loads = self.normal.iter().copied();
        let friction_error = error / loads.fold(f64::MIN_POSITIVE, f64::max);
        let status = if residual > Quality::RESIDUAL_LIMIT {
            Status::Failed
        } else if friction_error > Quality::FRICTION_LIMIT {
            Status::InexactFriction
        } else {
            Status::Solved
        };
        Quality {
            status,
            residual,
            friction_error,
            systems: 0,
        }
    }
}

/// The trial force `p = t + z/G` of the projection onto a bound, with G = `self_mobility`.
pub(crate) fn trial_force<S: Space>(
    t: &S::PerTangent<f64>,
    z: &S::PerTangent<f64>,
    self_mobility: f64,
) -> S::PerTangent<f64> {
    let mut trial = *t;
    for k in 0..S::TANGENTS {
        trial[k] += z[k] / self_mobility;
    }
    trial
}

/// Typical normal velocity of a contact under a unit of its own force, in 1/(mu·a).
pub(crate) const TYPICAL_MOBILITY: f64 = 0.02;

/// Rounding error of forces of a solved linear system, over the largest force.
pub(crate) const FORCE_ROUNDOFF: f64 = 1e-13;

/// Magnitudes treated as zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RoundoffThresholds {
    /// Forces below this, in mu·a²·rate.
    pub(crate) force: f64,
    /// Velocities below this, in a·rate.
    pub(crate) velocity: f64,
    /// Whether the linear system was solved as accurately as possible.
    pub(crate) exact: bool,
}

impl RoundoffThresholds {
    pub(crate) const NONE: Self = Self {
        force: 0.0,
        velocity: 0.0,
        exact: false,
    };
}

/// Linear algebra of a contact problem: the response of contact velocities to contact forces.
pub(crate) trait System<S: Space = Layer> {
    /// Solves the linear problem of an active set for the forces, of either sign, and their slack
    /// and slip.
    ///
    /// `last`: whether this active set is expected to be final, so that it is solved as accurately
    /// as possible. `None` where the linear system has no solution.
    fn solve(
        &mut self,
        problem: &Problem<S>,
        states: &States<S>,
        last: bool,
        forces: &mut Forces<S>,
    ) -> Option<RoundoffThresholds>;

    /// Sets slack and slip from the motion of the preceding solution; returns whether there is one.
    fn read_motion(&self, _problem: &Problem<S>, _forces: &mut Forces<S>) -> bool {
        false
    }

    /// Sets slack and slip of given forces.
    fn measure(&mut self, problem: &Problem<S>, forces: &mut Forces<S>);

    /// Approximate normal velocity of a contact under a unit of its own force; in a·rate per unit
    /// of force.
    fn mobility(&self, candidate: usize) -> f64;
}

pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, x| most.max(x.abs()))
}
