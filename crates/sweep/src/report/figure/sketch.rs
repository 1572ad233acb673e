//! The data of a figure: lines of points, without style.

mod diagram;
mod draft;

use super::log_axis::LogAxis;
use super::palette::{CURVES, ORDERED_CURVES};
use super::{Drawing, Kind, Quantity, Trace, refused};
use crate::measure::Estimate;
use crate::model::axes::AXES;
use crate::report::columns::Column;
use crate::report::curves::Label;
use crate::report::error::ReportError;
use crate::report::points::{Point, Report};
use draft::Draft;

/// Maximum number of panels of an automatic split.
const PANELS: usize = 12;

/// A point of a line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    /// Its position along the axis.
    pub(super) x: f64,
    /// Its value; `None` for a point of the campaign without a result.
    pub(super) y: Option<Height>,
    /// Ends of the interval of its position.
    pub(super) across: Option<[f64; 2]>,
}

/// A value and its interval.
#[derive(Debug, Clone, Copy)]
pub(super) struct Height {
    pub(super) value: f64,
    /// Extent of the interval down and up.
    pub(super) interval: Option<[f64; 2]>,
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// Markers joined by a line.
    Curve,
    /// A thin line without markers.
    Trace,
    /// Unconnected markers.
    Points,
    /// Unconnected crosses.
    Crosses,
}

/// One line of a figure.
#[derive(Debug)]
pub(super) struct Line {
    /// Its entry in the legend.
    pub(super) label: Label,
    /// Its points.
    pub(super) points: Vec<Spot>,
    /// Its index among the curves of the figure, which selects colour and marker.
    pub(super) place: usize,
    pub(super) form: Form,
    /// Its panel.
    pub(super) panel: usize,
    /// Strain discarded, of a run in time.
    pub(super) discard: Option<f64>,
    /// Number of runs averaged by a line in time.
    pub(super) runs: usize,
}

impl Line {
    pub(super) fn new(label: Label, points: Vec<Spot>, form: Form, panel: usize) -> Self {
        Self {
            label,
            points,
            place: 0,
            form,
            panel,
            discard: None,
            runs: 0,
        }
    }
}

/// One panel.
#[derive(Debug, Default)]
pub(super) struct Field {
    /// Common values of its points.
    pub(super) title: String,
    /// Dilute limits.
    pub(super) dilute: Vec<f64>,
    /// Their label.
    pub(super) formula: &'static str,
}

/// The data of a figure.
#[derive(Debug, Default)]
pub(super) struct Sketch {
    pub(super) lines: Vec<Line>,
    pub(super) panels: Vec<Field>,
    /// Number of curves with ordered colours; 0 for unordered colours.
    pub(super) ordered: usize,
    /// Label of the horizontal axis.
    pub(super) x: String,
    /// Label of the vertical axis.
    pub(super) y: String,
    /// Its horizontal axis, if that is logarithmic.
    pub(super) log: Option<LogAxis>,
    /// Whether the vertical axis is linear whatever its values.
    pub(super) is_linear: bool,
}

/// A quantity of every point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measured {
    /// Label of its axis.
    label: &'static str,
    /// Its column.
    name: &'static str,
    /// Its unit.
    unit: &'static str,
}

impl From<Estimate> for Height {
    fn from(estimate: Estimate) -> Self {
        Self {
            value: estimate.mean,
            interval: estimate.ci95.map(|half| [half, half]),
        }
    }
}

impl Height {
    /// A value without an interval.
    pub(super) fn bare(value: f64) -> Self {
        Self {
            value,
            interval: None,
        }
    }
}

/// Makes the sketch of reports, or of traces. If there are more curves than can be distinguished
/// and splitting is allowed, each value of one axis has its own panel; the axis is the one with the
/// fewest values among those that help.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw, or too much.
pub(super) fn sketch(
    reports: &[Report],
    traces: &[Trace],
    drawing: &Drawing,
    may_split: bool,
) -> Result<Sketch, ReportError> {
    let whole = drafted(reports, traces, drawing)?;
    let Some((number, most)) = excess(&whole.1) else {
        return arranged(whole, drawing);
    };
    let in_panels = |axis| {
        let mut drawing = drawing.clone();
        drawing.look.panels = Some(axis);
        let split = drafted(reports, traces, &drawing).ok()?;
        excess(&split.1).is_none().then_some((split, drawing))
    };
    let by_itself = AXES
        .iter()
        .filter(|_| may_split && drawing.look.panels.is_none());
    let split = by_itself.filter_map(in_panels);
    let split = split.filter(|((_, sketch), _)| sketch.panels.len() <= PANELS);
    if let Some((split, drawing)) = split.min_by_key(|((_, sketch), _)| sketch.panels.len()) {
        return arranged(split, &drawing);
    }
    let (more, how) = if drawing.kind == Kind::Trace {
        (" or more", "runs with --where KEY=VALUE or --case CASE")
    } else {
        (
            "",
            "points with --where KEY=VALUE, the axis they run along with --along, or another axis of --panels",
        )
    };
    Err(refused(format!(
        "{number}{more} curves are more than the {most} that can be distinguished: choose {how}"
    )))
}

