//! The points of a campaign: what its store holds, averaged over the runs that differ only in their
//! seed.

use super::columns::{self, Columns, measure};
use super::error::ReportError;
use super::failures::FailureGroup;
use super::selection::Selection;
use super::starts::Starts;
use super::steady;
use super::units::{At, Units};
use crate::measure::doubt::is_rigid;
use crate::measure::{Decision, Estimate, PointRun, Runs, Trend};
use crate::model::axes::{AXES, Axis, identity};
use crate::model::campaign::{AsWritten, SharedPoints};
use crate::model::case::State;
use crate::model::precision::Precision;
use crate::store::{Counts, Provenance, Store};
use crate::text::format::counted;
use sd_core::Params;
use std::collections::{HashMap, HashSet};
use std::f64::consts::PI;
use std::sync::Arc;

/// Failures listed in a report.
const FAILURES_SHOWN: usize = 10;

/// A campaign's results so far.
#[derive(Debug, Clone)]
pub struct Report {
    /// Name of the campaign.
    pub campaign: String,
    /// The selected points.
    pub selection: Selection,
    /// The selected columns of its tables.
    pub columns: Columns,
    /// Their cases by state.
    pub counts: Counts,
    /// Number of finished runs among them with doubtful numbers.
    pub doubtful: u64,
    /// Whether these are averaged too.
    pub with_doubtful: bool,
    /// The discarded start of every run.
    pub discard: f64,
    /// Number of the segment whose averages they are, from 1, of runs that have segments.
    pub segment: Option<usize>,
    /// Numbers of its jammed runs in the campaign file, from 1.
    pub jammed: Vec<u64>,
    /// The points in the order of the file.
    pub points: Vec<Point>,
    /// Their first failures, similar ones grouped.
    pub failures: Vec<FailureGroup>,
    /// Wall seconds of computing their results, summed over workers.
    pub computing: f64,
    /// Their CPU seconds, as far as known.
    pub processor: f64,
    /// Whether some of its points share their runs: friction has no effect at Γ = 0, nor has its
    /// onset at Γ = ∞, nor have its laws and the shear rate without friction.
    pub shares_runs: bool,
    /// Processes that finished results of the store, the latest first.
    pub provenance: Vec<Provenance>,
    /// The keys of its runs with a result.
    pub keys: Vec<String>,
    /// The units of its numbers.
    pub units: Units,
    /// Names of its start layers.
    pub(crate) starts: Starts,
}

/// All runs that differ only in their seed.
#[derive(Debug, Clone)]
pub struct Point {
    /// Their parameters.
    pub params: Params,
    /// Runs averaged.
    pub seeds: u64,
    /// Runs that ended jammed: counted, not averaged.
    pub jammed: u64,
    /// Runs that failed: counted, not averaged.
    pub failed: u64,
    /// Viscosity in full: mean over the runs of their means.
    pub viscosity: Option<Estimate>,
    /// The requested precision and the state of its rule; `None` for a fixed number of seeds.
    pub rule: Option<(Precision, Decision)>,
    /// How its runs change, if they are not in steady state, with advice.
    pub(crate) trend: Option<(Trend, String)>,
    /// Measured numbers, by column; NaN for missing ones.
    pub(super) measured: Box<[f64]>,
}

impl Report {
    /// Reads the present results of the points selected.
    ///
    /// # Errors
    /// An I/O or SQLite error; [`ReportError::Argument`] on a selection that no point meets.
    pub fn of(store: &Store, selection: &Selection) -> Result<Self, ReportError> {
        Ok(Self::with_runs(store, selection)?.0)
    }

