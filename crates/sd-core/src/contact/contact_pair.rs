//! Pairs of spheres in contact or close to it.

use super::row::Row;
use crate::law::rolling_friction;
use crate::model::PressureKind;
use crate::space::pair::Neighbours;
use crate::space::{IncidentFlow, Layer, Space};
use serde::{Deserialize, Serialize};

/// Friction state of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ContactState {
    /// No friction: there is no normal force, or it is below the critical load.
    Frictionless,
    /// Friction is below its bound: it prevents slip, or under roll-slip the isolated pair rolls.
    #[serde(rename = "rolling")]
    Sticking,
    /// Friction is at its bound: the surfaces slip.
    Slipping,
}

/// One candidate pair with its forces and velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact<S: Space = Layer> {
    /// The pair.
    pub pair: Neighbours<S>,
    /// Centre-to-contact distances l_i and l_j, in a.
    pub levers: [f64; 2],
    /// Inverse slip mobility K of the isolated pair, in mu·a; 0 until it is needed.
    pub(crate) slip_resistance: f64,
    /// n·(u∞_j − u∞_i).
    pub background_approach: f64,
    /// Slip velocity of the background.
    pub background_slip: S::Tangent,
    /// Relative rotation of the background that corresponds to rolling: 0 in a linear flow, which
    /// rotates both spheres equally.
    pub background_spin: S::Tangent,
    /// Normal force f ≥ 0, in mu·a²·rate.
    pub normal_force: f64,
    /// Tangential force F_t, in mu·a²·rate.
    pub tangential_force: S::Tangent,
    /// v_n in the solution.
    pub normal_velocity: f64,
    /// u_t in the solution.
    pub slip_velocity: S::Tangent,
    /// Friction state.
    pub state: ContactState,
    /// Quasi-force F_r of rolling friction, in mu·a²·rate: the couple on i over the rolling radius;
    /// 0 without rolling friction.
    pub rolling_force: S::Tangent,
    /// Rolling velocity u_r in the solution.
    pub rolling_velocity: S::Tangent,
    /// Whether rolling friction prevents rolling, i.e. F_r is below its bound.
    pub(crate) rolling_sticks: bool,
    /// Whether friction is active, as last determined by comparing the load with the critical load.
    pub(crate) friction_acts: bool,
    /// Normal force at which friction is bounded while bounds are held: that of the last solution
    /// before.
    pub(crate) held_load: f64,
}

impl<S: Space> Contact<S> {
    /// A pair without forces.
    ///
    /// # Panics
    /// If there is no radius of one of its spheres, or the flow has no departure there.
    pub fn new(pair: Neighbours<S>, radii: &[f64], flow: &IncidentFlow<S>) -> Self {
        let mut contact = Self::approaching(pair, radii, flow);
        let linear = flow.linear();
        let difference = linear.velocity(&(pair.normal * pair.distance));
        let directions = S::tangents(&pair.normal);
        let [lever_i, lever_j] = contact.levers;
        let mut slip = S::each_tangent(0.0);
        for k in 0..S::TANGENTS {
            let turning = S::spin_dot(
                &S::axis(&pair.normal, &directions[k]),
                &linear.angular_velocity(),
            );
            slip[k] = S::dot(&directions[k], &difference) - (lever_i + lever_j) * turning;
        }
        contact.background_slip = S::tangent(&directions, &slip);
        if let Some(departures) = flow.departures() {
            contact.background_slip += contact.read(&contact.slip_rows(), departures);
            contact.background_spin = contact.read(&contact.rotation_rows(), departures);
        }
        contact
    }

    /// A pair without forces, of whose motion only the approach is known.
    pub(crate) fn approaching(pair: Neighbours<S>, radii: &[f64], flow: &IncidentFlow<S>) -> Self {
        let levers = [
            radii[pair.i] + 0.5 * pair.gap,
            radii[pair.j] + 0.5 * pair.gap,
        ];
        // Velocity difference of the linear flow over the separation.
        let difference = flow.linear().velocity(&(pair.normal * pair.distance));
        let mut contact = Self {
            pair,
            levers,
            slip_resistance: 0.0,
            background_approach: S::dot(&pair.normal, &difference),
            background_slip: S::Tangent::default(),
            background_spin: S::Tangent::default(),
            normal_force: 0.0,
            tangential_force: S::Tangent::default(),
            normal_velocity: 0.0,
            slip_velocity: S::Tangent::default(),
            state: ContactState::Frictionless,
            rolling_force: S::Tangent::default(),
            rolling_velocity: S::Tangent::default(),
            rolling_sticks: false,
            friction_acts: false,
            held_load: 0.0,
        };
        if let Some(departures) = flow.departures() {
            contact.background_approach += contact.normal_row().read(departures);
        }
        contact
    }

