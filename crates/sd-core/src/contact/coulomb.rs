//! Coulomb's law with no slip at all within the cone: the rigid limit of [`super::stick_slide`].
//!
//! ```text
//! |F_t| ≤ ν f;   u_t = 0 where |F_t| < ν f;   else F_t = ν f sign(u_t)
//! ```
//!
//! for all pairs at once, together with the normal forces (`contact/cone.rs`). The paper's rolling force would halt the slip of an isolated
//! pair (section II A says that it does not of many): this one halts it in the layer. The same problem serves
//! [`super::stick_slide`], with the compliance 1/(k_t s) of the springs over the time ahead s and what they bear already as an
//! offset, and [`super::stick_rotate`], with rows for the relative spin and no limit:
//!
//! ```text
//! F = clamp(base + k_t s u_t):   z = u_t + base/(k_t s) − F/(k_t s)
//! ```
//!
//! Which contacts friction acts on (f > F_crit) is decided in the first solutions and then held, as the law jumps there and a
//! self-consistent set need not exist; with F_crit = 0, or taken off the load, there is nothing to decide. Source: Coulomb 1785; for rigid
//! bodies Moreau & Jean, Proc. ESDA 4, 201 (1996).

use super::cone::{Cone, Grip, Problem};
use super::laws::{History, Phase, Setting, Tangential};
use super::rigid::Memory;
use super::{COMPLIANCE, Contact, ContactState, Contacts, Quality, stick_rotate};
use crate::hydrodynamics::resistance::Resistance;
use crate::linalg::dense::{Matrix, add_scaled, dot};
use crate::params::FrictionOnset;

/// Solutions after which the set of activated contacts is held.
const DECIDING_PASSES: u32 = 4;

/// A tangential row of the problem.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Row {
    /// Its contact.
    contact: usize,
    /// Whether it reads the relative spin instead of the slip.
    spin: bool,
}

/// The problem with its workspace.
#[derive(Default)]
pub(super) struct Workspace {
    /// Solver.
    cone: Cone,
    /// Rows, ordered by contact; none if the stage is without friction.
    rows: Vec<Row>,
    /// Contact of each row.
    contact: Vec<usize>,
    /// Whether friction acts, for each row.
    acts: Vec<bool>,
    /// q_n.
    q_n: Vec<f64>,
    /// q_t.
    q_t: Vec<f64>,
    /// `G_tt`.
    g_tt: Matrix,
}

impl Workspace {
    /// Room for that many contacts.
    pub(super) fn new(contacts: usize) -> Self {
        let mut g_tt = Matrix::default();
        g_tt.reserve(contacts * contacts);
        Self {
            cone: Cone::new(contacts),
            rows: Vec::with_capacity(2 * contacts),
            contact: Vec::with_capacity(2 * contacts),
            acts: Vec::with_capacity(2 * contacts),
            q_n: Vec::with_capacity(contacts),
            q_t: Vec::with_capacity(2 * contacts),
            g_tt,
        }
    }

    /// Forgets the rows.
    pub(super) fn clear(&mut self) {
        self.rows.clear();
    }

    /// w of the solution, if this is what solved the stage.
    pub(super) fn slack(&self) -> Option<&[f64]> {
        (!self.rows.is_empty()).then(|| self.cone.slack())
    }
}

impl Contacts {
    /// Forces of the candidates with friction on `frictional`, put into `list`.
    pub(super) fn solve_cone(
        &mut self,
        setting: Setting<'_>,
        memory: &Memory,
        history: &History,
    ) -> Quality {
        loop {
            self.reduce_rows(setting, memory, history);
            if let Some(quality) = self.solve_rows(setting) {
                return quality;
            }
        }
    }

