//! Cross shear: an oscillation along the vorticity, across a steady shear.

use nalgebra::{Matrix3, Vector3};
use sd_core::cell::Cell;
use sd_core::contact::Laws;
use sd_core::instant::{Configuration, InstantContacts, SolvedConfiguration, solve};
use sd_core::model::{CrossShear, Segment, SolverSettings, Surface};
use sd_core::{
    Bulk, ContactLaws, ContactScheme, Hydrodynamics, Layer, NearFields, Params, Sample, Simulation,
    Snapshot, Space, TangentialLaw, VelocityGradient,
};

/// Steady shear with this across it, from a strain on.
fn crossed(start: f64, amplitude: f64, ratio: f64) -> Segment {
    Segment {
        start,
        cross_shear: Some(CrossShear { amplitude, ratio }),
        ..Segment::default()
    }
}

/// A suspension of rough rigid spheres with friction.
fn suspension(segments: &[Segment]) -> Params {
    let steady = Params::builder()
        .spheres(100)
        .volume_fraction(0.45)
        .roughness(0.01)
        .friction(0.5)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(ContactScheme::Laws(ContactLaws {
            tangential: TangentialLaw::Coulomb,
            ..ContactLaws::PAPER
        }))
        .time_step(0.01)
        .build()
        .unwrap();
    Params {
        segments: segments.to_vec(),
        ..steady
    }
}

/// A suspension of soft spheres, whose springs have a memory.
fn springs(segments: &[Segment]) -> Params {
    Params {
        contact: ContactScheme::Laws(ContactLaws::linear_spring(
            2e3,
            TangentialLaw::StickSlide,
            0.01,
        )),
        shear_rate: 10.0,
        ..suspension(segments)
    }
}

/// Spheres that do not touch.
fn dilute(segments: &[Segment], hydrodynamics: Hydrodynamics) -> Params {
    Params {
        spheres: 40,
        volume_fraction: Some(0.25),
        roughness: 1e-4,
        friction: 0.0,
        shear_rate: 0.0,
        hydrodynamics,
        ..suspension(segments)
    }
}

fn begin(params: &Params, seed: u64) -> Simulation<Bulk> {
    params.validate().unwrap();
    let start = Snapshot::start(params, seed).unwrap();
    let settings = SolverSettings::precise();
    Simulation::with_settings(params, start, &NearFields::default(), &settings).unwrap()
}

fn steps(run: &mut Simulation<Bulk>, steps: u64) -> Vec<Sample> {
    (0..steps).map(|_| run.step().unwrap()).collect()
}

#[test]
fn what_is_imposed_is_a_sine_of_the_primary_strain() {
    let reversed = Segment {
        direction: Some(-1.0),
        ..crossed(1.0, 0.3, 2.0)
    };
    let params = suspension(&[
        crossed(0.0, 0.1, 5.0),
        reversed,
        Segment {
            start: 1.5,
            ..Segment::default()
        },
    ]);
    let first = |strain: f64| 0.1 * (5.0 * strain).sin();
    let second = |strain: f64| first(1.0) + 0.3 * (2.0 * (strain - 1.0)).sin();
    for (step, expected) in [
        (0, 0.0),
        (20, first(0.2)),
        (100, first(1.0)),
        (120, second(1.2)),
        (150, second(1.5)),
        (200, second(1.5)),
    ] {
        let found = params.cross_strain(step);
        assert!((found - expected).abs() < 1e-12, "{step}: {found}");
    }
    for (step, gained) in [
        (20, first(0.21) - first(0.2)),
        (120, second(1.21) - second(1.2)),
        (170, 0.0),
    ] {
        let rate = params.imposed(step).cross_rate();
        assert!((rate * 0.01 - gained).abs() < 1e-12, "{step}: {rate}");
    }
}

#[test]
fn spheres_out_of_range_of_others_move_with_the_flow() {
    let params = Params {
        spheres: 2,
        volume_fraction: Some(0.01),
        ..dilute(&[crossed(0.0, 0.7, 3.0)], Hydrodynamics::BallMelrose)
    };
    let is_apart = |run: &Simulation<Bulk>| {
        let cell = Cell::<Bulk>::equal_sides(run.side(), 0.0).unwrap();
        let between = cell.nearest(run.centres()[0] - run.centres()[1]).0;
        between.y.abs() > 4.0
    };
    let mut runs = (1..100).map(|seed| begin(&params, seed));
    let mut run = runs.find(is_apart).unwrap();
    let starts = run.centres().to_vec();
    for step in 1..=300 {
        run.step().unwrap();
        let strain = 0.01 * f64::from(step);
        let along = Vector3::new(strain, 0.0, 0.7 * (3.0 * strain).sin());
        let cell = run.cell_at(run.strain()).unwrap();
        for (x, start) in run.centres().iter().zip(&starts) {
            let missed = cell.nearest(x - start - along * start.y).0;
            assert!(missed.norm() < 1e-10, "{step}: {missed}");
        }
    }
}

