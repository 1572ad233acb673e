//! Laws of contact other than the paper's: what must hold for each of them.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use sd_core::cell::Cell;
use sd_core::contact::laws::{Laws, NormalForce, Phase, Span};
use sd_core::contact::warm_start::SpringForces;
use sd_core::contact::{Contact, ContactMemory, ContactState, Surface};
use sd_core::instant::{Configuration, ContactRequest, SolvedConfiguration, solve};
use sd_core::law::repulsion::ExponentialRepulsion;
use sd_core::model::DEEPEST_OVERLAP;
use sd_core::modes::{Background, Vec2};
use sd_core::simulation::SchemeMemory;
use sd_core::{
    ContactLaws, ContactScheme, Flow, FrictionOnset, Hydrodynamics, NearFields, NormalLaw, Params,
    Resistance, Rosenbrock, Simulation, Snapshot, StageContact, StageSolver, State, TangentialLaw,
};

const RIGID: NormalForce = NormalForce {
    law: NormalLaw::Rigid,
    stiffness: f64::INFINITY,
    dashpot: 0.0,
};
const SPRING: NormalForce = NormalForce {
    law: NormalLaw::LinearSpring,
    stiffness: 2000.0,
    dashpot: 0.0,
};
const HERTZ: NormalForce = NormalForce {
    law: NormalLaw::Hertz,
    stiffness: 40_000.0,
    dashpot: 0.0,
};

/// Overlap at which a law bears a force.
fn overlap(normal: NormalForce, force: f64) -> f64 {
    normal.law.overlap(force, normal.stiffness)
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
    }
}

/// Tangential springs of a stiffness that slide.
fn stick_slide(normal: NormalForce, stiffness: f64, friction: f64) -> Laws {
    Laws {
        tangential_stiffness: stiffness,
        ..laws(normal, TangentialLaw::StickSlide, friction)
    }
}

/// Two spheres of radii 1 and 1.4 alone, along a slanted line of centres, pushed by `push` each towards the other and by `shear` across.
fn pair(gap: f64, push: f64, shear: f64) -> Configuration {
    let n = Vec2::new(0.8, 0.6);
    let force = n * push + Vec2::new(-n.y, n.x) * shear;
    Configuration {
        centres: vec![Vec2::zeros(), n * (2.4 + gap)],
        radii: vec![1.0, 1.4],
        cell: Cell::Unbounded,
        hydrodynamics: Hydrodynamics::StokesianDynamics,
        background: Background::QUIESCENT,
        forces: vec![force, -force],
        torques: vec![0.0; 2],
    }
}

fn solved(configuration: &Configuration, laws: &Laws, time_span: f64) -> SolvedConfiguration {
    let request = ContactRequest::Laws {
        laws: *laws,
        lubrication_gap: 0.001,
        time_span,
        springs: SpringForces::default(),
    };
    solve(configuration, &request, &NearFields::default()).unwrap()
}

#[test]
fn pressed_pair_is_in_exact_balance() {
    for (normal, overlap) in [(SPRING, 5.0 / 2000.0), (HERTZ, overlap(HERTZ, 5.0))] {
        for time_span in [1e-4, 0.01] {
            let at_rest = pair(0.01 - overlap, 5.0, 0.0);
            let instant = solved(
                &at_rest,
                &laws(normal, TangentialLaw::Coulomb, 0.5),
                time_span,
            );
            let c = instant.contacts[0];
            assert!((c.normal_force - 5.0).abs() < 1e-8, "{normal:?}: {c:?}");
            assert!(c.normal_velocity.abs() < 1e-8);
            // Opposite forces of equal size move a touching pair nowhere.
            assert!(
                instant
                    .disturbances
                    .iter()
                    .flatten()
                    .all(|v| v.abs() < 1e-8)
            );
        }
    }
    // A repulsion alone: F0 exp(-g/l) = 5 at g = l ln(F0/5).
    let repulsion = ExponentialRepulsion {
        force: 20.0,
        length: 0.02,
    };
    let alone = Laws {
        repulsion: Some(repulsion),
        ..laws(
            NormalForce {
                law: NormalLaw::ExponentialRepulsion,
                ..RIGID
            },
            TangentialLaw::Coulomb,
            0.0,
        )
    };
    let instant = solved(&pair(0.02 * 4.0_f64.ln(), 5.0, 0.0), &alone, 0.01);
    assert!(instant.contacts.is_empty());
    assert!(
        instant
            .disturbances
            .iter()
            .flatten()
            .all(|v| v.abs() < 1e-10)
    );
}

