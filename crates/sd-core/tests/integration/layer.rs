//! Runs of whole layers: what must hold for every one of them.

use sd_core::cell::Cell;
use sd_core::contact::{ContactState, Laws, Surface};
use sd_core::instant::{Configuration, InstantContacts, solve};
use sd_core::internals::{Resistance, RungeKutta, SolvePass, StageContacts, StageSolver, State};
use sd_core::modes::Vec2;
use sd_core::{
    ContactLaws, ContactScheme, Error, Flow, Hydrodynamics, NearFields, Params, Sample, Simulation,
    Snapshot, TangentialLaw, VelocityGradient, start,
};
use std::f64::consts::PI;

fn params() -> Params {
    Params::builder()
        .spheres(40)
        .area_fraction(0.693)
        .roughness(0.01)
        .friction(0.3)
        .shear_rate(100.0)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(ContactScheme::Rigid)
        .time_step(0.005)
        .build()
        .unwrap()
}

/// Samples of a run over some steps, and its end.
fn run(params: &Params, seed: u64, steps: u64) -> (Vec<Sample>, Snapshot) {
    let mut simulation =
        Simulation::<sd_core::Layer>::new(params, seed, &NearFields::default()).unwrap();
    let samples = (0..steps).map(|_| simulation.step().unwrap()).collect();
    assert_eq!(simulation.flow(), Flow::Flowing);
    (samples, simulation.snapshot())
}

/// The configuration of a snapshot of a monodisperse layer at time step 0.005.
fn configuration(snapshot: &Snapshot, hydrodynamics: Hydrodynamics) -> Configuration {
    let n = snapshot.centres.len();
    let strain = snapshot.steps as f64 * 0.005;
    Configuration {
        centres: snapshot
            .centres
            .iter()
            .map(|&[x, y]| Vec2::new(x, y))
            .collect(),
        radii: snapshot.radii.clone(),
        cell: Cell::equal_sides(snapshot.side, strain * snapshot.side).unwrap(),
        hydrodynamics,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vec2::zeros(); n],
        torques: vec![0.0; n],
    }
}

#[test]
fn energy_balances_to_1e_10_with_contacts_and_friction() {
    let (_, snapshot) = run(&params(), 3, 60);
    for hydrodynamics in [Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics] {
        let configuration = configuration(&snapshot, hydrodynamics);
        let surface = Surface {
            roughness: 0.012,
            friction: 0.3,
            critical_load: 10.0,
        };
        for request in [
            InstantContacts::None,
            InstantContacts::under(Laws::rigid(surface), 0.005),
            InstantContacts::Procedure { surface },
        ] {
            let instant = solve(&configuration, &request, &NearFields::default()).unwrap();
            let stress = instant.stress.unwrap();
            let volume = 2.0 * configuration.cell.content().unwrap();
            let left = stress.viscosity - 1.0;
            let right = stress.dissipation + instant.contact_power() / volume;
            assert!(
                (left - right).abs() < 1e-10 * left,
                "{request:?}: {left} against {right}"
            );
            let states = |state| instant.contacts.iter().any(|c| c.state == state);
            if !instant.contacts.is_empty() {
                assert!(states(ContactState::Sticking) && states(ContactState::Slipping));
            }
        }
    }
}

