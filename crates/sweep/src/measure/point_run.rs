//! One run of a point: what the averages over runs are made from.

use super::Steadiness;
use super::doubt::Doubt;
use crate::model::case::State;
use sd_core::Params;
use std::sync::Arc;

/// One run of a point, with its result if it has one.
#[derive(Debug, Clone)]
pub struct PointRun {
    /// Its position in the campaign file, from 0.
    pub position: u64,
    /// Its key.
    pub key: String,
    /// Its parameters.
    pub params: Arc<Params>,
    /// Its seed.
    pub seed: u64,
    /// Its state.
    pub state: State,
    /// Reasons why its numbers are doubtful, if any.
    pub doubts: Vec<Doubt>,
    /// Strain between samples.
    pub sample_every: f64,
    /// Numbers of its result, in the order of [`NUMBERS`]; NaN for missing ones, empty without a
    /// result.
    pub(crate) numbers: Box<[f64]>,
}

impl PointRun {
    /// Whether it is finished, and broke a rule.
    pub fn is_doubtful(&self) -> bool {
        self.state == State::Done && !self.doubts.is_empty()
    }

    /// Whether it is finished and included in averages.
    pub fn is_sound(&self) -> bool {
        self.state == State::Done && self.doubts.is_empty()
    }

    /// Whether it came to rest under an imposed ratio of stress and pressure.
    pub(crate) fn is_arrested(&self) -> bool {
        self.state.is_arrest(&self.params)
    }

    /// Strain discarded.
    pub fn discard(&self) -> Option<f64> {
        Some(self.number("discard_step")? * self.params.time_step)
    }

    /// Measures of steadiness.
    pub(crate) fn steadiness(&self) -> Option<Steadiness> {
        let part = |name| self.number(name);
        Some(Steadiness {
            parts: [
                part("viscosity_part_1")?,
                part("viscosity_part_2")?,
                part("viscosity_part_3")?,
                part("viscosity_part_4")?,
            ],
            variance: part("viscosity_variance")?,
            correlation: part("viscosity_correlation")?,
        })
    }
}
