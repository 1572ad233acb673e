//! All that a run needs to go on.

use super::Counters;
use crate::contact::procedure::ContactList;
use crate::contact::rigid::Memory;
use crate::error::Error;
use crate::geometry::pair::PairKey;
use crate::params::Params;
use crate::run::start;
use serde::{Deserialize, Serialize};

/// Version of [`Snapshot`].
pub const SNAPSHOT_VERSION: u32 = 1;

/// All that the next step needs. Restored with the same parameters, a run goes on with the same bits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Snapshot {
    /// [`SNAPSHOT_VERSION`].
    pub version: u32,
    /// Steps done; strain = steps × time step.
    pub steps: u64,
    /// Radii, in a.
    pub radii: Vec<f64>,
    /// Side of the square cell, in a.
    pub side: f64,
    /// Centres, in a.
    pub centres: Vec<[f64; 2]>,
    /// Orientations, in radians.
    pub orientations: Vec<f64>,
    /// Mean disturbance velocities `[3N]` of the last step, for step 1 of the procedure; empty before it and under other schemes.
    pub velocities: Vec<f64>,
    /// Contact forces of the last stage, where the next one starts; under stick-slide the forces of its springs.
    pub memory: Memory,
    /// Contact list of the procedure.
    pub listed: ContactList,
    /// Pairs of the near part's pattern, ordered, where the resistance is held pair by pair: the order of elimination follows from
    /// them.
    #[serde(default)]
    pub near_pairs: Vec<PairKey>,
    /// Counters.
    pub counters: Counters,
}

impl Snapshot {
    /// Refuses what cannot be a snapshot of a run with these parameters.
    pub(super) fn check(&self, params: &Params) -> Result<(), Error> {
        let refuse = |reason| Err(Error::Snapshot { reason });
        let n = params.spheres;
        if self.version != SNAPSHOT_VERSION {
            return refuse("made by another version of the program");
        }
        if self.radii.len() != n || self.centres.len() != n || self.orientations.len() != n {
            return refuse("other number of spheres");
        }
        if !(self.velocities.is_empty() || self.velocities.len() == 3 * n) {
            return refuse("velocities of another number of spheres");
        }
        if !self
            .listed
            .pairs
            .iter()
            .all(|&(i, j)| i < j && (j as usize) < n)
        {
            return refuse("contacts of spheres that are not there");
        }
        let pairs = &self.near_pairs;
        if !pairs.iter().all(|&(i, j)| i < j && (j as usize) < n)
            || !pairs.is_sorted_by(|a, b| a < b)
        {
            return refuse("near pairs of spheres that are not there, or not in order");
        }
        let finite = self.centres.iter().flatten().all(|x| x.is_finite())
            && self.orientations.iter().all(|x| x.is_finite())
            && self.velocities.iter().all(|x| x.is_finite())
            && self
                .memory
                .forces
                .iter()
                .all(|f| f.2.is_finite() && f.3.is_finite());
        if !finite {
            return refuse("not all numbers are finite");
        }
        let (radii, side) = start::radii_and_side(params)?;
        if self.radii != radii || self.side.to_bits() != side.to_bits() {
            return refuse("other radii or cell than the parameters give");
        }
        Ok(())
    }
}
