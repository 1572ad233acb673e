//! Layers with the resistance stored pair by pair against the same layers with the full factor of
//! `R_FU`.

#![expect(
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test fails by panicking"
)]

use sd_core::Space as _;
use sd_core::cell::Cell;
use sd_core::contact::{Contact, ContactState, Laws, Surface};
use sd_core::internals::{
    ContactList, ContactMemory, IterativeFarField, Resistance, SolvePass, Span, StageContacts,
    StageSolver,
};
use sd_core::model::DEEPEST_OVERLAP;
use sd_core::modes::Vec2;
use sd_core::simulation::SchemeMemory;
use sd_core::{
    ContactLaws, ContactScheme, Error, FrictionOnset, Hydrodynamics, LeadingOrder, NearFields,
    NormalLaw, Params, Simulation, Snapshot, Strains, TangentialLaw, VelocityGradient,
};

/// Minimum number of spheres for pairwise storage.
const PAIRWISE: usize = 100;
/// Minimum number of spheres for an iterated far field.
const ITERATED: usize = 160;

fn params(spheres: usize, area_fraction: f64, friction: f64) -> Params {
    Params::builder()
        .spheres(spheres)
        .area_fraction(area_fraction)
        .roughness(0.01)
        .friction(friction)
        .shear_rate(100.0)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(ContactScheme::Rigid)
        .time_step(0.01)
        .build()
        .unwrap()
}

/// A layer after some steps, with cell and centres.
struct Layer {
    snapshot: Snapshot,
    cell: Cell,
    centres: Vec<Vec2>,
}

impl Layer {
    fn of(simulation: &Simulation) -> Self {
        let snapshot = simulation.snapshot();
        let offset = simulation.strain() * snapshot.side;
        let centres = snapshot.centres.iter().map(|&[x, y]| Vec2::new(x, y));
        Self {
            cell: Cell::equal_sides(snapshot.side, offset).unwrap(),
            centres: centres.collect(),
            snapshot,
        }
    }

    fn memory(&self) -> ContactMemory {
        match &self.snapshot.memory {
            SchemeMemory::Laws(memory) => memory.clone(),
            SchemeMemory::Procedure { .. } => panic!("a layer under laws"),
        }
    }
}

/// A layer sheared under rigid contacts.
fn sheared(params: &Params, steps: u64) -> Layer {
    let mut simulation =
        Simulation::<sd_core::Layer>::new(params, 5, &NearFields::default()).unwrap();
    while simulation.steps() < steps {
        simulation.step().unwrap();
    }
    Layer::of(&simulation)
}

/// A layer sheared further for some steps under given laws.
fn sheared_on(mut snapshot: Snapshot, params: &Params, steps: u64) -> Layer {
    snapshot.memory = SchemeMemory::Laws(ContactMemory::default());
    snapshot.near_pairs.clear();
    snapshot.far_field.clear();
    let mut simulation =
        Simulation::from_snapshot(params, snapshot, &NearFields::default()).unwrap();
    for _ in 0..steps {
        simulation.step().unwrap();
    }
    Layer::of(&simulation)
}

/// One stage of a layer, stored pair by pair or factored.
fn stage(layer: &Layer, laws: &Laws, lubrication_gap: f64, pairwise: bool) -> StageSolver {
    stage_under(
        Hydrodynamics::BallMelrose,
        layer,
        laws,
        (lubrication_gap, pairwise),
    )
}

