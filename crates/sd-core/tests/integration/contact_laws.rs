//! Laws of contact other than the paper's: what must hold for each of them.

mod adhering_pair;
mod layers;
mod pressed_pair;
mod pushed_pair;
mod rolling_pair;

use sd_core::cell::Cell;
use sd_core::contact::{Laws, NormalForce, PairForces, Surface};
use sd_core::instant::{Configuration, InstantContacts, SolvedConfiguration, solve};
use sd_core::law::hydrodynamic_friction::HydrodynamicFriction;
use sd_core::modes::Vec2;
use sd_core::{
    FrictionOnset, Hydrodynamics, NearFields, NormalLaw, TangentialLaw, VelocityGradient,
};

const RIGID: NormalForce = NormalForce {
    law: sd_core::contact::ForceLaw::BuiltIn(NormalLaw::Rigid),
    stiffness: f64::INFINITY,
    dashpot: 0.0,
};
const SPRING: NormalForce = NormalForce {
    law: sd_core::contact::ForceLaw::BuiltIn(NormalLaw::LinearSpring),
    stiffness: 2000.0,
    dashpot: 0.0,
};
const HERTZ: NormalForce = NormalForce {
    law: sd_core::contact::ForceLaw::BuiltIn(NormalLaw::Hertz),
    stiffness: 40_000.0,
    dashpot: 0.0,
};

/// Overlap at which a law has a given force.
fn overlap(normal: NormalForce, force: f64) -> f64 {
    normal.law.curve().overlap(force, normal.stiffness)
}

fn laws(normal: NormalForce, tangential: TangentialLaw, friction: f64) -> Laws {
    Laws {
        surface: Surface {
            roughness: 0.01,
            friction,
            critical_load: 0.0,
        },
        normal,
        tangential,
        tangential_stiffness: 0.0,
        onset: FrictionOnset::CriticalLoad,
        repulsion: None,
        attraction: None,
        rolling_friction: 0.0,
        adhesion: 0.0,
        hydrodynamic_friction: HydrodynamicFriction::default(),
    }
}

/// Tangential springs of a stiffness that slide.
fn stick_slide(normal: NormalForce, stiffness: f64, friction: f64) -> Laws {
    Laws {
        tangential_stiffness: stiffness,
        ..laws(normal, TangentialLaw::StickSlide, friction)
    }
}

/// Two spheres of radii 1 and 1.4 alone, along a slanted line of centres, pushed by `push` each
/// towards the other and by `shear` across.
fn pair(gap: f64, push: f64, shear: f64) -> Configuration {
    let n = Vec2::new(0.8, 0.6);
    let force = n * push + Vec2::new(-n.y, n.x) * shear;
    Configuration {
        centres: vec![Vec2::zeros(), n * (2.4 + gap)],
        radii: vec![1.0, 1.4],
        cell: Cell::Unbounded,
        hydrodynamics: Hydrodynamics::StokesianDynamics,
        background: VelocityGradient::at_rest().into(),
        forces: vec![force, -force],
        torques: vec![0.0; 2],
    }
}

fn solved(configuration: &Configuration, laws: &Laws, time_span: f64) -> SolvedConfiguration {
    let request = InstantContacts::Laws {
        laws: *laws,
        lubrication_gap: 0.001,
        time_span,
        springs: PairForces::default(),
        rolling_springs: PairForces::default(),
    };
    solve(configuration, &request, &NearFields::default()).unwrap()
}
