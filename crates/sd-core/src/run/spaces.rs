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
        let (key, value, problem, allowed) = match (Self::DIMENSIONS, params.volume_fraction) {
            (2, None) | (3, Some(_)) => return Ok(()),
            (2, Some(fraction)) => (
                "volume_fraction",
                fraction,
                "makes a suspension, and this is to be a layer",
                "a Suspension with it, or a Layer with area_fraction",
            ),
            _ => (
                "area_fraction",
                params.area_fraction,
                "makes a layer, and this is to be a suspension",
                "a Layer with it, or a Suspension with volume_fraction",
            ),
        };
        Err(Refusal {
            key,
            value: value.to_string(),
            problem: problem.into(),
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
