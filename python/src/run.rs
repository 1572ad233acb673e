//! A layer or a suspension under shear, step by step.

use crate::arrays::{need_numpy, of_numbers, of_rows};
use crate::campaign::one_case;
use crate::errors::{SimulationError, raise};
use crate::instant::tables_of;
use crate::steps::{Place, RunIn, Stepped, Steps};
use crate::values;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBytes, PyDict, PyString};
use sd_core::simulation::{Flow, Frame};
use sd_core::{Bulk, Error, NearFields, Params, Sample, Simulation, Snapshot};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use sweep::measure::numbers::{Level, Number, columns};
use sweep::model::axes::AXES;
use sweep::store::Checkpoint;
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
    inner: Mutex<Box<dyn Steps>>,
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

impl Run {
    fn of<S: Stepped>(
        py: Python<'_>,
        (params, besides): (Params, Table),
        seed: Option<u64>,
        make: impl Send + FnOnce(&Params, &NearFields) -> Result<Simulation<S>, Error>,
    ) -> PyResult<Self>
    where
        Simulation<S>: Send,
        Frame<S>: Send,
    {
        need_numpy(py)?;
        S::check(&params).map_err(raise)?;
        let tables = if params.hydrodynamics.needs_tables() {
            tables_of(
                py,
                &sd_core::start::radii_and_side(&params).map_err(raise)?.0,
            )?
        } else {
            NearFields::default()
        };
        let run = py.detach(|| make(&params, &tables)).map_err(raise)?;
        let run: Box<dyn Steps> = Box::new(RunIn::from(run));
        let (place, [of_centre, of_orientation, ..]) = (run.place(), run.widths());
        let (centres, angles) = (of_numbers(py, place.centres), of_numbers(py, place.angles));
        Ok(Self {
            steps: AtomicU64::new(place.steps),
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
    fn begin<S: Stepped>(
        py: Python<'_>,
        params: &Bound<'_, PyAny>,
        seed: &Bound<'_, PyAny>,
    ) -> PyResult<Self>
    where
        Simulation<S>: Send,
        Frame<S>: Send,
    {
        let seed = values::count("seed", seed)?;
        let params = one_case(&values::dict("params", params)?, seed)?;
        Self::of(py, params, Some(seed), |params, tables| {
            Simulation::<S>::new(params, seed, tables)
        })
    }

    /// From a snapshot.
    fn restored<S: Stepped>(
        py: Python<'_>,
        params: &Bound<'_, PyAny>,
        snapshot: &Bound<'_, PyAny>,
    ) -> PyResult<Self>
    where
        Simulation<S>: Send,
        Snapshot<S>: Send,
        Frame<S>: Send,
    {
        let params = one_case(&values::dict("params", params)?, 0)?;
        let checkpoint = Checkpoint::decode(&values::bytes("snapshot", snapshot)?)
            .map_err(|damage| PyValueError::new_err(format!("snapshot: {damage}")))?;
        let snapshot = S::unwrapped(checkpoint.snapshot).map_err(PyValueError::new_err)?;
        Self::of(py, params, None, move |params, tables| {
            Simulation::from_snapshot(params, snapshot, tables)
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
    fn run(&self) -> MutexGuard<'_, Box<dyn Steps>> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes the positions into the arrays, unless another thread has made more steps since.
    fn show(&self, py: Python<'_>, place: &Place) -> PyResult<()> {
        if place.steps <= self.steps.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.steps.store(place.steps, Ordering::Relaxed);
        let centres = self.centres.bind(py);
        (centres.try_readwrite()?.as_slice_mut()?).copy_from_slice(&place.centres);
        let angles = self.angles.bind(py);
        (angles.try_readwrite()?.as_slice_mut()?).copy_from_slice(&place.angles);
        Ok(())
    }

    /// Velocities and angular velocities, and numbers of components.
    fn motion(&self, py: Python<'_>) -> PyResult<([Vec<f64>; 2], [usize; 4])> {
        let (motion, widths) = py.detach(|| {
            let mut run = self.run();
            (run.motion(&self.params, &self.tables), run.widths())
        });
        Ok((motion.map_err(raise)?, widths))
    }

    fn one_step(&self, py: Python<'_>) -> PyResult<Sample> {
        let (sample, place, took) = py.detach(|| {
            let mut run = self.run();
            let begun = Instant::now();
            let sample = run.step();
            (sample, run.place(), begun.elapsed().as_secs_f64())
        });
        // Written by threads that are attached to the interpreter, one at a time.
        let so_far = self.computing_time_s();
        (self.computing_time_s).store((so_far + took).to_bits(), Ordering::Relaxed);
        let sample = sample.map_err(raise)?;
        self.show(py, &place)?;
        Ok(sample)
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
                params: &Bound<'_, PyAny>,
                seed: &Bound<'_, PyAny>,
            ) -> PyResult<PyClassInitializer<Self>> {
                let run = Run::begin::<$space>(py, params, seed)?;
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
                params: &Bound<'_, PyAny>,
                snapshot: &Bound<'_, PyAny>,
            ) -> PyResult<Py<Self>> {
                let run = Run::restored::<$space>(py, params, snapshot)?;
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

    /// Side of the square or cubic cell.
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
    fn step<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let sample = self.one_step(py)?;
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
    #[pyo3(signature = (strain, *, every=None), text_signature = "($self, strain, *, every=1)")]
    fn shear<'py>(
        &self,
        py: Python<'py>,
        strain: &Bound<'py, PyAny>,
        every: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let (strain, every) = (values::number("strain", strain)?, values::stride(every)?);
        let steps = (strain / self.params.time_step).round();
        let off = (strain - steps * self.params.time_step).abs() > 1e-6 * self.params.time_step;
        if !(0.0..=1e9).contains(&steps) || off {
            return Err(PyValueError::new_err(format!(
                "strain must be a non-negative multiple of the time step {}, got {strain}",
                self.params.time_step
            )));
        }
        let mut samples = Vec::new();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "checked above"
        )]
        let steps = steps as usize;
        for step in 0..steps {
            let sample = self.one_step(py)?;
            if step % every == 0 {
                samples.push(dict_of(py, &sample)?);
            }
            py.check_signals()?;
        }
        Ok(samples)
    }

    /// Measurements of the next step, as from `step`: at the present positions, or with loaded
    /// rigid contacts half a step ahead. The computation is reused for that step.
    fn sample<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let sample = py.detach(|| self.run().sample(&self.params, &self.tables));
        dict_of(py, &sample.map_err(raise)?)
    }

    /// The present pairs in contact: structured array with i, j, normal [2], gap, normal_force,
    /// tangential_force, state ("frictionless", "rolling", "slipping"); normal and tangential_force
    /// of a suspension are vectors [3].
    #[getter]
    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (contacts, [dimensions, ..]) = py.detach(|| {
            let mut run = self.run();
            (run.contacts(&self.params, &self.tables), run.widths())
        });
        let helper = py.import("sheared_layers._solution")?;
        helper.call_method1("touching", (contacts.map_err(raise)?, dimensions))
    }

    /// Present stresslets: array [N, 3] of xx, yy, xy; of a suspension [N, 5], and xz, yz.
    #[getter]
    fn stresslets(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let (flat, [_, _, of_stresslet, _]) = py.detach(|| {
            let mut run = self.run();
            (run.stresslets(&self.params, &self.tables), run.widths())
        });
        of_rows(py, flat.map_err(raise)?, of_stresslet)
    }

    /// Present velocities at the centres, background flow included: array [N, 2], of a suspension
    /// [N, 3].
    #[getter]
    fn velocities(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let ([flat, _], [dimensions, ..]) = self.motion(py)?;
        of_rows(py, flat, dimensions)
    }

    /// Present angular velocities, background flow included: array [N], of a suspension [N, 3].
    #[getter]
    fn angular_velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let ([_, flat], [dimensions, ..]) = self.motion(py)?;
        Ok(if dimensions == 2 {
            of_numbers(py, flat).into_bound(py).into_any()
        } else {
            of_rows(py, flat, dimensions)?.into_bound(py).into_any()
        })
    }

    /// Centres followed from the start of the run over the edges of the cell: array [N, 2], of a
    /// suspension [N, 3]. Differences in time are displacements, those of the flow included.
    #[getter]
    fn unwrapped_positions(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let (flat, [dimensions, ..]) = py.detach(|| {
            let run = self.run();
            (run.unwrapped(), run.widths())
        });
        of_rows(py, flat, dimensions)
    }

    /// Lattice vectors of the periodic cell, one a row: array [2, 2], of a suspension [3, 3].
    #[getter]
    fn lattice(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let (flat, [dimensions, ..]) = py.detach(|| {
            let run = self.run();
            (run.lattice(), run.widths())
        });
        of_rows(py, flat.map_err(raise)?, dimensions)
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
    /// The keys, made once: they are the same for every sample.
    static KEYS: PyOnceLock<Vec<Py<PyString>>> = PyOnceLock::new();
    // Manual steps do not record the contact network.
    let numbers = || columns(Level::Samples).filter(|number: &&Number| !number.is_observed());
    let keys = KEYS.get_or_init(py, || {
        let names = numbers().map(|number| number.name);
        names.map(|name| PyString::new(py, name).unbind()).collect()
    });
    let dict = PyDict::new(py);
    for (key, number) in keys.iter().zip(numbers()) {
        dict.set_item(key, values::of_axis(py, number.of_sample(sample))?)?;
    }
    Ok(dict)
}
