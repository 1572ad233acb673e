//! The protocol of the runs of a campaign: length, discarded strain, sampling, checkpoints.

use crate::text::format::short;
use sd_core::model::Segment;
use serde::{Deserialize, Serialize};

/// The `[protocol]` table without the time step, which is a parameter of the run. All values are
/// strains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Protocol {
    /// Length of a run, a whole number of steps; that of its segments together.
    pub strain: f64,
    /// The start of a run that averages leave out, from 0 to below `strain`; with segments, all
    /// before the last one and its discarded strain.
    pub discard: f64,
    /// Strain from one checkpoint to the next, at least one step.
    pub checkpoint_every: f64,
    /// Strain from one sample to the next, a whole number of steps.
    pub sample_every: f64,
    /// Whether samples record the contact network: `observe = ["network"]`. This does not change
    /// the run.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub observes_network: bool,
    /// Segments of a run, in order; empty for steady shear at the rate or stress of the grid.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub segments: Vec<PlannedSegment>,
}

/// A segment of every run of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PlannedSegment {
    /// The imposed shear, and the strain of the run at which it starts.
    pub imposed: Segment,
    /// Its length; strain in the reverse direction counts as positive.
    pub strain: f64,
    /// Strain after its start that its averages leave out.
    pub discard: f64,
}

impl PlannedSegment {
    /// Description of the imposed shear and its length.
    pub fn words(&self) -> String {
        format!(
            "{} for a strain of {}",
            self.imposed_words(),
            short(self.strain, 6)
        )
    }

    /// Description of the imposed shear.
    pub(crate) fn imposed_words(&self) -> String {
        let flow = self.imposed.flow.map(|flow| flow.to_string());
        let mut words = vec![match self.imposed.amplitude {
            Some(amplitude) => {
                let flow = flow.map_or_else(String::new, |flow| flow + " ");
                format!("{flow}oscillation γ0 {}", short(amplitude, 6))
            }
            None => flow.unwrap_or_else(|| "shear".to_owned()),
        }];
        let back = self.imposed.direction.filter(|direction| *direction < 0.0);
        words.extend(back.map(|_| "backwards".to_owned()));
        let rate = self.imposed.shear_rate;
        words.extend(rate.map(|rate| format!("Γ {}", short(rate, 6))));
        let stress = self.imposed.shear_stress;
        words.extend(stress.map(|stress| format!("σ* {}", short(stress, 6))));
        let cross = self.imposed.cross_shear;
        words.extend(cross.map(|cross| {
            let [amplitude, ratio] = [cross.amplitude, cross.ratio].map(|value| short(value, 6));
            format!("cross shear {amplitude} at {ratio} times the rate")
        }));
        words.join(", ")
    }

    /// Strain of the run at its end.
    pub fn end(&self) -> f64 {
        sum(self.imposed.start, self.strain)
    }

    /// Strain of the run from which on its samples are averaged.
    pub fn kept_from(&self) -> f64 {
        sum(self.imposed.start, self.discard)
    }
}

/// The sum of two strains, rounded to a decimal such as 2.4 for 1.6 + 0.8.
fn sum(a: f64, b: f64) -> f64 {
    ((a + b) * 1e9).round() / 1e9
}

impl Default for Protocol {
    fn default() -> Self {
        Self {
            strain: 5.0,
            discard: 2.0,
            checkpoint_every: 0.1,
            sample_every: 0.02,
            observes_network: false,
            segments: Vec::new(),
        }
    }
}

impl Protocol {
    /// The protocol in steps of this length.
    pub fn with_time_step(&self, time_step: f64) -> Steps<'_> {
        Steps {
            protocol: self,
            time_step,
        }
    }

    /// The protocol as far as one of its segments, by its number from 1, whose kept strain is
    /// averaged.
    ///
    /// # Errors
    /// A message, where there is no such segment.
    pub fn of_segment(mut self, number: usize) -> Result<Self, String> {
        let count = self.segments.len();
        self.segments.truncate(number);
        match self.segments.last() {
            Some(segment) if (1..=count).contains(&number) => {
                self.strain = segment.end();
                self.discard = segment.kept_from();
                Ok(self)
            }
            _ if count == 0 => Err(
                "the campaign has no segments: [[protocol.segment]] in its file defines them"
                    .into(),
            ),
            _ => Err(format!(
                "the campaign has segments 1 to {count}, and no segment {number}"
            )),
        }
    }

    /// The imposed shear in the segments of a run; empty without segments.
    pub fn imposed(&self) -> Vec<Segment> {
        self.segments
            .iter()
            .map(|segment| segment.imposed)
            .collect()
    }
}

/// A protocol in steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steps<'p> {
    protocol: &'p Protocol,
    time_step: f64,
}

impl Steps<'_> {
    /// Whole steps in a strain; `None` if it is not a whole number of them.
    pub fn whole_steps(&self, strain: f64) -> Option<u64> {
        let steps = strain / self.time_step;
        ((steps - steps.round()).abs() <= 1e-6).then(|| count(steps))
    }

    /// Steps of a run.
    pub fn steps(&self) -> u64 {
        count(self.protocol.strain / self.time_step)
    }

    /// Steps from one sample to the next.
    pub fn sample_stride(&self) -> u64 {
        count(self.protocol.sample_every / self.time_step).max(1)
    }

    /// Steps from one checkpoint to the next.
    pub fn checkpoint_stride(&self) -> u64 {
        count(self.protocol.checkpoint_every / self.time_step).max(1)
    }

    /// First step whose sample is averaged.
    pub fn discard_steps(&self) -> u64 {
        self.first_step_from(self.protocol.discard)
    }

    /// First step that begins at a strain or after it.
    pub fn first_step_from(&self, strain: f64) -> u64 {
        count((strain / self.time_step - 1e-6).ceil())
    }
}

/// The whole number nearest to a number of steps, which the reader bounds.
fn count(steps: f64) -> u64 {
    crate::text::format::count(steps) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_run_is_a_thousand_steps_and_250_samples() {
        let protocol = Protocol::default();
        let protocol = protocol.with_time_step(0.005);
        assert_eq!(protocol.steps(), 1000);
        assert_eq!(protocol.sample_stride(), 4);
        assert_eq!(protocol.checkpoint_stride(), 20);
        assert_eq!(protocol.discard_steps(), 400);
        assert_eq!(protocol.whole_steps(0.0125), None);
    }
}
