//! Runs in extension and mixtures: their lattice, energy, reversal, viscosity of dilute and dense
//! suspensions, imposed stress, interruption.

use crate::common::schemes::schemes;
use nalgebra::Vector3;
use sd_core::cell::Cell;
use sd_core::instant::{Configuration, InstantContacts, solve};
use sd_core::model::{FlowType, Segment};
use sd_core::simulation::Frame;
use sd_core::{
    Bulk, ContactLaws, ContactScheme, Error, Hydrodynamics, Layer, LeadingOrder, NearFields,
    Params, RunSpace, Simulation, Snapshot, Space, TangentialLaw, VelocityGradient, start,
};
use std::f64::consts::PI;

const FULL: Hydrodynamics = Hydrodynamics::StokesianDynamics;
const BALL_MELROSE: Hydrodynamics = Hydrodynamics::BallMelrose;
const LUBRICATION: Hydrodynamics = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);
const MIXTURE: FlowType = FlowType::Mixture(0.7);
const OF_SPACE: [FlowType; 4] = [
    FlowType::PlanarExtension,
    FlowType::Uniaxial,
    FlowType::Biaxial,
    MIXTURE,
];

/// Rough, frictional, rigid spheres.
fn suspension(flow: FlowType, spheres: usize, fraction: f64) -> Params {
    let params = Params::builder()
        .spheres(spheres)
        .volume_fraction(fraction)
        .roughness(0.01)
        .friction(0.5)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(LUBRICATION)
        .flow(flow);
    params.build().unwrap()
}

fn layer(flow: FlowType, spheres: usize, fraction: f64) -> Params {
    let params = Params::builder()
        .spheres(spheres)
        .area_fraction(fraction)
        .roughness(0.01)
        .friction(0.5)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(BALL_MELROSE)
        .flow(flow);
    params.build().unwrap()
}

fn begun<S: RunSpace>(params: &Params, seed: u64) -> Simulation<S> {
    Simulation::new(params, seed, &NearFields::default()).unwrap()
}

/// Checks that a run continues with the same bits after an interruption.
fn check_interrupted<S: RunSpace>(params: &Params) {
    let mut run = begun::<S>(params, 1);
    for _ in 0..8 {
        run.step().unwrap();
    }
    let mut resumed =
        Simulation::from_snapshot(params, run.snapshot(), &NearFields::default()).unwrap();
    for _ in 0..6 {
        assert_eq!(run.step().unwrap(), resumed.step().unwrap());
    }
    let [a, b] = [&run, &resumed].map(Simulation::snapshot);
    assert_eq!(a, b);
    assert!(run.unwrapped().eq(resumed.unwrapped()));
}

#[test]
fn an_interrupted_run_continues_with_the_same_bits() {
    for flow in OF_SPACE {
        for hydrodynamics in [FULL, BALL_MELROSE, LUBRICATION] {
            let dilute = Params {
                hydrodynamics,
                ..suspension(flow, 64, 0.3)
            };
            check_interrupted::<Bulk>(&dilute);
        }
        if flow.is_planar() {
            for (spheres, hydrodynamics) in [(40, FULL), (130, FULL), (40, BALL_MELROSE)] {
                check_interrupted::<Layer>(&Params {
                    hydrodynamics,
                    ..layer(flow, spheres, 0.6)
                });
            }
        }
    }
    for flow in OF_SPACE {
        check_interrupted::<Bulk>(&stressed(flow));
    }
    let springs = ContactLaws::linear_spring(1e4, TangentialLaw::StickSlide, 0.01);
    for contact in [ContactScheme::Procedure, ContactScheme::Laws(springs)] {
        check_interrupted::<Layer>(&Params {
            contact,
            shear_rate: 10.0,
            ..layer(FlowType::PlanarExtension, 40, 0.65)
        });
    }
}

