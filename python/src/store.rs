//! Stores, readable during writes.

use crate::campaign::warn;
use crate::errors::raise;
use crate::table::Table;
use crate::values;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use sd_core::model::Keywords;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use sweep::data::DataColumn;
use sweep::model::axes::{AXES, Axis};
use sweep::model::spaces::AnyFrame;
use sweep::report::{
    Drawing, FitReport, Kind, Report, SegmentReport, Selection, SphereView, StructureReport,
    draw_spheres, outline, point_table, traces,
};
use sweep::store::{Store as OpenStore, StoreSource, StoredFrame};
use sweep::system::files::{reason_to_stay, write_output};
use sweep::trajectory::{contact_table, sphere_table};

/// The store of a campaign.
///
/// Every call reads the present contents, while the command line or another notebook may write to
/// the store.
///
/// Parameters
/// ----------
/// path : str or path
///     The store; or a campaign file, whose name ends with .toml, for its runs in its default
///     store.
#[pyclass(frozen, module = "sheared_layers")]
pub(crate) struct Store(StoreSource);

impl Store {
    pub(crate) fn of(source: StoreSource) -> Self {
        Self(source)
    }

    /// A store that can be read.
    pub(crate) fn opened(source: StoreSource) -> PyResult<Self> {
        source.open().map_err(raise)?;
        Ok(Self(source))
    }

    fn open(&self) -> PyResult<OpenStore> {
        self.0.open().map_err(raise)
    }

    /// Reads the store, while other threads of Python continue.
    fn read<T: Send>(
        &self,
        py: Python<'_>,
        read: impl Send + FnOnce(&OpenStore) -> Result<T, sweep::Error>,
    ) -> PyResult<T> {
        py.detach(|| {
            let store = self.0.open()?;
            read(&store)
        })
        .map_err(|error: sweep::Error| raise(error))
    }

    /// Number of done runs, as text.
    pub(crate) fn standing(&self) -> PyResult<String> {
        let counts = self.open()?.counts().map_err(raise)?;
        let ended = counts.done + counts.jammed + counts.failed;
        Ok(format!("{ended} of {} cases", counts.total()))
    }

    /// Number of failed runs, and the reason of the first, if any.
    pub(crate) fn failures(&self) -> PyResult<Option<String>> {
        let store = self.open()?;
        let counts = store.counts().map_err(raise)?;
        let first = store.failures(1).map_err(raise)?;
        Ok(first.first().map(|first| {
            format!(
                "{} of {} runs failed; the first, {}: {}",
                counts.failed,
                counts.total(),
                &first.key[..8],
                first.failed.error
            )
        }))
    }

    /// A table of the structure.
    fn structure_of(
        &self,
        py: Python<'_>,
        case: Option<&Bound<'_, PyAny>>,
        r#where: Option<&Bound<'_, PyAny>>,
        table: fn(&StructureReport) -> Vec<DataColumn>,
    ) -> PyResult<Vec<DataColumn>> {
        let selection = selection(r#where)?;
        let case = case.map(name_of).transpose()?;
        let (table, note) = self.read(py, |store| {
            let report = StructureReport::of(store, &selection, case.as_deref())?;
            Ok((table(&report), report.note()))
        })?;
        note.map_or(Ok(()), |note| warn(py, &note))?;
        Ok(table)
    }

    fn kept_frames(&self, py: Python<'_>, case: &str, every: usize) -> PyResult<Vec<StoredFrame>> {
        self.read(py, |store| {
            let key = store.key_of(case)?;
            Ok(store.frames(&key, every)?)
        })
    }
}

#[pymethods]
impl Store {
    #[new]
    fn new(path: &Bound<'_, PyAny>) -> PyResult<Self> {
        let path = values::file("path", path)?;
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            let campaign = sweep::campaign::read(&path).map_err(raise)?;
            return Self::opened(StoreSource::new(campaign.default_store(), Some(campaign)));
        }
        Self::opened(StoreSource::new(std::path::absolute(path)?, None))
    }

    /// Its file.
    #[getter]
    fn path(&self) -> PathBuf {
        self.0.path().to_owned()
    }

