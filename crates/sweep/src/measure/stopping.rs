//! Stopping rule: the number of seeds of a point when a campaign requests a precision.
//!
//! Seeds are computed in batches, and the rule evaluates a point only after a complete batch:
//! ```text
//! n₁ = at_least,   n_{k+1} = n_k + max(2, n_k/5, rounded up),   at most at_most
//! w(n) = t(0.975, n − 1) s/√n / |mean|                of the runs averaged among the first n
//! stop at n_k if w (1 + 2/n) ≤ precision at n_{k−1} and at n_k, or n_k = at_most
//! ```
//! So the seeds that count depend only on their results, not on who computed them or on their
//! order.
//!
//! A sequential rule stops slightly too often when the scatter happens to look small, and intervals
//! then contain the true mean less often than stated. The confirmation by a second batch and the
//! factor 1 + 2/n, of the kind used by Chow and Robbins, limit this effect: see the test
//! `intervals_hold_the_mean_almost_as_often_as_they_say`.
//!
//! Jammed and failed runs use up their seed and are not averaged. A point with fewer than two
//! averaged runs in its first batch gets no more seeds.
//!
//! Source: Y. S. Chow and H. Robbins, Ann. Math. Stat. 36, 457 (1965); A. M. Law and W. D. Kelton,
//! Oper. Res. 30, 641 (1982).

use super::Estimate;
use crate::model::precision::Precision;
use serde::Serialize;

/// A batch has 1 over this times the number of seeds before it.
const SHARE: usize = 5;
/// Minimum number of seeds of a batch after the first.
const LEAST: usize = 2;
/// The factor 1 + GUARD/n guards against a scatter that is small by chance.
const GUARD: f64 = 2.0;

/// Outcome of the run of a seed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// Not ended yet.
    Open,
    /// Ended, with this value.
    Value(f64),
    /// Jammed or failed: not averaged.
    Lost,
}

/// State of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Seeds of the last batch are still to be computed.
    Open,
    /// The precision is reached.
    Reached,
    /// The precision is not reached with the maximum number of seeds.
    AtMost,
    /// Fewer than two runs of the first batch can be averaged.
    TooFewRuns,
}

/// Decision of the rule about a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// Number of first seeds that count.
    pub wanted: usize,
    /// State of the point.
    pub verdict: Verdict,
    /// Half width of the 95 % interval over the mean at the last complete batch.
    pub reached: Option<f64>,
    /// Seeds of the last complete batch and those before it.
    pub complete: usize,
}

impl Precision {
    /// Number of seeds after the batch that follows a number of seeds.
    fn next(&self, seeds: usize) -> usize {
        (seeds + seeds.div_ceil(SHARE).max(LEAST)).min(self.at_most)
    }

    /// Applies the rule to the outcomes of the seeds, in order.
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

    /// Gain of the next batch of an open point: the expected decrease of the interval relative to
    /// the mean, at unchanged scatter and not beyond the precision. Infinite before the first batch
    /// is complete.
    pub fn gain(&self, decision: &Decision) -> f64 {
        let Some(width) = decision.reached else {
            return f64::INFINITY;
        };
        let after = width * (decision.complete as f64 / decision.wanted as f64).sqrt();
        // For a point that only needs confirmation, the gain is the confirmation.
        (width - after.max(self.precision)).max(0.1 * (width - after))
    }

    /// Expected number of seeds at a relative scatter of runs, from at least two measured runs.
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

/// Half width of the 95 % interval of the mean over the mean; `None` for fewer than two values.
pub(crate) fn relative_half_width(values: &[f64]) -> Option<f64> {
    let estimate = Estimate::of(values)?;
    let width = estimate.ci95? / estimate.mean.abs();
    Some(if width.is_nan() { f64::INFINITY } else { width })
}

#[cfg(test)]
mod tests;