/// The sketch before its curves are ordered.
fn drafted<'r>(
    reports: &'r [Report],
    traces: &[Trace],
    drawing: &Drawing,
) -> Result<(Draft<'r>, Sketch), ReportError> {
    let diagram = match drawing.kind {
        Kind::StateDiagram => Some(diagram::axes(reports, drawing)?),
        _ => None,
    };
    let along = diagram.map_or(drawing.along, |[x, _]| Some(x));
    let draft = Draft::of(
        reports,
        &Drawing {
            along,
            ..drawing.clone()
        },
    )?;
    let measured = Measured::of(drawing);
    draft.check_units(measured)?;
    let mut sketch = match (drawing.kind, diagram) {
        (_, Some([_, y])) => draft.diagram(y)?,
        (Kind::Contacts, None) => draft.contacts(),
        (Kind::Trace, None) => draft.in_time(traces),
        _ => draft.of_points(measured),
    };
    if matches!(drawing.kind, Kind::Trace | Kind::Viscosity)
        && !(drawing.kind == Kind::Viscosity && draft.along.is_fraction())
    {
        draft.add_dilute(&mut sketch, traces, drawing.kind);
    }
    let has_result = |line: &Line| line.points.iter().any(|spot| spot.y.is_some());
    if !sketch.lines.iter().any(has_result) {
        draft.check_scale(measured)?;
        return Err(refused(
            "there are no results to draw yet; `sweep status` shows the progress of the campaign",
        ));
    }
    sketch.lines.retain(|line| !line.points.is_empty());
    Ok((draft, sketch))
}

/// The sketch with its curves in order, and further marks.
fn arranged(
    (draft, mut sketch): (Draft<'_>, Sketch),
    drawing: &Drawing,
) -> Result<Sketch, ReportError> {
    // In a state diagram each state has a fixed colour, even if others are absent.
    if drawing.kind != Kind::StateDiagram {
        arrange(&mut sketch, drawing)?;
    }
    draft.note_doubtful(&mut sketch, drawing.kind);
    let crosses = draft.jammed(drawing.kind, &sketch);
    sketch.lines.extend(crosses);
    Ok(sketch)
}

/// The labels of the curves, each once, and whether colours are ordered.
fn labels(sketch: &Sketch) -> (Vec<Label>, bool) {
    let mut known: Vec<Label> = Vec::new();
    for line in &sketch.lines {
        if !known.iter().any(|label| label.words == line.label.words) {
            known.push(line.label.clone());
        }
    }
    let is_ordered = known.len() > CURVES && known.iter().all(|label| label.number.is_some());
    (known, is_ordered)
}

/// Number of curves and maximum number, if exceeded.
fn excess(sketch: &Sketch) -> Option<(usize, usize)> {
    let (known, is_ordered) = labels(sketch);
    let most = if is_ordered { ORDERED_CURVES } else { CURVES };
    (known.len() > most).then_some((known.len(), most))
}

/// Gives every curve its index by its label, the same in all panels, and the labels requested.
fn arrange(sketch: &mut Sketch, drawing: &Drawing) -> Result<(), ReportError> {
    let (mut known, is_ordered) = labels(sketch);
    if is_ordered {
        let number = |label: &Label| label.number.unwrap_or(f64::NAN);
        known.sort_by(|a, b| number(a).total_cmp(&number(b)));
        sketch.ordered = known.len();
    }
    let asked = &drawing.look.labels;
    if !asked.is_empty() && asked.len() != known.len() {
        let there = known.iter().map(|label| format!("{:?}", label.words));
        let message = format!(
            "{} labels for {} curves, which are in order: {}",
            asked.len(),
            known.len(),
            there.collect::<Vec<_>>().join(", ")
        );
        return Err(ReportError::argument("--label", message));
    }
    for line in &mut sketch.lines {
        let place = known
            .iter()
            .position(|label| label.words == line.label.words)
            .unwrap_or(0);
        line.place = place;
        if let Some(label) = asked.get(place) {
            line.label.words.clone_from(label);
        }
    }
    sketch.lines.sort_by_key(|line| (line.panel, line.place));
    Ok(())
}

impl Measured {
    /// The quantity of a figure.
    fn of(drawing: &Drawing) -> Self {
        let (label, name) = match (drawing.kind, drawing.quantity.unwrap_or_default()) {
            (Kind::NormalStress, _) => ("normal stress difference N₁", "normal_stress_difference"),
            (Kind::SecondNormalStress, _) => ("normal stress difference N₂", "n2"),
            (Kind::ParticlePressure, _) => ("particle pressure Π", "particle_pressure"),
            (Kind::FlowCurve, _) => ("shear stress σ*", "shear_stress"),
            (Kind::ApproachVelocity, _) => ("mean approach velocity", "mean_approach_velocity"),
            (Kind::Contacts, _) => ("pairs per sphere", "contacts_per_sphere"),
            (_, Quantity::ViscosityStresslet) => ("stresslet viscosity", "viscosity_stresslet"),
            (_, Quantity::ViscosityMedian) => ("median viscosity", "viscosity_median"),
            (_, Quantity::Viscosity) => ("relative viscosity η", "viscosity"),
        };
        Self {
            label,
            name,
            unit: Column::named(name).map_or("", |column| column.unit),
        }
    }

    /// Its value at a point.
    fn read(self, point: &Point) -> Option<Height> {
        match self.name {
            "shear_stress" => point.shear_stress().map(Height::from),
            "viscosity_median" => {
                let value = point.number(self.name)?;
                let quartile = |n: u8| point.number(&format!("{}_quartile_{n}", self.name));
                let quartiles = quartile(1).zip(quartile(3));
                Some(Height {
                    value,
                    interval: quartiles.map(|(low, high)| [value - low, high - value]),
                })
            }
            name => point.estimate(name).map(Height::from),
        }
    }
}
