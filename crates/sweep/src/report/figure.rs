//! Figures: content and file formats.
//!
//! ```text
//! sketch      points of reports as lines of panels
//! outline     the sketch with colours, ends and ticks of axes: all that another program needs to draw it
//! layout      the outline, or a picture of the plane of shear, as paths and texts on a page
//! svg, png, pdf   the page as a file with its origin
//! graph       paths that are no results of a campaign
//! chart       a trace in characters, for the terminal
//! ```

mod chart;
mod font;
mod graph;
mod layout;
mod legend;
pub(super) mod log_axis;
mod look;
mod origin;
mod outline;
pub(super) mod palette;
mod pdf;
mod png;
pub(super) mod scale;
mod scene;
mod sketch;
mod svg;

pub(crate) use chart::chart;
pub(super) use graph::{FitCurve, draw_fit, draw_graphs_of};
pub use graph::{Graph, draw_graphs};
pub(super) use layout::{Key, Mark, Picture};
use look::axis_among;
pub use look::{Intervals, LegendPlace, Length, Look, Range, Style};
pub(super) use origin::Origin;
pub use outline::Outline;

use super::error::ReportError;
use super::points::{Report, selected_runs};
use super::selection::Selection;
use crate::measure::Estimate;
use crate::model::axes::{Axis, Identity, identity};
use crate::store::{PointRun, Store};
use palette::ORDERED_CURVES;
pub(super) use palette::{COLOURS, Colour};
use scene::Page;
use sd_core::Params;
use sketch::Sketch;
use std::collections::BTreeMap;
use std::path::Path;

/// Kind of a figure.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// Viscosity with 95 % intervals, plateaus of Γ = 0 and ∞ at the edges, the dilute limit
    /// dashed: 1 + 5c/3, or 1 + 5φ/2 of a suspension.
    #[default]
    Viscosity,
    /// Pairs in contact, activated, rolling and slipping, per sphere.
    Contacts,
    /// Viscosity against the strain since the start, mean over the finished runs of a point with
    /// the 95 % Student interval over runs as a band.
    Trace,
    /// First normal stress difference with 95 % intervals.
    NormalStress,
    /// Second normal stress difference.
    SecondNormalStress,
    /// Particle pressure of contacts and repulsion.
    ParticlePressure,
    /// Shear stress σ* against shear rate Γ, whichever of them is imposed.
    FlowCurve,
    /// Mean approach velocity of the pairs in contact.
    ApproachVelocity,
    /// State of the flow in the plane of --x and --y: continuous, discontinuous, shear-jammed,
    /// jammed, failed.
    StateDiagram,
}

/// The viscosity of a figure, by the names of the columns of tables.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Quantity {
    /// In full, contact stress included.
    #[default]
    #[value(name = "viscosity")]
    Viscosity,
    /// From the stresslets alone, as eq. (20) of the paper reads.
    #[value(name = "viscosity_stresslet")]
    ViscosityStresslet,
    /// Median over runs of their medians in time, insensitive to spikes near jamming, with the
    /// quartiles over runs.
    #[value(name = "viscosity_median")]
    ViscosityMedian,
}

/// Options of a figure.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Drawing {
    /// Kind of the figure
    #[arg(long, value_enum, default_value_t, requires = "figure")]
    pub kind: Kind,
    /// Viscosity of the figure [default: viscosity]
    #[arg(long, value_enum, requires = "figure", hide_short_help = true)]
    pub quantity: Option<Quantity>,
    /// Horizontal axis, by its key in the campaign file or its symbol [default: the shear rate
    /// where it varies; for contacts the friction]
    #[arg(long, value_name = "AXIS", value_parser = axis_among(Axis::is_numeric), requires = "figure", hide_possible_values = true)]
    pub along: Option<&'static Axis>,
    /// Horizontal axis of a state diagram [default: area_fraction, or volume_fraction of
    /// suspensions]
    #[arg(long, value_name = "AXIS", value_parser = axis_among(Axis::is_numeric), requires = "figure", hide_possible_values = true, hide_short_help = true)]
    pub x: Option<&'static Axis>,
    /// Vertical axis of a state diagram: shear_stress or shear_rate [default: what is imposed]
    #[arg(long, value_name = "AXIS", value_parser = axis_among(Axis::is_of_shear), requires = "figure", hide_possible_values = true, hide_short_help = true)]
    pub y: Option<&'static Axis>,
    /// Its style.
    #[command(flatten)]
    pub look: Look,
}

/// Format of a figure, by the ending of its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// Vector, for the web and for drawing programs.
    Svg,
    /// Vector, for papers.
    Pdf,
    /// Raster.
    Png,
}

impl Format {
    /// The format by the name of a file.
    ///
    /// # Errors
    /// A message, on another ending.
    pub fn of_file(path: &Path) -> Result<Self, String> {
        let ending = path.extension().and_then(|ending| ending.to_str());
        let found =
            ending.and_then(|ending| <Self as clap::ValueEnum>::from_str(ending, true).ok());
        found.ok_or_else(|| {
            format!(
                "a name that ends with .svg, .pdf or .png, not {}",
                path.display()
            )
        })
    }
}

/// A run in time, or the mean over runs of a point.
#[derive(Debug)]
pub struct Trace {
    /// Its campaign.
    campaign: String,
    /// Its parameters.
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
    let usual = match protocol.discard {
        crate::model::protocol::Discard::Strain(strain) => Some(strain - start),
        crate::model::protocol::Discard::Auto => None,
    };
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
            .map(|(run, _)| run.discard.map(|discard| discard - start).or(usual));
        all.push(Trace {
            campaign: campaign.clone(),
            params: (*first.params).clone(),
            seed: (counted == 0).then_some(first.seed),
            runs: traces.len(),
            discard: discards.flatten().reduce(f64::max),
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

/// Draws a figure: of reports, or of traces.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw, or too much.
pub fn draw(
    reports: &[Report],
    traces: &[Trace],
    drawing: &Drawing,
    format: Format,
) -> Result<Vec<u8>, ReportError> {
    let sketch = sketch::sketch(reports, traces, drawing, true)?;
    drawn(&sketch, &drawing.look, &Origin::of(reports), format)
}

/// The same figure for another program: in one panel unless several are requested.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw, or too much.
pub fn outline(
    reports: &[Report],
    traces: &[Trace],
    drawing: &Drawing,
) -> Result<Outline, ReportError> {
    let sketch = sketch::sketch(reports, traces, drawing, false)?;
    Outline::of(&sketch, &drawing.look)
}

/// Draws a sketch.
fn drawn(
    sketch: &Sketch,
    look: &Look,
    origin: &Origin,
    format: Format,
) -> Result<Vec<u8>, ReportError> {
    let page = layout::page(&Outline::of(sketch, look)?);
    file(&page, look.style.dpi, format, origin)
}

/// Writes a picture of the plane of shear as a file.
pub(super) fn draw_picture(
    picture: &Picture,
    origin: &Origin,
    format: Format,
) -> Result<Vec<u8>, ReportError> {
    let page = layout::picture(picture)?;
    file(&page, Style::default().dpi, format, origin)
}

/// Writes a page as a file.
fn file(page: &Page, dpi: u32, format: Format, origin: &Origin) -> Result<Vec<u8>, ReportError> {
    match format {
        Format::Svg => Ok(svg::write(page, origin)),
        Format::Pdf => pdf::write(page, origin).map_err(refused),
        Format::Png => png::write(page, dpi, origin).map_err(refused),
    }
}

/// The error about the figure.
fn refused(message: impl Into<String>) -> ReportError {
    ReportError::argument("--figure", message)
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
