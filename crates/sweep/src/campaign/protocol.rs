//! How every run of a campaign is made: step, length, what is dropped and what is kept.

use super::error::Problem;
use super::reader::{Located, Table, number};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use toml::de::DeTable;

/// Time steps there are, in words.
pub(super) const STEP_RANGE: &str = "above 0 and at most 0.1 (a strain)";

/// Whether a number can be a time step.
pub(super) fn is_step(value: f64) -> bool {
    (1e-7..=0.1).contains(&value)
}

/// Longest run, in steps.
const STEP_LIMIT: f64 = 1e8;
/// Most samples of one run.
const SAMPLE_LIMIT: u64 = 1_000_000;

/// The `[protocol]` table. All values are strains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Protocol {
    /// Step, in (0, 0.1].
    pub time_step: f64,
    /// Length of a run, a whole number of steps.
    pub strain: f64,
    /// Samples before this strain are left out of the averages; in [0, strain).
    pub discard: f64,
    /// Strain from one checkpoint to the next, at least one step.
    pub checkpoint_every: f64,
    /// Strain from one sample to the next, a whole number of steps.
    pub sample_every: f64,
}

impl Default for Protocol {
    fn default() -> Self {
        Self {
            time_step: 0.005,
            strain: 5.0,
            discard: 2.0,
            checkpoint_every: 0.1,
            sample_every: 0.02,
        }
    }
}

impl Protocol {
    /// The same with another time step.
    #[must_use]
    pub fn with_time_step(self, time_step: f64) -> Self {
        Self { time_step, ..self }
    }

    /// Whole steps in a strain; `None` if it is not a whole number of them.
    pub fn whole_steps(&self, strain: f64) -> Option<u64> {
        let steps = strain / self.time_step;
        ((steps - steps.round()).abs() <= 1e-6).then(|| count(steps))
    }

    /// Steps of a run.
    pub fn steps(&self) -> u64 {
        count(self.strain / self.time_step)
    }

    /// Steps from one sample to the next.
    pub fn sample_stride(&self) -> u64 {
        count(self.sample_every / self.time_step).max(1)
    }

    /// Steps from one checkpoint to the next.
    pub fn checkpoint_stride(&self) -> u64 {
        count(self.checkpoint_every / self.time_step).max(1)
    }

    /// First step whose sample counts in the averages.
    pub fn discard_steps(&self) -> u64 {
        count((self.discard / self.time_step - 1e-6).ceil())
    }
}

/// The whole number nearest to a value that is checked to be small and not negative.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates, and the reader bounds all strains"
)]
fn count(value: f64) -> u64 {
    value.round() as u64
}

/// Reads and checks the protocol.
pub(super) fn read(entries: &DeTable<'_>, span: Range<usize>) -> Result<Protocol, Problem> {
    let known = [
        "time_step",
        "strain",
        "discard",
        "checkpoint_every",
        "sample_every",
    ];
    let table = Table::new(entries, span.clone(), "[protocol]", &known)?;
    let preset = Protocol::default();
    let read = |key: &str, default: f64, range: &str, inside: fn(f64) -> bool| {
        table.get(key).map_or(
            Ok(Located {
                value: default,
                span: span.clone(),
            }),
            |written| number(written, key, range, inside),
        )
    };
    let positive = "above 0 and finite (a strain)";
    let time_step = read("time_step", preset.time_step, STEP_RANGE, is_step)?;
    let above_zero: fn(f64) -> bool = |v| v > 0.0 && v.is_finite();
    let strain = read("strain", preset.strain, positive, above_zero)?;
    let discard = read("discard", preset.discard, "from 0 to below `strain`", |v| {
        v >= 0.0 && v.is_finite()
    })?;
    let checkpoint = read(
        "checkpoint_every",
        preset.checkpoint_every,
        positive,
        above_zero,
    )?;
    let sample = read("sample_every", preset.sample_every, positive, above_zero)?;
    let written = Written {
        protocol: Protocol {
            time_step: time_step.value,
            strain: strain.value,
            discard: discard.value,
            checkpoint_every: checkpoint.value,
            sample_every: sample.value,
        },
        time_step: time_step.span,
        strain: strain.span,
        discard: discard.span,
        checkpoint_every: checkpoint.span,
        sample_every: sample.span,
    };
    written.check_lengths()?;
    written.check_averages()?;
    Ok(written.protocol)
}

