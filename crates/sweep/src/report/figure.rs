//! What a figure shows: points as curves, or runs in time.

mod log_axis;
mod outline;
mod render;

pub use outline::Outline;
pub use render::Format;

use super::ReportError;
use super::curves::{curves, labels};
use super::{Point, Report, Selection, selected_runs};
use crate::axes::{AXES, Axis, identity};
use crate::statistics::Estimate;
use crate::store::{PointRun, Store};
use log_axis::LogAxis;
use outline::CURVES;
use render::render;
use sd_core::Params;

/// Style of the crosses of jammed layers.
const JAMMED_STYLE: usize = 6;

/// What a figure shows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// Viscosity with 95 % intervals, plateaus of Γ = 0 and ∞ at the edges, the dilute limit 1 + 5c/3 dashed.
    #[default]
    Viscosity,
    /// Pairs in contact, activated, rolling and slipping, per sphere.
    Contacts,
    /// Viscosity in time, one run per point.
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
}

/// Which viscosity a figure shows; named as the columns of the tables are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Quantity {
    /// In full, contact stress included.
    #[default]
    #[value(name = "viscosity")]
    Viscosity,
    /// From the stresslets alone, as eq. (20) of the paper reads.
    #[value(name = "viscosity_stresslet")]
    ViscosityStresslet,
    /// Median over runs of their medians in time, which spikes near jamming do not move.
    #[value(name = "viscosity_median")]
    ViscosityMedian,
}

/// What is to be drawn.
#[derive(Debug, Clone, Copy)]
pub struct Drawing {
    /// What the figure shows.
    pub kind: Kind,
    /// Which viscosity.
    pub quantity: Quantity,
    /// Its horizontal axis; `None` for Γ where it varies, for contacts ν where that does.
    pub along: Option<&'static Axis>,
}

/// One run in time.
#[derive(Debug)]
pub struct Trace {
    /// Its parameters.
    params: Params,
    /// Its seed.
    seed: u64,
    /// Strain and viscosity.
    points: Vec<(f64, f64)>,
}

/// One line of a figure.
#[derive(Debug)]
struct Line {
    /// Its entry in the legend.
    label: String,
    /// Place on the axis, mean, half the interval.
    points: Vec<(f64, f64, Option<f64>)>,
    /// Colour and marker.
    style: usize,
    /// Without markers.
    plain: bool,
    /// Whether its points are joined.
    joined: bool,
}

/// What a figure is made of.
#[derive(Debug, Default)]
struct Sketch {
    /// Its lines.
    lines: Vec<Line>,
    /// Heights of dashed lines.
    dashed: Vec<f64>,
    /// Label of the horizontal axis.
    x: String,
    /// Label of the vertical axis.
    y: &'static str,
    /// Its horizontal axis, if that is logarithmic.
    log: Option<LogAxis>,
}

/// Traces of runs of the points selected: those whose keys begin with one of `keys`, or else the first with samples of
/// each point. One more than a figure holds at most.
///
/// # Errors
/// Trouble with the store; [`crate::store::StoreError::Case`] on a key no selected run has.
pub fn traces(
    store: &Store,
    selection: &Selection,
    keys: &[String],
) -> Result<Vec<Trace>, ReportError> {
    let runs = selected_runs(store, selection)?;
    let begins = |run: &PointRun, key: &String| run.key.starts_with(key.as_str());
    if let Some(key) = keys
        .iter()
        .find(|key| !runs.iter().any(|run| begins(run, key)))
    {
        return Err(store.no_case(key, "no case").into());
    }
    let mut all: Vec<Trace> = Vec::new();
    for run in runs {
        let wanted = if keys.is_empty() {
            let point = identity(&run.params);
            !all.iter().any(|known| identity(&known.params) == point)
        } else {
            keys.iter().any(|key| begins(&run, key))
        };
        if !wanted || all.len() > CURVES {
            continue;
        }
        let points = store.trace(&run.key)?;
        if !points.is_empty() {
            all.push(Trace {
                params: run.params,
                seed: run.seed,
                points,
            });
        }
    }
    Ok(all)
}

