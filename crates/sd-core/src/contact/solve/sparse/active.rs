//! What given states put into the linear system, listed once for all products with it.
//!
//! A third of the candidates and rows is not in it, and which ones cannot be guessed: products that ask each of them wait for the answer more
//! than they multiply.

use crate::contact::row::Row;
use crate::contact::solve::problem::{FrictionState, Problem, States};
use crate::space::modes::Vec2;

/// A closed candidate, by its number and its line of centres, of which its row has nothing but the components: in few bytes, as each product
/// reads all of them.
pub(super) struct Closed {
    pub(super) at: u32,
    spheres: [u32; 2],
    pub(super) compliance: f64,
    normal: Vec2,
}

/// A sticking row, by its number.
pub(super) struct Held {
    pub(super) at: usize,
    pub(super) compliance: f64,
    pub(super) row: Row,
}

/// A row whose force is a force of the vector (f, t) times a factor: its own if it sticks, that of its candidate if it slides.
pub(super) struct Acting {
    pub(super) force: usize,
    pub(super) factor: f64,
    pub(super) row: Row,
}

/// What is in the linear system.
#[derive(Default)]
pub(super) struct Active {
    pub(super) closed: Vec<Closed>,
    pub(super) sticking: Vec<Held>,
    pub(super) acting: Vec<Acting>,
}

impl Closed {
    #[inline(always)]
    pub(super) fn row(&self) -> Row {
        Row::normal(self.spheres.map(|sphere| sphere as usize), self.normal)
    }
}

impl Active {
    /// Lists what these states put into the system.
    pub(super) fn list(&mut self, problem: &Problem, states: &States) {
        self.closed.clear();
        for (k, entry) in problem.normal.iter().enumerate() {
            if states.closed[k] {
                let [.., x, y, _] = entry.row.weights;
                self.closed.push(Closed {
                    at: number(k),
                    spheres: entry.row.spheres.map(number),
                    compliance: entry.compliance,
                    normal: Vec2::new(x, y),
                });
            }
        }
        self.sticking.clear();
        self.acting.clear();
        for (m, entry) in problem.tangential.iter().enumerate() {
            let (row, slope) = (entry.row, slope(problem, states, m));
            if slope != 0.0 {
                self.acting.push(Acting {
                    force: entry.contact,
                    factor: slope,
                    row,
                });
            } else if states.friction[m] == FrictionState::Stick {
                self.acting.push(Acting {
                    force: problem.normal.len() + m,
                    factor: 1.0,
                    row,
                });
                self.sticking.push(Held {
                    at: m,
                    compliance: entry.compliance,
                    row,
                });
            }
        }
    }
}

/// Friction over load of a sliding row of a closed candidate; 0 for others.
pub(super) fn slope(problem: &Problem, states: &States, m: usize) -> f64 {
    let sign = states.friction[m].sign();
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
