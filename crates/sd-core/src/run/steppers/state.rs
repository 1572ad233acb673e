//! What a method in time moves, and the evaluations that it asks for.

use crate::contact::laws::Phase;
use crate::space::modes::Vec2;

/// Centres and orientations of the spheres.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    /// Centres, in a.
    pub centres: Vec<Vec2>,
    /// Orientations, in radians.
    pub orientations: Vec<f64>,
}

impl State {
    /// Becomes equal to the other, without allocating once there is room.
    pub fn copy_from(&mut self, other: &Self) {
        self.centres.clone_from(&other.centres);
        self.orientations.clone_from(&other.orientations);
    }
}

/// One evaluation of the right-hand side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stage {
    /// Number of the stage in its step, from 0.
    pub number: usize,
    /// Time (strain) of the stage.
    pub time: f64,
    /// The τ over which contact laws look ahead: how long Runge-Kutta moves the spheres by these velocities, γ steps of Rosenbrock.
    pub span: f64,
    /// What contact laws make of it.
    pub phase: Phase,
}

/// Whether contacts bear forces at a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bearing {
    /// None does.
    Free,
    /// One does, or more.
    Loaded,
}
