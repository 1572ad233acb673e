//! Curves that are not points of a campaign, in the style of its figures.

use super::layout::draw;
use super::origin::Origin;
use super::outline::{Curve, CurveKind, Figure, Panel};
use super::palette::{CURVES, ORDERED_CURVES};
use super::refused;
use super::scale::LogAxis;
use crate::measure::Estimate;
use crate::report::error::ReportError;

/// A path: its entry in the legend and its points.
pub type Graph<'a> = (&'a str, Vec<[f64; 2]>);

/// Draws paths between axes with these names as SVG, with this title in the metadata of the file.
///
/// # Errors
/// [`ReportError::Argument`] if there are more paths than can be distinguished.
pub fn draw_graphs(
    graphs: &[Graph<'_>],
    axes: [&str; 2],
    title: &str,
) -> Result<String, ReportError> {
    let curve = |(index, (label, points)): (usize, &Graph<'_>)| {
        let points = points.iter().map(|[x, y]| (*x, Estimate::bare(*y)));
        Curve::of_values(label, points, CurveKind::Line, index)
    };
    let curves = graphs.iter().enumerate().map(curve).collect();
    draw_curves(curves, axes, [false; 2], &Origin::of_lines(title, &[]))
}

/// Draws curves between axes with these names. The horizontal axis may be logarithmic, with 0 and
/// infinity beyond its ends; the vertical one may be linear whatever its values.
///
/// # Errors
/// [`ReportError::Argument`] if there are more curves than can be distinguished.
pub(in crate::report) fn draw_curves(
    mut curves: Vec<Curve>,
    [x, y]: [&str; 2],
    [is_logarithmic, is_linear]: [bool; 2],
    origin: &Origin,
) -> Result<String, ReportError> {
    let number = curves.iter().map(|curve| curve.index + 1).max();
    let number = number.unwrap_or(0);
    if number > ORDERED_CURVES {
        return Err(refused(format!(
            "{number} curves are more than the {ORDERED_CURVES} that can be distinguished: choose points (where)"
        )));
    }
    let log = is_logarithmic.then(|| {
        // Lines follow the markers.
        let data = curves.iter().filter(|curve| curve.kind != CurveKind::Line);
        let places = data.flat_map(|curve| &curve.points).map(|point| point.0);
        LogAxis::of(&places.collect::<Vec<_>>())
    });
    if let Some(log) = log {
        for curve in &mut curves {
            let points = curve.points.iter_mut().map(|point| &mut point.0);
            let marks = curve.trends.iter_mut().map(|(_, mark)| &mut mark[0]);
            for place in points.chain(marks) {
                *place = log.place(*place);
            }
        }
    }
    let figure = Figure {
        curves,
        panels: vec![Panel::default()],
        ordered: if number > CURVES { number } else { 0 },
        x: x.into(),
        y: y.into(),
        log,
        is_linear,
        note: None,
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
        let points = points.map(|(x, y)| (x, Estimate::bare(y))).into_iter();
        let curve = Curve::of_values("", points, CurveKind::Line, 0);
        let origin = Origin::of_lines("a path", &[]);
        let svg = draw_curves(vec![curve], ["r", "g"], [false, is_linear], &origin).unwrap();
        ["0", "0.00", "0.001"].map(|label| svg.matches(&format!(">{label}<")).count())
    }

    #[test]
    fn an_axis_of_distances_begins_at_contact_and_shares_are_linear() {
        assert_eq!(labels(false), [0, 0, 1]);
        assert_eq!(labels(true), [0, 1, 0]);
    }
}
