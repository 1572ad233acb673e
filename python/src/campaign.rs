//! Campaigns: read, planned, run.

use crate::errors::{raise, raise_without_place};
use crate::store::Store;
use crate::two_spheres::LOOK;
use crate::values;
use pyo3::exceptions::{PyRuntimeWarning, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sd_core::Params;
use std::ffi::CString;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;
use sweep::model::axes::Axis;
use sweep::runner::{
    Options, Progress, Reason, StartOptions, StartedCampaign, Stop, Style, begin, complete,
};
use sweep::store::StoreSource;
use sweep::system::disk::network_file_system;
use sweep::text::format::parse_positive_duration;
use toml::{Table, Value};

/// Maximum number of threads; more are treated as a typo.
const WORKER_LIMIT: usize = 4096;
/// SIGINT, which Ctrl-C sends.
const INTERRUPT: i32 = 2;

/// A campaign: a grid of layers, each sheared with several seeds.
///
/// Parameters
/// ----------
/// name : str
///     a-z, 0-9 and -; also the name of the store.
/// protocol : dict, optional
///     What `[protocol]` of a campaign file has: `strain`, `discard`, `sample_every`,
///     `checkpoint_every`, `time_step`.
/// grid : list of dict, optional
///     What each `[[grid]]` has. In place of it the axes of a single one may be keywords:
///     ``friction=[0.1, 0.5], seeds=4, ...``
#[pyclass(frozen, module = "sheared_layers")]
pub(crate) struct Campaign(sweep::model::campaign::Campaign);

/// The parameters of the run of a dictionary, read like the grid of a campaign file, and its other
/// values.
pub(crate) fn one_case(params: &Bound<'_, PyDict>, seed: u64) -> PyResult<(Params, Table)> {
    let mut grid = values::table(params)?;
    let mut besides = grid.clone();
    besides.retain(|key, _| Axis::of_key(key).is_none());
    if grid.contains_key("seeds") {
        return Err(PyTypeError::new_err(
            "params must not have `seeds`: the seed of a run is an argument of its own",
        ));
    }
    if let Some((key, _)) = grid.iter().find(|(_, value)| value.is_array()) {
        return Err(PyValueError::new_err(format!(
            "params: `{key}` has several values: a run has one; several are a campaign"
        )));
    }
    let mut protocol = Table::new();
    if let Some(step) = grid.get("time_step").and_then(Value::as_float)
        && step > 0.0
        && step <= 1.0
    {
        // Lengths that any time step divides; nothing of them concerns a layer that is sheared by
        // hand.
        for key in ["strain", "sample_every", "checkpoint_every"] {
            protocol.insert(key.into(), step.into());
        }
        protocol.insert("discard".into(), 0.0.into());
    }
    let seed = i64::try_from(seed)
        .map_err(|_| PyValueError::new_err(format!("seed must be below 2^63, got {seed}")))?;
    grid.insert("seeds".into(), vec![seed].into());
    let text = text_of("layer", protocol, vec![Value::Table(grid)])?;
    let mut campaign = sweep::campaign::parse("params", text).map_err(raise_without_place)?;
    let case = campaign.cases.pop();
    let none = || PyValueError::new_err("params must describe one run");
    Ok((case.ok_or_else(none)?.1.params, besides))
}

/// The text of a campaign file.
fn text_of(name: &str, protocol: Table, grid: Vec<Value>) -> PyResult<String> {
    let mut file = Table::new();
    file.insert("name".into(), name.into());
    if !protocol.is_empty() {
        file.insert("protocol".into(), protocol.into());
    }
    file.insert("grid".into(), grid.into());
    toml::to_string(&file).map_err(|error| PyValueError::new_err(error.to_string()))
}

#[pymethods]
impl Campaign {
    #[new]
    #[pyo3(signature = (name, *, protocol=None, grid=None, **axes))]
    fn new(
        name: &str,
        protocol: Option<&Bound<'_, PyDict>>,
        grid: Option<&Bound<'_, PyAny>>,
        axes: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let grids = match (grid, axes) {
            (None, Some(axes)) => vec![Value::Table(values::table(axes)?)],
            (None, None) => Vec::new(),
            (Some(grid), None) => match values::value("grid", grid)? {
                Some(Value::Array(grids)) => grids,
                other => other.into_iter().collect(),
            },
            (Some(_), Some(axes)) => {
                return Err(PyTypeError::new_err(format!(
                    "{} beside `grid`: axes are keywords, or `grid` has them all",
                    axes.keys()
                )));
            }
        };
        let protocol = protocol.map(values::table).transpose()?.unwrap_or_default();
        let text = text_of(name, protocol, grids)?;
        let mut campaign = sweep::campaign::parse("campaign", text).map_err(raise_without_place)?;
        campaign.file = std::path::absolute(format!("{name}.toml"))?;
        Ok(Self(campaign))
    }

    /// The campaign of a file.
    ///
    /// Parameters
    /// ----------
    /// path : str or path
    #[staticmethod]
    #[expect(clippy::needless_pass_by_value, reason = "an argument of Python")]
    fn from_toml(path: PathBuf) -> PyResult<Self> {
        sweep::campaign::read(&path).map(Self).map_err(raise)
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// The text of its file. Written to NAME.toml, it is the same campaign for the command line.
    #[getter]
    fn text(&self) -> &str {
        &self.0.text
    }

    /// Default path of its store.
    #[getter]
    fn default_store(&self) -> PathBuf {
        self.0.default_store()
    }

    /// Number of runs.
    fn __len__(&self) -> usize {
        self.0.cases.len()
    }

    /// Its plan: axes, number of runs, time on this machine, disk, memory. Writes nothing; takes a
    /// second or two.
    ///
    /// Parameters
    /// ----------
    /// workers : int, optional
    ///     Runs computed in parallel; by default the cores of the machine.
    ///
    /// Returns
    /// -------
    /// dict
    ///     As `sweep plan --json` has it.
    #[pyo3(signature = (*, workers=None))]
    fn plan<'py>(&self, py: Python<'py>, workers: Option<usize>) -> PyResult<Bound<'py, PyAny>> {
        let workers = threads(workers)?;
        let plan = py
            .detach(|| sweep::plan::plan(&self.0, workers, false, None))
            .map_err(raise)?;
        values::answer(py, &plan)
    }

    /// Compute its open runs. Finished runs in the store are not computed again.
    ///
    /// Ctrl-C checkpoints after the current steps; the same call continues with the same bits. The
    /// command line, or another notebook, may compute or read the same store at the same time.
    ///
    /// Parameters
    /// ----------
    /// store : str or path, optional
    ///     The store; `default_store`.
    /// workers : int, optional
    ///     Runs computed in parallel; by default the cores of the machine.
    /// progress : bool or callable
    ///     True shows a bar, in a notebook or a terminal; a callable is called with the fraction
    ///     done, 0 to 1, and a text.
    /// retry_failed : bool
    ///     Compute failed runs again.
    /// trajectory : bool
    ///     Keep a frame at every sampled strain of every run, for `Store.frames`; runs begun or
    ///     finished without them are computed again.
    /// time_limit : float or str, optional
    ///     Seconds, or a text such as "15m" or "2h", after which all is checkpointed; the same call
    ///     continues.
    /// max_wall_time : float or str, optional
    ///     Computing time after which a single run ends as failed; 50 times its estimate.
    ///
    /// Returns
    /// -------
    /// Store
    #[pyo3(signature = (
        store=None, *, workers=None, progress=None, retry_failed=false, trajectory=false, time_limit=None, max_wall_time=None
    ))]
    #[expect(
        clippy::too_many_arguments,
        reason = "keywords of Python, each with a default"
    )]
    fn run(
        &self,
        py: Python<'_>,
        store: Option<PathBuf>,
        workers: Option<usize>,
        progress: Option<&Bound<'_, PyAny>>,
        retry_failed: bool,
        trajectory: bool,
        time_limit: Option<&Bound<'_, PyAny>>,
        max_wall_time: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Store> {
        let path = self.place(store)?;
        let threads = threads(workers)?;
        let stop = Stop::by_hand();
        if let Some(limit) = time("time_limit", time_limit)? {
            stop.after(limit);
        }
        let wall_limit = time("max_wall_time", max_wall_time)?;
        if let Some(network) = network_file_system(&path) {
            let words = format!(
                "{} is on a network file system ({network}), where several machines cannot safely share a store: run it from one machine \
                 only, or choose a local disk",
                path.display()
            );
            warn(py, &words)?;
        }
        let bar = py.import("sheared_layers._progress")?;
        let bar = bar.call_method1("bar", (progress,))?.unbind();
        let workers = threads.min(self.0.cases.len().max(1));
        let progress = Progress::new(Style::Quiet, workers, Box::new(std::io::sink()));
        let work = || -> Result<Vec<String>, sweep::Error> {
            let options = StartOptions {
                retry_failed,
                trajectory,
            };
            let StartedCampaign { mut store, .. } = begin(&path, &self.0, options)?;
            let mut notes: Vec<String> = store.warning().map(str::to_owned).into_iter().collect();
            let options = Options {
                workers,
                threads,
                wall_limit,
                observer: None,
                stop: &stop,
                progress: &progress,
            };
            let counts = complete(&mut store, &self.0, options)?;
            let left = counts.pending + counts.running;
            if left > 0 && matches!(stop.reason(), Some(Reason::TimeLimit)) {
                notes.push(format!(
                    "time limit reached: {left} runs remain; the same call continues them"
                ));
            }
            Ok(notes)
        };
        let notes = attended(py, work, &stop, &progress, &bar);
        let done = Store::of(StoreSource::new(path.clone(), Some(self.0.clone())));
        if notes.is_ok() {
            bar.call_method1(py, "update", (1.0, progress.standing().message))?;
        }
        bar.call_method0(py, "close")?;
        for words in notes?.into_iter().chain(done.failures()?) {
            warn(py, &words)?;
        }
        Ok(done)
    }

    /// Its store, which shows the runs of this campaign, done or not.
    ///
    /// Parameters
    /// ----------
    /// path : str or path, optional
    ///     The store; `default_store`.
    #[pyo3(signature = (path=None))]
    fn store(&self, path: Option<PathBuf>) -> PyResult<Store> {
        Store::opened(StoreSource::new(self.place(path)?, Some(self.0.clone())))
    }

    fn __repr__(&self) -> String {
        format!("Campaign({:?}, {} runs)", self.0.name, self.0.cases.len())
    }
}

