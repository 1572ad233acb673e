//! The curves of a figure: the points of a report, or runs in time.

use super::outline::{Curve, CurveKind, Figure};
use super::palette::{CURVES, ORDERED_CURVES};
use super::quantities::{Plotted, Quantities, plotted, read};
use super::scale::{LogAxis, extent};
use super::source::{FigureSource, jammed_at_imposed_stress};
use super::{Against, Drawing, Kind, Trace, diagram, refused};
use crate::model::axes::{AXES, identity};
use crate::model::spaces::dilute_viscosity;
use crate::report::error::ReportError;
use crate::report::labels::{Label, Shared};
use crate::report::points::{Point, Report};
use crate::report::references::{Reference, ReferenceCurve};
use crate::report::states::grouped;
use crate::report::units::At;
use sd_core::Params;
use std::cmp::Ordering;
use std::f64::consts::PI;

/// Pieces of the line of a published law.
const LINE: usize = 120;

/// The data of a figure of a report, or of traces.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw, or too much.
pub(super) fn figure_data(
    report: &Report,
    traces: &[Trace],
    drawing: &Drawing,
) -> Result<Figure, ReportError> {
    let kind = drawing.kind;
    let diagram = match kind {
        Kind::StateDiagram => Some(diagram::axes(report, drawing)?),
        _ => None,
    };
    let along = diagram.map_or(drawing.along, |[x, _]| Some(x));
    let source = FigureSource::of(report, drawing, along)?;
    let quantities = Quantities::of(drawing);
    source.check_units(&quantities)?;
    let mut data = match diagram {
        Some([_, y]) => source.diagram(y)?,
        None if kind.is_in_time() => source.in_time(traces, &quantities),
        None => source.of_points(&quantities),
    };
    let first = quantities.measured.first().map_or("", |first| first.1);
    let is_viscosity = kind == Kind::Curve && first.starts_with("viscosity");
    if kind == Kind::Trace {
        source.add_dilute(&mut data, traces.iter().map(|trace| &trace.params));
    } else if is_viscosity && source.against.is_none() && !source.along.is_fraction() {
        source.add_dilute(&mut data, report.params());
    }
    let has_result = |curve: &Curve| curve.points.iter().any(|point| !point.1.is_nan());
    if !data.curves.iter().any(has_result) {
        source.check_scale(&quantities)?;
        let are_averaged = report.points.iter().any(|point| point.seeds > 0);
        return Err(refused(if are_averaged && !kind.is_in_time() {
            format!(
                "none of these points has a value of this figure, the {}",
                quantities.label
            )
        } else {
            "there are no results to draw yet; `sweep status` shows the progress of the campaign"
                .into()
        }));
    }
    data.curves.retain(|curve| !curve.points.is_empty());
    // In a state diagram each state has a fixed colour, even if others are absent.
    if kind != Kind::StateDiagram {
        data.arrange(kind)?;
    }
    for reference in &drawing.references {
        let curves = source.curves_of(reference, &quantities, &data)?;
        data.curves.extend(curves);
    }
    data.note = (!kind.is_in_time()).then(|| report.note()).flatten();
    Ok(data)
}

impl Figure {
    /// Gives every curve its index by its label, the same in all panels; a single number that
    /// distinguishes more curves than there are colours orders them.
    fn arrange(&mut self, kind: Kind) -> Result<(), ReportError> {
        let mut known: Vec<(String, Option<f64>)> = Vec::new();
        for curve in &self.curves {
            if !known.iter().any(|(label, _)| *label == curve.label) {
                known.push((curve.label.clone(), curve.number));
            }
        }
        let number = known.len();
        let is_ordered = number > CURVES && known.iter().all(|(_, number)| number.is_some());
        let most = if is_ordered { ORDERED_CURVES } else { CURVES };
        if number > most {
            let (more, how) = match kind {
                kind if kind.is_in_time() => (" or more", "runs (where, case)"),
                _ => (
                    "",
                    "points (where), the axis they run along (along), or an axis with a panel for each value (panels)",
                ),
            };
            return Err(refused(format!(
                "{number}{more} curves are more than the {most} that can be distinguished: choose {how}"
            )));
        }
        if is_ordered {
            let number = |of: Option<f64>| of.unwrap_or(f64::NAN);
            known.sort_by(|a, b| number(a.1).total_cmp(&number(b.1)));
            self.ordered = known.len();
        }
        for curve in &mut self.curves {
            let place = known.iter().position(|(label, _)| *label == curve.label);
            curve.index = place.unwrap_or(0);
        }
        self.curves.sort_by_key(|curve| (curve.panel, curve.index));
        Ok(())
    }
}

