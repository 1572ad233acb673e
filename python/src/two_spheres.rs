//! Two spheres: their resistance functions, and one moving past the other.

use crate::arrays::{need_numpy, with_numbers};
use crate::errors::raise;
use crate::instant::tables_of;
use crate::values;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sd_core::pair::{PairScenario, pass_while};
use std::time::{Duration, Instant};
use sweep::instant::named_scalars;

/// Interval between checks for Ctrl-C.
pub(crate) const LOOK: Duration = Duration::from_millis(50);

/// Resistance functions of two spheres, normalised as in Kim & Karrila.
///
/// Parameters
/// ----------
/// size_ratio : float
///     Radius of the second sphere over that of the first, 0.01 to 100.
/// separation : float or array of floats
///     s' = 2 r / (a1 + a2), above 2.
///
/// Returns
/// -------
/// dict
///     For each of XA, YA, YB, XC, YC, XG, YG, YH, XM, YM, ZM an array of shape ``(..., 2)``: the
///     shape of `separation`, and the function of the sphere's own motion (11) and of the other's
///     (12). A in 6 pi mu a1; B, G in 4 pi mu a1^2; C, H in 8 pi mu a1^3; M in (20/3) pi mu a1^3.
#[pyfunction]
pub(crate) fn scalars<'py>(
    py: Python<'py>,
    size_ratio: f64,
    separation: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    need_numpy(py)?;
    let array = with_numbers("separation", separation, "of separations")?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let flat = array.call_method1("reshape", (-1,))?;
    let flat = flat.cast::<PyArray1<f64>>()?.try_readonly()?;
    let separations: Vec<f64> = flat.as_array().iter().copied().collect();
    let mut values = Vec::with_capacity(separations.len());
    for separation in separations {
        let found = py.detach(|| named_scalars(size_ratio, separation));
        values.push(found.map_err(raise)?);
        py.check_signals()?;
    }
    let names = named_scalars(1.0, 3.0).map_err(raise)?;
    let answer = PyDict::new(py);
    for (place, (name, _)) in names.iter().enumerate() {
        let column: Vec<f64> = values.iter().flat_map(|of_all| of_all[place].1).collect();
        let mut shape = shape.clone();
        shape.push(2);
        let column = PyArray1::from_vec(py, column).call_method1("reshape", (shape,))?;
        answer.set_item(name, column)?;
    }
    Ok(answer)
}

/// Move two spheres past each other.
///
/// Unbounded fluid, radii 1 and `size_ratio`, forces +1 and -1 along x from (-start, offset) and
/// (start, -offset), critical load 0, until x1 - x2 = 2 start. Lengths in radii of the first
/// sphere.
///
/// Parameters
/// ----------
/// size_ratio : float
///     Radius of the second sphere, 0.01 to 100.
/// roughness, friction : float
///     Roughness height, above 0 and below 0.5; friction coefficient, 0 to 10.
/// contact : bool
///     False for smooth spheres, without effect of `roughness` and `friction`.
/// offset, start : float
///     Half the offset of the paths, and half the distance along x, at the start.
/// time_step : float
///     In mu a^2 / force.
///
/// Returns
/// -------
/// Passed
#[pyfunction]
#[pyo3(signature = (size_ratio=1.0, *, roughness=0.05, friction=0.0, contact=true, offset=0.25, start=5.0, time_step=0.05))]
#[expect(
    clippy::too_many_arguments,
    reason = "keywords of Python, each with a default"
)]
pub(crate) fn pair(
    py: Python<'_>,
    size_ratio: f64,
    roughness: f64,
    friction: f64,
    contact: bool,
    offset: f64,
    start: f64,
    time_step: f64,
) -> PyResult<Bound<'_, PyAny>> {
    need_numpy(py)?;
    let scenario = PairScenario {
        size_ratio,
        contact: contact.then_some((roughness, friction)),
        offset,
        start,
        time_step,
    };
    let tables = tables_of(py, &[1.0, size_ratio])?;
    let mut interrupted = None;
    let passed = py.detach(|| {
        let mut looked = Instant::now();
        pass_while(&scenario, &tables, || {
            if looked.elapsed() < LOOK {
                return true;
            }
            looked = Instant::now();
            interrupted = Python::attach(|py| py.check_signals().err());
            interrupted.is_none()
        })
    });
    if let Some(interrupt) = interrupted {
        return Err(interrupt);
    }
    let passed = passed
        .map_err(raise)?
        .expect("only an interrupt stops them, and there was none");
    let helper = py.import("sheared_layers._solution")?;
    helper.call_method1("Passed", (values::answer(py, &passed)?,))
}
