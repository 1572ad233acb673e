//! A layer or a suspension under shear, step by step.

use crate::arrays::{need_numpy, of_numbers, of_rows};
use crate::campaign::one_case;
use crate::errors::{SimulationError, raise};
use crate::instant::tables_of;
use crate::steps::{self, Place, Steps};
use crate::values;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use sd_core::simulation::Flow;
use sd_core::{Bulk, Error, NearFields, Params, RunSpace, Sample};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use sweep::data::Value;
use sweep::measure::numbers::{Level, columns};
use sweep::model::axes::AXES;
use sweep::model::spaces::{AnyFrame, AnySimulation, InSpace};
use sweep::store::Checkpoint;
use sweep::text::format::count;
use toml::Table;

/// Base of `Layer` and `Suspension`: rough spheres under shear, step by step.
///
/// All values are those at the current strain. Units: mean radius a, viscosity mu and shear rate
/// are 1. A run may be used by several threads: each step is made by one of them, while the others
/// continue.
#[pyclass(frozen, subclass, module = "sheared_layers")]
pub(crate) struct Run {
    params: Params,
    /// Further values of its dictionary.
    besides: Table,
    seed: Option<u64>,
    tables: NearFields,
    inner: Mutex<Steps>,
    /// Steps done as of the arrays below.
    steps: AtomicU64,
    /// Seconds the steps took, as bits.
    computing_time_s: AtomicU64,
    centres: Py<PyArray1<f64>>,
    angles: Py<PyArray1<f64>>,
    /// Read-only views of these for users.
    positions: Py<PyAny>,
    orientations: Py<PyAny>,
}

/// A layer of rough spheres under shear.
///
/// Parameters
/// ----------
/// params : dict
///     Keys of a `[[grid]]` of a campaign file, one value each: `area_fraction`, `roughness`,
///     `friction`, `shear_rate`, `spheres`, `hydrodynamics`, `contact`, `time_step`, ...
/// seed : int
///     Seed of the start layer. The same parameters and seed give the same bits as a run of a
///     campaign.
#[pyclass(frozen, extends = Run, module = "sheared_layers")]
pub(crate) struct Layer;

/// A suspension of rough spheres under shear: flow along x, its gradient along y, in a cubic cell.
///
/// Parameters
/// ----------
/// params : dict
///     As for a `Layer`, with `volume_fraction` in place of `area_fraction`.
/// seed : int
///     Seed of the start. The same parameters and seed give the same bits as a run of a campaign.
#[pyclass(frozen, extends = Run, module = "sheared_layers")]
pub(crate) struct Suspension;

/// The data to restore a run.
type Made<'py> = (Bound<'py, PyDict>, Bound<'py, PyBytes>);

/// The check of parameters of a class.
type Check = fn(&Params) -> Result<(), Error>;

fn check<S: RunSpace>(params: &Params) -> Result<(), Error> {
    S::check(params)
}

impl Run {
    fn of(
        py: Python<'_>,
        (params, besides): (Params, Table),
        seed: Option<u64>,
        make: impl Send + FnOnce(&Params, &NearFields) -> Result<AnySimulation, Error>,
    ) -> PyResult<Self> {
        need_numpy(py)?;
        let tables = if params.hydrodynamics.needs_tables() {
            let (radii, _) = sd_core::start::radii_and_side(&params).map_err(raise)?;
            tables_of(py, &radii)?
        } else {
            NearFields::default()
        };
        let run = py.detach(|| make(&params, &tables)).map_err(raise)?;
        let run = Steps::from(run);
        let (steps, places) = run.place();
        let [centres, angles] = places.map(|numbers| of_numbers(py, numbers));
        let [of_centre, of_orientation, _] = widths(&params);
        Ok(Self {
            steps: AtomicU64::new(steps),
            computing_time_s: AtomicU64::new(0.0_f64.to_bits()),
            positions: read_only(centres.bind(py), of_centre)?,
            orientations: read_only(angles.bind(py), of_orientation)?,
            centres,
            angles,
            params,
            besides,
            seed,
            tables,
            inner: Mutex::new(run),
        })
    }

    /// From parameters and a seed.
    fn begin(
        py: Python<'_>,
        check: Check,
        params: &Bound<'_, PyDict>,
        seed: u64,
    ) -> PyResult<Self> {
        let params = one_case(params, seed)?;
        check(&params.0).map_err(raise)?;
        Self::of(py, params, Some(seed), |params, tables| {
            AnySimulation::new(params, seed, tables)
        })
    }

