//! The points of a report on the axes of a figure.

use super::outline::{Curve, Figure, Panel};
use super::quantities::{Quantities, read};
use super::scale::{LogAxis, extent};
use super::{Against, Drawing, Kind};
use crate::measure::numbers::Number;
use crate::model::axes::{AXES, Axis};
use crate::report::error::ReportError;
use crate::report::labels::{AxisWords, Shared};
use crate::report::points::{Point, Report};
use crate::report::states::grouped;
use crate::report::units::Units;
use sd_core::Params;

/// A report, and the axes along which its points are drawn.
pub(super) struct FigureSource<'r> {
    pub(super) kind: Kind,
    pub(super) report: &'r Report,
    pub(super) along: &'static Axis,
    /// What the horizontal axis shows in place of that axis.
    pub(super) against: Option<Against>,
    pub(super) panels: Option<&'static Axis>,
    /// Parameters of each panel, in the order of their values; empty without panels.
    panel_params: Vec<&'r Params>,
    pub(super) log: Option<LogAxis>,
    pub(super) units: Units,
}

impl<'r> FigureSource<'r> {
    pub(super) fn of(
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
    pub(super) fn check_units(&self, quantities: &Quantities) -> Result<(), ReportError> {
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
    pub(super) fn check_scale(&self, quantities: &Quantities) -> Result<(), ReportError> {
        let mut points = self.report.points.iter();
        let is_known = |point: &Point| {
            quantities
                .measured
                .iter()
                .any(|of| read(of.1, point).is_some())
        };
        let lacks_scale = |point| is_known(point) && !self.has_scale(quantities.unit, point);
        if self.units.are_requested() && points.any(lacks_scale) {
            return Err(Units::without_scale());
        }
        Ok(())
    }

    /// Whether numbers of this unit, and the position along the axis, have a value in the requested
    /// units.
    pub(super) fn has_scale(&self, unit: &str, point: &Point) -> bool {
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
    pub(super) fn shared(&self, along: Option<&'static Axis>) -> Shared<'_> {
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
    pub(super) fn chosen_along(&self) -> Vec<&'static str> {
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
}

impl Against {
    /// The place of a point; NaN without one.
    fn place(self, units: Units, point: &Point) -> f64 {
        let place = match self {
            Self::Number(number) => {
                let factor = units.factor(number.unit, point.at());
                factor.zip(point.number(number.name)).map(|(a, b)| a * b)
            }
            Self::Below(jamming) => {
                let below = read("fraction", point).map(|[own, ..]| jamming - own);
                below.filter(|distance| *distance > 0.0)
            }
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
pub(super) fn jammed_at_imposed_stress(point: &Point) -> bool {
    point.params.shear_stress.is_some() && point.jammed > 0
}
