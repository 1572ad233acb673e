//! Imposed pressure: the volume of the cell follows.

use crate::common::schemes::schemes;
use sd_core::contact::ContactState;
use sd_core::{
    Bulk, ContactLaws, ContactScheme, Hydrodynamics, Layer, LeadingOrder, NearFields, Params,
    RunSpace, Simulation, Snapshot, StiffnessUnit, TangentialLaw,
    model::{FlowType, PressureKind, SolverSettings},
    simulation::Flow,
};
use std::f64::consts::PI;

const LUBRICATION: Hydrodynamics = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);

/// Rigid spheres that begin at a fraction.
fn suspension(number: f64, fraction: f64, friction: f64) -> Params {
    let laws = ContactLaws {
        tangential: TangentialLaw::Coulomb,
        ..ContactLaws::PAPER
    };
    Params::builder()
        .spheres(40)
        .volume_fraction(fraction)
        .two_sizes(1.4, 0.25)
        .roughness(0.01)
        .friction(friction)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(LUBRICATION)
        .contact(ContactScheme::Laws(laws))
        .viscous_number(number)
        .build()
        .unwrap()
}

/// Soft spheres at J = 0.05.
fn soft(laws: ContactLaws, friction: f64) -> Params {
    let mut params = Params {
        contact: ContactScheme::Laws(laws),
        shear_rate: 1.0,
        ..suspension(0.05, 0.5, friction)
    };
    params.canonicalise();
    params
}

fn layer(number: f64) -> Params {
    Params::builder()
        .spheres(40)
        .area_fraction(0.6)
        .roughness(0.01)
        .friction(0.5)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .viscous_number(number)
        .build()
        .unwrap()
}

/// Mean pressures, fraction and viscosity from a strain on.
struct Means {
    pressure: f64,
    /// On planes across the gradient, tangential forces included.
    pressure_22: f64,
    fraction: f64,
    viscosity: f64,
}

fn means<S: RunSpace>(mut run: Simulation<S>, [from, to]: [f64; 2]) -> Means {
    let mut sums = [0.0; 4];
    let mut count = 0.0;
    while run.strain() < to {
        let sample = run.step().unwrap();
        if sample.strain >= from {
            let [xx, yy, zz] = [sample.stress.xx(), sample.stress.yy(), sample.stress.zz()];
            // That of the contacts, which the volume answers to.
            let fraction = sample.fraction.unwrap_or(run.fraction());
            let normal = [xx, yy, zz].map(|part| part.normal_contact + part.repulsion);
            let pressure = -normal.iter().sum::<f64>() / S::DIMENSIONS as f64;
            let across = -(normal[1] + yy.tangential_contact);
            let all = [pressure, fraction, sample.viscosity, across];
            for (sum, x) in sums.iter_mut().zip(all) {
                *sum += x;
            }
            count += 1.0;
        }
    }
    let [pressure, fraction, viscosity, pressure_22] = sums.map(|sum| sum / count);
    Means {
        pressure,
        pressure_22,
        fraction,
        viscosity,
    }
}

/// Means of three runs between two strains.
fn means_of_runs(params: &Params, strains: [f64; 2]) -> Means {
    let runs = [1, 2, 3].map(|seed| means(begun::<Bulk>(params, seed), strains));
    let mean = |of: fn(&Means) -> f64| runs.iter().map(of).sum::<f64>() / 3.0;
    Means {
        pressure: mean(|run| run.pressure),
        pressure_22: mean(|run| run.pressure_22),
        fraction: mean(|run| run.fraction),
        viscosity: mean(|run| run.viscosity),
    }
}

fn begun<S: RunSpace>(params: &Params, seed: u64) -> Simulation<S> {
    Simulation::new(params, seed, &NearFields::default()).unwrap()
}

#[test]
fn contacts_bear_the_imposed_pressure_from_any_start() {
    for number in [0.1, 0.01] {
        let runs = [0.45, 0.52]
            .map(|fraction| means_of_runs(&suspension(number, fraction, 0.0), [2.0, 5.0]));
        for run in &runs {
            let ratio = run.pressure * number;
            assert!((ratio - 1.0).abs() < 0.03, "{number}: {ratio}");
        }
        let [a, b] = runs.map(|run| run.fraction);
        assert!((a - b).abs() < 0.015, "{number}: {a} {b}");
    }
    let planar = means(begun::<Layer>(&layer(0.05), 1), [2.0, 6.0]);
    assert!(
        (planar.pressure * 0.05 - 1.0).abs() < 0.03,
        "{}",
        planar.pressure
    );
    assert!(
        planar.fraction > 0.62 && planar.fraction < 0.8,
        "{}",
        planar.fraction
    );
}

