//! Spaces in which runs can be made and stepped.

use super::instant::{self, Configuration, InstantContacts, SolvedConfiguration};
use super::simulation::{Sample, Simulation, Snapshot};
use super::start::suspension::Mixture;
use super::start::{self, Start};
use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, NearFields};
use crate::model::{Params, Refusal, SolverSettings};
use crate::space::{Bulk, Layer, Space as _};

/// A space in which runs can be made.
pub trait Started: Fluid {
    /// Refuses parameters of the other space.
    ///
    /// # Errors
    /// [`Error::Refused`].
    fn check(params: &Params) -> Result<(), Error>;

    /// Radii and cell side, without packing.
    ///
    /// # Errors
    /// [`Error::CellTooSmall`].
    fn radii_and_side(params: &Params) -> Result<(Vec<f64>, f64), Error>;

    /// The start of a run.
    ///
    /// # Errors
    /// [`Error::CellTooSmall`], [`Error::CannotPack`].
    fn start(params: &Params, seed: u64) -> Result<Start<Self>, Error>;

    /// Offset of the cell at strain 0, in a.
    fn offset(params: &Params) -> f64;

    /// [`Simulation::with_settings`].
    ///
    /// # Errors
    /// Its errors.
    fn continue_run(
        params: &Params,
        snapshot: Snapshot<Self>,
        tables: &NearFields,
        settings: &SolverSettings,
    ) -> Result<Simulation<Self>, Error>;

    /// [`Simulation::step`].
    ///
    /// # Errors
    /// Its errors.
    fn step(run: &mut Simulation<Self>) -> Result<Sample, Error>;

    /// [`instant::solve`].
    ///
    /// # Errors
    /// Its errors.
    fn solve(
        configuration: &Configuration<Self>,
        request: &InstantContacts<Self>,
        tables: &NearFields,
    ) -> Result<SolvedConfiguration<Self>, Error>;
}

/// Implements the last three methods for a space. Generic code is compiled in the crate that uses
/// it, with the optimisation of that crate: a program optimised for size would take three times as
/// long per step. So it is instantiated here.
macro_rules! compile {
    () => {
        #[inline(never)]
        fn continue_run(
            params: &Params,
            snapshot: Snapshot<Self>,
            tables: &NearFields,
            settings: &SolverSettings,
        ) -> Result<Simulation<Self>, Error> {
            Simulation::continued(params, snapshot, tables, settings)
        }

        #[inline(never)]
        fn step(run: &mut Simulation<Self>) -> Result<Sample, Error> {
            run.advance()
        }

        #[inline(never)]
        fn solve(
            configuration: &Configuration<Self>,
            request: &InstantContacts<Self>,
            tables: &NearFields,
        ) -> Result<SolvedConfiguration<Self>, Error> {
            let method = instant::method(configuration, request);
            instant::solve_with(method, configuration, request, tables)
        }
    };
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

impl Started for Layer {
    compile!();

    fn check(params: &Params) -> Result<(), Error> {
        match params.volume_fraction {
            None => Ok(()),
            Some(_) => Err(refuse_space("area_fraction", "a layer has one")),
        }
    }

    fn radii_and_side(params: &Params) -> Result<(Vec<f64>, f64), Error> {
        start::radii_and_side(params)
    }

    fn start(params: &Params, seed: u64) -> Result<Start, Error> {
        start::first_layer(params, seed)
    }

    fn offset(params: &Params) -> f64 {
        params.start.as_ref().map_or(0.0, |start| start.offset)
    }
}

impl Started for Bulk {
    compile!();

    fn check(params: &Params) -> Result<(), Error> {
        match params.volume_fraction {
            Some(_) => Ok(()),
            None => Err(refuse_space("volume_fraction", "a suspension has one")),
        }
    }

    fn radii_and_side(params: &Params) -> Result<(Vec<f64>, f64), Error> {
        Mixture::of(params).radii_and_side()
    }

    fn start(params: &Params, seed: u64) -> Result<Start<Self>, Error> {
        let suspension = Mixture::of(params).suspension(seed)?;
        Ok(Start {
            orientations: vec![Self::UPRIGHT; suspension.radii.len()],
            springs: Vec::new(),
            rolling_springs: Vec::new(),
            radii: suspension.radii,
            centres: suspension.centres,
            side: suspension.side,
        })
    }

    fn offset(_: &Params) -> f64 {
        0.0
    }
}
