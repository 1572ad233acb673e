//! Two spheres under constant forces, in time.

use super::{HERTZ, RIGID, SPRING, laws, overlap, pair, solved, stick_slide};
use sd_core::cell::Cell;
use sd_core::contact::{Contact, ContactState, ForceLaw, Laws, NormalForce};
use sd_core::internals::{
    ContactMemory, Resistance, Rosenbrock, SolvePass, Span, StageContacts, StageKind, StageSolver,
    State,
};
use sd_core::law::repulsion::ExponentialRepulsion;
use sd_core::law::van_der_waals::VanDerWaals;
use sd_core::model::DEEPEST_OVERLAP;
use sd_core::model::PressureKind;
use sd_core::modes::Vec2;
use sd_core::{Hydrodynamics, NearFields, NormalLaw, TangentialLaw, VelocityGradient};

/// A pair moved in time under constant forces along and across its line of centres.
pub(super) struct Pushed {
    state: State,
    pub(super) memory: ContactMemory,
    /// Work done by the forces, energy dissipated in the fluid and by friction: by the trapezoidal
    /// rule of the stages.
    pub(super) work: f64,
    pub(super) dissipated: f64,
    pub(super) last: Contact,
}

/// Pushes a pair for some time in steps, from a gap; the forces turn with the frame only if `turn`
/// does.
pub(super) fn pushed(
    laws: &Laws,
    gap: f64,
    [push, shear]: [f64; 2],
    time: f64,
    steps: u32,
    turn: f64,
) -> Pushed {
    pushed_by(laws, gap, [push, shear, 0.0], time, steps, turn)
}

/// A pushed pair with a torque on the first sphere and its opposite on the second.
pub(super) fn pushed_by(
    laws: &Laws,
    gap: f64,
    forces: [f64; 3],
    time: f64,
    steps: u32,
    turn: f64,
) -> Pushed {
    pushed_in_turn(laws, gap, &[forces], time, steps, turn)
}

/// The resistance of the two spheres.
fn two_spheres(laws: &Laws) -> Resistance {
    let mut resistance = Resistance::new(
        Hydrodynamics::StokesianDynamics,
        &Cell::Unbounded,
        &[1.0, 1.4],
        &NearFields::default(),
    )
    .unwrap();
    if laws.is_soft() {
        resistance.regularise(0.001, DEEPEST_OVERLAP);
    }
    resistance
}

