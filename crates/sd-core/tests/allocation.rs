//! Steps of a run that has settled allocate nothing.
//!
//! Buffers are reserved for as many pairs and contacts as a layer can have. The first steps are left out: until friction acts
//! some of the products that size the workspace of the matrix multiplication have not been called yet.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use sd_core::{
    ContactLaws, ContactScheme, FrictionOnset, Hydrodynamics, LeadingOrder, NearFields, NormalLaw,
    Params, Simulation, StiffnessUnit, TangentialLaw,
};

/// Allocations in 200 steps after the first ones.
fn allocations(
    spheres: usize,
    hydrodynamics: Hydrodynamics,
    contact: ContactScheme,
    steps: u64,
) -> u64 {
    // Spheres that weld together jam far earlier than others.
    let welds = contact.laws().tangential == TangentialLaw::StickRotate;
    let params = Params {
        spheres,
        area_fraction: if welds { 0.5 } else { 0.65 },
        roughness: 0.01,
        friction: 0.3,
        shear_rate: 100.0,
        size_ratio: 1.0,
        large_fraction: 0.5,
        hydrodynamics,
        contact,
        time_step: 0.005,
        ..Params::UNWRITTEN
    };
    let mut simulation =
        Simulation::<sd_core::Layer>::new(&params, 3, &NearFields::default()).unwrap();
    while simulation.steps() < steps {
        simulation.step().unwrap();
    }
    let mut contacts = 0;
    let info = allocation_counter::measure(|| {
        for _ in 0..150 {
            contacts += simulation.step().unwrap().contacts;
        }
    });
    assert!(contacts > 100, "{contacts} contacts are no test");
    info.count_total
}

/// Laws other than the paper's.
fn other_laws() -> Vec<ContactLaws> {
    let rigid = |tangential| ContactLaws {
        tangential,
        ..ContactLaws::PAPER
    };
    let spring = |tangential| ContactLaws::linear_spring(1e4, tangential, 0.01);
    vec![
        rigid(TangentialLaw::Coulomb),
        rigid(TangentialLaw::StickRotate),
        spring(TangentialLaw::RollSlip),
        spring(TangentialLaw::Coulomb),
        // Clusters that neither slip nor roll bear much: softer springs would let them overlap.
        ContactLaws::linear_spring(1e6, TangentialLaw::StickRotate, 0.01),
        spring(TangentialLaw::StickSlide),
        ContactLaws {
            rolling_friction: 0.1,
            adhesion: 1.0,
            ..rigid(TangentialLaw::Coulomb)
        },
        ContactLaws {
            rolling_friction: 0.1,
            adhesion: 1.0,
            ..spring(TangentialLaw::StickSlide)
        },
        ContactLaws {
            normal: NormalLaw::Hertz,
            repulsion: 1.0,
            repulsion_length: 0.02,
            ..spring(TangentialLaw::StickSlide)
        },
    ]
}

#[test]
fn steps_of_settled_runs_allocate_nothing() {
    for hydrodynamics in [Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics] {
        for contact in [ContactScheme::Rigid, ContactScheme::Procedure] {
            let count = allocations(40, hydrodynamics, contact, 40);
            assert_eq!(count, 0, "{hydrodynamics:?}, {contact:?}");
        }
    }
    // The procedure lets spheres overlap sooner under it.
    let lubrication = Hydrodynamics::Lubrication(LeadingOrder::USUAL);
    assert_eq!(allocations(40, lubrication, ContactScheme::Rigid, 40), 0);
}

#[test]
fn springs_with_lubrication_allocate_nothing() {
    let laws = ContactLaws {
        stiffness_unit: StiffnessUnit::Flow,
        onset: FrictionOnset::Reduced,
        lubrication_gap: 0.0,
        ..ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01)
    };
    let hydrodynamics = Hydrodynamics::Lubrication(LeadingOrder::USUAL);
    assert_eq!(
        allocations(40, hydrodynamics, ContactScheme::Laws(laws), 40),
        0
    );
}

#[test]
fn other_laws_allocate_nothing() {
    for laws in other_laws() {
        let contact = ContactScheme::Laws(laws);
        let count = allocations(40, Hydrodynamics::BallMelrose, contact, 40);
        assert_eq!(count, 0, "{laws:?}");
    }
}
