//! Rigid asperities of height h: which pairs touch, with what forces.
//!
//! ```text
//! normal force f ≥ 0:  −f n on i, +f n on j             v_n = n·(U_j − U_i)
//! friction F_t:        +F_t t on i, −F_t t on j,         u_t = t·(U_j − U_i) − (l_i Ω_i + l_j Ω_j)
//!                      torques l_i F_t, l_j F_t          t = (−n_y, n_x), l = a + g/2
//! ```
//!
//! With `R_FU = L Lᵀ` and C, D the rows that read v_n and u_t off the velocities, all that a contact law needs are
//! `Y_n = L⁻¹ Cᵀ`, `Y_t = L⁻¹ Dᵀ` and their small products `G`:
//!
//! ```text
//! v_n = v_n⁰ + G_nn f − G_nt F_t,      u_t = u_t⁰ + G_tn f − G_tt F_t,      G_nn = Y_nᵀ Y_n, …
//! ```
//!
//! where v_n⁰, u_t⁰ belong to the motion without contact forces. `G_nn` is the Delassus matrix.

mod augmented;
mod cone;
pub mod coulomb;
pub mod friction;
pub mod hertz;
pub mod laws;
pub mod linear_spring;
pub mod network;
mod newton;
mod normal;
pub mod procedure;
pub mod repulsion;
pub mod rigid;
pub mod stick_rotate;
pub mod stick_slide;

use crate::geometry::modes::{Background, Vec2};
use crate::geometry::pair::Neighbours;
use crate::hydrodynamics::resistance::Resistance;
use crate::linalg::dense::Matrix;
use crate::linalg::staggered::StaggeredColumns;
use serde::{Deserialize, Serialize};

/// Compliance added to the diagonal of the Delassus matrix, in a/(mu·a²·rate): what limits the forces in a truly rigid network.
pub const COMPLIANCE: f64 = 1e-10;

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

/// Surfaces: roughness and friction, as the contact laws need them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Roughness height h, in a.
    pub roughness: f64,
    /// Friction coefficient ν.
    pub friction: f64,
    /// Normal force above which friction acts, in mu·a²·rate.
    pub critical_load: f64,
}

impl Surface {
    /// Whether friction can act at all.
    pub fn has_friction(&self) -> bool {
        self.friction > 0.0 && self.critical_load.is_finite()
    }
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
        }
    }

    /// First rows of its spheres in vectors `[3N]` in their order.
    fn rows(&self) -> [usize; 2] {
        [3 * self.pair.i, 3 * self.pair.j]
    }

    /// n·(v_j − v_i) for disturbance velocities `[3N]`, without the background.
    fn normal_row(&self, v: &[f64]) -> f64 {
        let n = self.pair.normal;
        let (i, j) = (3 * self.pair.i, 3 * self.pair.j);
        n.x * (v[j] - v[i]) + n.y * (v[j + 1] - v[i + 1])
    }

    /// Slip for disturbance velocities `[3N]`, without the background.
    fn slip_row(&self, v: &[f64]) -> f64 {
        let t = tangent(self.pair.normal);
        let (i, j) = (3 * self.pair.i, 3 * self.pair.j);
        t.x * (v[j] - v[i]) + t.y * (v[j + 1] - v[i + 1])
            - self.levers[0] * v[i + 2]
            - self.levers[1] * v[j + 2]
    }

    /// Adds `f` times the normal row's transpose to forces `[3N]`: −f n on i, +f n on j, whose first rows are given.
    fn add_normal(&self, f: f64, [i, j]: [usize; 2], forces: &mut [f64]) {
        let n = self.pair.normal * f;
        forces[i] -= n.x;
        forces[i + 1] -= n.y;
        forces[j] += n.x;
        forces[j + 1] += n.y;
    }

    /// Adds `f` times the slip row's transpose to forces `[3N]`, first rows given: the force of friction is `f = −F_t`.
    fn add_slip(&self, f: f64, [i, j]: [usize; 2], forces: &mut [f64]) {
        let t = tangent(self.pair.normal) * f;
        forces[i] -= t.x;
        forces[i + 1] -= t.y;
        forces[i + 2] -= self.levers[0] * f;
        forces[j] += t.x;
        forces[j + 1] += t.y;
        forces[j + 2] -= self.levers[1] * f;
    }
}

/// The tangent t = (−n_y, n_x).
pub fn tangent(n: Vec2) -> Vec2 {
    Vec2::new(-n.y, n.x)
}

