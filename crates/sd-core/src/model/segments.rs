//! Protocols in time: the imposed shear in each segment of a run.

use super::{FlowType, Params, StiffnessUnit};
use crate::error::Refusal;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A part of a run with one imposed flow: a steady shear, or an oscillation.
///
/// Values that are absent are those of the [`Params`] it belongs to.
///
/// ```
/// use sd_core::Params;
/// use sd_core::model::Segment;
///
/// let forwards = Segment::default();
/// let backwards = Segment { start: 1.0, direction: Some(-1.0), ..Segment::default() };
/// let oscillation = Segment { start: 2.0, amplitude: Some(0.1), ..Segment::default() };
/// let params = Params::builder()
///     .spheres(40)
///     .area_fraction(0.6)
///     .roughness(0.01)
///     .friction(0.5)
///     .shear_rate(2.0)
///     .segments(vec![forwards, backwards, oscillation])
///     .build()?;
/// let imposed = params.imposed(150); // in the step after 150 steps of 0.01
/// assert_eq!((imposed.segment, imposed.direction), (1, -1.0));
/// # Ok::<(), sd_core::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    /// Strain of the run at its start, a multiple of the time step; strain in the reverse direction
    /// counts as positive.
    pub start: f64,
    /// Type of its flow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow: Option<FlowType>,
    /// Sense of the flow, 1 or −1; in an oscillation that of its first quarter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<f64>,
    /// Imposed shear rate Γ; in an oscillation the largest of a cycle.
    #[serde(
        default,
        with = "super::infinite::optional",
        skip_serializing_if = "Option::is_none"
    )]
    pub shear_rate: Option<f64>,
    /// Imposed shear stress σ*; not in oscillations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shear_stress: Option<f64>,
    /// Amplitude γ0 of an oscillation γ0 sin ωt about the strain at the start of the segment, a
    /// multiple of the time step; `None` for a steady shear.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<f64>,
    /// Oscillation across a steady shear of a suspension.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cross_shear: Option<CrossShear>,
}

/// An oscillation along the vorticity, across a continuing steady shear (Lin, Ness, Cates, Sun &
/// Cohen, PNAS 113, 10774, 2016).
///
/// ```text
/// u∞ = γ̇ y x̂ + γ̇_z y ẑ,   γ_z = amplitude sin(ratio γ)
/// ```
/// γ is the strain of the primary shear since the start of the segment. γ_z is imposed at the start
/// of every step, with linear interpolation between, so that the rate of strain is the same in all
/// stages of a step, as in a steady shear.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CrossShear {
    /// Largest cross strain, above 0.
    pub amplitude: f64,
    /// Angular frequency over the rate of the primary shear, above 0.
    pub ratio: f64,
}

/// Strain across the shear in one step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CrossStrain {
    /// Strain of the run at which it has the value `strain`.
    pub(crate) since: f64,
    strain: f64,
    /// Its rate over that of the primary shear.
    pub(crate) rate: f64,
}

/// The imposed shear in one step of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Imposed {
    /// Number of the segment, from 0.
    pub segment: usize,
    /// Type of the flow.
    pub flow: FlowType,
    /// Sense of the flow, 1 or −1; 0 in fluid at rest.
    pub direction: f64,
    /// Step of the run at which shear in this sense started, in this segment.
    pub since: u64,
    /// Net number of forward steps up to then.
    pub net_steps: i64,
    /// Net number of forward steps in the segments before.
    pub(crate) net_steps_before: i64,
    /// Cross strain gained in the segments before.
    pub(crate) cross_before: f64,
    /// Mean shear rate over the step, over the largest of the segment: 1 except in an oscillation.
    pub rate_share: f64,
    /// Strain along the vorticity.
    pub cross: CrossStrain,
}

/// What a segment of a run, or a run without segments, has done to the spheres by its flow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Displacement {
    pub(crate) flow: FlowType,
    /// Net strain in the sense of the flow.
    pub(crate) strain: f64,
    /// Cross strain gained.
    pub(crate) cross: f64,
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

impl CrossShear {
    /// Largest phase, in radians, by which it may advance in a step.
    const LARGEST_ADVANCE: f64 = 0.5;
    /// Largest cross strain of a step.
    const LARGEST_STRAIN: f64 = 0.1;

