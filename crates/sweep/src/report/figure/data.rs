//! The curves of a figure: the points of a report, or runs in time.

use super::outline::{Curve, CurveKind, Figure, Panel};
use super::palette::{CURVES, ORDERED_CURVES};
use super::scale::{LogAxis, extent};
use super::{Drawing, Kind, Trace, diagram, refused};
use crate::measure::Estimate;
use crate::measure::numbers::Number;
use crate::model::axes::{AXES, Axis, identity};
use crate::model::spaces::dilute_viscosity;
use crate::report::error::ReportError;
use crate::report::labels::{AxisWords, Label, Shared};
use crate::report::points::{Point, Report};
use crate::report::states::grouped;
use crate::report::units::{At, Units};
use sd_core::Params;
use std::cmp::Ordering;
use std::f64::consts::PI;

/// A value, and the extent of its interval down and up.
type Plotted = [f64; 3];

fn plotted(estimate: Estimate) -> Plotted {
    let half = estimate.ci95.unwrap_or(0.0);
    [estimate.mean, half, half]
}

/// A quantity of every point: label of its axis, column and unit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measured {
    label: &'static str,
    name: &'static str,
    unit: &'static str,
}

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
    let measured = Measured::of(drawing);
    source.check_units(measured)?;
    let mut data = match (kind, diagram) {
        (_, Some([_, y])) => source.diagram(y)?,
        (Kind::Contacts, None) => source.contacts(),
        (Kind::Trace, None) => source.in_time(traces),
        _ => source.of_points(measured),
    };
    let is_viscosity = kind == Kind::Curve && measured.name.starts_with("viscosity");
    if kind == Kind::Trace {
        source.add_dilute(&mut data, traces.iter().map(|trace| &trace.params));
    } else if is_viscosity && !source.along.is_fraction() {
        source.add_dilute(&mut data, report.params());
    }
    let has_result = |curve: &Curve| curve.points.iter().any(|point| !point.1.is_nan());
    if !data.curves.iter().any(has_result) {
        source.check_scale(measured)?;
        return Err(refused(
            "there are no results to draw yet; `sweep status` shows the progress of the campaign",
        ));
    }
    data.curves.retain(|curve| !curve.points.is_empty());
    // In a state diagram each state has a fixed colour, even if others are absent.
    if kind != Kind::StateDiagram {
        data.arrange(kind)?;
    }
    data.note = (kind != Kind::Trace).then(|| report.note()).flatten();
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
                Kind::Trace => (" or more", "runs (where, case)"),
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

impl Measured {
    /// The quantity of a figure.
    fn of(drawing: &Drawing) -> Self {
        let usual = || Number::named("viscosity");
        let number = match drawing.kind {
            Kind::FlowCurve | Kind::Contacts => None,
            _ => drawing.number.or_else(usual),
        };
        let (label, name, unit) = match number {
            Some(number) if number.label.is_empty() => (number.name, number.name, number.unit),
            Some(number) => (number.label, number.name, number.unit),
            None if drawing.kind == Kind::Contacts => {
                ("pairs per sphere", "contacts_per_sphere", "1")
            }
            None => ("shear stress σ*", "shear_stress", "F_crit/a²"),
        };
        Self { label, name, unit }
    }

    /// Its value at a point.
    fn read(self, point: &Point) -> Option<Plotted> {
        match self.name {
            "shear_stress" => point.shear_stress().map(plotted),
            "viscosity_median" => {
                let number = point.number(self.name)?;
                let quartile = |n: u8| point.number(&format!("{}_quartile_{n}", self.name));
                let quartiles = quartile(1).zip(quartile(3));
                let (low, high) = quartiles.unwrap_or((number, number));
                Some([number, number - low, high - number])
            }
            name => point.estimate(name).map(plotted),
        }
    }
}

/// A report, and the axes along which its points are drawn.
pub(super) struct FigureSource<'r> {
    kind: Kind,
    report: &'r Report,
    pub(super) along: &'static Axis,
    pub(super) panels: Option<&'static Axis>,
    /// Parameters of each panel, in the order of their values; empty without panels.
    panel_params: Vec<&'r Params>,
    log: Option<LogAxis>,
    pub(super) units: Units,
}