/// Twenty Hencky strains without a failed step, whose lattices never have a vector shorter than
/// that at the start.
fn check_long<S: RunSpace>(params: &Params, hencky: f64) {
    let mut run = begun::<S>(params, 1);
    let shortest = |run: &Simulation<S>| {
        let cell = run.cell_at(run.time()).unwrap();
        cell.lattice().unwrap().shortest()
    };
    let least = shortest(&run);
    let stretching = VelocityGradient::<S>::of_type(params.flow, 1.0).rate_of_strain()[0];
    while run.strain() * stretching < hencky {
        run.step().unwrap();
        assert!(shortest(&run) > least * (1.0 - 1e-9));
    }
    let content = run.cell_at(run.time()).unwrap().content().unwrap();
    let start = run.side().powi(i32::try_from(S::DIMENSIONS).unwrap());
    assert!((content / start - 1.0).abs() < 1e-12);
    assert_eq!(run.counters().jammed_steps, 0);
}

#[test]
fn twenty_hencky_strains_without_a_failed_step() {
    for flow in [FlowType::PlanarExtension, FlowType::Uniaxial] {
        check_long::<Bulk>(&suspension(flow, 20, 0.45), 20.0);
    }
}

#[test]
fn layers_survive_planar_extension_and_mixtures() {
    for flow in [FlowType::PlanarExtension, MIXTURE] {
        check_long::<Layer>(&layer(flow, 40, 0.6), 4.0);
    }
}

/// The instant after some steps of a run, solved by itself.
fn instant<S: RunSpace>(run: &Simulation<S>, params: &Params) -> Configuration<S> {
    let n = params.spheres;
    Configuration {
        centres: run.centres().to_vec(),
        radii: run.radii().to_vec(),
        cell: run.cell_at(run.time()).unwrap(),
        hydrodynamics: params.hydrodynamics,
        background: VelocityGradient::of_type(params.flow, params.direction).into(),
        forces: vec![S::Vector::default(); n],
        torques: vec![S::Spin::default(); n],
    }
}

/// Work of the stress at unit rate is spent by the fluid and the contacts, and the run has the
/// viscosity of the instant.
fn check_energy<S: RunSpace>(params: &Params, steps: usize) {
    let mut run = begun::<S>(params, 2);
    for _ in 0..steps {
        run.step().unwrap();
    }
    let configuration = instant(&run, params);
    let contacts = InstantContacts::of_run(params, params.time_step);
    let solved = solve(&configuration, &contacts, &NearFields::default()).unwrap();
    let stress = solved.stress.unwrap();
    let spent = stress.dissipation * stress.volume + solved.contact_power();
    let work = (stress.viscosity - 1.0) * stress.volume;
    let mut pressed = solved.contacts.iter().chain(&solved.repulsive);
    assert!(
        pressed.any(|c| c.normal_force > 0.0),
        "{}, {:?}",
        params.flow,
        params.contact
    );
    assert!(
        (work / spent - 1.0).abs() < 1e-7,
        "{}, {:?}: {work} {spent}",
        params.flow,
        params.contact
    );
    // Σ:E/(2 E:E) by components, which is the additional viscosity at rate 1.
    let e = VelocityGradient::<S>::of_type(params.flow, 1.0).rate_of_strain();
    let s = &stress.components;
    let full = [s.xx(), s.yy(), s.zz(), s.xy, s.xz, s.yz].map(|part| part.total());
    let pairs = full.iter().zip(&e).enumerate();
    let work = pairs.map(|(k, (s, e))| if k < 3 { s * e } else { 2.0 * s * e });
    assert!((work.sum::<f64>() / (stress.viscosity - 1.0) - 1.0).abs() < 1e-10);
}

#[test]
fn energy_balances_in_every_flow() {
    for flow in OF_SPACE {
        for hydrodynamics in [FULL, BALL_MELROSE, LUBRICATION] {
            check_energy::<Bulk>(
                &Params {
                    hydrodynamics,
                    ..suspension(flow, 88, 0.45)
                },
                30,
            );
        }
        if flow.is_planar() {
            check_energy::<Layer>(&layer(flow, 40, 0.7), 30);
        }
    }
}

#[test]
fn energy_balances_under_every_law_in_every_flow() {
    for contact in schemes() {
        for flow in OF_SPACE {
            // Spheres that neither slip nor roll jam far earlier than others.
            let jams = contact.laws().tangential == TangentialLaw::StickRotate;
            let (fraction, steps) = if jams { (0.4, 30) } else { (0.48, 15) };
            let mut params = Params {
                contact,
                shear_rate: 1.0,
                ..suspension(flow, 24, fraction)
            };
            params.canonicalise();
            check_energy::<Bulk>(&params, steps);
        }
    }
}

