//! The entries of the contact problem: what every law comes down to at one stage.

use crate::contact::row::Row;
use crate::contact::{Quality, Status};
use crate::space::{Layer, Space};

/// Normal part of one candidate: `w = C v + bias + compliance f`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Normal<S: Space = Layer> {
    /// Row of C.
    pub(crate) row: Row<S>,
    /// What w has besides, in a·rate: the background's part, and the gap left over the time ahead.
    pub(crate) bias: f64,
    /// In a·rate per unit of force: the inverse of a spring's stiffness over the time ahead; a tiny
    /// one for a rigid contact.
    pub(crate) compliance: f64,
}

/// A friction row of one candidate: `z = D v + shift − compliance t`, `|t| ≤ ρ(f)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tangential<S: Space = Layer> {
    /// Its candidate.
    pub(crate) contact: usize,
    /// Row of D.
    pub(crate) row: Row<S>,
    /// What z has besides, in a·rate: the background's part, and the stretch of a spring over the
    /// time ahead.
    pub(crate) shift: f64,
    /// In a·rate per unit of force.
    pub(crate) compliance: f64,
    /// The bound `ρ(f) = max(0, coefficient f + intercept)` while friction is active. An infinite
    /// coefficient means no bound while the contact is loaded.
    pub(crate) coefficient: f64,
    /// See `coefficient`; in mu·a²·rate.
    pub(crate) intercept: f64,
    /// Whether friction is active: whether the load is above the critical one.
    pub(crate) active: bool,
    /// Whether friction was deactivated in this problem. That happens once: where the load is above
    /// the critical one without friction and below it with friction, friction stays active.
    pub(crate) was_deactivated: bool,
}

impl<S: Space> Tangential<S> {
    /// Bound ρ of |t| at a normal force f.
    pub(crate) fn bound(&self, f: f64) -> f64 {
        if !self.active {
            return 0.0;
        }
        let of_load = if f > 0.0 { self.coefficient * f } else { 0.0 };
        (of_load + self.intercept).max(0.0)
    }

    /// Friction in a state that does not stick, at a normal force of either sign.
    pub(crate) fn slipping_force(&self, state: FrictionState, f: f64) -> f64 {
        match state {
            FrictionState::Inactive | FrictionState::Stick => 0.0,
            _ if self.follows_load() => state.sign() * (self.coefficient * f + self.intercept),
            _ => state.sign() * self.intercept,
        }
    }

    /// Whether the bound follows the load. Otherwise it is given, as where bounds are held.
    pub(crate) fn follows_load(&self) -> bool {
        self.coefficient > 0.0
    }
}

/// One contact problem; see [`super`].
#[derive(Default, Debug)]
pub(crate) struct Problem<S: Space = Layer> {
    /// Candidates, ordered by (i, j).
    pub(crate) normal: Vec<Normal<S>>,
    /// Friction rows, ordered by candidate; candidates without one have no friction. As many as slip has components follow each other,
    /// along orthonormal directions: they are one vector, and its length is bounded.
    pub(crate) tangential: Vec<Tangential<S>>,
    /// Whether friction rows read the motion that normal forces alone leave, v_N, in place of v.
    pub(crate) uses_frictionless_slip: bool,
}

impl<S: Space> Problem<S> {
    /// Becomes equal to the other, without allocating once there is room.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.normal.clone_from(&other.normal);
        self.tangential.clone_from(&other.tangential);
        self.uses_frictionless_slip = other.uses_frictionless_slip;
    }

    /// Room for that many candidates and twice as many slips.
    pub(crate) fn reserve(&mut self, candidates: usize) {
        self.normal.reserve(candidates);
        self.tangential.reserve(2 * S::TANGENTS * candidates);
    }
}

/// A row along or across the direction of a slide.
pub(crate) struct TurnedRow<S: Space> {
    pub(crate) row: Row<S>,
    pub(crate) shift: f64,
    /// Of the two rows of the slip in it.
    pub(crate) shares: [f64; 2],
}