#[test]
fn friction_dissipates_in_a_layer() {
    let (_, snapshot) = run(&params(), 4, 100);
    let configuration = configuration(&snapshot, Hydrodynamics::BallMelrose);
    let surface = Surface {
        roughness: 0.01,
        friction: 0.3,
        critical_load: 0.0,
    };
    let coulomb = ContactLaws {
        tangential: TangentialLaw::Coulomb,
        ..ContactLaws::PAPER
    };
    let request = InstantContacts::under(Laws::new(&coulomb, surface), 0.005);
    let instant = solve(&configuration, &request, &NearFields::default()).unwrap();
    // Every contact that slips dissipates ν f |u_t|, and one that sticks nothing.
    let [mut slips, mut sticks] = [0; 2];
    for c in &instant.contacts {
        let power = c.tangential_force * c.slip_velocity;
        match c.state {
            ContactState::Slipping => {
                slips += 1;
                let expected = 0.3 * c.normal_force * c.slip_velocity.abs();
                assert!((power - expected).abs() < 1e-9 * (1.0 + expected), "{c:?}");
                assert!(power > 0.0, "{c:?}");
            }
            ContactState::Sticking => {
                sticks += 1;
                assert!(power.abs() < 1e-7 * (1.0 + c.normal_force), "{c:?}");
            }
            ContactState::Frictionless => assert_eq!(c.tangential_force, 0.0),
        }
    }
    assert!(slips > 5 && sticks > 0, "{slips} slip, {sticks} stick");
}

#[test]
fn one_sphere_in_a_large_cell_gives_the_dilute_limit() {
    for hydrodynamics in [Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics] {
        let dilute = Params {
            spheres: 1,
            hydrodynamics,
            ..params()
        };
        let excess = |area_fraction: f64| {
            let at = Params {
                area_fraction,
                ..dilute.clone()
            };
            let sample = run(&at, 1, 1).0[0];
            (sample.viscosity - 1.0) / area_fraction
        };
        assert!((excess(1e-4) - 5.0 / 3.0).abs() < 1e-5);
        // Images in the layer matter at order c^(3/2): eight times less at a quarter of the cell's
        // density.
        let deviation = |c| (excess(c) - 5.0 / 3.0).abs();
        if hydrodynamics == Hydrodynamics::StokesianDynamics {
            let ratio = deviation(0.02) / deviation(0.005);
            assert!((ratio - 8.0).abs() < 0.5, "ratio {ratio}");
        } else {
            assert!(deviation(0.02) < 1e-12);
        }
    }
}

#[test]
fn rigid_gaps_stay_at_the_roughness_height() {
    let (samples, snapshot) = run(&params(), 2, 1000);
    let smallest = snapshot.counters.minimum_gap;
    assert!(smallest > 0.98 * 0.01, "smallest gap {smallest}");
    assert!(samples.iter().all(|s| s.minimum_gap >= smallest));
    assert!(
        samples
            .iter()
            .any(|s| s.contacts > 20 && s.sticking > 0 && s.slipping > 0)
    );
    assert_eq!(snapshot.counters.unconverged_stages, 0);
    assert!(snapshot.counters.worst_residual < 1e-8);
    // The lower bound of minimum dissipation.
    let bound = 1.0 + 5.0 / 3.0 * 0.693;
    assert!(samples.iter().all(|s| s.viscosity_stresslet > bound));
}

#[test]
fn near_jamming_every_stage_is_converged() {
    let dense = Params {
        spheres: 100,
        area_fraction: 0.80,
        shear_rate: 1.0,
        ..params()
    };
    let (samples, snapshot) = run(&dense, 1, 400);
    let counters = snapshot.counters;
    // Two per step, except in the first ones, without loaded contacts.
    assert!((800..840).contains(&counters.stages), "{counters:?}");
    // A condition of the test: contacts come close to the isostatic 2N.
    assert!(samples.iter().any(|s| s.contacts > 160));
    assert!(counters.worst_residual < 1e-8, "{counters:?}");
    assert!(counters.worst_friction_error < 1e-6, "{counters:?}");
    assert_eq!(counters.unconverged_stages, 0);
}

#[test]
fn a_step_in_which_spheres_would_overlap_is_halved() {
    let jamming = Params {
        spheres: 40,
        area_fraction: 0.80,
        shear_rate: 100.0,
        time_step: 0.02,
        ..params()
    };
    let (samples, snapshot) = run(&jamming, 2, 50);
    assert!(snapshot.counters.stages > 110, "no step was halved");
    // Still one sample per step, and the gaps held.
    let strains: Vec<f64> = samples.iter().map(|s| s.strain).collect();
    assert!((0..50).all(|k| (strains[k] - 0.02 * k as f64).abs() < 1e-12));
    assert!(snapshot.counters.minimum_gap >= 0.95 * 0.01);
}

