//! The entries of the contact problem: what every law comes down to at one stage.

use crate::contact::laws::COMPLIANCE;
use crate::contact::row::Row;
use crate::linalg::dense::Matrix;
use crate::model::Params;

/// Normal part of one candidate: `w = C v + bias + compliance f`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Normal {
    /// Row of C.
    pub(crate) row: Row,
    /// What w has besides, in a·rate: the background's part, and the gap left over the time ahead.
    pub(crate) bias: f64,
    /// In a·rate per unit of force: the inverse of a spring's stiffness over the time ahead; nearly nothing for a rigid contact.
    pub(crate) compliance: f64,
}

/// A tangential row of one candidate: `z = D v + shift − compliance t`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tangential {
    /// Its candidate.
    pub(crate) contact: usize,
    /// Row of D.
    pub(crate) row: Row,
    /// What z has besides, in a·rate: the background's part, and the stretch of a spring over the time ahead.
    pub(crate) shift: f64,
    /// In a·rate per unit of force.
    pub(crate) compliance: f64,
    /// Whether friction acts: the load is above the critical one.
    pub(crate) acts: bool,
    /// Whether it ceased to act in this problem, as the load with friction was below the critical one. It does so once: where the load
    /// without friction is above it the law jumps to and fro, and friction stays.
    pub(crate) ceased: bool,
}

/// One contact problem; see [`super`].
#[derive(Debug, Default)]
pub(crate) struct Problem {
    /// Candidates, ordered by (i, j).
    pub(crate) normal: Vec<Normal>,
    /// Tangential rows, ordered by candidate; candidates without one have no friction.
    pub(crate) tangential: Vec<Tangential>,
    /// ν; infinite where friction has no limit, 0 where there is none.
    pub(crate) friction: f64,
    /// Load taken off before friction.
    pub(crate) offset: f64,
    /// Whether tangential rows read the motion that normal forces alone leave.
    pub(crate) isolated: bool,
}

impl Problem {
    /// Whether contacts give way under their forces.
    pub(crate) fn is_soft(&self) -> bool {
        let mut entries = self.normal.iter();
        entries.any(|entry| entry.compliance > COMPLIANCE)
    }

    /// Whether contacts do not give way and friction is a reaction to the motion that it slows: such a problem need not have a solution.
    pub(crate) fn can_jam(&self) -> bool {
        self.friction > 0.0 && !self.isolated && !self.is_soft()
    }

    /// Whether it can jam, and friction is [steep](Params::STEEP_ABOVE).
    pub(crate) fn is_steep(&self) -> bool {
        self.friction > Params::STEEP_ABOVE && self.can_jam()
    }

    /// Bound ρ of |t| in a row, at normal forces f.
    pub(crate) fn bound(&self, row: &Tangential, f: &[f64]) -> f64 {
        let load = f[row.contact] - self.offset;
        if load > 0.0 && row.acts {
            self.friction * load
        } else {
            0.0
        }
    }
}

/// What drives the spheres besides contacts, `[3N]` each.
#[derive(Clone, Copy)]
pub struct Driving<'a> {
    /// All external and background forces.
    pub all: &'a [f64],
    /// Those of them that count for the motion that normal forces alone leave.
    pub isolated: &'a [f64],
    /// Residual that is enough, over the norm of these forces; 0: as exact as can be.
    pub enough: f64,
}

impl<'a> Driving<'a> {
    /// The same forces for both motions.
    pub fn by(forces: &'a [f64]) -> Self {
        Self {
            all: forces,
            isolated: forces,
            enough: 0.0,
        }
    }
}

/// What a tangential row does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Grip {
    /// No force: friction does not act, or there is no load.
    Off,
    /// Within the bound, z = 0.
    Stick,
    /// t = ρ.
    Plus,
    /// t = −ρ.
    Minus,
}

impl Grip {
    /// The sliding state with a force of that sign.
    pub(crate) fn sliding(towards: f64) -> Self {
        if towards > 0.0 {
            Self::Plus
        } else {
            Self::Minus
        }
    }

    /// Sign of the force of a sliding row; 0 in other states.
    pub(crate) fn sign(self) -> f64 {
        match self {
            Self::Plus => 1.0,
            Self::Minus => -1.0,
            Self::Off | Self::Stick => 0.0,
        }
    }
}

/// What each candidate and each row does; the problem is linear once this is known.
#[derive(Debug, Default)]
pub(crate) struct States {
    /// Whether each candidate is closed.
    pub(crate) closed: Vec<bool>,
    /// What each row does.
    pub(crate) grip: Vec<Grip>,
}

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
    /// Takes the forces of others, without slack and slip, and without allocating once there is room.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.normal.clone_from(&other.normal);
        self.tangential.clone_from(&other.tangential);
    }

    /// The same, with slack and slip.
    pub(crate) fn copy_all_from(&mut self, other: &Self) {
        self.copy_from(other);
        self.slack.clone_from(&other.slack);
        self.slip.clone_from(&other.slip);
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
}

/// What decides nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Noise {
    /// Forces below this, in mu·a²·rate.
    pub(crate) force: f64,
    /// Velocities below this, in a·rate.
    pub(crate) velocity: f64,
    /// Whether the forces are as exact as they can be.
    pub(crate) exact: bool,
}

/// The linear algebra behind a problem: how forces of contacts move contacts.
pub(crate) trait System {
    /// Forces (of either sign) that the states give, with their slack and slip.
    ///
    /// `last`: whether these states are expected to be the last, so that the forces had better be as exact as they can. `None` where the
    /// states have no solution.
    fn solve(
        &mut self,
        problem: &Problem,
        states: &States,
        last: bool,
        forces: &mut Forces,
    ) -> Option<Noise>;

    /// Whether there is a matrix of all forces and contacts: whether there are not too many of them.
    fn has_matrix(&self, problem: &Problem) -> bool;

    /// How all forces (f, t) move all contacts (w, z), without compliance: a square matrix, which takes the shape. `false`, and nothing is
    /// written, where there is none.
    fn fill_matrix(&mut self, problem: &Problem, matrix: &mut Matrix) -> bool;

    /// Slack and slip of given forces.
    fn measure(&mut self, problem: &Problem, forces: &mut Forces);

    /// How fast a unit of force moves its own candidate, about; in a·rate per unit of force.
    fn mobility(&self, candidate: usize) -> f64;
}

/// Largest magnitude.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, x| most.max(x.abs()))
}