#[test]
fn spheres_without_contacts_return_with_the_flow() {
    for flow in OF_SPACE {
        let back = Segment {
            start: 1.0,
            direction: Some(-1.0),
            ..Segment::default()
        };
        let mut params = Params {
            hydrodynamics: BALL_MELROSE,
            ..suspension(flow, 20, 0.05)
        };
        params.segments = vec![Segment::default(), back];
        let mut run = begun::<Bulk>(&params, 3);
        let before: Vec<_> = run.unwrapped().collect();
        let mut farthest: f64 = 0.0;
        for step in 0..200 {
            let sample = run.step().unwrap();
            assert_eq!(sample.contacts, 0);
            if step == 99 {
                farthest = run
                    .unwrapped()
                    .zip(&before)
                    .map(|(x, y)| (x - y).norm())
                    .fold(0.0, f64::max);
            }
        }
        let distances = run.unwrapped().zip(&before).map(|(x, y)| (x - y).norm());
        let error = distances.fold(0.0, f64::max);
        assert!(farthest > 2.0 && error < 1e-6, "{flow}: {farthest} {error}");
    }
}

#[test]
fn spheres_are_followed_from_cell_to_cell() {
    let params = suspension(FlowType::Uniaxial, 30, 0.3);
    let mut run = begun::<Bulk>(&params, 1);
    let gradient = VelocityGradient::<Bulk>::of_type(params.flow, 1.0);
    for _ in 0..100 {
        let before: Vec<_> = run.unwrapped().collect();
        let shifts: Vec<_> = before
            .iter()
            .zip(run.centres())
            .map(|(x, y)| x - y)
            .collect();
        run.step().unwrap();
        let moved = run.unwrapped().zip(&before).map(|(x, y)| x - y);
        let errors = moved.zip(&shifts).zip(run.velocities());
        let errors = errors.map(|((moved, shift), velocity)| {
            let velocity = Bulk::translation(velocity) + gradient.velocity(shift);
            (moved - velocity * params.time_step).norm() / (1.0 + shift.norm())
        });
        // Of single spheres the velocity changes within a step.
        let mean = errors.sum::<f64>() / 30.0;
        assert!(mean < 1e-3, "{mean}");
    }
    let content = run.cell_at(run.time()).unwrap();
    for (x, y) in run.unwrapped().zip(run.centres()) {
        assert!(content.nearest(x - y).0.norm() < 1e-9);
    }
}

#[test]
fn dilute_suspensions_have_einsteins_viscosity_in_every_flow() {
    for flow in OF_SPACE {
        let params = Params {
            hydrodynamics: FULL,
            ..suspension(flow, 20, 0.01)
        };
        let mut run = begun::<Bulk>(&params, 1);
        let viscosity = run.step().unwrap().viscosity;
        // Pairs add some 7 φ².
        let slope = (viscosity - 1.0) / 0.01;
        assert!((slope - 2.5).abs() < 0.1, "{flow}: {slope}");
    }
}

/// Two spheres in a strain, free of forces: `[A, B, J]` of Batchelor & Green (J. Fluid Mech. 56,
/// 375 and 401 (1972)) at a separation of their centres.
fn pair_functions(separation: f64, tables: &NearFields) -> [f64; 3] {
    // The line of centres in the flow, and a direction across it in which the flow turns it.
    let diagonal = 0.5_f64.sqrt();
    let cases = [
        (FlowType::Uniaxial, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1.0),
        (
            FlowType::PlanarExtension,
            [diagonal, diagonal, 0.0],
            [diagonal, -diagonal, 0.0],
            2.0,
        ),
        (
            FlowType::PlanarExtension,
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0],
            2.0,
        ),
    ];
    let mut functions = [0.0; 3];
    for (k, (flow, n, t, weight)) in cases.into_iter().enumerate() {
        let gradient = VelocityGradient::<Bulk>::of_type(flow, 1.0);
        let [n, t] = [Bulk::vector(&n), Bulk::vector(&t)];
        let solved = solve(
            &Configuration {
                centres: vec![n * (-0.5 * separation), n * (0.5 * separation)],
                radii: vec![1.0; 2],
                cell: Cell::Unbounded,
                hydrodynamics: FULL,
                background: gradient.into(),
                forces: vec![Vector3::zeros(); 2],
                torques: vec![Vector3::zeros(); 2],
            },
            &InstantContacts::None,
            tables,
        )
        .unwrap();
        let [first, second] = [0, 1].map(|i| Bulk::translation(&solved.disturbances[i]));
        let (relative, strained) = (second - first, gradient.velocity(&(n * separation)));
        if k == 0 {
            functions[0] = -Bulk::dot(&relative, &n) / Bulk::dot(&strained, &n);
        } else if k == 1 {
            functions[1] = -Bulk::dot(&relative, &t) / Bulk::dot(&strained, &t);
        }
        let e = gradient.rate_of_strain();
        let [mut work, mut square] = [0.0; 2];
        for stresslet in &solved.stresslets {
            let [xx, yy, xy, xz, yz] = Bulk::tensor(stresslet);
            let s = [xx, yy, -xx - yy, xy, xz, yz];
            for (k, (s, e)) in s.iter().zip(&e).enumerate() {
                let times = if k < 3 { 1.0 } else { 2.0 };
                work += times * s * e;
                square += times * e * e;
            }
        }
        functions[2] += weight / 5.0 * (work / (20.0 * PI / 3.0 * square) - 1.0);
    }
    functions
}