/// How well a stage's contact problem was solved.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Quality {
    /// Largest violation of the normal problem, `max |min(G_kk f, w)|`, in a·rate.
    pub residual: f64,
    /// Largest distance between a friction force and what the law gives, over the largest force.
    pub friction_error: f64,
    /// Passes of the friction iteration.
    pub passes: u32,
}

impl Quality {
    /// Residual of the normal problem above which a stage counts as unconverged.
    pub const NORMAL_LIMIT: f64 = 1e-8;
    /// Friction error above which a stage counts as unconverged.
    pub const FRICTION_LIMIT: f64 = 1e-6;

    /// Whether both parts hold.
    pub fn converged(&self) -> bool {
        self.residual <= Self::NORMAL_LIMIT && self.friction_error <= Self::FRICTION_LIMIT
    }
}

/// The contact problem of one stage, with its workspace. Reused, it allocates only when the layer has more contacts than ever before.
#[derive(Default)]
pub struct Contacts {
    /// Candidate pairs, ordered by (i, j) once solved.
    pub list: Vec<Contact>,
    /// `L⁻¹` of the forces without contact, `[3N]`; rows as [`Resistance::row`] has them, as in all columns here.
    free: Vec<f64>,
    /// The motion in the same order of rows, `[3N]`.
    motion: Vec<f64>,
    /// `Y_n = L⁻¹ Cᵀ`, `[3N × K]`.
    normal_columns: StaggeredColumns,
    /// The candidates on which friction may act, M of them, ascending.
    frictional: Vec<usize>,
    /// `Y_t = L⁻¹ Dᵀ`, `[3N × M]`, of these alone.
    slip_columns: StaggeredColumns,
    /// The Delassus matrix `G_nn`, `[K × K]`, both triangles.
    g_nn: Matrix,
    /// `G_tn`, `[M × K]`.
    g_tn: Matrix,
    /// v_n⁰ of each candidate.
    free_normal: Vec<f64>,
    /// u_t⁰ of each frictional candidate.
    free_slip: Vec<f64>,
    /// Workspace of sorting `list`.
    sorting: Sorting,
    /// Weights of columns in the motion.
    weights: Vec<f64>,
    /// Normal forces at hand.
    normal_forces: Vec<f64>,
    /// Solver of the normal problem.
    normal: normal::NormalProblem,
    /// Workspace of the friction iteration.
    friction: friction::Workspace,
    /// Workspace of the laws chosen one by one.
    laws: laws::Workspace,
    /// Workspace of networks.
    network: network::Workspace,
}

/// Workspace of a sort that moves each contact once: they are large.
#[derive(Default)]
struct Sorting {
    /// Key and place of each contact.
    keys: Vec<([usize; 3], usize)>,
    /// The contacts in order.
    sorted: Vec<Contact>,
}

impl Sorting {
    /// Sorts by a key that no two contacts share.
    fn sort(&mut self, list: &mut Vec<Contact>, key: impl Fn(&Contact) -> [usize; 3]) {
        self.keys.clear();
        self.keys
            .extend(list.iter().enumerate().map(|(k, c)| (key(c), k)));
        self.keys.sort_unstable();
        self.sorted.clear();
        self.sorted.extend(self.keys.iter().map(|&(_, k)| list[k]));
        std::mem::swap(list, &mut self.sorted);
    }
}

/// Most spheres for which room is made in advance for all contacts there can be.
const MOST_RESERVED: usize = 1000;

/// Most contacts of equal spheres in a plane: six for each sphere. Unequal ones hardly have more.
pub fn most_contacts(spheres: usize) -> usize {
    3 * spheres.min(MOST_RESERVED)
}

impl Contacts {
    /// Workspace with room for all contacts of that many spheres. Pages never written to cost no memory.
    pub fn new(spheres: usize) -> Self {
        let (rows, most) = (3 * spheres, most_contacts(spheres));
        let mut contacts = Self {
            list: Vec::with_capacity(most),
            free: Vec::with_capacity(rows),
            motion: Vec::with_capacity(rows),
            frictional: Vec::with_capacity(most),
            free_normal: Vec::with_capacity(most),
            free_slip: Vec::with_capacity(most),
            sorting: Sorting {
                keys: Vec::with_capacity(most),
                sorted: Vec::with_capacity(most),
            },
            weights: Vec::with_capacity(most),
            normal_forces: Vec::with_capacity(most),
            normal: normal::NormalProblem::new(most),
            friction: friction::Workspace::new(most),
            laws: laws::Workspace::new(most),
            ..Self::default()
        };
        contacts.normal_columns.reserve(rows, most);
        contacts.slip_columns.reserve(rows, most);
        contacts.g_nn.reserve(most * most);
        contacts.g_tn.reserve(most * most);
        contacts
    }