    /// The report with the runs of its points, each with the index of its point.
    pub(super) fn with_runs(
        store: &Store,
        selection: &Selection,
    ) -> Result<(Self, Vec<PointRun>, Vec<usize>), ReportError> {
        let written = store.written()?;
        let runs = selected(store.point_runs()?, &written, selection)?;
        let once = each_once(&runs);
        let wanted: HashSet<&str> = once.iter().map(|run| run.key.as_str()).collect();
        let mut failures = store.failures(u32::MAX)?;
        failures.retain(|failure| wanted.contains(failure.key.as_str()));
        let mut failures = FailureGroup::of(failures);
        failures.truncate(FAILURES_SHOWN);
        // An empty sum would be -0.
        let total = |time: &str| {
            let times = once.iter().filter_map(|run| run.number(time));
            times.fold(0.0, |a, b| a + b)
        };
        let (computing, processor) = (total("wall_time_s"), total("cpu_time_s"));
        let keys = once.iter().filter(|run| run.number("viscosity").is_some());
        let keys = keys.map(|run| run.key.clone()).collect();
        let jammed = once.iter().filter(|run| run.state == State::Jammed);
        let jammed = jammed.map(|run| run.position + 1).collect();
        let doubtful = once.iter().filter(|run| run.is_doubtful()).count() as u64;
        let mut counts = Counts::default();
        for run in &once {
            counts.add(run.state, run.is_arrested());
        }
        let protocol = store.protocol()?;
        let states = store.point_states()?.into_iter();
        let rules = states.map(|state| {
            let shown = shown(&state.params, protocol.segments.len());
            (identity(&shown), (state.rule, state.decision))
        });
        let rules: HashMap<_, _> = rules.collect();
        let mut groups: Vec<Vec<&PointRun>> = Vec::new();
        let mut place_of = HashMap::new();
        let mut places: Vec<usize> = Vec::with_capacity(runs.len());
        for run in &runs {
            // Runs of a point come one after the other.
            let place = match places.last() {
                Some(&last) if groups[last][0].params == run.params => last,
                _ => *place_of.entry(identity(&run.params)).or_insert_with(|| {
                    groups.push(Vec::new());
                    groups.len() - 1
                }),
            };
            places.push(place);
            groups[place].push(run);
        }
        let mut points = Vec::with_capacity(groups.len());
        for all in groups {
            let averaged = all.iter().copied();
            let averaged = averaged.filter(|run| selection.averages(run)).collect();
            let mut settled = Params::clone(&all[0].params);
            settled.canonicalise();
            let rule = rules.get(&identity(&settled)).copied();
            let runs = Runs {
                all,
                averaged,
                rule,
            };
            points.push(Point {
                trend: steady::trend(store, &runs, &protocol)?,
                ..Point::of(&runs)
            });
        }
        let report = Self {
            campaign: store.campaign_name()?,
            selection: selection.clone(),
            columns: Columns::default(),
            counts,
            discard: protocol.discard,
            segment: Some(protocol.segments.len()).filter(|count| *count > 0),
            points,
            jammed,
            doubtful,
            with_doubtful: selection.with_doubtful,
            failures,
            computing,
            processor,
            shares_runs: once.len() < runs.len(),
            provenance: store.provenance()?,
            keys,
            units: Units::default(),
            starts: Starts(written.starts),
        };
        Ok((report, runs, places))
    }

    /// The parameters of its points.
    pub(super) fn params(&self) -> impl Iterator<Item = &Params> + Clone {
        self.points.iter().map(|point| &point.params)
    }

    /// The axes on which its points differ.
    pub(super) fn varying(&self) -> impl Iterator<Item = &'static Axis> {
        AXES.iter().filter(|axis| axis.varies(self.params()))
    }

    /// A note on doubtful runs.
    pub(super) fn note(&self) -> Option<String> {
        let how = if self.with_doubtful {
            "averaged too"
        } else {
            "left out"
        };
        let runs = counted(self.doubtful, "doubtful run");
        (self.doubtful > 0).then(|| format!("{runs} {how}"))
    }

    /// The programs that computed its results, each once.
    pub(crate) fn programs(&self) -> Vec<String> {
        let mut programs: Vec<String> = Vec::new();
        for process in &self.provenance {
            let program = process.program();
            if !programs.contains(&program) {
                programs.push(program);
            }
        }
        programs
    }
}

/// All runs of the points selected, each once, in the order of the campaign file.
pub(super) fn selected_runs(
    store: &Store,
    selection: &Selection,
) -> Result<Vec<PointRun>, ReportError> {
    let runs = selected(store.point_runs()?, &store.written()?, selection)?;
    Ok(each_once(&runs).into_iter().cloned().collect())
}

/// The first of each run that several points share.
fn each_once(runs: &[PointRun]) -> Vec<&PointRun> {
    // Only runs of these parameters are shared, which most campaigns lack.
    let is_shared = |run: &PointRun| {
        let rate = run.params.shear_rate;
        run.params.friction == 0.0 || rate == 0.0 || rate.is_infinite()
    };
    if !runs.iter().any(is_shared) {
        return runs.iter().collect();
    }
    let mut known = HashSet::new();
    runs.iter()
        .filter(|run| known.insert(run.key.as_str()))
        .collect()
}

/// The runs of the points as written in the campaign file: a run that several points share belongs
/// to each.
fn as_written(runs: Vec<PointRun>, written: &AsWritten) -> Vec<PointRun> {
    if written.shared.is_empty() {
        return runs;
    }
    let shared = SharedPoints::new(written);
    let mut all = Vec::with_capacity(runs.len());
    for run in runs {
        let Some(points) = shared.of_run(&run.params) else {
            all.push((run.position, usize::MAX, run));
            continue;
        };
        all.extend(points.map(|(follows, place, params)| {
            let run = PointRun {
                params: Arc::new(params),
                ..run.clone()
            };
            (follows, place, run)
        }));
    }
    all.sort_by_key(|(follows, place, run)| (*follows, *place, run.position));
    all.into_iter().map(|(.., run)| run).collect()
}

