//! The layer as a step samples it: where the spheres are, which forces they bear, which of them touch.

use super::{Sample, Simulation};
use crate::contact::ContactState;
use crate::contact::laws::Phase;
use crate::error::Error;
use crate::run::steppers::Stage;
use crate::space::modes::{Vec2, strain_tensor};

/// The layer at one instant of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frame {
    /// Strain: that of the stage that was sampled, which is where the step begins or its middle.
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
    /// Quasi-force of rolling friction, in mu·a²·rate; 0 without.
    pub rolling_force: f64,
    /// What it does.
    pub state: ContactState,
}

impl Simulation {
    /// As [`Simulation::step`], and returns the frame of the sample too. The numbers of the run are the same with it as without.
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
    pub fn step_with_frame(&mut self) -> Result<(Sample, Frame), Error> {
        self.frame = Some(Box::default());
        let result = self.step();
        let frame = self.frame.take().map(|frame| *frame).unwrap_or_default();
        Ok((result?, frame))
    }

    /// Fills in the frame at the stage solved last.
    pub(super) fn fill_frame(&mut self, stage: &Stage, centres: &[Vec2]) {
        // From where the step began the first stage has turned them.
        let ahead = stage.time - self.strain();
        let turns = |sphere: usize| {
            if stage.phase == Phase::Middle {
                ahead * (self.first[3 * sphere + 2] + self.background.angular_velocity)
            } else {
                0.0
            }
        };
        let orientations = self.before.orientations.iter().enumerate();
        let contacts = self.stage.contacts.list.iter();
        let frame = Frame {
            strain: stage.time,
            side: self.side,
            offset: self.offset_at(stage.time),
            radii: self.stage.resistance.radii().to_vec(),
            centres: centres.iter().copied().map(plain).collect(),
            orientations: orientations
                .map(|(sphere, angle)| angle + turns(sphere))
                .collect(),
            stresslets: self
                .stress
                .stresslets
                .iter()
                .map(|s| {
                    let (xx, yy, xy) = strain_tensor(s);
                    [xx, yy, xy]
                })
                .collect(),
            contacts: contacts
                .filter(|contact| contact.normal_force > 0.0)
                .map(|contact| FrameContact {
                    i: contact.pair.i,
                    j: contact.pair.j,
                    normal: plain(contact.pair.normal),
                    gap: contact.pair.gap,
                    normal_force: contact.normal_force,
                    tangential_force: contact.tangential_force,
                    rolling_force: contact.rolling_force,
                    state: contact.state,
                })
                .collect(),
        };
        self.frame = Some(Box::new(frame));
    }
}

pub(super) fn plain(x: Vec2) -> [f64; 2] {
    [x.x, x.y]
}
