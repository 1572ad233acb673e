//! A layer under shear, step by step.

use crate::arrays::{Records, need_numpy, of_numbers, of_pairs};
use crate::campaign::one_case;
use crate::errors::{SimulationError, raise};
use crate::instant::tables_of;
use crate::values;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBytes, PyDict, PyString};
use sd_core::simulation::{Flow, Frame};
use sd_core::{NearFields, Params, Sample, Simulation, start};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use sweep::axes::AXES;
use sweep::data::is_of_network;
use sweep::report::sample_fields;
use sweep::spaces::InSpace;
use sweep::store::Checkpoint;
use toml::Table;

/// A layer of rough spheres under shear.
///
/// All it shows belongs to the strain it has reached. Units: mean radius a, viscosity mu and shear rate are 1. A layer may be used by
/// several threads: each step is done by one of them, while the others compute on.
///
/// Parameters
/// ----------
/// params : dict
///     What a `[[grid]]` of a campaign file has, one value each: `area_fraction`, `roughness`, `friction`, `shear_rate`, `spheres`,
///     `hydrodynamics`, `contact`, `time_step`, ...
/// seed : int
///     Seed of the start layer. The same parameters and seed give the same bits as a run of a campaign.
#[pyclass(frozen, module = "sheared_layers")]
pub(crate) struct Layer {
    params: Params,
    /// What the dictionary it was made of says besides.
    besides: Table,
    seed: Option<u64>,
    tables: NearFields,
    run: Mutex<Run>,
    /// Steps done as of the arrays below.
    steps: AtomicU64,
    /// Seconds the steps took, as bits.
    computing_time_s: AtomicU64,
    centres: Py<PyArray2<f64>>,
    angles: Py<PyArray1<f64>>,
    /// What users see of these: the same memory, read only.
    positions: Py<PyAny>,
    orientations: Py<PyAny>,
}

/// What a layer is made of again.
type Made<'py> = (Bound<'py, PyDict>, Bound<'py, PyBytes>);

/// The run of a layer.
struct Run {
    layer: Simulation,
    /// The next step, done on a copy by whoever wanted to know what it measures.
    ahead: Option<Box<Ahead>>,
}

/// A step done in advance.
struct Ahead {
    layer: Simulation,
    sample: Sample,
    frame: Frame,
}

/// Where the spheres are after so many steps.
struct Place {
    steps: u64,
    centres: Vec<f64>,
    angles: Vec<f64>,
}

impl Run {
    /// Does a step.
    fn step(&mut self) -> Result<Sample, sd_core::Error> {
        match self.ahead.take() {
            Some(ahead) => {
                self.layer = ahead.layer;
                Ok(ahead.sample)
            }
            None => self.layer.step(),
        }
    }

    /// What the next step measures.
    fn look(&mut self, params: &Params, tables: &NearFields) -> Result<&Ahead, sd_core::Error> {
        let ahead = if let Some(ahead) = self.ahead.take() {
            ahead
        } else {
            // A run restored from a snapshot goes on with the same bits.
            let mut layer = Simulation::from_snapshot(params, self.layer.snapshot(), tables)?;
            let (sample, frame) = layer.step_with_frame()?;
            Box::new(Ahead {
                layer,
                sample,
                frame,
            })
        };
        Ok(self.ahead.insert(ahead))
    }

    fn place(&self) -> Place {
        let centres = self.layer.centres().iter();
        Place {
            steps: self.layer.steps(),
            centres: centres.flat_map(|x| [x.x, x.y]).collect(),
            angles: self.layer.orientations().to_vec(),
        }
    }
}

