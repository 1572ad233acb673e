//! What given states put into the linear system, listed once for all products with it.
//!
//! A third of the candidates and rows is not in it, and which ones cannot be guessed: products that ask each of them wait for the answer more
//! than they multiply.

use crate::contact::row::Row;
use crate::contact::solve::problem::{Grip, Problem, States};
use crate::geometry::modes::Vec2;

/// A [`Row`] in fewer bytes, as each product reads all of them.
#[derive(Clone, Copy)]
struct ShortRow {
    spheres: [u32; 2],
    weights: [f64; 6],
}

/// A closed candidate, by its number and its line of centres, of which its row has nothing but the components.
pub(super) struct Closed {
    pub(super) at: u32,
    spheres: [u32; 2],
    pub(super) compliance: f64,
    normal: Vec2,
}

/// A sticking row, by its number.
pub(super) struct Held {
    pub(super) at: u32,
    pub(super) compliance: f64,
    row: ShortRow,
}

/// A row whose force is a force of the vector (f, t) times a factor: its own if it sticks, that of its candidate if it slides.
pub(super) struct Acting {
    pub(super) force: u32,
    pub(super) factor: f64,
    row: ShortRow,
}

/// What is in the linear system.
#[derive(Default)]
pub(super) struct Active {
    pub(super) closed: Vec<Closed>,
    pub(super) sticking: Vec<Held>,
    pub(super) acting: Vec<Acting>,
}

impl ShortRow {
    fn new(row: &Row) -> Self {
        Self {
            spheres: row.spheres.map(number),
            weights: row.weights,
        }
    }

    #[inline(always)]
    fn row(&self) -> Row {
        Row {
            spheres: self.spheres.map(|sphere| sphere as usize),
            weights: self.weights,
        }
    }
}

impl Closed {
    #[inline(always)]
    pub(super) fn row(&self) -> Row {
        Row::normal(self.spheres.map(|sphere| sphere as usize), self.normal)
    }
}

impl Held {
    #[inline(always)]
    pub(super) fn row(&self) -> Row {
        self.row.row()
    }
}

impl Acting {
    #[inline(always)]
    pub(super) fn row(&self) -> Row {
        self.row.row()
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
            let grip = states.grip[m];
            let row = ShortRow::new(&entry.row);
            if grip == Grip::Stick {
                self.sticking.push(Held {
                    at: number(m),
                    compliance: entry.compliance,
                    row,
                });
                self.acting.push(Acting {
                    force: number(problem.normal.len() + m),
                    factor: 1.0,
                    row,
                });
            } else if problem.friction != 0.0 && grip != Grip::Off && states.closed[entry.contact] {
                self.acting.push(Acting {
                    force: number(entry.contact),
                    factor: grip.sign() * problem.friction,
                    row,
                });
            }
        }
    }
}

/// Spheres, candidates and rows are fewer than 2^32.
#[expect(clippy::cast_possible_truncation, reason = "they are fewer")]
fn number(at: usize) -> u32 {
    at as u32
}
