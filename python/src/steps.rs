//! A run in either space, for the classes of runs.

use crate::instant::Arrays;
use sd_core::simulation::{Flow, Frame, FrameContact};
use sd_core::{Bulk, Error, NearFields, Params, RunSpace, Sample, Simulation, Snapshot};
use sweep::model::spaces::{AnySnapshot, InSpace};
use sweep::trajectory::{STATES, state_number};

/// A pair in contact: spheres, normal, gap, normal force, tangential force, state.
pub(crate) type Touching = (usize, usize, Vec<f64>, f64, f64, Vec<f64>, &'static str);

/// A run in either space.
pub(crate) trait Steps: Send {
    /// Does a step.
    fn step(&mut self) -> Result<Sample, Error>;

    /// Measurements of the next step.
    fn sample(&mut self, params: &Params, tables: &NearFields) -> Result<Sample, Error>;

    /// The pairs in contact.
    fn contacts(&mut self, params: &Params, tables: &NearFields) -> Result<Vec<Touching>, Error>;

    /// Stresslets, one after the other.
    fn stresslets(&mut self, params: &Params, tables: &NearFields) -> Result<Vec<f64>, Error>;

    /// Velocities and angular velocities, each one after the other.
    fn motion(&mut self, params: &Params, tables: &NearFields) -> Result<[Vec<f64>; 2], Error>;

    /// Centres that are not moved back into the cell, one after the other.
    fn unwrapped(&self) -> Vec<f64>;

    /// Lattice vectors of the cell, one after the other.
    fn lattice(&self) -> Result<Vec<f64>, Error>;

    fn place(&self) -> Place;
    fn side(&self) -> f64;
    fn radii(&self) -> &[f64];
    fn flow(&self) -> Flow;
    fn snapshot(&self) -> AnySnapshot;

    /// Numbers of a centre, an orientation, a stresslet and a tangential force.
    fn widths(&self) -> [usize; 4];
}

/// A space in which runs are stepped.
pub(crate) trait Stepped: RunSpace + Arrays {
    /// A snapshot of either space.
    fn wrapped(snapshot: Snapshot<Self>) -> AnySnapshot;

    /// The snapshot, if it is of this space.
    fn unwrapped(snapshot: AnySnapshot) -> Result<Snapshot<Self>, &'static str>;
}

impl Stepped for sd_core::Layer {
    fn wrapped(snapshot: Snapshot<Self>) -> AnySnapshot {
        InSpace::Layer(snapshot)
    }

    fn unwrapped(snapshot: AnySnapshot) -> Result<Snapshot<Self>, &'static str> {
        match snapshot {
            InSpace::Layer(snapshot) => Ok(snapshot),
            InSpace::Suspension(_) => Err("snapshot: of a suspension, and this is a layer"),
        }
    }
}

impl Stepped for Bulk {
    fn wrapped(snapshot: Snapshot<Self>) -> AnySnapshot {
        InSpace::Suspension(snapshot)
    }

    fn unwrapped(snapshot: AnySnapshot) -> Result<Snapshot<Self>, &'static str> {
        match snapshot {
            InSpace::Suspension(snapshot) => Ok(snapshot),
            InSpace::Layer(_) => Err("snapshot: of a layer, and this is a suspension"),
        }
    }
}

/// A run of one space.
pub(crate) struct RunIn<S: Stepped> {
    run: Simulation<S>,
    /// The next step, made in advance on a copy.
    ahead: Option<Box<Ahead<S>>>,
}

/// A step done in advance.
struct Ahead<S: Stepped> {
    run: Simulation<S>,
    sample: Sample,
    frame: Frame<S>,
}

/// Positions after a number of steps.
pub(crate) struct Place {
    pub(crate) steps: u64,
    pub(crate) centres: Vec<f64>,
    pub(crate) angles: Vec<f64>,
}

impl<S: Stepped> From<Simulation<S>> for RunIn<S> {
    fn from(run: Simulation<S>) -> Self {
        Self { run, ahead: None }
    }
}

