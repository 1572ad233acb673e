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

/// A friction row of one candidate: `z = D v + shift − compliance t`, `|t| ≤ ρ(f)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tangential<S: Space = Layer> {
    /// Index of its candidate.
    pub(crate) contact: usize,
    /// Row of D.
    pub(crate) row: Row<S>,
    /// Constant part of z, in a·rate: the background's contribution, and that of the spring force
    /// over the time span.
    pub(crate) shift: f64,
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

impl<S: Space> Tangential<S> {
    /// Bound ρ on |t| at a normal force f.
    pub(crate) fn bound(&self, f: f64) -> f64 {
        if !self.active {
            return 0.0;
        }
        let load_part = if f > 0.0 { self.coefficient * f } else { 0.0 };
        (load_part + self.intercept).max(0.0)
    }

    /// Friction force in a state other than sticking, at a normal force of either sign.
    pub(crate) fn slipping_force(&self, state: FrictionState, f: f64) -> f64 {
        match state {
            FrictionState::Inactive | FrictionState::Stick => 0.0,
            _ if self.follows_load() => state.sign() * (self.coefficient * f + self.intercept),
            _ => state.sign() * self.intercept,
        }
    }

    /// Whether the bound is proportional to the load. Otherwise it is a constant, as where bounds
    /// are fixed.
    pub(crate) fn follows_load(&self) -> bool {
        self.coefficient > 0.0
    }
}

/// One contact problem; see [`super`].
#[derive(Default, Debug)]
pub(crate) struct Problem<S: Space = Layer> {
    /// Candidates, ordered by (i, j).
    pub(crate) normal: Vec<Normal<S>>,
    /// Friction rows, ordered by candidate; candidates without a row have no friction. Consecutive
    /// rows, as many as slip has components, are along orthonormal directions: together they are
    /// one vector with a bounded length.
    pub(crate) tangential: Vec<Tangential<S>>,
    /// Whether friction rows act on the motion v_N under normal forces alone, instead of v.
    pub(crate) uses_frictionless_slip: bool,
}

impl<S: Space> Problem<S> {
    /// Copies another value, without allocating once there is capacity.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.normal.clone_from(&other.normal);
        self.tangential.clone_from(&other.tangential);
        self.uses_frictionless_slip = other.uses_frictionless_slip;
    }

    /// Reserves memory for that many candidates and twice as many friction vectors.
    pub(crate) fn reserve(&mut self, candidates: usize) {
        self.normal.reserve(candidates);
        self.tangential.reserve(2 * S::TANGENTS * candidates);
    }
}

/// A friction row in the frame of a slide: along its direction or across it.
pub(crate) struct RotatedRow<S: Space> {
    pub(crate) row: Row<S>,
    pub(crate) shift: f64,
    /// Components of this row in the two rows of the vector.
    pub(crate) components: [f64; 2],
}

impl<S: Space> Problem<S> {
    /// Row `m` rotated to the frame of its slide: the first of the two rows is along the direction,
    /// the second across it.
    pub(crate) fn rotated_row(&self, slide: &Slide, m: usize) -> RotatedRow<S> {
        let first = m - m % 2;
        let [a, b] = [&self.tangential[first], &self.tangential[first + 1]];
        let [c, s] = slide.direction;
        let components = if m == first { [c, s] } else { [-s, c] };
        RotatedRow {
            row: a.row.combined(components[0], &b.row, components[1]),
            shift: components[0] * a.shift + components[1] * b.shift,
            components,
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

/// Friction state of one row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FrictionState {
    /// No friction force: friction is not active, or there is no load.
    Inactive,
    /// |t| below the bound and z = 0.
    Stick,
    /// t = ρ; in a suspension t = ρ d, with the direction d of a [`Slide`].
    SlipPositive,
    /// t = −ρ.
    SlipNegative,
}

impl FrictionState {
    /// The slipping state with a force of the given sign.
    pub(crate) fn slipping(towards: f64) -> Self {
        if towards > 0.0 {
            Self::SlipPositive
        } else {
            Self::SlipNegative
        }
    }

    /// The state of a row, inferred from its unbounded force.
    pub(crate) fn from_force(force: f64, bound: f64) -> Self {
        if bound == 0.0 {
            Self::Inactive
        } else if force.abs() < bound * (1.0 - 1e-12) {
            Self::Stick
        } else {
            Self::slipping(force)
        }
    }

    /// Sign of the force of a slipping row; 0 in other states.
    pub(crate) fn sign(self) -> f64 {
        match self {
            Self::SlipPositive => 1.0,
            Self::SlipNegative => -1.0,
            Self::Inactive | Self::Stick => 0.0,
        }
    }
}

/// The active set: the state of each candidate and each friction row. For a given active set the
/// problem is linear.
#[derive(Debug, Default)]
pub(crate) struct States {
    /// Whether each candidate is closed.
    pub(crate) closed: Vec<bool>,
    /// State of each row. In a suspension both rows of a vector have the same state.
    pub(crate) friction: Vec<FrictionState>,
    /// Linearised slip of each friction vector in a suspension; empty where slip has one component.
    pub(crate) slides: Vec<Slide>,
}

/// Linearised slip in a suspension, where the direction rotates with the forces. Vectors are given
/// by their components in the two rows.
///
/// ```text
/// t = ρ(f) p/|p|,  p = t + z/G       linearised about the current p, with d = p/|p| and e ⟂ d:
/// t_d = ρ(f),      z_e = c t_e,      c = G (|p| − ρ)/ρ
/// ```
/// Along d the contact slips as in a layer; along e it sticks, with a compliance (Alart & Curnier
/// 1991).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Slide {
    /// d, by its components in the rows.
    pub(crate) direction: [f64; 2],
    /// c, in a·rate per unit of force.
    pub(crate) compliance: f64,
}

impl Slide {
    /// A slide whose direction is not known yet.
    pub(crate) const NONE: Self = Self {
        direction: [1.0, 0.0],
        compliance: 0.0,
    };

