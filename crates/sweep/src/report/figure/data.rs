//! The curves of a figure: the points of a report, or runs in time.

use super::outline::{Curve, CurveKind, Figure, Panel};
use super::palette::{CURVES, ORDERED_CURVES};
use super::scale::{LogAxis, extent};
use super::{Against, Drawing, Kind, Trace, diagram, refused};
use crate::measure::Estimate;
use crate::measure::numbers::{NUMBERS, Number};
use crate::model::axes::{AXES, Axis, identity};
use crate::model::spaces::dilute_viscosity;
use crate::report::error::ReportError;
use crate::report::labels::{AxisWords, Label, Shared};
use crate::report::points::{Point, Report};
use crate::report::references::{Reference, ReferenceCurve};
use crate::report::states::grouped;
use crate::report::units::{At, Units};
use sd_core::Params;
use std::cmp::Ordering;
use std::f64::consts::PI;

/// Pieces of the line of a published law.
const LINE: usize = 120;

/// A value, and the extent of its interval down and up.
type Plotted = [f64; 3];

fn plotted(estimate: Estimate) -> Plotted {
    let half = estimate.ci95.unwrap_or(0.0);
    [estimate.mean, half, half]
}

/// A quantity of every point: its label, and its column.
type Measured = (&'static str, &'static str);

/// Quantities of figures that show more than one.
const CONTACTS: [Measured; 4] = [
    ("in contact", "contacts_per_sphere"),
    ("activated", "activated_per_sphere"),
    ("rolling", "rolling_per_sphere"),
    ("slipping", "slipping_per_sphere"),
];
const NORMAL_STRESS: [Measured; 2] = [("N₁/σ", "n1_over_stress"), ("N₂/σ", "n2_over_stress")];
const VISCOSITIES: [Measured; 2] = [("η", "viscosity"), ("η_n", "normal_viscosity")];

/// What the vertical axis of a figure shows: its label and unit, and the quantities.
struct Quantities {
    label: &'static str,
    unit: &'static str,
    measured: Vec<Measured>,
}

impl Quantities {
    fn of(drawing: &Drawing) -> Self {
        let one = |label, name, unit| (label, unit, vec![(label, name)]);
        let number = |number: &'static Number| match number.label {
            "" => one(number.name, number.name, number.unit),
            label => one(label, number.name, number.unit),
        };
        let usual = Number::named("viscosity").unwrap_or(&NUMBERS[0]);
        let (label, unit, measured) = match drawing.kind {
            Kind::Contacts => ("pairs per sphere", "1", CONTACTS.to_vec()),
            Kind::NormalStress => ("N₁/σ, N₂/σ", "1", NORMAL_STRESS.to_vec()),
            Kind::Divergence => ("viscosities η, η_n", "mu", VISCOSITIES.to_vec()),
            Kind::FlowCurve => one("shear stress σ*", "shear_stress", "F_crit/a²"),
            Kind::FractionLaw => one("fraction", "fraction", "1"),
            Kind::Lissajous => one("stress / (μ γ₀ ω)", "", "1"),
            Kind::Distribution => one("probability density", "", "1"),
            Kind::Spectrum => one("power of η (per cycle in a strain of 1)", "", "1"),
            Kind::FrictionLaw => {
                Number::named("macroscopic_friction").map_or_else(|| number(usual), number)
            }
            Kind::Parts => number(usual),
            _ => number(drawing.number.unwrap_or(usual)),
        };
        Self {
            label,
            unit,
            measured,
        }
    }

    /// The names of their columns that a reference may have too.
    fn names(&self) -> impl Iterator<Item = Measured> {
        self.measured.iter().map(|(label, name)| match *name {
            "fraction" => (*label, "volume_fraction"),
            name => (*label, name),
        })
    }
}

