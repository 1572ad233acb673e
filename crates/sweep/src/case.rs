//! One case: all that decides the result of one run, its key, its state, its cost.

use crate::protocol::Protocol;
use sd_core::{ContactScheme, Hydrodynamics, Method, NormalLaw, Params, TangentialLaw};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Raised whenever the same parameters and seed give other numbers than before: old results then keep their old keys.
///
/// Not raised where only contact problems change that were left unsolved or found jammed, and counted as such: a run with one says itself
/// that its numbers may not be those of its law.
///
/// Where only some runs change, [`Case::physics`] says which: all others keep their keys, and results of theirs stand.
pub const PHYSICS_VERSION: u32 = 17;
/// The version that last changed runs of every kind.
pub const CHANGED_ALL: u32 = 8;
/// Number of spheres below which soft layers too were solved densely before version 15.
const SOFT_DENSE_BEFORE: usize = 100;

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

/// The canonical form a key is made of. Its field names and order are part of the key: never change them.
#[derive(Serialize)]
struct Canonical<'c> {
    /// [`Case::physics`].
    physics: u32,
    /// Parameters.
    params: &'c Params,
    /// Seed.
    seed: u64,
    /// Steps between samples.
    sample_stride: u64,
}

impl Case {
    /// The case of these parameters, [settled](Params::settle) so that equal physics has equal numbers.
    pub fn new(mut params: Params, seed: u64, protocol: &Protocol) -> Self {
        params.settle();
        let in_steps = protocol.with_time_step(params.time_step);
        Self {
            params,
            seed,
            steps: in_steps.steps(),
            sample_stride: in_steps.sample_stride(),
        }
    }

    /// The version of the physics that last changed runs of this kind. Version 9 iterates a far field from its near part on, and from step to
    /// step; version 10 solves the contact problems on the way less strictly, and with factors made more often; version 11 finds contact
    /// forces in layers held pair by pair in fewer systems, and near jamming by other ways where friction answers the motion that it slows;
    /// version 12 goes on longer with one of them where contacts are rigid too; version 13 numbers spheres of large layers row by row; version
    /// 14 leaps over convex problems on the way to the solution where friction is steep; version 15 makes factors of large layers as those of
    /// others, holds soft layers pair by pair from fewer spheres on, and jams later under an imposed stress; versions 16 and 17 see sooner which
    /// states of contacts are wrong in large layers held pair by pair.
    pub fn physics(&self) -> u32 {
        let (answers, is_rigid, is_soft, is_steep) = match &self.params.contact {
            ContactScheme::Laws(laws) => (
                laws.tangential != TangentialLaw::RollSlip,
                laws.normal == NormalLaw::Rigid,
                laws.is_soft(),
                laws.tangential.bound(self.params.friction, 1.0) > Params::STEEP_ABOVE,
            ),
            ContactScheme::Rigid | ContactScheme::Procedure => (false, true, false, false),
        };
        let spheres = self.params.spheres;
        match Method::of(&self.params) {
            Method::Pairwise if spheres > Params::LARGE_ABOVE => 17,
            Method::Iterated if spheres > Params::LARGE_ABOVE => 15,
            Method::Pairwise if is_soft && spheres < SOFT_DENSE_BEFORE => 15,
            // The search for the rate that bears a stress may meet jammed problems that no stage ends with, and so no counter tells.
            Method::Pairwise if answers && is_rigid && self.params.shear_stress.is_some() => 15,
            _ if answers && is_rigid && is_steep => 14,
            // The paper's procedure.
            Method::Dense if spheres > Params::LARGE_ABOVE => 13,
            _ if answers && is_rigid => 12,
            Method::Pairwise => 11,
            Method::Dense | Method::Iterated if answers => 11,
            Method::Iterated => 10,
            Method::Dense => CHANGED_ALL,
        }
    }

    /// Hash of everything that decides the samples of the run, and of nothing else.
    ///
    /// The name of the campaign, the strain discarded and the checkpoint interval are not in it: they change no sample. Nor is
    /// the length of the run: a short run is the beginning of a long one.
    pub fn key(&self) -> CaseKey {
        let canonical = Canonical {
            physics: self.physics(),
            params: &self.params,
            seed: self.seed,
            sample_stride: self.sample_stride,
        };
        let mut hasher = blake3::Hasher::new();
        let written = serde_json::to_writer(&mut hasher, &canonical);
        debug_assert!(written.is_ok(), "numbers and names always have JSON");
        let mut key = [0; 16];
        key.copy_from_slice(&hasher.finalize().as_bytes()[..16]);
        CaseKey(key)
    }

    /// Strain at the end of the run.
    pub fn strain(&self) -> f64 {
        self.steps as f64 * self.params.time_step
    }

    /// Estimated seconds of one step on a common core: right for the order of runs and for shares of a bar, not for promises.
    pub fn step_cost(&self) -> f64 {
        let n = self.params.spheres as f64;
        // Of one stage, contacts included, as measured.
        let stage = match (Method::of(&self.params), self.params.hydrodynamics) {
            // Dense factorizations of 6N and sums over all pairs.
            (Method::Dense, Hydrodynamics::StokesianDynamics) => {
                3e-6 * n + 2.6e-7 * n * n + 2.7e-9 * n.powi(3)
            }
            (Method::Iterated, _) => 1e-4 * n * (n / 400.0).sqrt(),
            // Sparse factors, and solves with them.
            (Method::Pairwise, _) => 2e-6 * n.powf(1.3),
            // Dense in the contacts alone.
            (Method::Dense, Hydrodynamics::BallMelrose | Hydrodynamics::Lubrication(_)) => {
                2e-6 * n + 3.3e-8 * n * n
            }
        };
        // Solves of a stage until it bears the stress, where that is imposed.
        let solves = |most: f64| {
            let searches = self.params.shear_stress.is_some() && self.params.rubs();
            if searches { most } else { 1.0 }
        };
        match self.params.contact {
            ContactScheme::Procedure => 2.4 * stage * solves(1.5),
            ContactScheme::Laws(laws) if laws.is_soft() => 2.0 * stage * solves(4.0),
            ContactScheme::Rigid | ContactScheme::Laws(_) => 2.0 * stage * solves(1.5),
        }
    }