    /// Cross strain at a primary strain.
    fn strain_after(&self, strain: f64) -> f64 {
        self.amplitude * (self.ratio * strain).sin()
    }
}

impl CrossStrain {
    /// The cross strain at a strain of the run within the step.
    pub(crate) fn at(&self, strain: f64) -> f64 {
        self.strain + self.rate * (strain - self.since)
    }
}

impl Segment {
    /// Refuses an invalid cross shear.
    ///
    /// # Errors
    /// [`Refusal`] of a cross shear in a layer, across an oscillation, with numbers out of range or
    /// not resolved by the time step.
    pub fn check_cross_shear(&self, params: &Params) -> Result<(), Refusal> {
        let Some(CrossShear { amplitude, ratio }) = self.cross_shear else {
            return Ok(());
        };
        let refuse = |key, value: String, problem: String, allowed: String, because| {
            Err(Refusal {
                key,
                value,
                problem,
                allowed,
                because,
            })
        };
        let written = format!("{{ amplitude = {amplitude}, ratio = {ratio} }}");
        if params.volume_fraction.is_none() {
            return refuse(
                "cross_shear",
                written,
                "has no meaning: a layer has no vorticity direction".into(),
                "suspensions, which have a `volume_fraction`".into(),
                None,
            );
        }
        if self.flow.unwrap_or(params.flow) != FlowType::Shear {
            return refuse(
                "cross_shear",
                written,
                "is imposed across a flow that is no shear".into(),
                "`flow` = \"shear\" in this segment".into(),
                Some("flow"),
            );
        }
        if self.amplitude.is_some() {
            return refuse(
                "cross_shear",
                written,
                "is imposed across an oscillation".into(),
                "either of the two in a segment: cross shear goes with a steady shear".into(),
                Some("oscillation"),
            );
        }
        for (key, value) in [
            ("cross_shear.amplitude", amplitude),
            ("cross_shear.ratio", ratio),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(
                    key,
                    value.to_string(),
                    "is out of range".into(),
                    "finite numbers above 0".into(),
                    None,
                );
            }
        }
        let dt = params.time_step;
        let unresolved = format!("is not resolved by a time step of {dt}");
        if ratio * dt > CrossShear::LARGEST_ADVANCE {
            let most = CrossShear::LARGEST_ADVANCE;
            return refuse(
                "cross_shear.ratio",
                ratio.to_string(),
                unresolved,
                format!(
                    "at most {}, or a `time_step` of at most {}: `ratio` times `time_step` is at most {most}",
                    most / dt,
                    most / ratio
                ),
                Some("time_step"),
            );
        }
        if amplitude * ratio * dt > CrossShear::LARGEST_STRAIN {
            let most = CrossShear::LARGEST_STRAIN;
            return refuse(
                "cross_shear.amplitude",
                amplitude.to_string(),
                unresolved,
                format!(
                    "at most {}, or a `time_step` of at most {}: the cross strain of a step is at most {most}",
                    most / (ratio * dt),
                    most / (ratio * amplitude)
                ),
                Some("time_step"),
            );
        }
        Ok(())
    }

    /// Its first step.
    fn first_step(&self, time_step: f64) -> u64 {
        steps_in(self.start, time_step)
    }

    /// Γ and σ* imposed in it; σ* is `None` under an imposed rate.
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

    /// Net steps in its direction after a number of its steps.
    fn displacement(&self, steps: u64, time_step: f64) -> i64 {
        self.quarter(time_step).map_or_else(
            || steps.cast_signed(),
            |quarter| displacement(steps, quarter),
        )
    }
}

/// Phase ωt of an oscillation γ0 sin ωt, from the total strain in both directions over its
/// amplitude.
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

