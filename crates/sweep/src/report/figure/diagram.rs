//! State diagrams: the state of the flow in the plane of two axes.

use super::outline::{Curve, CurveKind, Figure};
use super::source::FigureSource;
use crate::model::axes::{AXES, Axis};
use crate::report::error::ReportError;
use crate::report::figure::Drawing;
use crate::report::labels::{Label, differences};
use crate::report::points::{Point, Report};
use crate::report::states::{Flow, FlowCurve, grouped};
use sd_core::Params;

/// Slopes d ln η/d ln σ whose contours are drawn as lines, and their labels.
const LIMITS: [(f64, &str); 2] = [(0.5, "d ln η/d ln σ = 0.5"), (1.0, "d ln η/d ln σ = 1")];
/// Minimum number of columns of a diagram, and of points in each, for slopes.
const MIN_COLUMNS: usize = 2;
const MIN_POINTS: usize = 3;

/// The axes of a state diagram: those requested, or the area fraction and the stress, or the rate
/// where no stress is imposed.
///
/// # Errors
/// [`ReportError::Argument`] on unsuitable axes.
pub(super) fn axes(report: &Report, drawing: &Drawing) -> Result<[&'static Axis; 2], ReportError> {
    let of_key = |key| Axis::of_key(key).unwrap_or(&AXES[0]);
    let is_imposed = |params: &Params| params.shear_stress.is_some();
    let y = drawing
        .y
        .unwrap_or(of_key(if report.params().any(is_imposed) {
            "shear_stress"
        } else {
            "shear_rate"
        }));
    let first = report.params().next();
    let is_layer = first.is_none_or(|params| params.volume_fraction.is_none());
    let x = drawing.x.unwrap_or(of_key(if is_layer {
        "area_fraction"
    } else {
        "volume_fraction"
    }));
    if !y.is_of_shear() {
        return Err(ReportError::argument(
            "y",
            "in a state diagram it is shear_stress or shear_rate",
        ));
    }
    if x.is_of_shear() {
        return Err(ReportError::argument(
            "x",
            "in a state diagram it is neither shear rate nor stress, which are on the vertical axis",
        ));
    }
    Ok([x, y])
}

impl FigureSource<'_> {
    /// The diagram: a marker for every point, and lines where slopes pass the limits.
    ///
    /// # Errors
    /// [`ReportError::Argument`] if other axes have several values, and if there are too few points
    /// for slopes.
    pub(super) fn diagram(&self, y: &'static Axis) -> Result<Figure, ReportError> {
        let x = self.along;
        let mut drawn = Vec::new();
        let mut enough = false;
        let (mut most_columns, mut most_points) = (0, 0);
        for (panel, points) in self.points_by_panel().into_iter().enumerate() {
            self.check_others(&points)?;
            let curves = flow_curves(&points, x);
            let sizes = || curves.iter().map(|curve| curve.points().len());
            most_columns = most_columns.max(curves.len());
            most_points = most_points.max(sizes().max().unwrap_or(0));
            enough |= sizes().filter(|size| *size >= MIN_POINTS).count() >= MIN_COLUMNS;
            drawn.extend(self.markers(&curves, y, panel));
            drawn.extend(self.limits(&curves, y, panel));
        }
        if !enough {
            return Err(ReportError::argument(
                "kind",
                format!(
                    "a state diagram needs at least {MIN_COLUMNS} values of {} with {MIN_POINTS} of {} each, as slopes are taken \
                     between neighbours; here are {most_columns} with {most_points} at most",
                    x.key, y.key
                ),
            ));
        }
        Ok(self.figure_of(drawn, self.label_of_shear(y)))
    }

    /// Refuses points that differ on another axis.
    fn check_others(&self, points: &[&Point]) -> Result<(), ReportError> {
        let params = points.iter().map(|point| &point.params);
        let drawn = [Some(self.along), self.panels];
        let named = differences(&params, |axis| {
            axis.is_of_shear() || drawn.iter().flatten().any(|drawn| drawn.key == axis.key)
        });
        if named.is_empty() {
            return Ok(());
        }
        Err(ReportError::argument(
            "where",
            format!(
                "a state diagram does not average over axes, and {}: choose one value of each (where), or one panel for each (panels)",
                named.join("; ")
            ),
        ))
    }

    /// The markers of each state.
    fn markers(&self, curves: &[FlowCurve<'_>], y: &Axis, panel: usize) -> Vec<Curve> {
        let of_state = |(index, flow): (usize, &Flow)| {
            let kind = match flow {
                Flow::Failed => CurveKind::Crosses,
                _ => CurveKind::Points,
            };
            let points = curves
                .iter()
                .flat_map(|curve| curve.points().iter().zip(curve.flows()));
            let own = points.filter(|(_, state)| *state == Some(*flow));
            let spots = own.map(|(point, _)| {
                let height = self.units.along(y, point.at(), point.place(y));
                (point, self.place(self.value(point)), height)
            });
            let spots: Vec<_> = spots.filter(|of| of.2 > 0.0 && of.2.is_finite()).collect();
            let trend = |(point, x, height): &(&&Point, f64, f64)| {
                Some((point.trend.as_ref()?.0, [*x, *height]))
            };
            let trends = spots.iter().filter_map(trend).collect();
            let spots = spots
                .into_iter()
                .map(|(_, x, height)| (x, height, 0.0, 0.0));
            Curve {
                index,
                trends,
                ..Curve::new(Label::from(flow.name()), spots.collect(), kind, panel)
            }
        };
        Flow::ALL.iter().enumerate().map(of_state).collect()
    }

    /// The lines at which slopes pass the limits: rising ones and falling ones, each interrupted
    /// where a column has none.
    fn limits(&self, curves: &[FlowCurve<'_>], y: &Axis, panel: usize) -> Vec<Curve> {
        let mut lines = Vec::new();
        for (number, (limit, name)) in LIMITS.into_iter().enumerate() {
            for branch in 0..2 {
                let spot = |curve: &FlowCurve<'_>| {
                    let first = curve.points()[0];
                    let at = curve.crossings(limit, y)[branch].unwrap_or(f64::NAN);
                    let height = self.units.along(y, first.at(), at);
                    (self.place(self.value(first)), height, 0.0, 0.0)
                };
                let spots: Vec<_> = curves.iter().map(spot).collect();
                // A single crossing has no line.
                let is_joined =
                    |pair: &[(f64, f64, f64, f64)]| pair.iter().all(|spot| !spot.1.is_nan());
                if spots.windows(2).any(is_joined) {
                    lines.push(Curve {
                        index: Flow::ALL.len() + number,
                        ..Curve::new(Label::from(name), spots, CurveKind::Line, panel)
                    });
                }
            }
        }
        lines
    }
}

/// The points of each value of an axis as flow curves, in the order of the values.
fn flow_curves<'p>(points: &[&'p Point], x: &Axis) -> Vec<FlowCurve<'p>> {
    let mut columns: Vec<Vec<&'p Point>> = grouped(points, Axis::is_of_shear)
        .into_iter()
        .map(|group| group.into_iter().map(|place| points[place]).collect())
        .collect();
    columns.sort_by(|a, b| a[0].place(x).total_cmp(&b[0].place(x)));
    columns.into_iter().map(FlowCurve::of).collect()
}