    /// Estimated seconds of the whole run, in the sense of [`Case::step_cost`].
    pub fn cost(&self) -> f64 {
        self.steps as f64 * self.step_cost()
    }

    /// The case in a few words, for progress and errors.
    pub fn label(&self) -> String {
        let p = &self.params;
        let shear = match p.shear_stress {
            Some(stress) => format!("σ*={stress}"),
            None => format!("Γ={}", p.shear_rate),
        };
        format!(
            "c={} ν={} h={} {shear} N={} seed {}",
            p.area_fraction, p.friction, p.roughness, p.spheres, self.seed
        )
    }
}

/// Name of a case: 128 bits of a BLAKE3 hash, written as 32 hexadecimal digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CaseKey([u8; 16]);

impl fmt::Display for CaseKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// Where a case is on its way. The data of each state is in the store.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Not begun, or stopped and waiting to go on from its last checkpoint.
    Pending,
    /// Owned by a process.
    Running,
    /// Finished; counts in the averages.
    Done,
    /// Ended as a jammed layer: a result of its own kind, counted but not averaged.
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use sd_core::ContactLaws;

    fn case() -> Case {
        Case::new(crate::test_support::params(), 7, &Protocol::default())
    }

    #[test]
    fn key_is_the_same_on_every_day_and_machine() {
        assert_eq!(case().key().to_string(), "7ec1797a6bdb932c69f6b8bab3ffebca");
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
            Case { params, ..case() }.step_cost()
        };
        // Milliseconds, of steps of two stages at c = 0.7; those of 400 and 1000 spheres by pairs on a machine 1.6 times as fast, times that.
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
            discard: crate::campaign::Discard::Strain(1.0),
            checkpoint_every: 0.3,
            ..Protocol::default()
        };
        assert_eq!(Case::new(case().params, 7, &protocol).key(), case().key());
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
    fn version_of_the_physics_is_that_which_last_changed_runs_of_the_kind() {
        use Hydrodynamics::{BallMelrose, StokesianDynamics};
        let laws = |tangential| {
            ContactScheme::Laws(ContactLaws {
                tangential,
                ..ContactLaws::PAPER
            })
        };
        let coulomb = laws(TangentialLaw::Coulomb);
        let of = |hydrodynamics, spheres, contact| {
            let params = Params {
                hydrodynamics,
                spheres,
                contact,
                area_fraction: 0.7,
                ..case().params
            };
            Case { params, ..case() }.physics()
        };
        let rigid = ContactScheme::Rigid;
        assert_eq!(of(BallMelrose, 90, rigid), CHANGED_ALL);
        assert_eq!(of(StokesianDynamics, 90, rigid), CHANGED_ALL);
        assert_eq!(of(StokesianDynamics, 400, rigid), 10);
        assert_eq!(of(BallMelrose, 400, rigid), 11);
        let large = Params::LARGE_ABOVE + 1;
        for contact in [rigid, coulomb] {
            assert_eq!(of(BallMelrose, large, contact), PHYSICS_VERSION);
            assert_eq!(of(StokesianDynamics, large, contact), 15);
        }
        assert_eq!(of(BallMelrose, large, ContactScheme::Procedure), 13);
        let of_friction = |friction, contact| {
            let params = Params {
                friction,
                contact,
                ..case().params
            };
            Case { params, ..case() }.physics()
        };
        assert_eq!(of_friction(1.0, coulomb), 12);
        assert_eq!(of_friction(1.1, coulomb), 14);
        assert_eq!(of_friction(1.1, rigid), CHANGED_ALL);
        assert_eq!(of_friction(1.1, laws(TangentialLaw::RollSlip)), CHANGED_ALL);
        // Its friction has no limit, whatever its coefficient is called.
        assert_eq!(of_friction(0.3, laws(TangentialLaw::StickRotate)), 14);
        // The paper's procedure is dense at any number of spheres.
        assert_eq!(of(BallMelrose, 400, ContactScheme::Procedure), CHANGED_ALL);
        let springs = ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01);
        let soft = ContactScheme::Laws(springs);
        for spheres in [90, 400] {
            for hydrodynamics in [BallMelrose, StokesianDynamics] {
                assert_eq!(of(hydrodynamics, spheres, coulomb), 12);
            }
            assert_eq!(of(StokesianDynamics, spheres, soft), 11);
        }
        let stressed = Params {
            shear_stress: Some(0.1),
            spheres: 200,
            contact: coulomb,
            hydrodynamics: BallMelrose,
            ..case().params
        };
        let stressed = Case {
            params: stressed,
            ..case()
        };
        assert_eq!(stressed.physics(), 15);
        for (spheres, physics) in [(50, 11), (90, 15), (400, 11)] {
            assert_eq!(of(BallMelrose, spheres, soft), physics);
        }
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