impl Layer {
    fn of(
        py: Python<'_>,
        (params, besides): (Params, Table),
        seed: Option<u64>,
        make: impl Send + FnOnce(&Params, &NearFields) -> Result<Simulation, sd_core::Error>,
    ) -> PyResult<Self> {
        need_numpy(py)?;
        let tables = if params.hydrodynamics.needs_tables() {
            tables_of(py, &start::radii_and_side(&params).map_err(raise)?.0)?
        } else {
            NearFields::default()
        };
        let layer = py.detach(|| make(&params, &tables)).map_err(raise)?;
        let run = Run { layer, ahead: None };
        let centres = of_pairs(py, run.layer.centres().iter().map(|x| [x.x, x.y]))?;
        let angles = of_numbers(py, run.layer.orientations().iter().copied());
        Ok(Self {
            steps: AtomicU64::new(run.layer.steps()),
            computing_time_s: AtomicU64::new(0.0_f64.to_bits()),
            positions: read_only(centres.bind(py))?,
            orientations: read_only(angles.bind(py))?,
            centres,
            angles,
            params,
            besides,
            seed,
            tables,
            run: Mutex::new(run),
        })
    }

    /// The run, for as long as the guard lives. Not to be asked for while attached to the interpreter: another thread may have it.
    fn run(&self) -> MutexGuard<'_, Run> {
        self.run.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes where the spheres are into the arrays, unless another thread has done more steps since.
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

    fn look<T: Send>(&self, py: Python<'_>, read: impl Send + FnOnce(&Ahead) -> T) -> PyResult<T> {
        py.detach(|| self.run().look(&self.params, &self.tables).map(read))
            .map_err(raise)
    }
}

#[pymethods]
impl Layer {
    #[new]
    fn new(py: Python<'_>, params: &Bound<'_, PyAny>, seed: &Bound<'_, PyAny>) -> PyResult<Self> {
        let seed = values::count("seed", seed)?;
        let params = one_case(&values::dict("params", params)?, seed)?;
        Self::of(py, params, Some(seed), |params, tables| {
            Simulation::<sd_core::Layer>::new(params, seed, tables)
        })
    }

