//! Figures for print: 85 mm wide, the colours of Okabe and Ito, a marker of its own for each curve.

mod rates;

use super::curves::{Abscissa, curves};
use super::{Point, Report};
use crate::error::Error;
use crate::statistics::Estimate;
use crate::store::{Store, StoreError};
use kuva::backend::png::PngBackend;
use kuva::backend::svg::SvgBackend;
use kuva::plot::legend::LegendPosition;
use kuva::plot::scatter::MarkerShape;
use kuva::plot::{LinePlot, ScatterPlot};
use kuva::render::annotations::ReferenceLine;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::render::render_multiple;
use rates::Rates;
use std::sync::Arc;

/// Width of a column, 85 mm, in pixels of 1/96 inch.
const WIDTH: f64 = 321.0;
/// Height of a figure without its legend.
const HEIGHT: f64 = 255.0;
/// Height of an entry of the legend.
const LEGEND_LINE: f64 = 18.0;
/// Dots of a PNG per pixel: 576 per inch.
const PNG_SCALE: f32 = 6.0;
/// Curves of one figure at most: as many as there are colours and markers that can be told apart.
const CURVES: usize = 8;
/// Okabe and Ito's colours, dark ones first, their yellow last: it is hard to see on white.
const COLOURS: [&str; CURVES] = [
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9", "#F0E442",
];
/// A marker for each colour.
const MARKERS: [MarkerShape; CURVES] = [
    MarkerShape::Circle,
    MarkerShape::Square,
    MarkerShape::Triangle,
    MarkerShape::Diamond,
    MarkerShape::TriangleDown,
    MarkerShape::Plus,
    MarkerShape::Cross,
    MarkerShape::Star,
];

/// What a figure shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// Viscosity with 95 % intervals, plateaus of Γ = 0 and ∞ at the edges, the dilute limit 1 + 5c/3 dashed.
    Viscosity,
    /// Pairs in contact, activated, rolling and slipping, per sphere.
    Contacts,
    /// Viscosity in time, one run per point.
    Trace,
    /// First normal stress difference with 95 % intervals.
    NormalStress,
}

/// How a figure is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Vector.
    Svg,
    /// Raster, 576 dots per inch.
    Png,
}

/// One run in time.
#[derive(Debug)]
pub struct Trace {
    /// What it is a run of.
    pub label: String,
    /// Strain and viscosity.
    pub points: Vec<(f64, f64)>,
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
}

/// What a figure is made of.
#[derive(Debug, Default)]
struct Sketch {
    /// Its lines.
    lines: Vec<Line>,
    /// Heights of dashed lines.
    dashed: Vec<f64>,
    /// Label of the horizontal axis.
    x: &'static str,
    /// Label of the vertical axis.
    y: &'static str,
    /// The logarithmic axis of shear rates, if it is that.
    rates: Option<Rates>,
}

/// Traces of one run per point: of those whose keys begin with one of `keys`, or else the first with samples.
///
/// # Errors
/// Trouble with the store.
pub fn traces(store: &Store, keys: &[String]) -> Result<Vec<Trace>, StoreError> {
    let mut all: Vec<Trace> = Vec::new();
    let mut last = None;
    for run in store.point_runs()? {
        let wanted = if keys.is_empty() {
            last.as_ref() != Some(&run.params)
        } else {
            keys.iter().any(|key| run.key.starts_with(key.as_str()))
        };
        if !wanted || all.len() == CURVES {
            continue;
        }
        let points = store.trace(&run.key)?;
        if points.is_empty() {
            continue;
        }
        let p = &run.params;
        let rate = p.shear_rate;
        let rate = if rate.is_infinite() {
            "∞".into()
        } else {
            rate.to_string()
        };
        all.push(Trace {
            label: format!(
                "c = {}, ν = {}, Γ = {rate}, seed {}",
                p.area_fraction, p.friction, run.seed
            ),
            points,
        });
        last = Some(run.params);
    }
    Ok(all)
}