    /// The slide of a trial force p with a `length` above the bound ρ ≥ 0; `self_mobility` is G.
    pub(crate) fn from_trial(
        [x, y]: [f64; 2],
        length: f64,
        bound: f64,
        self_mobility: f64,
    ) -> Self {
        Self {
            direction: [x / length, y / length],
            compliance: if bound > 0.0 {
                self_mobility * ((length - bound) / bound).max(0.0)
            } else {
                f64::INFINITY
            },
        }
    }

    /// Components along d and e of a vector given by its components in the rows.
    pub(crate) fn rotate(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.direction;
        [c * x + s * y, c * y - s * x]
    }

    /// The inverse of [`Slide::rotate`].
    pub(crate) fn rotate_back(&self, [d, e]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.direction;
        [c * d - s * e, s * d + c * e]
    }
}

impl States {
    /// Removes all friction states.
    pub(crate) fn clear_friction(&mut self) {
        self.friction.clear();
        self.slides.clear();
    }

    /// Adds the state of a friction vector, inferred from its unbounded force.
    pub(crate) fn push_friction<S: Space>(&mut self, force: &S::PerTangent<f64>, bound: f64) {
        let [x, y] = *force.as_ref() else {
            let states = force.as_ref().iter();
            self.friction
                .extend(states.map(|&t| FrictionState::from_force(t, bound)));
            return;
        };
        let length = x.hypot(y);
        let mut slide = Slide::NONE;
        let state = match FrictionState::from_force(length, bound) {
            FrictionState::SlipPositive if length > 0.0 => {
                slide.direction = [x / length, y / length];
                slide.compliance = EXPECTED_SLIP / bound;
                FrictionState::SlipPositive
            }
            FrictionState::Inactive => FrictionState::Inactive,
            _ => FrictionState::Stick,
        };
        self.friction.extend([state; 2]);
        self.slides.push(slide);
    }

    /// Sign of the force of row `m` if it is proportional to the load; 0 for others.
    pub(crate) fn sign(&self, m: usize) -> f64 {
        // In the frame of a slide, the first row slips and the second sticks.
        if self.slide(m).is_some() && m % 2 == 1 {
            0.0
        } else {
            self.friction[m].sign()
        }
    }

    /// Whether row `m`, in the frame of its slide if it slides, sticks.
    pub(crate) fn sticks(&self, m: usize) -> bool {
        self.friction[m] == FrictionState::Stick || self.slide(m).is_some() && m % 2 == 1
    }

    /// The slide of the vector that row `m` belongs to, if it slides in a suspension.
    pub(crate) fn slide(&self, m: usize) -> Option<&Slide> {
        let slide = self.slides.get(m / 2)?;
        (self.friction[m] == FrictionState::SlipPositive).then_some(slide)
    }

    /// Reserves memory for that many candidates and twice as many friction vectors.
    pub(crate) fn reserve(&mut self, candidates: usize) {
        self.closed.reserve(candidates);
        self.friction.reserve(4 * candidates);
        self.slides.reserve(2 * candidates);
    }
}

/// Slip velocity, in a·rate, expected of a slide before the first linear system.
const EXPECTED_SLIP: f64 = 0.3;

/// Forces, and the velocities that correspond to them.
#[derive(Debug, Default)]
pub(crate) struct Forces {
    /// f of each candidate, in mu·a²·rate.
    pub(crate) normal: Vec<f64>,
    /// t of each row.
    pub(crate) tangential: Vec<f64>,
    /// w of each candidate, in a·rate.
    pub(crate) slack: Vec<f64>,
    /// z of each row.
    pub(crate) slip: Vec<f64>,
}

impl Forces {
    /// Copies another value, without allocating once there is capacity.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.normal.clone_from(&other.normal);
        self.tangential.clone_from(&other.tangential);
        self.slack.clone_from(&other.slack);
        self.slip.clone_from(&other.slip);
    }