#[test]
fn a_step_is_the_instant_of_its_configuration_and_flow() {
    for (hydrodynamics, tolerance) in [
        (Hydrodynamics::BallMelrose, 1e-9),
        // The far field of runs is iterated, but not that of an instant of so few spheres.
        (Hydrodynamics::StokesianDynamics, 1e-5),
    ] {
        let params = dilute(&[crossed(0.0, 0.3, 2.0)], hydrodynamics);
        let mut run = begin(&params, 5);
        for step in 0..12 {
            let rate = params.imposed(run.steps()).cross_rate();
            let sheared = 0.3 * (0.02 * f64::from(step)).sin() * run.side();
            let configuration = Configuration::<Bulk> {
                centres: run.centres().to_vec(),
                radii: run.radii().to_vec(),
                cell: Cell::equal_sides(run.side(), run.strain() * run.side())
                    .and_then(|cell| cell.with_cross_offset(sheared))
                    .unwrap(),
                hydrodynamics,
                background: VelocityGradient::simple_shear(1.0)
                    .with_cross_shear(rate)
                    .into(),
                forces: vec![Vector3::zeros(); 40],
                torques: vec![Vector3::zeros(); 40],
            };
            let (sample, frame) = run.step_with_frame().unwrap();
            assert_eq!(sample.contacts, 0);
            let solved = solve(
                &configuration,
                &InstantContacts::None,
                &NearFields::default(),
            )
            .unwrap();
            // The viscosity of a run is that of the primary shear alone.
            let sheared: f64 = solved.stresslets.iter().map(|s| Bulk::tensor(s)[2]).sum();
            let viscosity = 1.0 + sheared / run.side().powi(3);
            for (found, expected) in [
                (sample.viscosity, viscosity),
                (sample.dissipation, solved.stress.unwrap().dissipation),
            ] {
                let error = (found / expected - 1.0).abs();
                assert!(error < tolerance, "{hydrodynamics:?} {step}: {error:.1e}");
            }
            for (found, expected) in frame.stresslets.iter().zip(&solved.stresslets) {
                let expected = Bulk::tensor(expected);
                for (a, b) in found.iter().zip(expected) {
                    assert!(
                        (a - b).abs() < 100.0 * tolerance,
                        "{hydrodynamics:?} {step}"
                    );
                }
            }
        }
    }
}

#[test]
fn half_the_time_step_changes_a_run_hardly_more_than_without_cross_shear() {
    // The remaining error is from the end of the lubrication range, which pairs cross within a
    // step.
    let change = |segments: &[Segment]| {
        let [coarse, fine] = [0.02, 0.01].map(|time_step| {
            let params = Params {
                time_step,
                ..dilute(segments, Hydrodynamics::BallMelrose)
            };
            let mut run = begin(&params, 5);
            while run.strain() < 0.3999 {
                assert_eq!(run.step().unwrap().contacts, 0);
            }
            run
        });
        let cell = fine.cell_at(0.4).unwrap();
        let pairs = coarse.centres().iter().zip(fine.centres());
        let moved = pairs.map(|(a, b)| cell.nearest(a - b).0.norm());
        moved.fold(0.0, f64::max)
    };
    let [without, with] = [change(&[]), change(&[crossed(0.0, 0.3, 4.0)])];
    assert!(with < 4.0 * without, "{without:.1e} {with:.1e}");
    assert!(without < 1e-4, "{without:.1e}");
}

/// The position of the cell boundary has no effect: images move exactly with the flow, contacts
/// across the boundary included.
#[test]
fn a_run_does_not_depend_on_where_the_cell_is_cut() {
    for params in [suspension, springs] {
        let params = params(&[crossed(0.0, 0.2, 10.0)]);
        let mut whole = begin(&params, 4);
        // Without a fixed active set friction jumps, and rounding would determine it.
        steps(&mut whole, 30);
        let mut moved = whole.snapshot();
        let cell = whole.cell_at(whole.strain()).unwrap();
        for x in &mut moved.centres {
            *x = cell
                .wrap(Vector3::from(*x) + Vector3::y() * 0.4 * whole.side())
                .into();
        }
        let mut moved = Simulation::from_snapshot(&params, moved, &NearFields::default()).unwrap();
        let mut contacts = 0;
        for (a, b) in steps(&mut whole, 20).iter().zip(steps(&mut moved, 20)) {
            contacts += a.contacts;
            let error = (a.viscosity / b.viscosity - 1.0).abs();
            assert!(error < 1e-6, "{error:.1e}");
            assert!((a.minimum_gap - b.minimum_gap).abs() < 1e-8);
        }
        assert!(contacts > 200, "{contacts} are no test");
    }
}

