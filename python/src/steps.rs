//! A run in either space, for the classes of runs.

use sd_core::cell::Lattice;
use sd_core::simulation::{Flow, Frame, FrameContact};
use sd_core::{Error, NearFields, Params, RunSpace, Sample, Simulation};
use sweep::model::spaces::{AnyFrame, AnySimulation, AnySnapshot};
use sweep::of_either;
use sweep::trajectory::{Kept, STATES, state_number};

/// A pair in contact: spheres, normal, gap, normal force, tangential force, state.
pub(crate) type Touching = (usize, usize, Vec<f64>, f64, f64, Vec<f64>, &'static str);

/// A run.
pub(crate) struct Steps {
    run: AnySimulation,
    /// The next step, made in advance on a copy.
    ahead: Option<(AnySimulation, Sample, AnyFrame)>,
}

/// A number of steps, and the positions after them: centres and orientations, one after the other.
pub(crate) type Place = (u64, [Vec<f64>; 2]);

impl From<AnySimulation> for Steps {
    fn from(run: AnySimulation) -> Self {
        Self { run, ahead: None }
    }
}

impl Steps {
    /// Does a step.
    pub(crate) fn step(&mut self) -> Result<Sample, Error> {
        match self.ahead.take() {
            Some((run, sample, _)) => {
                self.run = run;
                Ok(sample)
            }
            None => self.run.step(),
        }
    }

    /// Does a step that nobody looks at.
    pub(crate) fn step_unmeasured(&mut self) -> Result<(), Error> {
        match self.ahead.take() {
            Some((run, ..)) => {
                self.run = run;
                Ok(())
            }
            None => self.run.step_unmeasured(),
        }
    }

    /// Measurements of the next step, and its frame.
    pub(crate) fn look(
        &mut self,
        params: &Params,
        tables: &NearFields,
    ) -> Result<(Sample, &AnyFrame), Error> {
        let ahead = if let Some(ahead) = self.ahead.take() {
            ahead
        } else {
            // A run restored from a snapshot continues with the same bits.
            let mut run = AnySimulation::from_snapshot(params, self.run.snapshot(), tables)?;
            let (sample, frame) = run.step_with_frame()?;
            (run, sample, frame)
        };
        let (_, sample, frame) = self.ahead.insert(ahead);
        Ok((*sample, frame))
    }

    /// Centres that are not moved back into the cell, one after the other.
    pub(crate) fn unwrapped(&self) -> Vec<f64> {
        fn of<S: RunSpace>(run: &Simulation<S>) -> Vec<f64> {
            let centres = run.unwrapped().map(|x| S::point(&x));
            centres.flat_map(|x| x.as_ref().to_vec()).collect()
        }
        of_either!(&self.run, run => of(run))
    }

    /// Lattice vectors of the cell, one after the other.
    pub(crate) fn lattice(&self) -> Result<Vec<f64>, Error> {
        fn of<S: RunSpace>(run: &Simulation<S>) -> Result<Vec<f64>, Error> {
            let cell = run.cell_at(run.time())?;
            let vectors = cell.lattice().map_or(&[][..], Lattice::vectors);
            let points = vectors.iter().map(|a| S::point(a).as_ref().to_vec());
            Ok(points.flatten().collect())
        }
        of_either!(&self.run, run => of(run))
    }

    pub(crate) fn place(&self) -> Place {
        fn of<S: Kept + RunSpace>(run: &Simulation<S>) -> Place {
            let centres = run.centres().iter().map(S::point);
            let angles = run.orientations().iter().flat_map(S::orientation);
            let centres = centres.flat_map(|x| x.as_ref().to_vec()).collect();
            (run.steps(), [centres, angles.copied().collect()])
        }
        of_either!(&self.run, run => of(run))
    }

    pub(crate) fn side(&self) -> f64 {
        of_either!(&self.run, run => run.side())
    }

    pub(crate) fn radii(&self) -> &[f64] {
        of_either!(&self.run, run => run.radii())
    }

    pub(crate) fn flow(&self) -> Flow {
        self.run.flow()
    }

    pub(crate) fn snapshot(&self) -> AnySnapshot {
        self.run.snapshot()
    }
}

/// The pairs in contact of a frame.
pub(crate) fn contacts(frame: &AnyFrame) -> Vec<Touching> {
    fn touching<S: Kept>(contact: &FrameContact<S>) -> Touching {
        (
            contact.i,
            contact.j,
            contact.normal.as_ref().to_vec(),
            contact.gap,
            contact.normal_force,
            S::across(&contact.tangential_force).to_vec(),
            STATES[usize::from(state_number(contact.state))],
        )
    }
    of_either!(frame, frame => frame.contacts.iter().map(touching).collect())
}

/// Stresslets of a frame, one after the other.
pub(crate) fn stresslets(frame: &AnyFrame) -> Vec<f64> {
    of_either!(frame, frame => frame.stresslets.iter().flat_map(|s| s.as_ref().to_vec()).collect())
}

/// Velocities and angular velocities of a frame, each one after the other.
pub(crate) fn motion(frame: &AnyFrame) -> [Vec<f64>; 2] {
    fn of<S: Kept>(frame: &Frame<S>) -> [Vec<f64>; 2] {
        let velocities = frame.velocities.iter().flat_map(|u| u.as_ref().to_vec());
        let spins = frame.angular_velocities.iter().flat_map(S::spin);
        [velocities.collect(), spins.copied().collect()]
    }
    of_either!(frame, frame => of(frame))
}