/// Draws a figure: of a report, or of traces.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw, or too much.
pub fn draw(
    report: &Report,
    traces: &[Trace],
    drawing: Drawing,
    format: Format,
) -> Result<Vec<u8>, ReportError> {
    render(&outline(report, traces, drawing)?, format).map_err(refused)
}

/// The same figure, to be drawn by another program.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw, or too much.
pub fn outline(
    report: &Report,
    traces: &[Trace],
    drawing: Drawing,
) -> Result<Outline, ReportError> {
    let along = drawing
        .along
        .unwrap_or_else(|| default_axis(report, drawing.kind));
    if drawing.kind == Kind::FlowCurve && !along.is_shear_rate() {
        return Err(ReportError::Argument {
            argument: "--along",
            message: "a flow curve is stress against rate: it runs along shear_rate".into(),
        });
    }
    let mut sketch = match drawing.kind {
        Kind::Viscosity => viscosity(report, along, drawing.quantity),
        Kind::NormalStress => of_points(report, along, "normal stress difference N₁", |p| {
            p.normal_stress_difference
        }),
        Kind::SecondNormalStress => {
            of_points(report, along, "normal stress difference N₂", |p| {
                p.stress("n2")
            })
        }
        Kind::ParticlePressure => of_points(report, along, "particle pressure Π", |p| {
            p.stress("particle_pressure")
        }),
        Kind::FlowCurve => of_points(
            report,
            along,
            "shear stress σ* (F_crit/a²)",
            Point::shear_stress,
        ),
        Kind::ApproachVelocity => of_points(report, along, "mean approach velocity", |p| {
            p.mean_approach_velocity.map(Estimate::bare)
        }),
        Kind::Contacts => contacts(report, along),
        Kind::Trace => in_time(traces),
    };
    if sketch.lines.iter().all(|line| line.points.is_empty()) {
        return Err(refused(
            "there are no results to draw yet; `sweep status` says how far the campaign is".into(),
        ));
    }
    if report.doubtful > 0 && drawing.kind != Kind::Trace {
        let what = if report.with_doubtful {
            "averaged too"
        } else {
            "left out"
        };
        sketch.x = format!("{} ({} doubtful runs {what})", sketch.x, report.doubtful);
    }
    let curves = sketch.lines.len();
    if curves > CURVES {
        let how = match drawing.kind {
            Kind::Trace => "choose runs with --where KEY=VALUE or --case KEY",
            _ => "choose points with --where KEY=VALUE, or the axis they run along with --along",
        };
        let more = if drawing.kind == Kind::Trace {
            " or more"
        } else {
            ""
        };
        return Err(refused(format!(
            "{curves}{more} curves, and at most {CURVES} can be told apart: {how}"
        )));
    }
    let crosses = jammed(report, along, drawing.kind, &sketch);
    sketch.lines.extend(crosses);
    Ok(Outline::of(&sketch))
}

/// The error about a figure.
fn refused(message: String) -> ReportError {
    ReportError::Argument {
        argument: "--figure",
        message,
    }
}

/// Draws the paths of spheres that pass: the centres of the first and the second, in a.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw.
pub fn draw_paths(paths: [Vec<(f64, f64)>; 2], format: Format) -> Result<Vec<u8>, ReportError> {
    let lines = paths.into_iter().zip(["first sphere", "second sphere"]);
    let sketch = Sketch {
        lines: lines
            .enumerate()
            .map(|(style, (path, label))| Line {
                label: label.into(),
                points: path.into_iter().map(|(x, y)| (x, y, None)).collect(),
                style,
                plain: true,
                joined: true,
            })
            .collect(),
        x: "x / a".into(),
        y: "y / a",
        ..Sketch::default()
    };
    render(&Outline::of(&sketch), format).map_err(refused)
}