/// A pair that is pushed in several ways, one after another, for that time each. Rigid contacts
/// move by the midpoint rule, written out again.
fn pushed_in_turn(
    laws: &Laws,
    gap: f64,
    pushes: &[[f64; 3]],
    time: f64,
    steps: u32,
    turn: f64,
) -> Pushed {
    let (sine, cosine) = turn.sin_cos();
    let n = Vec2::new(cosine, sine);
    let mut motion = StageSolver::new(two_spheres(laws));
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
    let mut first = Vec::new();
    let mut integrator = Rosenbrock::default();
    let dt = time / f64::from(steps);
    for &[push, shear, torque] in pushes {
        let force = n * push + Vec2::new(-n.y, n.x) * shear;
        let external = [force.x, force.y, torque, -force.x, -force.y, -torque];
        for _ in 0..steps {
            let (memory, last) = (&mut out.memory, &mut out.last);
            let (mut power, mut loss) = (0.0, 0.0);
            // Share of the step over which the velocities of a stage act.
            let mut evaluate = |kind, span, share: f64, centres: &[Vec2]| {
                let span = Span {
                    time: span,
                    kind,
                    first: &first,
                    shear: 1.0,
                    dilation: 0.0,
                    dilates: PressureKind::Isotropic,
                };
                let law = StageContacts::Laws { laws, span, memory };
                motion.assemble(&Cell::Unbounded, centres)?;
                motion.solve(
                    &VelocityGradient::at_rest().into(),
                    &external,
                    law,
                    SolvePass::First,
                )?;
                if matches!(kind, StageKind::First | StageKind::Single) {
                    first = motion.velocities().to_vec();
                }
                let of = |f: &[f64]| {
                    f.iter()
                        .zip(motion.velocities())
                        .map(|(f, v)| f * v)
                        .sum::<f64>()
                };
                power += share * of(&external);
                // Dissipation in the fluid: all forces on the spheres times their velocities.
                let others = motion
                    .distant
                    .repulsive
                    .iter()
                    .chain(&motion.distant.attractive)
                    .chain(&motion.distant.adhesive);
                let contacts = motion.contacts.list.iter().chain(others);
                let contact: f64 = contacts
                    .map(|c| {
                        c.normal_force * c.normal_velocity
                            - c.tangential_force * c.slip_velocity
                            - c.rolling_force * c.rolling_velocity
                    })
                    .sum();
                loss += share * (of(&external) + contact);
                if let Some(c) = motion.contacts.list.first() {
                    *last = *c;
                }
                Ok::<Vec<f64>, sd_core::Error>(motion.velocities().to_vec())
            };
            if laws.is_soft() {
                let kinds = [StageKind::First, StageKind::Second];
                integrator
                    .step(&mut out.state, 0.0, dt, |stage, centres, velocities| {
                        let kind = kinds[stage.number];
                        let found = evaluate(kind, stage.span, 0.5, centres)?;
                        velocities.copy_from_slice(&found);
                        Ok::<(), sd_core::Error>(())
                    })
                    .unwrap();
            } else {
                let start = out.state.centres.clone();
                let mut moved = |kind, share, step: f64| {
                    let v = evaluate(kind, dt, share, &out.state.centres).unwrap();
                    for (k, x) in out.state.centres.iter_mut().enumerate() {
                        *x = start[k] + Vec2::new(v[3 * k], v[3 * k + 1]) * step;
                    }
                };
                moved(StageKind::Single, 0.0, 0.5 * dt);
                moved(StageKind::Midpoint, 1.0, dt);
            }
            out.work += power * dt;
            out.dissipated += loss * dt;
        }
    }
    out
}

/// What the springs of a pushed pair store, whose stiffness along the line of centres is 2000.
pub(super) fn stretched(p: &Pushed, tangential_stiffness: f64) -> f64 {
    let d = 0.01 - gap(p);
    0.5 * 2000.0 * d * d + across(p, tangential_stiffness)
}

/// What its tangential and rolling springs store.
pub(super) fn across(p: &Pushed, tangential_stiffness: f64) -> f64 {
    let springs = p
        .memory
        .springs
        .forces
        .0
        .iter()
        .chain(&p.memory.rolling_springs.forces.0);
    let squares: f64 = springs.map(|spring| spring.2 * spring.2).sum();
    0.5 * squares / tangential_stiffness
}

/// Gap of a pushed pair.
pub(super) fn gap(p: &Pushed) -> f64 {
    (p.state.centres[1] - p.state.centres[0]).norm() - 2.4
}

