//! Protocols in time: what is imposed in each segment of a run, and when it changes.

use super::{Params, StiffnessUnit};
use crate::error::Refusal;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A part of a run in which the same flow is imposed: a steady shear, or an oscillation.
///
/// What it does not name is as in the [`Params`] that it belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    /// Strain since the start of the run at which it begins, a whole number of time steps; what is sheared back counts as well.
    pub start: f64,
    /// Sense of the shear, 1 or −1; of an oscillation that of its first quarter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<f64>,
    /// Imposed shear rate Γ; of an oscillation the largest of a cycle.
    #[serde(
        default,
        with = "super::infinite::optional",
        skip_serializing_if = "Option::is_none"
    )]
    pub shear_rate: Option<f64>,
    /// Imposed shear stress σ*, which no oscillation has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shear_stress: Option<f64>,
    /// Amplitude γ0 of an oscillation γ0 sin ωt about the strain at which the segment begins, a whole number of time steps; `None`
    /// for a steady shear.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<f64>,
}

/// What is imposed in one step of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Imposed {
    /// Number of the segment, from 0.
    pub segment: usize,
    /// Sense of the shear, 1 or −1.
    pub direction: f64,
    /// Step of the run from which on it has been sheared in this sense, in this segment.
    pub since: u64,
    /// Steps that the cell was sheared forwards up to then, less those backwards.
    pub net_steps: i64,
    /// Mean shear rate over the step, over the largest of the segment: 1 but in an oscillation.
    pub rate_share: f64,
}

/// Time steps in a strain that is a whole number of them.
fn steps_in(strain: f64, time_step: f64) -> u64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a strain is 0 or more"
    )]
    let steps = (strain / time_step).round() as u64;
    steps
}

impl Segment {
    /// Its first step.
    fn first_step(&self, time_step: f64) -> u64 {
        steps_in(self.start, time_step)
    }

    /// Γ and σ* that are imposed in it; σ* is `None` where the rate is imposed.
    fn shear(&self, run: &Params) -> (f64, Option<f64>) {
        match (self.shear_rate, self.shear_stress) {
            (None, None) => (run.shear_rate, run.shear_stress),
            (_, Some(stress)) => (0.0, Some(stress)),
            (Some(rate), None) => (rate, None),
        }
    }

    /// Steps in a quarter of a cycle, where it oscillates.
    fn quarter(&self, time_step: f64) -> Option<u64> {
        let amplitude = self.amplitude?;
        Some(steps_in(amplitude, time_step).max(1))
    }

    /// Steps from where it began to where it is after so many of its steps, in its direction.
    fn displacement(&self, steps: u64, time_step: f64) -> i64 {
        self.quarter(time_step).map_or_else(
            || steps.cast_signed(),
            |quarter| displacement(steps, quarter),
        )
    }
}

/// Phase ωt of an oscillation γ0 sin ωt that has sheared forwards and backwards by so many times its amplitude in all.
///
/// ```
/// use sd_core::model::phase;
/// use std::f64::consts::PI;
///
/// assert_eq!([0.0, 1.0, 2.0].map(phase), [0.0, 0.5 * PI, PI]);
/// ```
pub fn phase(sheared: f64) -> f64 {
    let cycles = (sheared / 4.0).floor();
    let place = sheared - 4.0 * cycles;
    let within = if place < 1.0 {
        place.asin()
    } else if place < 3.0 {
        PI - (2.0 - place).asin()
    } else {
        2.0 * PI + (place - 4.0).asin()
    };
    2.0 * PI * cycles + within
}

/// Net steps of an oscillation with so many steps in a quarter of a cycle, after `steps` of them.
fn displacement(steps: u64, quarter: u64) -> i64 {
    let place = (steps % (4 * quarter)).cast_signed();
    let quarter = quarter.cast_signed();
    if place < quarter {
        place
    } else if place < 3 * quarter {
        2 * quarter - place
    } else {
        place - 4 * quarter
    }
}

impl Params {
    /// What is imposed in a step of the run, counted from 0.
    pub fn imposed(&self, step: u64) -> Imposed {
        let steady = Imposed {
            segment: 0,
            direction: self.direction,
            since: 0,
            net_steps: 0,
            rate_share: 1.0,
        };
        let first = |segment: &Segment| segment.first_step(self.time_step);
        let direction = |segment: &Segment| segment.direction.unwrap_or(self.direction);
        let sign = |segment: &Segment| if direction(segment) < 0.0 { -1 } else { 1 };
        let begun = self
            .segments
            .iter()
            .filter(|one| first(one) <= step)
            .count();
        let Some((current, before)) = self.segments[..begun].split_last() else {
            return steady;
        };
        let following = self.segments[..begun].iter().skip(1);
        let net_steps: i64 = before
            .iter()
            .zip(following)
            .map(|(one, next)| {
                sign(one) * one.displacement(first(next) - first(one), self.time_step)
            })
            .sum();
        let imposed = Imposed {
            segment: before.len(),
            direction: direction(current),
            since: first(current),
            net_steps,
            ..steady
        };
        let Some(quarter) = current.quarter(self.time_step) else {
            return imposed;
        };
        let gone = step - first(current);
        let cycle = gone - gone % (4 * quarter);
        // A quarter forwards, two backwards, one forwards.
        let (turned_at, turned) = match (gone - cycle) / quarter {
            0 => (cycle, 1.0),
            1 | 2 => (cycle + quarter, -1.0),
            _ => (cycle + 3 * quarter, 1.0),
        };
        let quarter = quarter as f64;
        let passed = phase((gone + 1) as f64 / quarter) - phase(gone as f64 / quarter);
        Imposed {
            direction: turned * imposed.direction,
            since: imposed.since + turned_at,
            net_steps: net_steps + sign(current) * current.displacement(turned_at, self.time_step),
            rate_share: 1.0 / (quarter * passed),
            ..imposed
        }
    }