#[test]
fn dashpot_adds_its_share_and_never_pulls() {
    let damped = |dashpot| {
        let normal = NormalForce { dashpot, ..SPRING };
        laws(normal, TangentialLaw::Coulomb, 0.0)
    };
    let approaching = solved(&pair(0.009, 10.0, 0.0), &damped(300.0), 1e-9).contacts[0];
    let expected = 2000.0 * 0.001 - 300.0 * approaching.normal_velocity;
    assert!(approaching.normal_velocity < 0.0);
    assert!((approaching.normal_force - expected).abs() < 1e-5);
    // Pulled apart faster than the spring follows.
    let parting = solved(&pair(0.009, -1e4, 0.0), &damped(300.0), 1e-9).contacts[0];
    assert_eq!(parting.normal_force, 0.0);
}

#[test]
fn coulomb_sticks_without_slip_inside_the_cone_and_slides_on_it() {
    for normal in [RIGID, SPRING, HERTZ] {
        let gap = if normal == RIGID { 0.01 } else { 0.008 };
        let at = |friction, shear| {
            solved(
                &pair(gap, 5.0, shear),
                &laws(normal, TangentialLaw::Coulomb, friction),
                0.001,
            )
            .contacts[0]
        };
        let stuck = at(1.0, 1.0);
        assert_eq!(stuck.state, ContactState::Rolling);
        assert!(stuck.slip_velocity.abs() < 1e-8, "{stuck:?}");
        assert!(stuck.tangential_force.abs() < stuck.normal_force);
        let sliding = at(0.1, 4.0);
        assert_eq!(sliding.state, ContactState::Slipping);
        assert!((sliding.tangential_force.abs() - 0.1 * sliding.normal_force).abs() < 1e-12);
        assert!(sliding.tangential_force * sliding.slip_velocity > 0.0);
    }
}

#[test]
fn stick_rotate_turns_a_pressed_pair_as_one_body() {
    for normal in [RIGID, SPRING] {
        let gap = if normal == RIGID { 0.01 } else { 0.0075 };
        let instant = solved(
            &pair(gap, 5.0, 3.0),
            &laws(normal, TangentialLaw::StickRotate, 1.0),
            0.001,
        );
        let c = instant.contacts[0];
        assert!(c.normal_force > 1.0 && c.slip_velocity.abs() < 1e-8);
        let [first, second] = [instant.disturbances[0], instant.disturbances[1]];
        assert!(first[2].abs() > 0.01 && (first[2] - second[2]).abs() < 1e-8);
        // Rigid: the centres turn about each other at the rate at which the spheres do.
        let across = Vec2::new(second[0] - first[0], second[1] - first[1])
            .dot(&Vec2::new(-c.pair.normal.y, c.pair.normal.x));
        assert!((across - first[2] * c.pair.distance).abs() < 1e-7);
        // Pulled apart, they part and turn freely.
        let parting = solved(
            &pair(gap, -5.0, 3.0),
            &laws(normal, TangentialLaw::StickRotate, 1.0),
            1e-6,
        );
        if normal == RIGID {
            assert_eq!(parting.contacts[0].tangential_force, 0.0);
        }
    }
}

