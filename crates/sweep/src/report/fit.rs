//! The Wyart-Cates model fitted to a campaign.

mod wyart_cates;

use super::error::ReportError;
use super::figure::{Curve, CurveKind, Origin, draw_curves};
use super::points::{Report, selected_runs};
use super::selection::Selection;
use crate::data::Tag;
use crate::data::{DataColumn, Kind, Value};
use crate::measure::{Estimate, Trend};
use crate::model::axes::{AXES, identity};
use crate::model::case::State;
use crate::store::Store;
use crate::text::format::counted;
use sd_core::Params;
use serde_json::{Value as Json, json};
use std::collections::HashMap;
use std::f64::consts::PI;
use wyart_cates::{Datum, Fit, NAMES, PARAMETERS, fit};

/// Minimum numbers of points and area fractions that determine the parameters.
const MIN_POINTS: usize = PARAMETERS + 1;
const MIN_FRACTIONS: usize = 2;
const MIN_STRESSES: usize = 3;
/// Number of stresses at which a curve of the figure is evaluated.
const DRAWN: usize = 120;

/// A fit and its data.
#[derive(Debug)]
pub struct FitReport {
    campaign: String,
    /// Origin of its figure.
    origin: Origin,
    data: Vec<Datum>,
    /// Of each point.
    params: Vec<Params>,
    /// How the runs of each change, if they are not in steady state.
    trends: Vec<Option<Trend>>,
    /// Points that are left out, as most of their runs jammed.
    jammed: Vec<LeftOut>,
    fit: Fit,
}

/// A point most of whose runs jammed: those that flowed are no sample of it.
#[derive(Debug)]
struct LeftOut {
    fraction: f64,
    /// `None` under an imposed rate.
    stress: Option<f64>,
    jammed: usize,
    runs: usize,
}

/// The runs of a point.
#[derive(Debug)]
struct PointRuns {
    params: Params,
    /// Of those that are averaged.
    viscosities: Vec<f64>,
    jammed: usize,
    /// Those that ended, whether averaged or not.
    runs: usize,
}

impl FitReport {
    /// Fits the points selected, with runs averaged as in a report.
    ///
    /// # Errors
    /// An I/O or SQLite error; [`ReportError::Argument`] where points differ in more than fraction
    /// and shear, or are too few.
    pub fn of(
        store: &Store,
        selection: &Selection,
        replicates: usize,
    ) -> Result<Self, ReportError> {
        let report = Report::of(store, selection)?;
        if report
            .points
            .iter()
            .any(|point| point.params.imposes_pressure())
        {
            return Err(ReportError::Refused(
                "a fit needs points at given fractions, and these are under an imposed pressure"
                    .into(),
            ));
        }
        let mut runs: HashMap<Vec<Tag>, PointRuns> = HashMap::new();
        let mut order: Vec<Vec<Tag>> = Vec::new();
        for run in selected_runs(store, selection)? {
            let is_jammed = run.state == State::Jammed;
            let is_averaged = run.is_sound() || (report.with_doubtful && run.is_doubtful());
            let viscosity = run.number("viscosity").filter(|_| is_averaged);
            if !is_jammed && run.state != State::Done {
                continue;
            }
            let key = identity(&run.params);
            let entry = runs.entry(key.clone()).or_insert_with(|| {
                order.push(key);
                PointRuns {
                    params: (*run.params).clone(),
                    viscosities: Vec::new(),
                    jammed: 0,
                    runs: 0,
                }
            });
            entry.jammed += usize::from(is_jammed);
            entry.runs += 1;
            entry.viscosities.extend(viscosity);
        }
        let points = order.iter().filter_map(|key| runs.remove(key));
        let (jammed, points): (Vec<PointRuns>, Vec<PointRuns>) =
            points.partition(|point| point.jammed > point.viscosities.len());
        // Others may have doubtful runs alone.
        let points = points
            .into_iter()
            .filter(|point| !point.viscosities.is_empty());
        let mut points: Vec<(Params, Vec<f64>)> = points
            .map(|point| (point.params, point.viscosities))
            .collect();
        // Whatever the order of the file, since the bootstrap draws point by point.
        points.sort_by(|(a, of_a), (b, of_b)| {
            let fractions = fraction(a).total_cmp(&fraction(b));
            fractions.then(stress(a, of_a).total_cmp(&stress(b, of_b)))
        });
        let params: Vec<Params> = points.iter().map(|(params, _)| params.clone()).collect();
        check(&params)?;
        let known = report.points.iter();
        let known = known.map(|point| (identity(&point.params), point.trend.as_ref()));
        let known: HashMap<Vec<Tag>, _> = known.collect();
        let trend = |params| Some(known.get(&identity(params)).copied()??.0);
        let trends = params.iter().map(trend).collect();
        let data: Vec<Datum> = points
            .into_iter()
            .map(|(params, runs)| Datum {
                fraction: fraction(&params),
                stress: stress(&params, &runs),
                runs,
            })
            .collect();
        check_number(&data)?;
        let fit = fit(&data, replicates).ok_or_else(|| {
            ReportError::Refused("no parameters of the model describe these points: the viscosity must not decrease with the stress".into())
        })?;
        Ok(Self {
            origin: Origin::of(&report),
            campaign: report.campaign,
            data,
            params,
            trends,
            jammed: jammed.iter().map(LeftOut::of).collect(),
            fit,
        })
    }

