//! Layers and suspensions as one type: the only place where the parameters of a run select its
//! space.

use sd_core::simulation::{Counters, Flow, Frame};
use sd_core::{Bulk, Error, Layer, NearFields, Params, Sample, Simulation, Snapshot};
use serde::{Deserialize, Serialize};

/// A value of a layer or of a suspension.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum InSpace<L, B> {
    /// Spheres in a plane.
    Layer(L),
    /// Spheres in a volume.
    Suspension(B),
}

/// A run.
pub type AnySimulation = InSpace<Box<Simulation<Layer>>, Box<Simulation<Bulk>>>;
/// All that a run needs to continue.
pub type AnySnapshot = InSpace<Snapshot<Layer>, Snapshot<Bulk>>;
/// Spheres and contacts at one instant.
pub type AnyFrame = InSpace<Frame<Layer>, Frame<Bulk>>;

/// Evaluates the same expression for a value of either space.
#[macro_export]
macro_rules! of_either {
    ($either:expr, $one:ident => $result:expr) => {
        match $either {
            $crate::model::spaces::InSpace::Layer($one) => $result,
            $crate::model::spaces::InSpace::Suspension($one) => $result,
        }
    };
}
pub(crate) use of_either;

/// The dilute limit of the viscosity and its formula: Einstein's in a suspension, and in a layer
/// that of its volume, `2 ⟨a⟩ A` for equal spheres.
pub(crate) fn dilute_viscosity(params: &Params) -> (f64, &'static str) {
    match params.volume_fraction {
        Some(volume_fraction) => (1.0 + 2.5 * volume_fraction, "dilute 1 + 5φ/2"),
        None => (1.0 + 5.0 * params.area_fraction / 3.0, "dilute 1 + 5c/3"),
    }
}

impl AnySimulation {
    /// Starts a run from the layer or suspension of its seed.
    ///
    /// # Errors
    /// Those of [`Simulation::new`].
    pub fn new(params: &Params, seed: u64, tables: &NearFields) -> Result<Self, Error> {
        Ok(if params.volume_fraction.is_some() {
            Self::Suspension(Box::new(Simulation::new(params, seed, tables)?))
        } else {
            Self::Layer(Box::new(Simulation::new(params, seed, tables)?))
        })
    }

    /// Continues a run.
    ///
    /// # Errors
    /// Those of [`Simulation::from_snapshot`].
    pub fn from_snapshot(
        params: &Params,
        snapshot: AnySnapshot,
        tables: &NearFields,
    ) -> Result<Self, Error> {
        Ok(match snapshot {
            InSpace::Layer(of) => {
                Self::Layer(Box::new(Simulation::from_snapshot(params, of, tables)?))
            }
            InSpace::Suspension(of) => {
                Self::Suspension(Box::new(Simulation::from_snapshot(params, of, tables)?))
            }
        })
    }

    /// All that the next step needs.
    pub fn snapshot(&self) -> AnySnapshot {
        match self {
            Self::Layer(run) => InSpace::Layer(run.snapshot()),
            Self::Suspension(run) => InSpace::Suspension(run.snapshot()),
        }
    }

    /// Makes a step.
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
    pub fn step(&mut self) -> Result<Sample, Error> {
        of_either!(self, run => run.step())
    }

    /// Makes a step without its sample.
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
    pub fn step_unmeasured(&mut self) -> Result<(), Error> {
        of_either!(self, run => run.step_unmeasured())
    }

    /// As [`AnySimulation::step`], and returns the frame of the sample too.
    ///
    /// # Errors
    /// Those of [`Simulation::step`].
    pub fn step_with_frame(&mut self) -> Result<(Sample, AnyFrame), Error> {
        Ok(match self {
            Self::Layer(run) => {
                let (sample, frame) = run.step_with_frame()?;
                (sample, InSpace::Layer(frame))
            }
            Self::Suspension(run) => {
                let (sample, frame) = run.step_with_frame()?;
                (sample, InSpace::Suspension(frame))
            }
        })
    }

    /// Places of the spheres at the start of the run along gradient and vorticity, in a; 0 along
    /// the vorticity of a layer. For a run that has begun the start is made again.
    ///
    /// # Errors
    /// Those of [`Snapshot::start`].
    pub(crate) fn places_at_start(
        &self,
        params: &Params,
        seed: u64,
    ) -> Result<Vec<[f64; 2]>, Error> {
        let start = match self {
            _ if self.steps() == 0 => self.snapshot(),
            Self::Layer(_) => InSpace::Layer(Snapshot::start(params, seed)?),
            Self::Suspension(_) => InSpace::Suspension(Snapshot::start(params, seed)?),
        };
        Ok(match start {
            InSpace::Layer(of) => of.centres.iter().map(|x| [x[1], 0.0]).collect(),
            InSpace::Suspension(of) => of.centres.iter().map(|x| [x[1], x[2]]).collect(),
        })
    }

    /// Steps done.
    pub(crate) fn steps(&self) -> u64 {
        of_either!(self, run => run.steps())
    }

    /// Strain reached.
    pub(crate) fn strain(&self) -> f64 {
        of_either!(self, run => run.strain())
    }

    /// Whether it still flows.
    pub fn flow(&self) -> Flow {
        of_either!(self, run => run.flow())
    }

    /// Counters so far.
    pub(crate) fn counters(&self) -> &Counters {
        of_either!(self, run => run.counters())
    }
}

impl AnySnapshot {
    /// Steps done.
    pub fn steps(&self) -> u64 {
        of_either!(self, of => of.steps)
    }

    /// Counters.
    pub(crate) fn counters(&self) -> &Counters {
        of_either!(self, of => &of.counters)
    }
}

impl AnyFrame {
    /// Strain.
    pub fn strain(&self) -> f64 {
        of_either!(self, frame => frame.strain)
    }
}