#[test]
fn the_pressure_at_an_imposed_fraction_gives_that_fraction() {
    let fixed = Params {
        viscous_number: None,
        ..suspension(1.0, 0.48, 0.3)
    };
    let fixed = means_of_runs(&fixed, [1.5, 5.0]);
    assert!((fixed.fraction - 0.48).abs() < 1e-9);
    let free = suspension(fixed.pressure.recip(), 0.46, 0.3);
    let free = means_of_runs(&free, [1.5, 5.0]);
    assert!((free.fraction - 0.48).abs() < 0.012, "{}", free.fraction);
    let ratio = free.viscosity / fixed.viscosity;
    assert!((ratio - 1.0).abs() < 0.25, "{ratio}");
}

#[test]
fn frictional_spheres_lie_on_the_law_of_boyer_guazzelli_and_pouliquen() {
    let params = Params {
        spheres: 150,
        hydrodynamics: Hydrodynamics::BallMelrose,
        ..suspension(0.03, 0.48, 0.5)
    };
    let run = means(begun::<Bulk>(&params, 1), [1.0, 2.6]);
    let law = 0.585 / (1.0 + 0.03_f64.sqrt());
    assert!((run.fraction / law - 1.0).abs() < 0.025, "{}", run.fraction);
}

#[test]
fn frictionless_spheres_approach_random_packing_and_a_small_friction() {
    let [flowing, dense] = [1e-3, 1e-4].map(|number| {
        let run = means(begun::<Bulk>(&suspension(number, 0.58, 0.0), 1), [1.5, 3.0]);
        (run.viscosity / run.pressure, run.fraction)
    });
    // The friction of the packing tends to some 0.1, and the fraction to that of random packing,
    // 0.64 to 0.65 of the spheres with their roughness.
    assert!(dense.0 < 0.75 * flowing.0, "{flowing:?} {dense:?}");
    assert!((0.08..0.2).contains(&dense.0), "{dense:?}");
    assert!((0.60..0.65).contains(&dense.1), "{dense:?}");
}

/// Equal spheres, which need a smaller cell.
fn gradient(params: Params) -> Params {
    Params {
        pressure: PressureKind::Gradient,
        size_ratio: 1.0,
        large_fraction: 0.5,
        ..params
    }
}

#[test]
fn no_layer_begins_in_the_cell_of_one_that_dilated_along_the_gradient() {
    let params = Params {
        pressure: PressureKind::Gradient,
        ..layer(0.1)
    };
    let mut run = Simulation::<Layer>::new(&params, 1, &NearFields::default()).unwrap();
    run.snapshot().layer(&params).unwrap();
    for _ in 0..5 {
        run.step().unwrap();
    }
    let error = run.snapshot().layer(&params).unwrap_err().to_string();
    assert!(error.contains("not square"), "{error}");
}

#[test]
fn contacts_bear_the_pressure_across_the_gradient() {
    for friction in [0.0, 0.5] {
        let params = gradient(suspension(0.03, 0.5, friction));
        let mut run = begun::<Bulk>(&params, 1);
        run.step().unwrap();
        let run = means(run, [2.0, 6.0]);
        let ratio = run.pressure_22 * 0.03;
        assert!((ratio - 1.0).abs() < 0.03, "{friction}: {ratio}");
    }
    let planar = means(begun::<Layer>(&gradient(layer(0.05)), 1), [2.0, 6.0]);
    let ratio = planar.pressure_22 * 0.05;
    assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
}

#[test]
fn the_pressure_across_the_gradient_gives_the_fraction_that_it_was_measured_at() {
    let fixed = Params {
        viscous_number: None,
        ..suspension(1.0, 0.48, 0.3)
    };
    let fixed = means_of_runs(&fixed, [1.5, 5.0]);
    let free = gradient(suspension(fixed.pressure_22.recip(), 0.46, 0.3));
    let free = means_of_runs(&free, [1.5, 5.0]);
    assert!((free.fraction - 0.48).abs() < 0.012, "{}", free.fraction);
}

