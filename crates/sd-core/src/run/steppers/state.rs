//! What a method in time moves, and what it asks for.

use crate::geometry::modes::Vec2;

/// Centres and orientations of the spheres.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    /// Centres, in a.
    pub centres: Vec<Vec2>,
    /// Orientations, in radians.
    pub orientations: Vec<f64>,
}

impl State {
    /// Takes the other's place, without allocating once there is room.
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
    /// How long its velocities move the spheres before they are evaluated again: the τ of the contact laws.
    pub span: f64,
}
