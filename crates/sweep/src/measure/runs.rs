//! The runs of a point, from which its numbers are made.

use super::point_run::PointRun;
use super::steady::{MIN_RUNS, significant_mean};
use super::{Decision, Distribution, Drift, Estimate, Trend, ratio, relative_half_width};
use crate::model::precision::{Precision, Quantity};

/// Changes of order over the kept strain, by name, with the word for what changes.
const ORDER: [(&str, &str); 2] = [
    ("layering_drift", "layering"),
    ("bond_order_drift", "bond orientation"),
];

/// The runs of a point.
#[derive(Debug)]
pub(crate) struct Runs<'r> {
    pub(crate) all: Vec<&'r PointRun>,
    pub(crate) averaged: Vec<&'r PointRun>,
    /// The requested precision and the state of its rule.
    pub(crate) rule: Option<(Precision, Decision)>,
}

impl Runs<'_> {
    /// Number of runs that meet a condition.
    pub(crate) fn number_of(&self, is_so: fn(&PointRun) -> bool) -> u64 {
        self.all.iter().filter(|run| is_so(run)).count() as u64
    }

    /// A value of each averaged run that has one.
    pub(super) fn of_each(&self, number: impl Fn(&PointRun) -> Option<f64>) -> Vec<f64> {
        self.averaged.iter().filter_map(|run| number(run)).collect()
    }

    /// The sum of such values.
    pub(super) fn total(&self, number: impl Fn(&PointRun) -> Option<f64>) -> f64 {
        // An empty sum would be -0.
        self.of_each(number).into_iter().fold(0.0, |a, b| a + b)
    }

    /// A number of the results of the averaged runs that have it.
    pub(crate) fn values(&self, name: &str) -> Vec<f64> {
        self.of_each(|run| run.number(name))
    }

    /// The sum of these numbers.
    pub(super) fn sum(&self, name: &str) -> f64 {
        self.values(name).into_iter().fold(0.0, |a, b| a + b)
    }

    /// The mean over runs of a number of their results.
    pub(crate) fn estimate(&self, name: &str) -> Option<Estimate> {
        Estimate::of(&self.values(name))
    }

    /// The mean fraction at which runs came to rest under an imposed ratio of stress and pressure.
    pub(super) fn arrested_fraction(&self) -> Option<f64> {
        let arrested = self.all.iter().filter(|run| run.is_arrested());
        let fractions: Vec<f64> = arrested
            .filter_map(|run| run.number("final_fraction"))
            .collect();
        ratio(fractions.iter().sum(), fractions.len() as f64)
    }

    /// Smallest gap of any run, in a.
    pub(super) fn gap(&self) -> Option<f64> {
        self.values("minimum_gap").into_iter().reduce(f64::min)
    }

    /// Median and quartiles over runs of their medians.
    pub(super) fn medians(&self) -> Option<Distribution> {
        Distribution::of(self.values("viscosity_median"))
    }

    /// Median and quartiles of several runs.
    pub(super) fn quartiles(&self) -> Option<Distribution> {
        self.medians().filter(|_| self.averaged.len() > 1)
    }

    /// Seeds that count.
    pub(crate) fn wanted(&self) -> u64 {
        let wanted = self.rule.map(|(_, decision)| decision.wanted);
        wanted.unwrap_or(self.all.len()) as u64
    }

    /// Half width of an interval over the mean, of the quantity with a requested precision, else of
    /// the viscosity.
    pub(crate) fn precision(&self) -> Option<f64> {
        let quantity = self
            .rule
            .map_or(Quantity::Viscosity, |(rule, _)| rule.quantity);
        relative_half_width(&self.values(quantity.name())).filter(|width| width.is_finite())
    }

    /// Whether they drift.
    pub(crate) fn drift(&self) -> Option<Drift> {
        let steady = self.averaged.iter().filter_map(|run| run.steadiness());
        Drift::of(&steady.map(|steady| steady.parts).collect::<Vec<_>>())
    }

    /// The measures of order that change significantly from the first half of the kept strain to
    /// the second, with the change.
    pub(crate) fn changes_of_order(&self) -> Vec<(&'static str, f64)> {
        let changes = ORDER
            .into_iter()
            .filter_map(|(name, word)| Some((word, significant_mean(&self.values(name))?)));
        changes.collect()
    }

    /// The change of the fraction under an imposed pressure from the first half of the kept strain
    /// to the second, if it is significant.
    pub(crate) fn change_of_fraction(&self) -> Option<f64> {
        significant_mean(&self.values("fraction_drift"))
    }

    /// How they change over the kept strain, if they are known not to be in steady state.
    pub(crate) fn trend(&self) -> Option<Trend> {
        let changes = self.changes_of_order().into_iter();
        let changes: Vec<f64> = changes.map(|(_, change)| change).collect();
        let drifts = |drift: Drift| drift.drifts() || drift.remembers_start();
        let is_drifting = self.drift().is_some_and(drifts) || self.change_of_fraction().is_some();
        Trend::of(&changes, is_drifting)
    }

    /// 1 if they have this trend and 0 if not; `None` with too few runs to know.
    pub(super) fn has_trend(&self, trend: Trend) -> Option<f64> {
        let is_known = self.values("viscosity_variance").len() >= MIN_RUNS;
        is_known.then(|| f64::from(u8::from(self.trend() == Some(trend))))
    }
}