#[test]
fn pairs_in_pure_strain_add_seven_times_the_square_of_the_fraction() {
    // Spheres from infinity have the density q at a separation r, in the same paper:
    // q = exp(∫_r^∞ 3 (B − A)/(ρ (1 − A)) dρ)/(1 − A),   η = 1 + 5φ/2 + (5/2 + 15/2 ∫ J q r² dr) φ²
    let tables = NearFields::default();
    let (points, [least, most]) = (240_i32, [1e-7_f64, 20.0]);
    let step = (most / least).ln() / f64::from(points);
    let [mut exponent, mut integral] = [0.0; 2];
    let mut before: Option<[f64; 2]> = None;
    let mut last = 0.0;
    for k in 0..=points {
        // From far to near, at equal ratios of the gap.
        let gap = most * (-step * f64::from(k)).exp();
        let r = 2.0 + gap;
        let [a, b, j] = pair_functions(r, &tables);
        let slope = 3.0 * (b - a) / (r * (1.0 - a)) * gap;
        if let Some([slope_before, _]) = before {
            exponent += 0.5 * step * (slope + slope_before);
        }
        let density = j * r * r * exponent.exp() / (1.0 - a) * gap;
        if let Some([_, density_before]) = before {
            integral += 0.5 * step * (density + density_before);
        }
        before = Some([slope, density]);
        // Nearer pairs: their density is a power of the gap.
        last = density / (1.0 + slope);
    }
    let coefficient = 2.5 + 7.5 * (integral + last);
    // 7.6 in that paper, 6.95 by later integrations with more terms.
    assert!((coefficient - 6.95).abs() < 0.1, "{coefficient}");
}

/// A suspension at an imposed stress.
fn stressed(flow: FlowType) -> Params {
    Params {
        shear_rate: 0.0,
        shear_stress: Some(2.0),
        ..suspension(flow, 30, 0.45)
    }
}

#[test]
fn an_imposed_stress_is_borne_in_extension() {
    for flow in OF_SPACE {
        let mut run = begun::<Bulk>(&stressed(flow), 1);
        for _ in 0..30 {
            let sample = run.step().unwrap();
            let stress = sample.viscosity * sample.shear_rate / (6.0 * PI);
            assert!((stress / 2.0 - 1.0).abs() < 1e-6, "{stress}");
        }
    }
}

/// The mean viscosity of some runs of frictionless spheres after a strain.
fn viscosity(flow: FlowType, fraction: f64) -> f64 {
    let params = Params {
        friction: 0.0,
        shear_rate: 0.0,
        ..suspension(flow, 60, fraction)
    };
    let (mut sum, mut count) = (0.0, 0.0);
    for seed in 1..=2 {
        let mut run = begun::<Bulk>(&params, seed);
        while run.strain() < 5.0 {
            let sample = run.step().unwrap();
            if sample.strain >= 1.0 {
                sum += sample.viscosity;
                count += 1.0;
            }
        }
    }
    sum / count
}

