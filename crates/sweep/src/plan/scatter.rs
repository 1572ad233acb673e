//! The uncertainty of estimated costs, from the scatter of similar measured runs.

use crate::measure::student_95;
use crate::plan::costs::StepCost;

/// The runs of one kind, added point by point. With n runs of a point to come that take T in all,
/// and m measured near with the relative scatter s, the half width of the 95 % interval is
/// ```text
/// t (√Σ (s T)²/n + Σ s T/√m)
/// ```
/// Future runs scatter independently at every point; the error of the measured mean is common to
/// all of them.
#[derive(Debug, Default)]
pub(super) struct Sum {
    /// Steps of all.
    pub(super) steps: f64,
    squares: f64,
    common: f64,
    /// Fewest degrees of freedom; `None` of no point.
    freedom: Option<f64>,
    /// Whether the scatter of some point is unknown.
    is_unknown: bool,
}

impl Sum {
    /// Adds the runs of a point.
    pub(super) fn add(&mut self, cost: StepCost, steps: f64, runs: f64) {
        if runs <= 0.0 {
            return;
        }
        self.steps += steps * runs;
        let Some(scatter) = cost.scatter else {
            self.is_unknown = true;
            return;
        };
        let off = scatter.relative * cost.seconds * steps * runs;
        self.squares += off * off / runs;
        self.common += off / scatter.runs.sqrt();
        let freedom = self.freedom.unwrap_or(f64::INFINITY);
        self.freedom = Some(freedom.min(scatter.freedom));
    }

    /// Half width of the 95 % interval of the total seconds; `None` where it is unknown.
    pub(super) fn half(&self) -> Option<f64> {
        let student = student_95(self.freedom.filter(|_| !self.is_unknown)?)?;
        Some(student * (self.squares.sqrt() + self.common))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::costs::Scatter;

    #[test]
    fn interval_is_that_of_the_runs_to_come_and_of_those_measured() {
        let cost = StepCost {
            seconds: 0.01,
            distance: 0.0,
            scatter: Some(Scatter {
                relative: 0.1,
                runs: 9.0,
                freedom: 8.0,
            }),
        };
        let mut sum = Sum::default();
        assert_eq!(sum.half(), None);
        sum.add(cost, 100.0, 4.0);
        // 4 s in all, 10 %: 0.4 s over √4 for the runs to come and over √9 for those measured.
        let by_hand = 2.306 * (0.2 + 0.4 / 3.0);
        assert!((sum.half().unwrap() / by_hand - 1.0).abs() < 1e-3);
        sum.add(
            StepCost {
                scatter: None,
                ..cost
            },
            100.0,
            1.0,
        );
        assert_eq!(sum.half(), None);
    }
}
