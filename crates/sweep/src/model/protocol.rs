//! How every run of a campaign is made: its length, what is dropped and what is kept.

use serde::{Deserialize, Serialize};

/// The `[protocol]` table, but for the time step, which is a parameter of the run. All values are strains.
///
/// Stores written before have a time step here, which is not read.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Protocol {
    /// Length of a run, a whole number of steps.
    pub strain: f64,
    /// What is left out of the averages at the start of a run.
    pub discard: Discard,
    /// Strain from one checkpoint to the next, at least one step.
    pub checkpoint_every: f64,
    /// Strain from one sample to the next, a whole number of steps.
    pub sample_every: f64,
    /// Whether samples look at the network of contacts: `observe = ["network"]`. What a run computes does not depend on it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub observes_network: bool,
}

/// What is left out at the start of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Discard {
    /// As much as MSER-5 picks at each point: see `mser_5` in `statistics`.
    Auto,
    /// Samples before this strain; in [0, strain).
    #[serde(untagged)]
    Strain(f64),
}

impl Default for Protocol {
    fn default() -> Self {
        Self {
            strain: 5.0,
            discard: Discard::Strain(2.0),
            checkpoint_every: 0.1,
            sample_every: 0.02,
            observes_network: false,
        }
    }
}

impl Protocol {
    /// The protocol in steps of this length.
    pub fn with_time_step(self, time_step: f64) -> Steps {
        Steps {
            protocol: self,
            time_step,
        }
    }
}

/// A protocol in steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steps {
    protocol: Protocol,
    time_step: f64,
}

impl Steps {
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

    /// First step whose sample counts in the averages; `None` where each point has its own.
    pub fn discard_steps(&self) -> Option<u64> {
        match self.protocol.discard {
            Discard::Strain(strain) => Some(count((strain / self.time_step - 1e-6).ceil())),
            Discard::Auto => None,
        }
    }
}

/// The whole number nearest to a number of steps, which the reader bounds.
fn count(steps: f64) -> u64 {
    crate::format::count(steps) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discard_is_a_number_or_a_word_in_stores() {
        for (discard, text) in [(Discard::Strain(2.0), "2.0"), (Discard::Auto, "\"auto\"")] {
            assert_eq!(serde_json::to_string(&discard).unwrap(), text);
            assert_eq!(serde_json::from_str::<Discard>(text).unwrap(), discard);
        }
        assert!(serde_json::from_str::<Discard>("\"all\"").is_err());
    }

    #[test]
    fn default_run_is_a_thousand_steps_and_250_samples() {
        let protocol = Protocol::default().with_time_step(0.005);
        assert_eq!(protocol.steps(), 1000);
        assert_eq!(protocol.sample_stride(), 4);
        assert_eq!(protocol.checkpoint_stride(), 20);
        assert_eq!(protocol.discard_steps(), Some(400));
        assert_eq!(protocol.whole_steps(0.0125), None);
    }
}
