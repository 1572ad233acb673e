//! Two surfaces that touch, or are about to.

use super::row::Row;
use crate::law::rolling_friction;
use crate::space::modes::Vec2;
use crate::space::pair::Neighbours;
use crate::space::{ImposedFlow as _, Layer, Space};
use serde::{Deserialize, Serialize};

/// What a contact does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ContactState {
    /// No friction: no force, or one below the critical load.
    Frictionless,
    /// Friction as the isolated pair's lubrication would need it to roll; under laws without slip, friction within its limit.
    Rolling,
    /// Friction at its limit.
    Slipping,
}

/// One candidate pair with its forces and velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact<S: Space = Layer> {
    /// The pair.
    pub pair: Neighbours<S>,
    /// Centre-to-contact distances l_i and l_j, in a.
    pub levers: [f64; 2],
    /// Inverse slip mobility K of the isolated pair, in mu·a; 0 where friction was never asked for.
    pub(crate) slip_resistance: f64,
    /// n·(u∞_j − u∞_i).
    pub background_approach: f64,
    /// The slip of the background itself.
    pub background_slip: S::Tangent,
    /// Normal force f ≥ 0, in mu·a²·rate.
    pub normal_force: f64,
    /// Tangential force F_t, in mu·a²·rate.
    pub tangential_force: S::Tangent,
    /// v_n in the final motion.
    pub normal_velocity: f64,
    /// u_t in the final motion.
    pub slip_velocity: S::Tangent,
    /// What it does.
    pub state: ContactState,
    /// Quasi-force F_r of rolling friction, in mu·a²·rate: the couple on i over the radius of rolling; 0 without such friction.
    pub rolling_force: S::Tangent,
    /// Rolling velocity u_r in the final motion.
    pub rolling_velocity: S::Tangent,
    /// Whether rolling friction halts it: whether F_r is within its bound.
    pub(crate) rolling_halted: bool,
    /// Whether friction acts on it: its load was above the critical one when that was decided.
    pub(crate) friction_acts: bool,
}

impl<S: Space> Contact<S> {
    /// A pair without forces.
    pub fn new(pair: Neighbours<S>, radii: &[f64], background: &S::Background) -> Self {
        let levers = [
            radii[pair.i] + 0.5 * pair.gap,
            radii[pair.j] + 0.5 * pair.gap,
        ];
        // The background's velocity difference over the actual separation.
        let difference = background.velocity_at(&(pair.normal * pair.distance));
        let directions = S::tangents(&pair.normal);
        let mut slip = S::each_tangent(0.0);
        for k in 0..S::TANGENTS {
            let turning = S::spin_dot(&S::axis(&pair.normal, &directions[k]), &background.spin());
            slip[k] = S::dot(&directions[k], &difference) - (levers[0] + levers[1]) * turning;
        }
        Self {
            pair,
            levers,
            slip_resistance: 0.0,
            background_approach: S::dot(&pair.normal, &difference),
            background_slip: S::tangent(&directions, &slip),
            normal_force: 0.0,
            tangential_force: S::Tangent::default(),
            normal_velocity: 0.0,
            slip_velocity: S::Tangent::default(),
            state: ContactState::Frictionless,
            rolling_force: S::Tangent::default(),
            rolling_velocity: S::Tangent::default(),
            rolling_halted: false,
            friction_acts: false,
        }
    }

    /// The row of C that reads v_n, without the background, off disturbance velocities.
    pub(crate) fn normal_row(&self) -> Row<S> {
        Row::normal([self.pair.i, self.pair.j], &self.pair.normal)
    }

    /// The directions along which rows read slip and rolling.
    pub(crate) fn directions(&self) -> S::PerTangent<S::Vector> {
        S::tangents(&self.pair.normal)
    }

    /// The row of D that reads the slip along a direction, likewise.
    pub(crate) fn slip_row(&self, direction: &S::Vector) -> Row<S> {
        let spheres = [self.pair.i, self.pair.j];
        Row::slip(spheres, &self.pair.normal, direction, self.levers)
    }

    /// The row that reads the rotation of one sphere against the other that rolls along a direction.
    pub(crate) fn spin_row(&self, direction: &S::Vector) -> Row<S> {
        Row::spin([self.pair.i, self.pair.j], &self.pair.normal, direction)
    }

    /// The row that reads the rolling velocity along a direction. The background turns both spheres alike.
    pub(crate) fn rolling_row(&self, direction: &S::Vector) -> Row<S> {
        let radii = self.levers.map(|lever| lever - 0.5 * self.pair.gap);
        let spheres = [self.pair.i, self.pair.j];
        let radius = rolling_friction::radius(radii);
        Row::rolling(spheres, &self.pair.normal, direction, radius)
    }

    /// v_n in a motion with disturbances of all spheres.
    pub(crate) fn approach(&self, velocities: &[f64]) -> f64 {
        self.background_approach + self.normal_row().read(velocities)
    }

    /// Takes the velocities of the contact in a motion with disturbances of all spheres.
    pub(crate) fn take_velocities(&mut self, velocities: &[f64]) {
        self.normal_velocity = self.approach(velocities);
        let directions = self.directions();
        let [mut slip, mut rolling] = [S::each_tangent(0.0); 2];
        for k in 0..S::TANGENTS {
            slip[k] = self.slip_row(&directions[k]).read(velocities);
            rolling[k] = self.rolling_row(&directions[k]).read(velocities);
        }
        self.slip_velocity = self.background_slip + S::tangent(&directions, &slip);
        self.rolling_velocity = S::tangent(&directions, &rolling);
    }
}

/// The tangent t = (−n_y, n_x).
pub fn tangent(n: Vec2) -> Vec2 {
    Vec2::new(-n.y, n.x)
}