#[test]
fn rigid_contacts_keep_their_gaps() {
    let params = suspension(&[crossed(0.0, 0.05, 20.0)]);
    let mut run = begin(&params, 2);
    let samples = steps(&mut run, 60);
    assert!(samples.iter().map(|sample| sample.contacts).max() > Some(20));
    assert!(run.counters().minimum_gap > 0.95 * params.roughness);
}

#[test]
fn a_run_resumes_with_the_same_bits_from_every_step() {
    let segments = [
        Segment::default(),
        crossed(0.1, 0.3, 5.0),
        Segment {
            start: 0.4,
            shear_stress: Some(3.0),
            ..Segment::default()
        },
        Segment {
            shear_stress: Some(4.0),
            ..crossed(0.5, 0.1, 20.0)
        },
    ];
    let full = Params {
        hydrodynamics: Hydrodynamics::StokesianDynamics,
        spheres: 60,
        ..suspension(&segments)
    };
    for (params, count) in [
        (suspension(&segments), 60),
        (springs(&segments), 60),
        (full, 20),
    ] {
        params.validate().unwrap();
        crate::common::resumed::check::<Bulk>(&params, count, 3);
    }
}

#[test]
fn the_imposed_stress_is_borne_across_a_cross_shear() {
    let params = suspension(&[Segment {
        shear_stress: Some(2.0),
        ..crossed(0.0, 0.1, 10.0)
    }]);
    let mut run = begin(&params, 2);
    for sample in steps(&mut run, 10) {
        // σ* = η Γ/6π
        let stress = sample.viscosity * sample.shear_rate / (6.0 * std::f64::consts::PI);
        assert!((stress / 2.0 - 1.0).abs() < 1e-3, "{stress}");
    }
}

/// Spheres on a disordered lattice, at φ = 0.35, that touch; forces and torques act on them.
fn touching(hydrodynamics: Hydrodynamics) -> Configuration<Bulk> {
    let side = 2.29;
    let wave = |k: usize, factor: f64| (factor * k as f64).sin();
    let centres: Vec<_> = (0..64)
        .map(|k| {
            let place = [k % 4, k / 4 % 4, k / 16].map(|x| x as f64);
            let moved = [1.7, 2.9, 0.9].map(|factor| 0.07 * wave(k, factor));
            Vector3::from(place) * side + Vector3::from(moved)
        })
        .collect();
    Configuration {
        radii: vec![1.0; 64],
        cell: Cell::equal_sides(4.0 * side, 1.3)
            .and_then(|cell| cell.with_cross_offset(-2.1))
            .unwrap(),
        hydrodynamics,
        background: VelocityGradient::simple_shear(1.0)
            .with_cross_shear(0.7)
            .into(),
        forces: (0..64)
            .map(|k| Vector3::new(wave(k, 0.7), 0.3, -0.1))
            .collect(),
        torques: (0..64)
            .map(|k| Vector3::new(0.1, wave(k, 1.1), 0.2))
            .collect(),
        centres,
    }
}

/// The configuration with x and z exchanged.
fn exchanged(configuration: &Configuration<Bulk>) -> Configuration<Bulk> {
    let swap = |x: &Vector3<f64>| Vector3::new(x.z, x.y, x.x);
    let lattice = configuration.cell.lattice().unwrap();
    let sides = Vector3::from_column_slice(lattice.lengths());
    let (offset, cross_offset) = (lattice.offset(), lattice.cross_offset());
    let flow = configuration.background.linear();
    let [x, y, z] = [2, 1, 0].map(|k| swap(&flow.rows()[k]));
    Configuration {
        centres: configuration.centres.iter().map(swap).collect(),
        cell: Cell::periodic(swap(&sides), cross_offset)
            .and_then(|cell| cell.with_cross_offset(offset))
            .unwrap(),
        background: VelocityGradient::new(&[x, y, z]).unwrap().into(),
        forces: configuration.forces.iter().map(swap).collect(),
        torques: configuration.torques.iter().map(|t| -swap(t)).collect(),
        ..configuration.clone()
    }
}

