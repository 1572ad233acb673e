//! Groups of similar failures.

use crate::model::case::without_shear;
use crate::store::FailureLine;

/// Runs that failed in the same way: with the same message and the same parameters but for the
/// shear rate and the seed.
#[derive(Debug, Clone, PartialEq)]
pub struct FailureGroup {
    /// The first of them.
    pub first: FailureLine,
    /// How many there are.
    pub runs: usize,
    /// Their shear rates, or stresses where these are imposed, in the order of the campaign file.
    pub shear_rates: Vec<f64>,
}

impl FailureGroup {
    /// Groups of some failures, in the order of the first of each.
    pub fn of(failures: Vec<FailureLine>) -> Vec<Self> {
        let mut groups: Vec<Self> = Vec::new();
        for failure in failures {
            let alike = |group: &&mut Self| {
                group.first.failed.error == failure.failed.error
                    && without_shear(&group.first.params) == without_shear(&failure.params)
            };
            let params = &failure.params;
            let shear_rate = params.shear_stress.unwrap_or(params.shear_rate);
            if let Some(group) = groups.iter_mut().find(alike) {
                group.runs += 1;
                if !group.shear_rates.contains(&shear_rate) {
                    group.shear_rates.push(shear_rate);
                }
            } else {
                groups.push(Self {
                    first: failure,
                    runs: 1,
                    shear_rates: vec![shear_rate],
                });
            }
        }
        groups
    }

    /// Description: runs, place and reason.
    pub fn text(&self) -> String {
        let FailureLine {
            key, seed, failed, ..
        } = &self.first;
        let what = format!(
            "{key} seed {seed} at strain {:.3}, attempt {}: {}",
            failed.strain, failed.attempt, failed.error
        );
        if self.runs == 1 {
            return format!("failed: {what}");
        }
        let shear_rates: Vec<String> = self.shear_rates.iter().map(f64::to_string).collect();
        let stress = self.first.params.shear_stress;
        format!(
            "failed: {} runs at {} = {}, the first {what}",
            self.runs,
            if stress.is_some() { "σ*" } else { "Γ" },
            shear_rates.join(", ")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::Attempt;
    use crate::test_support::params;
    use sd_core::Params;

    #[test]
    fn failures_that_are_the_same_for_every_shear_rate_are_one() {
        let failure = |shear_rate, friction, error: &str| FailureLine {
            key: format!("{shear_rate}-{friction}"),
            seed: 1,
            params: Params {
                shear_rate,
                friction,
                ..params()
            },
            failed: Attempt {
                error: error.into(),
                ..Attempt::default()
            },
        };
        let groups = FailureGroup::of(vec![
            failure(0.1, 0.3, "no start layer"),
            failure(1.0, 0.3, "no start layer"),
            failure(1.0, 0.5, "no start layer"),
            failure(f64::INFINITY, 0.3, "no start layer"),
            failure(0.1, 0.3, "overlap"),
        ]);
        let runs: Vec<usize> = groups.iter().map(|group| group.runs).collect();
        assert_eq!(runs, [3, 1, 1]);
        let text = groups[0].text();
        assert!(
            text.contains("3 runs at Γ = 0.1, 1, inf, the first 0.1-0.3"),
            "{text}"
        );
    }
}
