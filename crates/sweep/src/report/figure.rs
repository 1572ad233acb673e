//! Figures: their content, and its one form, from which all of them are drawn.
//!
//! ```text
//! data       points of a report, or runs in time, as curves
//! outline    curves with colours, ends and ticks of axes: what this program and others draw
//! layout     positions on the page
//! svg        shapes and texts as a file with its origin
//! graph      curves that are not points of a campaign
//! plane      a square of the plane of flow and gradient
//! ```

mod data;
mod diagram;
mod font;
mod graph;
mod layout;
mod origin;
mod outline;
pub(super) mod palette;
mod plane;
pub(super) mod scale;
mod svg;

pub(super) use data::default_axis;
pub(super) use graph::draw_curves;
pub use graph::{Graph, draw_graphs};
pub(super) use origin::Origin;
pub use outline::Outline;
pub(super) use outline::{Curve, CurveKind};
pub(super) use plane::{Key, Mark, PlanePicture, draw_plane};

use super::error::ReportError;
use super::points::{Report, selected_runs};
use super::selection::Selection;
use crate::measure::numbers::Number;
use crate::measure::{Estimate, PointRun};
use crate::model::axes::{Axis, identity};
use crate::store::Store;
use crate::text::choices::choices;
use palette::ORDERED_CURVES;
pub(super) use palette::{COLOURS, Colour};
use sd_core::Params;
use std::collections::{BTreeMap, HashMap};

choices! {
    /// Kind of a figure.
    Kind {
        Curve = "curve", "A number of the points (--quantity) with 95 % intervals, plateaus of Γ = 0 and ∞ at the edges; of viscosities the dilute limit dashed: 1 + 5c/3, or 1 + 5φ/2 of a suspension";
        Contacts = "contacts", "Pairs in contact, activated, rolling and slipping, per sphere";
        Trace = "trace", "Viscosity against the strain since the start, mean over the finished runs of a point with the 95 % Student interval over runs as a band";
        FlowCurve = "flow-curve", "Shear stress σ* against shear rate Γ, whichever of them is imposed";
        StateDiagram = "state-diagram", "State of the flow in the plane of two axes: continuous, discontinuous, shear-jammed, jammed, failed";
    }
}

/// Options of a figure.
#[derive(Debug, Clone, Copy, Default)]
pub struct Drawing {
    /// Its kind.
    pub kind: Kind,
    /// The number of a curve; by default the viscosity.
    pub number: Option<&'static Number>,
    /// Horizontal axis; by default the shear rate where it varies, for contacts the friction.
    pub along: Option<&'static Axis>,
    /// Horizontal axis of a state diagram; by default the fraction.
    pub x: Option<&'static Axis>,
    /// Vertical axis of a state diagram; by default what is imposed.
    pub y: Option<&'static Axis>,
    /// An axis with a panel for each of its values.
    pub panels: Option<&'static Axis>,
}

/// A run in time, or the mean over runs of a point.
#[derive(Debug)]
pub struct Trace {
    params: Params,
    /// Its seed, of one run.
    seed: Option<u64>,
    /// Number of runs averaged at each strain.
    runs: usize,
    /// Strain discarded from all its runs.
    discard: Option<f64>,
    /// Strain since the start, and viscosity.
    points: Vec<(f64, Estimate)>,
}

impl Trace {
    /// A run in time.
    pub(super) fn of_run(
        run: &PointRun,
        discard: f64,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        let points = points.into_iter().map(|(x, y)| (x, Estimate::bare(y)));
        Self {
            params: (*run.params).clone(),
            seed: Some(run.seed),
            runs: 1,
            discard: Some(discard),
            points: points.collect(),
        }
    }
}