impl<S: Space> Problem<S> {
    /// The first of the two rows of a slide, which row `m` is one of, turned to its direction, or the second, turned across it.
    pub(crate) fn turned_row(&self, slide: &Slide, m: usize) -> TurnedRow<S> {
        let first = m - m % 2;
        let [a, b] = [&self.tangential[first], &self.tangential[first + 1]];
        let [c, s] = slide.direction;
        let shares = if m == first { [c, s] } else { [-s, c] };
        TurnedRow {
            row: a.row.combined(shares[0], &b.row, shares[1]),
            shift: shares[0] * a.shift + shares[1] * b.shift,
            shares,
        }
    }
}

/// The forces on the spheres besides those of contact, `[3N]` each.
#[derive(Clone, Copy)]
pub(crate) struct AppliedForces<'a> {
    /// All external and background forces.
    pub all: &'a [f64],
    /// Those of them that count for the motion that normal forces alone leave.
    pub frictionless: &'a [f64],
    /// Residual at which the solution is exact enough, relative to the norm of these forces; 0: as
    /// exact as rounding allows.
    pub relative_tolerance: f64,
}

impl<'a> AppliedForces<'a> {
    /// The same forces for both motions.
    pub(crate) fn both(forces: &'a [f64]) -> Self {
        Self {
            all: forces,
            frictionless: forces,
            relative_tolerance: 0.0,
        }
    }
}

/// What friction does in one row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FrictionState {
    /// No force: friction is not active, or there is no load.
    Inactive,
    /// Within the bound, z = 0.
    Stick,
    /// t = ρ; in a suspension t = ρ d with the direction d of a [`Slide`].
    SlipPositive,
    /// t = −ρ.
    SlipNegative,
}

impl FrictionState {
    /// The slipping state with a force of that sign.
    pub(crate) fn slipping(towards: f64) -> Self {
        if towards > 0.0 {
            Self::SlipPositive
        } else {
            Self::SlipNegative
        }
    }

    /// The state of a row with that force, were it free of its bound.
    pub(crate) fn of(force: f64, bound: f64) -> Self {
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

/// The active set: what each candidate and each row does. The problem is linear once it is known.
#[derive(Debug, Default)]
pub(crate) struct States {
    /// Whether each candidate is closed.
    pub(crate) closed: Vec<bool>,
    /// What each row does. In a suspension the rows of one slip do the same.
    pub(crate) friction: Vec<FrictionState>,
    /// How each slip slides where it does, in a suspension; none in a layer.
    pub(crate) slides: Vec<Slide>,
}

/// A slip along a direction that turns with the forces, by components along its two rows.
///
/// ```text
/// t = ρ(f) p/|p|,  p = t + z/G       linearised about the present p, with d = p/|p| and e across d:
/// t_d = ρ(f),      z_e = c t_e,      c = G (|p| − ρ)/ρ
/// ```
/// Along d it slips as in a layer; across d it sticks, with a compliance (Alart & Curnier 1991).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Slide {
    /// d, by components along the rows.
    pub(crate) direction: [f64; 2],
    /// c, in a·rate per unit of force.
    pub(crate) compliance: f64,
}

impl Slide {
    /// The direction is of no meaning yet.
    pub(crate) const NONE: Self = Self {
        direction: [1.0, 0.0],
        compliance: 0.0,
    };

    /// The slide of a trial force p whose `length` is above the bound ρ ≥ 0; `own` is G.
    pub(crate) fn under([x, y]: [f64; 2], length: f64, bound: f64, own: f64) -> Self {
        Self {
            direction: [x / length, y / length],
            compliance: if bound > 0.0 {
                own * ((length - bound) / bound).max(0.0)
            } else {
                f64::INFINITY
            },
        }
    }

    /// Components along d and e of a vector by components along the rows.
    pub(crate) fn turned(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.direction;
        [c * x + s * y, c * y - s * x]
    }