/// Refuses a time step of a grid of which the protocol's lengths are no whole numbers. Errors point at the step.
pub(super) fn check_step(protocol: &Protocol, step: &Located<f64>) -> Result<(), Problem> {
    let place = || step.span.clone();
    let written = Written {
        protocol: protocol.with_time_step(step.value),
        time_step: place(),
        strain: place(),
        discard: place(),
        checkpoint_every: place(),
        sample_every: place(),
    };
    written.check_lengths()
}

/// A protocol and the places its values were written at.
struct Written {
    /// The values.
    protocol: Protocol,
    /// Place of the time step; that of the table for values not written, as with the others.
    time_step: Range<usize>,
    /// Place of the strain.
    strain: Range<usize>,
    /// Place of the strain discarded.
    discard: Range<usize>,
    /// Place of the checkpoint interval.
    checkpoint_every: Range<usize>,
    /// Place of the sample interval.
    sample_every: Range<usize>,
}

impl Written {
    /// Refuses runs too long, and lengths that are not whole numbers of steps.
    fn check_lengths(&self) -> Result<(), Problem> {
        let p = &self.protocol;
        let steps = p.strain / p.time_step;
        if steps > STEP_LIMIT {
            return Err(Problem::at(
                &self.strain,
                format!("a run of {steps:.3e} steps"),
                format!("at most {STEP_LIMIT:e} steps: a shorter strain or a longer step"),
            ));
        }
        let whole = format!("a whole number of time steps, {} each", p.time_step);
        for (key, value, span) in [
            ("strain", p.strain, &self.strain),
            ("sample_every", p.sample_every, &self.sample_every),
        ] {
            if p.whole_steps(value).is_none_or(|n| n == 0) {
                return Err(Problem::at(
                    span,
                    format!("`{key}` = {value} is not {whole}"),
                    format!("`{key}` is {whole}"),
                )
                .also(&self.time_step, "the time step"));
            }
        }
        if p.checkpoint_every < p.time_step {
            return Err(Problem::at(
                &self.checkpoint_every,
                format!(
                    "`checkpoint_every` = {} is less than a step",
                    p.checkpoint_every
                ),
                format!("at least the time step, {}", p.time_step),
            ));
        }
        Ok(())
    }

    /// Refuses runs of which nothing, or too much, is left to average.
    fn check_averages(&self) -> Result<(), Problem> {
        let p = &self.protocol;
        if p.discard >= p.strain {
            return Err(Problem::at(
                &self.discard,
                format!(
                    "`discard` = {} leaves nothing of a run of strain {}",
                    p.discard, p.strain
                ),
                format!("`discard` is from 0 to below {}", p.strain),
            )
            .also(&self.strain, "the length of a run"));
        }
        if p.sample_every > p.strain - p.discard {
            return Err(Problem::at(
                &self.sample_every,
                format!(
                    "`sample_every` = {} may leave no sample after the strain discarded",
                    p.sample_every
                ),
                format!("at most {}", p.strain - p.discard),
            ));
        }
        if p.steps() / p.sample_stride() > SAMPLE_LIMIT {
            return Err(Problem::at(
                &self.sample_every,
                "too many samples in a run",
                format!("at most {SAMPLE_LIMIT}: sample less often"),
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_run_is_a_thousand_steps_and_250_samples() {
        let protocol = Protocol::default();
        assert_eq!(protocol.steps(), 1000);
        assert_eq!(protocol.sample_stride(), 4);
        assert_eq!(protocol.checkpoint_stride(), 20);
        assert_eq!(protocol.discard_steps(), 400);
        assert_eq!(protocol.whole_steps(0.0125), None);
    }
}