    /// Brings the normal problem down to the candidates in `list`.
    ///
    /// `forces`: external and background forces `[3N]` on the spheres.
    fn reduce_normal(&mut self, resistance: &Resistance, forces: &[f64]) {
        let solver = resistance.solver();
        resistance.to_rows(forces, &mut self.free);
        solver.solve_lower_vector(&mut self.free);
        let rows = |c: &Contact| [c.pair.i, c.pair.j].map(|sphere| resistance.row(sphere));
        let start = |c: &Contact| rows(c)[0].min(rows(c)[1]);
        self.sorting
            .sort(&mut self.list, |c| [start(c), c.pair.i, c.pair.j]);
        let starts = self.list.iter().map(start);
        self.normal_columns.reset(forces.len(), starts);
        for (k, contact) in self.list.iter().enumerate() {
            contact.add_normal(1.0, rows(contact), self.normal_columns.column_mut(k));
        }
        self.normal_columns.solve_lower(solver);
        self.normal_columns.gram(&mut self.g_nn);
        self.free_normal.clear();
        self.normal_columns
            .add_transposed_product(&self.free, &mut self.free_normal);
        for (velocity, contact) in self.free_normal.iter_mut().zip(&self.list) {
            *velocity += contact.background[0];
        }
    }

    /// The same for the slip of the candidates in `frictional`.
    fn reduce_slip(&mut self, resistance: &Resistance) {
        let rows = |c: &Contact| [c.pair.i, c.pair.j].map(|sphere| resistance.row(sphere));
        let start = |c: &Contact| rows(c)[0].min(rows(c)[1]);
        let starts = self.frictional.iter().map(|&k| start(&self.list[k]));
        self.slip_columns.reset(self.free.len(), starts);
        for (m, &k) in self.frictional.iter().enumerate() {
            let contact = &mut self.list[k];
            contact.add_slip(1.0, rows(contact), self.slip_columns.column_mut(m));
            contact.slip_resistance = resistance.slip_resistance(&contact.pair);
        }
        self.slip_columns.solve_lower(resistance.solver());
        self.slip_columns
            .transposed_product(&self.normal_columns, &mut self.g_tn);
        self.free_slip.clear();
        self.slip_columns
            .add_transposed_product(&self.free, &mut self.free_slip);
        for (velocity, &k) in self.free_slip.iter_mut().zip(&self.frictional) {
            *velocity += self.list[k].background[1];
        }
    }

    /// Velocities `[3N]` of the motion with the forces in `list`, and the contact velocities that belong to them.
    fn finish(&mut self, resistance: &Resistance, velocities: &mut [f64]) {
        let motion = &mut self.motion;
        motion.clone_from(&self.free);
        let weights = &mut self.weights;
        weights.clear();
        weights.extend(self.list.iter().map(|contact| contact.normal_force));
        self.normal_columns.add_product(weights, motion);
        if !self.frictional.is_empty() {
            let force = |&k: &usize| -self.list[k].tangential_force;
            weights.clear();
            weights.extend(self.frictional.iter().map(force));
            self.slip_columns.add_product(weights, motion);
        }
        self.settle(resistance, velocities);
    }

    /// Velocities `[3N]` of what `motion` holds, half solved, and the contact velocities that belong to them.
    fn settle(&mut self, resistance: &Resistance, velocities: &mut [f64]) {
        resistance.solver().solve_upper_vector(&mut self.motion);
        resistance.from_rows(&self.motion, velocities);
        self.sorting
            .sort(&mut self.list, |c| [c.pair.i, c.pair.j, 0]);
        self.take_velocities(velocities);
    }

    /// The contact velocities that belong to disturbance velocities `[3N]`, put into `list`.
    fn take_velocities(&mut self, velocities: &[f64]) {
        for contact in &mut self.list {
            contact.normal_velocity = contact.background[0] + contact.normal_row(velocities);
            contact.slip_velocity = contact.background[1] + contact.slip_row(velocities);
        }
    }
}
