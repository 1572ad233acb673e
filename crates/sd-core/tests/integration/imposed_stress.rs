//! Imposed stress: the rate follows from the stress at every stage.

use crate::common::schemes::rigid_springs;
use sd_core::cell::Cell;
use sd_core::contact::Quality;
use sd_core::instant::{Configuration, InstantContacts, solve};
use sd_core::internals::{Rosenbrock, State};
use sd_core::modes::Vec2;
use sd_core::{
    ContactLaws, ContactScheme, FrictionOnset, Hydrodynamics, NearFields, NormalLaw, Params,
    Sample, Simulation, Snapshot, TangentialLaw, VelocityGradient,
};
use std::f64::consts::PI;

fn params(contact: ContactScheme) -> Params {
    Params::builder()
        .spheres(40)
        .area_fraction(0.68)
        .roughness(0.01)
        .friction(0.5)
        .shear_stress(3.0)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(contact)
        .time_step(0.005)
        .build()
        .unwrap()
}

/// These parameters at an imposed rate.
fn at_rate(params: &Params, shear_rate: f64) -> Params {
    Params {
        shear_rate,
        shear_stress: None,
        ..params.clone()
    }
}

fn run(params: &Params, seed: u64, steps: u64) -> (Vec<Sample>, Simulation) {
    let mut simulation =
        Simulation::<sd_core::Layer>::new(params, seed, &NearFields::default()).unwrap();
    let samples = (0..steps).map(|_| simulation.step().unwrap()).collect();
    (samples, simulation)
}

fn rigid(tangential: TangentialLaw, onset: FrictionOnset) -> ContactScheme {
    ContactScheme::Laws(ContactLaws {
        tangential,
        onset,
        ..ContactLaws::PAPER
    })
}

fn soft(tangential: TangentialLaw, onset: FrictionOnset, repulsion: f64) -> ContactScheme {
    ContactScheme::Laws(ContactLaws {
        onset,
        repulsion,
        repulsion_length: if repulsion > 0.0 { 0.02 } else { 0.0 },
        ..ContactLaws::linear_spring(2e3, tangential, 0.01)
    })
}

/// These contacts with rolling friction and adhesion.
fn with(contact: ContactScheme, rolling_friction: f64, adhesion: f64) -> ContactScheme {
    ContactScheme::Laws(ContactLaws {
        rolling_friction,
        adhesion,
        ..*contact.laws()
    })
}

/// Every kind of law: nothing, the active set, or all forces depend on the critical load.
fn schemes() -> Vec<ContactScheme> {
    use FrictionOnset::{CriticalLoad, Reduced};
    use TangentialLaw::{Coulomb, RollSlip, StickRotate, StickSlide};
    vec![
        ContactScheme::Rigid,
        ContactScheme::Procedure,
        rigid(Coulomb, CriticalLoad),
        rigid(Coulomb, Reduced),
        rigid(StickRotate, CriticalLoad),
        with(rigid(Coulomb, CriticalLoad), 0.1, 0.0),
        with(rigid(Coulomb, CriticalLoad), 0.1, 1.0),
        rigid_springs(1e4),
        with(rigid_springs(1e4), 0.1, 0.0),
        with(soft(StickSlide, CriticalLoad, 0.0), 0.1, 1.0),
        soft(StickSlide, CriticalLoad, 0.0),
        soft(StickSlide, Reduced, 2.0),
        soft(RollSlip, Reduced, 0.0),
        ContactScheme::Laws(ContactLaws {
            normal: NormalLaw::Hertz,
            stiffness: 2e4,
            ..*soft(Coulomb, CriticalLoad, 0.0).laws()
        }),
    ]
}