/// Mean over runs of the viscosity from a strain on, over four more, with its standard error.
fn viscosity_after(params: &Params, strain: f64) -> [f64; 2] {
    let means = [1, 2, 3, 4, 5, 6].map(|seed| {
        let mut run = begun::<Bulk>(params, seed);
        let (mut sum, mut count) = (0.0, 0.0);
        while run.strain() < strain + 4.0 {
            let sample = run.step().unwrap();
            if sample.strain >= strain {
                sum += sample.viscosity;
                count += 1.0;
            }
        }
        sum / count
    });
    let mean = means.iter().sum::<f64>() / 6.0;
    let squares = means.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    [mean, (squares / 30.0).sqrt()]
}

#[test]
fn means_do_not_depend_on_the_angle_of_the_lattice() {
    let plain = Params {
        friction: 0.0,
        shear_rate: 0.0,
        ..suspension(FlowType::PlanarExtension, 40, 0.45)
    };
    // Half a period of the lattice before the start its angle is the opposite one. The flow is
    // reversed for as long first.
    let half = 0.96;
    let forth = Segment {
        start: half,
        direction: Some(1.0),
        ..Segment::default()
    };
    let turned = Params {
        direction: -1.0,
        segments: vec![Segment::default(), forth],
        ..plain.clone()
    };
    let mut run = begun::<Bulk>(&turned, 1);
    let start = run.cell_at(0.0).unwrap();
    while run.strain() < half - 1e-9 {
        run.step().unwrap();
    }
    let now = run.cell_at(run.time()).unwrap();
    let least = start.lattice().unwrap().shortest();
    for a in now.lattice().unwrap().vectors() {
        let mirrored = Vector3::new(a.x, -a.y, a.z);
        assert!(start.nearest(mirrored).0.norm() < 0.02 * least);
    }
    let planar = now.lattice().unwrap().vectors().iter();
    let mut planar = planar.filter(|a| a.x.hypot(a.y) > 0.1 * least);
    assert!(planar.all(|a| start.nearest(*a).0.norm() > 0.2 * least));

    let [one, other] =
        [(&plain, 1.0), (&turned, half + 1.0)].map(|(p, from)| viscosity_after(p, from));
    let error = one[1].hypot(other[1]);
    assert!(error < 0.05 * one[0], "{one:?} {other:?}");
    assert!((one[0] - other[0]).abs() < 2.5 * error, "{one:?} {other:?}");
}

/// Where a short extension follows, the shear before it is computed in the vectors of its lattice.
#[test]
fn shear_in_a_lattice_is_shear_in_a_sheared_cell_until_rounding_grows() {
    fn check<S: RunSpace>(plain: &Params) {
        let [stretched, sheared] =
            [(0.9, FlowType::PlanarExtension), (0.92, FlowType::Shear)].map(|(start, flow)| {
                Segment {
                    start,
                    flow: Some(flow),
                    ..Segment::default()
                }
            });
        let in_lattice = Params {
            segments: vec![Segment::default(), stretched, sheared],
            ..plain.clone()
        };
        let mut runs = [plain, &in_lattice].map(|params| begun::<S>(params, 1));
        for step in 0..80 {
            let [a, b] = runs.each_mut().map(|run| run.step().unwrap().viscosity);
            let allowed = if step < 10 { 1e-9 } else { 1e-5 };
            assert!((a / b - 1.0).abs() < allowed, "{step}: {a} {b}");
        }
    }
    check::<Bulk>(&suspension(FlowType::Shear, 60, 0.4));
    check::<Layer>(&layer(FlowType::Shear, 90, 0.6));
}

#[test]
fn frictionless_spheres_are_as_viscous_in_extension_as_in_shear() {
    let shear = viscosity(FlowType::Shear, 0.45);
    for flow in [FlowType::PlanarExtension, FlowType::Uniaxial] {
        let ratio = viscosity(flow, 0.45) / shear;
        assert!((ratio - 1.0).abs() < 0.12, "{flow}: {ratio}");
    }
}