#[test]
fn the_volume_follows_the_pressure_in_extension_too() {
    for flow in [FlowType::PlanarExtension, FlowType::Uniaxial] {
        let params = Params {
            flow,
            spheres: 60,
            ..suspension(0.05, 0.48, 0.3)
        };
        let run = means(begun::<Bulk>(&params, 1), [2.0, 5.0]);
        let ratio = run.pressure * 0.05;
        assert!((ratio - 1.0).abs() < 0.03, "{flow}: {ratio}");
        let sheared = means(begun::<Bulk>(&suspension(0.05, 0.48, 0.3), 1), [2.0, 5.0]);
        assert!(
            (run.fraction - sheared.fraction).abs() < 0.03,
            "{flow}: {}",
            run.fraction
        );
    }
}

/// A ratio of stress and pressure in place of the viscous number.
fn at_ratio(ratio: f64, params: Params) -> Params {
    Params {
        viscous_number: None,
        macroscopic_friction: Some(ratio),
        ..params
    }
}

#[test]
fn stress_and_pressure_keep_their_ratio_and_both_ensembles_agree() {
    let number = 0.05;
    let fixed = means(begun::<Bulk>(&suspension(number, 0.48, 0.3), 1), [1.5, 6.0]);
    let ratio = fixed.viscosity * number;
    let params = at_ratio(ratio, suspension(number, 0.48, 0.3));
    let mut run = begun::<Bulk>(&params, 1);
    let mut shear = (0.0, 0.0);
    while run.strain() < 6.0 {
        let sample = run.step().unwrap();
        if sample.strain >= 1.5 {
            // Strain over the time in units of the stress.
            shear.0 += 1.0;
            shear.1 += sample.viscosity;
        }
    }
    assert_eq!(run.flow(), Flow::Flowing);
    let found = ratio * shear.0 / shear.1;
    assert!((found / number - 1.0).abs() < 0.2, "{found}");
    assert!((run.fraction() - fixed.fraction).abs() < 0.03);
}

#[test]
fn below_the_least_ratio_a_suspension_arrests_and_above_it_yields() {
    // Without friction the ratio tends to some 0.1.
    let runs = [0.04, 0.8].map(|ratio| {
        let params = at_ratio(ratio, suspension(1.0, 0.55, 0.0));
        let mut run = begun::<Bulk>(&params, 1);
        while run.flow() == Flow::Flowing && run.strain() < 1.5 {
            run.step().unwrap();
        }
        (run.flow(), run.fraction())
    });
    let [(arrested, dense), (flowing, loose)] = runs;
    assert_eq!([arrested, flowing], [Flow::Jammed, Flow::Flowing]);
    assert!(dense > 0.6 && loose < 0.58, "{dense} {loose}");
}

#[test]
fn means_do_not_depend_on_how_fast_the_volume_answers() {
    for kind in [PressureKind::Isotropic, PressureKind::Gradient] {
        let params = Params {
            pressure: kind,
            ..gradient(suspension(0.05, 0.5, 0.3))
        };
        let [slow, fast] = [2.0, 20.0].map(|rate| {
            let mut settings = SolverSettings::default();
            settings.volume_rate = rate;
            let start = Snapshot::<Bulk>::start(&params, 3).unwrap();
            let tables = NearFields::default();
            means(
                Simulation::with_settings(&params, start, &tables, &settings).unwrap(),
                [2.0, 8.0],
            )
        });
        let imposed = |run: &Means| match kind {
            PressureKind::Isotropic => run.pressure,
            PressureKind::Gradient => run.pressure_22,
        };
        let ratios = [
            slow.fraction / fast.fraction,
            imposed(&slow) / imposed(&fast),
        ];
        assert!((ratios[0] - 1.0).abs() < 0.02, "{kind:?}: {ratios:?}");
        assert!((ratios[1] - 1.0).abs() < 0.05, "{kind:?}: {ratios:?}");
    }
}

