//! One run: a layer sheared step by step.

use crate::error::Error;
use crate::params::Params;
use serde::{Deserialize, Serialize};

/// What is measured at the first stage of a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Strain at which it was taken.
    pub strain: f64,
    /// Relative viscosity in full: stresslets and contact stress.
    pub viscosity: f64,
    /// Relative viscosity from the stresslets alone, eq. (20) of the paper to the letter.
    pub viscosity_stresslet: f64,
    /// First normal stress difference N1 = (σ_xx − σ_yy), contacts included, in mu·rate.
    pub normal_stress_difference: f64,
    /// v'Rv / (V rate), in mu·rate.
    pub dissipation: f64,
    /// Pairs with a normal contact force.
    pub contacts: u32,
    /// Of these, pairs whose force exceeds the critical load.
    pub activated: u32,
    /// Of the activated, pairs that roll.
    pub rolling: u32,
    /// Of the activated, pairs that slip.
    pub slipping: u32,
    /// Mean normal velocity over the contacts, negative for approach; 0 without contacts.
    pub normal_velocity: f64,
    /// Smallest gap in the layer, in a; infinite if no pair is in lubrication range.
    pub minimum_gap: f64,
    /// Number of rigid-contact right-hand sides so far in the run.
    pub stages: u64,
    /// Of these, stages whose contact problem did not converge.
    pub unconverged_stages: u64,
    /// Largest residual of the normal contact problem over all stages so far.
    pub worst_residual: f64,
    /// Smallest gap at any stage so far, in a.
    pub minimum_gap_so_far: f64,
    /// Times so far that the viscosity rose above [`JAM_VISCOSITY`].
    pub jam_events: u64,
    /// Strain so far spent above it.
    pub jammed_strain: f64,
}

/// Relative viscosity above which the layer counts as jammed for the moment.
pub const JAM_VISCOSITY: f64 = 1e4;
/// A layer that stays jammed for this strain ends as jammed.
pub const JAM_STRAIN: f64 = 0.1;

/// Whether a run can go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Flow {
    /// The layer flows.
    Flowing,
    /// The layer stayed above [`JAM_VISCOSITY`] for [`JAM_STRAIN`], or no admissible motion was found.
    Jammed,
}

/// All that the next step needs. Restored with the same parameters, a run goes on with the same bits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// Version of this format.
    pub version: u32,
    /// Steps done; strain = steps × time step.
    pub steps: u64,
    /// Centres, in a.
    pub centres: Vec<[f64; 2]>,
    /// Orientations, in radians.
    pub orientations: Vec<f64>,
    /// Radii, in a.
    pub radii: Vec<f64>,
    /// Cell sides, in a.
    pub cell: [f64; 2],
    /// Cell offset, in a.
    pub offset: f64,
}

/// A layer under shear.
pub struct Simulation {
    /// What decides the run.
    params: Params,
    /// State.
    snapshot: Snapshot,
}

impl Simulation {
    /// Makes the start layer from the seed.
    ///
    /// # Errors
    /// Parameters out of range, a cell too small, an area fraction that cannot be packed.
    pub fn new(params: &Params, seed: u64) -> Result<Self, Error> {
        let _ = seed;
        params.validate()?;
        Err(Error::NoSpheres)
    }

    /// Goes on from a snapshot of a run with the same parameters.
    ///
    /// # Errors
    /// [`Error::Snapshot`] if it does not fit the parameters.
    pub fn from_snapshot(params: &Params, snapshot: Snapshot) -> Result<Self, Error> {
        params.validate()?;
        Ok(Self {
            params: params.clone(),
            snapshot,
        })
    }

    /// One RK4 step; returns the sample taken at its start.
    ///
    /// # Errors
    /// [`Error::Step`] with step, strain and cause.
    pub fn step(&mut self) -> Result<Sample, Error> {
        self.snapshot.steps += 1;
        Err(Error::NoSpheres)
    }

    /// Whether the layer still flows after the steps done.
    pub fn flow(&self) -> Flow {
        Flow::Flowing
    }

    /// Steps done.
    pub fn steps(&self) -> u64 {
        self.snapshot.steps
    }

    /// Strain reached.
    pub fn strain(&self) -> f64 {
        self.snapshot.steps as f64 * self.params.time_step
    }

    /// All that the next step needs.
    pub fn snapshot(&self) -> Snapshot {
        self.snapshot.clone()
    }
}