    /// Runs by state: done, jammed, failed, running, pending.
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let counts = self.read(py, |store| Ok(store.counts()?))?;
        values::answer(py, &counts)
    }

    /// The points of the campaign, averaged over seeds: the table of `sweep report --parquet`, one
    /// row per point.
    ///
    /// Parameters
    /// ----------
    /// where : dict, optional
    ///     Only points with these values: ``{"friction": 0.3, "shear_rate": [0.1, math.inf]}``.
    #[pyo3(signature = (*, r#where=None))]
    fn points(&self, py: Python<'_>, r#where: Option<&Bound<'_, PyAny>>) -> PyResult<Table> {
        let selection = selection(r#where)?;
        let columns = self.read(py, |store| Ok(point_table(&Report::of(store, &selection)?)))?;
        Ok(Table::of(columns))
    }

    /// The runs of the campaign, one row each: key, state, axes, seed, and results.
    fn runs(&self, py: Python<'_>) -> PyResult<Table> {
        Ok(Table::of(self.read(py, |store| Ok(store.runs()?))?))
    }

    /// The samples of a run in time; for a running one, up to its last checkpoint.
    ///
    /// Parameters
    /// ----------
    /// case : str or int
    ///     The beginning of its key, or its number in the campaign file, from 1.
    fn samples(&self, py: Python<'_>, case: &Bound<'_, PyAny>) -> PyResult<Table> {
        let case = name_of(case)?;
        let samples = self.read(py, |store| Ok(store.samples(&store.key_of(&case)?)?))?;
        Ok(Table::of(sweep::measure::sample_table(&samples)))
    }

    /// The spheres of a run at its kept strains, one row per sphere and strain.
    /// ``run(trajectory=True)`` keeps frames.
    ///
    /// Parameters
    /// ----------
    /// case : str or int
    ///     The beginning of its key, or its number in the campaign file, from 1.
    /// every : int
    ///     Stride of frames.
    #[pyo3(signature = (case, *, every=None), text_signature = "($self, case, *, every=1)")]
    fn frames(
        &self,
        py: Python<'_>,
        case: &Bound<'_, PyAny>,
        every: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Table> {
        let kept = self.kept_frames(py, &name_of(case)?, values::stride(every)?)?;
        Ok(Table::of(sphere_table(&with_steps(&kept))))
    }

    /// The contacts of the same frames, one row per contact and strain.
    #[pyo3(signature = (case, *, every=None), text_signature = "($self, case, *, every=1)")]
    fn contacts(
        &self,
        py: Python<'_>,
        case: &Bound<'_, PyAny>,
        every: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Table> {
        let kept = self.kept_frames(py, &name_of(case)?, values::stride(every)?)?;
        Ok(Table::of(contact_table(&with_steps(&kept))))
    }

    /// Structure of the layers: pair distributions, contacts, clusters, percolation, rigid
    /// clusters, fabric, averaged over the kept frames after the discarded strain and over runs.
    /// ``run(trajectory=True)`` keeps frames.
    ///
    /// Parameters
    /// ----------
    /// case : str or int, optional
    ///     A single run; by default all finished runs.
    /// where : dict, optional
    ///     Only these points, as in `points`.
    ///
    /// Returns
    /// -------
    /// Table
    ///     One row per point: the table of `sweep structure --csv`. `structure_curves` has the
    ///     curves.
    #[pyo3(signature = (case=None, *, r#where=None))]
    fn structure(
        &self,
        py: Python<'_>,
        case: Option<&Bound<'_, PyAny>>,
        r#where: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Table> {
        Ok(Table::of(self.structure_of(
            py,
            case,
            r#where,
            StructureReport::table,
        )?))
    }

    /// Curves of the structure: pair distributions, angles of contacts, forces, sizes of clusters.
    ///
    /// Parameters
    /// ----------
    /// case : str or int, optional
    ///     A single run; by default all finished runs.
    /// where : dict, optional
    ///     Only these points, as in `points`.
    ///
    /// Returns
    /// -------
    /// Table
    ///     One row per bin of each curve of each point: the table of `sweep structure --curves`.
    #[pyo3(signature = (case=None, *, r#where=None))]
    fn structure_curves(
        &self,
        py: Python<'_>,
        case: Option<&Bound<'_, PyAny>>,
        r#where: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Table> {
        Ok(Table::of(self.structure_of(
            py,
            case,
            r#where,
            StructureReport::curves,
        )?))
    }

    /// Results of each segment of the runs: averages, stress after a reversal, harmonics of an
    /// oscillation.
    ///
    /// Parameters
    /// ----------
    /// where : dict, optional
    ///     Only these points, as in `points`.
    ///
    /// Returns
    /// -------
    /// Table
    ///     One row per segment of each point: the table of `sweep segments --csv`.
    #[pyo3(signature = (*, r#where=None))]
    fn segments(&self, py: Python<'_>, r#where: Option<&Bound<'_, PyAny>>) -> PyResult<Table> {
        let selection = selection(r#where)?;
        let table = |store: &OpenStore| Ok(SegmentReport::of(store, &selection)?.table());
        Ok(Table::of(self.read(py, table)?))
    }

    /// Fit the Wyart-Cates model to the viscosities, as `sweep fit` does.
    ///
    /// Parameters
    /// ----------
    /// where : dict, optional
    ///     Only these points, as in `points`.
    /// replicates : int
    ///     Replicates of the bootstrap; 0 for no intervals.
    ///
    /// Returns
    /// -------
    /// dict
    ///     The object of `sweep fit --json`: each of ``parameters`` has ``value``, ``low`` and
    ///     ``high``; ``rms`` is that of the residuals; ``points`` has a dict for each point.
    #[pyo3(
        signature = (*, r#where=None, replicates=200),
        text_signature = "($self, *, where=None, replicates=200)"
    )]
    fn fit<'py>(
        &self,
        py: Python<'py>,
        r#where: Option<&Bound<'py, PyAny>>,
        replicates: u32,
    ) -> PyResult<Bound<'py, PyAny>> {
        let selection = selection(r#where)?;
        let replicates = replicates.min(100_000) as usize;
        let fit = self.read(py, |store| {
            Ok(FitReport::of(store, &selection, replicates)?.json())
        })?;
        values::answer(py, &fit)
    }

    /// Draw the spheres of a run at a kept strain into a file, as `sweep draw` does.
    /// ``run(trajectory=True)`` keeps frames.
    ///
    /// Parameters
    /// ----------
    /// case : str or int
    ///     The beginning of its key, or its number in the campaign file, from 1.
    /// path : str or path
    ///     The file, whose name ends with .svg.
    /// strain : float, optional
    ///     The strain of the drawn frame, the nearest one kept; by default the last frame.
    /// colour : str
    ///     Quantity that colours the spheres: "pressure", "contacts", "spin" or "cluster".
    /// slab : (float, float), optional
    ///     In a suspension, only spheres with centres at z in this range, in a.
    #[pyo3(
        signature = (case, path, *, strain=None, colour=None, slab=None),
        text_signature = "($self, case, path, *, strain=None, colour='pressure', slab=None)"
    )]
    fn draw(
        &self,
        py: Python<'_>,
        case: &Bound<'_, PyAny>,
        path: &Bound<'_, PyAny>,
        strain: Option<&Bound<'_, PyAny>>,
        colour: Option<&Bound<'_, PyAny>>,
        slab: Option<(f64, f64)>,
    ) -> PyResult<()> {
        let refused = |message: String| PyValueError::new_err(message);
        let (case, path) = (name_of(case)?, values::file("path", path)?);
        if path.extension().is_none_or(|ending| ending != "svg") {
            let path = path.display();
            let message = format!("path must be a name that ends with .svg, got {path}");
            return Err(refused(message));
        }
        if let Some(reason) = reason_to_stay(&path) {
            let message = format!(
                "{} is not written: {reason}; name another file",
                path.display()
            );
            return Err(refused(message));
        }
        if let Some((from, to)) = slab
            && !(from < to && from.is_finite() && to.is_finite())
        {
            let message =
                format!("slab must be two finite numbers, the lower one first, got ({from}, {to})");
            return Err(refused(message));
        }
        let view = SphereView {
            strain: strain
                .map(|strain| values::number("strain", strain))
                .transpose()?,
            colour: word("colour", colour)?,
            slab: slab.map(|(from, to)| [from, to]),
        };
        let picture = self.read(py, |store| Ok(draw_spheres(store, &case, view)?))?;
        Ok(write_output(&path, picture.file.as_ref())?)
    }

    /// Draw the results with matplotlib, in the style of `sweep report --figure`.
    ///
    /// Parameters
    /// ----------
    /// kind : str
    ///     "viscosity", "contacts", "trace", "normal-stress", "approach-velocity", "state-diagram"
    ///     and others of `sweep report`.
    /// quantity : str, optional
    ///     Of kind "viscosity": "viscosity", "viscosity_stresslet" or "viscosity_median".
    /// along : str, optional
    ///     The horizontal axis; by default the shear rate where it varies.
    /// where : dict, optional
    ///     Only these points, as in `points`.
    /// cases : list of str, optional
    ///     Of kind "trace": the runs, by the beginnings of their keys.
    /// segment : int, optional
    ///     The segment of the runs, from 1; by default the last.
    /// ax : matplotlib axes, optional
    ///     Axes for the figure; by default a new figure.
    ///
    /// Returns
    /// -------
    /// matplotlib axes
    #[pyo3(
        signature = (kind=None, *, quantity=None, along=None, r#where=None, cases=None, segment=None, ax=None),
        text_signature = "($self, kind='viscosity', *, quantity=None, along=None, where=None, cases=None, segment=None, ax=None)"
    )]
    #[expect(
        clippy::too_many_arguments,
        reason = "keywords of Python, each with a default"
    )]
    fn plot<'py>(
        &self,
        py: Python<'py>,
        kind: Option<&Bound<'py, PyAny>>,
        quantity: Option<&Bound<'py, PyAny>>,
        along: Option<&Bound<'py, PyAny>>,
        r#where: Option<&Bound<'py, PyAny>>,
        cases: Option<&Bound<'py, PyAny>>,
        segment: Option<usize>,
        ax: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let drawing = Drawing {
            kind: word("kind", kind)?,
            quantity: word("quantity", quantity)?,
            along: along.map(axis).transpose()?,
            ..Drawing::default()
        };
        let selection = selection(r#where)?;
        let cases = match cases {
            Some(cases) => values::texts("cases", cases)?,
            None => Vec::new(),
        };
        let source = &self.0;
        let draw = |store: &OpenStore| {
            let report = Report::of(store, &selection)?;
            let traces = match drawing.kind {
                Kind::Trace => traces(store, &selection, &cases)?,
                _ => Vec::new(),
            };
            Ok(outline(std::slice::from_ref(&report), &traces, &drawing)?)
        };
        let outline = match segment {
            None => self.read(py, draw)?,
            Some(number) => py
                .detach(|| Ok(source.open_segment(number)?.map(|store| draw(&store))))
                .map_err(|error: sweep::Error| raise(error))?
                .map_err(|message| PyValueError::new_err(format!("segment: {message}")))?
                .map_err(raise)?,
        };
        py.import("sheared_layers._plot")?
            .call_method1("draw", (values::answer(py, &outline)?, ax))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let counts = self.read(py, |store| Ok(store.counts()?))?;
        Ok(format!(
            "Store({}, {} of {} runs done)",
            self.0.path().display(),
            counts.done + counts.jammed,
            counts.total()
        ))
    }
}

