//! Stores, readable during writes.

use crate::campaign::warn;
use crate::errors::raise;
use crate::table::Table;
use crate::values::{self, CaseName};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sd_core::model::Keywords;
use std::path::PathBuf;
use sweep::data::DataColumn;
use sweep::model::axes::{AXES, Axis};
use sweep::model::spaces::AnyFrame;
use sweep::report::{
    Against, Drawing, FitReport, Reference, Report, SegmentReport, Selection, SphereView,
    StructureReport, draw_spheres, number, outline, point_table, traces,
};
use sweep::store::{Store as OpenStore, StoreSource};
use sweep::system::files::{reason_to_stay, write_output};
use sweep::trajectory::{contact_table, sphere_table};
use toml::Value;

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

    /// Number of failed runs, and the reason of the first, if any.
    pub(crate) fn failures(&self) -> PyResult<Option<String>> {
        let store = self.open()?;
        let counts = store.counts().map_err(raise)?;
        let first = store.failures(1).map_err(raise)?;
        let (failed, total) = (counts.failed, counts.total());
        Ok(first.first().map(|first| {
            let (key, error) = (&first.key[..8], &first.failed.error);
            format!("{failed} of {total} runs failed; the first, {key}: {error}")
        }))
    }

    /// A table of the store, while other threads of Python continue.
    fn table(
        &self,
        py: Python<'_>,
        read: impl Send + FnOnce(&OpenStore) -> Result<Vec<DataColumn>, sweep::Error>,
    ) -> PyResult<Table> {
        Ok(Table::of(self.read(py, read)?))
    }

    /// A table of the structure.
    fn structure_of(
        &self,
        py: Python<'_>,
        case: Option<CaseName>,
        r#where: Option<&Bound<'_, PyDict>>,
        table: fn(&StructureReport) -> Vec<DataColumn>,
    ) -> PyResult<Table> {
        let selection = selection(r#where)?;
        let case = case.map(|case| case.0);
        let (table, note) = self.read(py, |store| {
            let report = StructureReport::of(store, &selection, case.as_deref())?;
            Ok((table(&report), report.note()))
        })?;
        note.map_or(Ok(()), |note| warn(py, &note))?;
        Ok(Table::of(table))
    }

    /// A table of the kept frames of a case.
    fn of_frames(
        &self,
        py: Python<'_>,
        case: &str,
        every: usize,
        table: fn(&[(u64, &AnyFrame)]) -> Vec<DataColumn>,
    ) -> PyResult<Table> {
        let every = values::stride(every)?;
        self.table(py, |store| {
            let kept = store.frames(&store.key_of(case)?, every)?;
            let frames: Vec<_> = kept.iter().map(|kept| (kept.step, &kept.frame)).collect();
            Ok(table(&frames))
        })
    }
}

/// What a horizontal axis shows in place of an axis of the campaign.
#[derive(FromPyObject)]
enum Abscissa {
    Below(f64),
    Column(String),
}