#[test]
fn procedure_lets_gaps_drift_and_rigid_does_not() {
    let procedure = Params {
        contact: ContactScheme::Procedure,
        ..params()
    };
    let drifted = run(&procedure, 2, 200).1.counters.minimum_gap;
    let held = run(&params(), 2, 200).1.counters.minimum_gap;
    assert!(drifted < 0.009 && held > 0.0098, "{drifted} against {held}");
}

#[test]
fn overlap_ends_a_procedure_run_with_step_and_pair() {
    let dense = Params {
        spheres: 100,
        area_fraction: 0.80,
        contact: ContactScheme::Procedure,
        ..params()
    };
    let mut simulation =
        Simulation::<sd_core::Layer>::new(&dense, 1, &NearFields::default()).unwrap();
    let failure = (0..1000).find_map(|_| simulation.step().err());
    let Some(Error::Step { source, strain, .. }) = failure else {
        panic!("the procedure cannot hold this layer for five strains, but did so");
    };
    assert!(matches!(*source, Error::Overlap { gap, .. } if gap <= 0.0));
    assert!(strain > 0.0);
}

#[test]
fn sample_of_a_coarse_step_is_the_mean_of_fine_ones() {
    for (hydrodynamics, shear_stress) in [
        (Hydrodynamics::BallMelrose, None),
        (Hydrodynamics::BallMelrose, Some(0.5)),
        (Hydrodynamics::StokesianDynamics, None),
    ] {
        let coarse = Params {
            time_step: 0.01,
            area_fraction: 0.7,
            hydrodynamics,
            shear_stress,
            shear_rate: if shear_stress.is_some() { 0.0 } else { 1.0 },
            ..params()
        };
        let tables = NearFields::default();
        let mut layer = Simulation::<sd_core::Layer>::new(&coarse, 3, &tables).unwrap();
        for _ in 0..100 {
            layer.step().unwrap();
        }
        // The same layer, moved on over fifty steps, and in finer ones.
        let fine = Params {
            time_step: 0.001,
            ..coarse.clone()
        };
        let mut there = layer.snapshot();
        there.steps *= 10;
        let mut fine = Simulation::from_snapshot(&fine, there, &tables).unwrap();
        let mean = |layer: &mut Simulation, steps: u32| {
            let sum: f64 = (0..steps).map(|_| layer.step().unwrap().viscosity).sum();
            sum / f64::from(steps)
        };
        let stages = layer.counters().stages;
        let (found, exact) = (mean(&mut layer, 50), mean(&mut fine, 500));
        assert!((found / exact - 1.0).abs() < 0.01, "{found} and {exact}");
        // Two right-hand sides a step, and no other contact problem.
        if shear_stress.is_none() {
            assert_eq!(layer.counters().stages, stages + 100);
        }
    }
}

#[test]
fn snapshot_of_other_parameters_is_refused() {
    let (_, snapshot) = run(&params(), 1, 1);
    let other = Params {
        area_fraction: 0.5,
        ..params()
    };
    let refused = Simulation::from_snapshot(&other, snapshot, &NearFields::default());
    assert!(matches!(refused, Err(Error::Snapshot { .. })));
}

