//! A step allocates nothing, unless it has more contacts than any before or makes a new pattern of
//! sparse matrices.
//!
//! The first steps are left out, in which the network of contacts grows.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use sd_core::RunSpace;
use sd_core::{
    Bulk, ContactLaws, ContactScheme, FrictionOnset, Hydrodynamics, Layer, LeadingOrder,
    NearFields, NormalLaw, Params, Simulation, StiffnessUnit, TangentialLaw, memory_bytes,
};

/// A layer in which spheres touch.
fn layer(hydrodynamics: Hydrodynamics, contact: ContactScheme) -> Params {
    // Spheres under stick-rotate jam much earlier than others.
    let welds = contact.laws().tangential == TangentialLaw::StickRotate;
    Params::builder()
        .spheres(40)
        .area_fraction(if welds { 0.5 } else { 0.65 })
        .roughness(0.01)
        .friction(0.3)
        .shear_rate(100.0)
        .hydrodynamics(hydrodynamics)
        .contact(contact)
        .time_step(0.005)
        .build()
        .unwrap()
}

/// A suspension in which spheres touch.
fn suspension(hydrodynamics: Hydrodynamics, contact: ContactScheme) -> Params {
    let welds = contact.laws().tangential == TangentialLaw::StickRotate;
    let mut params = Params {
        spheres: 80,
        area_fraction: 0.0,
        volume_fraction: Some(if welds { 0.4 } else { 0.5 }),
        friction: 0.5,
        shear_rate: 20.0,
        size_ratio: 1.2,
        ..layer(hydrodynamics, contact)
    };
    params.canonicalise();
    params
}

/// Checks the steps of a layer after the first ones: few have more contacts than any before.
fn check_dense(hydrodynamics: Hydrodynamics, contact: ContactScheme) {
    check_layer(&layer(hydrodynamics, contact), 100);
}

/// Likewise with these parameters, under which there are more than so many contacts.
fn check_layer(params: &Params, least: u32) {
    let mut simulation = Simulation::<Layer>::new(params, 3, &NearFields::default()).unwrap();
    while simulation.steps() < 90 {
        simulation.step().unwrap();
    }
    let (mut contacts, mut allocating) = (0, Vec::new());
    while simulation.steps() < 190 {
        let info = allocation_counter::measure(|| {
            contacts += simulation.step().unwrap().contacts;
        });
        if info.count_total > 0 {
            allocating.push((simulation.steps(), info.count_total));
        }
    }
    assert!(contacts > least, "{contacts} contacts are no test");
    assert!(allocating.len() <= 20, "{params:?}: {allocating:?}");
}

/// Brownian spheres at a rate, and under a stress.
fn brownian(params: &Params) -> [Params; 2] {
    let at_rate = Params {
        peclet: 100.0,
        ..params.clone()
    };
    let under_stress = Params {
        shear_rate: 0.0,
        shear_stress: Some(5.0),
        ..at_rate.clone()
    };
    [at_rate, under_stress]
}

#[test]
fn steps_of_brownian_spheres_allocate_nothing() {
    // Their contacts are collisions, of one step each, and fewer.
    for hydrodynamics in [Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics] {
        for params in brownian(&layer(hydrodynamics, ContactScheme::Rigid)) {
            check_layer(&params, 20);
        }
    }
    for params in brownian(&suspension(
        Hydrodynamics::BallMelrose,
        ContactScheme::Rigid,
    )) {
        check_pairwise::<Bulk>(&params, 50);
    }
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
        // Clusters that neither slip nor roll carry large loads: softer springs would let them
        // overlap.
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
            check_dense(hydrodynamics, contact);
        }
    }
    // The procedure lets spheres overlap sooner under it.
    let lubrication = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);
    check_dense(lubrication, ContactScheme::Rigid);
}

#[test]
fn springs_with_lubrication_allocate_nothing() {
    let laws = ContactLaws {
        stiffness_unit: StiffnessUnit::Flow,
        onset: FrictionOnset::Reduced,
        lubrication_gap: 0.0,
        ..ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01)
    };
    let hydrodynamics = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);
    check_dense(hydrodynamics, ContactScheme::Laws(laws));
}

#[test]
fn other_laws_allocate_nothing() {
    for laws in other_laws() {
        check_dense(Hydrodynamics::BallMelrose, ContactScheme::Laws(laws));
    }
}

/// Checks the steps of a run whose resistance is stored pair by pair. A step allocates only where
/// it makes a new pattern of near pairs, or has more pairs or contacts than any before.
fn check_pairwise<S: RunSpace>(params: &Params, least: u32) {
    let mut simulation = Simulation::<S>::new(params, 3, &NearFields::default()).unwrap();
    while simulation.steps() < 60 {
        simulation.step().unwrap();
    }
    let (mut contacts, mut kept) = (0, Vec::new());
    for _ in 0..25 {
        let pattern = simulation.snapshot().near_pairs;
        assert!(!pattern.is_empty());
        let info = allocation_counter::measure(|| {
            contacts += simulation.step().unwrap().contacts;
        });
        if simulation.snapshot().near_pairs == pattern {
            kept.push(info.count_total);
        }
    }
    assert!(contacts > least, "{contacts} contacts are no test");
    let allocating = kept.iter().filter(|&&count| count > 0).count();
    assert!(
        kept.len() >= 15 && 3 * allocating <= kept.len(),
        "{:?}: {kept:?}",
        params.contact
    );
}

#[test]
fn steps_that_keep_their_pattern_allocate_nothing() {
    let mut large = layer(Hydrodynamics::BallMelrose, ContactScheme::Rigid);
    large.spheres = 130;
    check_pairwise::<Layer>(&large, 100);
    let coulomb = ContactScheme::Laws(other_laws()[0]);
    for hydrodynamics in [Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics] {
        check_pairwise::<Bulk>(&suspension(hydrodynamics, coulomb), 100);
    }
}

#[test]
fn steps_of_suspensions_that_keep_their_pattern_allocate_nothing_under_every_law() {
    let laws = other_laws().into_iter().map(ContactScheme::Laws);
    for contact in laws.chain([ContactScheme::Rigid]) {
        let lubrication = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);
        check_pairwise::<Bulk>(&suspension(lubrication, contact), 100);
    }
}

#[test]
fn suspensions_take_no_more_memory_than_is_estimated_and_not_far_less() {
    let coulomb = ContactScheme::Laws(other_laws()[0]);
    let springs = ContactScheme::Laws(ContactLaws::linear_spring(
        1e4,
        TangentialLaw::StickSlide,
        0.01,
    ));
    let lubrication = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);
    for (spheres, hydrodynamics, contact, steps) in [
        (200, lubrication, springs, 100),
        (200, Hydrodynamics::BallMelrose, coulomb, 60),
        (200, Hydrodynamics::StokesianDynamics, coulomb, 4),
    ] {
        let params = Params {
            spheres,
            ..suspension(hydrodynamics, contact)
        };
        let tables = NearFields::default();
        // Tables are shared between runs.
        drop(Simulation::<Bulk>::new(&params, 3, &tables).unwrap());
        let info = allocation_counter::measure(|| {
            let mut run = Simulation::<Bulk>::new(&params, 3, &tables).unwrap();
            while run.steps() < steps {
                run.step().unwrap();
            }
        });
        let share = info.bytes_max as f64 / memory_bytes(&params);
        assert!((0.3..1.0).contains(&share), "{hydrodynamics:?}: {share}");
    }
}
