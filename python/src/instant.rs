//! One instant of one configuration.

use crate::arrays::{
    Records, has_three_columns, need_numpy, numbers, of_numbers, of_rows, vectors,
};
use crate::errors::raise;
use crate::values;
use numpy::{PyArray1, PyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sd_core::contact::{Contact, ContactState};
use sd_core::{Bulk, Layer, NearFields, StressComponents, instant};
use serde::Deserialize as _;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;
use sweep::instant::{Components, Input as InstantInput, InputError, Written, configuration};

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

/// Motion, stresslets and contacts of a configuration. Units: radius a, viscosity mu and shear rate
/// are 1.
#[pyclass(frozen, module = "sheared_layers")]
pub(crate) struct Solution {
    /// Velocities minus the background flow at the own centre: array [N, 2], of a suspension [N,
    /// 3].
    #[pyo3(get)]
    velocity_disturbance: Py<PyArray2<f64>>,
    /// Angular velocities minus that of the background: array [N], of a suspension [N, 3].
    #[pyo3(get)]
    angular_velocity_disturbance: Py<PyAny>,
    /// xx of the stresslets: array [N].
    #[pyo3(get)]
    stresslet_xx: Py<PyArray1<f64>>,
    /// yy of the stresslets: array [N].
    #[pyo3(get)]
    stresslet_yy: Py<PyArray1<f64>>,
    /// xy of the stresslets: array [N].
    #[pyo3(get)]
    stresslet_xy: Py<PyArray1<f64>>,
    /// xz of the stresslets of a suspension: array [N]; None of a layer.
    #[pyo3(get)]
    stresslet_xz: Option<Py<PyArray1<f64>>>,
    /// The same, yz.
    #[pyo3(get)]
    stresslet_yz: Option<Py<PyArray1<f64>>>,
    /// Relative viscosity in full; None in unbounded fluid, as are the next two.
    #[pyo3(get)]
    viscosity: Option<f64>,
    /// Relative viscosity from the stresslets alone.
    #[pyo3(get)]
    viscosity_stresslet: Option<f64>,
    /// v'Rv over volume and shear rate.
    #[pyo3(get)]
    dissipation: Option<f64>,
    stress: Option<StressComponents>,
    /// Seconds of the computation itself, without conversions.
    #[pyo3(get)]
    computing_time_s: f64,
    dimensions: usize,
    contacts: Vec<Touching>,
}

#[pymethods]
impl Solution {
    /// First normal stress difference; None in unbounded fluid, as are the next three.
    #[getter]
    fn n1(&self) -> Option<f64> {
        self.stress.as_ref().map(|stress| stress.n1.total())
    }

    /// Second normal stress difference.
    #[getter]
    fn n2(&self) -> Option<f64> {
        self.stress.as_ref().map(|stress| stress.n2.total())
    }

    /// Particle pressure of contacts and repulsion.
    #[getter]
    fn particle_pressure(&self) -> Option<f64> {
        let stress = self.stress.as_ref();
        stress.map(|stress| stress.particle_pressure.total())
    }

    /// The same and the shear stress, by cause: dict of dicts, as in `sweep solve --json`.
    #[getter]
    fn stress<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        values::answer(py, &self.stress)
    }

    /// All candidate pairs, force 0 included: structured array with i, j, image [2], gap, normal
    /// [2], normal_force, tangential_force, normal_velocity, slip_velocity, rolling_force,
    /// rolling_velocity, state. In a suspension vectors have three components, and so have forces
    /// and velocities perpendicular to the line of centres.
    #[getter]
    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut records = Records::default();
        for contact in &self.contacts {
            for sphere in contact.spheres {
                records.sphere(sphere);
            }
            for image in &contact.image {
                records.whole(*image);
            }
            let pair = std::iter::once(&contact.gap).chain(&contact.normal);
            let numbers = pair
                .chain([&contact.normal_force])
                .chain(&contact.tangential_force)
                .chain([&contact.normal_velocity])
                .chain(&contact.slip_velocity)
                .chain(&contact.rolling_force)
                .chain(&contact.rolling_velocity);
            for number in numbers {
                records.number(*number);
            }
            records.state(contact.state);
        }
        let vector = self.dimensions;
        let across = if vector == 2 { 1 } else { vector };
        records.array(
            py,
            &[
                ("i", "i8", 1),
                ("j", "i8", 1),
                ("image", "i8", vector),
                ("gap", "f8", 1),
                ("normal", "f8", vector),
                ("normal_force", "f8", 1),
                ("tangential_force", "f8", across),
                ("normal_velocity", "f8", 1),
                ("slip_velocity", "f8", across),
                ("rolling_force", "f8", across),
                ("rolling_velocity", "f8", across),
                ("state", "U12", 1),
            ],
        )
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let viscosity = match self.viscosity {
            Some(viscosity) => format!("viscosity={viscosity:?}"),
            None => "unbounded fluid".into(),
        };
        format!(
            "Solution({} spheres, {} candidate pairs, {viscosity})",
            self.stresslet_xy.bind(py).len(),
            self.contacts.len()
        )
    }
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
#[pyo3(signature = (
    centres, *, radii=None, cell=None, offset=None, cross_offset=None, hydrodynamics=None, background=None, forces=None, torques=None, contact=None, **more
), text_signature = "(centres, *, radii=None, cell=None, offset=None, cross_offset=None, hydrodynamics='stokesian-dynamics', background=None, forces=None, torques=None, contact=None, **more)")]
#[expect(
    clippy::too_many_arguments,
    reason = "keywords of Python, each with a default"
)]
pub(crate) fn solve(
    py: Python<'_>,
    centres: &Bound<'_, PyAny>,
    radii: Option<&Bound<'_, PyAny>>,
    cell: Option<&Bound<'_, PyAny>>,
    offset: Option<&Bound<'_, PyAny>>,
    cross_offset: Option<&Bound<'_, PyAny>>,
    hydrodynamics: Option<&Bound<'_, PyAny>>,
    background: Option<&Bound<'_, PyAny>>,
    forces: Option<&Bound<'_, PyAny>>,
    torques: Option<&Bound<'_, PyAny>>,
    contact: Option<&Bound<'_, PyAny>>,
    more: Option<&Bound<'_, PyDict>>,
) -> PyResult<Solution> {
    need_numpy(py)?;
    let mut written = more.map(values::table).transpose()?.unwrap_or_default();
    for (name, given) in [
        ("cell", cell),
        ("offset", offset),
        ("cross_offset", cross_offset),
        ("hydrodynamics", hydrodynamics),
        ("background", background),
        ("contact", contact),
    ] {
        if let Some(value) = given
            .map(|given| values::value(name, given))
            .transpose()?
            .flatten()
        {
            written.insert(name.into(), value);
        }
    }
    written
        .entry("hydrodynamics")
        .or_insert_with(|| "stokesian-dynamics".into());
    let given = Given {
        written,
        centres,
        radii,
        forces,
        torques,
    };
    if has_three_columns("centres", centres)? {
        solve_in::<Bulk>(py, given)
    } else {
        solve_in::<Layer>(py, given)
    }
}