    /// The parameters: name, value, and 95 % interval.
    pub fn parameters(&self) -> impl Iterator<Item = (&'static str, f64, Option<[f64; 2]>)> {
        let interval = |k: usize| self.fit.intervals.map(|intervals| intervals[k]);
        (0..PARAMETERS).map(move |k| (NAMES[k], self.fit.values[k], interval(k)))
    }

    /// Whether the points do not determine a parameter.
    pub fn is_undetermined(&self, name: &str) -> bool {
        self.fit.undetermined.contains(&name)
    }

    /// Warnings about parameters that the points do not determine, and about points that are not in
    /// steady state.
    pub fn notes(&self) -> Vec<String> {
        let names = self.fit.undetermined.join(", ");
        let undetermined = (!names.is_empty()).then(|| {
            format!(
                "not determined by these points: {names}; their values are no results. Points at more fractions near jamming, or at more \
                 stresses around the onset of friction, would determine them"
            )
        });
        let unsteady = self.trends().flatten().count() as u64;
        let unsteady = (unsteady > 0).then(|| {
            format!(
                "{} fitted here with runs that are not steady or ordering; `sweep report` says what changes, and a selection (where) leaves points out",
                counted(unsteady, "point")
            )
        });
        undetermined.into_iter().chain(unsteady).collect()
    }

    /// How the runs of each point change, in the order of the rows, where they are not in steady
    /// state.
    fn trends(&self) -> impl Iterator<Item = Option<Trend>> {
        self.trends.iter().copied()
    }