impl<'r> FigureSource<'r> {
    /// The points as curves along the axis, one for each combination of values of the others.
    fn curves(&self) -> Vec<(Label, Vec<&'r Point>)> {
        let (along, points) = (self.along, &self.report.points);
        let chosen = self.chosen_along();
        let shared = Shared {
            chosen: &chosen,
            ..self.shared(Some(along))
        };
        let all: Vec<&Point> = points.iter().collect();
        let groups = grouped(&all, |axis| shared.is_along(axis));
        // Some laws have no effect at some points of a curve, which share their runs with others.
        let effects = |params: &Params| {
            AXES.iter()
                .filter(|axis| axis.means_something(params))
                .count()
        };
        let named = groups.iter().filter_map(|group| {
            let params = group.iter().map(|place| &points[*place].params);
            params.max_by_key(|params| effects(params))
        });
        let labels = shared.labels(&named.collect::<Vec<_>>());
        let sorted = groups.into_iter().map(|group| {
            let mut points: Vec<&Point> = group.into_iter().map(|place| &points[place]).collect();
            points.sort_by(|a, b| a.place(along).total_cmp(&b.place(along)));
            if along.is_of_shear() {
                // Along a curve that folds back, the imposed quantity increases.
                let stress = |point: &Point| point.params.shear_stress;
                points.sort_by(|a, b| stress(a).partial_cmp(&stress(b)).unwrap_or(Ordering::Equal));
            }
            points
        });
        labels.into_iter().zip(sorted).collect()
    }

    /// The curve of a quantity of some points.
    fn line(
        &self,
        points: &[&Point],
        label: Label,
        value: &dyn Fn(&Point) -> Option<Plotted>,
    ) -> Curve {
        let panel = self.panel(&points[0].params);
        let mut curve = Curve::new(label, Vec::new(), CurveKind::Markers, panel);
        for point in points {
            let x = self.place(self.value(point));
            let jam = self.jam(point, x);
            curve.jammed.extend(jam);
            if !x.is_finite() {
                // The position of a curve that only jams.
                curve
                    .points
                    .extend(jam.map(|[x, _]| (x, f64::NAN, 0.0, 0.0)));
                continue;
            }
            let value = value(point).filter(|[number, ..]| number.is_finite());
            let [number, down, up] = value.unwrap_or([f64::NAN, 0.0, 0.0]);
            curve.points.push((x, number, down, up));
            let trend = point.trend.as_ref().filter(|_| value.is_some());
            curve
                .trends
                .extend(trend.map(|(trend, _)| (*trend, [x, number])));
            // One error has one bar: that of a viscosity is drawn along the vertical axis.
            if value.is_some() && down == 0.0 && up == 0.0 {
                let ends = self.rates(point);
                let across = ends.map(|[from, to]| [from, to, number]);
                curve.across.extend(across);
            }
        }
        curve
    }

    /// Ends of the interval of the rate that follows from an imposed stress, on the axis.
    fn rates(&self, point: &Point) -> Option<[f64; 2]> {
        let along = self.along;
        let (_, stress) = point.params.last_shear();
        let is_rate = along.is_shear_rate() && self.against.is_none();
        let stress = stress.filter(|_| is_rate)?;
        let eta = point.viscosity?;
        let half = eta.ci95?;
        Some([half, -half].map(|reach| {
            // An interval that reaches a viscosity of 0 has no upper end.
            let rate = 6.0 * PI * stress / (eta.mean + reach).max(0.0);
            self.place(self.units.along(along, point.at(), rate))
        }))
    }

