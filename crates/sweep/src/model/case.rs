//! One case: all inputs that determine the result of a run, its key, its state, its cost.

use crate::model::protocol::Protocol;
use sd_core::model::FlowType;
use sd_core::{ContactScheme, Hydrodynamics, Method, Params};
use serde::{Deserialize, Serialize};
use std::fmt::{self, Write as _};

/// Version of the physics, raised whenever the same parameters and seed give other numbers: old
/// results then keep their old keys.
pub const PHYSICS_VERSION: u32 = 6;

/// One run of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Parameters of the layer and its flow.
    pub params: Params,
    /// Seed of the start layer.
    pub seed: u64,
    /// Length of the run, in steps.
    pub steps: u64,
    /// Steps from one sample to the next.
    pub sample_stride: u64,
}

impl Case {
    /// The case of these parameters, [canonical](Params::canonicalise) so that equal physics has
    /// equal numbers.
    pub fn new(mut params: Params, seed: u64, protocol: &Protocol) -> Self {
        params.canonicalise();
        let in_steps = protocol.with_time_step(params.time_step);
        Self {
            params,
            seed,
            steps: in_steps.steps(),
            sample_stride: in_steps.sample_stride(),
        }
    }

    /// Hash of all that determines the samples of the run, and of nothing else.
    ///
    /// The name of the campaign, the strain discarded and the checkpoint interval are not in it:
    /// they change no sample. Nor is the length of the run: a short run is the beginning of a long
    /// one.
    pub fn key(&self) -> CaseKey {
        let params = serde_json::to_string(&self.params);
        debug_assert!(params.is_ok(), "numbers and names always have JSON");
        CaseKey::of_text(&params.unwrap_or_default(), self.seed, self.sample_stride)
    }

    /// Strain at the end of the run.
    pub fn strain(&self) -> f64 {
        self.steps as f64 * self.params.time_step
    }

    /// Estimated seconds of the whole run, good enough for the order of runs.
    pub fn cost(&self) -> f64 {
        self.steps as f64 * step_cost(&self.params)
    }

    /// A short description of the case, for progress and errors.
    pub fn label(&self) -> String {
        let p = &self.params;
        let fraction = match p.volume_fraction {
            Some(volume_fraction) => format!("φ={volume_fraction}"),
            None => format!("c={}", p.area_fraction),
        };
        // Whether the coefficient or the rate was 0, friction does not act and Γ has no effect.
        let acts = p.has_friction();
        let friction = if acts {
            format!("ν={}", p.friction)
        } else {
            "frictionless".into()
        };
        let flow = match p.flow {
            FlowType::Shear => String::new(),
            other => format!(" {other}"),
        };
        let shear = match p.shear_stress {
            Some(stress) => format!(" σ*={stress}"),
            None if acts || p.shear_rate != 0.0 => format!(" Γ={}", p.shear_rate),
            None => String::new(),
        };
        let pressure = match (p.viscous_number, p.macroscopic_friction) {
            (Some(number), _) => format!(" J={number}"),
            (None, Some(ratio)) => format!(" σ/P={ratio}"),
            (None, None) => String::new(),
        };
        format!(
            "{fraction} {friction} h={}{flow}{shear}{pressure} N={} seed {}",
            p.roughness, p.spheres, self.seed
        )
    }
}