    /// The row of C: v_n without the background, from disturbance velocities.
    pub(crate) fn normal_row(&self) -> Row<S> {
        Row::normal([self.pair.i, self.pair.j], &self.pair.normal)
    }

    /// The directions of the components of slip and rolling.
    pub(crate) fn directions(&self) -> S::PerTangent<S::Vector> {
        S::tangents(&self.pair.normal)
    }

    /// The rows of D: the slip along the directions, without the background.
    pub(crate) fn slip_rows(&self) -> S::PerTangent<Row<S>> {
        self.rows(|spheres, n, d| Row::slip(spheres, n, d, self.levers))
    }

    /// The rows of the relative rotation of the spheres that corresponds to rolling.
    pub(crate) fn rotation_rows(&self) -> S::PerTangent<Row<S>> {
        self.rows(|spheres, n, d| Row::rolling(spheres, n, d, 1.0))
    }

    /// The rows of the rolling velocity, without the background.
    pub(crate) fn rolling_rows(&self) -> S::PerTangent<Row<S>> {
        let radius = self.rolling_radius();
        self.rows(|spheres, n, d| Row::rolling(spheres, n, d, radius))
    }

    /// Rolling velocity over relative rotation.
    fn rolling_radius(&self) -> f64 {
        rolling_friction::radius(self.levers.map(|lever| lever - 0.5 * self.pair.gap))
    }

    pub(crate) fn background_rolling(&self) -> S::Tangent {
        self.background_spin * self.rolling_radius()
    }

    /// Rows along the directions, from the spheres, the line of centres and a direction.
    fn rows(
        &self,
        row: impl Fn([usize; 2], &S::Vector, &S::Vector) -> Row<S>,
    ) -> S::PerTangent<Row<S>> {
        let (spheres, n) = ([self.pair.i, self.pair.j], &self.pair.normal);
        let directions = self.directions();
        let mut rows = S::each_tangent(row(spheres, n, &directions[0]));
        for k in 1..S::TANGENTS {
            rows[k] = row(spheres, n, &directions[k]);
        }
        rows
    }

    /// The vector whose components are those of rows along the directions.
    fn read(&self, rows: &S::PerTangent<Row<S>>, velocities: &[f64]) -> S::Tangent {
        let mut components = S::each_tangent(0.0);
        for k in 0..S::TANGENTS {
            components[k] = rows[k].read(velocities);
        }
        S::tangent(&self.directions(), &components)
    }

    /// The rate at which the pair opens per rate of dilation: r/d in d dimensions, `r n_y²` where
    /// the cell dilates along y alone.
    pub(crate) fn opening(&self, kind: PressureKind) -> f64 {
        match kind {
            PressureKind::Isotropic => self.pair.distance / S::DIMENSIONS as f64,
            PressureKind::Gradient => self.pair.distance * self.pair.normal[1].powi(2),
        }
    }

    /// The components of the slip per rate of dilation along the given directions.
    pub(crate) fn shifting(
        &self,
        kind: PressureKind,
        directions: &S::PerTangent<S::Vector>,
    ) -> S::PerTangent<f64> {
        let mut shifting = S::each_tangent(0.0);
        if kind == PressureKind::Gradient {
            for k in 0..S::TANGENTS {
                shifting[k] = self.pair.distance * self.pair.normal[1] * directions[k][1];
            }
        }
        shifting
    }

    /// Adds the motion of a dilating cell to the velocities.
    pub(crate) fn dilate(&mut self, kind: PressureKind, rate: f64) {
        self.normal_velocity += self.opening(kind) * rate;
        if kind == PressureKind::Gradient {
            let directions = self.directions();
            let slip = self.shifting(kind, &directions);
            self.slip_velocity += S::tangent(&directions, &slip) * rate;
        }
    }

    /// v_n for given disturbance velocities of all spheres.
    pub(crate) fn approach(&self, velocities: &[f64]) -> f64 {
        self.background_approach + self.normal_row().read(velocities)
    }

    /// Sets the contact's velocities from disturbance velocities of all spheres.
    pub(crate) fn set_velocities(&mut self, velocities: &[f64]) {
        self.normal_velocity = self.approach(velocities);
        self.slip_velocity = self.background_slip + self.read(&self.slip_rows(), velocities);
        let rolling = self.read(&self.rolling_rows(), velocities);
        self.rolling_velocity = self.background_rolling() + rolling;
    }
}