/// The input of a configuration: values as in a file, and arrays.
struct Given<'g, 'py> {
    written: toml::Table,
    centres: &'g Bound<'py, PyAny>,
    radii: Option<&'g Bound<'py, PyAny>>,
    forces: Option<&'g Bound<'py, PyAny>>,
    torques: Option<&'g Bound<'py, PyAny>>,
}

/// A space whose configurations come as arrays.
pub(crate) trait Arrays: Written {
    /// Reads vectors.
    fn vectors(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Self::Components>>;

    /// Reads torques.
    fn spins(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Self::Turning>>;

    /// The components of a vector perpendicular to a line of centres.
    fn across(tangent: &Self::Tangent) -> Vec<f64>;
}

impl Arrays for Layer {
    fn vectors(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Components<2>>> {
        Ok(vectors(name, given)?.into_iter().map(Components).collect())
    }

    fn spins(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
        numbers(name, given)
    }

    fn across(tangent: &f64) -> Vec<f64> {
        vec![*tangent]
    }
}

impl Arrays for Bulk {
    fn vectors(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Components<3>>> {
        Ok(vectors(name, given)?.into_iter().map(Components).collect())
    }

    fn spins(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<Components<3>>> {
        <Self as Arrays>::vectors(name, given)
    }

    fn across(tangent: &Self::Tangent) -> Vec<f64> {
        tangent.as_slice().to_vec()
    }
}

fn solve_in<S: Arrays>(py: Python<'_>, given: Given<'_, '_>) -> PyResult<Solution>
where
    instant::Configuration<S>: Sync,
    instant::InstantContacts<S>: Sync,
    instant::SolvedConfiguration<S>: Send,
{
    let Given {
        mut written,
        centres,
        radii,
        forces,
        torques,
    } = given;
    // Read as arrays below.
    written.insert("centres".into(), toml::Value::Array(Vec::new()));
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
    let solved = solved.map_err(raise)?;
    let tensors: Vec<S::Tensor> = solved.stresslets.iter().map(S::tensor).collect();
    let column = |place: usize| of_numbers(py, tensors.iter().map(|s| s[place]));
    let suspended = |place: usize| (S::STRAINS > place).then(|| column(place));
    let moves = solved.disturbances.iter();
    let moves = moves.flat_map(|v| S::point(&S::translation(v)).as_ref().to_vec());
    let turns = solved.disturbances.iter();
    let turns = turns.flat_map(|v| S::turning(&S::rotation(v)));
    let turns: Vec<f64> = turns.collect();
    let stress = solved.stress.as_ref();
    Ok(Solution {
        velocity_disturbance: of_rows(py, moves.collect(), S::DIMENSIONS)?,
        angular_velocity_disturbance: match S::DIMENSIONS {
            2 => of_numbers(py, turns).into_any(),
            width => of_rows(py, turns, width)?.into_any(),
        },
        stresslet_xx: column(0),
        stresslet_yy: column(1),
        stresslet_xy: column(2),
        stresslet_xz: suspended(3),
        stresslet_yz: suspended(4),
        viscosity: stress.map(|s| s.viscosity),
        viscosity_stresslet: stress.map(|s| s.viscosity_stresslet),
        dissipation: stress.map(|s| s.dissipation),
        stress: stress.map(|s| s.components),
        computing_time_s,
        dimensions: S::DIMENSIONS,
        contacts: solved.contacts.iter().map(Touching::of).collect(),
    })
}

/// A candidate pair, its vectors as so many numbers as the space has.
struct Touching {
    spheres: [usize; 2],
    image: Vec<i64>,
    gap: f64,
    normal: Vec<f64>,
    normal_force: f64,
    tangential_force: Vec<f64>,
    normal_velocity: f64,
    slip_velocity: Vec<f64>,
    rolling_force: Vec<f64>,
    rolling_velocity: Vec<f64>,
    state: ContactState,
}

impl Touching {
    fn of<S: Arrays>(contact: &Contact<S>) -> Self {
        let pair = &contact.pair;
        Self {
            spheres: [pair.i, pair.j],
            image: (0..S::DIMENSIONS).map(|k| pair.image[k].into()).collect(),
            gap: pair.gap,
            normal: S::point(&pair.normal).as_ref().to_vec(),
            normal_force: contact.normal_force,
            tangential_force: S::across(&contact.tangential_force),
            normal_velocity: contact.normal_velocity,
            slip_velocity: S::across(&contact.slip_velocity),
            rolling_force: S::across(&contact.rolling_force),
            rolling_velocity: S::across(&contact.rolling_velocity),
            state: contact.state,
        }
    }
}

/// The exception for invalid keywords.
fn unreadable(error: &toml::de::Error) -> PyErr {
    let words = error.to_string();
    let words: Vec<&str> = words
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect();
    let words = words.join(" ");
    if error.message().starts_with("unknown field") {
        PyTypeError::new_err(words)
    } else {
        PyValueError::new_err(words)
    }
}