fn with_steps(frames: &[StoredFrame]) -> Vec<(u64, &AnyFrame)> {
    frames.iter().map(|kept| (kept.step, &kept.frame)).collect()
}

/// A case by its name on the command line.
fn name_of(case: &Bound<'_, PyAny>) -> PyResult<String> {
    if let Ok(key) = case.extract::<String>() {
        return Ok(key);
    }
    match case.extract::<usize>().map(NonZeroUsize::new) {
        Ok(Some(number)) => Ok(number.to_string()),
        _ => Err(PyTypeError::new_err(format!(
            "case must be the beginning of a key or the number of a run, from 1, got {}",
            values::shown(case)
        ))),
    }
}

/// The points selected by a dictionary.
fn selection(given: Option<&Bound<'_, PyAny>>) -> PyResult<Selection> {
    let given = given
        .map(|given| values::dict("where", given))
        .transpose()?;
    let mut texts = Vec::new();
    for (key, value) in given.iter().flatten() {
        let key = key.str()?.to_string();
        let values: Vec<Bound<'_, PyAny>> = if value.cast::<PyList>().is_ok()
            || value.cast::<PyTuple>().is_ok()
            || value.hasattr("tolist")?
        {
            let several = py_list(&value)?;
            several.iter().collect()
        } else {
            vec![value]
        };
        let values: Vec<String> = values
            .iter()
            .map(|value| value.str().map(|text| text.to_string()))
            .collect::<PyResult<_>>()?;
        texts.push(format!("{key}={}", values.join(",")));
    }
    Selection::parse(&texts).map_err(raise)
}

