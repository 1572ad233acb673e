//! Contacts and runs in three dimensions: agreement with layers, symmetries, laws of friction on a
//! disc, and resumed runs.

mod contacts;
mod runs;

use crate::common::schemes::rigid_springs;
use sd_core::model::Surface;
use sd_core::{
    Bulk, ContactLaws, ContactScheme, FrictionOnset, Hydrodynamics, LeadingOrder, NearFields,
    NormalLaw, Params, Simulation, StiffnessUnit, TangentialLaw,
};

/// Leading-order lubrication with default parameters.
const LUBRICATION: Hydrodynamics = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);

/// Rigid contacts with another tangential law than the paper's.
fn rigid(tangential: TangentialLaw) -> ContactLaws {
    ContactLaws {
        tangential,
        ..ContactLaws::PAPER
    }
}

/// Springs whose stiffness is in units of the flow.
fn springs(tangential: TangentialLaw) -> ContactLaws {
    ContactLaws {
        stiffness_unit: StiffnessUnit::Flow,
        ..ContactLaws::linear_spring(1e4, tangential, 0.01)
    }
}

/// Laws of every kind.
fn laws() -> Vec<(&'static str, ContactLaws)> {
    vec![
        ("rigid roll-slip", ContactLaws::PAPER),
        ("rigid coulomb", rigid(TangentialLaw::Coulomb)),
        ("rigid stick-rotate", rigid(TangentialLaw::StickRotate)),
        (
            "rigid coulomb, rolling friction, adhesion",
            ContactLaws {
                rolling_friction: 0.1,
                adhesion: 0.5,
                ..rigid(TangentialLaw::Coulomb)
            },
        ),
        (
            "rigid stick-slide, rolling friction",
            ContactLaws {
                rolling_friction: 0.1,
                stiffness_unit: StiffnessUnit::Flow,
                ..*rigid_springs(1e3).laws()
            },
        ),
        ("springs, stick-slide", springs(TangentialLaw::StickSlide)),
        ("springs, coulomb", springs(TangentialLaw::Coulomb)),
        ("springs, roll-slip", springs(TangentialLaw::RollSlip)),
        (
            "springs, reduced onset, rolling friction, dashpot",
            ContactLaws {
                onset: FrictionOnset::Reduced,
                rolling_friction: 0.1,
                dashpot: 1.0,
                ..springs(TangentialLaw::StickSlide)
            },
        ),
        (
            "hertz, repulsion",
            ContactLaws {
                normal: NormalLaw::Hertz,
                repulsion: 1.0,
                repulsion_length: 0.02,
                ..springs(TangentialLaw::StickSlide)
            },
        ),
    ]
}

/// A small dense suspension of two sizes.
fn params(laws: ContactLaws, hydrodynamics: Hydrodynamics) -> Params {
    Params::builder()
        .spheres(120)
        .volume_fraction(0.5)
        .roughness(0.01)
        .friction(0.5)
        .shear_rate(20.0)
        .hydrodynamics(hydrodynamics)
        .contact(ContactScheme::Laws(laws))
        .time_step(0.005)
        .two_sizes(1.4, 0.26)
        .build()
        .unwrap()
}

/// Roughness and friction without a critical load.
fn surface(friction: f64) -> Surface {
    Surface {
        roughness: 0.01,
        friction,
        critical_load: 0.0,
    }
}

/// A suspension that was sheared for some steps.
fn sheared(params: &Params, steps: u64) -> Simulation<Bulk> {
    let mut suspension = Simulation::<Bulk>::new(params, 1, &NearFields::default()).unwrap();
    while suspension.steps() < steps {
        suspension.step().unwrap();
    }
    suspension
}