    /// Brings the tangential rows of the candidates in `frictional` into the problem.
    fn reduce_rows(&mut self, setting: Setting<'_>, memory: &Memory, history: &History) {
        let Setting {
            resistance,
            laws,
            span,
        } = setting;
        let rotate = matches!(laws.tangential, Tangential::StickRotate);
        let work = &mut self.laws.cone;
        work.rows.clear();
        work.contact.clear();
        for &contact in &self.frictional {
            for spin in [false, true].into_iter().take(if rotate { 2 } else { 1 }) {
                work.rows.push(Row { contact, spin });
                work.contact.push(contact);
            }
        }
        let places = |c: &Contact| [c.pair.i, c.pair.j].map(|sphere| resistance.row(sphere));
        let start = |c: &Contact| places(c)[0].min(places(c)[1]);
        let starts = work.rows.iter().map(|row| start(&self.list[row.contact]));
        self.slip_columns.reset(self.free.len(), starts);
        for (m, row) in work.rows.iter().enumerate() {
            let contact = &self.list[row.contact];
            let column = self.slip_columns.column_mut(m);
            if row.spin {
                stick_rotate::add_spin(1.0, places(contact), column);
            } else {
                contact.add_slip(1.0, places(contact), column);
            }
        }
        self.slip_columns.solve_lower(resistance.solver());
        self.slip_columns
            .transposed_product(&self.normal_columns, &mut self.g_tn);
        self.slip_columns.gram(&mut work.g_tt);
        work.q_t.clear();
        for (m, row) in work.rows.iter().enumerate() {
            let contact = &self.list[row.contact];
            let (begin, y) = self.slip_columns.tail(m);
            let mut q = dot(y, &self.free[begin..]);
            // The background turns both spheres alike.
            if !row.spin {
                q += contact.background[1];
            }
            work.g_tt[(m, m)] += COMPLIANCE;
            if let Tangential::StickSlide { stiffness } = laws.tangential {
                let (i, j) = (contact.pair.i, contact.pair.j);
                let base = match span.phase {
                    Phase::Second => history.stretch(i, j).base(),
                    Phase::Alone | Phase::First => memory.forces(i, j).1,
                };
                let ahead = stiffness * span.time;
                work.g_tt[(m, m)] += ahead.recip();
                q += base / ahead;
            }
            work.q_t.push(q);
        }
    }

    /// Solves the problem; `None` if a candidate without a row came above the critical load: it has then joined `frictional`.
    fn solve_rows(&mut self, setting: Setting<'_>) -> Option<Quality> {
        let laws = setting.laws;
        let load = laws.surface.critical_load;
        let (work, bias) = (&mut self.laws.cone, &self.friction.bias);
        work.q_n.clear();
        work.q_n
            .extend(self.free_normal.iter().zip(bias).map(|(v, b)| v + b));
        work.acts.clear();
        work.acts.resize(work.rows.len(), true);
        let glued = matches!(laws.tangential, Tangential::StickRotate);
        let friction = if glued {
            f64::INFINITY
        } else {
            laws.surface.friction
        };
        let offset = if glued { 0.0 } else { laws.offset() };
        let decided = load == 0.0 || (laws.onset == FrictionOnset::Reduced && !glued);
        self.guess_states(friction, offset);
        let work = &mut self.laws.cone;
        let mut passes = 0;
        let mut count = 0;
        let merit = loop {
            let (merit, steps) = work.cone.solve(&Problem {
                g_nn: &self.g_nn,
                g_tn: &self.g_tn,
                g_tt: &work.g_tt,
                q_n: &work.q_n,
                q_t: &work.q_t,
                contact: &work.contact,
                acts: &work.acts,
                friction,
                offset,
                compliance: 0.0,
            });
            passes += steps;
            count += 1;
            let f = &work.cone.normal;
            if decided || count <= DECIDING_PASSES {
                let before = self.frictional.len();
                for (k, &f) in f.iter().enumerate() {
                    if f > load && self.frictional[..before].binary_search(&k).is_err() {
                        self.frictional.push(k);
                    }
                }
                if self.frictional.len() > before {
                    self.frictional.sort_unstable();
                    // Where the next one starts.
                    self.take_forces();
                    return None;
                }
            }
            if decided || count > DECIDING_PASSES {
                break merit;
            }
            let mut changed = false;
            for (acts, &k) in work.acts.iter_mut().zip(&work.contact) {
                changed |= *acts != (f[k] > load);
                *acts = f[k] > load;
            }
            if !changed {
                break merit;
            }
            for (grip, (&acts, &k)) in work
                .cone
                .grip
                .iter_mut()
                .zip(work.acts.iter().zip(&work.contact))
            {
                if !acts {
                    *grip = Grip::Off;
                } else if *grip == Grip::Off && work.cone.closed[k] {
                    *grip = Grip::Stick;
                }
            }
        };
        self.take_forces();
        Some(Quality {
            residual: merit.residual,
            friction_error: merit.friction_error,
            passes,
        })
    }