    /// The run without its last segment, and the step at which that begins; `None` where it has one segment.
    pub fn before_last_segment(&self) -> Option<(Self, u64)> {
        let (last, before) = self.segments.split_last()?;
        if before.is_empty() {
            return None;
        }
        let mut shorter = self.clone();
        shorter.impose(before);
        shorter.settle();
        Some((shorter, last.first_step(self.time_step)))
    }

    /// Γ and σ* that are imposed in the last segment, the rate being the largest of an oscillation; σ* is `None` where the rate is imposed.
    pub fn last_shear(&self) -> (f64, Option<f64>) {
        match self.segments.last() {
            None => (self.shear_rate, self.shear_stress),
            Some(segment) => segment.shear(self),
        }
    }

    /// The parameters of steady shear in each segment; of itself where it has none.
    pub fn flows(&self) -> Vec<Self> {
        if self.segments.is_empty() {
            return vec![self.clone()];
        }
        let steps = self
            .segments
            .iter()
            .map(|one| one.first_step(self.time_step));
        steps
            .map(|step| {
                let imposed = Imposed {
                    rate_share: 1.0,
                    ..self.imposed(step)
                };
                self.in_step(&imposed)
            })
            .collect()
    }

    /// Strain of the cell once `steps` of the run are done, backwards counted as negative.
    pub fn net_strain(&self, steps: u64) -> f64 {
        let imposed = self.imposed(steps);
        imposed.net_strain(steps as f64 * self.time_step, self.time_step)
    }

    /// Imposes segments in place of a steady shear; a single one that is steady is one, at the rate or stress and in the direction it has.
    pub fn impose(&mut self, segments: &[Segment]) {
        self.segments = segments.to_vec();
        if let [only] = segments
            && only.amplitude.is_none()
        {
            *self = self.in_step(&self.imposed(0));
        }
    }

    /// Parameters of a run that imposes for all time what this one imposes in one step: without segments.
    #[must_use]
    pub fn in_step(&self, imposed: &Imposed) -> Self {
        let mut params = Self {
            segments: Vec::new(),
            ..self.clone()
        };
        params.take(self, imposed);
        params
    }

    /// Takes over what another run imposes in a step.
    pub(crate) fn take(&mut self, run: &Self, imposed: &Imposed) {
        self.direction = imposed.direction;
        let Some(segment) = run.segments.get(imposed.segment) else {
            return;
        };
        (self.shear_rate, self.shear_stress) = segment.shear(run);
        self.shear_rate *= imposed.rate_share;
        if let Some(laws) = self.contact.chosen_laws()
            && laws.stiffness_unit == StiffnessUnit::Flow
        {
            // The unit is that of the largest rate of a cycle, in which a spring is always as stiff.
            laws.stiffness = run.contact.laws().stiffness / imposed.rate_share;
        }
    }
}

impl Imposed {
    /// Strain of the cell at a strain of the run within the step.
    pub(crate) fn net_strain(&self, strain: f64, time_step: f64) -> f64 {
        let before = self.net_steps as f64 * time_step;
        before + self.direction * (strain - self.since as f64 * time_step)
    }
}

/// Refuses segments that are no protocol of a run.
pub(super) fn check(params: &Params) -> Result<(), Refusal> {
    let refuse = |key, value: f64, problem: &str, allowed: &str| {
        Err(Refusal {
            key,
            value: value.to_string(),
            problem: problem.into(),
            allowed: allowed.into(),
            because: Some("segments"),
        })
    };
    let is_whole = |strain: f64, least: f64| {
        let steps = strain / params.time_step;
        (least..1e15).contains(&steps.round()) && (steps - steps.round()).abs() <= 1e-6
    };
    let mut before = f64::NEG_INFINITY;
    for (number, segment) in params.segments.iter().enumerate() {
        let start = segment.start;
        if !is_whole(start, 0.0) || start <= before || (number == 0 && start != 0.0) {
            return refuse(
                "start",
                start,
                "is no start of a segment",
                "0 for the first segment, then increasing whole numbers of time steps",
            );
        }
        before = start;
        if segment.shear_rate.is_some() && segment.shear_stress.is_some() {
            return refuse(
                "shear_stress",
                segment.shear_stress.unwrap_or(0.0),
                "is imposed beside a shear rate",
                "either of the two in a segment",
            );
        }
        let Some(amplitude) = segment.amplitude else {
            continue;
        };
        if !is_whole(amplitude, 1.0) {
            return refuse(
                "amplitude",
                amplitude,
                "is no whole number of time steps",
                "whole numbers of them: an oscillation turns at the end of a step",
            );
        }
        let stress = match segment.shear_rate {
            Some(_) => None,
            None => segment.shear_stress.or(params.shear_stress),
        };
        if let Some(stress) = stress {
            return refuse(
                "shear_stress",
                stress,
                "is imposed in an oscillation",
                "a `shear_rate`, the largest of a cycle",
            );
        }
    }
    Ok(())
}
