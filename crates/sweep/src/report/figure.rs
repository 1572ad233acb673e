//! Figures: their content, and its one form, from which all of them are drawn.
//!
//! ```text
//! quantities what a figure shows of points
//! source     the points of a report on the axes of a figure
//! data       points of a report, or runs in time, as curves
//! outline    curves with colours, ends and ticks of axes: what this program and others draw
//! layout     positions on the page
//! svg        shapes and texts as a file with its origin
//! graph      curves that are not points of a campaign
//! series     runs in time as curves
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
mod quantities;
pub(super) mod scale;
mod series;
mod source;
mod svg;

pub(super) use graph::draw_curves;
pub use graph::{Graph, draw_graphs};
pub(super) use origin::Origin;
pub use outline::Outline;
pub(super) use outline::{Curve, CurveKind};
pub(super) use plane::{Key, Mark, PlanePicture, draw_plane};
pub(super) use series::mean_trace;
pub use series::traces;
pub(super) use source::default_axis;

use super::error::ReportError;
use super::points::Report;
use super::references::Reference;
use crate::measure::numbers::Number;
use crate::measure::{Estimate, PointRun};
use crate::model::axes::Axis;
use crate::text::choices::choices;
pub(super) use palette::{COLOURS, Colour};
use sd_core::Params;

choices! {
    /// Kind of a figure.
    Kind {
        Curve = "curve", "A number of the points (--quantity) with 95 % intervals, plateaus of Γ = 0 and ∞ at the edges; of viscosities the dilute limit dashed, but not along a fraction: 1 + 5c/3, or 1 + 5φ/2 of a suspension";
        Contacts = "contacts", "Pairs in contact, activated, rolling and slipping, per sphere";
        FrictionLaw = "mu-j", "Macroscopic friction coefficient σ/P₂₂ against the viscous number J";
        FractionLaw = "phi-j", "Volume or area fraction against the viscous number J";
        NormalStress = "normal-stress", "N₁/σ and N₂/σ";
        Divergence = "divergence", "Viscosity and normal viscosity against the distance of the fraction from jamming (--jamming)";
        Trace = "trace", "Viscosity against the strain since the start, mean over the finished runs of a point with the 95 % Student interval over runs as a band";
        Parts = "parts", "The same by its causes: stresslets, normal contact forces, friction, repulsion";
        Distribution = "distribution", "Probability density of the viscosity in time";
        Spectrum = "spectrum", "Power spectrum of the viscosity in time";
        Lissajous = "lissajous", "Stress against strain in an oscillation, mean over its averaged cycles";
        FlowCurve = "flow-curve", "Shear stress σ* against shear rate Γ, whichever of them is imposed";
        StateDiagram = "state-diagram", "State of the flow in the plane of two axes: continuous, discontinuous, shear-jammed, jammed, failed";
    }
}

impl Kind {
    /// Whether it shows runs in time.
    pub(crate) fn is_in_time(self) -> bool {
        let kinds = [
            Self::Parts,
            Self::Distribution,
            Self::Spectrum,
            Self::Lissajous,
        ];
        self == Self::Trace || kinds.contains(&self)
    }
}

/// A number in place of an axis of the campaign.
#[derive(Debug, Clone, Copy)]
pub enum Against {
    /// A column of points.
    Number(&'static Number),
    /// The distance of the fraction below this one.
    Below(f64),
}

/// Options of a figure.
#[derive(Debug, Clone, Default)]
pub struct Drawing {
    /// Its kind.
    pub kind: Kind,
    /// The number of a curve; by default the viscosity.
    pub number: Option<&'static Number>,
    /// Horizontal axis; by default the shear rate where it varies, for contacts the friction.
    pub along: Option<&'static Axis>,
    /// What the horizontal axis shows in place of that axis, along which curves still run.
    pub against: Option<Against>,
    /// Published curves beside them.
    pub references: Vec<&'static Reference>,
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
    /// Its name among the curves of the same runs; empty if it is the only one.
    name: &'static str,
    /// Its seed, of one run.
    seed: Option<u64>,
    /// Number of runs averaged at each strain.
    runs: usize,
    /// Strain discarded from all its runs.
    discard: Option<f64>,
    /// Strain since the start and viscosity, or what other kinds show.
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
            name: "",
            seed: Some(run.seed),
            runs: 1,
            discard: Some(discard),
            points: points.collect(),
        }
    }
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