/// Traces of the points selected: the `cases`, each named by its number in the campaign file or by
/// the beginning of its key, or else for each point the mean over its runs that averages count, at
/// the strains at which all of them have a sample. While none of these is finished, the first run
/// with samples is shown. At most one more than a figure can hold.
///
/// # Errors
/// An I/O or SQLite error; [`crate::store::StoreError::Case`] on a name that does not identify one
/// selected run.
pub fn traces(
    store: &Store,
    selection: &Selection,
    cases: &[String],
) -> Result<Vec<Trace>, ReportError> {
    let runs = selected_runs(store, selection)?;
    let mut keys = Vec::with_capacity(cases.len());
    for case in cases {
        let key = store.key_of(case)?;
        if !runs.iter().any(|run| run.key == key) {
            return Err(store.no_case(case, "no case of these points").into());
        }
        keys.push(key);
    }
    let protocol = store.protocol()?;
    // Shows the last segment, against the strain since its start.
    let last = protocol.segments.last();
    let start = last.map_or(0.0, |last| last.imposed.start);
    let usual = protocol.discard - start;
    // Runs of a point, or the cases one by one.
    let mut groups: Vec<Vec<&PointRun>> = Vec::new();
    let mut place_of = HashMap::new();
    for run in &runs {
        if keys.contains(&run.key) {
            groups.push(vec![run]);
        } else if keys.is_empty() {
            let place = *place_of
                .entry(identity(&run.params))
                .or_insert(groups.len());
            if place == groups.len() {
                groups.push(Vec::new());
            }
            groups[place].push(run);
        }
    }
    let mut all: Vec<Trace> = Vec::new();
    for group in groups {
        let is_counted = |run: &&PointRun| keys.is_empty() && selection.averages(run);
        let is_mean = group.iter().any(is_counted);
        let mut traces = Vec::new();
        for run in group {
            if is_mean && !selection.averages(run) || !is_mean && !traces.is_empty() {
                continue;
            }
            let mut trace = store.trace(&run.key)?;
            if last.is_some() {
                // Strains are sums of steps.
                trace.retain(|(strain, _)| (start - 1e-9..protocol.strain - 1e-9).contains(strain));
                for (strain, _) in &mut trace {
                    *strain -= start;
                }
            }
            if !trace.is_empty() {
                traces.push((run, trace));
            }
        }
        let Some((first, _)) = traces.first() else {
            continue;
        };
        let discards = traces
            .iter()
            .map(|(run, _)| run.discard().map_or(usual, |discard| discard - start));
        all.push(Trace {
            params: (*first.params).clone(),
            seed: (!is_mean).then_some(first.seed),
            runs: traces.len(),
            discard: discards.reduce(f64::max),
            points: mean_trace(traces.into_iter().map(|(_, trace)| trace)),
        });
        if all.len() > ORDERED_CURVES {
            break;
        }
    }
    Ok(all)
}

/// The mean of traces at the strains that all of them have.
pub(super) fn mean_trace(traces: impl Iterator<Item = Vec<(f64, f64)>>) -> Vec<(f64, Estimate)> {
    let mut at: BTreeMap<u64, (f64, Vec<f64>)> = BTreeMap::new();
    let mut number = 0;
    for trace in traces {
        number += 1;
        for (strain, viscosity) in trace {
            // Strains are sums of steps: those of the same step are the same.
            let (_, values) = at.entry(strain.to_bits()).or_insert((strain, Vec::new()));
            values.push(viscosity);
        }
    }
    let of_all = at.into_values().filter(|of| of.1.len() == number);
    of_all
        .filter_map(|(strain, values)| Some((strain, Estimate::of(&values)?)))
        .collect()
}

/// The outline of a figure of a report, or of traces.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw, or too much.
pub fn outline(
    report: &Report,
    traces: &[Trace],
    drawing: &Drawing,
) -> Result<Outline, ReportError> {
    Ok(data::figure_data(report, traces, drawing)?.outline())
}

/// Draws a figure of a report, or of traces, as SVG.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw, or too much.
pub fn draw(report: &Report, traces: &[Trace], drawing: &Drawing) -> Result<String, ReportError> {
    let outline = outline(report, traces, drawing)?;
    Ok(layout::draw(&outline, &Origin::of(report)))
}

/// Draws a figure of a report, or of traces, for a page that names their origin itself.
pub(super) fn draw_on_page(
    report: &Report,
    traces: &[Trace],
    drawing: &Drawing,
) -> Result<String, ReportError> {
    let outline = outline(report, traces, drawing)?;
    let origin = Origin::of_lines(&report.campaign, &[]);
    Ok(layout::draw(&outline, &origin))
}

/// The error about the figure.
fn refused(message: impl Into<String>) -> ReportError {
    ReportError::argument("figure", message)
}

#[cfg(test)]
mod tests {
    use super::mean_trace;

    #[test]
    fn traces_are_averaged_at_the_strains_that_all_runs_have() {
        let long = vec![(0.1, 1.0), (0.2, 4.0), (0.3, 5.0)];
        let gap = vec![(0.1, 3.0), (0.3, 7.0)];
        let mean = mean_trace([long.clone(), gap].into_iter());
        let means: Vec<(f64, f64)> = mean.iter().map(|(strain, e)| (*strain, e.mean)).collect();
        assert_eq!(means, [(0.1, 2.0), (0.3, 6.0)]);
        // t(0.975, 1) = 12.7062, and the standard error of 1 and 3 is 1.
        assert!((mean[0].1.ci95.unwrap() - 12.7062).abs() < 1e-4);
        let alone = mean_trace(std::iter::once(long));
        assert!(alone.len() == 3 && alone.iter().all(|(_, e)| e.ci95.is_none()));
    }
}