/// Parameters named by the shear of the last of the segments that are shown, which is that of the
/// averages.
pub(super) fn shown(params: &Params, segments: usize) -> Params {
    let mut cut = params.clone();
    cut.segments.truncate(segments);
    cut.by_last_segment()
}

/// Names each run by the shear of its last segment.
fn name_by_last_segment(runs: &mut [PointRun], segments: usize) {
    let mut last: Option<[Arc<Params>; 2]> = None;
    for run in runs
        .iter_mut()
        .filter(|run| !run.params.segments.is_empty())
    {
        // Runs of a point come one after the other.
        let of = match last.take() {
            Some(of) if of[0] == run.params => of,
            _ => [run.params.clone(), Arc::new(shown(&run.params, segments))],
        };
        run.params = of[1].clone();
        last = Some(of);
    }
}

/// The runs of the points selected.
fn selected(
    runs: Vec<PointRun>,
    written: &AsWritten,
    selection: &Selection,
) -> Result<Vec<PointRun>, ReportError> {
    // The store may be shown up to one of its segments.
    let segments = runs.first().map_or(0, |run| run.params.segments.len());
    let mut runs = as_written(runs, written);
    name_by_last_segment(&mut runs, segments);
    let params: Vec<&Params> = runs.iter().map(|run| run.params.as_ref()).collect();
    selection.check(&params)?;
    runs.retain(|run| selection.has(&run.params));
    Ok(runs)
}

impl Point {
    /// A measured number; `None` for a missing one.
    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        let number = self.measured.get(columns::place(name)?);
        number.copied().filter(|number| !number.is_nan())
    }

    /// Γ: imposed, or that of the mean viscosity where the stress is imposed.
    pub(crate) fn shear_rate(&self) -> Option<f64> {
        match self.params.last_shear() {
            (rate, None) => Some(rate),
            (_, Some(stress)) => self.viscosity.map(|eta| 6.0 * PI * stress / eta.mean),
        }
    }

    /// The input for converting its numbers to physical units.
    pub(super) fn at(&self) -> At {
        At::new(&self.params, self.shear_rate())
    }

    /// σ*: imposed, or that of the mean viscosity where the rate is imposed.
    pub(super) fn shear_stress(&self) -> Option<Estimate> {
        let (rate, stress) = self.params.last_shear();
        if let Some(stress) = stress {
            return Some(Estimate::bare(stress));
        }
        let factor = rate / (6.0 * PI);
        self.viscosity.map(|eta| Estimate {
            ci95: eta.ci95.map(|width| factor * width),
            ..Estimate::bare(factor * eta.mean)
        })
    }

    /// Its position along an axis, measured where rate or stress is a result; NaN where unknown.
    pub(super) fn place(&self, axis: &Axis) -> f64 {
        // Segments may impose another rate or stress than the grid.
        if axis.is_of_shear() && axis.means_something(&self.params) {
            axis.number(&self.params)
        } else if axis.is_shear_rate() {
            self.shear_rate().unwrap_or(f64::NAN)
        } else if axis.is_shear_stress() {
            self.shear_stress().map_or(f64::NAN, |stress| stress.mean)
        } else {
            axis.number(&self.params)
        }
    }

    /// Whether most of its runs jammed.
    pub(super) fn is_jammed(&self) -> bool {
        self.jammed > self.seeds
    }

    /// Whether soft contacts yielded by more than the roughness height, so that the spheres
    /// themselves overlapped.
    pub(super) fn overlaps_too_much(&self) -> bool {
        let height = self.params.roughness;
        let overlap = self.number("overlap").filter(|_| height > 0.0);
        !is_rigid(&self.params) && overlap.is_some_and(|overlap| overlap > height)
    }

    /// The mean over runs in a column, with the half width of its interval from the column beside
    /// it.
    pub(super) fn estimate(&self, name: &str) -> Option<Estimate> {
        Some(Estimate {
            ci95: self.number(&format!("{name}_ci95")),
            ..Estimate::bare(self.number(name)?)
        })
    }

    /// A point with only its viscosity and the numbers of runs averaged, jammed and failed.
    #[cfg(test)]
    pub(super) fn synthetic(
        params: Params,
        viscosity: Option<Estimate>,
        [seeds, jammed, failed]: [u64; 3],
    ) -> Self {
        Self {
            params,
            seeds,
            jammed,
            failed,
            viscosity,
            rule: None,
            trend: None,
            measured: Box::default(),
        }
    }

    fn of(runs: &Runs<'_>) -> Self {
        Self {
            params: Params::clone(&runs.all[0].params),
            seeds: runs.averaged.len() as u64,
            jammed: runs.number_of(|run| run.state == State::Jammed),
            failed: runs.number_of(|run| run.state == State::Failed),
            viscosity: runs.estimate("viscosity"),
            rule: runs.rule,
            trend: None,
            measured: measure(runs),
        }
    }
}