#[test]
fn onset_takes_the_load_off_or_jumps() {
    let at = |onset, critical_load| {
        let mut laws = laws(RIGID, TangentialLaw::Coulomb, 0.2);
        laws.onset = onset;
        laws.surface.critical_load = critical_load;
        solved(&pair(0.01, 5.0, 4.0), &laws, 0.001).contacts[0]
    };
    let jumped = at(FrictionOnset::CriticalLoad, 3.0);
    assert!((jumped.tangential_force.abs() - 0.2 * jumped.normal_force).abs() < 1e-12);
    let reduced = at(FrictionOnset::Reduced, 3.0);
    let limit = 0.2 * (reduced.normal_force - 3.0);
    assert!((reduced.tangential_force.abs() - limit).abs() < 1e-12);
    for onset in [FrictionOnset::CriticalLoad, FrictionOnset::Reduced] {
        let none = at(onset, 6.0);
        assert_eq!(none.tangential_force, 0.0);
        assert_eq!(none.state, ContactState::Frictionless);
    }
}

/// A pair moved in time under constant forces along and across its line of centres.
struct Pushed {
    state: State,
    memory: ContactMemory,
    /// Work done by the forces, energy dissipated in the fluid and by friction: by the trapezoidal rule of the stages.
    work: f64,
    dissipated: f64,
    last: Contact,
}

/// Pushes a pair for some time in steps, from a gap; the forces turn with the frame only if `turn` does.
fn pushed(
    laws: &Laws,
    gap: f64,
    [push, shear]: [f64; 2],
    time: f64,
    steps: u32,
    turn: f64,
) -> Pushed {
    let (sine, cosine) = turn.sin_cos();
    let n = Vec2::new(cosine, sine);
    let radii = [1.0, 1.4];
    let mut resistance = Resistance::new(
        Hydrodynamics::StokesianDynamics,
        &Cell::Unbounded,
        &radii,
        &NearFields::default(),
    )
    .unwrap();
    resistance.regularise(0.001, DEEPEST_OVERLAP);
    let mut motion = StageSolver::new(resistance);
    let mut out = Pushed {
        state: State {
            centres: vec![Vec2::zeros(), n * (2.4 + gap)],
            orientations: vec![0.0; 2],
        },
        memory: ContactMemory::default(),
        work: 0.0,
        dissipated: 0.0,
        last: motion.contacts.list.first().copied().unwrap_or_else(|| {
            let c = solved(&pair(0.01, 5.0, 0.0), laws, 0.001);
            c.contacts.first().copied().unwrap()
        }),
    };
    let force = n * push + Vec2::new(-n.y, n.x) * shear;
    let external = [force.x, force.y, 0.0, -force.x, -force.y, 0.0];
    let mut first = Vec::new();
    let mut integrator = Rosenbrock::default();
    let dt = time / f64::from(steps);
    for _ in 0..steps {
        let (memory, last) = (&mut out.memory, &mut out.last);
        let (mut power, mut loss) = (0.0, 0.0);
        integrator
            .step(&mut out.state, 0.0, dt, |stage, centres, velocities| {
                let span = Span {
                    time: stage.span,
                    phase: [Phase::First, Phase::Second][stage.number],
                    first: &first,
                };
                let law = StageContact::Laws { laws, span, memory };
                motion.assemble(&Cell::Unbounded, centres)?;
                motion.solve(&Background::QUIESCENT, &external, law)?;
                if stage.number == 0 {
                    first = motion.velocities().to_vec();
                }
                velocities.copy_from_slice(motion.velocities());
                let of = |f: &[f64]| {
                    f.iter()
                        .zip(motion.velocities())
                        .map(|(f, v)| f * v)
                        .sum::<f64>()
                };
                power += 0.5 * of(&external);
                // What the fluid takes: all forces on the spheres times their velocities.
                let contacts = motion.contacts.list.iter().chain(&motion.repelled.pairs);
                let contact: f64 = contacts
                    .map(|c| {
                        c.normal_force * c.normal_velocity - c.tangential_force * c.slip_velocity
                    })
                    .sum();
                loss += 0.5 * (of(&external) + contact);
                if let Some(c) = motion.contacts.list.first() {
                    *last = *c;
                }
                Ok::<(), sd_core::Error>(())
            })
            .unwrap();
        out.work += power * dt;
        out.dissipated += loss * dt;
    }
    out
}

