//! Lines of numbers that are no points of a campaign, in the look of its figures.

use super::log_axis::LogAxis;
use super::look::Look;
use super::origin::Origin;
use super::sketch::{Field, Form, Height, Line as Drawn, Sketch, Spot};
use super::{Format, Outline, file};
use crate::report::curves::Label;
use crate::report::error::ReportError;
use crate::statistics::Estimate;

/// What is to be drawn.
#[derive(Debug, Clone, Default)]
pub struct Graph {
    /// Label of the horizontal axis.
    pub x: String,
    /// Whether that is logarithmic.
    pub log_x: bool,
    /// Label of the vertical axis.
    pub y: String,
    /// Titles of the panels; a single one needs none.
    pub panels: Vec<String>,
    /// Its lines, in the order of the legend. Lines of one label look alike and have one entry there.
    pub lines: Vec<Line>,
}

/// One line.
#[derive(Debug, Clone)]
pub struct Line {
    /// Its entry in the legend.
    pub label: String,
    /// Its panel, from 0.
    pub panel: usize,
    /// Whether it is a path without markers, or else joins points.
    pub is_path: bool,
    /// Places along the axis, and heights with half their 95 % intervals.
    pub points: Vec<(f64, Estimate)>,
}

/// Draws it.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw.
pub fn draw_graph(graph: &Graph, format: Format) -> Result<Vec<u8>, ReportError> {
    let places = graph.lines.iter().flat_map(|line| &line.points);
    let places: Vec<f64> = places.map(|(x, _)| *x).collect();
    let log = graph.log_x.then(|| LogAxis::of(&places));
    let mut labels: Vec<&str> = Vec::new();
    for line in &graph.lines {
        if !labels.contains(&line.label.as_str()) {
            labels.push(&line.label);
        }
    }
    let place = |label: &str| labels.iter().position(|known| *known == label);
    let lines = graph.lines.iter().map(|line| Drawn {
        label: Label {
            words: line.label.clone(),
            number: None,
        },
        points: line
            .points
            .iter()
            .map(|(x, height)| Spot {
                x: log.map_or(*x, |log| log.place(*x)),
                y: Some(Height::from(*height)),
            })
            .collect(),
        place: place(&line.label).unwrap_or_default(),
        form: if line.is_path {
            Form::Trace
        } else {
            Form::Curve
        },
        panel: line.panel,
        discard: None,
    });
    let panel = |title: &String| Field {
        title: title.clone(),
        dilute: Vec::new(),
    };
    let sketch = Sketch {
        lines: lines.collect(),
        panels: graph.panels.iter().map(panel).collect(),
        x: graph.x.clone(),
        y: graph.y.clone(),
        log,
        ..Sketch::default()
    };
    let look = Look::default();
    let outline = Outline::of(&sketch, &look)?;
    file(&outline, &look.style, format, &Origin::of(&[]))
}
