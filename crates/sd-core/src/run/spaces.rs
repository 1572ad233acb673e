//! What differs between the starts of layers and of suspensions.

use super::start::{self, Start};
use crate::error::Error;
use crate::hydrodynamics::resistance::Fluid;
use crate::model::{Params, Refusal};
use crate::space::{Bulk, Layer};

/// A space with the start of its runs.
pub trait Starts: Fluid {
    /// Refuses parameters of the other space.
    ///
    /// # Errors
    /// [`Error::Refused`].
    fn check(params: &Params) -> Result<(), Error> {
        let (key, allowed) = match (Self::DIMENSIONS, params.volume_fraction) {
            (2, None) | (3, Some(_)) => return Ok(()),
            (2, _) => ("area_fraction", "a layer has one"),
            _ => ("volume_fraction", "a suspension has one"),
        };
        Err(Refusal {
            key,
            value: "none".into(),
            problem: "is missing".into(),
            allowed: allowed.into(),
            because: None,
        }
        .into())
    }

    /// The start of a run.
    ///
    /// # Errors
    /// [`Error::CellTooSmall`], [`Error::CannotPack`].
    fn start(params: &Params, seed: u64) -> Result<Start<Self>, Error>;
}

impl Starts for Layer {
    fn start(params: &Params, seed: u64) -> Result<Start, Error> {
        start::first_layer(params, seed)
    }
}

impl Starts for Bulk {
    fn start(params: &Params, seed: u64) -> Result<Start<Self>, Error> {
        start::suspension(params, seed)
    }
}
