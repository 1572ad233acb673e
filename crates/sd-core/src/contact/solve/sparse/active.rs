//! What given states put into the linear system, listed once for all products with it.
//!
//! A third of the candidates and rows is not in it, and which ones cannot be guessed: products that ask each of them wait for the answer more
//! than they multiply.

use crate::contact::row::Row;
use crate::contact::solve::problem::{Problem, States};
use crate::space::Space;

/// A closed candidate, by its number and its line of centres, of which its row has nothing but the components: in few bytes, as each product
/// reads all of them.
pub(super) struct Closed<S: Space> {
    pub(super) at: u32,
    spheres: [u32; 2],
    pub(super) compliance: f64,
    normal: S::Vector,
}

/// A sticking row, by its number, or what sticks across the direction of a slide: then a row that is turned.
pub(super) struct Held<S: Space> {
    pub(super) at: usize,
    pub(super) compliance: f64,
    pub(super) shift: f64,
    pub(super) row: Row<S>,
    /// The first row of its slip, and shares of the rows of the slip in this one.
    first: usize,
    shares: S::PerTangent<f64>,
}

/// A row whose force is a force of the vector (f, t) times a factor: its own if it sticks, that of its candidate if it slides.
pub(super) struct Acting<S: Space> {
    pub(super) force: usize,
    pub(super) factor: f64,
    pub(super) row: Row<S>,
}

/// What is in the linear system.
pub(super) struct Active<S: Space> {
    pub(super) closed: Vec<Closed<S>>,
    pub(super) sticking: Vec<Held<S>>,
    pub(super) acting: Vec<Acting<S>>,
}

impl<S: Space> Default for Active<S> {
    fn default() -> Self {
        Self {
            closed: Vec::new(),
            sticking: Vec::new(),
            acting: Vec::new(),
        }
    }
}

impl<S: Space> Held<S> {
    /// Its force among those of all rows.
    pub(super) fn force(&self, forces: &[f64]) -> f64 {
        let mut sum = self.shares[0] * forces[self.first];
        for k in 1..S::TANGENTS {
            sum += self.shares[k] * forces[self.first + k];
        }
        sum
    }

    /// Adds to its force.
    pub(super) fn add(&self, force: f64, forces: &mut [f64]) {
        for k in 0..S::TANGENTS {
            forces[self.first + k] += self.shares[k] * force;
        }
    }
}

impl<S: Space> Closed<S> {
    #[inline(always)]
    pub(super) fn row(&self) -> Row<S> {
        Row::normal(self.spheres.map(|sphere| sphere as usize), &self.normal)
    }
}

impl<S: Space> Active<S> {
    /// Lists what these states put into the system.
    pub(super) fn list(&mut self, problem: &Problem<S>, states: &States) {
        self.closed.clear();
        for (k, entry) in problem.normal.iter().enumerate() {
            if states.closed[k] {
                self.closed.push(Closed {
                    at: number(k),
                    spheres: entry.row.spheres.map(number),
                    compliance: entry.compliance,
                    normal: S::translation(entry.row.halves()[1]),
                });
            }
        }
        self.sticking.clear();
        self.acting.clear();
        let contacts = problem.normal.len();
        for (m, entry) in problem.tangential.iter().enumerate() {
            let (first, k) = (m - m % S::TANGENTS, m % S::TANGENTS);
            let slides = slope(problem, states, m);
            let mut shares = S::each_tangent(0.0);
            shares[k] = 1.0;
            let mut held = Held {
                at: m,
                compliance: entry.compliance,
                shift: entry.shift,
                row: entry.row,
                first,
                shares,
            };
            if let Some(slide) = states.slide(m) {
                let turned = problem.turned_row(slide, m);
                (held.row, held.shift) = (turned.row, turned.shift);
                held.compliance += slide.compliance;
                shares.as_mut().copy_from_slice(&turned.shares);
                held.shares = shares;
            }
            if slides != 0.0 {
                self.acting.push(Acting {
                    force: entry.contact,
                    factor: slides,
                    row: held.row,
                });
            } else if states.sticks(m) && held.compliance.is_finite() {
                self.acting.push(Acting {
                    force: contacts + m,
                    factor: 1.0,
                    row: held.row,
                });
                self.sticking.push(held);
            }
        }
    }
}

/// Friction over load of a sliding row of a closed candidate; 0 for others.
pub(super) fn slope<S: Space>(problem: &Problem<S>, states: &States, m: usize) -> f64 {
    let sign = states.sign(m);
    if sign == 0.0 || !states.closed[problem.tangential[m].contact] {
        0.0
    } else {
        sign * problem.tangential[m].coefficient
    }
}

/// Spheres and candidates are fewer than 2^32.
#[expect(clippy::cast_possible_truncation, reason = "they are fewer")]
fn number(at: usize) -> u32 {
    at as u32
}