/// The axis of a figure if the user names none: the first that varies.
fn default_axis(report: &Report, kind: Kind) -> &'static Axis {
    let first = match kind {
        Kind::Contacts => "friction",
        // Stress against rate, whichever is imposed.
        Kind::FlowCurve => return Axis::of_key("shear_rate").unwrap_or(&AXES[0]),
        _ => "shear_rate",
    };
    let order = [
        first,
        "shear_stress",
        "shear_rate",
        "area_fraction",
        "friction",
    ];
    let mut order: Vec<&Axis> = order.into_iter().filter_map(Axis::of_key).collect();
    order.extend(AXES.iter().filter(|axis| axis.is_numeric()));
    order
        .iter()
        .find(|axis| axis.varies(report.points.iter().map(|point| &point.params)))
        .unwrap_or(&order[0])
}

/// The dilute limit 1 + 5c/3 of every area fraction.
fn dilute<'p>(params: impl Iterator<Item = &'p Params>) -> Vec<f64> {
    let mut heights: Vec<f64> = Vec::new();
    for height in params.map(|p| 1.0 + 5.0 * p.area_fraction / 3.0) {
        if !heights.iter().any(|h| (h - height).abs() < 1e-9) {
            heights.push(height);
        }
    }
    heights
}

/// Traces with the dilute limit of their layers.
fn in_time(traces: &[Trace]) -> Sketch {
    let params: Vec<&Params> = traces.iter().map(|trace| &trace.params).collect();
    let lines = traces
        .iter()
        .zip(labels(&params, None))
        .enumerate()
        .map(|(style, (trace, label))| {
            let same = |other: &&Trace| identity(&other.params) == identity(&trace.params);
            let label = match (traces.iter().filter(same).count(), label.as_str()) {
                (1, _) => label,
                (_, "") => format!("seed {}", trace.seed),
                _ => format!("{label}, seed {}", trace.seed),
            };
            Line {
                label,
                points: trace.points.iter().map(|&(x, y)| (x, y, None)).collect(),
                style,
                plain: true,
                joined: true,
            }
        })
        .collect();
    Sketch {
        lines,
        dashed: dilute(params.into_iter()),
        x: "strain".into(),
        y: "relative viscosity η",
        log: None,
    }
}

/// The horizontal axis of a report's points.
fn axis(report: &Report, along: &Axis) -> Option<LogAxis> {
    let values: Vec<f64> = report
        .points
        .iter()
        .map(|p| p.place(along))
        // Layers that bear their stress at rest stand at a rate of 0.
        .chain(
            report
                .points
                .iter()
                .filter(|p| along.is_shear_rate() && bears(p))
                .map(|_| 0.0),
        )
        .collect();
    along.is_logarithmic().then(|| LogAxis::of(&values))
}

/// Place of a point.
fn place(log: Option<LogAxis>, along: &Axis, point: &Point) -> f64 {
    let value = point.place(along);
    log.map_or(value, |log| log.place(value))
}

/// One of the viscosities, with the dilute limit unless c is the axis.
fn viscosity(report: &Report, along: &Axis, quantity: Quantity) -> Sketch {
    let mut sketch = match quantity {
        Quantity::Viscosity => of_points(report, along, "relative viscosity η", |p| p.viscosity),
        Quantity::ViscosityStresslet => of_points(report, along, "stresslet viscosity", |p| {
            p.viscosity_stresslet
        }),
        Quantity::ViscosityMedian => of_points(report, along, "median viscosity", |p| {
            p.viscosity_median.map(Estimate::bare)
        }),
    };
    if along.key != "area_fraction" {
        sketch.dashed = dilute(report.points.iter().map(|point| &point.params));
    }
    sketch
}

/// Whether runs of it ended jammed under an imposed stress.
fn bears(point: &Point) -> bool {
    point.params.shear_stress.is_some() && point.jammed > 0
}