    /// Names of these trends.
    pub fn trend_names(&self) -> impl Iterator<Item = Option<&'static str>> {
        self.trends().map(|trend| Some(trend?.name()))
    }

    /// Root mean square of ln η minus that of the fit.
    pub fn rms(&self) -> f64 {
        let squares: f64 = self.fit.residuals.iter().map(|r| r * r).sum();
        (squares / self.fit.residuals.len() as f64).sqrt()
    }

    /// Key and symbol of the fraction, of area or of volume.
    pub fn fraction(&self) -> [&'static str; 2] {
        let key = self.params.first().map_or("area_fraction", fraction_key);
        [key, if key == "volume_fraction" { "φ" } else { "c" }]
    }

    /// Name of the campaign, points, runs, and points left out.
    pub fn summary(&self) -> String {
        let left_out = match self.jammed.len() {
            0 => String::new(),
            number => format!(
                "; left out {}, most of whose runs jammed",
                counted(number as u64, "point")
            ),
        };
        format!(
            "{}: η = A (1 − {}/c_J)⁻², c_J = f c_m + (1 − f) c_0, f = exp(−(σ_c/σ)^β), to {} points of {} runs{left_out}",
            self.campaign,
            self.fraction()[1],
            self.data.len(),
            self.data
                .iter()
                .map(|datum| datum.runs.len())
                .sum::<usize>()
        )
    }

    /// Fraction, of area or of volume, stress, viscosity, that of the fit, and the residual of
    /// every point.
    pub fn rows(&self) -> impl Iterator<Item = [f64; 5]> {
        self.data
            .iter()
            .zip(&self.fit.residuals)
            .map(|(datum, residual)| {
                let mean = datum.runs.iter().sum::<f64>() / datum.runs.len() as f64;
                let fitted = self.fit.viscosity(datum.fraction, datum.stress);
                [datum.fraction, datum.stress, mean, fitted, *residual]
            })
    }

    /// Points left out, as most of their runs jammed: fraction, imposed stress if there is one,
    /// viscosity of the fit there (infinite where it jams too), runs that jammed, and all that
    /// jammed or flowed.
    pub fn jammed(&self) -> impl Iterator<Item = (f64, Option<f64>, Option<f64>, [usize; 2])> {
        self.jammed.iter().map(|point| {
            let fitted = point
                .stress
                .map(|stress| self.fit.viscosity(point.fraction, stress));
            (
                point.fraction,
                point.stress,
                fitted,
                [point.jammed, point.runs],
            )
        })
    }

    /// The points as a table, with their viscosity, that of the fit, and the residual.
    pub(crate) fn table(&self) -> Vec<DataColumn> {
        let names = ["shear_stress", "viscosity", "fitted", "residual"];
        let columns = std::iter::once(self.fraction()[0]).chain(names).enumerate();
        let columns = columns.map(|(index, name)| {
            let cells = self.rows().map(|row| Some(Value::Number(row[index])));
            DataColumn::of(name, Kind::Number, "", cells)
        });
        let trends = self.trend_names().map(|name| Some(Value::Word(name?)));
        let trends = DataColumn::of("trend", Kind::Word, "", trends);
        columns.chain([trends]).collect()
    }

    /// The object for programs.
    pub fn json(&self) -> Json {
        let number = |value: f64| json!(Value::Number(value));
        // Without friction only the plateau Γ = 0 has a rate.
        let has_rate = |params: &Params| {
            let is_free = params.friction == 0.0 && params.shear_rate > 0.0;
            params.shear_stress.is_none() && !is_free
        };
        let parameters: serde_json::Map<String, Json> = self
            .parameters()
            .map(|(name, value, interval)| {
                let end = |k: usize| interval.map(|interval| number(interval[k]));
                let entry = json!({"value": number(value), "low": end(0), "high": end(1)});
                (name.to_owned(), entry)
            })
            .collect();
        let points: Vec<Json> = self
            .rows()
            .zip(self.params.iter().zip(self.trend_names()))
            .map(
                |([fraction, stress, viscosity, fitted, residual], (params, trend))| {
                    let key = fraction_key(params);
                    json!({
                        key: fraction, "shear_stress": number(stress),
                        "shear_rate": has_rate(params).then(|| number(params.shear_rate)),
                        "viscosity": viscosity, "fitted": number(fitted), "residual": residual,
                        "trend": trend,
                    })
                },
            )
            .collect();
        let jammed: Vec<Json> = self
            .jammed()
            .map(|(fraction, stress, fitted, [jammed, runs])| {
                json!({
                    self.fraction()[0]: fraction, "shear_stress": stress.map(number), "fitted": fitted.map(number),
                    "jammed": jammed, "runs": runs,
                })
            })
            .collect();
        json!({
            "campaign": self.campaign, "model": "wyart-cates", "parameters": parameters, "rms": self.rms(),
            "replicates": self.fit.replicates, "undetermined": self.fit.undetermined, "points": points, "jammed": jammed,
        })
    }

    /// Draws viscosities and the fit against the stress, one colour per fraction.
    ///
    /// # Errors
    /// [`ReportError::Argument`] if there are more fractions than a figure holds.
    pub fn draw(&self) -> Result<String, ReportError> {
        let mut fractions: Vec<f64> = self.data.iter().map(|datum| datum.fraction).collect();
        fractions.sort_by(f64::total_cmp);
        fractions.dedup();
        let finite = || {
            let stresses = self.data.iter().map(|datum| datum.stress);
            stresses.filter(|stress| *stress > 0.0 && stress.is_finite())
        };
        let low = finite().fold(f64::INFINITY, f64::min).ln();
        let high = finite().fold(0.0, f64::max).ln();
        let mut curves = Vec::with_capacity(2 * fractions.len());
        for (index, &fraction) in fractions.iter().enumerate() {
            let of = self.rows().zip(self.trends());
            let of = of.filter(|(row, _)| row[0] == fraction);
            let mut data: Vec<_> = of.map(|(row, trend)| ([row[1], row[2]], trend)).collect();
            data.sort_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]));
            let (data, trends): (Vec<[f64; 2]>, Vec<_>) = data.into_iter().unzip();
            let drawn = (0..=DRAWN).map(|k| (low + (high - low) * k as f64 / DRAWN as f64).exp());
            let fit = drawn.map(|at| (at, Estimate::bare(self.fit.viscosity(fraction, at))));
            let data = data.into_iter().map(|[x, y]| (x, Estimate::bare(y)));
            let label = format!("{} = {fraction}", self.fraction()[1]);
            let data = Curve::of_values(&label, data, CurveKind::Points, index);
            curves.push(data.marked(&trends));
            curves.push(Curve::of_values("", fit, CurveKind::Line, index));
        }
        let axes = ["shear stress σ* (F_crit/a²)", "relative viscosity η"];
        draw_curves(curves, axes, [true, false], &self.origin)
    }
}

