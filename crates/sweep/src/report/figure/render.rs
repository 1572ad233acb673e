//! Figures drawn by the program itself.

use super::outline::{Curve, Marker, Outline, Straight};
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

/// Dots of a PNG per pixel: 576 per inch.
const PNG_SCALE: f32 = 6.0;

/// How a figure is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Vector.
    Svg,
    /// Raster, 576 dots per inch.
    Png,
}

impl Marker {
    fn shape(self) -> MarkerShape {
        match self {
            Self::Circle => MarkerShape::Circle,
            Self::Square => MarkerShape::Square,
            Self::Triangle => MarkerShape::Triangle,
            Self::Diamond => MarkerShape::Diamond,
            Self::TriangleDown => MarkerShape::TriangleDown,
            Self::Plus => MarkerShape::Plus,
            Self::Cross => MarkerShape::Cross,
            Self::Star => MarkerShape::Star,
        }
    }
}

/// The shapes of a curve.
fn shapes(curve: &Curve) -> Vec<Plot> {
    let places = curve.points.iter().map(|p| (p.0, p.1));
    let mut path = LinePlot::new()
        .with_data(places.clone())
        .with_color(curve.colour)
        .with_stroke_width(curve.width);
    let Some(marker) = curve.marker else {
        if !curve.label.is_empty() {
            path = path.with_legend(curve.label.clone());
        }
        return vec![Plot::Line(path)];
    };
    let mut marks = ScatterPlot::new()
        .with_data(places)
        .with_color(curve.colour)
        .with_size(curve.marker_size)
        .with_marker(marker.shape());
    if curve.has_intervals {
        marks = marks.with_y_err_asymmetric(curve.points.iter().map(|p| (p.2, p.3)));
    }
    if !curve.label.is_empty() {
        marks = marks.with_legend(curve.label.clone());
    }
    vec![Plot::Line(path), Plot::Scatter(marks)]
}

/// Adds straight lines. The raster backend takes dashes in dots, not in pixels: `scale` of them.
fn with_lines(
    layout: Layout,
    lines: &Straight,
    scale: f32,
    line: fn(f64) -> ReferenceLine,
) -> Layout {
    let [dash, gap] = lines.dashes.map(|length| length * f64::from(scale));
    lines.places.iter().fold(layout, |layout, place| {
        layout.with_reference_line(
            line(*place)
                .with_color(lines.colour)
                .with_stroke_width(lines.width)
                .with_dasharray(format!("{dash} {gap}")),
        )
    })
}

/// Draws a figure.
pub(super) fn render(outline: &Outline, format: Format) -> Result<Vec<u8>, String> {
    let scale = match format {
        Format::Svg => 1.0,
        Format::Png => PNG_SCALE,
    };
    let plots: Vec<Plot> = outline.lines.iter().flat_map(shapes).collect();
    let (height, legend) = (outline.height, outline.legend_height);
    let mut layout = Layout::auto_from_plots(&plots)
        .with_width(outline.width)
        .with_height(height)
        .with_force_margins_y(10.0, 44.0 + legend)
        .with_legend_position(LegendPosition::Custom(44.0, height - legend + 4.0))
        .with_x_label(outline.x.label.clone())
        .with_x_label_offset(0.0, -legend)
        .with_y_label(outline.y.label)
        .with_label_size(outline.label_size)
        .with_tick_size(outline.tick_size)
        .with_body_size(outline.tick_size)
        .with_show_grid(false)
        .with_box_axes()
        .with_legend_box(false);
    if outline.y.logarithmic {
        layout = layout.with_log_y();
    } else if outline.y.from_zero {
        layout = layout.with_y_axis_min(0.0);
    }
    if let Some(decades) = &outline.x.decades {
        let ticks = decades.ticks.clone();
        let tick = move |place: f64| {
            let near = ticks.iter().find(|tick| (tick.0 - place).abs() < 0.25);
            near.map_or_else(String::new, |tick| tick.1.clone())
        };
        layout = layout
            .with_x_axis_min(decades.left)
            .with_x_axis_max(decades.right)
            .with_x_tick_step(decades.step)
            .with_x_tick_format(TickFormat::Custom(Arc::new(tick)));
        layout = with_lines(layout, &decades.breaks, scale, ReferenceLine::vertical);
    }
    layout = with_lines(layout, &outline.dashed, scale, ReferenceLine::horizontal);
    let scene = render_multiple(plots, layout);
    match format {
        Format::Svg => Ok(SvgBackend::new().render_scene(&scene).into_bytes()),
        Format::Png => PngBackend::new().with_scale(PNG_SCALE).render_scene(&scene),
    }
}