    /// The way back.
    pub(crate) fn turned_back(&self, [d, e]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.direction;
        [c * d - s * e, s * d + c * e]
    }
}

impl States {
    /// Forgets what friction does.
    pub(crate) fn clear_friction(&mut self) {
        self.friction.clear();
        self.slides.clear();
    }

    /// Adds the states of a slip that force shows, were it free of its bound.
    pub(crate) fn push_friction<S: Space>(&mut self, force: &S::PerTangent<f64>, bound: f64) {
        let [x, y] = *force.as_ref() else {
            let states = force.as_ref().iter();
            self.friction
                .extend(states.map(|&t| FrictionState::of(t, bound)));
            return;
        };
        let length = x.hypot(y);
        let mut slide = Slide::NONE;
        let state = match FrictionState::of(length, bound) {
            FrictionState::SlipPositive if length > 0.0 => {
                slide.direction = [x / length, y / length];
                slide.compliance = LIKELY_SLIP / bound;
                FrictionState::SlipPositive
            }
            FrictionState::Inactive => FrictionState::Inactive,
            _ => FrictionState::Stick,
        };
        self.friction.extend([state; 2]);
        self.slides.push(slide);
    }

    /// Sign of the force of row `m`, if that follows the load; 0 for others.
    pub(crate) fn sign(&self, m: usize) -> f64 {
        // Of a slide, the first of its turned rows follows the load, and the other sticks.
        if self.slide(m).is_some() && m % 2 == 1 {
            0.0
        } else {
            self.friction[m].sign()
        }
    }

    /// Whether row `m`, turned if it slides, sticks.
    pub(crate) fn sticks(&self, m: usize) -> bool {
        self.friction[m] == FrictionState::Stick || self.slide(m).is_some() && m % 2 == 1
    }

    /// The direction and compliance of the slip that row `m` is a part of, if it slides in a suspension.
    pub(crate) fn slide(&self, m: usize) -> Option<&Slide> {
        let slide = self.slides.get(m / 2)?;
        (self.friction[m] == FrictionState::SlipPositive).then_some(slide)
    }

    /// Room for that many candidates and twice as many rows.
    pub(crate) fn reserve(&mut self, candidates: usize) {
        self.closed.reserve(candidates);
        self.friction.reserve(4 * candidates);
        self.slides.reserve(2 * candidates);
    }
}

/// Slip velocity, in a·rate, that a slide is expected to have before the first system says it.
const LIKELY_SLIP: f64 = 0.3;

/// Forces, and the velocities that go with them.
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
    /// Takes all values of another, without allocating once there is room.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.normal.clone_from(&other.normal);
        self.tangential.clone_from(&other.tangential);
        self.slack.clone_from(&other.slack);
        self.slip.clone_from(&other.slip);
    }

    /// Room for that many candidates and twice as many rows.
    pub(crate) fn reserve(&mut self, candidates: usize) {
        self.normal.reserve(candidates);
        self.slack.reserve(candidates);
        self.tangential.reserve(4 * candidates);
        self.slip.reserve(4 * candidates);
    }

    /// No forces of no contacts.
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

    /// Brings forces that are out of their bounds back into them.
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

    /// Halves the step from other forces to these, whose slack and slip are known.
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

    /// Reads off forces, whose slack and slip are known, what they violate: of each candidate
    /// `min(G f, w)`, of each friction `|t − the nearest to t + z/G within ρ|`.
    fn violations<S: Space>(
        &self,
        problem: &Problem<S>,
        system: &impl System<S>,
        mut normal: impl FnMut(usize, f64),
        mut friction: impl FnMut(f64),
    ) {
        for (k, &f) in self.normal.iter().enumerate() {
            normal(k, (system.mobility(k) * f).min(self.slack[k]));
        }
        let slips = S::by_slip(&self.tangential)
            .iter()
            .zip(S::by_slip(&self.slip));
        for ((t, z), rows) in slips.zip(problem.tangential.chunks_exact(S::TANGENTS)) {
            let row = &rows[0];
            let bound = row.bound(self.normal[row.contact]);
            let own = system.mobility(row.contact) + row.compliance;
            let mut trial = *t;
            for k in 0..S::TANGENTS {
                trial[k] += z[k] / own;
            }
            let mut missing = S::within(&trial, bound);
            for k in 0..S::TANGENTS {
                missing[k] = t[k] - missing[k];
            }
            friction(S::length(&missing));
        }
    }

    /// Sum of the squares of what these forces violate, whose slack and slip are known.
    pub(crate) fn square_violation<S: Space>(
        &self,
        problem: &Problem<S>,
        system: &impl System<S>,
    ) -> f64 {
        let (mut normal, mut friction) = (0.0, 0.0);
        self.violations(
            problem,
            system,
            |k, missing| normal += (missing / system.mobility(k)).powi(2),
            |missing| friction += missing * missing,
        );
        normal + friction
    }

    /// Violation of the conditions by these forces, whose slack and slip are known.
    pub(crate) fn violation<S: Space>(
        &self,
        problem: &Problem<S>,
        system: &impl System<S>,
    ) -> Violation {
        let (mut residual, mut error) = (0.0_f64, 0.0_f64);
        let worse = |a: f64, b: f64| if b.is_nan() { f64::INFINITY } else { a.max(b) };
        self.violations(
            problem,
            system,
            |_, missing| residual = worse(residual, missing.abs()),
            |missing| error = worse(error, missing),
        );
        let most = self
            .normal
            .iter()
            .copied()
            .fold(f64::MIN_POSITIVE, f64::max);
        Violation {
            residual,
            friction_error: error / most,
        }
    }
}