impl<S: Stepped> RunIn<S> {
    /// Measurements of the next step.
    fn look(&mut self, params: &Params, tables: &NearFields) -> Result<&Ahead<S>, Error> {
        let ahead = if let Some(ahead) = self.ahead.take() {
            ahead
        } else {
            // A run restored from a snapshot continues with the same bits.
            let mut run = Simulation::from_snapshot(params, self.run.snapshot(), tables)?;
            let (sample, frame) = run.step_with_frame()?;
            Box::new(Ahead { run, sample, frame })
        };
        Ok(self.ahead.insert(ahead))
    }
}

impl<S: Stepped> Steps for RunIn<S>
where
    Simulation<S>: Send,
    Frame<S>: Send,
{
    fn step(&mut self) -> Result<Sample, Error> {
        match self.ahead.take() {
            Some(ahead) => {
                self.run = ahead.run;
                Ok(ahead.sample)
            }
            None => self.run.step(),
        }
    }

    fn sample(&mut self, params: &Params, tables: &NearFields) -> Result<Sample, Error> {
        Ok(self.look(params, tables)?.sample)
    }

    fn contacts(&mut self, params: &Params, tables: &NearFields) -> Result<Vec<Touching>, Error> {
        let contacts = self.look(params, tables)?.frame.contacts.iter();
        let touching = |contact: &FrameContact<S>| {
            (
                contact.i,
                contact.j,
                contact.normal.as_ref().to_vec(),
                contact.gap,
                contact.normal_force,
                S::across(&contact.tangential_force).to_vec(),
                STATES[usize::from(state_number(contact.state))],
            )
        };
        Ok(contacts.map(touching).collect())
    }

    fn stresslets(&mut self, params: &Params, tables: &NearFields) -> Result<Vec<f64>, Error> {
        let stresslets = self.look(params, tables)?.frame.stresslets.iter();
        Ok(stresslets.flat_map(|s| s.as_ref().to_vec()).collect())
    }

    fn motion(&mut self, params: &Params, tables: &NearFields) -> Result<[Vec<f64>; 2], Error> {
        let frame = &self.look(params, tables)?.frame;
        let velocities = frame.velocities.iter().flat_map(|u| u.as_ref().to_vec());
        let spins = frame.angular_velocities.iter().flat_map(S::spin);
        Ok([velocities.collect(), spins.copied().collect()])
    }

    fn unwrapped(&self) -> Vec<f64> {
        let centres = self.run.unwrapped();
        let centres = centres.flat_map(|x| S::point(&x).as_ref().to_vec());
        centres.collect()
    }

    fn lattice(&self) -> Result<Vec<f64>, Error> {
        let cell = self.run.cell_at(self.run.time())?;
        let frame = Frame::<S> {
            side: self.run.side(),
            offset: cell.offset(),
            cross_offset: cell.cross_offset(),
            ..Frame::default()
        };
        let vectors = frame.lattice();
        Ok(vectors.iter().flat_map(|v| v.as_ref().to_vec()).collect())
    }

    fn place(&self) -> Place {
        let centres = self.run.centres().iter().map(S::point);
        let angles = self.run.orientations().iter().flat_map(S::orientation);
        Place {
            steps: self.run.steps(),
            centres: centres.flat_map(|x| x.as_ref().to_vec()).collect(),
            angles: angles.copied().collect(),
        }
    }

    fn side(&self) -> f64 {
        self.run.side()
    }

    fn radii(&self) -> &[f64] {
        self.run.radii()
    }

    fn flow(&self) -> Flow {
        self.run.flow()
    }

    fn snapshot(&self) -> AnySnapshot {
        S::wrapped(self.run.snapshot())
    }

    fn widths(&self) -> [usize; 4] {
        [S::DIMENSIONS, S::ORIENTATION, S::STRAINS, S::TANGENT]
    }
}
