//! The physics and the campaigns of this repository for Python.
//!
//! `sd_core` and `sweep` do all computations; this crate converts arguments from Python, and
//! results and errors to Python. Everything specific to numpy, Arrow or keywords of Python is here.
//! ```text
//! errors      errors of the program as exceptions, with the same messages
//! values      keywords as values of the campaign file's form, and back
//! arrays      numpy arrays in and out, structured ones for contacts
//! two_spheres scalars, pair
//! instant     solve
//! run         a layer or a suspension under shear, step by step
//! steps       what is done for it in one space or the other
//! table       a table of the program as Arrow
//! campaign    campaigns: plan, run
//! store       stores: points, runs, samples, frames, outlines of figures
//! frames      structure of frames that may come from another program
//! ```

mod arrays;
mod campaign;
mod errors;
mod frames;
mod instant;
mod run;
mod steps;
mod store;
mod table;
mod two_spheres;
mod values;

/// The compiled part of `sheared_layers`.
#[pyo3::pymodule]
mod _core {
    #[pymodule_export]
    use crate::campaign::Campaign;
    #[pymodule_export]
    use crate::errors::{SimulationError, StoreError};
    #[pymodule_export]
    use crate::frames::frame_structure;
    #[pymodule_export]
    use crate::instant::solve;
    #[pymodule_export]
    use crate::run::{Layer, Run, Suspension};
    #[pymodule_export]
    use crate::store::Store;
    #[pymodule_export]
    use crate::table::Table;
    #[pymodule_export]
    use crate::two_spheres::{pair, scalars};

    /// Version of the package.
    #[pymodule_export]
    const __VERSION__: &str = env!("CARGO_PKG_VERSION");
}