    /// One line per curve of each quantity.
    fn of_points(&self, quantities: &Quantities) -> Figure {
        let Quantities {
            label,
            unit,
            measured,
        } = quantities;
        let mut curves: Vec<Curve> = Vec::new();
        for (words, points) in self.curves() {
            for (word, name) in measured {
                let value = |point: &Point| {
                    let factor = self.units.factor(unit, point.at())?;
                    Some(read(name, point)?.map(|part| factor * part))
                };
                // A result without a value here, such as a stress at an infinite rate, is left out
                // and not marked as missing.
                let is_shown = |point: &&&Point| match read(name, point) {
                    Some([number, ..]) => number.is_finite() && self.has_scale(unit, point),
                    None => true,
                };
                let shown: Vec<&Point> = points.iter().filter(is_shown).copied().collect();
                let words = match measured.len() {
                    1 => words.clone(),
                    _ if words.words.is_empty() => Label::from(*word),
                    _ => Label::from(format!("{word}, {}", words.words)),
                };
                if !shown.is_empty() {
                    curves.push(self.line(&shown, words, &value));
                }
            }
        }
        // A plateau that nothing reaches is left out.
        let log = self.log.map(|log| {
            let points = || curves.iter().flat_map(|curve| &curve.points);
            let mut all = self.report.points.iter();
            let rests = self.along.is_shear_rate() && all.any(jammed_at_imposed_stress);
            LogAxis {
                zero: log.zero && (points().any(|point| point.0 < log.low) || rests),
                infinite: log.infinite && points().any(|point| point.0 > log.high),
                ..log
            }
        });
        Figure {
            log,
            ..self.figure_of(curves, self.units.label(label, unit))
        }
    }

    /// The curves of a publication beside those of a figure, over their range.
    fn curves_of(
        &self,
        reference: &Reference,
        quantities: &Quantities,
        figure: &Figure,
    ) -> Result<Vec<Curve>, ReportError> {
        let name = &reference.name;
        let refused = |message: String| Err(ReportError::argument("reference", message));
        if let Some(why) = reference.refuses(self.report.params()) {
            return refused(format!("{name} is {why}"));
        }
        if self.units.are_requested() {
            return refused(format!("{name} is in μ and the rate: leave the units out"));
        }
        let x = match self.against {
            Some(Against::Number(number)) => number.name,
            Some(Against::Below(_)) => "volume_fraction",
            None => self.along.key,
        };
        let own = quantities.names().flat_map(|(word, y)| {
            let curves = reference.curves.iter();
            let curves = curves.filter(move |curve| curve.x == x && curve.y == y);
            curves.map(move |curve| (word, curve))
        });
        let own: Vec<(&str, &ReferenceCurve)> = own.collect();
        if own.is_empty() || self.kind.is_in_time() {
            let label = quantities.label;
            return refused(format!(
                "{name} has {}; this figure shows {label} against {x}",
                reference.offers()
            ));
        }
        let places = figure.curves.iter().flat_map(|curve| &curve.points);
        let [low, high] = extent(places.map(|point| point.0));
        // From a place on the axis to the abscissa of the publication and back.
        let distance = |value: f64| match self.against {
            Some(Against::Below(jamming)) => jamming - value,
            _ => value,
        };
        let at = |place: f64| distance(self.log.map_or(place, |_| 10_f64.powf(place)));
        let mut curves = Vec::new();
        for (word, curve) in own {
            let label = match quantities.measured.len() {
                1 => curve.label(reference),
                _ => format!("{word}, {}", curve.label(reference)),
            };
            let places = (0..=LINE).map(|k| low + (high - low) * k as f64 / LINE as f64);
            let line = places.filter_map(|place| Some((place, curve.value(at(place))?)));
            let line: Vec<(f64, f64)> = line.collect();
            let points = curve.points.iter();
            let points = points.map(|[x, y]| (self.place(distance(*x)), *y));
            let (kind, points) = match line.len() {
                0 => (CurveKind::Crosses, points.collect()),
                _ => (CurveKind::Reference, line),
            };
            if points.is_empty() {
                let [from, to] = curve.range;
                return refused(format!(
                    "{name} holds where {x} is between {from} and {to}, and the figure has no such points"
                ));
            }
            let points = points.into_iter().map(|(x, y)| (x, y, 0.0, 0.0));
            let points: Vec<_> = points.collect();
            let before = figure
                .curves
                .iter()
                .filter(|curve| curve.kind == kind)
                .count();
            for panel in 0..figure.panels.len() {
                curves.push(Curve {
                    index: before + curves.len() / figure.panels.len(),
                    ..Curve::new(label.as_str().into(), points.clone(), kind, panel)
                });
            }
        }
        Ok(curves)
    }

