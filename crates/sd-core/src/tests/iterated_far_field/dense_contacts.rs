//! A small dense solver of the rigid contact problem in two parts, by Newton's method on the states
//! of the contacts.

use crate::contact::laws::{COMPLIANCE, OVERLAP_CORRECTION};
use crate::contact::{Contact, Surface};
use crate::error::Error;
use crate::hydrodynamics::iterative::fixed_point::{FixedPointMap, Progress};
use crate::hydrodynamics::resistance::Resistance;
use crate::linalg::dense::{add_scaled, dot};
use crate::space::{Layer, Space as _, VelocityGradient};
use nalgebra::{DMatrix, DVector};

/// State of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    /// It has no force.
    Open,
    /// Friction is proportional to the slip.
    Rolls,
    /// Friction is at its limit, with this sign.
    Slips(f64),
}

/// The contact problem at one set of positions.
pub(super) struct DenseContacts<'a> {
    near: &'a Resistance,
    friction: f64,
    list: Vec<Contact>,
    /// Inverse slip mobility of each.
    slip_resistance: Vec<f64>,
    /// Terms of w and u_t apart from the disturbances.
    bias: [Vec<f64>; 2],
    /// Rows that compute v_n and u_t from velocities.
    rows: [Vec<Vec<f64>>; 2],
    /// `R_BM⁻¹` of these.
    columns: [Vec<Vec<f64>>; 2],
    /// Products of rows `a` with columns `b`.
    products: [[DMatrix<f64>; 2]; 2],
    states: Vec<State>,
    /// f of each, then F_t.
    found: DVector<f64>,
}

impl<'a> DenseContacts<'a> {
    /// The problem of all pairs that may touch.
    pub(super) fn new(near: &'a Resistance, surface: &Surface, time_span: f64) -> Self {
        let shear = VelocityGradient::simple_shear(1.0).into();
        let pairs = near.neighbours().iter();
        let list: Vec<_> = pairs
            .filter(|pair| pair.gap < surface.roughness + 0.05)
            .map(|pair| Contact::new(*pair, near.radii(), &shear))
            .collect();
        let width = 3 * near.radii().len();
        let rows = [0, 1].map(|kind| -> Vec<Vec<f64>> {
            let row = |c: &Contact| {
                let mut row = vec![0.0; width];
                let direction = [c.pair.normal, Layer::tangents(&c.pair.normal)[0]][kind];
                for k in 0..2 {
                    row[3 * c.pair.i + k] = -direction[k];
                    row[3 * c.pair.j + k] = direction[k];
                }
                if kind == 1 {
                    row[3 * c.pair.i + 2] = -c.levers[0];
                    row[3 * c.pair.j + 2] = -c.levers[1];
                }
                row
            };
            list.iter().map(row).collect()
        });
        let columns = rows.clone().map(|mut columns| {
            for column in &mut columns {
                near.solver().solve(column);
            }
            columns
        });
        let count = list.len();
        let products = [0, 1].map(|a| {
            [0, 1].map(|b| DMatrix::from_fn(count, count, |k, l| dot(&rows[a][k], &columns[b][l])))
        });
        let gap_bias = |c: &Contact| {
            let excess = c.pair.gap - surface.roughness;
            excess
                * if excess < 0.0 {
                    OVERLAP_CORRECTION
                } else {
                    1.0
                }
                / time_span
        };
        Self {
            near,
            friction: surface.friction,
            slip_resistance: list.iter().map(|c| near.slip_resistance(&c.pair)).collect(),
            bias: [
                list.iter()
                    .map(|c| c.background_approach + gap_bias(c))
                    .collect(),
                list.iter().map(|c| c.background_slip).collect(),
            ],
            rows,
            columns,
            products,
            states: vec![State::Open; count],
            found: DVector::zeros(2 * count),
            list,
        }
    }

    pub(super) fn forces(&self, i: usize, j: usize) -> (f64, f64) {
        let at = self
            .list
            .iter()
            .position(|c| (c.pair.i, c.pair.j) == (i, j))
            .unwrap();
        (self.found[at], self.found[self.list.len() + at])
    }

    /// Sum of the contact stresses' xy component.
    pub(super) fn shear_stress(&self) -> f64 {
        let stress = |(k, c): (usize, &Contact)| {
            let (n, r) = (c.pair.normal, c.pair.distance);
            let (f, f_t) = (self.found[k], self.found[self.list.len() + k]);
            -r * f * n.x * n.y + 0.5 * r * f_t * (n.x * n.x - n.y * n.y)
        };
        self.list.iter().enumerate().map(stress).sum()
    }