/// Checks that contacts bear the pressure but for what the volume resists: its mean is
/// P + κ ln(V/V₀)/t, κ = P/5, from an instant after the rise of P on.
fn check_pressure<S: RunSpace>(params: &Params) {
    let mut run = begun::<S>(params, 1);
    while run.strain() < 0.205 {
        run.step().unwrap();
    }
    let (from, steps) = (run.fraction(), 30);
    let mut sum = 0.0;
    for _ in 0..steps {
        let stress = run.step().unwrap().stress;
        let [xx, yy, zz] = [stress.xx(), stress.yy(), stress.zz()];
        let normal = [xx, yy, zz].map(|part| part.normal_contact + part.repulsion);
        sum -= match params.pressure {
            PressureKind::Isotropic => normal.iter().sum::<f64>() / S::DIMENSIONS as f64,
            PressureKind::Gradient => normal[1] + yy.tangential_contact,
        };
    }
    let imposed = params.viscous_number.unwrap().recip();
    let time = f64::from(steps) * params.time_step;
    let expected = imposed * (1.0 + 0.2 * (from / run.fraction()).ln() / time);
    let ratio = sum / f64::from(steps) / expected;
    assert!((ratio - 1.0).abs() < 0.02, "{:?}: {ratio}", params.contact);
}

#[test]
fn contacts_bear_the_pressure_under_every_law() {
    for contact in schemes() {
        let with = |params: Params| {
            let mut params = Params {
                contact,
                shear_rate: 1.0,
                ..params
            };
            params.canonicalise();
            params
        };
        // Spheres that neither slip nor roll jam far earlier than others.
        let jams = contact.laws().tangential == TangentialLaw::StickRotate;
        let [number, fraction] = if jams { [0.5, 0.3] } else { [0.05, 0.5] };
        check_pressure::<Bulk>(&with(suspension(number, fraction, 0.3)));
        check_pressure::<Layer>(&with(gradient(layer(0.05))));
    }
}

/// Spheres whose stress is a multiple of the pressure, at these shears.
fn at_shear(shear_rate: f64, shear_stress: Option<f64>) -> Params {
    let laws = ContactLaws {
        tangential: TangentialLaw::Coulomb,
        ..ContactLaws::PAPER
    };
    let mut params = Params {
        contact: ContactScheme::Laws(laws),
        shear_rate,
        shear_stress,
        ..at_ratio(0.6, suspension(1.0, 0.48, 0.5))
    };
    params.canonicalise();
    params
}

#[test]
fn friction_begins_at_the_critical_load_under_a_ratio_of_stress_and_pressure() {
    let rates = [1e-4, 0.06, 100.0].map(|rate| at_shear(rate, None));
    let stresses = [1e-4, 0.3, 100.0].map(|stress| at_shear(0.0, Some(stress)));
    for runs in [rates, stresses] {
        let shares = runs.map(|params| {
            let mut run = begun::<Bulk>(&params, 1);
            let [
                mut stress,
                mut pressure,
                mut contacts,
                mut rubbing,
                mut others,
            ] = [0.0; 5];
            while run.strain() < 1.6 {
                let (sample, frame) = run.step_with_frame().unwrap();
                if let Some(imposed) = params.shear_stress {
                    let borne = sample.viscosity * sample.shear_rate / (6.0 * PI);
                    assert!((borne / imposed - 1.0).abs() < 1e-6, "{borne}");
                }
                if sample.strain < 0.6 {
                    continue;
                }
                let parts = [sample.stress.xx(), sample.stress.yy(), sample.stress.zz()];
                pressure -= parts.iter().map(|part| part.normal_contact).sum::<f64>() / 3.0;
                stress += sample.viscosity;
                let load = 6.0 * PI / sample.shear_rate;
                for contact in &frame.contacts {
                    let rubs = contact.state != ContactState::Frictionless;
                    others += f64::from(u8::from(rubs != (contact.normal_force > load)));
                    contacts += 1.0;
                    rubbing += f64::from(u8::from(rubs));
                }
            }
            let ratio = stress / pressure;
            // Few stages have no consistent set of frictional contacts.
            assert!(others < 0.02 * contacts, "{others} of {contacts}");
            assert!((ratio / 0.6 - 1.0).abs() < 0.05, "{params:?}: {ratio}");
            rubbing / contacts
        });
        let [few, some, most] = shares;
        assert!(few == 0.0 && most > 0.95, "{shares:?}");
        assert!((0.1..0.9).contains(&some), "{shares:?}");
    }
}

