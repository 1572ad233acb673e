//! Runs in segments: steps of rate and stress, reversals, oscillations.

use sd_core::cell::Cell;
use sd_core::instant::{Configuration, InstantContacts, solve};
use sd_core::model::{Segment, StartLayer};
use sd_core::modes::Vec2;
use sd_core::{
    ContactLaws, ContactScheme, Hydrodynamics, Layer, NearFields, Params, Sample, Simulation,
    Snapshot, TangentialLaw, VelocityGradient,
};
use std::f64::consts::PI;

/// A dense layer of rough rigid spheres with friction.
fn layer(segments: &[Segment]) -> Params {
    let steady = Params::builder()
        .spheres(40)
        .area_fraction(0.70)
        .roughness(0.01)
        .friction(0.5)
        .shear_rate(10.0)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(ContactScheme::Rigid)
        .time_step(0.01)
        .build()
        .unwrap();
    Params {
        segments: segments.to_vec(),
        ..steady
    }
}

/// A dense layer of soft spheres, whose springs have a memory.
fn springs(segments: &[Segment]) -> Params {
    Params {
        contact: ContactScheme::Laws(ContactLaws::linear_spring(
            2e3,
            TangentialLaw::StickSlide,
            0.01,
        )),
        ..layer(segments)
    }
}

fn begin(params: &Params, seed: u64) -> Simulation {
    params.validate().unwrap();
    Simulation::<Layer>::new(params, seed, &NearFields::default()).unwrap()
}

/// Time steps in a strain.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "strains are 0 or more"
)]
fn count(strain: f64, time_step: f64) -> u64 {
    (strain / time_step).round() as u64
}

fn steps(run: &mut Simulation, steps: u64) -> Vec<Sample> {
    (0..steps).map(|_| run.step().unwrap()).collect()
}

/// Reversal, steps of rate and stress, and an oscillation.
fn protocol() -> Vec<Segment> {
    let at = |start| Segment {
        start,
        ..Segment::default()
    };
    vec![
        at(0.0),
        Segment {
            direction: Some(-1.0),
            ..at(0.5)
        },
        Segment {
            shear_rate: Some(0.3),
            ..at(0.8)
        },
        Segment {
            shear_stress: Some(3.0),
            ..at(1.0)
        },
        Segment {
            amplitude: Some(0.1),
            ..at(1.2)
        },
        Segment {
            direction: Some(-1.0),
            ..at(1.7)
        },
    ]
}

#[test]
fn one_segment_is_the_run_without_any() {
    for params in [layer, springs] {
        let one = params(&[Segment::default()]);
        let samples = steps(&mut begin(&one, 3), 40);
        assert_eq!(samples, steps(&mut begin(&params(&[]), 3), 40));
    }
}

#[test]
fn what_is_imposed_follows_the_segments() {
    let params = layer(&protocol());
    let imposed = |strain: f64| params.imposed(count(strain, 0.01));
    let of = |strain: f64| {
        let imposed = imposed(strain);
        (imposed.segment, imposed.direction)
    };
    assert_eq!([of(0.0), of(0.49)], [(0, 1.0); 2]);
    assert_eq!([of(0.5), of(0.79)], [(1, -1.0); 2]);
    assert_eq!(of(0.8), (2, 1.0));
    // Quarters of 0.1: forwards, twice backwards, forwards, and on.
    assert_eq!([of(1.2), of(1.29)], [(4, 1.0); 2]);
    assert_eq!([of(1.3), of(1.49)], [(4, -1.0); 2]);
    assert_eq!([of(1.5), of(1.69)], [(4, 1.0); 2]);
    assert_eq!(of(1.7), (5, -1.0));
    for (strain, net) in [
        (0.3, 0.3),
        (0.5, 0.5),
        (0.8, 0.2),
        (1.2, 0.6),
        (1.3, 0.7),
        (1.5, 0.5),
        (1.6, 0.6),
        (1.7, 0.7),
        (1.9, 0.5),
    ] {
        let found = params.net_strain(count(strain, 0.01));
        assert!((found - net).abs() < 1e-12, "{strain}: {found} for {net}");
    }
}