    /// Forces at the current states, for velocities without them `[6N]`; returns w and u_t of each.
    fn forces_at_states(&mut self, free: &[f64]) -> [Vec<f64>; 2] {
        let count = self.list.len();
        let (normal, friction) = free.split_at(free.len() / 2);
        let [[nn, nt], [tn, _]] = &self.products;
        let w: Vec<f64> = (0..count)
            .map(|k| {
                let row = &self.rows[0][k];
                self.bias[0][k] + dot(row, normal) + dot(row, friction)
            })
            .collect();
        let slip: Vec<f64> = (0..count)
            .map(|k| self.bias[1][k] + dot(&self.rows[1][k], normal))
            .collect();
        let mut matrix = DMatrix::identity(2 * count, 2 * count);
        let mut rhs = DVector::zeros(2 * count);
        for (k, state) in self.states.iter().enumerate() {
            if *state != State::Open {
                rhs[k] = -w[k];
                for l in 0..count {
                    matrix[(k, l)] = nn[(k, l)] + if k == l { COMPLIANCE } else { 0.0 };
                    matrix[(k, count + l)] = -nt[(k, l)];
                }
            }
            match *state {
                State::Open => {}
                State::Rolls => {
                    rhs[count + k] = self.slip_resistance[k] * slip[k];
                    for l in 0..count {
                        matrix[(count + k, l)] = -self.slip_resistance[k] * tn[(k, l)];
                    }
                }
                State::Slips(sign) => matrix[(count + k, k)] = -self.friction * sign,
            }
        }
        self.found = matrix.lu().solve(&rhs).unwrap();
        let (f, f_t) = (self.found.rows(0, count), self.found.rows(count, count));
        let (w_f, slip_f) = (nn * f - nt * f_t, tn * f);
        [
            (0..count).map(|k| w[k] + w_f[k]).collect(),
            (0..count).map(|k| slip[k] + slip_f[k]).collect(),
        ]
    }

    /// Velocities without contact forces.
    fn free(&self, forces: &[f64]) -> Vec<f64> {
        let mut free = forces.to_vec();
        for part in free.chunks_exact_mut(forces.len() / 2) {
            self.near.solver().solve(part);
        }
        free
    }

    /// Adds the motion by contact forces.
    fn add_contacts(&self, free: &[f64], velocities: &mut [f64]) {
        let count = self.list.len();
        velocities.copy_from_slice(free);
        let (normal, friction) = velocities.split_at_mut(free.len() / 2);
        for k in 0..count {
            add_scaled(normal, &self.columns[0][k], self.found[k]);
            add_scaled(friction, &self.columns[1][k], -self.found[count + k]);
        }
    }
}

impl DenseContacts<'_> {
    /// Solves the contact problem, forces and velocities `[6N]` as in [`FixedPointMap::evaluate`].
    fn solve(&mut self, forces: &[f64], velocities: &mut [f64]) {
        let count = self.list.len();
        let free = self.free(forces);
        for pass in 0.. {
            assert!(pass < 300, "states of the contacts do not converge");
            let [w, slip] = self.forces_at_states(&free);
            let mut changed = 0;
            for k in 0..count {
                let f = self.found[k];
                let roll = self.slip_resistance[k] * slip[k];
                let open = match self.states[k] {
                    State::Open => w[k] >= -1e-13,
                    _ => f <= 0.0,
                };
                let state = if open {
                    State::Open
                } else if roll.abs() <= self.friction * f.max(0.0) {
                    State::Rolls
                } else {
                    State::Slips(roll.signum())
                };
                if state != self.states[k] {
                    changed += 1;
                    // One at a time once simultaneous updates cycle.
                    if pass < 40 || changed == 1 {
                        self.states[k] = state;
                    }
                }
            }
            if changed == 0 {
                break;
            }
        }
        self.add_contacts(&free, velocities);
    }
}

impl FixedPointMap for DenseContacts<'_> {
    fn evaluate(
        &mut self,
        forces: &[f64],
        _: Progress,
        velocities: &mut [f64],
    ) -> Result<bool, Error> {
        self.solve(forces, velocities);
        Ok(false)
    }
}