/// The lattice of a frame is that of its flow, and holds its contacts.
#[test]
fn frames_have_the_lattice() {
    let params = suspension(FlowType::Biaxial, 30, 0.45);
    let mut run = begun::<Bulk>(&params, 1);
    for _ in 0..60 {
        run.step().unwrap();
    }
    let (_, frame): (_, Frame<Bulk>) = run.step_with_frame().unwrap();
    assert!(!frame.is_sheared() && !frame.contacts.is_empty());
    let cell = frame.cell().unwrap();
    for contact in &frame.contacts {
        let [x, y] = [contact.i, contact.j].map(|k| Bulk::vector(&frame.centres[k]));
        let (near, _) = cell.nearest(y - x);
        let gap = near.norm() - frame.radii[contact.i] - frame.radii[contact.j];
        assert!((gap - contact.gap).abs() < 1e-9);
    }
    let sheared = Params {
        flow: FlowType::Shear,
        ..params
    };
    let (_, frame) = begun::<Bulk>(&sheared, 1).step_with_frame().unwrap();
    assert!(frame.is_sheared());
}

/// A suspension sheared first, then stretched; the lattice moves on from one to the other.
#[test]
fn segments_may_have_different_flows() {
    let stretched = Segment {
        start: 0.5,
        flow: Some(FlowType::PlanarExtension),
        ..Segment::default()
    };
    let params = Params {
        segments: vec![Segment::default(), stretched],
        ..suspension(FlowType::Shear, 60, 0.4)
    };
    params.validate().unwrap();
    start::check(&params).unwrap();
    let mut run = begun::<Bulk>(&params, 1);
    for step in 0..150 {
        let before = run.cell_at(run.time()).unwrap();
        run.step().unwrap();
        let gradient = VelocityGradient::<Bulk>::of_type(
            if step < 50 {
                FlowType::Shear
            } else {
                FlowType::PlanarExtension
            },
            0.01,
        );
        let moved = before.lattice().unwrap().deform(&gradient, 1.0);
        let cell = run.cell_at(run.time()).unwrap();
        for a in moved.vectors() {
            assert!(cell.nearest(*a).0.norm() < 1e-8);
        }
    }
    // The viscosity is that of the flow of the segment.
    let mut configuration = instant(&run, &params);
    configuration.background = VelocityGradient::planar_extension(0.5).into();
    let contacts = InstantContacts::of_run(&params, params.time_step);
    let solved = solve(&configuration, &contacts, &NearFields::default()).unwrap();
    let ratio = run.step().unwrap().viscosity / solved.stress.unwrap().viscosity;
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
    // The reverse order: the square cell collapses, which is known before the run.
    let sheared = Segment {
        start: 3.0,
        flow: Some(FlowType::Shear),
        ..Segment::default()
    };
    let other = Params {
        segments: vec![Segment::default(), sheared],
        ..suspension(FlowType::PlanarExtension, 60, 0.4)
    };
    let [first, second] = [&params, &other].map(start::check);
    first.unwrap();
    let refused = second.err().map(|error| error.to_string());
    assert!(refused.is_none_or(|text| text.contains("at times in this `flow`")));
}

#[test]
fn flows_that_the_space_or_the_start_does_not_have_are_refused() {
    let flat = Params {
        flow: FlowType::Uniaxial,
        ..layer(FlowType::Shear, 40, 0.6)
    };
    let error = flat.validate().unwrap_err().to_string();
    assert!(
        error.contains("flow") && error.contains("volume_fraction"),
        "{error}"
    );
    let sheared = layer(FlowType::Shear, 40, 0.6);
    let given = Snapshot::<Layer>::start(&sheared, 1)
        .unwrap()
        .layer(&sheared)
        .unwrap();
    let begun = Params {
        flow: FlowType::PlanarExtension,
        start: Some(given.into()),
        ..sheared
    };
    let error = begun.validate().unwrap_err().to_string();
    assert!(error.contains("given layer"), "{error}");
    // The least number of spheres is said before the run.
    let few = Params {
        hydrodynamics: BALL_MELROSE,
        ..suspension(FlowType::Uniaxial, 30, 0.45)
    };
    let Err(Error::Refused(refusal)) = start::check(&few) else {
        panic!("a cell of thirty spheres");
    };
    let text = refusal.to_string();
    let least = text
        .split("at least ")
        .nth(1)
        .and_then(|rest| rest.split(' ').next());
    let least: usize = least.unwrap().parse().unwrap();
    let at = |spheres| {
        start::check(&Params {
            spheres,
            ..few.clone()
        })
    };
    assert!(at(least).is_ok() && at(least - 1).is_err(), "{text}");
}
