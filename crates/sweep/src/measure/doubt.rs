//! Criteria for doubtful numbers of a finished run: these are stored, but not averaged.
//!
//! The rules are declared here alone, each with its threshold and the reason for it; the store
//! keeps which of them a run broke, and tables, figures and the page count such runs.

use crate::measure::{RunData, mean, ratio};
use sd_core::{ContactScheme, NormalLaw, Params};

/// Maximum fraction of unconverged contact problems. Good runs near jamming have 1 to 2.5 %.
const UNCONVERGED: f64 = 0.05;
/// Largest residual of a contact problem, in a·rate. Over a step of 0.005 a contact then violates
/// its condition by 5e-4 a, a twentieth of a typical roughness height; good runs stay below 1e-6.
/// Under an imposed stress the rate vanishes at an instant at which the spheres jam, and a residual
/// that is measured by it says nothing: such runs are judged by their gaps.
const RESIDUAL: f64 = 0.1;
/// Smallest gap under rigid contacts, over the roughness height: rough surfaces then overlap by
/// three quarters of it. No step lets a gap fall below 0.95 of it, so that smaller gaps come from a
/// given start or from results of an earlier version of the physics; but beside a repulsion pairs
/// that close within a step overlap in proportion to it, much with hydrodynamic friction.
const HELD: f64 = 0.25;
/// Maximum contribution of one sample to the mean viscosity: without it the mean would fall by
/// half.
const CARRIED: f64 = 0.5;
/// Minimum number of samples for that rule.
const FEW: usize = 10;

/// Why a run is doubtful.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Doubt {
    /// Too many contact problems did not converge.
    Unconverged,
    /// A contact problem kept a large residual.
    Residual,
    /// Rough surfaces overlap under rigid contacts.
    Overlap,
    /// A viscosity that no suspension has.
    BelowOne,
    /// One sample dominates the mean.
    OneSample,
}

impl Doubt {
    /// All rules.
    pub const ALL: [Self; 5] = [
        Self::Unconverged,
        Self::Residual,
        Self::Overlap,
        Self::BelowOne,
        Self::OneSample,
    ];

    /// Its name in the store and in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unconverged => "unconverged",
            Self::Residual => "residual",
            Self::Overlap => "overlap",
            Self::BelowOne => "below-one",
            Self::OneSample => "one-sample",
        }
    }

    /// Description of the finding.
    pub fn meaning(self) -> String {
        match self {
            Self::Unconverged => format!(
                "more than {} % of the contact problems did not converge; near jamming shorter time steps make them easier",
                100.0 * UNCONVERGED
            ),
            Self::Residual => format!("a contact problem ended with a residual above {RESIDUAL}"),
            Self::Overlap => format!(
                "a gap fell below {HELD} of the roughness height under rigid contacts; a shorter time step holds it"
            ),
            Self::BelowOne => "the mean viscosity is below 1, the stresslet viscosity below 0, or a viscosity was negative \
                 although the contacts store no energy"
                .into(),
            Self::OneSample => format!(
                "one sample contributes more than {} % of the mean viscosity",
                100.0 * CARRIED
            ),
        }
    }

    /// The rules named in a text, separated by commas; unknown names are ignored.
    pub fn read(names: &str) -> Vec<Self> {
        names
            .split(',')
            .filter_map(|name| Self::ALL.into_iter().find(|doubt| doubt.name() == name))
            .collect()
    }

    /// In the format of [`Doubt::read`].
    pub fn write(doubts: &[Self]) -> String {
        let names: Vec<&str> = doubts.iter().map(|doubt| doubt.name()).collect();
        names.join(",")
    }

    /// The rules that a finished run broke.
    pub(crate) fn of(run: &RunData<'_>) -> Vec<Self> {
        Self::ALL
            .into_iter()
            .filter(|rule| rule.is_broken(run))
            .collect()
    }

    fn is_broken(self, run: &RunData<'_>) -> bool {
        let (params, counters, viscosities) = (run.params, &run.counters, &run.viscosities);
        match self {
            Self::Unconverged => {
                counters.unconverged_stages as f64 > UNCONVERGED * counters.stages as f64
            }
            Self::Residual => {
                let came_to_rest = params.shear_stress.is_some() && counters.jam_events > 0;
                counters.worst_residual > RESIDUAL && !came_to_rest
            }
            Self::Overlap => is_rigid(params) && counters.minimum_gap < HELD * params.roughness,
            // Fluid at rest has no viscosity, and that of an instant with random forces any value.
            Self::BelowOne | Self::OneSample if params.thermal_energy().is_some() => false,
            Self::BelowOne => {
                mean(viscosities).is_some_and(|mean| mean < 1.0)
                    || mean(&run.stresslet_viscosities).is_some_and(|mean| mean < 0.0)
                    || (!can_release_energy(params)
                        && viscosities.iter().any(|viscosity| *viscosity < 0.0))
            }
            Self::OneSample => {
                let sizes = || viscosities.iter().map(|viscosity| viscosity.abs());
                let largest = sizes().fold(0.0, f64::max);
                viscosities.len() >= FEW
                    && ratio(largest, sizes().sum()).is_none_or(|share| share > CARRIED)
            }
        }
    }
}