    /// Reserves memory for that many candidates and twice as many friction vectors.
    pub(crate) fn reserve(&mut self, candidates: usize) {
        self.normal.reserve(candidates);
        self.slack.reserve(candidates);
        self.tangential.reserve(4 * candidates);
        self.slip.reserve(4 * candidates);
    }

    /// Removes all forces.
    pub(crate) fn clear(&mut self) {
        for values in [
            &mut self.normal,
            &mut self.tangential,
            &mut self.slack,
            &mut self.slip,
        ] {
            values.clear();
        }
    }

    /// Projects forces onto their bounds.
    pub(crate) fn project_onto_bounds<S: Space>(&mut self, problem: &Problem<S>) {
        for f in &mut self.normal {
            *f = f.max(0.0);
        }
        let slips = S::by_slip_mut(&mut self.tangential).iter_mut();
        for (t, rows) in slips.zip(problem.tangential.chunks_exact(S::TANGENTS)) {
            let bound = rows[0].bound(self.normal[rows[0].contact]);
            *t = S::within(t, bound);
        }
    }

    /// Halves the step from `from` to these forces, whose slack and slip are known.
    pub(crate) fn halve_step(&mut self, from: &Self) {
        for (values, from) in [
            (&mut self.normal, &from.normal),
            (&mut self.tangential, &from.tangential),
            (&mut self.slack, &from.slack),
            (&mut self.slip, &from.slip),
        ] {
            for (x, x_from) in values.iter_mut().zip(from) {
                *x = 0.5 * (*x + x_from);
            }
        }
    }

    /// Evaluates the violation of the conditions by forces whose slack and slip are known:
    /// `min(G f, w)` of each candidate, and `|t − P(t + z/G)|` of each friction vector, where P
    /// projects onto the bound ρ. `mobility` returns the G of a candidate.
    fn violations<S: Space>(
        &self,
        problem: &Problem<S>,
        mobility: impl Fn(usize) -> f64,
        mut normal: impl FnMut(usize, f64),
        mut friction: impl FnMut(f64),
    ) {
        for (k, &f) in self.normal.iter().enumerate() {
            normal(k, (mobility(k) * f).min(self.slack[k]));
        }
        let slips = S::by_slip(&self.tangential)
            .iter()
            .zip(S::by_slip(&self.slip));
        for ((t, z), rows) in slips.zip(problem.tangential.chunks_exact(S::TANGENTS)) {
            let row = &rows[0];
            let bound = row.bound(self.normal[row.contact]);
            let self_mobility = mobility(row.contact) + row.compliance;
            let mut trial = *t;
            for k in 0..S::TANGENTS {
                trial[k] += z[k] / self_mobility;
            }
            let mut difference = S::within(&trial, bound);
            for k in 0..S::TANGENTS {
                difference[k] = t[k] - difference[k];
            }
            friction(S::length(&difference));
        }
    }

    /// Sum of the squared violations of the conditions by these forces, whose slack and slip are
    /// known.
    pub(crate) fn square_violation<S: Space>(
        &self,
        problem: &Problem<S>,
        system: &impl System<S>,
    ) -> f64 {
        let (mut normal, mut friction) = (0.0, 0.0);
        self.violations(
            problem,
            |k| system.mobility(k),
            |k, violation| normal += (violation / system.mobility(k)).powi(2),
            |violation| friction += violation * violation,
        );
        normal + friction
    }

    /// The quality of these forces, whose slack and slip are known, as a solution: it is measured
    /// alike for any linear algebra, with [`TYPICAL_MOBILITY`] as G.
    pub(crate) fn quality<S: Space>(&self, problem: &Problem<S>) -> Quality {
        let (mut residual, mut error) = (0.0_f64, 0.0_f64);
        let worse = |a: f64, b: f64| if b.is_nan() { f64::INFINITY } else { a.max(b) };
        self.violations(
            problem,
            |_| TYPICAL_MOBILITY,
            |_, violation| residual = worse(residual, violation.abs()),
            |violation| error = worse(error, violation),
        );
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

/// Typical normal velocity of a contact under a unit of its own force, in 1/(mu·a).
pub(crate) const TYPICAL_MOBILITY: f64 = 0.02;

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
    /// No magnitude is treated as zero.
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
        states: &States,
        last: bool,
        forces: &mut Forces,
    ) -> Option<RoundoffThresholds>;

    /// Sets slack and slip from the motion of the preceding solution; returns whether there is one.
    fn read_motion(&self, _problem: &Problem<S>, _forces: &mut Forces) -> bool {
        false
    }

    /// Sets slack and slip of given forces.
    fn measure(&mut self, problem: &Problem<S>, forces: &mut Forces);

    /// Approximate normal velocity of a contact under a unit of its own force; in a·rate per unit
    /// of force.
    fn mobility(&self, candidate: usize) -> f64;
}

/// Largest magnitude.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, x| most.max(x.abs()))
}