#[test]
fn oscillation_takes_the_time_of_a_sine() {
    let params = layer(&[Segment {
        amplitude: Some(0.2),
        ..Segment::default()
    }]);
    let passed = |step: u64| 0.01 / params.imposed(step).rate_share;
    // ωt = asin γ/γ0, and the largest rate is γ0 ω = 1 here.
    let mut time = 0.0;
    for step in 0..20 {
        time += passed(step);
        let phase = (0.01 * (step + 1) as f64 / 0.2).asin();
        assert!((time / 0.2 - phase).abs() < 1e-12);
    }
    let cycle: f64 = (0..80).map(passed).sum();
    assert!((cycle - 0.2 * std::f64::consts::TAU).abs() < 1e-12);
}

#[test]
fn temperature_and_pressure_are_constant_over_an_oscillation() {
    let shaken = |params: Params| Params {
        segments: vec![Segment {
            amplitude: Some(0.2),
            ..Segment::default()
        }],
        ..params
    };
    // kT, in units of the rate of a step, times that rate.
    let hot = shaken(Params {
        peclet: 1000.0,
        ..layer(&[])
    });
    let pressed = shaken(Params {
        viscous_number: Some(0.1),
        ..layer(&[])
    });
    for step in 0..80 {
        let share = hot.imposed(step).rate_share;
        let of_step = |params: &Params| params.in_step(&params.imposed(step));
        let energy = share * of_step(&hot).thermal_energy().unwrap();
        assert!((energy / (6.0 * PI / 1000.0) - 1.0).abs() < 1e-12, "{step}");
        let pressure = share / of_step(&pressed).viscous_number.unwrap();
        assert!((pressure / 10.0 - 1.0).abs() < 1e-12, "{step}");
    }
    // Steps that are short enough at the largest rate are not at the turning points.
    hot.validate().unwrap();
    let steady = Params {
        peclet: 100.0,
        ..layer(&[])
    };
    steady.validate().unwrap();
    let error = shaken(steady).validate().unwrap_err().to_string();
    assert!(error.contains("its slowest step"), "{error}");
}

/// The viscosity of the layer at the end of a run, without contacts.
fn without_contacts(snapshot: &Snapshot, params: &Params) -> f64 {
    let StartLayer { side, offset, .. } = snapshot.layer(params).unwrap();
    let configuration: Configuration = Configuration {
        centres: snapshot
            .centres
            .iter()
            .map(|x| Vec2::new(x[0], x[1]))
            .collect(),
        radii: snapshot.radii.clone(),
        cell: Cell::equal_sides(side, offset).unwrap(),
        hydrodynamics: params.hydrodynamics,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vec2::zeros(); params.spheres],
        torques: vec![0.0; params.spheres],
    };
    let solved = solve(
        &configuration,
        &InstantContacts::None,
        &NearFields::default(),
    )
    .unwrap();
    solved.stress.unwrap().viscosity
}

/// Contact stresses in the last step before a reversal and in the first after it, and the snapshot
/// between.
fn reversed(params: &Params, seed: u64) -> ([f64; 2], Sample, Snapshot) {
    let mut run = begin(params, seed);
    let before = *steps(&mut run, count(1.5, params.time_step))
        .last()
        .unwrap();
    let snapshot = run.snapshot();
    let after = run.step().unwrap();
    let contact = |s: &Sample| s.stress.shear.normal_contact + s.stress.shear.tangential_contact;
    (
        [before, after].map(|sample| contact(&sample)),
        after,
        snapshot,
    )
}

/// A run that is reversed after a strain of 1.5.
fn reversal() -> [Segment; 2] {
    let back = Segment {
        start: 1.5,
        direction: Some(-1.0),
        ..Segment::default()
    };
    [Segment::default(), back]
}

#[test]
fn contacts_bear_next_to_nothing_at_the_first_instant_after_a_reversal() {
    // Pairs that were pressed together by others along the extension axis are now compressed by the
    // flow: 4 % of the contact stress remains.
    let (mut before, mut after) = (0.0, 0.0);
    for seed in 1..=8 {
        let ([loaded, unloaded], ..) = reversed(&layer(&reversal()), seed);
        before += loaded;
        after += unloaded;
    }
    assert!(after < 0.1 * before, "{after} {before}");
    // In a thinner layer most contacts were pressed by the flow alone, and all of them open.
    let mut open = 0;
    for seed in 1..=8 {
        let params = Params {
            area_fraction: 0.55,
            time_step: 1e-3,
            ..layer(&reversal())
        };
        let ([loaded, unloaded], first, snapshot) = reversed(&params, seed);
        assert!(
            loaded > 0.1 && unloaded < 0.01 * loaded,
            "{loaded} {unloaded}"
        );
        if unloaded == 0.0 {
            open += 1;
            // The hydrodynamic stress is linear in the flow: without contacts the viscosity is the
            // same in both directions.
            let alone = without_contacts(&snapshot, &params);
            assert!((first.viscosity / alone - 1.0).abs() < 1e-9);
        }
    }
    assert!(open >= 4, "{open}");
}

