//! The state of a method in time, and its evaluations.

use crate::contact::laws::StageKind;
use crate::space::{Layer, Space};

/// Centres and orientations of the spheres.
#[derive(Default, Debug, Clone, PartialEq)]
pub struct State<S: Space = Layer> {
    /// Centres, in a.
    pub centres: Vec<S::Vector>,
    /// Orientations: in radians, or unit quaternions.
    pub orientations: Vec<S::Orientation>,
}

impl<S: Space> State<S> {
    /// Moves the spheres by velocities over a time.
    pub(super) fn advance(&mut self, velocities: &[f64], dt: f64) {
        let spheres = self.centres.iter_mut().zip(&mut self.orientations);
        for ((x, orientation), u) in spheres.zip(S::by_sphere(velocities)) {
            *x += S::translation(u) * dt;
            *orientation = S::turned(orientation, &(S::rotation(u) * dt));
        }
    }

    /// Copies another state, without allocating if the capacity suffices.
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
    /// Look-ahead time τ of contact laws: the time that Runge-Kutta moves the spheres by these
    /// velocities, γ steps of Rosenbrock.
    pub span: f64,
    /// Kind of the stage for contact laws.
    pub kind: StageKind,
}