/// A list, a tuple, an array or a scalar of numpy as a list.
fn py_list<'py>(value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyList>> {
    let plain = if value.hasattr("tolist")? {
        value.call_method0("tolist")?
    } else {
        value.clone()
    };
    match plain.try_iter() {
        Ok(entries) => PyList::new(value.py(), entries.collect::<PyResult<Vec<_>>>()?),
        Err(_) => PyList::new(value.py(), [plain]),
    }
}

/// A choice by its keyword.
fn word<T: Keywords + Default>(name: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<T> {
    let Some(given) = given else {
        return Ok(T::default());
    };
    let given = values::text(name, given)?;
    T::of_word(&given).ok_or_else(|| {
        let known: Vec<String> = T::KEYWORDS
            .iter()
            .map(|word| format!("{:?}", word.word))
            .collect();
        PyValueError::new_err(format!(
            "{name} must be one of {}, got {given:?}",
            known.join(", ")
        ))
    })
}

/// An axis that a figure can run along.
fn axis(given: &Bound<'_, PyAny>) -> PyResult<&'static Axis> {
    let given = values::text("along", given)?;
    let found = Axis::named(&given).filter(|axis| axis.is_numeric());
    found.ok_or_else(|| {
        let known = AXES.iter().filter(|axis| axis.is_numeric());
        let known: Vec<&str> = known.map(|axis| axis.key).collect();
        PyValueError::new_err(format!(
            "along must be one of {}, got {given:?}",
            known.join(", ")
        ))
    })
}
