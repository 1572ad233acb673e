//! Two surfaces that touch, or are about to.

use super::row::Row;
use crate::law::rolling_friction;
use crate::space::modes::{Background, Vec2};
use crate::space::pair::Neighbours;
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
pub struct Contact {
    /// The pair.
    pub pair: Neighbours,
    /// Centre-to-contact distances l_i and l_j, in a.
    pub levers: [f64; 2],
    /// Inverse slip mobility K of the isolated pair, in mu·a; 0 where friction was never asked for.
    pub slip_resistance: f64,
    /// n·(u∞_j − u∞_i) and the slip of the background itself.
    pub background: [f64; 2],
    /// Normal force f ≥ 0, in mu·a²·rate.
    pub normal_force: f64,
    /// Tangential force F_t, in mu·a²·rate.
    pub tangential_force: f64,
    /// v_n in the final motion.
    pub normal_velocity: f64,
    /// u_t in the final motion.
    pub slip_velocity: f64,
    /// What it does.
    pub state: ContactState,
    /// Quasi-force F_r of rolling friction, in mu·a²·rate: the couple on i over the radius of rolling; 0 without such friction.
    pub rolling_force: f64,
    /// Rolling velocity u_r in the final motion.
    pub rolling_velocity: f64,
    /// Whether rolling friction halts it: whether F_r is within its bound.
    pub(crate) rolling_halted: bool,
    /// Whether friction acts on it: its load was above the critical one when that was decided.
    pub(crate) friction_acts: bool,
}

impl Contact {
    /// A pair without forces.
    pub fn new(pair: Neighbours, radii: &[f64], background: &Background) -> Self {
        let levers = [
            radii[pair.i] + 0.5 * pair.gap,
            radii[pair.j] + 0.5 * pair.gap,
        ];
        // The background's velocity difference over the actual separation.
        let difference = background.velocity(pair.normal * pair.distance);
        let normal = pair.normal.dot(&difference);
        let slip = tangent(pair.normal).dot(&difference)
            - (levers[0] + levers[1]) * background.angular_velocity;
        Self {
            pair,
            levers,
            slip_resistance: 0.0,
            background: [normal, slip],
            normal_force: 0.0,
            tangential_force: 0.0,
            normal_velocity: 0.0,
            slip_velocity: 0.0,
            state: ContactState::Frictionless,
            rolling_force: 0.0,
            rolling_velocity: 0.0,
            rolling_halted: false,
            friction_acts: false,
        }
    }

    /// The row of C that reads v_n, without the background, off disturbance velocities.
    pub(crate) fn normal_row(&self) -> Row {
        Row::normal([self.pair.i, self.pair.j], self.pair.normal)
    }

    /// The row of D that reads the slip, likewise.
    pub(crate) fn slip_row(&self) -> Row {
        let t = tangent(self.pair.normal);
        Row::slip([self.pair.i, self.pair.j], t, self.levers)
    }

    /// The row that reads the rolling velocity. The background turns both spheres alike.
    pub(crate) fn rolling_row(&self) -> Row {
        let radii = self.levers.map(|lever| lever - 0.5 * self.pair.gap);
        Row::rolling([self.pair.i, self.pair.j], rolling_friction::radius(radii))
    }

    /// Takes the velocities of the contact in a motion with disturbances `[3N]`.
    pub(crate) fn take_velocities(&mut self, velocities: &[f64]) {
        self.normal_velocity = self.background[0] + self.normal_row().read(velocities);
        self.slip_velocity = self.background[1] + self.slip_row().read(velocities);
        self.rolling_velocity = self.rolling_row().read(velocities);
    }
}

/// The tangent t = (−n_y, n_x).
pub fn tangent(n: Vec2) -> Vec2 {
    Vec2::new(-n.y, n.x)
}