/// Gap of a pushed pair.
fn gap(p: &Pushed) -> f64 {
    (p.state.centres[1] - p.state.centres[0]).norm() - 2.4
}

#[test]
fn spring_stores_what_work_leaves_over() {
    // Released from an overlap and pushed back: what is stored is known from the gap alone.
    let repelled = Laws {
        repulsion: Some(ExponentialRepulsion {
            force: 20.0,
            length: 0.01,
        }),
        ..laws(SPRING, TangentialLaw::Coulomb, 0.0)
    };
    for laws in [
        laws(SPRING, TangentialLaw::Coulomb, 0.0),
        laws(HERTZ, TangentialLaw::Coulomb, 0.0),
        repelled,
    ] {
        let stored = |gap: f64| {
            let d = (0.01 - gap).max(0.0);
            let NormalForce { law, stiffness, .. } = laws.normal;
            let contact = match law {
                NormalLaw::LinearSpring => 0.5 * stiffness * d * d,
                NormalLaw::Hertz => 0.4 * stiffness * d.powf(2.5),
                NormalLaw::Rigid | NormalLaw::ExponentialRepulsion => 0.0,
            };
            contact + laws.repulsion.map_or(0.0, |r| r.energy(gap))
        };
        let mismatch = |steps: u32| {
            let p = pushed(&laws, 0.009, [30.0, 0.0], 0.3, steps, 0.3);
            (p.work - p.dissipated - stored(gap(&p)) + stored(0.009)).abs() / p.work
        };
        let (coarse, fine) = (mismatch(100), mismatch(200));
        let order = (coarse / fine).log2();
        assert!(
            fine < 1e-3 && order > 1.7,
            "{laws:?}: {fine:.1e}, order {order}"
        );
    }
}

#[test]
fn sticking_spring_stores_and_sliding_dissipates() {
    for (friction, slides) in [(2.0, false), (0.1, true)] {
        let laws = stick_slide(SPRING, 1000.0, friction);
        let start = 0.01 - 5.0 / 2000.0;
        let stored = |p: &Pushed| {
            let d = 0.01 - gap(p);
            let stretched = p.memory.springs.0[0].2;
            0.5 * 2000.0 * d * d + 0.5 * stretched * stretched / 1000.0
        };
        // Friction's own loss is the work of F_t on the slip beyond what the spring takes up.
        let balance = |steps: u32| {
            let shear = if slides { 4.0 } else { 1.0 };
            let p = pushed(&laws, start, [5.0, shear], 0.5, steps, 0.0);
            assert_eq!(p.last.state == ContactState::Slipping, slides);
            let cone = friction * p.last.normal_force * (1.0 + 1e-12);
            assert!(p.last.tangential_force.abs() <= cone);
            p.work - p.dissipated - stored(&p) + 0.5 * 2000.0 * (5.0_f64 / 2000.0).powi(2)
        };
        let fine = balance(400);
        if slides {
            assert!(fine > 1e-4, "sliding loses {fine}");
        } else {
            let order = (balance(200) / fine).abs().log2();
            assert!(
                fine.abs() < 1e-5 && order > 1.7,
                "{fine:.1e}, order {order}"
            );
        }
    }
}

#[test]
fn stick_slide_does_not_know_its_frame() {
    let laws = stick_slide(SPRING, 1000.0, 0.3);
    let at = |turn| pushed(&laws, 0.0075, [5.0, 2.0], 0.5, 100, turn);
    let (still, turned) = (at(0.0), at(1.1));
    let forces = |p: &Pushed| {
        let (_, _, f, _) = p.memory.warm_start.forces[0];
        (f, p.memory.springs.0[0].2)
    };
    let (a, b) = (forces(&still), forces(&turned));
    assert!(
        (a.0 - b.0).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-9,
        "{a:?} {b:?}"
    );
    assert!((gap(&still) - gap(&turned)).abs() < 1e-12);
    // Nor does it stretch where a pair turns as one body: the slip is what stretches it, and a rigid turn has none.
    let mut whole = pair(0.0075, 5.0, 0.0);
    whole.background = Background {
        angular_velocity: 0.7,
        ..Background::QUIESCENT
    };
    let c = solved(&whole, &laws, 0.001).contacts[0];
    assert!(c.slip_velocity.abs() < 1e-12 && c.tangential_force.abs() < 1e-9);
}