/// Crosses for the points with runs that jammed under an imposed stress: at a rate of 0 in a flow curve, above all that flows among
/// viscosities.
fn jammed(report: &Report, along: &Axis, kind: Kind, sketch: &Sketch) -> Option<Line> {
    let heights = sketch.lines.iter().flat_map(|line| &line.points);
    let top = 1.5
        * heights
            .map(|point| point.1)
            .fold(f64::NEG_INFINITY, f64::max);
    let jammed = report.points.iter().filter(|point| bears(point));
    let points: Vec<(f64, f64, Option<f64>)> = jammed
        .filter_map(|point| {
            let stress = point.params.shear_stress?;
            let (x, height) = match kind {
                Kind::FlowCurve => (0.0, stress),
                Kind::Viscosity if along.is_shear_rate() => (0.0, top),
                Kind::Viscosity => (point.place(along), top),
                _ => return None,
            };
            Some((sketch.log.map_or(x, |log| log.place(x)), height, None))
        })
        .collect();
    let is_drawn = !points.is_empty() && points.iter().all(|point| point.1.is_finite());
    is_drawn.then(|| Line {
        label: "jammed at this stress".into(),
        points,
        style: JAMMED_STYLE,
        plain: false,
        joined: false,
    })
}

/// One line per curve of one quantity.
fn of_points(
    report: &Report,
    along: &Axis,
    y: &'static str,
    quantity: fn(&Point) -> Option<Estimate>,
) -> Sketch {
    let log = axis(report, along);
    let lines = curves(report, along)
        .into_iter()
        .enumerate()
        .map(|(style, curve)| Line {
            points: curve
                .points
                .iter()
                .filter_map(|point| {
                    let estimate = quantity(point).filter(|e| e.mean.is_finite())?;
                    // Where no run has told the rate yet, a stress that is imposed has no place.
                    let place = Some(place(log, along, point)).filter(|place| place.is_finite())?;
                    Some((place, estimate.mean, estimate.ci95))
                })
                .collect(),
            label: curve.label,
            style,
            plain: false,
            joined: true,
        })
        .collect();
    Sketch {
        lines,
        x: along.label(),
        y,
        log,
        dashed: Vec::new(),
    }
}

/// Four lines per curve.
fn contacts(report: &Report, along: &Axis) -> Sketch {
    /// A kind of contact: its name, and its number per sphere.
    type Count = (&'static str, fn(&Point) -> Option<f64>);
    let activated = |p: &Point| Some(p.contacts_per_sphere? * p.activated_fraction.unwrap_or(0.0));
    let counts: [Count; 4] = [
        ("in contact", |p| p.contacts_per_sphere),
        ("activated", activated),
        ("rolling", |p| {
            Some(
                p.contacts_per_sphere?
                    * p.activated_fraction.unwrap_or(0.0)
                    * p.rolling_fraction.unwrap_or(0.0),
            )
        }),
        ("slipping", |p| {
            let rolling = p.rolling_fraction.unwrap_or(0.0);
            Some(p.contacts_per_sphere? * p.activated_fraction.unwrap_or(0.0) * (1.0 - rolling))
        }),
    ];
    let log = axis(report, along);
    let mut lines = Vec::new();
    for curve in curves(report, along) {
        for (name, count) in counts {
            let words = [name, &curve.label];
            lines.push(Line {
                label: words[..if curve.label.is_empty() { 1 } else { 2 }].join(", "),
                points: curve
                    .points
                    .iter()
                    .filter_map(|point| Some((place(log, along, point), count(point)?, None)))
                    .collect(),
                style: lines.len() % CURVES,
                plain: false,
                joined: true,
            });
        }
    }
    Sketch {
        lines,
        x: along.label(),
        y: "pairs per sphere",
        log,
        dashed: Vec::new(),
    }
}
