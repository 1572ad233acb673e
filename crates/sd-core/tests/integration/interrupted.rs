//! Interrupted runs, resumed from their snapshots, in layers and suspensions, under every contact
//! law, have the bits of uninterrupted ones.

use crate::common::schemes::{rigid, schemes, spring};
use sd_core::RunSpace;
use sd_core::internals::{ContactList, ContactMemory};
use sd_core::simulation::{Counters, SchemeMemory};
use sd_core::{
    Bulk, ContactLaws, ContactScheme, FrictionOnset, Hydrodynamics, Layer, LeadingOrder,
    NearFields, NormalLaw, Params, Simulation, Snapshot, Space, StiffnessUnit, TangentialLaw,
};

const FULL: Hydrodynamics = Hydrodynamics::StokesianDynamics;
const NEAR: Hydrodynamics = Hydrodynamics::BallMelrose;
const LUBRICATION: Hydrodynamics = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);

/// The paper's law, an onset of friction that others do not have, and the rest.
fn all_schemes() -> Vec<ContactScheme> {
    let reduced = ContactLaws {
        onset: FrictionOnset::Reduced,
        ..*rigid(TangentialLaw::Coulomb).laws()
    };
    let first = [ContactScheme::Rigid, ContactScheme::Laws(reduced)];
    first.into_iter().chain(schemes()).collect()
}

/// A small layer, or a larger one of which matrices are sparse.
fn layer(spheres: usize, contact: ContactScheme, hydrodynamics: Hydrodynamics) -> Params {
    let mut params = Params {
        spheres,
        ..crate::common::small_layer(contact, hydrodynamics)
    };
    params.canonicalise();
    params
}

/// The smallest dense suspension of two sizes.
fn suspension(contact: ContactScheme, hydrodynamics: Hydrodynamics) -> Params {
    let volume_fraction = if contact.laws().tangential == TangentialLaw::StickRotate {
        // Spheres under stick-rotate jam much earlier than others.
        0.4
    } else if hydrodynamics == FULL {
        0.45
    } else {
        0.5
    };
    Params::builder()
        .spheres(80)
        .volume_fraction(volume_fraction)
        .roughness(0.01)
        .friction(0.5)
        .shear_rate(20.0)
        .hydrodynamics(hydrodynamics)
        .contact(contact)
        .time_step(0.005)
        .two_sizes(1.2, 0.5)
        .build()
        .unwrap()
}

/// A start for runs with these parameters: sheared until spheres touch, under springs and
/// lubrication, which is cheapest.
fn sheared<S: RunSpace>(params: &Params) -> Snapshot<S> {
    let springs = ContactLaws {
        stiffness_unit: StiffnessUnit::Flow,
        ..*spring(1e4, TangentialLaw::Coulomb).laws()
    };
    let mut cheap = Params {
        contact: ContactScheme::Laws(springs),
        hydrodynamics: LUBRICATION,
        shear_rate: 20.0,
        shear_stress: None,
        ..params.clone()
    };
    cheap.canonicalise();
    let mut run = Simulation::<S>::new(&cheap, 5, &NearFields::default()).unwrap();
    for _ in 0..80 {
        run.step().unwrap();
    }
    Snapshot {
        memory: SchemeMemory::Laws(ContactMemory::default()),
        near_pairs: Vec::new(),
        counters: Counters::default(),
        ..run.snapshot()
    }
}

/// A run resumed from the text form of its snapshot.
fn resumed<S: RunSpace>(
    params: &Params,
    run: &Simulation<S>,
    tables: &NearFields,
) -> Simulation<S> {
    let snapshot: Snapshot<S> = serde_json::from_str(&text(&run.snapshot())).unwrap();
    Simulation::from_snapshot(params, snapshot, tables).unwrap()
}

/// All numbers, to the bit.
fn text(what: &impl serde::Serialize) -> String {
    serde_json::to_string(what).unwrap()
}

/// Runs from a start, once uninterrupted and once interrupted twice.
fn check<S: RunSpace>(params: &Params, start: &Snapshot<S>, tables: &NearFields) {
    let what = format!("{:?}, {:?}", params.hydrodynamics, params.contact);
    let mut start = start.clone();
    if params.contact == ContactScheme::Procedure {
        start.memory = SchemeMemory::Procedure {
            contact_list: ContactList::default(),
            velocities: Vec::new(),
        };
    }
    let mut whole = Simulation::from_snapshot(params, start, tables).unwrap();
    for _ in 0..5 {
        whole.step().unwrap();
    }
    let mut parts = resumed(params, &whole, tables);
    for step in 0..2 {
        if step == 1 {
            parts = resumed(params, &parts, tables);
        }
        let samples = [&mut whole, &mut parts].map(|run| text(&run.step().unwrap()));
        assert_eq!(samples[0], samples[1], "{what}");
    }
    let snapshot = whole.snapshot();
    assert_eq!(text(&snapshot), text(&parts.snapshot()), "{what}");
    if let SchemeMemory::Laws(memory) = &snapshot.memory {
        assert_eq!(snapshot.counters.unconverged_stages, 0, "{what}");
        check_memory(memory, params.contact.laws(), &what);
    }
}

