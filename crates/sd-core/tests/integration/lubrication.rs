//! Leading-order lubrication: against a published code, by identities, and with every law of
//! contact.

use nalgebra::Vector3;
use sd_core::cell::Cell;
use sd_core::instant::{Configuration, InstantContacts, SolvedConfiguration, solve};
use sd_core::internals::Resistance;
use sd_core::modes::Vec2;
use sd_core::{
    ContactLaws, ContactScheme, Error, Flow, FrictionOnset, Hydrodynamics, LeadingOrder,
    NearFields, NormalLaw, Params, Simulation, Snapshot, StiffnessUnit, Strains, TangentialLaw,
    VelocityGradient,
};
use serde_json::Value;

const LUBRICATION: Hydrodynamics = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);

fn reference() -> Value {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/data/lubrication_instant.json"
    );
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Spheres of radius 1 of one case of the reference.
fn layer_of(case: &Value) -> Configuration {
    let number = |value: &Value| value.as_f64().unwrap();
    let list = case["centres"].as_array().unwrap();
    let centres: Vec<Vec2> = list
        .iter()
        .map(|x| Vec2::new(number(&x[0]), number(&x[1])))
        .collect();
    let n = centres.len();
    Configuration {
        centres,
        radii: vec![1.0; n],
        cell: Cell::periodic(
            Vec2::new(number(&case["cell"][0]), number(&case["cell"][1])),
            number(&case["offset"]),
        )
        .unwrap(),
        hydrodynamics: Hydrodynamics::Lubrication(LeadingOrder {
            // For radii of 1 the gap is ξ.
            cutoff: number(&case["cutoff_gap"]),
            regularisation: number(&case["regularisation"]),
        }),
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vec2::zeros(); n],
        torques: vec![0.0; n],
    }
}

/// Correlation of two lists of numbers.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let product = |x: &[f64], m: f64, y: &[f64], n: f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - m) * (y - n)).sum()
    };
    let together = product(a, mean_a, b, mean_b);
    together / (product(a, mean_a, a, mean_a) * product(b, mean_b, b, mean_b)).sqrt()
}

#[test]
fn contact_forces_and_viscosity_are_those_of_a_published_code() {
    for case in reference()["cases"].as_array().unwrap() {
        let layer = layer_of(case);
        let theirs = case["contacts"].as_array().unwrap();
        let number = |c: &Value, key: &str| usize::try_from(c[key].as_u64().unwrap()).unwrap();
        let pairs = theirs
            .iter()
            .map(|c| [number(c, "i"), number(c, "j")])
            .collect();
        let instant = solve(
            &layer,
            &InstantContacts::HeldPairs { pairs },
            &NearFields::default(),
        )
        .unwrap();
        let (mut ours, mut published) = (Vec::new(), Vec::new());
        for c in theirs {
            let same = |o: &&sd_core::contact::Contact| {
                (o.pair.i, o.pair.j) == (number(c, "i"), number(c, "j"))
            };
            let found = instant.contacts.iter().find(same).unwrap();
            assert!((found.pair.gap - c["gap"].as_f64().unwrap()).abs() < 2e-5);
            ours.push(found.normal_force);
            published.push(c["normal_force"].as_f64().unwrap());
        }
        let sums = [&ours, &published].map(|forces| forces.iter().sum::<f64>());
        let sum = sums[0] / sums[1] - 1.0;
        assert!(sum.abs() < 0.01, "sum of forces: {sum:.4}");
        let correlation = correlation(&ours, &published);
        assert!(correlation > 0.998, "correlation {correlation:.5}");
        let viscosity =
            instant.stress.unwrap().viscosity / case["viscosity"].as_f64().unwrap() - 1.0;
        assert!(viscosity.abs() < 0.005, "viscosity: {viscosity:.4}");
        // With the exact pair functions the forces differ clearly, so the agreement is specific to
        // the model.
        let exact = Configuration {
            hydrodynamics: Hydrodynamics::BallMelrose,
            // The exact functions need gaps.
            centres: layer.centres.iter().map(|x| x * 1.001).collect(),
            cell: match layer.cell {
                Cell::Periodic(lattice) => {
                    let sides = Vec2::from_column_slice(lattice.lengths());
                    Cell::periodic(1.001 * sides, 1.001 * lattice.offset()).unwrap()
                }
                Cell::Unbounded => Cell::Unbounded,
            },
            ..layer
        };
        let pairs = theirs
            .iter()
            .map(|c| [number(c, "i"), number(c, "j")])
            .collect();
        let instant = solve(
            &exact,
            &InstantContacts::HeldPairs { pairs },
            &NearFields::default(),
        )
        .unwrap();
        let sum: f64 = instant.contacts.iter().map(|c| c.normal_force).sum();
        assert!(sum < 0.85 * sums[1], "{sum} against {}", sums[1]);
    }
}