impl<'r> FigureSource<'r> {
    fn of(
        report: &'r Report,
        drawing: &Drawing,
        asked: Option<&'static Axis>,
    ) -> Result<Self, ReportError> {
        let (points, units) = (&report.points, report.units);
        let along = asked.unwrap_or_else(|| default_axis(report, drawing.kind));
        let refused = |option, message: String| Err(ReportError::argument(option, message));
        if drawing.kind == Kind::FlowCurve && !along.is_shear_rate() {
            let message = "a flow curve is stress against rate: its axis is shear_rate";
            return refused("along", message.into());
        }
        let varying = |is_meant: fn(&Axis) -> bool| {
            let axes = report.varying().filter(|axis| is_meant(axis));
            match axes.map(|axis| axis.key).collect::<Vec<_>>() {
                none if none.is_empty() => "no axis has several values here".to_owned(),
                keys => format!("axes with several values are {}", keys.join(", ")),
            }
        };
        // A measured rate varies without being an axis of the campaign. A state diagram reports
        // itself how many points it needs.
        let [low, high] = extent(points.iter().map(|point| point.place(along)));
        let is_of_points = !matches!(drawing.kind, Kind::Trace | Kind::StateDiagram);
        if asked.is_some() && is_of_points && !points.is_empty() && low >= high {
            let (key, others) = (along.key, varying(Axis::is_numeric));
            let message =
                format!("all points have the same {key}, so there is no curve along it; {others}");
            return refused("along", message);
        }
        let mut panel_params: Vec<&Params> = Vec::new();
        if let Some(axis) = drawing.panels {
            let key = axis.key;
            if key == along.key && drawing.kind != Kind::Trace {
                let message = format!("the curves run along {key}: name another axis");
                return refused("panels", message);
            }
            panel_params = report.params().collect();
            panel_params.sort_by(|a, b| axis.value(a).order(&axis.value(b)));
            panel_params.dedup_by(|a, b| axis.value(a) == axis.value(b));
            if panel_params.len() < 2 {
                let others = varying(|_| true);
                return refused(
                    "panels",
                    format!("all points have the same {key}; {others}"),
                );
            }
        }
        let log = along.is_logarithmic().then(|| {
            let rests = |p: &&Point| along.is_shear_rate() && jammed_at_imposed_stress(p);
            let values = points
                .iter()
                .map(|p| units.along(along, p.at(), p.place(along)));
            // Layers that carry their stress at rest are drawn at a rate of 0.
            let resting = points.iter().filter(rests).map(|_| 0.0);
            LogAxis::of(&values.chain(resting).collect::<Vec<_>>())
        });
        Ok(Self {
            kind: drawing.kind,
            report,
            along,
            panels: drawing.panels,
            panel_params,
            log,
            units,
        })
    }

    /// Checks that the requested units apply and change something.
    fn check_units(&self, measured: Measured) -> Result<(), ReportError> {
        let Measured { label, unit, .. } = measured;
        self.units.reach(label, unit)?;
        let mut axes = self.report.varying().chain([self.along]);
        let changes =
            self.units.word(unit) != unit || axes.any(|axis| self.units.of_axis(axis).is_some());
        if self.units.are_requested() && !changes {
            return Err(ReportError::argument(
                "units",
                format!(
                    "nothing in this figure has a physical unit: it shows {label} against {}",
                    self.along.key
                ),
            ));
        }
        Ok(())
    }

    /// Whether nothing is drawn because no value has a physical scale.
    fn check_scale(&self, measured: Measured) -> Result<(), ReportError> {
        let mut points = self.report.points.iter();
        let is_lost =
            |point: &Point| measured.read(point).is_some() && !self.has_scale(measured.unit, point);
        if points.any(is_lost) {
            return Err(Units::without_scale());
        }
        Ok(())
    }

    /// Whether numbers of this unit, and the position along the axis, have a value in the requested
    /// units.
    fn has_scale(&self, unit: &str, point: &Point) -> bool {
        let has_place = point.place(self.along).is_nan() || !self.value(point).is_nan();
        self.units.factor(unit, point.at()).is_some() && has_place
    }