/// Without this much memory the test would be void.
fn check_memory<S: Space>(memory: &ContactMemory<S>, laws: &ContactLaws, what: &str) {
    let none = S::Tangent::default();
    let any = |list: &[(u32, u32, S::Tangent)]| list.iter().any(|force| force.2 != none);
    let forces = &memory.warm_start.forces;
    let touches = laws.normal != NormalLaw::ExponentialRepulsion;
    assert_eq!(forces.iter().any(|f| f.3 != none), touches, "{what}");
    assert_eq!(
        forces.iter().filter(|f| f.2 > 0.0).count() > 5,
        touches,
        "{what}"
    );
    let (has_spring, rolls) = (laws.tangential.has_spring(), laws.rolling_friction > 0.0);
    assert_eq!(any(&memory.springs.forces.0), has_spring, "{what}");
    assert_eq!(any(&memory.warm_start.rolling.0), rolls, "{what}");
    let turned = any(&memory.rolling_springs.forces.0);
    assert_eq!(turned, rolls && has_spring, "{what}");
}

/// Checks all laws.
fn check_all<S: RunSpace>(
    schemes: Vec<ContactScheme>,
    hydrodynamics: &[Hydrodynamics],
    make: impl Fn(ContactScheme, Hydrodynamics) -> Params,
) {
    let tables = NearFields::default();
    // Spheres under stick-rotate have their own start.
    let mut starts: Vec<Snapshot<S>> = Vec::new();
    for contact in schemes {
        for &hydrodynamics in hydrodynamics {
            let params = make(contact, hydrodynamics);
            let (_, side) = sd_core::start::radii_and_side(&params).unwrap();
            let known = starts.iter().position(|start| start.side == side);
            let number = known.unwrap_or_else(|| {
                starts.push(sheared(&params));
                starts.len() - 1
            });
            check(&params, &starts[number], &tables);
        }
    }
}

#[test]
fn layers_go_on_with_the_same_bits() {
    let mut schemes = all_schemes();
    schemes.push(ContactScheme::Procedure);
    check_all::<Layer>(
        schemes,
        &[FULL, NEAR, LUBRICATION],
        |contact, hydrodynamics| layer(40, contact, hydrodynamics),
    );
}

#[test]
fn layers_of_sparse_matrices_resume_with_the_same_bits() {
    check_all::<Layer>(
        all_schemes(),
        &[FULL, NEAR, LUBRICATION],
        |contact, hydrodynamics| layer(130, contact, hydrodynamics),
    );
}

#[test]
fn suspensions_go_on_with_the_same_bits() {
    check_all::<Bulk>(all_schemes(), &[NEAR, LUBRICATION], suspension);
}

/// Three laws, as what the far field remembers is the same under every law; the layers above have
/// all of them.
#[test]
fn suspensions_in_full_stokesian_dynamics_resume_with_the_same_bits() {
    let schemes = vec![
        ContactScheme::Rigid,
        rigid(TangentialLaw::Coulomb),
        spring(1e4, TangentialLaw::StickSlide),
    ];
    check_all::<Bulk>(schemes, &[FULL], suspension);
}

/// These parameters under an imposed stress.
fn under_stress(params: Params) -> Params {
    Params {
        shear_rate: 0.0,
        shear_stress: Some(3.0),
        ..params
    }
}

#[test]
fn layers_under_an_imposed_stress_resume_with_the_same_bits() {
    let mut schemes = all_schemes();
    schemes.push(ContactScheme::Procedure);
    check_all::<Layer>(schemes, &[NEAR], |contact, hydrodynamics| {
        under_stress(layer(40, contact, hydrodynamics))
    });
}

#[test]
fn suspensions_under_an_imposed_stress_go_on_with_the_same_bits() {
    check_all::<Bulk>(
        all_schemes(),
        &[NEAR, LUBRICATION],
        |contact, hydrodynamics| under_stress(suspension(contact, hydrodynamics)),
    );
}