#[test]
fn order_in_time_is_two_and_stiffness_costs_no_steps() {
    let sliding = |stiffness: f64| {
        let normal = NormalForce {
            stiffness,
            ..SPRING
        };
        stick_slide(normal, 0.5 * stiffness, 0.5)
    };
    // From an overlap, so that no contact opens or closes within a step.
    let end = |stiffness: f64, steps| {
        let p = pushed(
            &sliding(stiffness),
            0.01 - 2.0 / stiffness,
            [5.0, 1.0],
            0.4,
            steps,
            0.4,
        );
        let (f, spring) = (p.memory.warm_start.forces[0].2, p.memory.springs.0[0].2);
        // Where the pair is and how far the spring is stretched; the normal force is that of a stage, and so of first order.
        ([gap(&p), spring / stiffness], f)
    };
    let distance = |(a, _): ([f64; 2], f64), (b, _): ([f64; 2], f64)| {
        (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
    };
    let exact = end(500.0, 3200);
    let order = (distance(end(500.0, 100), exact) / distance(end(500.0, 200), exact)).log2();
    assert!((order - 2.0).abs() < 0.2, "order {order}");
    // Steps 1e7 times as long as the time in which the spring relaxes: no worse than the turning of the pair makes them.
    let stiff = |steps| {
        let at = end(1e12, steps);
        ((at.0[0] - 0.01).abs(), (at.1 - 5.0).abs())
    };
    let errors = [10, 20, 40].map(stiff);
    for pair in errors.windows(2) {
        assert!(pair[1].0 < 0.3 * pair[0].0, "{errors:?}");
    }
    assert!(errors[0].0 < 1e-6 && errors[0].1 < 0.01, "{errors:?}");
}

#[test]
fn free_approach_meets_the_spring_without_overshoot() {
    // The contact closes within a step: the error is of second order in the step all the same, and the pair comes to rest where
    // spring and push balance.
    for normal in [SPRING, HERTZ] {
        let laws = laws(normal, TangentialLaw::Coulomb, 0.0);
        let rest = overlap(normal, 20.0);
        let p = pushed(&laws, 0.03, [20.0, 0.0], 40.0, 400, 0.0);
        assert!((gap(&p) - (0.01 - rest)).abs() < 1e-7, "{} {rest}", gap(&p));
    }
}

#[test]
fn friction_at_every_contact_needs_no_load() {
    // A contact below the critical load: with friction only where none is asked for.
    let light = |onset| {
        let choice = ContactLaws {
            onset,
            ..ContactLaws::linear_spring(1e4, TangentialLaw::Coulomb, 0.01)
        };
        let surface = Surface {
            roughness: 0.01,
            friction: 0.5,
            critical_load: 100.0,
        };
        let c = solved(&pair(0.00999, 5.0, 1.0), &Laws::new(&choice, surface), 0.01).contacts[0];
        assert!(c.normal_force > 0.0 && c.normal_force < 100.0, "{c:?}");
        c.state == ContactState::Frictionless
    };
    assert!(light(FrictionOnset::CriticalLoad) && light(FrictionOnset::Reduced));
    assert!(!light(FrictionOnset::Contact));
}

/// A small dense layer of two sizes.
fn params(contact: ContactScheme) -> Params {
    // Spheres that weld together jam far earlier than others.
    let welds = contact.laws().tangential == TangentialLaw::StickRotate;
    Params {
        spheres: 40,
        area_fraction: if welds { 0.5 } else { 0.7 },
        roughness: 0.01,
        friction: 0.5,
        shear_rate: 5.0,
        size_ratio: 1.4,
        large_fraction: 1.0 / 2.96,
        hydrodynamics: Hydrodynamics::BallMelrose,
        contact,
        time_step: 0.005,
        ..Params::UNWRITTEN
    }
}

fn spring(stiffness: f64, tangential: TangentialLaw) -> ContactScheme {
    ContactScheme::Laws(ContactLaws::linear_spring(stiffness, tangential, 0.01))
}

fn rigid(tangential: TangentialLaw) -> ContactScheme {
    ContactScheme::Laws(ContactLaws {
        tangential,
        ..ContactLaws::PAPER
    })
}

fn schemes() -> Vec<ContactScheme> {
    let hertz = |tangential| {
        ContactScheme::Laws(ContactLaws {
            normal: NormalLaw::Hertz,
            dashpot: 1.0,
            onset: FrictionOnset::Reduced,
            ..ContactLaws::linear_spring(1e5, tangential, 0.01)
        })
    };
    let repelling = |normal, stiffness, tangential| {
        ContactScheme::Laws(ContactLaws {
            normal,
            stiffness,
            repulsion: 1.0,
            repulsion_length: 0.02,
            ..ContactLaws::linear_spring(1e4, tangential, 0.01)
        })
    };
    let at_every_contact = || {
        ContactScheme::Laws(ContactLaws {
            onset: FrictionOnset::Contact,
            repulsion: 1.0,
            repulsion_length: 0.02,
            ..ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01)
        })
    };
    vec![
        rigid(TangentialLaw::Coulomb),
        rigid(TangentialLaw::StickRotate),
        spring(1e4, TangentialLaw::RollSlip),
        spring(1e4, TangentialLaw::StickSlide),
        spring(1e4, TangentialLaw::Coulomb),
        spring(1e4, TangentialLaw::StickRotate),
        hertz(TangentialLaw::RollSlip),
        hertz(TangentialLaw::StickSlide),
        repelling(
            NormalLaw::ExponentialRepulsion,
            f64::INFINITY,
            TangentialLaw::RollSlip,
        ),
        repelling(NormalLaw::LinearSpring, 1e4, TangentialLaw::StickSlide),
        at_every_contact(),
        repelling(NormalLaw::Rigid, f64::INFINITY, TangentialLaw::Coulomb),
    ]
}