/// Draws a figure. `along` is its horizontal axis; by default Γ, for contacts ν where it varies.
///
/// # Errors
/// [`Error::Argument`] if there is nothing to draw, or too much.
pub fn draw(
    report: &Report,
    traces: &[Trace],
    kind: Kind,
    along: Option<Abscissa>,
    format: Format,
) -> Result<Vec<u8>, Error> {
    let along = along.unwrap_or_else(|| default_axis(report, kind));
    let sketch = match kind {
        Kind::Viscosity => of_points(report, along, "relative viscosity η", |p| p.viscosity),
        Kind::NormalStress => of_points(report, along, "normal stress difference N₁", |p| {
            p.normal_stress_difference
        }),
        Kind::Contacts => contacts(report, along),
        Kind::Trace => Sketch {
            lines: traces
                .iter()
                .enumerate()
                .map(|(style, trace)| Line {
                    label: trace.label.clone(),
                    points: trace.points.iter().map(|&(x, y)| (x, y, None)).collect(),
                    style,
                    plain: true,
                })
                .collect(),
            x: "strain",
            y: "relative viscosity η",
            ..Sketch::default()
        },
    };
    let refuse = |message: String| Error::Argument {
        argument: "--figure",
        message,
    };
    if sketch.lines.iter().all(|line| line.points.is_empty()) {
        return Err(refuse(
            "there are no results to draw yet; `sweep status` says how far the campaign is".into(),
        ));
    }
    if sketch.lines.len() > CURVES {
        return Err(refuse(format!(
            "{} curves, and at most {CURVES} can be told apart: choose the axis along which they run with --along",
            sketch.lines.len()
        )));
    }
    let mut sketch = sketch;
    if kind == Kind::Viscosity {
        sketch.dashed = dilute(report, along);
    }
    render(&sketch, format).map_err(refuse)
}

/// The axis of a figure if the user names none.
fn default_axis(report: &Report, kind: Kind) -> Abscissa {
    let varies = |axis: Abscissa| {
        report.points.iter().any(|p| {
            axis.value(&p.params).to_bits() != axis.value(&report.points[0].params).to_bits()
        })
    };
    let order = match kind {
        Kind::Contacts => [
            Abscissa::Friction,
            Abscissa::ShearRate,
            Abscissa::AreaFraction,
        ],
        _ => [
            Abscissa::ShearRate,
            Abscissa::AreaFraction,
            Abscissa::Friction,
        ],
    };
    order
        .into_iter()
        .find(|axis| varies(*axis))
        .unwrap_or(order[0])
}

/// The dilute limit 1 + 5c/3 of every area fraction of the report, unless c is the axis.
fn dilute(report: &Report, along: Abscissa) -> Vec<f64> {
    let mut heights: Vec<f64> = Vec::new();
    for point in &report.points {
        let height = 1.0 + 5.0 * point.params.area_fraction / 3.0;
        if along != Abscissa::AreaFraction && !heights.iter().any(|h| (h - height).abs() < 1e-9) {
            heights.push(height);
        }
    }
    heights
}

/// The horizontal axis of a report's points.
fn axis(report: &Report, along: Abscissa) -> Option<Rates> {
    let values: Vec<f64> = report
        .points
        .iter()
        .map(|p| along.value(&p.params))
        .collect();
    (along == Abscissa::ShearRate).then(|| Rates::of(&values))
}

/// Place of a point.
fn place(rates: Option<Rates>, along: Abscissa, point: &Point) -> f64 {
    let value = along.value(&point.params);
    rates.map_or(value, |rates| rates.place(value))
}

/// One line per curve of one quantity.
fn of_points(
    report: &Report,
    along: Abscissa,
    y: &'static str,
    quantity: fn(&Point) -> Option<Estimate>,
) -> Sketch {
    let rates = axis(report, along);
    let lines = curves(report, along)
        .into_iter()
        .enumerate()
        .map(|(style, curve)| Line {
            points: curve
                .points
                .iter()
                .filter_map(|point| {
                    let estimate = quantity(point).filter(|e| e.mean.is_finite())?;
                    Some((place(rates, along, point), estimate.mean, estimate.ci95))
                })
                .collect(),
            label: curve.label,
            style,
            plain: false,
        })
        .collect();
    Sketch {
        lines,
        x: along.label(),
        y,
        rates,
        dashed: Vec::new(),
    }
}

/// Four lines per curve.
fn contacts(report: &Report, along: Abscissa) -> Sketch {
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
    let rates = axis(report, along);
    let mut lines = Vec::new();
    for curve in curves(report, along) {
        for (name, count) in counts {
            let words = [name, &curve.label];
            lines.push(Line {
                label: words[..if curve.label.is_empty() { 1 } else { 2 }].join(", "),
                points: curve
                    .points
                    .iter()
                    .filter_map(|point| Some((place(rates, along, point), count(point)?, None)))
                    .collect(),
                style: lines.len() % CURVES,
                plain: false,
            });
        }
    }
    Sketch {
        lines,
        x: along.label(),
        y: "pairs per sphere",
        rates,
        dashed: Vec::new(),
    }
}

/// Whether a vertical axis is logarithmic: all positive, and more than a decade.
fn is_logarithmic(sketch: &Sketch) -> bool {
    let values = || {
        sketch
            .lines
            .iter()
            .flat_map(|line| &line.points)
            .map(|p| p.1)
    };
    let (low, high) = (
        values().fold(f64::INFINITY, f64::min),
        values().fold(f64::NEG_INFINITY, f64::max),
    );
    low > 0.0 && high > 10.0 * low
}