#[expect(
    clippy::needless_pass_by_value,
    reason = "arguments of Python come as values"
)]
#[pymethods]
impl Store {
    #[new]
    fn new(path: PathBuf) -> PyResult<Self> {
        if path.extension().is_some_and(|ending| ending == "toml") {
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
    fn points(&self, py: Python<'_>, r#where: Option<&Bound<'_, PyDict>>) -> PyResult<Table> {
        let selection = selection(r#where)?;
        self.table(py, |store| Ok(point_table(&Report::of(store, &selection)?)))
    }

    /// The runs of the campaign, one row each: key, state, axes, seed, and results.
    fn runs(&self, py: Python<'_>) -> PyResult<Table> {
        self.table(py, |store| Ok(store.runs()?))
    }

    /// The samples of a run in time; for a running one, up to its last checkpoint.
    ///
    /// Parameters
    /// ----------
    /// case : str or int
    ///     The beginning of its key, or its number in the campaign file, from 1.
    fn samples(&self, py: Python<'_>, case: CaseName) -> PyResult<Table> {
        self.table(py, |store| {
            let samples = store.samples(&store.key_of(&case.0)?)?;
            Ok(sweep::measure::sample_table(&samples))
        })
    }

    /// The spheres of a run at its kept strains, one row per sphere and strain.
    /// ``run(trajectory=True)`` keeps frames.
    ///
    /// Parameters
    /// ----------
    /// case : str or int
    ///     As in `samples`.
    /// every : int
    ///     Stride of frames.
    #[pyo3(signature = (case, *, every=1))]
    fn frames(&self, py: Python<'_>, case: CaseName, every: usize) -> PyResult<Table> {
        self.of_frames(py, &case.0, every, sphere_table)
    }

    /// The contacts of the same frames, one row per contact and strain.
    #[pyo3(signature = (case, *, every=1))]
    fn contacts(&self, py: Python<'_>, case: CaseName, every: usize) -> PyResult<Table> {
        self.of_frames(py, &case.0, every, contact_table)
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
        case: Option<CaseName>,
        r#where: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Table> {
        self.structure_of(py, case, r#where, StructureReport::table)
    }

    /// Curves of the structure: pair distributions, angles of contacts, forces, sizes of clusters.
    /// Parameters are those of `structure`. One row per bin of each curve of each point: the table
    /// of `sweep structure --curves`.
    #[pyo3(signature = (case=None, *, r#where=None))]
    fn structure_curves(
        &self,
        py: Python<'_>,
        case: Option<CaseName>,
        r#where: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Table> {
        self.structure_of(py, case, r#where, StructureReport::curves)
    }

    /// Results of each segment of the runs: averages, stress after a reversal, harmonics of an
    /// oscillation. One row per segment of each point: the table of `sweep segments --csv`.
    ///
    /// Parameters
    /// ----------
    /// where : dict, optional
    ///     Only these points, as in `points`.
    #[pyo3(signature = (*, r#where=None))]
    fn segments(&self, py: Python<'_>, r#where: Option<&Bound<'_, PyDict>>) -> PyResult<Table> {
        let selection = selection(r#where)?;
        self.table(
            py,
            |store| Ok(SegmentReport::of(store, &selection)?.table()),
        )
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
    ///     ``high``; ``rms`` is that of the residuals; ``points`` has a dict for each point. Warns
    ///     of parameters that the points do not determine, whose names are in ``undetermined``.
    #[pyo3(signature = (*, r#where=None, replicates=200))]
    fn fit<'py>(
        &self,
        py: Python<'py>,
        r#where: Option<&Bound<'py, PyDict>>,
        replicates: u32,
    ) -> PyResult<Bound<'py, PyAny>> {
        let selection = selection(r#where)?;
        let replicates = replicates.min(100_000) as usize;
        let (fit, notes) = self.read(py, |store| {
            let report = FitReport::of(store, &selection, replicates)?;
            Ok((report.json(), report.notes()))
        })?;
        notes.iter().try_for_each(|note| warn(py, note))?;
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
    #[pyo3(signature = (case, path, *, strain=None, colour="pressure", slab=None))]
    fn draw(
        &self,
        py: Python<'_>,
        case: CaseName,
        path: PathBuf,
        strain: Option<f64>,
        colour: &str,
        slab: Option<[f64; 2]>,
    ) -> PyResult<()> {
        let name = path.display();
        if path.extension().is_none_or(|ending| ending != "svg") {
            let message = format!("path must be a name that ends with .svg, got {name}");
            return Err(PyValueError::new_err(message));
        }
        if let Some(reason) = reason_to_stay(&path) {
            let message = format!("{name} is not written: {reason}; name another file");
            return Err(PyValueError::new_err(message));
        }
        let view = SphereView {
            strain,
            colour: word("colour", colour)?,
            slab,
        };
        let picture = self.read(py, |store| Ok(draw_spheres(store, &case.0, view)?))?;
        Ok(write_output(&path, picture.file.as_bytes())?)
    }

    /// Draw the results with matplotlib, in the style of `sweep report --figure`.
    ///
    /// Parameters
    /// ----------
    /// kind : str
    ///     One of the kinds of `sweep report --kind`: "curve", "contacts", "mu-j", "trace", ...
    /// quantity : str, optional
    ///     Of kind "curve": a column of `points`; by default the viscosity.
    /// along : str, optional
    ///     The horizontal axis; by default the shear rate where it varies.
    /// where : dict, optional
    ///     Only these points, as in `points`.
    /// cases : list of str, optional
    ///     Of figures of runs in time: the runs, by the beginnings of their keys.
    /// segment : int, optional
    ///     The segment of the runs, from 1; by default the last.
    /// against : str or float, optional
    ///     What the horizontal axis shows in place of `along`: a column of `points`, or the
    ///     distance of the fraction below this one.
    /// references : list of str, optional
    ///     Published curves to draw too, such as "boyer2011".
    /// ax : matplotlib axes, optional
    ///     Axes for the figure; by default a new figure.
    ///
    /// Returns
    /// -------
    /// matplotlib axes
    #[pyo3(signature = (kind="curve", *, quantity=None, along=None, r#where=None, cases=None, segment=None, against=None, references=None, ax=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "keywords of Python, each with a default"
    )]
    fn plot<'py>(
        &self,
        py: Python<'py>,
        kind: &str,
        quantity: Option<&str>,
        along: Option<&str>,
        r#where: Option<&Bound<'py, PyDict>>,
        cases: Option<Vec<String>>,
        segment: Option<usize>,
        against: Option<Abscissa>,
        references: Option<Vec<String>>,
        ax: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let references = references.unwrap_or_default();
        let references = references.iter().map(|name| Reference::named(name));
        let drawing = Drawing {
            kind: word("kind", kind)?,
            number: quantity
                .map(|name| number("quantity", name))
                .transpose()
                .map_err(raise)?,
            along: along.map(axis).transpose()?,
            against: match against {
                Some(Abscissa::Column(name)) => {
                    Some(Against::Number(number("against", &name).map_err(raise)?))
                }
                Some(Abscissa::Below(jamming)) => Some(Against::Below(jamming)),
                None => None,
            },
            references: references.collect::<Result<_, _>>().map_err(raise)?,
            ..Drawing::default()
        };
        let (selection, cases) = (selection(r#where)?, cases.unwrap_or_default());
        let draw = |store: &OpenStore| {
            let report = Report::of(store, &selection)?;
            let traces = traces(store, &selection, &cases, drawing.kind)?;
            Ok(outline(&report, &traces, &drawing)?)
        };
        let outline = match segment {
            None => self.read(py, draw)?,
            Some(number) => py
                .detach(|| Ok(self.0.open_segment(number)?.map(|store| draw(&store))))
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

/// The points selected by a dictionary.
fn selection(given: Option<&Bound<'_, PyDict>>) -> PyResult<Selection> {
    let given = given.map(values::table).transpose()?.unwrap_or_default();
    let word = |value: &Value| match value {
        Value::String(word) => word.clone(),
        value => value.to_string(),
    };
    let wanted = given.iter().map(|(key, value)| {
        let several = value
            .as_array()
            .map_or(std::slice::from_ref(value), Vec::as_slice);
        let words: Vec<String> = several.iter().map(word).collect();
        format!("{key}={}", words.join(","))
    });
    Selection::parse(&wanted.collect::<Vec<_>>()).map_err(raise)
}

/// A choice by its keyword.
fn word<T: Keywords>(name: &str, given: &str) -> PyResult<T> {
    T::of_word(given).ok_or_else(|| {
        let known = T::KEYWORDS.iter().map(|word| format!("{:?}", word.word));
        let known = known.collect::<Vec<_>>().join(", ");
        PyValueError::new_err(format!("{name} must be one of {known}, got {given:?}"))
    })
}

/// An axis that a figure can run along.
fn axis(given: &str) -> PyResult<&'static Axis> {
    let found = Axis::named(given).filter(|axis| axis.is_numeric());
    found.ok_or_else(|| {
        let known = AXES.iter().filter(|axis| axis.is_numeric());
        let known = known.map(|axis| axis.key).collect::<Vec<_>>().join(", ");
        PyValueError::new_err(format!("along must be one of {known}, got {given:?}"))
    })
}