#[test]
fn stress_is_viscosity_times_rate_under_every_law() {
    for contact in schemes() {
        let params = params(contact);
        let (samples, simulation) = run(&params, 3, 120);
        let mut rates: Vec<f64> = Vec::new();
        for sample in &samples {
            let stress = sample.viscosity * sample.shear_rate / (6.0 * PI);
            assert!((stress / 3.0 - 1.0).abs() < 1e-9, "{contact:?}: {stress}");
            rates.push(sample.shear_rate);
        }
        let counters = simulation.counters();
        assert_eq!(counters.unconverged_stages, 0, "{contact:?}");
        // For every stage, not only sampled ones: the deviation from the balance counts as a
        // residual. Spheres under stick-rotate come close to jamming, and their gaps hold only to
        // the tolerance of the solver.
        let welds = contact.laws().tangential == TangentialLaw::StickRotate;
        let limit = if welds { Quality::RESIDUAL_LIMIT } else { 1e-9 };
        assert!(counters.worst_residual < limit, "{contact:?}");
        let spread = rates.iter().fold(0.0, |most: f64, rate| {
            most.max((rate / rates[0]).ln().abs())
        });
        assert!(spread > 0.05, "{contact:?}: the rate follows the layer");
        assert!(samples.iter().any(|s| s.activated > 0), "{contact:?}");
    }
}

#[test]
fn without_friction_the_path_is_that_of_the_imposed_rate() {
    for hydrodynamics in [Hydrodynamics::BallMelrose, Hydrodynamics::StokesianDynamics] {
        for contact in [ContactScheme::Rigid, ContactScheme::Procedure] {
            let at_stress = Params {
                friction: 0.0,
                hydrodynamics,
                ..params(contact)
            };
            let (one, a) = run(&at_stress, 5, 100);
            let (two, b) = run(&at_rate(&at_stress, 7.0), 5, 100);
            for (a, b) in one.iter().zip(&two) {
                assert!((a.viscosity / b.viscosity - 1.0).abs() < 1e-10);
            }
            let (a, b) = (a.snapshot(), b.snapshot());
            for (x, y) in a.centres.iter().zip(&b.centres) {
                assert!((x[0] - y[0]).abs() < 1e-10 && (x[1] - y[1]).abs() < 1e-10);
            }
        }
    }
}

#[test]
fn viscosity_is_that_of_the_imposed_rate_which_was_found() {
    use FrictionOnset::Reduced;
    // Rigid contacts are sampled in the middle of the step, where the rate is not quite that of its
    // first stage.
    for (contact, close) in [
        (rigid(TangentialLaw::Coulomb, Reduced), 1e-6),
        (soft(TangentialLaw::Coulomb, Reduced, 0.0), 1e-7),
        (soft(TangentialLaw::Coulomb, Reduced, 2.0), 1e-7),
    ] {
        let params = params(contact);
        let (_, mut simulation) = run(&params, 4, 100);
        let snapshot = simulation.snapshot();
        let sample = simulation.step().unwrap();
        assert!(sample.activated > 0);
        let step_at = |shear_rate| {
            let at_rate = at_rate(&params, shear_rate);
            let snapshot = Snapshot {
                critical_load: None,
                ..snapshot.clone()
            };
            let layer = Simulation::from_snapshot(&at_rate, snapshot, &NearFields::default());
            layer.unwrap().step().unwrap().viscosity
        };
        let found = step_at(sample.shear_rate);
        assert!(
            (found / sample.viscosity - 1.0).abs() < close,
            "{contact:?}: {found} and {}",
            sample.viscosity
        );
        if params.contact.laws().is_soft() {
            let found = instant(&params, &snapshot, &sample);
            assert!((found / sample.viscosity - 1.0).abs() < 1e-7);
        }
        // And at another rate it is another.
        assert!((step_at(2.0 * sample.shear_rate) / sample.viscosity - 1.0).abs() > 1e-4);
    }
}