    /// Runs in time, or means over them.
    fn in_time(&self, traces: &[Trace], quantities: &Quantities) -> Figure {
        let params: Vec<&Params> = traces.iter().map(|trace| &trace.params).collect();
        let labels = self.shared(None).labels(&params);
        let factor = match quantities.unit {
            "mu" => self.units.viscosity_factor(),
            _ => 1.0,
        };
        let places = traces.iter().flat_map(|trace| &trace.points);
        let log = (self.kind == Kind::Spectrum)
            .then(|| LogAxis::of(&places.map(|point| point.0).collect::<Vec<_>>()));
        let is_named = traces.iter().any(|trace| !trace.name.is_empty());
        let curves = traces.iter().zip(labels).map(|(trace, mut label)| {
            let own = identity(&trace.params);
            let same = |other: &&Trace| identity(&other.params) == own;
            let mut points = self.report.points.iter();
            let point = points.find(|point| identity(&point.params) == own);
            let trend = point.and_then(|point| Some(point.trend.as_ref()?.0));
            if let Some(seed) = trace.seed {
                label.words = label.with(&format!("seed {seed}"));
                if traces.iter().filter(same).count() > 1 {
                    label.number = None;
                }
            }
            if let Some(trend) = trend {
                label.words = label.with(trend.name());
            }
            if is_named {
                let words = std::mem::take(&mut label.words);
                let comma = if words.is_empty() { "" } else { ", " };
                label = Label::from(format!("{}{comma}{words}", trace.name));
            }
            let points = trace.points.iter().map(|(x, estimate)| {
                let [number, down, up] = plotted(*estimate).map(|part| factor * part);
                (log.map_or(*x, |log| log.place(*x)), number, down, up)
            });
            let panel = self.panel(&trace.params);
            Curve {
                discard: trace.discard,
                runs: trace.runs,
                ..Curve::new(label, points.collect(), CurveKind::Line, panel)
            }
        });
        let label = self.units.label(quantities.label, quantities.unit);
        let x = match self.kind {
            Kind::Distribution => "relative viscosity η",
            Kind::Spectrum => "cycles in a strain of 1",
            Kind::Lissajous => "strain / γ₀",
            _ if self.report.segment.is_some() => "strain since the start of the segment",
            _ => "strain",
        };
        Figure {
            x: x.into(),
            log,
            is_linear: self.kind == Kind::Parts,
            ..self.figure_of(curves.collect(), label)
        }
    }

    /// Adds the dilute limit of every fraction to its panel.
    fn add_dilute<'p>(&self, data: &mut Figure, params: impl Iterator<Item = &'p Params>) {
        let factor = self.units.viscosity_factor();
        for params in params {
            let (limit, formula) = dilute_viscosity(params);
            let value = factor * limit;
            let panel = &mut data.panels[self.panel(params)];
            let is_it = |known: &f64| (known - value).abs() < 1e-9 * value;
            if !panel.dashed.iter().any(is_it) {
                panel.dashed.push(value);
                panel.dashed_label = Some(formula);
            }
        }
    }

    /// Where the jammed runs of a point are marked: in a flow curve at the imposed stress and a
    /// rate of 0, else at the position of the point, or a rate of 0, on the upper edge.
    fn jam(&self, point: &Point, x: f64) -> Option<[f64; 2]> {
        if point.jammed == 0 {
            return None;
        }
        let rests = self.along.is_shear_rate() && jammed_at_imposed_stress(point);
        let stress = point
            .params
            .shear_stress
            .filter(|_| self.kind == Kind::FlowCurve);
        let height = stress.map_or(Some(f64::INFINITY), |stress| {
            Some(stress * self.units.factor("F_crit/a²", At::rate(None))?)
        })?;
        let x = if rests && (stress.is_some() || !x.is_finite()) {
            self.place(0.0)
        } else {
            x
        };
        x.is_finite().then_some([x, height])
    }
}