/// Estimated seconds of one step on a common core: good enough for the order of runs and for
/// progress bars.
pub(crate) fn step_cost(params: &Params) -> f64 {
    let n = params.spheres as f64;
    // Measured at 60 and 200 spheres, φ = 0.45.
    let suspended = params.volume_fraction.is_some();
    // Of one stage, contacts included, as measured.
    let stage = match (Method::of(params), params.hydrodynamics) {
        // Dense factorizations of 6N and sums over all pairs.
        (Method::Dense, Hydrodynamics::StokesianDynamics) => {
            3e-6 * n + 2.6e-7 * n * n + 2.7e-9 * n.powi(3)
        }
        (Method::Iterated, _) if suspended => 2e-3 * n * (n / 200.0).powf(0.2),
        (Method::Iterated, _) => 1e-4 * n * (n / 400.0).sqrt(),
        // Sparse factors, and solves with them.
        (Method::Pairwise, Hydrodynamics::Lubrication(_)) if suspended => 1e-5 * n.powf(1.3),
        (Method::Pairwise, _) if suspended => 3e-5 * n.powf(1.3),
        (Method::Pairwise, _) => 2e-6 * n.powf(1.3),
        // Dense in the contacts alone.
        (Method::Dense, Hydrodynamics::BallMelrose | Hydrodynamics::Lubrication(_)) => {
            2e-6 * n + 3.3e-8 * n * n
        }
    };
    // Solves per stage until it carries the imposed stress.
    let solves = |most: f64| {
        if params.has_free_rate() {
            return 3.5;
        }
        let searches = params.shear_stress.is_some() && params.has_friction();
        if searches { most } else { 1.0 }
    };
    match params.contact {
        ContactScheme::Procedure => 2.4 * stage * solves(1.5),
        ContactScheme::Laws(laws) if laws.is_soft() => 2.0 * stage * solves(4.0),
        ContactScheme::Rigid | ContactScheme::Laws(_) => 2.0 * stage * solves(1.5),
    }
}

/// The parameters without their shear rate or stress, which are the same along a flow curve.
pub(crate) fn without_shear(params: &Params) -> Params {
    Params {
        shear_rate: 0.0,
        shear_stress: params.shear_stress.map(|_| 1.0),
        ..params.clone()
    }
}

/// Name of a case: 128 bits of a BLAKE3 hash, written as 32 hexadecimal digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CaseKey([u8; 16]);

impl CaseKey {
    /// Of a case with these parameters as JSON. The names and their order are part of the key:
    /// never change them.
    pub(crate) fn of_text(params: &str, seed: u64, sample_stride: u64) -> Self {
        Self::of_physics(PHYSICS_VERSION, params, seed, sample_stride)
    }

    /// [`CaseKey::of_text`] by a version of the physics.
    pub(crate) fn of_physics(version: u32, params: &str, seed: u64, sample_stride: u64) -> Self {
        let mut text = String::with_capacity(params.len() + 96);
        let _ = write!(
            text,
            r#"{{"physics":{version},"params":{params},"seed":{seed},"sample_stride":{sample_stride}}}"#
        );
        let mut key = [0; 16];
        key.copy_from_slice(&blake3::hash(text.as_bytes()).as_bytes()[..16]);
        Self(key)
    }

    /// The key as one number.
    pub(crate) fn number(self) -> u128 {
        u128::from_be_bytes(self.0)
    }
}

impl fmt::Display for CaseKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const DIGITS: &[u8; 16] = b"0123456789abcdef";
        let mut text = String::with_capacity(2 * self.0.len());
        for byte in self.0 {
            text.push(DIGITS[usize::from(byte >> 4)].into());
            text.push(DIGITS[usize::from(byte & 15)].into());
        }
        f.write_str(&text)
    }
}

/// State of a case. The data of each state is in the store.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Not started, or stopped and ready to continue from its last checkpoint.
    Pending,
    /// Owned by a process.
    Running,
    /// Finished; included in averages.
    Done,
    /// Ended as a jammed layer, which is counted but not averaged.
    Jammed,
    /// Ended with an error.
    Failed,
}