/// A layer under other hydrodynamics.
fn stage_under(
    hydrodynamics: Hydrodynamics,
    layer: &Layer,
    laws: &Laws,
    (lubrication_gap, pairwise): (f64, bool),
) -> StageSolver {
    let (radii, tables) = (&layer.snapshot.radii, NearFields::default());
    let mut resistance = if pairwise {
        Resistance::new_pairwise(hydrodynamics, &layer.cell, radii, &tables, &[]).unwrap()
    } else {
        Resistance::new(hydrodynamics, &layer.cell, radii, &tables).unwrap()
    };
    if lubrication_gap > 0.0 || laws.is_soft() {
        resistance.regularise(lubrication_gap, DEEPEST_OVERLAP);
    }
    let mut stage = StageSolver::new(resistance);
    stage.assemble(&layer.cell, &layer.centres).unwrap();
    let contact = StageContacts::Laws {
        laws,
        span: Span::single(0.01),
        memory: &mut layer.memory(),
    };
    let quality = stage
        .solve(
            &VelocityGradient::simple_shear(1.0).into(),
            &[],
            contact,
            SolvePass::First,
        )
        .unwrap();
    assert!(quality.converged(), "{laws:?}: {quality:?}");
    stage
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Compares velocities, forces and states; `limits`: of velocities and of forces, each over the
/// largest. Returns how many contacts have friction.
fn compare(
    found: &StageSolver,
    expected: &StageSolver,
    limits: [f64; 2],
    what: &dyn std::fmt::Debug,
) -> usize {
    let fastest = largest(expected.velocities().iter().copied());
    let pairs = found.velocities().iter().zip(expected.velocities());
    let error = largest(pairs.map(|(a, b)| a - b));
    assert!(
        error < limits[0] * fastest,
        "{what:?}: {error:e} of {fastest}"
    );
    let most = largest(expected.contacts.list.iter().map(|c| c.normal_force));
    let limit = limits[1] * most;
    let mut frictional = 0;
    for c in &expected.contacts.list {
        let same = |o: &&Contact| o.pair.key() == c.pair.key();
        let Some(other) = found.contacts.list.iter().find(same) else {
            // A candidate that the other layer did not include.
            assert!(c.normal_force <= limit, "{what:?}: {c:?}");
            continue;
        };
        let off = [
            other.normal_force - c.normal_force,
            other.tangential_force - c.tangential_force,
        ];
        assert!(largest(off) < limit, "{what:?}: {off:?} of {most}, {c:?}");
        if c.normal_force > limit {
            assert_eq!(other.state, c.state, "{what:?}: {c:?}");
        }
        frictional += usize::from(c.state != ContactState::Frictionless);
    }
    frictional
}

#[test]
fn velocities_forces_and_states_are_those_of_the_factored_layer() {
    for (area_fraction, friction, steps, load, limit) in [
        (0.75, 0.3, 40, 0.2, 1e-6),
        (0.75, 0.3, 40, 40.0, 1e-6),
        (0.75, 0.0, 40, 0.2, 1e-6),
        // Near jamming forces of 10³ meet the compliance that only the factored layer has: 1e-7 of
        // the velocities, amplified.
        (0.8, 1.0, 60, 0.2, 1e-5),
    ] {
        let layer = sheared(&params(PAIRWISE, area_fraction, friction), steps);
        let laws = Laws::rigid(Surface {
            roughness: 0.01,
            friction,
            critical_load: load,
        });
        let [expected, found] = [false, true].map(|pairwise| stage(&layer, &laws, 0.0, pairwise));
        let contacts = expected.contacts.list.iter();
        assert!(largest(contacts.map(|c| c.normal_force)) > 10.0);
        let what = (area_fraction, friction, load);
        let frictional = compare(&found, &expected, [limit, 10.0 * limit], &what);
        let loads = expected.contacts.list.iter().map(|c| c.normal_force);
        assert_eq!(
            frictional > 0,
            friction > 0.0,
            "{what:?}: largest load {}",
            largest(loads)
        );
    }
}

/// All compatible laws, with either onset; some with a repulsion, rolling friction or adhesion, and
/// the repulsion alone.
fn all_laws() -> Vec<ContactLaws> {
    let mut all = Vec::new();
    for (normal, stiffness) in [
        (NormalLaw::Rigid, f64::INFINITY),
        (NormalLaw::LinearSpring, 1e5),
        (NormalLaw::Hertz, 1e6),
    ] {
        for tangential in [
            TangentialLaw::RollSlip,
            TangentialLaw::StickSlide,
            TangentialLaw::Coulomb,
            TangentialLaw::StickRotate,
        ] {
            let rigid = normal == NormalLaw::Rigid;
            if rigid && tangential.has_spring() {
                continue;
            }
            for onset in [FrictionOnset::CriticalLoad, FrictionOnset::Reduced] {
                let repels = onset == FrictionOnset::Reduced;
                let soft = ContactLaws::linear_spring(stiffness, tangential, 0.01);
                all.push(ContactLaws {
                    normal,
                    onset,
                    dashpot: if normal == NormalLaw::Hertz { 2.0 } else { 0.0 },
                    lubrication_gap: if rigid && !repels { 0.0 } else { 0.001 },
                    repulsion: if repels { 1.0 } else { 0.0 },
                    repulsion_length: if repels { 0.02 } else { 0.0 },
                    ..soft
                });
            }
        }
    }
    for (normal, stiffness) in [
        (NormalLaw::Rigid, f64::INFINITY),
        (NormalLaw::LinearSpring, 1e5),
    ] {
        let rigid = normal == NormalLaw::Rigid;
        let tangential = if rigid {
            TangentialLaw::Coulomb
        } else {
            TangentialLaw::StickSlide
        };
        for (rolling_friction, adhesion) in [(0.1, 0.0), (0.1, 1.0)] {
            all.push(ContactLaws {
                normal,
                rolling_friction,
                adhesion,
                lubrication_gap: if rigid { 0.0 } else { 0.001 },
                ..ContactLaws::linear_spring(stiffness, tangential, 0.01)
            });
        }
    }
    all.push(ContactLaws {
        normal: NormalLaw::ExponentialRepulsion,
        repulsion: 1.0,
        repulsion_length: 0.02,
        lubrication_gap: 0.001,
        ..ContactLaws::PAPER
    });
    all
}

#[test]
fn every_law_gives_the_motion_and_forces_of_the_factored_layer() {
    laws_agree_under(Hydrodynamics::BallMelrose, 0.74);
}

#[test]
fn every_law_does_so_under_lubrication() {
    // Friction has several valid solutions in dense layers, and the methods may find different
    // ones: at 0.74 this happens for one of these laws.
    laws_agree_under(Hydrodynamics::Lubrication(LeadingOrder::DEFAULT), 0.68);
}

/// Compares both methods under every law, in layers that were sheared under it.
fn laws_agree_under(hydrodynamics: Hydrodynamics, area_fraction: f64) {
    for size_ratio in [1.0, 1.4] {
        // Spheres under stick-rotate jam much earlier than others.
        let at = |welds: bool| Params {
            size_ratio,
            hydrodynamics,
            area_fraction: if welds { 0.6 } else { area_fraction },
            ..params(PAIRWISE, 0.5, 0.3)
        };
        let [loose, dense] = [true, false].map(|welds| sheared(&at(welds), 40));
        for chosen in all_laws() {
            let welds = chosen.tangential == TangentialLaw::StickRotate;
            let chosen = ContactLaws {
                // Leading-order lubrication has its own regularisation.
                lubrication_gap: match hydrodynamics {
                    Hydrodynamics::Lubrication(_) => 0.0,
                    _ => chosen.lubrication_gap,
                },
                ..chosen
            };
            let params = Params {
                contact: ContactScheme::Laws(chosen),
                time_step: 0.0025,
                ..at(welds)
            };
            // Steps are counted, and the strain is steps times their size.
            let mut start = if welds { &loose } else { &dense }.snapshot.clone();
            start.steps *= 4;
            let layer = sheared_on(start, &params, 8);
            let laws = Laws::new(&chosen, params.surface());
            let gap = chosen.lubrication_gap;
            let [expected, found] = [false, true]
                .map(|pairwise| stage_under(hydrodynamics, &layer, &laws, (gap, pairwise)));
            let frictional = compare(&found, &expected, [1e-7; 2], &(size_ratio, chosen));
            let alone = chosen.normal == NormalLaw::ExponentialRepulsion;
            assert_eq!(frictional == 0, alone, "{chosen:?}");
            assert_eq!(found.distant.repulsive.is_empty(), chosen.repulsion == 0.0);
            for (a, b) in found
                .distant
                .repulsive
                .iter()
                .zip(&expected.distant.repulsive)
            {
                let off = (a.normal_force - b.normal_force).abs();
                assert!(off < 1e-7 * params.critical_load(), "{off:e}");
            }
        }
    }
}

#[test]
fn motion_without_contacts_and_products_are_those_of_the_factored_layer() {
    let layer = sheared(&params(PAIRWISE, 0.75, 0.3), 40);
    let [dense, pairwise] = [false, true].map(|pairwise| {
        let laws = Laws::rigid(params(PAIRWISE, 0.75, 0.3).surface());
        let mut stage = stage(&layer, &laws, 0.0, pairwise);
        let torques: Vec<f64> = (0..300).map(|k| f64::from(k).sin()).collect();
        stage.assemble(&layer.cell, &layer.centres).unwrap();
        let solved = stage.solve(
            &VelocityGradient::simple_shear(1.0).into(),
            &torques,
            StageContacts::None,
            SolvePass::First,
        );
        solved.unwrap();
        stage
    });
    for (a, b) in pairwise.velocities().iter().zip(dense.velocities()) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    let (mut forces, mut stresslets, mut work) = (Vec::new(), Vec::new(), Vec::new());
    let v = dense.velocities();
    dense
        .resistance
        .apply(v, Strains::none(), &mut work, &mut forces, &mut stresslets);
    let mut product = vec![0.0; 300];
    let pairwise = pairwise.resistance.pairwise().unwrap();
    pairwise.apply(v, &mut product, &mut Vec::new());
    for (a, b) in product.iter().zip(&forces) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}

#[test]
fn an_iterated_far_field_refuses_the_procedure() {
    let layer = sheared(&params(40, 0.6, 0.3), 1);
    let (radii, tables) = (&layer.snapshot.radii, NearFields::default());
    let near =
        Resistance::new_pairwise(Hydrodynamics::BallMelrose, &layer.cell, radii, &tables, &[])
            .unwrap();
    let far = IterativeFarField::new(&layer.cell, radii, 1e-6).unwrap();
    let mut stage = StageSolver::with_far_field(near, far);
    stage.assemble(&layer.cell, &layer.centres).unwrap();
    let contact = StageContacts::Procedure {
        surface: params(40, 0.6, 0.3).surface(),
        contact_list: &mut ContactList::default(),
    };
    let solved = stage.solve(
        &VelocityGradient::simple_shear(1.0).into(),
        &[],
        contact,
        SolvePass::First,
    );
    assert_eq!(solved.unwrap_err(), Error::ProcedureNeedsDense);
}

#[test]
fn a_run_resumed_has_the_same_bits() {
    let params = params(PAIRWISE, 0.75, 0.3);
    let tables = NearFields::default();
    let mut whole = Simulation::<sd_core::Layer>::new(&params, 2, &tables).unwrap();
    let mut patterns = Vec::new();
    let mut parts = Simulation::<sd_core::Layer>::new(&params, 2, &tables).unwrap();
    for step in 0..24 {
        if step % 5 == 3 {
            let stored = serde_json::to_string(&parts.snapshot()).unwrap();
            let snapshot: Snapshot = serde_json::from_str(&stored).unwrap();
            assert!(!snapshot.near_pairs.is_empty());
            patterns.push(snapshot.near_pairs.clone());
            parts = Simulation::from_snapshot(&params, snapshot, &tables).unwrap();
        }
        let (a, b) = (whole.step().unwrap(), parts.step().unwrap());
        assert_eq!(a.viscosity.to_bits(), b.viscosity.to_bits(), "step {step}");
    }
    assert_eq!(whole.snapshot(), parts.snapshot());
    patterns.dedup();
    assert!(patterns.len() > 1, "the pattern never changed");
}

#[test]
fn a_run_with_an_iterated_far_field_resumed_has_the_same_bits() {
    let params = Params {
        hydrodynamics: Hydrodynamics::StokesianDynamics,
        ..params(ITERATED, 0.70, 0.3)
    };
    let tables = NearFields::default();
    let mut whole = Simulation::<sd_core::Layer>::new(&params, 2, &tables).unwrap();
    let first = whole.step().unwrap();
    for _ in 0..9 {
        whole.step().unwrap();
    }
    let stored = serde_json::to_string(&whole.snapshot()).unwrap();
    let snapshot: Snapshot = serde_json::from_str(&stored).unwrap();
    assert_eq!(snapshot.far_field.len(), 12 * ITERATED + 4);
    let mut rest = Simulation::from_snapshot(&params, snapshot.clone(), &tables).unwrap();
    let (a, b) = (whole.step().unwrap(), rest.step().unwrap());
    assert_eq!(a, b);
    let torn = Snapshot {
        far_field: snapshot.far_field[1..].to_vec(),
        ..snapshot
    };
    assert!(Simulation::from_snapshot(&params, torn, &tables).is_err());
    assert_eq!(whole.snapshot(), rest.snapshot());
    assert!(
        a.contacts > 0 && a.counters.unconverged_stages == 0,
        "{a:?}"
    );
    assert!(first.viscosity > 1.0 + 5.0 / 3.0 * 0.70);
}

#[test]
fn a_layer_too_large_for_matrices_of_contacts_moves_as_the_factored_one_and_resumes_to_the_bit() {
    let springs = ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01);
    let tables = NearFields::default();
    for contact in [ContactScheme::Laws(springs), ContactScheme::Rigid] {
        let params = Params {
            contact,
            shear_rate: 1.0,
            ..params(Params::LARGE_ABOVE + 1, 0.70, 0.3)
        };
        let mut whole = Simulation::<sd_core::Layer>::new(&params, 2, &tables).unwrap();
        for _ in 0..30 {
            whole.step().unwrap();
        }
        let layer = Layer::of(&whole);
        let mut rest = Simulation::from_snapshot(&params, whole.snapshot(), &tables).unwrap();
        let last = whole.step().unwrap();
        assert_eq!(last, rest.step().unwrap());
        assert_eq!(whole.snapshot(), rest.snapshot());
        assert_eq!(last.counters.unconverged_stages, 0, "{last:?}");
        let laws = Laws::new(params.contact.laws(), params.surface());
        let [expected, found] = [false, true].map(|pairwise| stage(&layer, &laws, 0.0, pairwise));
        assert!(compare(&found, &expected, [1e-6, 1e-5], &contact) > 100);
    }
}

