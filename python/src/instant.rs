//! One instant of one configuration.

use crate::arrays::{has_three_columns, need_numpy, numbers, vectors};
use crate::errors::raise;
use crate::values;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sd_core::{Bulk, Layer, NearFields, instant};
use serde::Deserialize as _;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;
use sweep::instant::{
    Answer, Components, Input as InstantInput, InputError, Written, configuration,
};
use sweep::trajectory::Kept;

/// Maximum number of size ratios with cached tables.
const MAX_TABLES: usize = 100;

/// Tables of unequal spheres that were needed so far, and their size ratios.
static TABLES: Mutex<(Vec<f64>, Option<NearFields>)> = Mutex::new((Vec::new(), None));

/// The tables for spheres of these radii: loaded ones, from the cache of the user, or computed.
pub(crate) fn tables_of(py: Python<'_>, radii: &[f64]) -> PyResult<NearFields> {
    let ratios = NearFields::ratios(radii);
    // Values out of range are refused where they are used.
    if ratios.iter().any(|ratio| !(0.01..=100.0).contains(ratio)) {
        return Ok(NearFields::default());
    }
    py.detach(|| {
        let mut known = TABLES.lock().unwrap_or_else(PoisonError::into_inner);
        let (made_for, tables) = &mut *known;
        let made = tables.get_or_insert_default();
        if ratios.iter().all(|ratio| made.contains(*ratio)) {
            return Ok(made.clone());
        }
        if made_for.len() > MAX_TABLES {
            made_for.clear();
        }
        made_for.extend(ratios);
        *made = sweep::near_field_cache::make(made_for, |_| ())?;
        Ok(made.clone())
    })
    .map_err(|error: sd_core::Error| raise(error))
}

/// Solve one instant of one configuration: velocities, stresslets and contact forces.
///
/// Lengths in sphere radii, forces in viscosity times radius squared times shear rate. Arrays of
/// integers and of narrower floats are converted; strides are arbitrary.
///
/// Parameters
/// ----------
/// centres : array [N, 2]
///     Of a suspension [N, 3], as are `forces` and `torques`; `cell` then has three sides, and
///     `background` is written as for `sweep solve`.
/// radii : array [N], optional
///     1 each.
/// cell : (float, float), optional
///     Sides of the periodic cell; none is unbounded fluid.
/// offset : float, optional
///     Offset of the cell above along the flow, with `cell`; 0.
/// cross_offset : float, optional
///     Of a suspension the offset of the cell above along the vorticity, with `cell`; 0.
/// hydrodynamics : str
///     "stokesian-dynamics", "ball-melrose", or "lubrication", whose numbers may be given as
///     `lubrication`.
/// background : dict, optional
///     {"rate_of_strain": {"xx": 0, "yy": 0, "xy": 0.5}, "angular_velocity": -0.5}, simple shear,
///     is the default.
/// forces : array [N, 2], optional
/// torques : array [N], optional
///     External ones; 0.
/// contact : dict, optional
///     {"scheme": "none"}; "listed" with "pairs"; "rigid" or "procedure" with "roughness",
///     "friction", "critical_load" and "time_span" of rigid contacts; "laws" with these and "laws".
/// **more
///     Further keys of a file of `sweep solve`.
///
/// Returns
/// -------
/// Solution
#[pyfunction]
#[pyo3(
    signature = (centres, *, radii=None, forces=None, torques=None, **more),
    text_signature = "(centres, *, radii=None, cell=None, offset=None, cross_offset=None, hydrodynamics='stokesian-dynamics', background=None, forces=None, torques=None, contact=None, **more)"
)]
pub(crate) fn solve<'py>(
    py: Python<'py>,
    centres: &Bound<'py, PyAny>,
    radii: Option<&Bound<'py, PyAny>>,
    forces: Option<&Bound<'py, PyAny>>,
    torques: Option<&Bound<'py, PyAny>>,
    more: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    need_numpy(py)?;
    let mut written = more.map(values::table).transpose()?.unwrap_or_default();
    written
        .entry("hydrodynamics")
        .or_insert_with(|| "stokesian-dynamics".into());
    // Read as arrays below.
    written.insert("centres".into(), toml::Value::Array(Vec::new()));
    let lists = [radii, forces, torques];
    if has_three_columns("centres", centres)? {
        solve_in::<Bulk>(py, written, centres, lists)
    } else {
        solve_in::<Layer>(py, written, centres, lists)
    }
}

/// A space whose configurations come as arrays.
trait Arrays: Written + Kept {
    /// Reads vectors.
    fn vectors(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Self::Components>>;

    /// Reads torques.
    fn spins(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Self::Turning>>;
}

impl Arrays for Layer {
    fn vectors(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Components<2>>> {
        Ok(vectors(name, given)?.into_iter().map(Components).collect())
    }

    fn spins(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
        numbers(name, given)
    }
}

impl Arrays for Bulk {
    fn vectors(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Components<3>>> {
        Ok(vectors(name, given)?.into_iter().map(Components).collect())
    }

    fn spins(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Components<3>>> {
        <Self as Arrays>::vectors(name, given)
    }
}

fn solve_in<'py, S: Arrays>(
    py: Python<'py>,
    written: toml::Table,
    centres: &Bound<'py, PyAny>,
    [radii, forces, torques]: [Option<&Bound<'py, PyAny>>; 3],
) -> PyResult<Bound<'py, PyAny>>
where
    instant::Configuration<S>: Sync,
    instant::InstantContacts<S>: Sync,
    instant::SolvedConfiguration<S>: Send,
{
    let mut input: InstantInput<S> =
        InstantInput::deserialize(written).map_err(|error| unreadable(&error))?;
    input.centres = S::vectors("centres", centres)?;
    input.radii = radii.map(|given| numbers("radii", given)).transpose()?;
    input.forces = forces
        .map(|given| S::vectors("forces", given))
        .transpose()?;
    input.torques = torques
        .map(|given| S::spins("torques", given))
        .transpose()?;
    let (configuration, request) = configuration(input).map_err(|error| match error {
        InputError::Physics(error) => raise(error),
        other => PyValueError::new_err(other.to_string()),
    })?;
    let tables = if configuration.hydrodynamics.needs_tables() {
        tables_of(py, &configuration.radii)?
    } else {
        NearFields::default()
    };
    let (solved, computing_time_s) = py.detach(|| {
        let begun = Instant::now();
        let solved = instant::solve(&configuration, &request, &tables);
        (solved, begun.elapsed().as_secs_f64())
    });
    let answer = Answer::of(&solved.map_err(raise)?).map_err(raise)?;
    let answer = values::answer(py, &answer)?;
    let helper = py.import("sheared_layers._solution")?;
    helper.call_method1("Solution", (answer, S::DIMENSIONS, computing_time_s))
}

/// The exception for invalid keywords.
fn unreadable(error: &toml::de::Error) -> PyErr {
    let words = error.to_string();
    let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
    if error.message().starts_with("unknown field") {
        PyTypeError::new_err(words)
    } else {
        PyValueError::new_err(words)
    }
}