#[test]
fn resistance_is_symmetric_and_positive_definite_where_spheres_overlap() {
    let layer = layer_of(&reference()["cases"][0]);
    // Two sizes, some of them deep in each other.
    let radii: Vec<f64> = (0..90)
        .map(|i| if i % 3 == 0 { 1.1 } else { 0.95 })
        .collect();
    for pairwise in [false, true] {
        let tables = NearFields::default();
        let mut resistance = if pairwise {
            Resistance::new_pairwise(LUBRICATION, &layer.cell, &radii, &tables, &[]).unwrap()
        } else {
            Resistance::new(LUBRICATION, &layer.cell, &radii, &tables).unwrap()
        };
        let refused = resistance.update(&layer.cell, &layer.centres);
        assert!(matches!(refused, Err(Error::Overlap { .. })));
        resistance.regularise(0.0, f64::INFINITY);
        resistance.update(&layer.cell, &layer.centres).unwrap();
        let deepest = resistance
            .neighbours()
            .iter()
            .map(|p| p.gap)
            .fold(0.0, f64::min);
        assert!(deepest < -0.05, "{deepest}");
        let motion = |seed: f64| -> (Vec<f64>, Vector3<f64>) {
            let v = (0..270).map(|k| (seed * f64::from(k)).sin()).collect();
            (v, Vector3::new(seed.cos(), seed.sin(), 0.5))
        };
        // v'R w of motions and strains common to all spheres, as forces on v and stresslets on the
        // strain.
        let form = |(v, e): &(Vec<f64>, Vector3<f64>), (w, strain): &(Vec<f64>, Vector3<f64>)| {
            let (mut work, mut forces, mut stresslets) = (Vec::new(), Vec::new(), Vec::new());
            resistance.apply(
                w,
                Strains::Uniform(*strain),
                &mut work,
                &mut forces,
                &mut stresslets,
            );
            let moved: f64 = v.iter().zip(&forces).map(|(v, f)| v * f).sum();
            let strained: f64 = stresslets.iter().map(|s| s.dot(e)).sum();
            moved + strained
        };
        for seed in [0.3, 1.7, 2.9, 11.1] {
            let (a, b) = (motion(seed), motion(seed + 0.5));
            let (one, two) = (form(&a, &b), form(&b, &a));
            let scale = (form(&a, &a) * form(&b, &b)).sqrt();
            assert!(form(&a, &a) > 0.0 && form(&b, &b) > 0.0);
            assert!((one - two).abs() < 1e-11 * scale, "{one} {two}");
        }
    }
}

/// The layer of these tests.
fn params(contact: ContactScheme) -> Params {
    crate::common::small_layer(contact, LUBRICATION)
}

/// Every normal law with every compatible tangential law.
fn schemes() -> Vec<ContactScheme> {
    let mut all = vec![ContactScheme::Rigid];
    for tangential in [
        TangentialLaw::RollSlip,
        TangentialLaw::StickSlide,
        TangentialLaw::Coulomb,
        TangentialLaw::StickRotate,
    ] {
        for (normal, stiffness) in [
            (NormalLaw::Rigid, f64::INFINITY),
            (NormalLaw::LinearSpring, 1e4),
            (NormalLaw::Hertz, 1e5),
        ] {
            let rigid = normal == NormalLaw::Rigid;
            if rigid && (tangential.has_spring() || tangential == TangentialLaw::RollSlip) {
                continue;
            }
            let soft = ContactLaws::linear_spring(stiffness, tangential, 0.01);
            all.push(ContactScheme::Laws(ContactLaws {
                normal,
                stiffness_unit: if rigid {
                    StiffnessUnit::CriticalLoad
                } else {
                    StiffnessUnit::Flow
                },
                onset: if rigid {
                    FrictionOnset::CriticalLoad
                } else {
                    FrictionOnset::Reduced
                },
                // Lubrication keeps itself finite.
                lubrication_gap: 0.0,
                ..soft
            }));
        }
    }
    all.push(ContactScheme::Laws(ContactLaws {
        normal: NormalLaw::ExponentialRepulsion,
        repulsion: 1.0,
        repulsion_length: 0.02,
        ..ContactLaws::PAPER
    }));
    all
}

fn run(params: &Params, seed: u64, steps: u64) -> Simulation {
    let mut simulation =
        Simulation::<sd_core::Layer>::new(params, seed, &NearFields::default()).unwrap();
    for _ in 0..steps {
        simulation.step().unwrap();
    }
    assert_eq!(simulation.flow(), Flow::Flowing, "{params:?}");
    simulation
}

/// The layer of a snapshot as a single instant.
fn instant(params: &Params, snapshot: &Snapshot) -> (SolvedConfiguration, f64) {
    let strain = snapshot.steps as f64 * params.time_step;
    let cell = Cell::equal_sides(snapshot.side, strain * snapshot.side).unwrap();
    let configuration = Configuration {
        centres: snapshot
            .centres
            .iter()
            .map(|&[x, y]| Vec2::new(x, y))
            .collect(),
        radii: snapshot.radii.clone(),
        cell,
        hydrodynamics: params.hydrodynamics,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vec2::zeros(); params.spheres],
        torques: vec![0.0; params.spheres],
    };
    let request = InstantContacts::of_run(params, 0.005);
    let volume = 2.0 * snapshot.side.powi(2);
    (
        solve(&configuration, &request, &NearFields::default()).unwrap(),
        volume,
    )
}

