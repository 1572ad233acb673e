//! The layer at the first stage of a step: where the spheres are, which forces they bear, which of them touch.

use super::{Sample, Simulation};
use crate::contact::{Contact, ContactState};
use crate::error::Error;
use crate::geometry::modes::{Vec2, strain_tensor};
use nalgebra::Vector3;

/// The layer at one instant of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frame {
    /// Strain.
    pub strain: f64,
    /// Side of the square cell, in a.
    pub side: f64,
    /// Offset of the upper image cell, in a, wrapped into [−side/2, side/2).
    pub offset: f64,
    /// Radii, in a.
    pub radii: Vec<f64>,
    /// Centres, in a.
    pub centres: Vec<[f64; 2]>,
    /// Orientations, in radians.
    pub orientations: Vec<f64>,
    /// Stresslets S of (20) as `(xx, yy, xy)`, in mu·a³·rate.
    pub stresslets: Vec<[f64; 3]>,
    /// Pairs with a normal force.
    pub contacts: Vec<FrameContact>,
}

/// One contact of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameContact {
    /// First sphere.
    pub i: usize,
    /// Second sphere.
    pub j: usize,
    /// Unit vector from i to the image of j it touches.
    pub normal: [f64; 2],
    /// Gap, in a.
    pub gap: f64,
    /// Normal force, in mu·a²·rate.
    pub normal_force: f64,
    /// Tangential force, in mu·a²·rate.
    pub tangential_force: f64,
    /// What it does.
    pub state: ContactState,
}

impl Simulation {
    /// As [`Simulation::step`], and returns the frame of its first stage too. The numbers of the run are the same with it as without.
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
    pub fn step_with_frame(&mut self) -> Result<(Sample, Frame), Error> {
        let strain = self.strain();
        self.frame = Some(Box::new(Frame {
            strain,
            side: self.side,
            offset: self.offset_at(strain),
            radii: self.stage.resistance.radii().to_vec(),
            centres: self.state.centres.iter().copied().map(plain).collect(),
            orientations: self.state.orientations.clone(),
            ..Frame::default()
        }));
        let result = self.step();
        let frame = self.frame.take().map(|frame| *frame).unwrap_or_default();
        Ok((result?, frame))
    }
}

impl Frame {
    /// Fills in the stresslets and contacts of the solved first stage.
    pub(super) fn solved(&mut self, stresslets: &[Vector3<f64>], contacts: &[Contact]) {
        self.stresslets = stresslets
            .iter()
            .map(|s| {
                let (xx, yy, xy) = strain_tensor(s);
                [xx, yy, xy]
            })
            .collect();
        self.contacts = contacts
            .iter()
            .filter(|contact| contact.normal_force > 0.0)
            .map(|contact| FrameContact {
                i: contact.pair.i,
                j: contact.pair.j,
                normal: plain(contact.pair.normal),
                gap: contact.pair.gap,
                normal_force: contact.normal_force,
                tangential_force: contact.tangential_force,
                state: contact.state,
            })
            .collect();
    }
}

pub(super) fn plain(x: Vec2) -> [f64; 2] {
    [x.x, x.y]
}