    /// From a snapshot.
    fn restored(
        py: Python<'_>,
        check: Check,
        params: &Bound<'_, PyDict>,
        snapshot: &[u8],
    ) -> PyResult<Self> {
        let params = one_case(params, 0)?;
        check(&params.0).map_err(raise)?;
        let refused = |words: String| PyValueError::new_err(format!("snapshot: {words}"));
        let checkpoint =
            Checkpoint::decode(snapshot).map_err(|damage| refused(damage.to_string()))?;
        let (own, other) = match checkpoint.snapshot {
            InSpace::Layer(_) => ("layer", "suspension"),
            InSpace::Suspension(_) => ("suspension", "layer"),
        };
        if (own == "layer") != params.0.volume_fraction.is_none() {
            return Err(refused(format!("of a {own}, and this is a {other}")));
        }
        Self::of(py, params, None, |params, tables| {
            AnySimulation::from_snapshot(params, checkpoint.snapshot, tables)
        })
        .map_err(|error| {
            // A snapshot that does not fit is a bad argument.
            if error.is_instance_of::<SimulationError>(py) {
                PyValueError::new_err(error.value(py).to_string())
            } else {
                error
            }
        })
    }

    /// The run, for as long as the guard lives. Never acquire it while attached to the interpreter:
    /// another thread may hold it.
    fn run(&self) -> MutexGuard<'_, Steps> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes the positions into the arrays, unless another thread has made more steps since.
    fn show(&self, py: Python<'_>, (steps, places): &Place) -> PyResult<()> {
        if *steps <= self.steps.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.steps.store(*steps, Ordering::Relaxed);
        for (array, place) in [&self.centres, &self.angles].into_iter().zip(places) {
            let mut array = array.bind(py).try_readwrite()?;
            array.as_slice_mut()?.copy_from_slice(place);
        }
        Ok(())
    }

    /// What the frame of the next step shows.
    fn of_next<T: Send>(
        &self,
        py: Python<'_>,
        of: impl Send + FnOnce(Sample, &AnyFrame) -> T,
    ) -> PyResult<T> {
        let found = py.detach(|| {
            let mut run = self.run();
            let (sample, frame) = run.look(&self.params, &self.tables)?;
            Ok(of(sample, frame))
        });
        found.map_err(|error: Error| raise(error))
    }

    /// Makes one step.
    fn one_step<T: Send>(
        &self,
        py: Python<'_>,
        step: impl Send + FnOnce(&mut Steps) -> Result<T, Error>,
    ) -> PyResult<T> {
        let (made, place, took) = py.detach(|| {
            let mut run = self.run();
            let begun = Instant::now();
            let made = step(&mut run);
            (made, run.place(), begun.elapsed().as_secs_f64())
        });
        // Written by threads that are attached to the interpreter, one at a time.
        let so_far = self.computing_time_s();
        (self.computing_time_s).store((so_far + took).to_bits(), Ordering::Relaxed);
        let made = made.map_err(raise)?;
        self.show(py, &place)?;
        Ok(made)
    }
}

/// The constructors of a class, whose runs are in a space and of such things.
macro_rules! constructors {
    ($class:ident, $space:ty, $thing:literal) => {
        #[pymethods]
        impl $class {
            #[new]
            fn new(
                py: Python<'_>,
                params: &Bound<'_, PyDict>,
                seed: u64,
            ) -> PyResult<PyClassInitializer<Self>> {
                let run = Run::begin(py, check::<$space>, params, seed)?;
                Ok(PyClassInitializer::from(run).add_subclass(Self))
            }

            #[doc = concat!("The ", $thing, " of a snapshot; it continues with the same bits.")]
            ///
            /// Parameters
            /// ----------
            /// params : dict
            #[doc = concat!("    The same as of the ", $thing, " that the snapshot was taken of.")]
            /// snapshot : bytes
            ///     Result of `snapshot()`.
            #[staticmethod]
            fn from_snapshot(
                py: Python<'_>,
                params: &Bound<'_, PyDict>,
                snapshot: &[u8],
            ) -> PyResult<Py<Self>> {
                let run = Run::restored(py, check::<$space>, params, snapshot)?;
                Py::new(py, PyClassInitializer::from(run).add_subclass(Self))
            }
        }
    };
}

