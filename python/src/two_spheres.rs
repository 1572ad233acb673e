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
    size_ratio: &Bound<'py, PyAny>,
    separation: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    need_numpy(py)?;
    let size_ratio = values::number("size_ratio", size_ratio)?;
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
#[pyo3(
    signature = (size_ratio=None, *, roughness=None, friction=None, contact=None, offset=None, start=None, time_step=None),
    text_signature = "(size_ratio=1.0, *, roughness=0.05, friction=0.0, contact=True, offset=0.25, start=5.0, time_step=0.05)"
)]
#[expect(
    clippy::too_many_arguments,
    reason = "keywords of Python, each with a default"
)]
pub(crate) fn pair<'py>(
    py: Python<'py>,
    size_ratio: Option<&Bound<'py, PyAny>>,
    roughness: Option<&Bound<'py, PyAny>>,
    friction: Option<&Bound<'py, PyAny>>,
    contact: Option<&Bound<'py, PyAny>>,
    offset: Option<&Bound<'py, PyAny>>,
    start: Option<&Bound<'py, PyAny>>,
    time_step: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    need_numpy(py)?;
    let number = |name, given: Option<&Bound<'py, PyAny>>, default| {
        given.map_or(Ok(default), |given| values::number(name, given))
    };
    let size_ratio = number("size_ratio", size_ratio, 1.0)?;
    let surface = (
        number("roughness", roughness, 0.05)?,
        number("friction", friction, 0.0)?,
    );
    let scenario = PairScenario {
        size_ratio,
        contact: values::flag("contact", contact, true)?.then_some(surface),
        offset: number("offset", offset, 0.25)?,
        start: number("start", start, 5.0)?,
        time_step: number("time_step", time_step, 0.05)?,
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