/// Net steps of an oscillation after `steps`, from its number of steps in a quarter of a cycle.
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
    /// The imposed shear in a step of the run, counted from 0.
    pub fn imposed(&self, step: u64) -> Imposed {
        let steady = Imposed {
            segment: 0,
            flow: self.flow,
            direction: if self.at_rest { 0.0 } else { self.direction },
            since: 0,
            net_steps: 0,
            net_steps_before: 0,
            cross_before: 0.0,
            rate_share: 1.0,
            cross: CrossStrain::default(),
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
        // The completed segments, and their numbers of steps.
        let over = || {
            let pairs = before.iter().zip(following.clone());
            pairs.map(|(one, next)| (one, first(next) - first(one)))
        };
        let net_steps: i64 = over()
            .map(|(one, steps)| sign(one) * one.displacement(steps, self.time_step))
            .sum();
        let crossed = |one: &Segment, steps: u64| {
            let strain = steps as f64 * self.time_step;
            one.cross_shear
                .map_or(0.0, |cross| cross.strain_after(strain))
        };
        let crossed_before: f64 = over().map(|(one, steps)| crossed(one, steps)).sum();
        let gone = step - first(current);
        let cross = if current.cross_shear.is_some() {
            let [now, next] = [gone, gone + 1].map(|steps| crossed(current, steps));
            CrossStrain {
                since: step as f64 * self.time_step,
                strain: crossed_before + now,
                rate: (next - now) / self.time_step,
            }
        } else {
            CrossStrain {
                strain: crossed_before,
                ..CrossStrain::default()
            }
        };
        let imposed = Imposed {
            segment: before.len(),
            flow: current.flow.unwrap_or(self.flow),
            direction: direction(current),
            since: first(current),
            net_steps,
            net_steps_before: net_steps,
            cross,
            cross_before: crossed_before,
            ..steady
        };
        let Some(quarter) = current.quarter(self.time_step) else {
            return imposed;
        };
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

    /// What the segments before this one do, each as a whole; none for a run without segments.
    pub(crate) fn displacements_before(&self, segment: usize) -> Vec<Displacement> {
        let pairs = self.segments.iter().zip(self.segments.iter().skip(1));
        let each = pairs.take(segment).map(|(one, next)| {
            let steps = next.first_step(self.time_step) - one.first_step(self.time_step);
            let net = one.displacement(steps, self.time_step) as f64 * self.time_step;
            let cross = one.cross_shear.map_or(0.0, |cross| {
                cross.strain_after(steps as f64 * self.time_step)
            });
            Displacement {
                flow: one.flow.unwrap_or(self.flow),
                strain: one.direction.unwrap_or(self.direction) * net,
                cross,
            }
        });
        each.collect()
    }

    /// The types of flow of the segments, or of a run without segments.
    pub(crate) fn flow_types(&self) -> Vec<FlowType> {
        let segments = self.segments.iter();
        let each: Vec<_> = segments.map(|one| one.flow.unwrap_or(self.flow)).collect();
        if each.is_empty() {
            vec![self.flow]
        } else {
            each
        }
    }

    /// Whether the run is sheared throughout, so that its cell is a sheared one.
    pub fn is_sheared(&self) -> bool {
        self.flow_types()
            .iter()
            .all(|flow| *flow == FlowType::Shear)
    }

    /// The run without its last segment, and the step at which that starts; `None` for a single
    /// segment.
    pub fn before_last_segment(&self) -> Option<(Self, u64)> {
        let (last, before) = self.segments.split_last()?;
        if before.is_empty() {
            return None;
        }
        let mut shorter = self.clone();
        shorter.impose(before);
        shorter.canonicalise();
        Some((shorter, last.first_step(self.time_step)))
    }

    /// Γ and σ* imposed in the last segment, in an oscillation the largest rate; σ* is `None` under
    /// an imposed rate.
    pub fn last_shear(&self) -> (f64, Option<f64>) {
        match self.segments.last() {
            None => (self.shear_rate, self.shear_stress),
            Some(segment) => segment.shear(self),
        }
    }

    /// This run, described by the shear of its last segment: its rate or stress are those of
    /// that segment, and every segment names its own.
    #[must_use]
    pub fn by_last_segment(&self) -> Self {
        let mut run = self.clone();
        for segment in &mut run.segments {
            let (rate, stress) = segment.shear(self);
            segment.shear_stress = stress;
            segment.shear_rate = stress.is_none().then_some(rate);
        }
        (run.shear_rate, run.shear_stress) = self.last_shear();
        run
    }

    /// The parameters of steady shear in each segment; without segments, its own.
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

    /// The parameters of the slowest step of each segment that oscillates.
    pub(crate) fn slowest_steps(&self) -> Vec<Self> {
        let steps = self.segments.iter().filter_map(|one| {
            let quarter = one.quarter(self.time_step)?;
            Some(one.first_step(self.time_step) + quarter - 1)
        });
        steps
            .map(|step| self.in_step(&self.imposed(step)))
            .collect()
    }

    /// Strain of the cell once `steps` of the run are done, backwards counted as negative.
    ///
    /// ```
    /// use sd_core::model::Segment;
    /// # use sd_core::{Hydrodynamics, Params};
    ///
    /// // Reversed at a strain of 1.
    /// let back = Segment { start: 1.0, direction: Some(-1.0), ..Segment::default() };
    /// # let reversed = Params::builder()
    /// #     .spheres(40)
    /// #     .area_fraction(0.6)
    /// #     .roughness(0.01)
    /// #     .friction(0.5)
    /// #     .shear_rate(2.0)
    /// #     .hydrodynamics(Hydrodynamics::BallMelrose)
    /// #     .segments(vec![Segment::default(), back]).build()?;
    /// assert!((reversed.net_strain(150) - 0.5).abs() < 1e-12); // 150 steps of 0.01
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn net_strain(&self, steps: u64) -> f64 {
        let imposed = self.imposed(steps);
        imposed.net_strain(steps as f64 * self.time_step, self.time_step)
    }

    /// Cross strain of the cell once `steps` of the run are done.
    pub fn cross_strain(&self, steps: u64) -> f64 {
        self.imposed(steps).cross.at(steps as f64 * self.time_step)
    }

    /// Imposes segments in place of a steady shear; a single steady segment becomes a steady shear
    /// with its rate or stress and direction.
    pub fn impose(&mut self, segments: &[Segment]) {
        self.segments = segments.to_vec();
        if let [only] = segments
            && only.amplitude.is_none()
            && only.cross_shear.is_none()
        {
            *self = self.in_step(&self.imposed(0));
        }
    }

    /// Parameters of a run without segments that permanently imposes the shear of one step, without
    /// cross shear.
    #[must_use]
    pub fn in_step(&self, imposed: &Imposed) -> Self {
        let mut params = Self {
            segments: Vec::new(),
            ..self.clone()
        };
        params.copy_shear(self, imposed);
        params
    }

    /// Copies the shear that another run imposes in a step.
    pub(crate) fn copy_shear(&mut self, run: &Self, imposed: &Imposed) {
        (self.flow, self.direction) = (imposed.flow, imposed.direction);
        let Some(segment) = run.segments.get(imposed.segment) else {
            return;
        };
        (self.shear_rate, self.shear_stress) = segment.shear(run);
        self.shear_rate *= imposed.rate_share;
        // kT and the pressure are those of the largest rate of a cycle.
        self.peclet = run.peclet * imposed.rate_share;
        self.viscous_number = run.viscous_number.map(|number| number * imposed.rate_share);
        if let Some(laws) = self.contact.chosen_laws()
            && laws.stiffness_unit == StiffnessUnit::Flow
        {
            // The unit is the largest rate of a cycle, so that the stiffness of springs is
            // constant.
            laws.stiffness = run.contact.laws().stiffness / imposed.rate_share;
        }
    }
}

impl Imposed {
    /// Net strain and cross strain gained in the segment at a strain of the run within the step.
    pub(crate) fn gained(&self, strain: f64, time_step: f64) -> [f64; 2] {
        let before = self.net_steps_before as f64 * time_step;
        [
            self.net_strain(strain, time_step) - before,
            self.cross.at(strain) - self.cross_before,
        ]
    }

    /// Rate of the cross shear in the step, over that of the primary shear: γ_z gained over γ.
    pub fn cross_rate(&self) -> f64 {
        self.cross.rate
    }

    /// Strain of the cell at a strain of the run within the step.
    pub(crate) fn net_strain(&self, strain: f64, time_step: f64) -> f64 {
        let before = self.net_steps as f64 * time_step;
        before + self.direction * (strain - self.since as f64 * time_step)
    }
}

/// Refuses segments that are not a valid protocol.
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
        segment.check_cross_shear(params)?;
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
