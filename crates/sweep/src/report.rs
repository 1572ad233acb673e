//! What the store holds, averaged over seeds: the answer to the campaign's question.

mod axes;
mod chart;
mod columns;
mod curves;
mod figure;
mod json;
mod page;
mod parquet;
mod selection;
mod text;
mod tidy;

pub(crate) use axes::identity;
pub use axes::{AXES, Axis, Value};
pub(crate) use chart::chart;
pub use figure::{Drawing, Format, Kind, Quantity, Trace, draw, draw_paths, traces};
pub use json::write as write_json;
pub use page::{Home, data, movie, page};
pub use parquet::parquet;
pub use selection::Selection;
pub use text::write as write_text;
pub(crate) use text::{contact, hydrodynamics, onset, table, tangential};
pub use tidy::{write_csv, write_markdown, write_units};

use crate::case::State;
use crate::error::Error;
use crate::statistics::{Estimate, mean, median, ratio};
use crate::store::{Counts, FailureGroup, PointRun, Provenance, Store};
use sd_core::Params;
use std::collections::HashMap;

/// Failures listed in a report.
const FAILURES_SHOWN: usize = 10;

/// A campaign's results so far.
#[derive(Debug, Clone)]
pub struct Report {
    /// Name of the campaign.
    pub campaign: String,
    /// Which of its points it is about.
    pub selection: Selection,
    /// Their cases by state.
    pub counts: Counts,
    /// Strain discarded from every run.
    pub discard: f64,
    /// The points in the order of the file.
    pub points: Vec<Point>,
    /// Their first failures, those that are alike together.
    pub failures: Vec<FailureGroup>,
    /// Seconds of computing their results took, over all workers.
    pub computing: f64,
    /// Processes that finished results of the store, the latest first.
    pub provenance: Vec<Provenance>,
}

/// All runs that differ only in their seed.
#[derive(Debug, Clone)]
pub struct Point {
    /// Their parameters.
    pub params: Params,
    /// Runs averaged.
    pub seeds: u64,
    /// Runs that ended jammed: counted, not averaged.
    pub jammed: u64,
    /// Runs that failed.
    pub failed: u64,
    /// Viscosity in full: mean over the runs of their means.
    pub viscosity: Option<Estimate>,
    /// Median over the runs of their medians.
    pub viscosity_median: Option<f64>,
    /// Viscosity from the stresslets alone.
    pub viscosity_stresslet: Option<Estimate>,
    /// First normal stress difference.
    pub normal_stress_difference: Option<Estimate>,
    /// Contacts per sphere over all samples of all runs, as are the fractions.
    pub contacts_per_sphere: Option<f64>,
    /// Activated contacts over contacts.
    pub activated_fraction: Option<f64>,
    /// Rolling contacts over activated ones.
    pub rolling_fraction: Option<f64>,
    /// Smallest gap of any run at any stage, the discarded strain included.
    pub minimum_gap: Option<f64>,
    /// Mean approach velocity of the contacts.
    pub mean_approach_velocity: Option<f64>,
    /// Worst residual of any run.
    pub worst_residual: Option<f64>,
    /// Unconverged right-hand sides over all with contacts.
    pub unconverged_fraction: Option<f64>,
    /// Mean seconds of computing of a run.
    pub wall_time_s: Option<f64>,
}

impl Report {
    /// Of what a store holds now about the points selected.
    ///
    /// # Errors
    /// Trouble with the store; [`Error::Argument`] on a selection that no point meets.
    pub fn of(store: &Store, selection: &Selection) -> Result<Self, Error> {
        let runs = selected_runs(store, selection)?;
        let mut failures = store.failures(u32::MAX)?;
        failures.retain(|failure| selection.has(&failure.params));
        let mut failures = FailureGroup::of(failures);
        failures.truncate(FAILURES_SHOWN);
        let computing = runs.iter().filter_map(|run| run.wall_time_s).sum();
        let mut groups: Vec<Vec<PointRun>> = Vec::new();
        let mut place_of = HashMap::new();
        let mut counts = Counts::default();
        for run in runs {
            *match run.state {
                State::Pending => &mut counts.pending,
                State::Running => &mut counts.running,
                State::Done => &mut counts.done,
                State::Jammed => &mut counts.jammed,
                State::Failed => &mut counts.failed,
            } += 1;
            let place = *place_of.entry(identity(&run.params)).or_insert_with(|| {
                groups.push(Vec::new());
                groups.len() - 1
            });
            groups[place].push(run);
        }
        Ok(Self {
            campaign: store.campaign_name()?,
            selection: selection.clone(),
            counts,
            discard: store.protocol()?.discard,
            points: groups.iter().filter_map(|runs| Point::of(runs)).collect(),
            failures,
            computing,
            provenance: store.provenance()?,
        })
    }
}