/// Shears a layer without contacts for some steps of either sign; returns the state.
fn shear(start: &start::Start, state: State, from: f64, dt: f64, steps: u32) -> State {
    let cell =
        |strain: f64| Cell::<sd_core::Layer>::equal_sides(start.side, strain * start.side).unwrap();
    let resistance = Resistance::new(
        Hydrodynamics::BallMelrose,
        &cell(0.0),
        &start.radii,
        &NearFields::default(),
    )
    .unwrap();
    let mut motion = StageSolver::new(resistance);
    let mut integrator = RungeKutta::default();
    let mut state = state;
    let shear = VelocityGradient::simple_shear(1.0);
    for k in 0..steps {
        let time = from + f64::from(k) * dt;
        integrator
            .step(&mut state, time, dt, |stage, centres, velocities| {
                motion.assemble(&cell(stage.time), centres)?;
                motion.solve(&shear.into(), &[], StageContacts::None, SolvePass::First)?;
                velocities.copy_from_slice(motion.velocities());
                for (u, &x) in velocities.chunks_exact_mut(3).zip(centres) {
                    u[0] += shear.velocity(&x).x;
                    u[2] += shear.angular_velocity();
                }
                Ok::<(), Error>(())
            })
            .unwrap();
    }
    state
}

/// A start layer as a state.
fn at_start(start: &start::Start) -> State {
    State {
        centres: start.centres.clone(),
        orientations: vec![0.0; start.radii.len()],
    }
}

/// Largest distance between corresponding centres.
fn distance(a: &State, b: &State) -> f64 {
    a.centres
        .iter()
        .zip(&b.centres)
        .map(|(x, y)| (x - y).norm())
        .fold(0.0, f64::max)
}

#[test]
fn without_contacts_five_strains_are_reversible() {
    let dilute = Params {
        spheres: 12,
        area_fraction: 0.3,
        ..params()
    };
    let start = start::layer(&dilute, 1).unwrap();
    let there = shear(&start, at_start(&start), 0.0, 0.005, 1000);
    assert!(distance(&there, &at_start(&start)) > 1.0);
    let back = shear(&start, there, 5.0, -0.005, 1000);
    let error = distance(&back, &at_start(&start));
    assert!(error < 1e-6, "returned to within {error}");
}

#[test]
fn order_in_time_is_four() {
    // Three spheres that stay within each other's lubrication range: where a pair enters or leaves
    // it, its term jumps by about 1e-4 of the drag, which no integrator follows at fourth order.
    let start = start::Start {
        radii: vec![1.0; 3],
        centres: vec![
            Vec2::new(0.0, 0.0),
            Vec2::new(2.2, 0.4),
            Vec2::new(0.9, 2.3),
        ],
        orientations: vec![0.0; 3],
        springs: Vec::new(),
        rolling_springs: Vec::new(),
        side: 20.0,
    };
    let end = |steps: u32| shear(&start, at_start(&start), 0.0, 0.2 / f64::from(steps), steps);
    let exact = end(320);
    let order = (distance(&end(10), &exact) / distance(&end(20), &exact)).log2();
    assert!((order - 4.0).abs() < 0.3, "order {order}");
}

#[test]
fn viscosity_does_not_depend_on_the_order_of_spheres_the_lattice_or_the_origin() {
    let (_, snapshot) = run(&params(), 6, 40);
    for hydrodynamics in [Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics] {
        let base = configuration(&snapshot, hydrodynamics);
        let request = InstantContacts::under(
            Laws::rigid(Surface {
                roughness: 0.01,
                friction: 0.3,
                critical_load: 0.0,
            }),
            0.005,
        );
        let viscosity = |c: &Configuration| {
            let instant = solve(c, &request, &NearFields::default()).unwrap();
            instant.stress.unwrap().viscosity
        };
        let reference = viscosity(&base);
        let mut reversed = base.clone();
        reversed.centres.reverse();
        let mut shifted = base.clone();
        for x in &mut shifted.centres {
            *x += Vec2::new(0.37, -0.91);
        }
        // One sphere replaced by an image, and the offset by the same lattice one strain later.
        let mut imaged = base.clone();
        imaged.centres[7] += imaged.cell.image_vector([-2, 1]);
        let mut sheared = base.clone();
        let strain = snapshot.steps as f64 * 0.005 + 1.0;
        sheared.cell = Cell::equal_sides(snapshot.side, strain * snapshot.side).unwrap();
        for (what, changed) in [
            ("order", &reversed),
            ("origin", &shifted),
            ("image", &imaged),
            ("lattice", &sheared),
        ] {
            let error = (viscosity(changed) / reference - 1.0).abs();
            assert!(error < 1e-7, "{what}: {error:.1e}");
        }
    }
}