/// Viscosity of the layer at the start of a soft step, at the rate of the sample, solved as a
/// single instant.
fn instant(params: &Params, snapshot: &Snapshot, sample: &Sample) -> f64 {
    let configuration: Configuration = Configuration {
        centres: snapshot
            .centres
            .iter()
            .map(|x| Vec2::new(x[0], x[1]))
            .collect(),
        radii: snapshot.radii.clone(),
        cell: Cell::equal_sides(snapshot.side, sample.strain * snapshot.side).unwrap(),
        hydrodynamics: params.hydrodynamics,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vec2::zeros(); params.spheres],
        torques: vec![0.0; params.spheres],
    };
    let mut span = 0.0;
    let mut state: State = State {
        centres: vec![Vec2::zeros()],
        orientations: vec![0.0],
    };
    let taken = Rosenbrock::default().step(&mut state, 0.0, params.time_step, |stage, _, _| {
        span = stage.span;
        Ok::<(), ()>(())
    });
    taken.unwrap();
    let request = InstantContacts::of_run(&at_rate(params, sample.shear_rate), span);
    let solved = solve(&configuration, &request, &NearFields::default()).unwrap();
    solved.stress.unwrap().viscosity
}

#[test]
fn low_and_high_stress_are_the_plateaus() {
    for contact in [
        ContactScheme::Rigid,
        rigid(TangentialLaw::Coulomb, FrictionOnset::Reduced),
    ] {
        for (stress, rate) in [(1e-6, 0.0), (1e9, f64::INFINITY)] {
            let at_stress = Params {
                shear_stress: Some(stress),
                ..params(contact)
            };
            let (one, _) = run(&at_stress, 2, 40);
            let (two, _) = run(&at_rate(&at_stress, rate), 2, 40);
            for (a, b) in one.iter().zip(&two) {
                let difference = (a.viscosity / b.viscosity - 1.0).abs();
                assert!(
                    difference < 1e-5,
                    "{contact:?} at {stress}: {difference:.1e}"
                );
            }
        }
    }
}

#[test]
fn reversed_shear_is_the_mirror_image() {
    let forward = at_rate(&params(ContactScheme::Rigid), 10.0);
    let (_, simulation) = run(&forward, 8, 100);
    let end = simulation.snapshot();
    let offset = simulation.offset_at(simulation.strain());
    let layer = |sign: f64| sd_core::model::StartLayer {
        side: end.side,
        offset: sign * offset,
        radii: end.radii.clone(),
        centres: end.centres.iter().map(|x| [sign * x[0], x[1]]).collect(),
        orientations: end.orientations.iter().map(|angle| sign * angle).collect(),
        springs: Vec::new(),
        rolling_springs: Vec::new(),
        origin: None,
    };
    let from = |start: sd_core::model::StartLayer, direction| Params {
        start: Some(start.into()),
        direction,
        ..forward.clone()
    };
    // Continued shear of the layer equals reversed shear of its mirror image.
    let (on, a) = run(&from(layer(1.0), 1.0), 1, 40);
    let (mirrored, b) = run(&from(layer(-1.0), -1.0), 1, 40);
    for (one, two) in on.iter().zip(&mirrored) {
        assert!((one.viscosity / two.viscosity - 1.0).abs() < 1e-7);
        assert!((one.stress.n1.total() - two.stress.n1.total()).abs() < 1e-6);
        assert!((one.stress.n2.total() - two.stress.n2.total()).abs() < 1e-6);
    }
    let (a, b) = (a.snapshot(), b.snapshot());
    for (x, y) in a.orientations.iter().zip(&b.orientations) {
        assert!((x + y).abs() < 1e-6);
    }
    // After the reversal its contacts open: the layer flows more easily than before and than under
    // continued shear.
    let (back, _) = run(&from(layer(1.0), -1.0), 1, 40);
    assert!(back[0].viscosity < on[0].viscosity);
    assert!(back.iter().all(|sample| sample.viscosity > 1.0));
}

#[test]
fn run_from_the_end_of_another_continues_like_that() {
    let springs = soft(TangentialLaw::StickSlide, FrictionOnset::Reduced, 0.0);
    for contact in [
        rigid(TangentialLaw::Coulomb, FrictionOnset::CriticalLoad),
        springs,
    ] {
        for at_stress in [params(contact), at_rate(&params(contact), 10.0)] {
            let (_, mut whole) = run(&at_stress, 9, 60);
            let layer = whole.snapshot().layer(&at_stress).unwrap();
            assert_eq!(layer.springs.is_empty(), contact != springs);
            let second = Params {
                start: Some(layer.into()),
                ..at_stress.clone()
            };
            let (samples, _) = run(&second, 9, 20);
            for sample in samples {
                let on = whole.step().unwrap();
                let difference = (sample.viscosity / on.viscosity - 1.0).abs();
                assert!(difference < 1e-5, "{contact:?}: {difference:.1e}");
                assert_eq!(sample.contacts, on.contacts);
            }
        }
    }
}