/// Whether contacts are rigid. The paper's steps do not hold gaps, which shows in their smallest
/// gap.
pub(crate) fn is_rigid(params: &Params) -> bool {
    match &params.contact {
        ContactScheme::Rigid => true,
        ContactScheme::Procedure => false,
        ContactScheme::Laws(laws) => laws.normal == NormalLaw::Rigid,
    }
}

/// Whether springs, a repulsion or adhesion can release energy: then a viscosity may briefly fall
/// below 0.
fn can_release_energy(params: &Params) -> bool {
    match &params.contact {
        ContactScheme::Rigid | ContactScheme::Procedure => false,
        ContactScheme::Laws(laws) => {
            laws.is_soft() || laws.has_rigid_springs() || laws.has_colloids() || laws.adhesion > 0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::{counters, params, sample};
    use sd_core::simulation::Counters;
    use sd_core::{ContactLaws, Sample};

    fn samples() -> Vec<Sample> {
        (0..50).map(|n| sample(f64::from(n) * 0.02)).collect()
    }

    fn doubts(params: &Params, counters: &Counters, samples: &[Sample]) -> Vec<Doubt> {
        let mut run = RunData::new(params, 0);
        run.counters = *counters;
        for sample in samples {
            run.add(0, sample);
        }
        Doubt::of(&run)
    }

    #[test]
    fn sound_runs_break_no_rule() {
        assert_eq!(doubts(&params(), &counters(), &samples()), []);
        // As bad as the worst of the published runs.
        let near_jamming = Counters {
            stages: 10_000,
            unconverged_stages: 250,
            worst_residual: 1.4e-7,
            minimum_gap: 0.0035,
            ..counters()
        };
        let mut spiky = samples();
        spiky[7].viscosity = 300.0;
        assert_eq!(doubts(&params(), &near_jamming, &spiky), []);
        assert_eq!(doubts(&params(), &counters(), &[]), []);
    }

    #[test]
    fn each_rule_is_broken_by_what_it_is_about() {
        let with = |change: fn(&mut Counters)| {
            let mut changed = counters();
            change(&mut changed);
            doubts(&params(), &changed, &samples())
        };
        assert_eq!(
            with(|c| (c.stages, c.unconverged_stages) = (3351, 3283)),
            [Doubt::Unconverged]
        );
        assert_eq!(with(|c| c.worst_residual = 0.2), [Doubt::Residual]);
        assert_eq!(with(|c| c.minimum_gap = 0.002), [Doubt::Overlap]);
        // A repulsion between the surfaces does not make contacts soft.
        let laws = ContactLaws {
            repulsion: 1.0,
            repulsion_length: 0.02,
            ..ContactLaws::PAPER
        };
        let repelled = Params {
            contact: ContactScheme::Laws(laws),
            ..params()
        };
        let overlapping = Counters {
            minimum_gap: -0.002,
            ..counters()
        };
        assert_eq!(
            doubts(&repelled, &overlapping, &samples()),
            [Doubt::Overlap]
        );
        let changed = |change: fn(&mut Vec<Sample>)| {
            let mut changed = samples();
            change(&mut changed);
            doubts(&params(), &counters(), &changed)
        };
        assert_eq!(changed(|s| s[3].viscosity = 1e6), [Doubt::OneSample]);
        assert_eq!(changed(|s| s[3].viscosity = -20.0), [Doubt::BelowOne]);
        assert_eq!(
            changed(|s| s.iter_mut().for_each(|s| s.viscosity = 0.9)),
            [Doubt::BelowOne]
        );
        assert_eq!(
            changed(|s| s.iter_mut().for_each(|s| s.viscosity_stresslet = -562.0)),
            [Doubt::BelowOne]
        );
    }

    #[test]
    fn a_residual_counts_unless_an_imposed_stress_jams_the_spheres_for_a_moment() {
        let imposed = Params {
            shear_stress: Some(1.0),
            ..params()
        };
        let with = |params: &Params, jam_events: u64| {
            let counters = Counters {
                worst_residual: 0.9,
                jam_events,
                ..counters()
            };
            doubts(params, &counters, &samples())
        };
        assert_eq!(with(&params(), 1), [Doubt::Residual]);
        assert_eq!(with(&imposed, 0), [Doubt::Residual]);
        assert_eq!(with(&imposed, 1), []);
    }

    #[test]
    fn the_paper_s_steps_may_lose_their_gaps() {
        let procedure = Params {
            contact: ContactScheme::Procedure,
            ..params()
        };
        let closed = Counters {
            minimum_gap: 1e-5,
            ..counters()
        };
        assert_eq!(doubts(&procedure, &closed, &samples()), []);
    }

    #[test]
    fn names_are_read_as_they_are_written() {
        for doubts in [vec![], vec![Doubt::Overlap], Doubt::ALL.to_vec()] {
            assert_eq!(Doubt::read(&Doubt::write(&doubts)), doubts);
        }
    }
}