#[test]
fn rolling_friction_stops_the_slip_of_a_pair_alone() {
    let (centre, angle) = (2.01, 2.2_f64);
    let configuration: Configuration = Configuration {
        centres: vec![
            Vec2::zeros(),
            Vec2::new(centre * angle.cos(), centre * angle.sin()),
        ],
        radii: vec![1.0; 2],
        cell: Cell::Unbounded,
        hydrodynamics: Hydrodynamics::StokesianDynamics,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vec2::zeros(); 2],
        torques: vec![0.0; 2],
    };
    let pressed = |friction| {
        let request = InstantContacts::under(
            Laws::rigid(Surface {
                roughness: 0.01,
                friction,
                critical_load: 0.0,
            }),
            0.005,
        );
        solve(&configuration, &request, &NearFields::default())
            .unwrap()
            .contacts[0]
    };
    let rolling = pressed(10.0);
    assert_eq!(rolling.state, ContactState::Sticking);
    assert!(rolling.normal_force > 0.0 && rolling.tangential_force != 0.0);
    assert!(rolling.slip_velocity.abs() < 1e-6);
    assert!(rolling.normal_velocity.abs() < 1e-6);
    let slipping = pressed(0.01);
    assert_eq!(slipping.state, ContactState::Slipping);
    assert!(slipping.tangential_force * slipping.slip_velocity > 0.0);
    let limit = 0.01 * slipping.normal_force;
    assert!((slipping.tangential_force.abs() - limit).abs() < 1e-9 * limit);
}

#[test]
fn two_sizes_shear_without_contact_at_the_start() {
    let two = Params {
        size_ratio: 1.4,
        area_fraction: 0.7,
        spheres: 50,
        ..params()
    };
    let (samples, snapshot) = run(&two, 1, 20);
    assert_eq!(samples[0].contacts, 0);
    let area: f64 = snapshot.radii.iter().map(|a| PI * a * a).sum();
    assert!((area / snapshot.side.powi(2) - 0.7).abs() < 1e-12);
    assert!(snapshot.counters.minimum_gap > 0.0098);
}

#[test]
fn without_friction_the_rate_and_at_rate_zero_friction_change_no_bit() {
    let soft = ContactScheme::Laws(sd_core::ContactLaws {
        stiffness_unit: sd_core::model::StiffnessUnit::Flow,
        ..sd_core::ContactLaws::linear_spring(1e4, sd_core::TangentialLaw::RollSlip, 0.01)
    });
    for contact in [ContactScheme::Rigid, ContactScheme::Procedure, soft] {
        let path = |friction, shear_rate| {
            let params = Params {
                friction,
                shear_rate,
                contact,
                ..params()
            };
            let mut simulation: Simulation =
                Simulation::new(&params, 2, &NearFields::default()).unwrap();
            let sample = |sample: Sample| Sample {
                shear_rate: 0.0,
                ..sample
            };
            let samples: Vec<Sample> = (0..40)
                .map(|_| sample(simulation.step().unwrap()))
                .collect();
            let mut settled = params;
            settled.canonicalise();
            (samples, settled)
        };
        let (plain, settled) = path(0.0, 0.0);
        assert!(plain.iter().any(|sample| sample.contacts > 0));
        for (friction, shear_rate) in [(0.0, 0.1), (0.0, f64::INFINITY), (0.3, 0.0)] {
            assert_eq!(path(friction, shear_rate), (plain.clone(), settled.clone()));
        }
        let (rubbing, other) = path(0.3, f64::INFINITY);
        assert_ne!(rubbing, plain, "{contact:?}");
        assert_ne!(other, settled);
    }
}
