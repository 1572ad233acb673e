//! The curves of a figure: the points of reports, or runs in time.

use super::outline::{Curve, CurveKind, Figure, Panel};
use super::palette::{CURVES, ORDERED_CURVES};
use super::scale::{LogAxis, extent};
use super::{Drawing, Kind, Quantity, Trace, diagram, refused};
use crate::data::Tag;
use crate::measure::{Estimate, Trend};
use crate::model::axes::{AXES, Axis, identity};
use crate::model::spaces::dilute_viscosity;
use crate::report::error::ReportError;
use crate::report::labels::{AxisWords, Label, Shared, Starts};
use crate::report::points::{Point, Report};
use crate::report::table::Column;
use crate::report::units::{At, Units};
use crate::text::format::counted;
use sd_core::Params;
use std::cmp::Ordering;
use std::f64::consts::PI;

/// A value, and the extent of its interval down and up.
type Plotted = [f64; 3];

fn plotted(estimate: Estimate) -> Plotted {
    let half = estimate.ci95.unwrap_or(0.0);
    [estimate.mean, half, half]
}

/// A quantity of every point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measured {
    /// Label of its axis.
    label: &'static str,
    /// Its column.
    name: &'static str,
    unit: &'static str,
}

/// The data of a figure of reports, or of traces.
///
/// # Errors
/// [`ReportError::Argument`] if there is nothing to draw, or too much.
pub(super) fn figure_data(
    reports: &[Report],
    traces: &[Trace],
    drawing: &Drawing,
) -> Result<Figure, ReportError> {
    let diagram = match drawing.kind {
        Kind::StateDiagram => Some(diagram::axes(reports, drawing)?),
        _ => None,
    };
    let along = diagram.map_or(drawing.along, |[x, _]| Some(x));
    let source = FigureSource::of(reports, drawing, along)?;
    let measured = Measured::of(drawing);
    source.check_units(measured)?;
    let mut data = match (drawing.kind, diagram) {
        (_, Some([_, y])) => source.diagram(y)?,
        (Kind::Contacts, None) => source.contacts(),
        (Kind::Trace, None) => source.in_time(traces),
        _ => source.of_points(measured),
    };
    if matches!(drawing.kind, Kind::Trace | Kind::Viscosity)
        && !(drawing.kind == Kind::Viscosity && source.along.is_fraction())
    {
        source.add_dilute(&mut data, traces);
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
    if drawing.kind != Kind::StateDiagram {
        data.arrange(drawing.kind)?;
    }
    let trends = trends(&data);
    data.curves.extend(trends);
    data.note = source.doubtful();
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
        let is_ordered = known.len() > CURVES && known.iter().all(|(_, number)| number.is_some());
        let most = if is_ordered { ORDERED_CURVES } else { CURVES };
        if known.len() > most {
            let (more, how) = if kind == Kind::Trace {
                (" or more", "runs (where, case)")
            } else {
                (
                    "",
                    "points (where), the axis they run along (along), or an axis with a panel for each value (panels)",
                )
            };
            return Err(refused(format!(
                "{}{more} curves are more than the {most} that can be distinguished: choose {how}",
                known.len()
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
        let (label, name) = match (drawing.kind, drawing.quantity) {
            (Kind::NormalStress, _) => ("normal stress difference N₁", "normal_stress_difference"),
            (Kind::SecondNormalStress, _) => ("normal stress difference N₂", "n2"),
            (Kind::ParticlePressure, _) => ("particle pressure Π", "particle_pressure"),
            (Kind::FlowCurve, _) => ("shear stress σ*", "shear_stress"),
            (Kind::ApproachVelocity, _) => ("mean approach velocity", "mean_approach_velocity"),
            (Kind::Contacts, _) => ("pairs per sphere", "contacts_per_sphere"),
            (_, Quantity::ViscosityStresslet) => ("stresslet viscosity", "viscosity_stresslet"),
            (_, Quantity::ViscosityMedian) => ("median viscosity", "viscosity_median"),
            (_, Quantity::Viscosity) => ("relative viscosity η", "viscosity"),
        };
        Self {
            label,
            name,
            unit: match Column::named(name) {
                Some(column) => column.unit(),
                None => Axis::of_key(name).map_or("", |axis| axis.unit),
            },
        }
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

/// Reports, and the axes along which their points are drawn.
pub(super) struct FigureSource<'r> {
    kind: Kind,
    reports: &'r [Report],
    pub(super) along: &'static Axis,
    pub(super) panels: Option<&'static Axis>,
    /// Parameters of each panel, in the order of their values; a single empty entry without panels.
    pub(super) panel_params: Vec<Option<&'r Params>>,
    log: Option<LogAxis>,
    pub(super) units: Units,
    starts: Starts,
}

impl<'r> FigureSource<'r> {
    fn of(
        reports: &'r [Report],
        drawing: &Drawing,
        asked: Option<&'static Axis>,
    ) -> Result<Self, ReportError> {
        let points = || reports.iter().flat_map(|report| &report.points);
        let params = || points().map(|point| &point.params);
        let along = asked.unwrap_or_else(|| default_axis(reports, drawing.kind));
        if drawing.kind == Kind::FlowCurve && !along.is_shear_rate() {
            return Err(ReportError::argument(
                "along",
                "a flow curve is stress against rate: its axis is shear_rate",
            ));
        }
        let names = |is_meant: fn(&Axis) -> bool| {
            let varying = AXES
                .iter()
                .filter(|axis| is_meant(axis) && axis.varies(params()));
            let names: Vec<&str> = varying.map(|axis| axis.key).collect();
            match names.as_slice() {
                [] => "no axis has several values here".to_owned(),
                names => format!("axes with several values are {}", names.join(", ")),
            }
        };
        // A measured rate varies without being an axis of the campaign.
        let [low, high] = extent(points().map(|point| point.place(along)));
        let is_in_time = drawing.kind == Kind::Trace;
        // It reports itself how many points it needs.
        let is_diagram = drawing.kind == Kind::StateDiagram;
        let has_one = points().next().is_some() && low >= high;
        if asked.is_some() && !is_in_time && !is_diagram && has_one {
            return Err(ReportError::argument(
                "along",
                format!(
                    "all points have the same {}, so there is no curve along it; {}",
                    along.key,
                    names(Axis::is_numeric)
                ),
            ));
        }
        let mut panel_params: Vec<Option<&Params>> = vec![None];
        if let Some(axis) = drawing.panels {
            let refused = |message| Err(ReportError::argument("panels", message));
            if axis.key == along.key && !is_in_time {
                let key = axis.key;
                return refused(format!("the curves run along {key}: name another axis"));
            }
            let mut values: Vec<&Params> = params().collect();
            values.sort_by(|a, b| axis.value(a).order(&axis.value(b)));
            values.dedup_by(|a, b| axis.value(a) == axis.value(b));
            if values.len() < 2 {
                let (key, names) = (axis.key, names(|_| true));
                return refused(format!("all points have the same {key}; {names}"));
            }
            panel_params = values.into_iter().map(Some).collect();
        }
        let units = reports
            .first()
            .map(|report| report.units)
            .unwrap_or_default();
        Ok(Self {
            reports,
            kind: drawing.kind,
            along,
            units,
            starts: Starts::together(reports.iter().map(|report| &report.starts)),
            panels: drawing.panels,
            panel_params,
            log: along.is_logarithmic().then(|| {
                let rests = |p: &&Point| along.is_shear_rate() && jammed_at_imposed_stress(p);
                let values: Vec<f64> = points()
                    .map(|p| units.along(along, p.at(), p.place(along)))
                    // Layers that carry their stress at rest are drawn at a rate of 0.
                    .chain(points().filter(rests).map(|_| 0.0))
                    .collect();
                LogAxis::of(&values)
            }),
        })
    }

    /// Checks that the requested units apply and change something.
    pub(super) fn check_units(&self, measured: Measured) -> Result<(), ReportError> {
        let Measured { label, unit, .. } = measured;
        self.units.reach(label, unit)?;
        let params = || self.points().map(|point| &point.params);
        let is_converted = |axis: &&Axis| self.units.of_axis(axis).is_some();
        let mut varying = AXES.iter().filter(|axis| axis.varies(params()));
        let changes = self.units.word(unit) != unit
            || is_converted(&self.along)
            || varying.any(|axis| is_converted(&axis));
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
    pub(super) fn check_scale(&self, measured: Measured) -> Result<(), ReportError> {
        if self
            .points()
            .any(|point| measured.read(point).is_some() && !self.has_scale(measured.unit, point))
        {
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

    pub(super) fn points(&self) -> impl Iterator<Item = &'r Point> {
        self.reports.iter().flat_map(|report| &report.points)
    }

    /// The points as curves along the axis, one for each combination of values of the others, those
    /// of the first report first.
    fn curves(&self) -> Vec<(Label, Vec<&'r Point>)> {
        let shared = Shared {
            along: Some(self.along),
            panels: self.panels,
            units: self.units,
            starts: &self.starts,
        };
        let mut groups: Vec<(Vec<Tag>, &str, Vec<&Point>)> = Vec::new();
        for (place, report) in self.reports.iter().enumerate() {
            for point in &report.points {
                let tags = identity(&point.params).into_iter().zip(AXES.iter());
                let others = tags.filter(|(_, axis)| !shared.is_along(axis));
                // Points of imposed stress and of imposed rate make curves of their own, as do
                // those of several stores.
                let is_imposed = Tag::Bits(point.params.shear_stress.is_some().into());
                let others = others.map(|(tag, _)| tag);
                let others: Vec<Tag> = others
                    .chain([is_imposed, Tag::Bits(place as u64)])
                    .collect();
                match groups.iter_mut().find(|group| group.0 == others) {
                    Some(group) => group.2.push(point),
                    None => groups.push((others, &report.campaign, vec![point])),
                }
            }
        }
        let first = groups
            .iter()
            .map(|(_, campaign, points)| (*campaign, &points[0].params));
        let labels = shared.labels(&first.collect::<Vec<_>>());
        let along = self.along;
        let sorted = groups.into_iter().map(|(_, _, mut points)| {
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
    pub(super) fn panel(&self, params: &Params) -> usize {
        let same = |field: Option<&Params>| match (self.panels, field) {
            (Some(axis), Some(field)) => axis.value(field) == axis.value(params),
            _ => true,
        };
        self.panel_params
            .iter()
            .copied()
            .position(same)
            .unwrap_or(0)
    }

    /// The figure of curves along the axis.
    pub(super) fn figure_of(&self, curves: Vec<Curve>, y: String) -> Figure {
        let values = || self.panel_params.iter().flatten().copied();
        let words = self
            .panels
            .map(|axis| AxisWords::of(axis, self.units, &self.starts, values()));
        let panel = |params: Option<&Params>| Panel {
            title: match (&words, params) {
                (Some(words), Some(params)) => words.named(params),
                _ => String::new(),
            },
            ..Panel::default()
        };
        Figure {
            curves,
            panels: self.panel_params.iter().copied().map(panel).collect(),
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
                curve
                    .across
                    .extend(ends.map(|[from, to]| [from, to, number]));
            }
        }
        curve
    }

    /// Ends of the interval of the rate that follows from an imposed stress, on the axis.
    fn rates(&self, point: &Point) -> Option<[f64; 2]> {
        let along = self.along;
        let (_, stress) = point.params.last_shear();
        let (stress, eta) = stress
            .filter(|_| along.is_shear_rate())
            .zip(point.viscosity)?;
        let half = eta.ci95?;
        Some([half, -half].map(|reach| {
            // An interval that reaches a viscosity of 0 has no upper end.
            let rate = 6.0 * PI * stress / (eta.mean + reach).max(0.0);
            self.place(self.units.along(along, point.at(), rate))
        }))
    }

    /// One line per curve of one quantity.
    pub(super) fn of_points(&self, measured: Measured) -> Figure {
        let Measured { label, unit, .. } = measured;
        let value = |point: &Point| {
            let factor = self.units.factor(unit, point.at())?;
            Some(measured.read(point)?.map(|part| factor * part))
        };
        let curves = self.curves().into_iter().filter_map(|(label, mut points)| {
            // A result without a value here, such as a stress at an infinite rate, is left out and
            // not marked as missing.
            let is_shown = |point: &Point| match measured.read(point) {
                Some([number, ..]) => number.is_finite() && self.has_scale(unit, point),
                None => true,
            };
            points.retain(|point| is_shown(point));
            (!points.is_empty()).then(|| self.line(&points, label, &value))
        });
        let curves: Vec<Curve> = curves.collect();
        // A plateau that nothing reaches is left out.
        let log = self.log.map(|log| {
            let has = |is_there: &dyn Fn(f64) -> bool| {
                let mut points = curves.iter().flat_map(|curve| &curve.points);
                points.any(|point| is_there(point.0))
            };
            let rests = self.along.is_shear_rate() && self.points().any(jammed_at_imposed_stress);
            LogAxis {
                zero: log.zero && (has(&|x| x < log.low) || rests),
                infinite: log.infinite && has(&|x| x > log.high),
                ..log
            }
        });
        Figure {
            log,
            ..self.figure_of(curves, self.units.label(label, unit))
        }
    }

    /// Four curves for each combination of values.
    pub(super) fn contacts(&self) -> Figure {
        let counts = |point: &Point| {
            let contacts = point.number("contacts_per_sphere")?;
            let activated = contacts * point.number("activated_fraction").unwrap_or(0.0);
            let rolling = point.number("rolling_fraction").unwrap_or(0.0);
            Some([
                contacts,
                activated,
                activated * rolling,
                activated * (1.0 - rolling),
            ])
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
    pub(super) fn in_time(&self, traces: &[Trace]) -> Figure {
        let labelled: Vec<(&str, &Params)> = traces
            .iter()
            .map(|trace| (trace.campaign.as_str(), &trace.params))
            .collect();
        let shared = Shared {
            along: None,
            panels: self.panels,
            units: self.units,
            starts: &self.starts,
        };
        let labels = shared.labels(&labelled);
        let curves = traces.iter().zip(labels).map(|(trace, mut label)| {
            let same = |other: &&Trace| {
                other.campaign == trace.campaign
                    && identity(&other.params) == identity(&trace.params)
            };
            if let Some(seed) = trace.seed {
                label.words = label.with(&format!("seed {seed}"));
                if traces.iter().filter(same).count() > 1 {
                    label.number = None;
                }
            }
            let factor = self.units.viscosity_factor();
            let points = trace.points.iter().map(|(x, estimate)| {
                let [number, down, up] = plotted(*estimate).map(|part| factor * part);
                (*x, number, down, up)
            });
            Curve {
                discard: trace.discard,
                runs: trace.runs,
                ..Curve::new(
                    label,
                    points.collect(),
                    CurveKind::Line,
                    self.panel(&trace.params),
                )
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
    pub(super) fn add_dilute(&self, data: &mut Figure, traces: &[Trace]) {
        let params: Vec<&Params> = if self.kind == Kind::Trace {
            traces.iter().map(|trace| &trace.params).collect()
        } else {
            self.points().map(|point| &point.params).collect()
        };
        let factor = self.units.viscosity_factor();
        for params in params {
            let (limit, formula) = dilute_viscosity(params);
            let value = factor * limit;
            let panel = &mut data.panels[self.panel(params)];
            if !panel
                .dashed
                .iter()
                .any(|h| (h - value).abs() < 1e-9 * value)
            {
                panel.dashed.push(value);
                panel.dashed_label = Some(formula);
            }
        }
    }

    /// A note on doubtful runs.
    fn doubtful(&self) -> Option<String> {
        let number: u64 = self.reports.iter().map(|report| report.doubtful).sum();
        (number > 0 && self.kind != Kind::Trace).then(|| {
            let what = if self.reports.iter().any(|report| report.with_doubtful) {
                "averaged too"
            } else {
                "left out"
            };
            format!("{} {what}", counted(number, "doubtful run"))
        })
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

/// Marks around the points whose runs are not in steady state.
fn trends(data: &Figure) -> Vec<Curve> {
    let mut marks: Vec<Curve> = Vec::new();
    for curve in &data.curves {
        for (trend, [x, y]) in &curve.trends {
            let (spot, kind) = ((*x, *y, 0.0, 0.0), CurveKind::Trend(*trend));
            let mut known = marks.iter_mut();
            let known = known.find(|known| known.panel == curve.panel && known.kind == kind);
            if let Some(known) = known {
                known.points.push(spot);
            } else {
                let label = Label::from(trend.name());
                marks.push(Curve::new(label, vec![spot], kind, curve.panel));
            }
        }
    }
    marks.sort_by_key(|curve| (curve.panel, curve.kind == CurveKind::Trend(Trend::Ordering)));
    marks
}

/// Default axis of a figure: the first that varies.
fn default_axis(reports: &[Report], kind: Kind) -> &'static Axis {
    let first = match kind {
        Kind::Contacts => "friction",
        // Stress against rate, whether stress or rate is imposed.
        Kind::FlowCurve => return Axis::of_key("shear_rate").unwrap_or(&AXES[0]),
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
    let mut axes = keys.into_iter().filter_map(Axis::of_key).chain(numeric);
    let points = || reports.iter().flat_map(|report| &report.points);
    let varies = |axis: &&Axis| axis.varies(points().map(|point| &point.params));
    axes.find(varies)
        .or(Axis::of_key(first))
        .unwrap_or(&AXES[0])
}

/// Whether runs of it ended jammed under an imposed stress.
fn jammed_at_imposed_stress(point: &Point) -> bool {
    point.params.shear_stress.is_some() && point.jammed > 0
}