/// The value of a quantity at a point.
fn read(name: &str, point: &Point) -> Option<Plotted> {
    let number = |name: &str| point.number(name);
    match name {
        "shear_stress" => point.shear_stress().map(plotted),
        "fraction" => {
            let imposed = || {
                let Params {
                    volume_fraction,
                    area_fraction,
                    ..
                } = point.params;
                Estimate::bare(volume_fraction.unwrap_or(area_fraction))
            };
            Some(plotted(point.estimate(name).unwrap_or_else(imposed)))
        }
        "viscosity_median" => {
            let value = number(name)?;
            let quartile = |n: u8| number(&format!("{name}_quartile_{n}"));
            let quartiles = quartile(1).zip(quartile(3));
            let (low, high) = quartiles.unwrap_or((value, value));
            Some([value, value - low, high - value])
        }
        "activated_per_sphere" | "rolling_per_sphere" | "slipping_per_sphere" => {
            let activated = number("activated_fraction").unwrap_or(0.0);
            let rolling = number("rolling_fraction").unwrap_or(0.0);
            let share = match name {
                "activated_per_sphere" => activated,
                "rolling_per_sphere" => activated * rolling,
                _ => activated * (1.0 - rolling),
            };
            Some([number("contacts_per_sphere")? * share, 0.0, 0.0])
        }
        "contacts_per_sphere" => Some([number(name)?, 0.0, 0.0]),
        name => point.estimate(name).map(plotted),
    }
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
        return Err(refused(
            "there are no results to draw yet; `sweep status` shows the progress of the campaign",
        ));
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

/// A report, and the axes along which its points are drawn.
pub(super) struct FigureSource<'r> {
    kind: Kind,
    report: &'r Report,
    pub(super) along: &'static Axis,
    /// What the horizontal axis shows in place of that axis.
    against: Option<Against>,
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
        let viscous_number = || Number::named("viscous_number").map(Against::Number);
        let against = match drawing.kind {
            Kind::FrictionLaw | Kind::FractionLaw => viscous_number(),
            _ => drawing.against,
        };
        let fraction = || {
            let of = |is: fn(&Axis) -> bool| report.varying().find(|axis| is(axis));
            of(Axis::is_imposed_pressure).or_else(|| of(Axis::is_fraction))
        };
        let usual = asked.or_else(|| against.and_then(|_| fraction()));
        let along = usual.unwrap_or_else(|| default_axis(report, drawing.kind));
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
        let is_of_points = !drawing.kind.is_in_time() && drawing.kind != Kind::StateDiagram;
        if asked.is_some() && is_of_points && !points.is_empty() && low >= high {
            let (key, others) = (along.key, varying(Axis::is_numeric));
            let message =
                format!("all points have the same {key}, so there is no curve along it; {others}");
            return refused("along", message);
        }
        let mut panel_params: Vec<&Params> = Vec::new();
        if let Some(axis) = drawing.panels {
            let key = axis.key;
            if key == along.key && !drawing.kind.is_in_time() {
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
        let log = match against {
            Some(against) => {
                let places = points.iter().map(|point| against.place(units, point));
                let places: Vec<f64> = places.filter(|place| !place.is_nan()).collect();
                let [low, high] = extent(places.iter().copied());
                (low > 0.0 && high > 3.0 * low).then(|| LogAxis::of(&places))
            }
            None => along.is_logarithmic().then(|| {
                let rests = |p: &&Point| along.is_shear_rate() && jammed_at_imposed_stress(p);
                let values = points
                    .iter()
                    .map(|p| units.along(along, p.at(), p.place(along)));
                // Layers that carry their stress at rest are drawn at a rate of 0.
                let resting = points.iter().filter(rests).map(|_| 0.0);
                LogAxis::of(&values.chain(resting).collect::<Vec<_>>())
            }),
        };
        Ok(Self {
            kind: drawing.kind,
            report,
            along,
            against,
            panels: drawing.panels,
            panel_params,
            log,
            units,
        })
    }

    /// Checks that the requested units apply and change something.
    fn check_units(&self, quantities: &Quantities) -> Result<(), ReportError> {
        let Quantities { label, unit, .. } = quantities;
        self.units.reach(label, unit)?;
        let mut axes = self.report.varying().chain([self.along]);
        let changes =
            self.units.word(unit) != *unit || axes.any(|axis| self.units.of_axis(axis).is_some());
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
    fn check_scale(&self, quantities: &Quantities) -> Result<(), ReportError> {
        let mut points = self.report.points.iter();
        let is_known = |point: &Point| {
            quantities
                .measured
                .iter()
                .any(|of| read(of.1, point).is_some())
        };
        if points.any(|point| is_known(point) && !self.has_scale(quantities.unit, point)) {
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
            chosen: &[],
            panels: self.panels,
            units: self.units,
            starts: &self.report.starts,
        }
    }

    /// Axes that vary along curves without dividing them, since each place has a value of its own:
    /// the time step, and under an imposed pressure the fraction of the start and the stiffness,
    /// which has the scale of the pressure.
    fn chosen_along(&self) -> Vec<&'static str> {
        let points: Vec<&Point> = self.report.points.iter().collect();
        let is_candidate = |axis: &Axis| {
            let may_follow = axis.is_fraction() || axis.key == "stiffness";
            axis.key == "time_step" || may_follow && self.along.is_imposed_pressure()
        };
        let mut chosen = Vec::new();
        for axis in AXES.iter().filter(|axis| is_candidate(axis)) {
            let with: Vec<&'static str> = chosen.iter().copied().chain([axis.key]).collect();
            let shared = Shared {
                chosen: &with,
                ..self.shared(Some(self.along))
            };
            let groups = grouped(&points, |axis| shared.is_along(axis));
            let places = |group: &[usize]| {
                let mut places: Vec<f64> = group
                    .iter()
                    .map(|place| points[*place].place(self.along))
                    .collect();
                places.sort_by(f64::total_cmp);
                places
            };
            let are_apart = |group: &Vec<usize>| places(group).windows(2).all(|at| at[0] != at[1]);
            let varies =
                |group: &Vec<usize>| axis.varies(group.iter().map(|place| &points[*place].params));
            if groups.iter().all(are_apart) && groups.iter().any(varies) {
                chosen = with;
            }
        }
        chosen
    }

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
            x: self.horizontal_label(),
            y,
            log: self.log,
            ..Figure::default()
        }
    }

    /// Value of a point on the horizontal axis, in the requested units.
    pub(super) fn value(&self, point: &Point) -> f64 {
        match self.against {
            Some(against) => against.place(self.units, point),
            None => self
                .units
                .along(self.along, point.at(), point.place(self.along)),
        }
    }

    fn horizontal_label(&self) -> String {
        match self.against {
            None => self.units.label_of(self.along),
            Some(Against::Below(jamming)) => format!("{jamming} − fraction"),
            Some(Against::Number(number)) => {
                let label = Some(number.label).filter(|label| !label.is_empty());
                self.units.label(label.unwrap_or(number.name), number.unit)
            }
        }
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

impl Against {
    /// The place of a point; NaN without one.
    fn place(self, units: Units, point: &Point) -> f64 {
        let place = match self {
            Self::Number(number) => {
                let factor = units.factor(number.unit, point.at());
                factor.zip(point.number(number.name)).map(|(a, b)| a * b)
            }
            Self::Below(jamming) => read("fraction", point).map(|[own, ..]| jamming - own),
        };
        place.unwrap_or(f64::NAN)
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
        "imposed_viscous_number",
        "imposed_macroscopic_friction",
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
