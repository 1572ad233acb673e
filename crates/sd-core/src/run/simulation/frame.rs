//! The spheres at a sample: positions, forces and contacts of the spheres.

use super::Simulation;
use super::volume::grown;
use crate::contact::ContactState;
use crate::contact::laws::StageKind;
use crate::error::Error;
use crate::run::spaces::Starts;
use crate::run::steppers::Stage;
use crate::space::cell::{Cell, Lattice};
use crate::space::{Layer, Space};
use serde::{Deserialize, Serialize};

/// The spheres at one instant of a run.
#[derive(Default, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Frame<S: Space = Layer> {
    /// Strain of the sampled stage, at the start or the middle of the step; in fluid at rest, and
    /// under a stress on Brownian spheres, the time.
    pub strain: f64,
    /// Side of the square or cubic cell, or of one with the content of the lattice, in a.
    pub side: f64,
    /// The vectors of the lattice, in a; empty for a sheared cell, which has the offsets in their
    /// place.
    pub vectors: Vec<S::Point>,
    /// Offset of the upper image cell, in a, wrapped into [−side/2, side/2).
    pub offset: f64,
    /// Its offset along the vorticity, in a, wrapped likewise; 0 without cross shear.
    pub cross_offset: f64,
    /// Radii, in a.
    pub radii: Vec<f64>,
    /// Centres, in a.
    pub centres: Vec<S::Point>,
    /// Centres followed from the start of the run, in a: see [`Simulation::unwrapped`].
    pub unwrapped: Vec<S::Point>,
    /// Velocities U at the centres, in a·rate, background included.
    pub velocities: Vec<S::Point>,
    /// Angular velocities Ω, in rate, background included.
    pub angular_velocities: Vec<S::Spin>,
    /// Orientations: in radians, or unit quaternions.
    pub orientations: Vec<S::Orientation>,
    /// Stresslets S of (20) as `(xx, yy, xy)`, in a suspension `(xx, yy, xy, xz, yz)`, in
    /// mu·a³·rate.
    pub stresslets: Vec<S::Tensor>,
    /// Pairs with a normal force.
    pub contacts: Vec<FrameContact<S>>,
}

impl<S: Space> Frame<S> {
    /// Lattice vectors of the periodic cell, in a; of a sheared cell along the flow, across it, and
    /// in a suspension along the vorticity.
    ///
    /// ```
    /// use sd_core::simulation::Frame;
    ///
    /// let frame: Frame = Frame { side: 10.0, offset: -3.0, ..Frame::default() };
    /// assert_eq!(frame.lattice(), [[10.0, 0.0], [-3.0, 10.0]]);
    /// ```
    pub fn lattice(&self) -> Vec<S::Point> {
        if !self.vectors.is_empty() {
            return self.vectors.clone();
        }
        let vector = |k: usize| {
            let mut vector = S::Point::default();
            vector[k] = self.side;
            if k == 1 {
                vector[0] = self.offset;
                if S::DIMENSIONS > 2 {
                    vector[2] = self.cross_offset;
                }
            }
            vector
        };
        (0..S::DIMENSIONS).map(vector).collect()
    }

    /// The periodic cell.
    ///
    /// # Errors
    /// Those of [`Cell::periodic`] and [`Lattice::new`].
    pub fn cell(&self) -> Result<Cell<S>, Error> {
        if self.vectors.is_empty() {
            return Cell::equal_sides(self.side, self.offset)?.with_cross_offset(self.cross_offset);
        }
        let vectors: Vec<_> = self.vectors.iter().map(S::vector).collect();
        Ok(Cell::Periodic(Lattice::new(&vectors)?))
    }

    /// Whether its cell is a sheared one.
    pub fn is_sheared(&self) -> bool {
        self.vectors.is_empty()
    }
}

/// One contact of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct FrameContact<S: Space = Layer> {
    /// First sphere.
    pub i: usize,
    /// Second sphere.
    pub j: usize,
    /// Unit vector from i to the image of j it touches.
    pub normal: S::Point,
    /// Gap, in a.
    pub gap: f64,
    /// Normal force, in mu·a²·rate.
    pub normal_force: f64,
    /// Tangential force, in mu·a²·rate.
    pub tangential_force: S::Tangent,
    /// Quasi-force of rolling friction, in mu·a²·rate; 0 without.
    pub rolling_force: S::Tangent,
    /// Its state.
    pub state: ContactState,
}