/// All runs of the points selected, in the order of the campaign file.
fn selected_runs(store: &Store, selection: &Selection) -> Result<Vec<PointRun>, Error> {
    let mut runs = store.point_runs()?;
    let params: Vec<_> = runs.iter().map(|run| &run.params).collect();
    selection.check(&params)?;
    runs.retain(|run| selection.has(&run.params));
    Ok(runs)
}

impl Point {
    /// Of the runs of one point; `None` of none.
    fn of(runs: &[PointRun]) -> Option<Self> {
        let params = runs.first()?.params.clone();
        let done: Vec<&PointRun> = runs.iter().filter(|r| r.state == State::Done).collect();
        let values = |quantity: fn(&PointRun) -> Option<f64>| -> Vec<f64> {
            done.iter().filter_map(|run| quantity(run)).collect()
        };
        let sum = |quantity: fn(&PointRun) -> u64| -> f64 {
            done.iter().map(|run| quantity(run)).sum::<u64>() as f64
        };
        let (contacts, activated) = (sum(|r| r.contacts), sum(|r| r.activated));
        Some(Self {
            seeds: done.len() as u64,
            jammed: runs.iter().filter(|r| r.state == State::Jammed).count() as u64,
            failed: runs.iter().filter(|r| r.state == State::Failed).count() as u64,
            viscosity: Estimate::of(&values(|r| r.viscosity)),
            viscosity_median: median(values(|r| r.viscosity_median)),
            viscosity_stresslet: Estimate::of(&values(|r| r.viscosity_stresslet)),
            normal_stress_difference: Estimate::of(&values(|r| r.normal_stress_difference)),
            contacts_per_sphere: ratio(contacts, sum(|r| r.samples) * params.spheres as f64),
            activated_fraction: ratio(activated, contacts),
            rolling_fraction: ratio(sum(|r| r.rolling), activated),
            minimum_gap: values(|r| r.minimum_gap).into_iter().reduce(f64::min),
            mean_approach_velocity: ratio(
                done.iter().map(|run| run.approach).sum::<f64>(),
                contacts,
            ),
            worst_residual: values(|r| r.worst_residual).into_iter().reduce(f64::max),
            unconverged_fraction: ratio(sum(|r| r.unconverged_stages), sum(|r| r.stages)),
            wall_time_s: mean(&values(|r| r.wall_time_s)),
            params,
        })
    }
}

/// A number to so many significant digits, with an exponent where that is shorter.
pub fn significant(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return if value.is_nan() {
            "–".into()
        } else {
            format!("{value}")
        };
    }
    if value == 0.0 {
        return "0".into();
    }
    #[expect(clippy::cast_possible_truncation, reason = "a decimal exponent")]
    let exponent = value.abs().log10().floor() as i32;
    if (-3..5).contains(&exponent) {
        let decimals = usize::try_from(digits - 1 - exponent).unwrap_or(0);
        format!("{value:.decimals$}")
    } else {
        let decimals = usize::try_from(digits - 1).unwrap_or(0);
        format!("{value:.decimals$e}")
    }
}

/// A time in words: `12 s`, `3 min 20 s`, `5 h 10 min`, `2 d 4 h`.
pub fn duration(seconds: f64) -> String {
    if !seconds.is_finite() || seconds < 0.0 {
        return "–".into();
    }
    if seconds < 10.0 {
        return format!("{seconds:.1} s");
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "finite and not negative; saturates"
    )]
    let s = seconds.round() as u64;
    match s {
        0..60 => format!("{s} s"),
        60..3600 => format!("{} min {} s", s / 60, s % 60),
        3600..86400 => format!("{} h {} min", s / 3600, s % 3600 / 60),
        _ => format!("{} d {} h", s / 86400, s % 86400 / 3600),
    }
}

/// Bytes in words.
pub fn bytes(number: f64) -> String {
    let mut number = number;
    for unit in ["B", "kB", "MB", "GB"] {
        if number < 1000.0 {
            return format!("{} {unit}", significant(number.round(), 3));
        }
        number /= 1000.0;
    }
    format!("{} TB", significant(number, 3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_significant_digits() {
        assert_eq!(significant(7.1234, 4), "7.123");
        assert_eq!(significant(0.00994, 3), "0.00994");
        assert_eq!(significant(1.0e-10, 2), "1.0e-10");
        assert_eq!(significant(123456.0, 4), "1.235e5");
        assert_eq!(significant(f64::INFINITY, 4), "inf");
        assert_eq!(significant(-48.26, 3), "-48.3");
    }

    #[test]
    fn times_are_in_words() {
        assert_eq!(duration(3.21), "3.2 s");
        assert_eq!(duration(200.0), "3 min 20 s");
        assert_eq!(duration(187_200.0), "2 d 4 h");
        assert_eq!(duration(f64::NAN), "–");
    }
}
