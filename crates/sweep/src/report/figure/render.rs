//! A sketch drawn for print: 85 mm wide, the colours of Okabe and Ito, a marker of its own for each curve.

use super::Sketch;
use kuva::backend::png::PngBackend;
use kuva::backend::svg::SvgBackend;
use kuva::plot::legend::LegendPosition;
use kuva::plot::scatter::MarkerShape;
use kuva::plot::{LinePlot, ScatterPlot};
use kuva::render::annotations::ReferenceLine;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::render::render_multiple;
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
pub(super) const CURVES: usize = 8;
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

/// How a figure is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Vector.
    Svg,
    /// Raster, 576 dots per inch.
    Png,
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
pub(super) fn render(sketch: &Sketch, format: Format) -> Result<Vec<u8>, String> {
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
        .with_x_label(sketch.x.clone())
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
    if let Some(log) = sketch.log {
        let left = log.low - if log.zero { 1.4 } else { 0.4 };
        let right = log.high + if log.infinite { 1.4 } else { 0.4 };
        let crowded = right - left > 8.5;
        layout = layout
            .with_x_axis_min(left)
            .with_x_axis_max(right)
            .with_x_tick_step(if crowded { 2.0 } else { 1.0 })
            .with_x_tick_format(TickFormat::Custom(Arc::new(move |place| log.tick(place))));
        for (drawn, break_at) in [(log.zero, log.low - 0.5), (log.infinite, log.high + 0.5)] {
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