impl Campaign {
    fn place(&self, store: Option<PathBuf>) -> PyResult<PathBuf> {
        let store = store.unwrap_or_else(|| self.0.default_store());
        Ok(std::path::absolute(store)?)
    }
}

/// A time: seconds, or a text as on the command line.
fn time(name: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Duration>> {
    let Some(given) = given else {
        return Ok(None);
    };
    let refused = |words: &str| format!("{name}: {words}, got {}", values::shown(given));
    let text = given
        .extract::<String>()
        .or_else(|_| Ok(format!("{}s", given.extract::<f64>()?)))
        .map_err(|_: PyErr| PyTypeError::new_err(refused("seconds, or a text such as \"2h\"")))?;
    parse_positive_duration(&text)
        .map(Some)
        .map_err(|words| PyValueError::new_err(refused(&words)))
}

/// Does the work in separate threads, while this one checks for Ctrl-C and updates the bar.
fn attended(
    py: Python<'_>,
    work: impl Send + FnOnce() -> Result<Vec<String>, sweep::Error>,
    stop: &Stop,
    progress: &Progress,
    bar: &Py<PyAny>,
) -> PyResult<Vec<String>> {
    let mut interrupted: Option<PyErr> = None;
    let done = py.detach(|| {
        std::thread::scope(|scope| {
            let working = scope.spawn(work);
            while !working.is_finished() {
                std::thread::sleep(LOOK);
                if interrupted.is_some() {
                    continue;
                }
                let now = progress.standing();
                let looked = Python::attach(|py| {
                    py.check_signals()?;
                    // The progress is unknown before the store was read.
                    if now.counts.total() > 0 {
                        bar.call_method1(py, "update", (now.fraction, now.message))?;
                    }
                    Ok(())
                });
                if let Err(error) = looked {
                    stop.ask(INTERRUPT);
                    interrupted = Some(error);
                }
            }
            working.join()
        })
    });
    match (done, interrupted) {
        (_, Some(interrupt)) => Err(interrupt),
        (Ok(done), None) => done.map_err(raise),
        (Err(panic), None) => std::panic::resume_unwind(panic),
    }
}

/// Number of threads.
fn threads(given: Option<usize>) -> PyResult<usize> {
    match given {
        None => Ok(std::thread::available_parallelism().map_or(1, NonZeroUsize::get)),
        Some(workers) if (1..=WORKER_LIMIT).contains(&workers) => Ok(workers),
        Some(workers) => Err(PyValueError::new_err(format!(
            "workers must be a whole number from 1 to {WORKER_LIMIT}, got {workers}"
        ))),
    }
}

pub(crate) fn warn(py: Python<'_>, words: &str) -> PyResult<()> {
    let words = CString::new(words.replace('\0', " "))?;
    PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &words, 1)
}