impl<S: Starts> Simulation<S> {
    /// Makes the next step fill in a frame.
    pub(in crate::run) fn request_frame(&mut self) {
        self.frame = Some(Box::default());
    }

    /// The frame of the last step, if it was requested.
    pub(in crate::run) fn take_frame(&mut self) -> Option<Frame<S>> {
        self.frame.take().map(|frame| *frame)
    }

    /// The loaded contacts, without a frame: their gaps and forces at the stage solved last, the
    /// middle of the last step or its second stage. None before the first step.
    ///
    /// ```
    /// # use sd_core::{Hydrodynamics, Layer, NearFields, Params, Simulation};
    /// # let params = Params::builder()
    /// #     .spheres(40)
    /// #     .area_fraction(0.7)
    /// #     .roughness(0.01)
    /// #     .friction(0.5)
    /// #     .shear_rate(f64::INFINITY)
    /// #     .hydrodynamics(Hydrodynamics::BallMelrose)
    /// #     .build()?;
    /// let mut layer = Simulation::<Layer>::new(&params, 1, &NearFields::default())?;
    /// for _ in 0..10 {
    ///     layer.step()?;
    /// }
    /// let largest = layer.contacts().map(|contact| contact.normal_force).fold(0.0, f64::max);
    /// for contact in layer.contacts() {
    ///     assert!(contact.gap > 0.009 && contact.normal_force <= largest);
    ///     let bound = params.friction * contact.normal_force;
    ///     assert!(contact.tangential_force.abs() <= bound * (1.0 + 1e-9));
    /// }
    /// assert!(layer.contacts().count() > 0);
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn contacts(&self) -> impl Iterator<Item = FrameContact<S>> {
        let loaded = self.solver.contacts.list.iter();
        loaded
            .filter(|contact| contact.normal_force > 0.0)
            .map(|contact| FrameContact {
                i: contact.pair.i,
                j: contact.pair.j,
                normal: S::point(&contact.pair.normal),
                gap: contact.pair.gap,
                normal_force: contact.normal_force,
                tangential_force: contact.tangential_force,
                rolling_force: contact.rolling_force,
                state: contact.state,
            })
    }

    /// Fills in the frame at the stage solved last.
    pub(super) fn fill_frame(&mut self, stage: &Stage, centres: &[S::Vector]) {
        let cell = self.cell_at(stage.time).unwrap_or(Cell::Unbounded);
        let is_sheared = self.path.is_none() && !self.dilates_along_gradient();
        let (vectors, offsets) = match cell.lattice() {
            Some(lattice) if !is_sheared => {
                (lattice.vectors().iter().map(S::point).collect(), [0.0; 2])
            }
            _ => (Vec::new(), [cell.offset(), cell.cross_offset()]),
        };
        let growth = self.dilations.growth();
        let kind = self.params.pressure;
        let place = |x: S::Vector| S::point(&grown::<S>(kind, x, growth));
        // Rotated from the start of the step by the first stage.
        let ahead = stage.time - self.time();
        let turned = |(sphere, orientation): (usize, &S::Orientation)| {
            if stage.kind == StageKind::Midpoint {
                let spin = S::rotation(&S::by_sphere(&self.first)[sphere]);
                S::turned(
                    orientation,
                    &((spin + self.background.angular_velocity() * self.first_shear()) * ahead),
                )
            } else {
                *orientation
            }
        };
        let motion = || self.velocities().iter();
        let orientations = self.before.state.orientations.iter().enumerate();
        let frame = Frame {
            strain: stage.time,
            side: if is_sheared || self.path.is_some() {
                self.extent.side * growth
            } else {
                self.content().powf((S::DIMENSIONS as f64).recip())
            },
            vectors,
            offset: offsets[0],
            cross_offset: offsets[1],
            radii: self.solver.resistance.radii().to_vec(),
            centres: centres.iter().map(|&x| place(x)).collect(),
            unwrapped: self.unwrapped_at(stage.time, centres).map(place).collect(),
            velocities: motion().map(|u| S::point(&S::translation(u))).collect(),
            angular_velocities: motion().map(S::rotation).collect(),
            orientations: orientations.map(turned).collect(),
            stresslets: self.stress.stresslets.iter().map(S::tensor).collect(),
            contacts: self.contacts().collect(),
        };
        self.frame = Some(Box::new(frame));
    }
}