    /// Puts the forces found into `list`.
    fn take_forces(&mut self) {
        let work = &self.laws.cone;
        for (contact, &f) in self.list.iter_mut().zip(&work.cone.normal) {
            contact.normal_force = f;
            contact.tangential_force = 0.0;
            contact.state = ContactState::Frictionless;
        }
        for (m, row) in work.rows.iter().enumerate().filter(|(_, row)| !row.spin) {
            let contact = &mut self.list[row.contact];
            contact.tangential_force = work.cone.tangential[m];
            contact.state = match work.cone.grip[m] {
                Grip::Off => ContactState::Frictionless,
                Grip::Stick => ContactState::Rolling,
                Grip::Plus | Grip::Minus => ContactState::Slipping,
            };
        }
    }

    /// States to start from: those of the forces in `list`, and of the motion without friction where a contact had none.
    fn guess_states(&mut self, friction: f64, offset: f64) {
        let Workspace { cone, rows, .. } = &mut self.laws.cone;
        cone.closed.clear();
        cone.closed.extend(
            self.list
                .iter()
                .zip(&self.normal_forces)
                .map(|(c, &f)| c.normal_force > 0.0 || f > 0.0),
        );
        cone.normal.clear();
        cone.normal.extend(self.list.iter().map(|c| c.normal_force));
        cone.tangential.clear();
        cone.tangential.extend(rows.iter().map(|row| {
            if row.spin {
                0.0
            } else {
                self.list[row.contact].tangential_force
            }
        }));
        cone.grip.clear();
        for row in rows.iter() {
            let contact = &self.list[row.contact];
            let limit = friction * (contact.normal_force - offset);
            let (f, t) = (contact.normal_force, contact.tangential_force);
            cone.grip.push(if !cone.closed[row.contact] {
                Grip::Off
            } else if row.spin || f == 0.0 || t == 0.0 || t.abs() < limit * (1.0 - 1e-9) {
                Grip::Stick
            } else if t > 0.0 {
                Grip::Plus
            } else {
                Grip::Minus
            });
        }
    }

    /// Velocities `[3N]` of the motion with the forces found, and the contact velocities that belong to them.
    pub(super) fn finish_laws(&mut self, resistance: &Resistance, velocities: &mut [f64]) {
        let Workspace { cone, rows, .. } = &self.laws.cone;
        if rows.is_empty() {
            return self.finish(resistance, velocities);
        }
        let motion = &mut self.motion;
        motion.clone_from(&self.free);
        for (k, &force) in cone.normal.iter().enumerate() {
            if force != 0.0 {
                let (start, y) = self.normal_columns.tail(k);
                add_scaled(&mut motion[start..], y, force);
            }
        }
        for (m, &force) in cone.tangential.iter().enumerate() {
            if force != 0.0 {
                let (start, y) = self.slip_columns.tail(m);
                add_scaled(&mut motion[start..], y, -force);
            }
        }
        self.settle(resistance, velocities);
    }
}