/// Mean viscosity over strains from 1 on, mean over seeds, and the square of its standard error.
fn estimate(params: &Params) -> (f64, f64) {
    let means = (1..=6).map(|seed| {
        let (samples, _) = run(params, seed, 400);
        let kept = &samples[100..];
        kept.iter().map(|s| s.viscosity).sum::<f64>() / kept.len() as f64
    });
    let means: Vec<f64> = means.collect();
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    let squares: f64 = means.iter().map(|v| (v - mean).powi(2)).sum();
    (mean, squares / (n * (n - 1.0)))
}

/// Below, in and above the thickening, which is smooth at this area fraction: at most 3 standard
/// errors between the viscosity at a stress and that at the resulting rate.
fn curves_agree(contact: ContactScheme) {
    let mut viscosities = Vec::new();
    for stress in [0.03, 0.3, 30.0] {
        let at_stress = Params {
            shear_stress: Some(stress),
            area_fraction: 0.65,
            spheres: 25,
            time_step: 0.01,
            ..params(contact)
        };
        let (viscosity, variance) = estimate(&at_stress);
        let rate = 6.0 * PI * stress / viscosity;
        let (expected, other) = estimate(&at_rate(&at_stress, rate));
        let distance = (viscosity - expected).abs() / (variance + other).sqrt();
        assert!(
            distance < 3.0,
            "{contact:?} at {stress}: {viscosity} and {expected}, {distance} standard errors"
        );
        viscosities.push(viscosity);
    }
    // The rise is far larger than what is compared.
    assert!(viscosities[2] > 1.2 * viscosities[0], "{viscosities:?}");
}

#[test]
fn curves_of_imposed_stress_and_rate_agree_under_rigid_contacts() {
    curves_agree(rigid(TangentialLaw::Coulomb, FrictionOnset::CriticalLoad));
}

#[test]
fn curves_of_imposed_stress_and_rate_agree_under_springs() {
    curves_agree(soft(
        TangentialLaw::StickSlide,
        FrictionOnset::CriticalLoad,
        0.0,
    ));
}

#[test]
fn very_soft_layers_are_moved_in_shorter_steps() {
    // An undivided step of this layer would let spheres overlap too much.
    let springs = ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01);
    let params = Params {
        spheres: 30,
        area_fraction: 0.77,
        friction: 1.0,
        shear_stress: Some(1.0),
        size_ratio: 1.4,
        large_fraction: 0.337838,
        time_step: 0.02,
        ..params(ContactScheme::Laws(springs))
    };
    let tables = NearFields::default();
    let mut simulation = Simulation::<sd_core::Layer>::new(&params, 6, &tables).unwrap();
    let (mut stages, mut divided) = (0, 0);
    for _ in 0..30 {
        let before = simulation.snapshot();
        let sample = simulation.step().unwrap();
        // Two for each part of a step, without those of rejected attempts.
        let taken = sample.counters.stages - stages;
        assert!(taken.is_power_of_two() && taken >= 2, "{taken} stages");
        stages += taken;
        if taken > 2 {
            divided += 1;
            check_divided(&params, before, taken / 2, &sample);
        }
    }
    assert!(divided > 0, "no step was divided");
}

/// Checks that the sample of a step that was made in parts is that of its first part.
fn check_divided(params: &Params, mut before: Snapshot, parts: u64, sample: &Sample) {
    before.steps *= parts;
    let params = Params {
        time_step: params.time_step / parts as f64,
        ..params.clone()
    };
    let tables = NearFields::default();
    let mut fine = Simulation::from_snapshot(&params, before, &tables).unwrap();
    let first = fine.step().unwrap();
    assert_eq!(first.stress, sample.stress);
    assert_eq!(first.shear_rate, sample.shear_rate);
}
