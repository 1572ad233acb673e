//! Paths that are not results of a campaign, in the style of its figures.

use super::log_axis::LogAxis;
use super::look::Look;
use super::origin::Origin;
use super::palette::{CURVES, ORDERED_CURVES};
use super::sketch::{Field, Form, Height, Line, Sketch, Spot};
use super::{Format, drawn, refused};
use crate::report::curves::Label;
use crate::report::error::ReportError;

/// A path: its entry in the legend and its points.
pub type Graph<'a> = (&'a str, Vec<[f64; 2]>);

/// Draws paths without a campaign between axes with these names, with this title in the metadata of
/// the file.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw.
pub fn draw_graphs(
    graphs: &[Graph<'_>],
    axes: [&str; 2],
    format: Format,
    title: &str,
) -> Result<Vec<u8>, ReportError> {
    draw_graphs_of(graphs, axes, false, format, &Origin::of_lines(title, &[]))
}

/// The same for a campaign; `is_linear`: the vertical axis is linear whatever its values.
pub(in crate::report) fn draw_graphs_of(
    graphs: &[Graph<'_>],
    [x, y]: [&str; 2],
    is_linear: bool,
    format: Format,
    origin: &Origin,
) -> Result<Vec<u8>, ReportError> {
    let spot = |&[x, y]: &[f64; 2]| Spot {
        x,
        y: Some(Height::bare(y)),
        across: None,
    };
    let line = |(place, (label, places)): (usize, &Graph<'_>)| Line {
        place,
        ..Line::new(
            Label::of_words(label),
            places.iter().map(spot).collect(),
            Form::Trace,
            0,
        )
    };
    let sketch = Sketch {
        lines: graphs.iter().enumerate().map(line).collect(),
        panels: vec![Field::default()],
        x: x.into(),
        y: y.into(),
        is_linear,
        ..Sketch::default()
    };
    drawn(&sketch, &Look::default(), origin, format)
}

/// Data and their fit: entry in the legend, number for the order, and points of both.
#[derive(Debug)]
pub(in crate::report) struct FitCurve {
    pub(in crate::report) label: String,
    pub(in crate::report) number: f64,
    pub(in crate::report) data: Vec<[f64; 2]>,
    pub(in crate::report) fit: Vec<[f64; 2]>,
}

/// Draws data as markers and fits as lines against a logarithmic axis, whose ends may be 0 and
/// infinity.
///
/// # Errors
/// [`ReportError::Argument`] if there are more curves than can be distinguished.
pub(in crate::report) fn draw_fit(
    curves: &[FitCurve],
    [x, y]: [&str; 2],
    format: Format,
    origin: &Origin,
) -> Result<Vec<u8>, ReportError> {
    if curves.len() > ORDERED_CURVES {
        return Err(refused(format!(
            "{} curves are more than the {ORDERED_CURVES} that can be distinguished: choose points with --where KEY=VALUE",
            curves.len()
        )));
    }
    let places: Vec<f64> = curves
        .iter()
        .flat_map(|curve| curve.data.iter().map(|[x, _]| *x))
        .collect();
    let log = LogAxis::of(&places);
    let spots = |places: &[[f64; 2]]| {
        let spot = |&[x, y]: &[f64; 2]| Spot {
            x: log.place(x),
            y: y.is_finite().then(|| Height::bare(y)),
            across: None,
        };
        places.iter().map(spot).collect()
    };
    let mut lines = Vec::new();
    for (place, curve) in curves.iter().enumerate() {
        let label = Label {
            words: curve.label.clone(),
            number: Some(curve.number),
        };
        for (label, places, form) in [
            (label, &curve.data, Form::Points),
            (Label::default(), &curve.fit, Form::Trace),
        ] {
            lines.push(Line {
                place,
                ..Line::new(label, spots(places), form, 0)
            });
        }
    }
    let sketch = Sketch {
        lines,
        panels: vec![Field::default()],
        ordered: if curves.len() > CURVES {
            curves.len()
        } else {
            0
        },
        x: x.into(),
        y: y.into(),
        log: Some(log),
        is_linear: false,
    };
    drawn(&sketch, &Look::default(), origin, format)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How often the axes of a path from 1.9 to 6 with heights of two decades have the labels 0,
    /// 0.00 and 0.001.
    fn labels(is_linear: bool) -> [usize; 3] {
        let graph = [("", vec![[1.9, 0.001], [4.0, 0.1], [6.0, 0.02]])];
        let origin = Origin::of_lines("a path", &[]);
        let svg = draw_graphs_of(&graph, ["r", "g"], is_linear, Format::Svg, &origin).unwrap();
        let svg = String::from_utf8(svg).unwrap();
        ["0", "0.00", "0.001"].map(|label| svg.matches(&format!(">{label}<")).count())
    }

    #[test]
    fn an_axis_of_distances_begins_at_contact_and_shares_are_linear() {
        assert_eq!(labels(false), [0, 0, 1]);
        assert_eq!(labels(true), [0, 1, 0]);
    }
}