#[test]
fn spring_stores_what_work_leaves_over() {
    // Released from an overlap and pushed back: what is stored is known from the gap alone.
    let repulsive = Laws {
        repulsion: Some(ExponentialRepulsion {
            force: 20.0,
            length: 0.01,
        }),
        ..laws(SPRING, TangentialLaw::Coulomb, 0.0)
    };
    for laws in [
        laws(SPRING, TangentialLaw::Coulomb, 0.0),
        laws(HERTZ, TangentialLaw::Coulomb, 0.0),
        repulsive,
        Laws {
            attraction: Some(VanDerWaals {
                energy: 0.3,
                length: 0.05,
            }),
            ..repulsive
        },
        Laws {
            adhesion: 4.0,
            ..laws(SPRING, TangentialLaw::Coulomb, 0.0)
        },
    ] {
        let stored = |gap: f64| {
            let d = (0.01 - gap).max(0.0);
            let NormalForce { law, stiffness, .. } = laws.normal;
            let contact = match law {
                ForceLaw::BuiltIn(NormalLaw::LinearSpring) => 0.5 * stiffness * d * d,
                ForceLaw::BuiltIn(NormalLaw::Hertz) => 0.4 * stiffness * d.powf(2.5),
                _ => 0.0,
            };
            // The pair adheres all the time: it works against the attraction where it opens.
            let radius = 2.0 * 1.4 / 2.4;
            let repulsion = laws.repulsion.map_or(0.0, |law| law.energy(gap, radius));
            let attraction = laws.attraction.map_or(0.0, |law| law.energy(gap, radius));
            contact + repulsion + attraction + laws.adhesion * gap
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
        // Friction's own loss is the work of F_t on the slip beyond what the spring takes up.
        let balance = |steps: u32| {
            let shear = if slides { 4.0 } else { 1.0 };
            let p = pushed(&laws, start, [5.0, shear], 0.5, steps, 0.0);
            assert_eq!(p.last.state == ContactState::Slipping, slides);
            let cone = friction * p.last.normal_force * (1.0 + 1e-12);
            assert!(p.last.tangential_force.abs() <= cone);
            p.work - p.dissipated - stretched(&p, 1000.0)
                + 0.5 * 2000.0 * (5.0_f64 / 2000.0).powi(2)
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
fn rigid_pair_with_a_tangential_spring_stores_and_gives_back() {
    // Pushed across and back: until the spring slides, friction has done the work that the spring
    // stores, also while it gives the work back.
    let laws = stick_slide(RIGID, 1000.0, 2.0);
    let friction = |pushes: &[[f64; 3]], steps| {
        let p = pushed_in_turn(&laws, 0.01, pushes, 0.5, steps, 0.0);
        assert_eq!(p.last.state, ContactState::Sticking);
        assert!((gap(&p) - 0.01).abs() < 1e-5, "{}", gap(&p));
        (p.work - p.dissipated, across(&p, 1000.0))
    };
    let (there, back) = ([5.0, 1.0, 0.0], [5.0, -0.2, 0.0]);
    let [out, returned] = [&[there][..], &[there, back]].map(|pushes| {
        let mismatch = |steps| {
            let (work, stored) = friction(pushes, steps);
            ((work - stored).abs(), work)
        };
        let ((coarse, _), (fine, work)) = (mismatch(200), mismatch(400));
        let order = (coarse / fine).log2();
        assert!(fine < 1e-6 && order > 1.7, "{fine:.1e}, order {order}");
        work
    });
    assert!(out > 1e-5 && returned < 0.2 * out, "{out} {returned}");
    // A weaker contact slides, and loses work at the bound.
    let weak = stick_slide(RIGID, 1000.0, 0.1);
    let p = pushed_in_turn(&weak, 0.01, &[[5.0, 4.0, 0.0]], 0.5, 200, 0.0);
    assert_eq!(p.last.state, ContactState::Slipping);
    assert!(p.work - p.dissipated > 100.0 * across(&p, 1000.0));
    let spring = p.memory.springs.forces.0[0].2.abs();
    assert!(
        (spring - 0.1 * p.last.normal_force).abs() < 1e-3,
        "{spring}"
    );
}

#[test]
fn order_in_time_of_a_rigid_pair_with_a_tangential_spring_is_two() {
    // It sticks; and it slides, then sticks and slides back, on a line of centres that turns.
    for (friction, pushes) in [
        (2.0, vec![[5.0, 1.0, 0.0]]),
        (0.15, vec![[5.0, 2.0, 0.0], [5.0, -0.5, 0.0]]),
    ] {
        let end = |steps| {
            let laws = stick_slide(RIGID, 300.0, friction);
            let p = pushed_in_turn(&laws, 0.01, &pushes, 0.4, steps, 0.4);
            let across = p.state.centres[1] - p.state.centres[0];
            [
                across.y.atan2(across.x),
                p.memory.springs.forces.0[0].2 / 300.0,
            ]
        };
        let exact = end(6400);
        let error = |steps| {
            let pairs = end(steps).into_iter().zip(exact);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let errors = [50, 100, 200, 400].map(error);
        let order = (errors[0] / errors[3]).log2() / 3.0;
        assert!(order > 1.7, "{friction}: {errors:?}, order {order}");
    }
}

#[test]
fn tangential_spring_of_a_rigid_pair_is_between_no_friction_and_coulomb() {
    // The force of a pair that sticks, by hand: F = k_t γ s (u − m F), where u is the slip without
    // friction and u/m the force that prevents it.
    let at = |laws: &Laws| solved(&pair(0.01, 5.0, 1.0), laws, 0.01).contacts[0];
    let free = at(&laws(RIGID, TangentialLaw::Coulomb, 0.0)).slip_velocity;
    let stuck = at(&laws(RIGID, TangentialLaw::Coulomb, 2.0)).tangential_force;
    let ahead = 0.01 * (1.0 - std::f64::consts::FRAC_1_SQRT_2);
    for stiffness in [1e-3, 1.0, 1e3, 1e6, 1e9] {
        let c = at(&stick_slide(RIGID, stiffness, 2.0));
        let trial = stiffness * ahead * free;
        let expected = trial / (1.0 + trial / stuck);
        let off = (c.tangential_force / expected - 1.0).abs();
        assert!(off < 1e-6, "{stiffness}: {off:.1e}");
    }
    // At its bound it is Coulomb's at any stiffness that reaches it.
    let slides = [1e4, 1e9].map(|k| at(&stick_slide(RIGID, k, 0.02)).tangential_force);
    let coulomb = at(&laws(RIGID, TangentialLaw::Coulomb, 0.02)).tangential_force;
    assert!(
        slides.iter().all(|t| (t / coulomb - 1.0).abs() < 1e-9),
        "{slides:?} {coulomb}"
    );
}

#[test]
fn stick_slide_does_not_know_its_frame() {
    let laws = stick_slide(SPRING, 1000.0, 0.3);
    let at = |turn| pushed(&laws, 0.0075, [5.0, 2.0], 0.5, 100, turn);
    let (still, turned) = (at(0.0), at(1.1));
    let forces = |p: &Pushed| {
        let (_, _, f, _) = p.memory.warm_start.forces[0];
        (f, p.memory.springs.forces.0[0].2)
    };
    let (a, b) = (forces(&still), forces(&turned));
    assert!(
        (a.0 - b.0).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-9,
        "{a:?} {b:?}"
    );
    assert!((gap(&still) - gap(&turned)).abs() < 1e-12);
    // It does not stretch under a rigid rotation of the pair either, which has no slip.
    let mut whole = pair(0.0075, 5.0, 0.0);
    whole.background = VelocityGradient::from_parts(&[0.0; 3], &0.7).into();
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
        let (f, spring) = (
            p.memory.warm_start.forces[0].2,
            p.memory.springs.forces.0[0].2,
        );
        // Where the pair is and how far the spring is stretched; the normal force is that of a
        // stage, and so of first order.
        ([gap(&p), spring / stiffness], f)
    };
    let distance = |(a, _): ([f64; 2], f64), (b, _): ([f64; 2], f64)| {
        (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
    };
    let exact = end(500.0, 3200);
    let order = (distance(end(500.0, 100), exact) / distance(end(500.0, 200), exact)).log2();
    assert!((order - 2.0).abs() < 0.2, "order {order}");
    // Steps 1e7 times as long as the relaxation time of the spring: the error is that of the
    // rotation of the pair.
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
    // The contact closes within a step: the error is still of second order in the step, and the
    // pair comes to rest where spring and push balance.
    for normal in [SPRING, HERTZ] {
        let laws = laws(normal, TangentialLaw::Coulomb, 0.0);
        let rest = overlap(normal, 20.0);
        let p = pushed(&laws, 0.03, [20.0, 0.0], 40.0, 400, 0.0);
        assert!((gap(&p) - (0.01 - rest)).abs() < 1e-7, "{} {rest}", gap(&p));
    }
}