#[test]
fn energy_balances_under_every_law() {
    for contact in schemes() {
        let params = params(contact);
        let snapshot = run(&params, 4, 80).snapshot();
        let (instant, volume) = instant(&params, &snapshot);
        let stress = instant.stress.unwrap();
        let taken = stress.dissipation + instant.contact_power() / volume;
        let (left, right) = (stress.viscosity - 1.0, taken);
        assert!(
            (left - right).abs() < 1e-10 * left,
            "{contact:?}: {left} against {right}"
        );
    }
}

/// The contact law of the field: springs between the surfaces themselves, in units of the flow.
fn field(stiffness: f64) -> ContactScheme {
    ContactScheme::Laws(ContactLaws {
        stiffness_unit: StiffnessUnit::Flow,
        onset: FrictionOnset::Reduced,
        lubrication_gap: 0.0,
        ..ContactLaws::linear_spring(stiffness, TangentialLaw::StickSlide, 0.0)
    })
}

#[test]
fn smooth_springs_overlap_according_to_their_forces() {
    let params = Params {
        roughness: 0.0,
        ..params(field(1e4))
    };
    let mut layer = run(&params, 2, 200);
    let sample = layer.step().unwrap();
    assert!(sample.contacts > 10 && sample.minimum_gap < 0.0);
    let (instant, _) = instant(&params, &layer.snapshot());
    let stiffness = 1e4 * 6.0 * std::f64::consts::PI;
    let mut overlapping = 0;
    for c in &instant.contacts {
        // Forces look ahead by the time span of the instant.
        let ahead = -c.pair.gap - 0.005 * c.normal_velocity;
        let expected = stiffness * ahead.max(0.0);
        assert!((c.normal_force - expected).abs() < 1e-6, "{c:?} {expected}");
        overlapping += u32::from(c.pair.gap < 0.0 && c.normal_force > 0.0);
    }
    assert!(overlapping > 10, "{overlapping}");
}

#[test]
fn stiffness_in_either_unit_is_the_same_spring() {
    // Γ = 4: a load of 6π/4, so that k in F_crit/a is four times k in units of the flow.
    let at = |unit, stiffness| {
        let ContactScheme::Laws(laws) = field(stiffness) else {
            unreachable!()
        };
        let contact = ContactScheme::Laws(ContactLaws {
            stiffness_unit: unit,
            ..laws
        });
        run(
            &Params {
                shear_rate: 4.0,
                roughness: 0.0,
                ..params(contact)
            },
            6,
            40,
        )
        .snapshot()
    };
    let (flow, load) = (
        at(StiffnessUnit::Flow, 1e4),
        at(StiffnessUnit::CriticalLoad, 4e4),
    );
    for (a, b) in flow
        .centres
        .iter()
        .flatten()
        .zip(load.centres.iter().flatten())
    {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}

#[test]
fn springs_in_units_of_the_flow_have_plateaus() {
    let viscosity = |shear_rate: f64, friction: f64| {
        let params = Params {
            shear_rate,
            friction,
            roughness: 0.0,
            ..params(field(1e4))
        };
        let mut layer = run(&params, 9, 150);
        layer.step().unwrap().viscosity
    };
    // Inactive friction is none; a negligible critical load is the upper plateau.
    assert_eq!(viscosity(0.0, 0.5).to_bits(), viscosity(0.0, 0.0).to_bits());
    let (limit, near) = (viscosity(f64::INFINITY, 0.5), viscosity(1e9, 0.5));
    assert!((near / limit - 1.0).abs() < 1e-3, "{near} {limit}");
    assert!(limit > 1.05 * viscosity(0.0, 0.5));
}

#[test]
fn numbers_that_make_no_sense_are_refused() {
    let with = |cutoff, regularisation| Params {
        hydrodynamics: Hydrodynamics::Lubrication(LeadingOrder {
            cutoff,
            regularisation,
        }),
        ..params(ContactScheme::Rigid)
    };
    with(0.5, 1e-3).validate().unwrap();
    with(0.999, 1e-3).validate().unwrap();
    for (bad, key) in [
        (with(0.0, 1e-3), "lubrication_cutoff"),
        (with(5.0, 1e-3), "lubrication_cutoff"),
        (with(1.0, 1e-3), "lubrication_cutoff"),
        (with(0.5, 0.0), "lubrication_regularisation"),
        (with(f64::NAN, 1e-3), "lubrication_cutoff"),
        (
            Params {
                roughness: 0.0,
                ..params(ContactScheme::Rigid)
            },
            "roughness",
        ),
        (
            Params {
                roughness: 0.0,
                ..params(ContactScheme::Procedure)
            },
            "roughness",
        ),
    ] {
        let error = bad.validate().unwrap_err();
        assert!(
            matches!(&error, Error::Refused(refusal) if refusal.key == key),
            "{error}"
        );
    }
}