fn run(params: &Params, seed: u64, steps: u64) -> Simulation {
    let mut simulation = Simulation::new(params, seed, &NearFields::default()).unwrap();
    for _ in 0..steps {
        simulation.step().unwrap();
    }
    assert_eq!(simulation.flow(), Flow::Flowing);
    simulation
}

#[test]
fn layers_keep_their_laws_under_every_choice() {
    for contact in schemes() {
        let params = params(contact);
        let laws = contact.laws();
        let mut simulation = run(&params, 3, 100);
        let load = params.critical_load();
        let (mut touching, mut rubbing) = (0, 0);
        for _ in 0..40 {
            let (sample, frame) = simulation.step_with_frame().unwrap();
            assert!(sample.viscosity > 1.0 + 5.0 / 3.0 * params.area_fraction);
            for c in &frame.contacts {
                touching += 1;
                rubbing += u32::from(c.tangential_force != 0.0);
                let beyond = match laws.onset {
                    FrictionOnset::CriticalLoad | FrictionOnset::Contact => c.normal_force,
                    FrictionOnset::Reduced => (c.normal_force - load).max(0.0),
                };
                assert!(c.normal_force > 0.0);
                if laws.tangential != TangentialLaw::StickRotate {
                    let limit = params.friction * beyond;
                    assert!(
                        c.tangential_force.abs() <= limit * (1.0 + 1e-9),
                        "{contact:?} {c:?}"
                    );
                }
            }
        }
        let counters = simulation.counters();
        assert_eq!(counters.unconverged_stages, 0, "{contact:?}");
        assert!(counters.worst_residual < 1e-8, "{contact:?}");
        // Four and one for the sample, or two.
        assert_eq!(counters.stages, 140 * if laws.is_soft() { 2 } else { 5 });
        let alone = laws.normal == NormalLaw::ExponentialRepulsion;
        assert_eq!(touching == 0, alone, "{contact:?}");
        assert_eq!(rubbing == 0, alone, "{contact:?}");
    }
}

