//! Figures: their content, and its one form, from which all of them are drawn.
//!
//! ```text
//! data       points of reports, or runs in time, as curves
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

pub(super) use graph::draw_curves;
pub use graph::{Graph, draw_graphs};
pub(super) use origin::Origin;
pub use outline::Outline;
pub(super) use outline::{Curve, CurveKind};
pub(super) use plane::{Key, Mark, PlanePicture, draw_plane};

use super::error::ReportError;
use super::points::{Report, selected_runs};
use super::selection::Selection;
use crate::measure::Estimate;
use crate::measure::PointRun;
use crate::model::axes::{Axis, Identity, identity};
use crate::store::Store;
use crate::text::choices::choices;
use palette::ORDERED_CURVES;
pub(super) use palette::{COLOURS, Colour};
use sd_core::Params;
use std::collections::BTreeMap;

choices! {
    /// Kind of a figure.
    Kind {
        Viscosity = "viscosity", "Viscosity with 95 % intervals, plateaus of Γ = 0 and ∞ at the edges, the dilute limit dashed: 1 + 5c/3, or 1 + 5φ/2 of a suspension";
        Contacts = "contacts", "Pairs in contact, activated, rolling and slipping, per sphere";
        Trace = "trace", "Viscosity against the strain since the start, mean over the finished runs of a point with the 95 % Student interval over runs as a band";
        NormalStress = "normal-stress", "First normal stress difference with 95 % intervals";
        SecondNormalStress = "second-normal-stress", "Second normal stress difference";
        ParticlePressure = "particle-pressure", "Particle pressure of contacts and repulsion";
        FlowCurve = "flow-curve", "Shear stress σ* against shear rate Γ, whichever of them is imposed";
        ApproachVelocity = "approach-velocity", "Mean approach velocity of the pairs in contact";
        StateDiagram = "state-diagram", "State of the flow in the plane of two axes: continuous, discontinuous, shear-jammed, jammed, failed";
    }
}

choices! {
    /// The viscosity of a figure, by the names of the columns of tables.
    Quantity {
        Viscosity = "viscosity", "In full, contact stress included";
        ViscosityStresslet = "viscosity_stresslet", "From the stresslets alone, as eq. (20) of the paper reads";
        ViscosityMedian = "viscosity_median", "Median over runs of their medians in time, insensitive to spikes near jamming, with the quartiles over runs";
    }
}

/// Options of a figure.
#[derive(Debug, Clone, Default)]
pub struct Drawing {
    /// Its kind.
    pub kind: Kind,
    /// The viscosity that it shows.
    pub quantity: Quantity,
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
    campaign: String,
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
    let (campaign, protocol) = (store.campaign_name()?, store.protocol()?);
    // Shows the last segment, against the strain since its start.
    let start = protocol
        .segments
        .last()
        .map_or(0.0, |last| last.imposed.start);
    let usual = protocol.discard - start;
    // Runs of a point, or the cases one by one.
    let mut groups: Vec<(Option<Identity>, Vec<&PointRun>)> = Vec::new();
    for run in &runs {
        let point = keys.is_empty().then(|| identity(&run.params));
        match groups
            .iter_mut()
            .rev()
            .find(|(known, _)| known.is_some() && *known == point)
        {
            Some((_, group)) => group.push(run),
            None if keys.is_empty() || keys.contains(&run.key) => groups.push((point, vec![run])),
            None => {}
        }
    }
    let mut all: Vec<Trace> = Vec::new();
    for (point, group) in groups {
        let is_counted = |run: &&&PointRun| point.is_some() && selection.averages(run);
        let counted = group.iter().filter(is_counted).count();
        let mut traces = Vec::new();
        for run in group {
            let is_meant = if counted > 0 {
                selection.averages(run)
            } else {
                traces.is_empty()
            };
            let mut trace = if is_meant {
                store.trace(&run.key)?
            } else {
                Vec::new()
            };
            if !protocol.segments.is_empty() {
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
            campaign: campaign.clone(),
            params: (*first.params).clone(),
            seed: (counted == 0).then_some(first.seed),
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
    let whole = at
        .into_values()
        .filter(|(_, values)| values.len() == number);
    whole
        .filter_map(|(strain, values)| Some((strain, Estimate::of(&values)?)))
        .collect()
}

/// The outline of a figure of reports, or of traces.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw, or too much.
pub fn outline(
    reports: &[Report],
    traces: &[Trace],
    drawing: &Drawing,
) -> Result<Outline, ReportError> {
    Ok(data::figure_data(reports, traces, drawing)?.outline())
}

/// Draws a figure of reports, or of traces, as SVG.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw, or too much.
pub fn draw(
    reports: &[Report],
    traces: &[Trace],
    drawing: &Drawing,
) -> Result<Vec<u8>, ReportError> {
    let outline = outline(reports, traces, drawing)?;
    Ok(layout::draw(&outline, &Origin::of(reports)))
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