#[test]
fn a_large_layer_satisfies_its_conditions_near_jamming() {
    let params = params(PAIRWISE, 0.8, 1.0);
    let layer = sheared(&params, 25);
    let counters = layer.snapshot.counters;
    assert_eq!(counters.unconverged_stages, 0, "{counters:?}");
    assert!(counters.minimum_gap >= 0.95 * 0.01);
    let stage = stage(&layer, &Laws::rigid(params.surface()), 0.0, true);
    let contacts = &stage.contacts.list;
    let carrying = contacts.iter().filter(|c| c.normal_force > 0.0).count();
    assert!(carrying > PAIRWISE, "{carrying}");
    let largest = contacts.iter().fold(0.0, |m: f64, c| m.max(c.normal_force));
    let (mut forces, mut stresslets, mut work) = (Vec::new(), Vec::new(), Vec::new());
    let strain = VelocityGradient::<sd_core::Layer>::simple_shear(1.0).strain();
    stage.resistance.apply(
        stage.velocities(),
        Strains::Uniform(strain),
        &mut work,
        &mut forces,
        &mut stresslets,
    );
    for c in contacts {
        let excess = c.pair.gap - 0.01;
        let share = if excess < 0.0 { 0.2 } else { 1.0 };
        let w = c.normal_velocity + share * excess / 0.01;
        assert!(w > -1e-6 && c.normal_force >= 0.0, "{c:?}");
        assert!(w < 1e-8 || c.normal_force == 0.0, "{c:?}");
        assert!(c.tangential_force.abs() <= c.normal_force + 1e-7 * largest);
        // Contact forces on the spheres must balance the resistance of the fluid.
        let (n, t) = (c.pair.normal, sd_core::Layer::tangents(&c.pair.normal)[0]);
        let on_j = n * c.normal_force - t * c.tangential_force;
        for (sphere, lever, sign) in [(c.pair.i, c.levers[0], -1.0), (c.pair.j, c.levers[1], 1.0)] {
            forces[3 * sphere] -= sign * on_j.x;
            forces[3 * sphere + 1] -= sign * on_j.y;
            forces[3 * sphere + 2] -= lever * c.tangential_force;
        }
    }
    let left = forces.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
    assert!(left < 1e-6 * largest, "{left} of {largest}");
}