/// The shapes of a sketch, and how many of its lines have an entry in the legend.
fn shapes(sketch: &Sketch, logarithmic: bool) -> (Vec<Plot>, f64) {
    let mut plots = Vec::new();
    let mut labelled: f64 = 0.0;
    for line in sketch.lines.iter().filter(|line| !line.points.is_empty()) {
        let colour = COLOURS[line.style % CURVES];
        let places = line.points.iter().map(|p| (p.0, p.1));
        let mut path = LinePlot::new().with_data(places.clone()).with_color(colour);
        path = path.with_stroke_width(if line.plain { 0.8 } else { 1.2 });
        if line.plain && !line.label.is_empty() {
            path = path.with_legend(line.label.clone());
        }
        plots.push(Plot::Line(path));
        if !line.plain {
            let bars = line.points.iter().map(|&(_, mean, half)| {
                let half = half.unwrap_or(0.0);
                // An interval that reaches below zero has no lower end on a logarithmic axis.
                let lower = if logarithmic {
                    half.min(0.99 * mean)
                } else {
                    half
                };
                (lower, half)
            });
            let mut marks = ScatterPlot::new()
                .with_data(places)
                .with_color(colour)
                .with_size(3.0)
                .with_marker(MARKERS[line.style % CURVES]);
            if line.points.iter().any(|point| point.2.is_some()) {
                marks = marks.with_y_err_asymmetric(bars);
            }
            if !line.label.is_empty() {
                marks = marks.with_legend(line.label.clone());
            }
            plots.push(Plot::Scatter(marks));
        }
        labelled += f64::from(u8::from(!line.label.is_empty()));
    }
    (plots, labelled)
}

/// Draws a sketch.
fn render(sketch: &Sketch, format: Format) -> Result<Vec<u8>, String> {
    let logarithmic = is_logarithmic(sketch);
    // The raster backend takes dashes in dots, not in pixels.
    let scale = match format {
        Format::Svg => 1.0,
        Format::Png => PNG_SCALE,
    };
    let dashes = |lengths: [f32; 2]| format!("{} {}", lengths[0] * scale, lengths[1] * scale);
    let (plots, labelled) = shapes(sketch, logarithmic);
    // A column of entries below the axis, with room of its own.
    let legend = LEGEND_LINE * labelled + if labelled > 0.0 { 10.0 } else { 0.0 };
    let height = HEIGHT + legend;
    let mut layout = Layout::auto_from_plots(&plots)
        .with_width(WIDTH)
        .with_height(height)
        .with_force_margins_y(10.0, 44.0 + legend)
        .with_legend_position(LegendPosition::Custom(44.0, height - legend + 4.0))
        .with_x_label(sketch.x)
        .with_x_label_offset(0.0, -legend)
        .with_y_label(sketch.y)
        .with_label_size(11)
        .with_tick_size(10)
        .with_body_size(10)
        .with_show_grid(false)
        .with_box_axes()
        .with_legend_box(false);
    if logarithmic {
        layout = layout.with_log_y();
    } else if sketch
        .lines
        .iter()
        .flat_map(|l| &l.points)
        .all(|p| p.1 >= 0.0)
    {
        layout = layout.with_y_axis_min(0.0);
    }
    if let Some(rates) = sketch.rates {
        let left = rates.low - if rates.zero { 1.4 } else { 0.4 };
        let right = rates.high + if rates.infinite { 1.4 } else { 0.4 };
        let crowded = right - left > 8.5;
        layout = layout
            .with_x_axis_min(left)
            .with_x_axis_max(right)
            .with_x_tick_step(if crowded { 2.0 } else { 1.0 })
            .with_x_tick_format(TickFormat::Custom(Arc::new(move |place| rates.tick(place))));
        for (drawn, break_at) in [
            (rates.zero, rates.low - 0.5),
            (rates.infinite, rates.high + 0.5),
        ] {
            if drawn {
                layout = layout.with_reference_line(
                    ReferenceLine::vertical(break_at)
                        .with_color("#bbbbbb")
                        .with_stroke_width(0.8)
                        .with_dasharray(dashes([1.0, 3.0])),
                );
            }
        }
    }
    for &height in &sketch.dashed {
        layout = layout.with_reference_line(
            ReferenceLine::horizontal(height)
                .with_color("#555555")
                .with_stroke_width(0.9)
                .with_dasharray(dashes([6.0, 4.0])),
        );
    }
    let scene = render_multiple(plots, layout);
    match format {
        Format::Svg => Ok(SvgBackend::new().render_scene(&scene).into_bytes()),
        Format::Png => PngBackend::new().with_scale(PNG_SCALE).render_scene(&scene),
    }
}