    /// The layer that a snapshot was taken of; it goes on with the same bits.
    ///
    /// Parameters
    /// ----------
    /// params : dict
    ///     The same as of the layer that the snapshot was taken of.
    /// snapshot : bytes
    ///     What `snapshot()` gave.
    #[staticmethod]
    fn from_snapshot(
        py: Python<'_>,
        params: &Bound<'_, PyAny>,
        snapshot: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let params = one_case(&values::dict("params", params)?, 0)?;
        let checkpoint = Checkpoint::decode(&values::bytes("snapshot", snapshot)?)
            .map_err(|damage| PyValueError::new_err(format!("snapshot: {damage}")))?;
        let InSpace::Layer(of_layer) = checkpoint.snapshot else {
            return Err(PyValueError::new_err(
                "snapshot: of a suspension, and this is a layer",
            ));
        };
        Self::of(py, params, None, move |params, tables| {
            Simulation::from_snapshot(params, of_layer, tables)
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

    /// Parameters: a dict of all that mean something.
    #[getter]
    fn params<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        // A layer that was given is no value of a grid; a snapshot holds what has become of it.
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

    /// Seed of the start layer; None of a layer made from a snapshot.
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

    /// Seconds the steps themselves took, without what came before and after each.
    #[getter]
    fn computing_time_s(&self) -> f64 {
        f64::from_bits(self.computing_time_s.load(Ordering::Relaxed))
    }

    /// Side of the square cell.
    #[getter]
    fn side(&self, py: Python<'_>) -> f64 {
        py.detach(|| self.run().layer.side())
    }

    /// Radii: array [N].
    #[getter]
    fn radii(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        let radii = py.detach(|| self.run().layer.radii().to_vec());
        of_numbers(py, radii)
    }

    /// Centres: array [N, 2], the layer's own and never copied. It changes with every step and cannot be written to.
    #[getter]
    fn positions(&self, py: Python<'_>) -> Py<PyAny> {
        self.positions.clone_ref(py)
    }

    /// Orientations in radians: array [N], the layer's own, as `positions` is.
    #[getter]
    fn orientations(&self, py: Python<'_>) -> Py<PyAny> {
        self.orientations.clone_ref(py)
    }

    /// "flowing", or "jammed" once it stayed so for a strain of 0.1.
    #[getter]
    fn flow(&self, py: Python<'_>) -> &'static str {
        match py.detach(|| self.run().layer.flow()) {
            Flow::Flowing => "flowing",
            Flow::Jammed => "jammed",
        }
    }

    /// Do one step of `time_step`.
    ///
    /// Returns
    /// -------
    /// dict
    ///     What was measured in it: `strain`, `viscosity`, `n1`, `n2`, `particle_pressure`, the stresses by their causes such as
    ///     `shear_normal_contact`, `contacts`, ...: the columns of `Store.samples`.
    fn step<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let sample = self.one_step(py)?;
        dict_of(py, &sample)
    }

    /// Shear by a strain: as many steps as it takes.
    ///
    /// Ctrl-C stops it after the step under way; the layer keeps what was done.
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
                "strain: {strain} came: not negative, and a whole number of steps of {}",
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

    /// What the next step measures, as `step` gives it: of the layer as it is, or where rigid contacts bear forces half a step ahead. What it computes serves
    /// that step.
    fn sample<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let sample = self.look(py, |ahead| ahead.sample)?;
        dict_of(py, &sample)
    }

    /// The pairs in contact as the layer is now: structured array with i, j, normal [2], gap, normal_force, tangential_force, state
    /// ("frictionless", "rolling", "slipping").
    #[getter]
    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let contacts = self.look(py, |ahead| ahead.frame.contacts.clone())?;
        let mut records = Records::default();
        for contact in &contacts {
            records.sphere(contact.i);
            records.sphere(contact.j);
            for number in [
                contact.normal[0],
                contact.normal[1],
                contact.gap,
                contact.normal_force,
                contact.tangential_force,
            ] {
                records.number(number);
            }
            records.state(contact.state);
        }
        records.array(
            py,
            &[
                ("i", "i8", 1),
                ("j", "i8", 1),
                ("normal", "f8", 2),
                ("gap", "f8", 1),
                ("normal_force", "f8", 1),
                ("tangential_force", "f8", 1),
                ("state", "U12", 1),
            ],
        )
    }

    /// Stresslets as the layer is now: array [N, 3] of xx, yy, xy.
    #[getter]
    fn stresslets(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let flat = self.look(py, |ahead| ahead.frame.stresslets.concat())?;
        let n = flat.len() / 3;
        Ok(PyArray1::from_vec(py, flat).reshape([n, 3])?.unbind())
    }

    /// All that the next step needs, as bytes with a checksum, for `Layer.from_snapshot`.
    fn snapshot<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let checkpoint = Checkpoint {
            snapshot: InSpace::Layer(py.detach(|| self.run().layer.snapshot())),
            samples: Vec::new(),
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
        let layer = slf.get();
        Ok((make, (layer.params(py)?, layer.snapshot(py)?)))
    }

    fn __repr__(&self) -> String {
        let p = &self.params;
        format!(
            "Layer({} spheres, c = {}, strain {:.4})",
            p.spheres,
            p.area_fraction,
            self.strain()
        )
    }
}

/// A view of an array that cannot be written to.
fn read_only(array: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
    let view = array.call_method0("view")?;
    view.getattr("flags")?.setattr("writeable", false)?;
    Ok(view.unbind())
}

/// A sample by the names that the store has.
fn dict_of<'py>(py: Python<'py>, sample: &Sample) -> PyResult<Bound<'py, PyDict>> {
    /// The keys, made once: they are the same for every sample.
    static KEYS: PyOnceLock<Vec<Py<PyString>>> = PyOnceLock::new();
    let mut fields = sample_fields(sample);
    // A layer that is stepped by hand does not look at its network.
    fields.retain(|field| !is_of_network(field));
    let keys = KEYS.get_or_init(py, || {
        let names = fields.iter().map(|field| field.name);
        names.map(|name| PyString::new(py, name).unbind()).collect()
    });
    let dict = PyDict::new(py);
    for (key, field) in keys.iter().zip(fields) {
        dict.set_item(key, values::of_axis(py, field.value)?)?;
    }
    Ok(dict)
}