fn check_interrupted<S: RunSpace>(params: &Params) {
    let mut run = begun::<S>(params, 1);
    for _ in 0..12 {
        run.step().unwrap();
    }
    let mut resumed =
        Simulation::from_snapshot(params, run.snapshot(), &NearFields::default()).unwrap();
    for _ in 0..6 {
        assert_eq!(run.step().unwrap(), resumed.step().unwrap());
    }
    assert_eq!(run.snapshot(), resumed.snapshot());
    assert!(run.unwrapped().eq(resumed.unwrapped()));
}

/// The laws whose forces depend on gaps.
fn springs_and_repulsion() -> [ContactLaws; 2] {
    let springs = ContactLaws {
        stiffness_unit: StiffnessUnit::Flow,
        ..ContactLaws::linear_spring(1e5, TangentialLaw::StickSlide, 0.0)
    };
    let repulsion = ContactLaws {
        repulsion: 2.0,
        repulsion_length: 0.02,
        ..ContactLaws::PAPER
    };
    [springs, repulsion]
}

#[test]
fn an_interrupted_run_continues_with_the_same_bits() {
    check_interrupted::<Bulk>(&suspension(0.05, 0.5, 0.5));
    check_interrupted::<Layer>(&layer(0.05));
    check_interrupted::<Bulk>(&gradient(suspension(0.05, 0.5, 0.5)));
    check_interrupted::<Layer>(&gradient(layer(0.05)));
    check_interrupted::<Bulk>(&at_ratio(0.8, suspension(0.05, 0.5, 0.5)));
    check_interrupted::<Bulk>(&at_shear(0.3, None));
    check_interrupted::<Bulk>(&at_shear(0.0, Some(0.3)));
    check_interrupted::<Bulk>(&Params {
        flow: FlowType::Uniaxial,
        spheres: 60,
        ..suspension(0.05, 0.5, 0.5)
    });
    check_interrupted::<Layer>(&Params {
        spheres: 70,
        ..layer(0.05)
    });
    for normal in springs_and_repulsion() {
        check_interrupted::<Bulk>(&soft(normal, 0.5));
    }
}

#[test]
fn springs_and_repulsions_bear_the_pressure_too() {
    for normal in springs_and_repulsion() {
        let params = soft(normal, 0.0);
        let run = means(begun::<Bulk>(&params, 1), [2.0, 5.0]);
        assert!((run.pressure * 0.05 - 1.0).abs() < 0.05, "{}", run.pressure);
    }
}

/// Without a pressure to speak of, forces expand the cell no further than they reach.
#[test]
fn a_vanishing_pressure_lets_the_cell_grow_by_the_range_of_forces_only() {
    for normal in springs_and_repulsion() {
        let params = Params {
            viscous_number: Some(1e8),
            ..soft(normal, 0.5)
        };
        let mut run = begun::<Bulk>(&params, 1);
        while run.strain() < 1.0 {
            run.step().unwrap();
        }
        assert!((0.05..0.5).contains(&run.fraction()), "{}", run.fraction());
    }
}

#[test]
fn a_pressure_is_refused_where_it_cannot_be_imposed() {
    let good = suspension(0.05, 0.5, 0.5);
    for (bad, part) in [
        (
            Params {
                viscous_number: Some(0.0),
                ..good.clone()
            },
            "out of range",
        ),
        (
            Params {
                shear_rate: 0.0,
                shear_stress: Some(1.0),
                ..good.clone()
            },
            "without a rate",
        ),
        (
            Params {
                hydrodynamics: Hydrodynamics::StokesianDynamics,
                ..good.clone()
            },
            "ball-melrose",
        ),
        (
            Params {
                flow: FlowType::PlanarExtension,
                ..gradient(good.clone())
            },
            "no shear",
        ),
        (
            Params {
                macroscopic_friction: Some(0.5),
                ..good.clone()
            },
            "it follows",
        ),
    ] {
        let error = bad.validate().unwrap_err().to_string();
        assert!(
            error.contains("viscous_number") && error.contains(part),
            "{error}"
        );
    }
}