    /// The points of each panel.
    pub(super) fn points_by_panel(&self) -> Vec<Vec<&'r Point>> {
        let mut panels = vec![Vec::new(); self.panel_params.len().max(1)];
        for point in &self.report.points {
            panels[self.panel(&point.params)].push(point);
        }
        panels
    }

    /// The common settings of curves along an axis.
    fn shared(&self, along: Option<&'static Axis>) -> Shared<'_> {
        Shared {
            along,
            panels: self.panels,
            units: self.units,
            starts: &self.report.starts,
        }
    }

    /// The points as curves along the axis, one for each combination of values of the others.
    fn curves(&self) -> Vec<(Label, Vec<&'r Point>)> {
        let (along, points) = (self.along, &self.report.points);
        let shared = self.shared(Some(along));
        let all: Vec<&Point> = points.iter().collect();
        let groups = grouped(&all, |axis| shared.is_along(axis));
        let first = groups.iter().map(|group| &points[group[0]].params);
        let labels = shared.labels(&first.collect::<Vec<_>>());
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

    /// Label of an axis of shear with its unit, whether stress or rate is imposed.
    pub(super) fn label_of_shear(&self, axis: &Axis) -> String {
        if axis.is_shear_stress() {
            self.units.label("shear stress σ*", axis.unit)
        } else {
            self.units.label_of(axis)
        }
    }

    /// The panel of some parameters.
    fn panel(&self, params: &Params) -> usize {
        let mut fields = self.panel_params.iter();
        let place = self
            .panels
            .and_then(|axis| fields.position(|field| axis.value(field) == axis.value(params)));
        place.unwrap_or(0)
    }

    /// The figure of curves along the axis.
    pub(super) fn figure_of(&self, curves: Vec<Curve>, y: String) -> Figure {
        let titles: Vec<String> = match self.panels {
            None => vec![String::new()],
            Some(axis) => {
                let values = self.panel_params.iter().copied();
                let words = AxisWords::of(axis, self.units, &self.report.starts, values.clone());
                values.map(|params| words.named(params)).collect()
            }
        };
        let panel = |title| Panel {
            title,
            ..Panel::default()
        };
        Figure {
            curves,
            panels: titles.into_iter().map(panel).collect(),
            x: self.units.label_of(self.along),
            y,
            log: self.log,
            ..Figure::default()
        }
    }

    /// Value of a point along the axis, in the requested units.
    pub(super) fn value(&self, point: &Point) -> f64 {
        let value = point.place(self.along);
        self.units.along(self.along, point.at(), value)
    }

    /// Position of a value on the axis.
    pub(super) fn place(&self, value: f64) -> f64 {
        self.log.map_or(value, |log| log.place(value))
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
        let stress = stress.filter(|_| along.is_shear_rate())?;
        let eta = point.viscosity?;
        let half = eta.ci95?;
        Some([half, -half].map(|reach| {
            // An interval that reaches a viscosity of 0 has no upper end.
            let rate = 6.0 * PI * stress / (eta.mean + reach).max(0.0);
            self.place(self.units.along(along, point.at(), rate))
        }))
    }

    /// One line per curve of one quantity.
    fn of_points(&self, measured: Measured) -> Figure {
        let Measured { label, unit, .. } = measured;
        let value = |point: &Point| {
            let factor = self.units.factor(unit, point.at())?;
            Some(measured.read(point)?.map(|part| factor * part))
        };
        // A result without a value here, such as a stress at an infinite rate, is left out and not
        // marked as missing.
        let is_shown = |point: &&Point| match measured.read(point) {
            Some([number, ..]) => number.is_finite() && self.has_scale(unit, point),
            None => true,
        };
        let curves = self.curves().into_iter().filter_map(|(label, mut points)| {
            points.retain(|point| is_shown(point));
            (!points.is_empty()).then(|| self.line(&points, label, &value))
        });
        let curves: Vec<Curve> = curves.collect();
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

    /// Four curves for each combination of values.
    fn contacts(&self) -> Figure {
        let counts = |point: &Point| {
            let contacts = point.number("contacts_per_sphere")?;
            let activated = contacts * point.number("activated_fraction").unwrap_or(0.0);
            let rolling = point.number("rolling_fraction").unwrap_or(0.0);
            let of_kinds = [activated * rolling, activated * (1.0 - rolling)];
            Some([contacts, activated, of_kinds[0], of_kinds[1]])
        };
        let names = ["in contact", "activated", "rolling", "slipping"];
        let mut curves = Vec::new();
        for (label, points) in self.curves() {
            for (place, name) in names.into_iter().enumerate() {
                let label = Label::from(match label.words.as_str() {
                    "" => name.to_owned(),
                    words => format!("{name}, {words}"),
                });
                curves.push(self.line(&points, label, &|point| {
                    Some([counts(point)?[place], 0.0, 0.0])
                }));
            }
        }
        self.figure_of(curves, "pairs per sphere".into())
    }

    /// Runs in time, or means over them.
    fn in_time(&self, traces: &[Trace]) -> Figure {
        let params: Vec<&Params> = traces.iter().map(|trace| &trace.params).collect();
        let labels = self.shared(None).labels(&params);
        let factor = self.units.viscosity_factor();
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
            let points = trace.points.iter().map(|(x, estimate)| {
                let [number, down, up] = plotted(*estimate).map(|part| factor * part);
                (*x, number, down, up)
            });
            let panel = self.panel(&trace.params);
            Curve {
                discard: trace.discard,
                runs: trace.runs,
                ..Curve::new(label, points.collect(), CurveKind::Line, panel)
            }
        });
        let label = self.units.label("relative viscosity η", "mu");
        Figure {
            x: "strain".into(),
            log: None,
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

/// Default axis of a figure: the first that varies.
pub(in crate::report) fn default_axis(report: &Report, kind: Kind) -> &'static Axis {
    let of_key = |key| Axis::of_key(key).unwrap_or(&AXES[0]);
    let first = match kind {
        Kind::Contacts => "friction",
        // Stress against rate, whether stress or rate is imposed.
        Kind::FlowCurve => return of_key("shear_rate"),
        _ => "shear_rate",
    };
    let keys = [
        first,
        "shear_stress",
        "shear_rate",
        "area_fraction",
        "volume_fraction",
        "friction",
    ];
    let numeric = AXES.iter().filter(|axis| axis.is_numeric());
    let mut axes = keys.map(of_key).into_iter().chain(numeric);
    let varies = |axis: &&Axis| axis.varies(report.params());
    axes.find(varies).unwrap_or(of_key(first))
}

/// Whether runs of it ended jammed under an imposed stress.
fn jammed_at_imposed_stress(point: &Point) -> bool {
    point.params.shear_stress.is_some() && point.jammed > 0
}
