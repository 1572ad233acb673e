//! How many seeds a point gets when a campaign asks for a precision and not for a number.
//!
//! Seeds are computed in batches, and the rule looks at a point only where a batch is complete:
//! ```text
//! n₁ = at_least,   n_{k+1} = n_k + max(2, n_k/5, rounded up),   at most at_most
//! w(n) = t(0.975, n − 1) s/√n / |mean|                of the runs averaged among the first n
//! stop at n_k if w (1 + 2/n) ≤ precision at n_{k−1} and at n_k, or n_k = at_most
//! ```
//! So the seeds that count are a function of their results alone, whoever computed them and in whatever order they finished.
//!
//! A rule that stops on the data stops a little too often where the scatter happens to look small, and intervals then hold the
//! true mean less often than they say. Looking twice and the factor 1 + 2/n, which is that of Chow and Robbins in kind, keep that
//! small: see the test `intervals_hold_the_mean_almost_as_often_as_they_say`.
//!
//! Runs that jammed or failed use up their seed and are not averaged. A point of whose first batch fewer than two runs can be
//! averaged gets no more seeds.
//!
//! Source: Y. S. Chow and H. Robbins, Ann. Math. Stat. 36, 457 (1965); A. M. Law and W. D. Kelton, Oper. Res. 30, 641 (1982).

use super::Estimate;
use serde::{Deserialize, Serialize};

/// Seeds of a batch over those before it, one over this.
const SHARE: usize = 5;
/// Least seeds of a batch after the first.
const LEAST: usize = 2;
/// The guard 1 + GUARD/n against a scatter that looks small by chance.
const GUARD: f64 = 2.0;

/// The quantity whose precision counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Mean viscosity.
    Viscosity,
    /// Median viscosity of a run; over runs the mean is taken.
    ViscosityMedian,
    /// Viscosity from the stresslets alone.
    ViscosityStresslet,
    /// First normal stress difference.
    NormalStressDifference,
}

impl Measure {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::Viscosity,
        Self::ViscosityMedian,
        Self::ViscosityStresslet,
        Self::NormalStressDifference,
    ];

    /// Its name: that of the column in results of the store and in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Viscosity => "viscosity",
            Self::ViscosityMedian => "viscosity_median",
            Self::ViscosityStresslet => "viscosity_stresslet",
            Self::NormalStressDifference => "normal_stress_difference",
        }
    }

    /// The quantity of this name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|measure| measure.name() == name)
    }
}

/// What a campaign asks for at a point: seeds until the precision is reached.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[expect(clippy::struct_field_names, reason = "the words of the campaign file")]
pub struct Precision {
    /// Half width of the 95 % interval over the mean; in (0, 1].
    pub precision: f64,
    /// Of what.
    pub quantity: Measure,
    /// Seeds of the first batch, at least 2.
    pub at_least: usize,
    /// Most seeds.
    pub at_most: usize,
}

/// What became of the run of a seed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// Not ended yet.
    Open,
    /// Ended, with this value.
    Value(f64),
    /// Jammed or failed: not averaged.
    Lost,
}

/// How a point stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Seeds of the last batch are still to be computed.
    Open,
    /// The precision is reached.
    Reached,
    /// It is not, with as many seeds as there may be.
    AtMost,
    /// Fewer than two runs of the first batch can be averaged.
    TooFewRuns,
}

/// What the rule says about a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// So many seeds count, the first ones.
    pub wanted: usize,
    /// How the point stands.
    pub verdict: Verdict,
    /// Half width of the 95 % interval over the mean at the last complete batch.
    pub reached: Option<f64>,
    /// Seeds of the last complete batch and those before it.
    pub complete: usize,
}

impl Precision {
    /// Seeds at the end of the batch that follows so many seeds.
    fn next(&self, seeds: usize) -> usize {
        (seeds + seeds.div_ceil(SHARE).max(LEAST)).min(self.at_most)
    }

    /// What the rule says, given what became of the seeds in their order.
    pub fn decide(&self, runs: &[Outcome]) -> Decision {
        let mut decision = Decision {
            wanted: self.at_least.min(self.at_most),
            verdict: Verdict::Open,
            reached: None,
            complete: 0,
        };
        let mut narrow_before = false;
        loop {
            let seeds = decision.wanted;
            let Some(values) = values(runs, seeds) else {
                return decision;
            };
            decision.complete = seeds;
            decision.reached = relative_half_width(&values);
            let runs = values.len() as f64;
            let narrow = decision
                .reached
                .is_some_and(|width| width * (1.0 + GUARD / runs) <= self.precision);
            decision.verdict = if values.len() < 2 {
                Verdict::TooFewRuns
            } else if narrow && narrow_before {
                Verdict::Reached
            } else if seeds < self.at_most {
                decision.wanted = self.next(seeds);
                Verdict::Open
            } else if decision.reached.is_some_and(|w| w <= self.precision) {
                Verdict::Reached
            } else {
                Verdict::AtMost
            };
            if decision.verdict != Verdict::Open {
                return decision;
            }
            narrow_before = narrow;
        }
    }

    /// What the next batch of an open point is worth: by how much it will narrow the interval, relative to the mean, if the
    /// scatter stays as it is. Nothing beyond the precision counts. Infinite before the first batch is complete.
    pub fn gain(&self, decision: &Decision) -> f64 {
        let Some(width) = decision.reached else {
            return f64::INFINITY;
        };
        let after = width * (decision.complete as f64 / decision.wanted as f64).sqrt();
        // A point that only has to be confirmed gains its confirmation.
        (width - after.max(self.precision)).max(0.1 * (width - after))
    }

    /// Seeds the precision will take if runs scatter by so much relative to their mean, at least two of them measured.
    pub fn foreseen(&self, scatter: f64) -> usize {
        let mut seeds = self.at_least.min(self.at_most);
        let mut narrow_before = false;
        while seeds < self.at_most {
            let n = seeds as f64;
            let width = super::student_95(n - 1.0).unwrap_or(f64::INFINITY) * scatter / n.sqrt();
            let narrow = width * (1.0 + GUARD / n) <= self.precision;
            if narrow && narrow_before {
                break;
            }
            narrow_before = narrow;
            seeds = self.next(seeds);
        }
        seeds
    }
}

/// Values of the first seeds; `None` while some are open.
fn values(runs: &[Outcome], seeds: usize) -> Option<Vec<f64>> {
    let mut values = Vec::with_capacity(seeds);
    for run in runs.get(..seeds)? {
        match run {
            Outcome::Open => return None,
            Outcome::Value(value) => values.push(*value),
            Outcome::Lost => {}
        }
    }
    Some(values)
}

/// Half width of the 95 % interval of the mean over the mean; `None` of fewer than two values.
pub(crate) fn relative_half_width(values: &[f64]) -> Option<f64> {
    let estimate = Estimate::of(values)?;
    let width = estimate.ci95? / estimate.mean.abs();
    Some(if width.is_nan() { f64::INFINITY } else { width })
}

#[cfg(test)]
mod tests;