fn solved(configuration: &Configuration<Bulk>) -> SolvedConfiguration<Bulk> {
    let surface = Surface {
        roughness: 0.2,
        friction: 0.3,
        critical_load: 0.0,
    };
    let choice = ContactLaws {
        tangential: TangentialLaw::Coulomb,
        ..ContactLaws::PAPER
    };
    let request = InstantContacts::under(Laws::new(&choice, surface), 0.01);
    solve(configuration, &request, &NearFields::default()).unwrap()
}

#[test]
fn flow_and_vorticity_may_be_exchanged() {
    let swap = Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0);
    for hydrodynamics in [Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics] {
        let mut configuration = touching(hydrodynamics);
        for flow in [
            *configuration.background.linear(),
            // With images shifted along one axis only, that of the flow.
            VelocityGradient::simple_shear(1.0),
        ] {
            if flow == VelocityGradient::simple_shear(1.0) {
                configuration.cell = configuration.cell.with_cross_offset(0.0).unwrap();
            }
            configuration.background = flow.into();
            let [a, b] = [configuration.clone(), exchanged(&configuration)]
                .map(|configuration| solved(&configuration));
            for (v, w) in a.disturbances.iter().zip(&b.disturbances) {
                for (k, sign) in [(0, 1.0), (3, -1.0)] {
                    let [of_a, of_b] = [v, w].map(|v| Vector3::new(v[k], v[k + 1], v[k + 2]));
                    let error = (swap * of_a * sign - of_b).amax();
                    assert!(error < 1e-9, "{hydrodynamics:?}: {error:.1e}");
                }
            }
            assert_eq!(a.contacts.len(), b.contacts.len());
            let loaded = a.contacts.iter().filter(|c| c.normal_force > 0.0).count();
            assert!(loaded > 10, "{loaded} are no test");
            for (c, d) in a.contacts.iter().zip(&b.contacts) {
                assert!((c.normal_force - d.normal_force).abs() < 1e-6);
                let error = (swap * c.tangential_force - d.tangential_force).amax();
                assert!(error < 1e-6, "{hydrodynamics:?}: {error:.1e}");
            }
        }
    }
}

#[test]
fn what_the_flow_gives_is_dissipated() {
    for hydrodynamics in [Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics] {
        let configuration = touching(hydrodynamics);
        let solved = solved(&configuration);
        let stress = solved.stress.unwrap();
        let volume = configuration.cell.content().unwrap();
        let spent = stress.dissipation * volume + solved.contact_power();
        let external: f64 = (configuration.forces.iter().zip(&configuration.torques))
            .zip(&solved.disturbances)
            .map(|((f, t), v)| {
                let of = |x: &Vector3<f64>, v: &[f64]| x.dot(&Vector3::from_column_slice(v));
                of(f, &v[..3]) + of(t, &v[3..])
            })
            .sum();
        // rate² = 2 E:E of both shears.
        let given = (stress.viscosity - 1.0) * volume * (1.0 + 0.7 * 0.7) + external;
        assert!((spent / given - 1.0).abs() < 1e-10, "{spent} {given}");
    }
}

#[test]
fn a_cross_shear_that_cannot_be_is_refused() {
    let refused = |params: &Params, expected: &str| {
        let error = params.validate().unwrap_err().to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    };
    let layer = Params {
        area_fraction: 0.5,
        volume_fraction: None,
        ..suspension(&[crossed(0.0, 0.1, 10.0)])
    };
    refused(&layer, "no vorticity direction");
    assert!(Simulation::<Layer>::new(&layer, 1, &NearFields::default()).is_err());
    let across = Segment {
        amplitude: Some(0.5),
        ..crossed(0.0, 0.1, 10.0)
    };
    refused(&suspension(&[across]), "across an oscillation");
    for (amplitude, ratio, expected) in [
        (0.0, 10.0, "cross_shear.amplitude"),
        (-0.1, 10.0, "cross_shear.amplitude"),
        (f64::NAN, 10.0, "cross_shear.amplitude"),
        (0.1, 0.0, "cross_shear.ratio"),
        (0.1, f64::INFINITY, "cross_shear.ratio"),
        (0.1, 51.0, "cross_shear.ratio = 51 is not resolved"),
        (5.0, 10.0, "cross_shear.amplitude = 5 is not resolved"),
    ] {
        refused(&suspension(&[crossed(0.0, amplitude, ratio)]), expected);
    }
}