impl State {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Pending,
        Self::Running,
        Self::Done,
        Self::Jammed,
        Self::Failed,
    ];

    /// The state of this name.
    pub fn of(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.name() == name)
    }

    /// Its name in the store.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pending => "pending",
            Self::Running => "running",
            Self::Done => "done",
            Self::Jammed => "jammed",
            Self::Failed => "failed",
        }
    }

    /// Whether it is that of a run which came to rest under an imposed ratio of stress and
    /// pressure: such runs count as jammed.
    pub(crate) fn is_arrest(self, params: &Params) -> bool {
        self == Self::Jammed && params.macroscopic_friction.is_some()
    }

    /// What it is called in a run of these parameters.
    pub(crate) fn word(self, params: &Params) -> &'static str {
        if self.is_arrest(params) {
            "arrested"
        } else {
            self.name()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case() -> Case {
        Case::new(crate::test_support::params(), 7, &Protocol::default())
    }

    #[test]
    fn key_is_the_same_on_every_day_and_machine() {
        assert_eq!(case().key().to_string(), "87582c0a14be70816119b33d636bb40c");
    }

    #[test]
    fn costs_of_a_step_are_those_measured_whatever_the_way_it_is_computed() {
        use Hydrodynamics::{BallMelrose, StokesianDynamics};
        let cost = |hydrodynamics, spheres| {
            let params = Params {
                hydrodynamics,
                spheres,
                ..case().params
            };
            step_cost(&params)
        };
        // Milliseconds, of steps of two stages at c = 0.7; those of 400 and 1000 spheres by pairs
        // on a machine 1.6 times as fast, times that.
        for (hydrodynamics, spheres, measured) in [
            (BallMelrose, 90, 1.2),
            (BallMelrose, 400, 9.0),
            (BallMelrose, 1000, 27.0),
            (BallMelrose, 10_000, 600.0),
            (StokesianDynamics, 50, 2.3),
            (StokesianDynamics, 90, 9.0),
            (StokesianDynamics, 200, 35.0),
            (StokesianDynamics, 400, 83.0),
            (StokesianDynamics, 800, 250.0),
            (StokesianDynamics, 2000, 890.0),
            (StokesianDynamics, 10_000, 9500.0),
        ] {
            let ratio = 1e3 * cost(hydrodynamics, spheres) / measured;
            assert!(
                (0.6..1.7).contains(&ratio),
                "{hydrodynamics:?} {spheres}: {ratio}"
            );
        }
    }

    #[test]
    fn key_depends_on_the_seed_and_not_on_what_is_discarded() {
        let other = Case { seed: 8, ..case() };
        assert_ne!(case().key(), other.key());
        let protocol = Protocol {
            discard: 1.0,
            checkpoint_every: 0.3,
            ..Protocol::default()
        };
        assert_eq!(Case::new(case().params, 7, &protocol).key(), case().key());
    }

    #[test]
    fn a_label_names_a_case() {
        let case = Case {
            params: Params {
                shear_rate: 0.1,
                ..case().params
            },
            ..case()
        };
        assert_eq!(case.label(), "c=0.693 ν=0.3 h=0.01 Γ=0.1 N=90 seed 7");
        let case = Case::new(
            Params {
                friction: 0.0,
                ..case.params
            },
            7,
            &Protocol::default(),
        );
        assert_eq!(case.label(), "c=0.693 frictionless h=0.01 N=90 seed 7");
    }

    #[test]
    fn a_longer_run_is_the_same_case() {
        let protocol = Protocol {
            strain: 10.0,
            ..Protocol::default()
        };
        let longer = Case::new(case().params, 7, &protocol);
        assert_ne!(longer.steps, case().steps);
        assert_eq!(longer.key(), case().key());
    }

    #[test]
    fn equal_physics_has_an_equal_key() {
        let alike = Params {
            large_fraction: 0.2,
            ..case().params
        };
        assert_eq!(
            Case::new(alike, 7, &Protocol::default()).key(),
            case().key()
        );
        let zero = |friction| {
            Case::new(
                Params {
                    friction,
                    ..case().params
                },
                7,
                &Protocol::default(),
            )
            .key()
        };
        assert_eq!(zero(0.0), zero(-0.0));
    }
}
