//! Reports as lines: the points of each curve, their positions, and their panels.

use super::{Field, Form, Height, Line, Measured, Sketch, Spot};
use crate::measure::Estimate;
use crate::model::axes::{AXES, Axis, identity};
use crate::model::spaces::dilute_viscosity;
use crate::report::axis_words::AxisWords;
use crate::report::curves::{Curve, Label, Shared, curves, labels};
use crate::report::error::ReportError;
use crate::report::figure::log_axis::LogAxis;
use crate::report::figure::scale::extent;
use crate::report::figure::{Drawing, Kind, Trace};
use crate::report::points::{Point, Report};
use crate::report::starts::Starts;
use crate::report::units::At;
use crate::report::units::Units;
use crate::text::format::counted;
use sd_core::Params;
use std::f64::consts::PI;

/// Settings of the lines of reports.
pub(super) struct Draft<'r> {
    reports: &'r [Report],
    pub(super) along: &'static Axis,
    pub(super) panels: Option<&'static Axis>,
    /// Parameters of each panel, in the order of their values; a single empty entry without panels.
    pub(super) fields: Vec<Option<&'r Params>>,
    log: Option<LogAxis>,
    pub(super) units: Units,
    starts: Starts,
}

impl<'r> Draft<'r> {
    pub(super) fn of(reports: &'r [Report], drawing: &Drawing) -> Result<Self, ReportError> {
        let points = || reports.iter().flat_map(|report| &report.points);
        let params = || points().map(|point| &point.params);
        let along = drawing
            .along
            .unwrap_or_else(|| default_axis(reports, drawing.kind));
        if drawing.kind == Kind::FlowCurve && !along.is_shear_rate() {
            return Err(ReportError::argument(
                "--along",
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
        if drawing.along.is_some() && !is_in_time && !is_diagram && has_one {
            return Err(ReportError::argument(
                "--along",
                format!(
                    "all points have the same {}, so there is no curve along it; {}",
                    along.key,
                    names(Axis::is_numeric)
                ),
            ));
        }
        let mut fields: Vec<Option<&Params>> = vec![None];
        if let Some(axis) = drawing.look.panels {
            let refused = |message| Err(ReportError::argument("--panels", message));
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
            fields = values.into_iter().map(Some).collect();
        }
        let units = reports
            .first()
            .map(|report| report.units)
            .unwrap_or_default();
        Ok(Self {
            reports,
            along,
            units,
            starts: Starts::together(reports.iter().map(|report| &report.starts)),
            panels: drawing.look.panels,
            fields,
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
                "--units",
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

    fn curves(&self) -> Vec<Curve<'r>> {
        let shared = Shared {
            along: Some(self.along),
            panels: self.panels,
            units: self.units,
            starts: &self.starts,
        };
        curves(self.reports, shared)
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
        self.fields.iter().copied().position(same).unwrap_or(0)
    }

    /// A sketch of lines along the axis.
    pub(super) fn sketch(&self, lines: Vec<Line>, y: String) -> Sketch {
        let values = || self.fields.iter().flatten().copied();
        let words = self
            .panels
            .map(|axis| AxisWords::of(axis, self.units, &self.starts, values()));
        let title = |field: Option<&Params>| match (&words, field) {
            (Some(words), Some(params)) => words.named(params),
            _ => String::new(),
        };
        let field = |field| Field {
            title: title(field),
            ..Field::default()
        };
        Sketch {
            lines,
            panels: self.fields.iter().copied().map(field).collect(),
            x: self.units.label_of(self.along),
            y,
            log: self.log,
            ..Sketch::default()
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

    /// A line of a quantity of the points of a curve.
    fn line(
        &self,
        curve: &Curve<'_>,
        label: Label,
        height: &dyn Fn(&Point) -> Option<Height>,
    ) -> Line {
        let spot = |point: &&Point| {
            let y = height(point).filter(|height| height.value.is_finite());
            let x = self.place(self.value(point));
            // One error has one bar: that of a viscosity is drawn along the vertical axis.
            let is_alone = y.is_some_and(|height| height.interval.is_none());
            let across = self.rates(point).filter(|_| is_alone);
            x.is_finite().then_some(Spot { x, y, across })
        };
        let panel = self.panel(&curve.points[0].params);
        let spots = curve.points.iter().filter_map(spot).collect();
        Line::new(label, spots, Form::Curve, panel)
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
    pub(super) fn of_points(&self, measured: Measured) -> Sketch {
        let Measured { label, unit, .. } = measured;
        let height = |point: &Point| {
            let height = measured.read(point)?;
            let factor = self.units.factor(unit, point.at())?;
            Some(Height {
                value: factor * height.value,
                interval: height.interval.map(|reach| reach.map(|part| factor * part)),
            })
        };
        let lines = self.curves().into_iter().filter_map(|mut curve| {
            // A result without a value here, such as a stress at an infinite rate, is left out and
            // not marked as missing.
            let is_shown = |point: &Point| match measured.read(point) {
                Some(height) => height.value.is_finite() && self.has_scale(unit, point),
                None => true,
            };
            curve.points.retain(|point| is_shown(point));
            (!curve.points.is_empty()).then(|| self.line(&curve, curve.label.clone(), &height))
        });
        let lines: Vec<Line> = lines.collect();
        let log = self.log.map(|log| self.without_empty_plateaus(log, &lines));
        Sketch {
            log,
            ..self.sketch(lines, self.units.label(label, unit))
        }
    }

    /// The axis without empty plateaus.
    fn without_empty_plateaus(&self, log: LogAxis, lines: &[Line]) -> LogAxis {
        let spots = || lines.iter().flat_map(|line| &line.points);
        let rests = || self.along.is_shear_rate() && self.points().any(jammed_at_imposed_stress);
        LogAxis {
            zero: log.zero && (spots().any(|spot| spot.x < log.low) || rests()),
            infinite: log.infinite && spots().any(|spot| spot.x > log.high),
            ..log
        }
    }

    /// Four lines per curve.
    pub(super) fn contacts(&self) -> Sketch {
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
        let mut lines = Vec::new();
        for curve in self.curves() {
            for (place, name) in names.into_iter().enumerate() {
                let label = match curve.label.words.as_str() {
                    "" => Label::of_words(name),
                    words => Label::of_words(&format!("{name}, {words}")),
                };
                lines.push(self.line(&curve, label, &|point| {
                    Some(Height::bare(counts(point)?[place]))
                }));
            }
        }
        self.sketch(lines, "pairs per sphere".into())
    }

    /// Runs in time, or means over them.
    pub(super) fn in_time(&self, traces: &[Trace]) -> Sketch {
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
        let labels = labels(&labelled, shared);
        let lines = traces.iter().zip(labels).map(|(trace, mut label)| {
            let same = |other: &&Trace| {
                other.campaign == trace.campaign
                    && identity(&other.params) == identity(&trace.params)
            };
            if let Some(seed) = trace.seed {
                let comma = if label.words.is_empty() { "" } else { ", " };
                label.words = format!("{}{comma}seed {seed}", label.words);
                if traces.iter().filter(same).count() > 1 {
                    label.number = None;
                }
            }
            let factor = self.units.viscosity_factor();
            let spot = |&(x, estimate): &(f64, Estimate)| Spot {
                x,
                y: estimate.mean.is_finite().then(|| Height {
                    value: factor * estimate.mean,
                    interval: estimate.ci95.map(|half| [factor * half; 2]),
                }),
                across: None,
            };
            let panel = self.panel(&trace.params);
            let spots = trace.points.iter().map(spot).collect();
            Line {
                discard: trace.discard,
                runs: trace.runs,
                ..Line::new(label, spots, Form::Trace, panel)
            }
        });
        Sketch {
            x: "strain".into(),
            log: None,
            ..self.sketch(
                lines.collect(),
                self.units.label("relative viscosity η", "mu"),
            )
        }
    }

    /// Adds the dilute limit of every fraction to its panel.
    pub(super) fn add_dilute(&self, sketch: &mut Sketch, traces: &[Trace], kind: Kind) {
        let params: Vec<&Params> = if kind == Kind::Trace {
            traces.iter().map(|trace| &trace.params).collect()
        } else {
            self.points().map(|point| &point.params).collect()
        };
        let factor = self.units.viscosity_factor();
        for params in params {
            let (limit, formula) = dilute_viscosity(params);
            let height = factor * limit;
            let panel = &mut sketch.panels[self.panel(params)];
            if !panel
                .dilute
                .iter()
                .any(|h| (h - height).abs() < 1e-9 * height)
            {
                panel.dilute.push(height);
                panel.formula = formula;
            }
        }
    }

    /// Adds a note on doubtful runs below the figure.
    pub(super) fn note_doubtful(&self, sketch: &mut Sketch, kind: Kind) {
        let number: u64 = self.reports.iter().map(|report| report.doubtful).sum();
        if number > 0 && kind != Kind::Trace {
            let what = if self.reports.iter().any(|report| report.with_doubtful) {
                "averaged too"
            } else {
                "left out"
            };
            let runs = counted(number, "doubtful run");
            sketch.x = format!("{} ({runs} {what})", sketch.x);
        }
    }

    /// Crosses for points with runs that jammed under an imposed stress: at a rate of 0 in a flow
    /// curve, above all flowing points among viscosities.
    pub(super) fn jammed(&self, kind: Kind, sketch: &Sketch) -> Vec<Line> {
        let spots = sketch.lines.iter().flat_map(|line| &line.points);
        let [_, top] = extent(spots.filter_map(|spot| Some(spot.y?.value)));
        let mut lines: Vec<Line> = Vec::new();
        for point in self
            .points()
            .filter(|point| jammed_at_imposed_stress(point))
        {
            let x = if self.along.is_shear_rate() {
                0.0
            } else {
                self.value(point)
            };
            let height = match kind {
                Kind::FlowCurve => {
                    let factor = self.units.factor("F_crit/a²", At::rate(None));
                    let stress = point.params.shear_stress.unwrap_or(f64::NAN);
                    factor.map_or(f64::NAN, |factor| stress * factor)
                }
                Kind::Viscosity => 1.5 * top,
                _ => continue,
            };
            if !height.is_finite() {
                continue;
            }
            let spot = Spot {
                x: self.place(x),
                y: Some(Height::bare(height)),
                across: None,
            };
            let panel = self.panel(&point.params);
            if let Some(line) = lines.iter_mut().find(|line| line.panel == panel) {
                line.points.push(spot);
            } else {
                let label = Label::of_words("jammed at this stress");
                lines.push(Line::new(label, vec![spot], Form::Crosses, panel));
            }
        }
        lines
    }
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
