//! The structure of frames that may come from another program.

use crate::errors::raise;
use crate::values;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use sd_core::contact::ContactState;
use sweep::report::{OutsideFrame, outside_structure};

/// A contact: both spheres, normal force, size of the friction force, number of its state.
type Touching = (usize, usize, f64, f64, usize);

/// A frame: lattice, centres, radii, contacts.
type Arrays = (Vec<f64>, Vec<f64>, Vec<f64>, Vec<Touching>);

/// The structure of runs, each a list of frames, as `sheared_layers.frames.structure` calls it.
#[pyfunction]
pub(crate) fn frame_structure(
    py: Python<'_>,
    runs: Vec<Vec<Arrays>>,
) -> PyResult<Bound<'_, PyAny>> {
    let state = |number: usize| match number {
        0 => Ok(ContactState::Frictionless),
        1 => Ok(ContactState::Sticking),
        2 => Ok(ContactState::Slipping),
        _ => Err(PyValueError::new_err(format!(
            "state must be 0, 1 or 2, got {number}"
        ))),
    };
    let frame = |(lattice, centres, radii, contacts): Arrays| {
        let contact =
            |(i, j, normal, tangential, number)| Ok((i, j, normal, tangential, state(number)?));
        Ok(OutsideFrame {
            lattice,
            centres,
            radii,
            contacts: contacts.into_iter().map(contact).collect::<PyResult<_>>()?,
        })
    };
    let runs: Vec<Vec<OutsideFrame>> = runs
        .into_iter()
        .map(|frames| frames.into_iter().map(frame).collect())
        .collect::<PyResult<_>>()?;
    let found = py.detach(|| outside_structure(&runs)).map_err(raise)?;
    values::answer(py, &found)
}