#[test]
fn spheres_that_never_touch_return_with_every_cycle() {
    let error = |time_step: f64| {
        let params = Params {
            area_fraction: 0.3,
            spheres: 20,
            friction: 0.0,
            shear_rate: 0.0,
            roughness: 1e-4,
            time_step,
            ..layer(&[Segment {
                amplitude: Some(0.4),
                ..Segment::default()
            }])
        };
        let mut run = begin(&params, 5);
        let start = run.snapshot();
        let cycle = count(1.6, time_step);
        let samples = steps(&mut run, 2 * cycle);
        assert!(samples.iter().all(|sample| sample.contacts == 0));
        let end = run.snapshot();
        let positions = start.centres.iter().zip(&end.centres);
        let moved = positions.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]));
        moved.fold(0.0, f64::max)
    };
    let [coarse, fine] = [0.02, 0.01].map(error);
    assert!(coarse < 1e-6, "{coarse:.1e}");
    // The integrator is of order four.
    assert!(fine < coarse / 8.0, "{coarse:.1e} {fine:.1e}");
}

#[test]
fn a_segment_goes_on_as_a_run_that_begins_with_the_layer() {
    for params in [layer, springs] {
        let segments = protocol();
        let whole = params(&segments);
        for (number, segment) in segments.iter().enumerate().skip(1) {
            let mut run = begin(&whole, 7);
            let start = segment.start;
            steps(&mut run, count(start, 0.01));
            let flow = whole.flows().swap_remove(number);
            let second = Params {
                start: Some(run.snapshot().layer(&whole).unwrap().into()),
                segments: vec![Segment {
                    amplitude: segment.amplitude,
                    ..Segment::default()
                }],
                ..flow
            };
            for (a, b) in steps(&mut run, 15)
                .iter()
                .zip(steps(&mut begin(&second, 7), 15))
            {
                let difference = (a.viscosity / b.viscosity - 1.0).abs();
                assert!(difference < 1e-5, "segment {number}: {difference:.1e}");
                let difference = (a.shear_rate / b.shear_rate - 1.0).abs();
                assert!(difference < 1e-5, "segment {number}: {difference:.1e}");
            }
        }
    }
}

#[test]
fn a_run_resumes_with_the_same_bits_from_every_step() {
    for params in [layer, springs] {
        let params = params(&protocol());
        params.validate().unwrap();
        crate::common::resumed::check::<Layer>(&params, 180, 5);
    }
}

#[test]
fn a_protocol_that_cannot_be_is_refused() {
    let two = |second| layer(&[Segment::default(), second]);
    let at = |start| Segment {
        start,
        ..Segment::default()
    };
    for (params, key) in [
        (layer(&[at(1.0)]), "start"),
        (two(at(0.0)), "start"),
        (two(at(0.005)), "start"),
        (two(at(f64::NAN)), "start"),
        (
            two(Segment {
                direction: Some(0.5),
                ..at(1.0)
            }),
            "direction",
        ),
        (
            two(Segment {
                shear_rate: Some(-1.0),
                ..at(1.0)
            }),
            "shear_rate",
        ),
        (
            two(Segment {
                shear_rate: Some(1.0),
                shear_stress: Some(1.0),
                ..at(1.0)
            }),
            "shear_stress",
        ),
        (
            two(Segment {
                amplitude: Some(0.1),
                shear_stress: Some(1.0),
                ..at(1.0)
            }),
            "shear_stress",
        ),
        (
            two(Segment {
                amplitude: Some(0.025),
                ..at(1.0)
            }),
            "amplitude",
        ),
        (
            two(Segment {
                amplitude: Some(0.0),
                ..at(1.0)
            }),
            "amplitude",
        ),
        (
            springs(&[
                Segment::default(),
                Segment {
                    shear_rate: Some(0.0),
                    ..at(1.0)
                },
            ]),
            "shear_rate",
        ),
    ] {
        let error = params.validate().unwrap_err().to_string();
        assert!(error.contains(key), "{key}: {error}");
    }
}