#[test]
fn resumed_run_has_the_same_bits_under_every_choice() {
    for contact in schemes() {
        let params = params(contact);
        let tables = NearFields::default();
        let mut whole = run(&params, 5, 60);
        let text = serde_json::to_string(&whole.snapshot()).unwrap();
        let restored: Snapshot = serde_json::from_str(&text).unwrap();
        let mut resumed = Simulation::from_snapshot(&params, restored, &tables).unwrap();
        for _ in 0..20 {
            assert_eq!(whole.step().unwrap(), resumed.step().unwrap());
        }
        assert_eq!(whole.snapshot(), resumed.snapshot());
        let SchemeMemory::Laws(memory) = whole.snapshot().memory else {
            panic!("a run under laws");
        };
        let remembers = memory.warm_start.forces.iter().any(|f| f.3 != 0.0);
        assert_eq!(
            remembers,
            contact.laws().normal != NormalLaw::ExponentialRepulsion
        );
        let stretched = memory.springs.0.iter().any(|f| f.2 != 0.0);
        assert_eq!(stretched, contact.laws().tangential.has_spring());
    }
}

#[test]
fn energy_of_a_layer_balances_under_every_choice() {
    for contact in schemes() {
        let params = params(contact);
        let snapshot = run(&params, 4, 80).snapshot();
        let strain = snapshot.steps as f64 * params.time_step;
        let configuration = Configuration {
            centres: snapshot
                .centres
                .iter()
                .map(|&[x, y]| Vec2::new(x, y))
                .collect(),
            radii: snapshot.radii.clone(),
            cell: Cell::periodic(snapshot.side, snapshot.side, strain * snapshot.side).unwrap(),
            hydrodynamics: Hydrodynamics::StokesianDynamics,
            background: Background::SHEAR,
            forces: vec![Vec2::zeros(); params.spheres],
            torques: vec![0.0; params.spheres],
        };
        let request = ContactRequest::of_run(&params, 0.005);
        let instant = solve(&configuration, &request, &NearFields::default()).unwrap();
        let stress = instant.stress.unwrap();
        let power: f64 = instant
            .contacts
            .iter()
            .chain(&instant.repelled)
            .map(|c| c.tangential_force * c.slip_velocity - c.normal_force * c.normal_velocity)
            .sum();
        let mean: f64 = snapshot.radii.iter().sum::<f64>() / params.spheres as f64;
        let volume = 2.0 * mean * configuration.cell.area().unwrap();
        let (left, right) = (stress.viscosity - 1.0, stress.dissipation + power / volume);
        assert!(
            (left - right).abs() < 1e-9 * left,
            "{contact:?}: {left} against {right}"
        );
    }
}

#[test]
fn soft_becomes_rigid_as_stiffness_grows() {
    for (soft, hard) in [
        (TangentialLaw::RollSlip, ContactScheme::Rigid),
        (TangentialLaw::StickSlide, rigid(TangentialLaw::Coulomb)),
        (TangentialLaw::Coulomb, rigid(TangentialLaw::Coulomb)),
        (
            TangentialLaw::StickRotate,
            rigid(TangentialLaw::StickRotate),
        ),
    ] {
        // Short: neighbouring paths part in time, whatever parts them.
        let viscosity = |contact| {
            let at = Params {
                // Dense enough for contacts so soon, where spheres weld as well.
                area_fraction: params(contact).area_fraction.max(0.6),
                shear_rate: 50.0,
                time_step: 0.001,
                ..params(contact)
            };
            let mut simulation = run(&at, 7, 149);
            let sample = simulation.step().unwrap();
            assert!(sample.rolling + sample.slipping >= 4);
            sample.viscosity
        };
        let limit = viscosity(hard);
        let error = |stiffness| (viscosity(spring(stiffness, soft)) / limit - 1.0).abs();
        let (compliant, stiff) = (error(1e4), error(1e7));
        assert!(
            stiff < 0.01 && stiff < 0.3 * compliant,
            "{soft:?}: {compliant:.1e} {stiff:.1e}"
        );
    }
}
