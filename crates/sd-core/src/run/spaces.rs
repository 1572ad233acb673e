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
    fn check(params: &Params) -> Result<(), Error>;

    /// The start of a run.
    ///
    /// # Errors
    /// [`Error::CellTooSmall`], [`Error::CannotPack`].
    fn start(params: &Params, seed: u64) -> Result<Start<Self>, Error>;

    /// Offset of the cell at strain 0, in a.
    fn offset(params: &Params) -> f64;
}

/// Refuses parameters of the other space.
fn refuse_space(key: &'static str, allowed: &str) -> Error {
    Refusal {
        key,
        value: "none".into(),
        problem: "is missing".into(),
        allowed: allowed.into(),
        because: None,
    }
    .into()
}

impl Starts for Layer {
    fn check(params: &Params) -> Result<(), Error> {
        match params.volume_fraction {
            None => Ok(()),
            Some(_) => Err(refuse_space("area_fraction", "a layer has one")),
        }
    }

    fn start(params: &Params, seed: u64) -> Result<Start, Error> {
        start::first_layer(params, seed)
    }

    fn offset(params: &Params) -> f64 {
        params.given_layer().map_or(0.0, |layer| layer.offset)
    }
}

impl Starts for Bulk {
    fn check(params: &Params) -> Result<(), Error> {
        match params.volume_fraction {
            Some(_) => Ok(()),
            None => Err(refuse_space("volume_fraction", "a suspension has one")),
        }
    }

    fn start(params: &Params, seed: u64) -> Result<Start<Self>, Error> {
        start::suspension(params, seed)
    }

    fn offset(_: &Params) -> f64 {
        0.0
    }
}