impl LeftOut {
    fn of(point: &PointRuns) -> Self {
        let (_, imposed) = point.params.last_shear();
        let plateau = |rate: f64| (rate == 0.0 || rate.is_infinite()).then_some(rate);
        let stress = match imposed {
            _ if point.params.friction == 0.0 => Some(0.0),
            Some(stress) => Some(stress),
            None => plateau(point.params.shear_rate),
        };
        Self {
            fraction: fraction(&point.params),
            stress,
            jammed: point.jammed,
            runs: point.runs,
        }
    }
}

/// The fraction of these spheres.
fn fraction(params: &Params) -> f64 {
    params.volume_fraction.unwrap_or(params.area_fraction)
}

/// σ* of a point: imposed, or from the mean viscosity at the rate; 0 and infinity at the plateaus.
/// Without friction it has no effect, and no contact is frictional: 0, as on the lower plateau.
fn stress(params: &Params, runs: &[f64]) -> f64 {
    if params.friction == 0.0 {
        return 0.0;
    }
    let (rate, stress) = params.last_shear();
    stress.unwrap_or_else(|| {
        let mean = runs.iter().sum::<f64>() / runs.len() as f64;
        mean * rate / (6.0 * PI)
    })
}

/// Key of the fraction of these spheres.
fn fraction_key(params: &Params) -> &'static str {
    if params.volume_fraction.is_some() {
        "volume_fraction"
    } else {
        "area_fraction"
    }
}

/// Refuses points that differ in more than fraction and shear. A frictionless plateau belongs to
/// every friction.
fn check(params: &[Params]) -> Result<(), ReportError> {
    let rubbing = || params.iter().filter(|params| params.friction > 0.0);
    let mut named = Vec::new();
    if params
        .windows(2)
        .any(|pair| fraction_key(&pair[0]) != fraction_key(&pair[1]))
    {
        named.push("some are layers, others suspensions".to_owned());
    }
    for axis in AXES.iter() {
        let is_fitted = axis.is_of_shear() || axis.is_fraction() || axis.key == "spheres";
        if is_fitted || !axis.varies(rubbing()) {
            continue;
        }
        let mut values: Vec<String> = rubbing().map(|p| axis.value(p).to_string()).collect();
        values.sort();
        values.dedup();
        named.push(format!("{} has {}", axis.key, values.join(", ")));
    }
    if named.is_empty() {
        return Ok(());
    }
    Err(ReportError::argument(
        "where",
        format!(
            "a fit needs points that differ only in their fraction and shear, and {}: choose one value of each (where)",
            named.join("; ")
        ),
    ))
}

/// Refuses too few points to determine the parameters.
fn check_number(data: &[Datum]) -> Result<(), ReportError> {
    let distinct = |of: fn(&Datum) -> f64| {
        let mut values: Vec<f64> = data.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values.len()
    };
    let (fractions, stresses) = (distinct(|d| d.fraction), distinct(|d| d.stress));
    if data.len() >= MIN_POINTS && fractions >= MIN_FRACTIONS && stresses >= MIN_STRESSES {
        return Ok(());
    }
    Err(ReportError::Refused(format!(
        "a fit of {PARAMETERS} parameters needs at least {MIN_POINTS} points with results, at {MIN_FRACTIONS} area or volume fractions and \
         {MIN_STRESSES} stresses or rates; here are {} points at {fractions} and {stresses}",
        data.len()
    )))
}