constructors!(Layer, sd_core::Layer, "layer");
constructors!(Suspension, Bulk, "suspension");

#[pymethods]
impl Run {
    /// Parameters: a dict of all that have an effect.
    #[getter]
    fn params<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        // A given start layer is not a value of a grid; a snapshot holds its present state.
        for axis in AXES
            .iter()
            .filter(|axis| axis.key != "start" && axis.means_something(&self.params))
        {
            all.set_item(axis.key, values::of_axis(py, axis.value(&self.params))?)?;
        }
        for (key, value) in &self.besides {
            all.set_item(key, values::answer(py, value)?)?;
        }
        Ok(all)
    }

    /// Seed of the start; None of a run made from a snapshot.
    #[getter]
    fn seed(&self) -> Option<u64> {
        self.seed
    }

    /// Steps done.
    #[getter]
    fn steps(&self) -> u64 {
        self.steps.load(Ordering::Relaxed)
    }

    /// Strain reached.
    #[getter]
    fn strain(&self) -> f64 {
        self.steps() as f64 * self.params.time_step
    }

    /// Seconds of the steps themselves, without conversions.
    #[getter]
    fn computing_time_s(&self) -> f64 {
        f64::from_bits(self.computing_time_s.load(Ordering::Relaxed))
    }

    /// Side of the square or cubic cell, or of one with the content of the lattice.
    #[getter]
    fn side(&self, py: Python<'_>) -> f64 {
        py.detach(|| self.run().side())
    }

    /// Radii: array [N].
    #[getter]
    fn radii(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        let radii = py.detach(|| self.run().radii().to_vec());
        of_numbers(py, radii)
    }

    /// Centres: array [N, 2], of a suspension [N, 3], the run's own and never copied. It changes
    /// with every step and cannot be written to.
    #[getter]
    fn positions(&self, py: Python<'_>) -> Py<PyAny> {
        self.positions.clone_ref(py)
    }

    /// Orientations in radians: array [N]; of a suspension quaternions, the real part first: array
    /// [N, 4]. The run's own, as `positions` is.
    #[getter]
    fn orientations(&self, py: Python<'_>) -> Py<PyAny> {
        self.orientations.clone_ref(py)
    }

    /// "flowing", or "jammed" once it stayed so for a strain of 0.1.
    #[getter]
    fn flow(&self, py: Python<'_>) -> &'static str {
        match py.detach(|| self.run().flow()) {
            Flow::Flowing => "flowing",
            Flow::Jammed => "jammed",
        }
    }

    /// Do one step of `time_step`.
    ///
    /// Returns
    /// -------
    /// dict
    ///     Measurements: `strain`, `viscosity`, `n1`, `n2`, `particle_pressure`, the stresses by
    ///     cause such as `shear_normal_contact`, `contacts`, ...: the columns of `Store.samples`.
    ///     `fraction` is among them under an imposed pressure, `pressure_hydrodynamic` without
    ///     Brownian motion.
    fn step<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let sample = self.one_step(py, Steps::step)?;
        dict_of(py, &sample)
    }

    /// Shear by a strain.
    ///
    /// Ctrl-C stops it after the current step; the run keeps its steps.
    ///
    /// Parameters
    /// ----------
    /// strain : float
    ///     A whole number of steps.
    /// every : int
    ///     Steps from one sample to the next.
    ///
    /// Returns
    /// -------
    /// list of dict
    ///     Samples, as `step` gives them.
    #[pyo3(signature = (strain, *, every=1))]
    fn shear<'py>(
        &self,
        py: Python<'py>,
        strain: f64,
        every: usize,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let every = values::stride(every)?;
        let steps = (strain / self.params.time_step).round();
        let off = (strain - steps * self.params.time_step).abs() > 1e-6 * self.params.time_step;
        if !(0.0..=1e9).contains(&steps) || off {
            return Err(PyValueError::new_err(format!(
                "strain must be a non-negative multiple of the time step {}, got {strain}",
                self.params.time_step
            )));
        }
        let mut samples = Vec::new();
        for step in 0..count(steps) {
            if step % every == 0 {
                let sample = self.one_step(py, Steps::step)?;
                samples.push(dict_of(py, &sample)?);
            } else {
                self.one_step(py, Steps::step_unmeasured)?;
            }
            py.check_signals()?;
        }
        Ok(samples)
    }

    /// Measurements of the next step, as from `step`: at the present positions, or with loaded
    /// rigid contacts half a step ahead. The computation is reused for that step.
    fn sample<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        dict_of(py, &self.of_next(py, |sample, _| sample)?)
    }

    /// The present pairs in contact: structured array with i, j, normal [2], gap, normal_force,
    /// tangential_force, state ("frictionless", "rolling", "slipping"); normal and tangential_force
    /// of a suspension are vectors [3].
    #[getter]
    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let contacts = self.of_next(py, |_, frame| steps::contacts(frame))?;
        let helper = py.import("sheared_layers._solution")?;
        helper.call_method1("touching", (contacts, widths(&self.params)[0]))
    }

    /// Present stresslets: array [N, 3] of xx, yy, xy; of a suspension [N, 5], and xz, yz.
    #[getter]
    fn stresslets(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let flat = self.of_next(py, |_, frame| steps::stresslets(frame))?;
        of_rows(py, flat, widths(&self.params)[2])
    }

    /// Present velocities at the centres, background flow included: array [N, 2], of a suspension
    /// [N, 3].
    #[getter]
    fn velocities(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let [flat, _] = self.of_next(py, |_, frame| steps::motion(frame))?;
        of_rows(py, flat, widths(&self.params)[0])
    }

    /// Present angular velocities, background flow included: array [N], of a suspension [N, 3].
    #[getter]
    fn angular_velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let [_, flat] = self.of_next(py, |_, frame| steps::motion(frame))?;
        Ok(match widths(&self.params)[0] {
            2 => of_numbers(py, flat).into_bound(py).into_any(),
            width => of_rows(py, flat, width)?.into_bound(py).into_any(),
        })
    }

    /// Centres followed from the start of the run over the edges of the cell: array [N, 2], of a
    /// suspension [N, 3]. Differences in time are displacements, those of the flow included.
    #[getter]
    fn unwrapped_positions(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let flat = py.detach(|| self.run().unwrapped());
        of_rows(py, flat, widths(&self.params)[0])
    }

    /// Lattice vectors of the periodic cell, one a row: array [2, 2], of a suspension [3, 3].
    #[getter]
    fn lattice(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let flat = py.detach(|| self.run().lattice()).map_err(raise)?;
        of_rows(py, flat, widths(&self.params)[0])
    }

    /// The state of the run, as bytes with a checksum, for `from_snapshot`.
    fn snapshot<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let checkpoint = Checkpoint {
            snapshot: py.detach(|| self.run().snapshot()),
            samples_digest: None,
            wall_time_s: 0.0,
            cpu_time_s: 0.0,
            resumed: 0,
        };
        let bytes = checkpoint
            .encode()
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// For pickle and copy.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Made<'py>)> {
        let py = slf.py();
        let make = slf.get_type().getattr("from_snapshot")?;
        let run = slf.get();
        Ok((make, (run.params(py)?, run.snapshot(py)?)))
    }

    fn __repr__(&self) -> String {
        let (p, strain) = (&self.params, self.strain());
        match p.volume_fraction {
            Some(phi) => format!(
                "Suspension({} spheres, φ = {phi}, strain {strain:.4})",
                p.spheres
            ),
            None => format!(
                "Layer({} spheres, c = {}, strain {strain:.4})",
                p.spheres, p.area_fraction
            ),
        }
    }
}

/// Numbers of components of a centre, an orientation and a stresslet.
fn widths(params: &Params) -> [usize; 3] {
    match params.volume_fraction {
        None => [2, 1, 3],
        Some(_) => [3, 4, 5],
    }
}

/// A read-only view of an array with rows of this length.
fn read_only(array: &Bound<'_, PyArray1<f64>>, width: usize) -> PyResult<Py<PyAny>> {
    let view = if width == 1 {
        array.call_method0("view")?
    } else {
        array.call_method1("reshape", ((-1, width),))?
    };
    view.getattr("flags")?.setattr("writeable", false)?;
    Ok(view.unbind())
}

/// A sample by the names of the store.
fn dict_of<'py>(py: Python<'py>, sample: &Sample) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    // Manual steps do not record the contact network.
    for number in columns(Level::Samples).filter(|number| !number.is_observed()) {
        let value = number.of_sample(sample);
        let is_absent = matches!(value, Value::Number(x) if x.is_nan());
        if !(is_absent && number.is_optional()) {
            dict.set_item(number.name, values::of_axis(py, value)?)?;
        }
    }
    Ok(dict)
}