/// By how much forces violate the conditions of a problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Violation {
    /// `max |min(G f, w)|`, G the mobility of the contact; in a·rate.
    pub(crate) residual: f64,
    /// `max |t − the nearest to t + z/G within ρ|` over the largest normal force.
    pub(crate) friction_error: f64,
}

impl Violation {
    /// What it says of a solution.
    pub(crate) fn status(self) -> Status {
        if self.residual > Quality::RESIDUAL_LIMIT {
            Status::Failed
        } else if self.friction_error > Quality::FRICTION_LIMIT {
            Status::InexactFriction
        } else {
            Status::Solved
        }
    }
}

/// Magnitudes treated as zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RoundoffThresholds {
    /// Forces below this, in mu·a²·rate.
    pub(crate) force: f64,
    /// Velocities below this, in a·rate.
    pub(crate) velocity: f64,
    /// Whether the forces are as exact as they can be.
    pub(crate) exact: bool,
}

impl RoundoffThresholds {
    /// Nothing is rounding.
    pub(crate) const NONE: Self = Self {
        force: 0.0,
        velocity: 0.0,
        exact: false,
    };
}

/// The linear algebra behind a problem: how forces of contacts move contacts.
pub(crate) trait System<S: Space = Layer> {
    /// Forces (of either sign) of an active set, with their slack and slip.
    ///
    /// `last`: whether this active set is expected to be the last, so that the forces should be as
    /// exact as they can be. `None` where the linear system has no solution.
    fn solve(
        &mut self,
        problem: &Problem<S>,
        states: &States,
        last: bool,
        forces: &mut Forces,
    ) -> Option<RoundoffThresholds>;

    /// Slack and slip of the motion of the solution before, where there is one; whether there is.
    fn read_motion(&self, _problem: &Problem<S>, _forces: &mut Forces) -> bool {
        false
    }

    /// Slack and slip of given forces.
    fn measure(&mut self, problem: &Problem<S>, forces: &mut Forces);

    /// How fast a unit of force moves its own candidate, about; in a·rate per unit of force.
    fn mobility(&self, candidate: usize) -> f64;
}

/// Largest magnitude.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, x| most.max(x.abs()))
}
