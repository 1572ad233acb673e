//! What is compiled in this crate for each space.
//!
//! What is generic is compiled in the crate that uses it, and optimised as that crate is: a program that is optimised for size would
//! take three times as long for its steps.

use super::instant::{self, Configuration, ContactRequest, SolvedConfiguration};
use super::simulation::{Sample, Simulation, Snapshot};
use super::start::Started;
use crate::error::Error;
use crate::hydrodynamics::resistance::{Fluid, NearFields};
use crate::model::Params;
use crate::space::{Bulk, Layer};

/// A space for which the parts of a run that compute are compiled here.
pub trait Compiled: Fluid {
    /// [`Simulation::from_snapshot`].
    ///
    /// # Errors
    /// Its errors.
    fn continue_run(
        params: &Params,
        snapshot: Snapshot<Self>,
        tables: &NearFields,
    ) -> Result<Simulation<Self>, Error>
    where
        Self: Started;

    /// [`Simulation::step`].
    ///
    /// # Errors
    /// Its errors.
    fn step(run: &mut Simulation<Self>) -> Result<Sample, Error>
    where
        Self: Started;

    /// [`instant::solve`].
    ///
    /// # Errors
    /// Its errors.
    fn solve(
        configuration: &Configuration<Self>,
        request: &ContactRequest<Self>,
        tables: &NearFields,
    ) -> Result<SolvedConfiguration<Self>, Error>;
}

macro_rules! compile {
    ($space:ty) => {
        impl Compiled for $space {
            #[inline(never)]
            fn continue_run(
                params: &Params,
                snapshot: Snapshot<Self>,
                tables: &NearFields,
            ) -> Result<Simulation<Self>, Error> {
                Simulation::continued(params, snapshot, tables)
            }

            #[inline(never)]
            fn step(run: &mut Simulation<Self>) -> Result<Sample, Error> {
                run.advance()
            }

            #[inline(never)]
            fn solve(
                configuration: &Configuration<Self>,
                request: &ContactRequest<Self>,
                tables: &NearFields,
            ) -> Result<SolvedConfiguration<Self>, Error> {
                let method = instant::method(configuration, request);
                instant::solve_with(method, configuration, request, tables)
            }
        }
    };
}

compile!(Layer);
compile!(Bulk);
