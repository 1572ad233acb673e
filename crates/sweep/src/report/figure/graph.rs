//! Curves that are not points of a campaign, in the style of its figures.

use super::layout::draw;
use super::origin::Origin;
use super::outline::{Curve, CurveKind, Figure, Panel};
use super::palette::{CURVES, ORDERED_CURVES};
use super::refused;
use super::scale::LogAxis;
use crate::measure::Estimate;
use crate::report::error::ReportError;
use crate::report::labels::Label;

/// A path: its entry in the legend and its points.
pub type Graph<'a> = (&'a str, Vec<[f64; 2]>);

/// Values along an axis, with the entry of their curve in the legend.
pub(in crate::report) type MeasuredGraph<'a> = (&'a str, Vec<(f64, Estimate)>);

/// Axes and marks of curves that are not points of a campaign.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::report) struct GraphForm {
    /// Whether the vertical axis is linear whatever its values.
    pub(in crate::report) is_linear: bool,
    /// Whether the horizontal axis is logarithmic.
    pub(in crate::report) is_log_along: bool,
    /// Whether points have markers and intervals.
    pub(in crate::report) has_markers: bool,
}

/// Draws paths between axes with these names as SVG, with this title in the metadata of the file.
pub fn draw_graphs(graphs: &[Graph<'_>], axes: [&str; 2], title: &str) -> Vec<u8> {
    let mut measured: Vec<MeasuredGraph<'_>> = Vec::with_capacity(graphs.len());
    for (label, points) in graphs {
        let points = points.iter().map(|[x, y]| (*x, Estimate::bare(*y)));
        measured.push((label, points.collect()));
    }
    let origin = Origin::of_lines(title, &[]);
    draw_graphs_of(&measured, axes, GraphForm::default(), &origin)
}

/// Draws curves of a campaign.
pub(in crate::report) fn draw_graphs_of(
    graphs: &[MeasuredGraph<'_>],
    [x, y]: [&str; 2],
    form: GraphForm,
    origin: &Origin,
) -> Vec<u8> {
    let all = graphs.iter().flat_map(|(_, points)| points);
    let log = form
        .is_log_along
        .then(|| LogAxis::of(&all.map(|(x, _)| *x).collect::<Vec<_>>()));
    let place = |x: f64| log.map_or(x, |log| log.place(x));
    let curve = |(index, (label, points)): (usize, &MeasuredGraph<'_>)| {
        let points = points.iter().map(|(x, value)| {
            let half = value.ci95.filter(|_| form.has_markers).unwrap_or(0.0);
            (place(*x), value.mean, half, half)
        });
        let kind = if form.has_markers {
            CurveKind::Markers
        } else {
            CurveKind::Line
        };
        Curve {
            index,
            ..Curve::new(Label::from(*label), points.collect(), kind, 0)
        }
    };
    let figure = Figure {
        curves: graphs.iter().enumerate().map(curve).collect(),
        panels: vec![Panel::default()],
        x: x.into(),
        y: y.into(),
        log,
        is_linear: form.is_linear,
        ..Figure::default()
    };
    draw(&figure.outline(), origin)
}

/// Data and their fit: entry in the legend, and points of both.
#[derive(Debug)]
pub(in crate::report) struct FitCurve {
    pub(in crate::report) label: String,
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
    origin: &Origin,
) -> Result<Vec<u8>, ReportError> {
    if curves.len() > ORDERED_CURVES {
        return Err(refused(format!(
            "{} curves are more than the {ORDERED_CURVES} that can be distinguished: choose points (where)",
            curves.len()
        )));
    }
    let all = curves.iter().flat_map(|curve| &curve.data);
    let log = LogAxis::of(&all.map(|[x, _]| *x).collect::<Vec<_>>());
    let mut drawn = Vec::new();
    for (index, curve) in curves.iter().enumerate() {
        for (label, points, kind) in [
            (curve.label.as_str(), &curve.data, CurveKind::Points),
            ("", &curve.fit, CurveKind::Line),
        ] {
            let points = points.iter().map(|[x, y]| (log.place(*x), *y, 0.0, 0.0));
            drawn.push(Curve {
                index,
                ..Curve::new(Label::from(label), points.collect(), kind, 0)
            });
        }
    }
    let is_ordered = curves.len() > CURVES;
    let figure = Figure {
        curves: drawn,
        panels: vec![Panel::default()],
        ordered: if is_ordered { curves.len() } else { 0 },
        x: x.into(),
        y: y.into(),
        log: Some(log),
        is_linear: false,
    };
    Ok(draw(&figure.outline(), origin))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How often the axes of a path from 1.9 to 6 with heights of two decades have the labels 0,
    /// 0.00 and 0.001.
    fn labels(is_linear: bool) -> [usize; 3] {
        let points = [(1.9, 0.001), (4.0, 0.1), (6.0, 0.02)];
        let graph = [("", points.map(|(x, y)| (x, Estimate::bare(y))).to_vec())];
        let origin = Origin::of_lines("a path", &[]);
        let form = GraphForm {
            is_linear,
            ..GraphForm::default()
        };
        let svg = draw_graphs_of(&graph, ["r", "g"], form, &origin);
        let svg = String::from_utf8(svg).unwrap();
        ["0", "0.00", "0.001"].map(|label| svg.matches(&format!(">{label}<")).count())
    }

    #[test]
    fn an_axis_of_distances_begins_at_contact_and_shares_are_linear() {
        assert_eq!(labels(false), [0, 0, 1]);
        assert_eq!(labels(true), [0, 1, 0]);
    }
}
