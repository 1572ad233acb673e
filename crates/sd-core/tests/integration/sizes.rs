//! Layers and suspensions of many sizes.

use sd_core::cell::Cell;
use sd_core::instant::{Configuration, InstantContacts, solve};
use sd_core::{
    Bulk, ContactScheme, Hydrodynamics, Layer, LeadingOrder, NearFields, Params, RunSpace,
    Simulation, Snapshot, VelocityGradient,
};

/// Parameters of a layer of these sizes.
fn layer(spheres: usize, area_fraction: f64, sizes: &str) -> Params {
    Params::builder()
        .spheres(spheres)
        .area_fraction(area_fraction)
        .roughness(0.01)
        .friction(0.3)
        .shear_rate(f64::INFINITY)
        .sizes(sizes.parse().unwrap())
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(ContactScheme::Rigid)
        .time_step(0.005)
        .build()
        .unwrap()
}

/// These sizes in a suspension.
fn suspension(spheres: usize, volume_fraction: f64, sizes: &str) -> Params {
    Params {
        area_fraction: 0.0,
        volume_fraction: Some(volume_fraction),
        ..layer(spheres, 0.5, sizes)
    }
}

/// Viscosity of the start of seed 1 in simple shear, with radii changed by a relative amount that
/// grows from sphere to sphere.
fn viscosity<S: RunSpace>(params: &Params, change: f64, tables: &NearFields) -> f64 {
    let start = S::start(params, 1).unwrap();
    let radii = start.radii.iter().enumerate();
    let configuration = Configuration::<S> {
        radii: radii.map(|(k, a)| a * (1.0 + change * k as f64)).collect(),
        forces: vec![S::Vector::default(); start.centres.len()],
        torques: vec![S::Spin::default(); start.centres.len()],
        centres: start.centres,
        cell: Cell::equal_sides(start.side, 0.0).unwrap(),
        hydrodynamics: params.hydrodynamics,
        background: VelocityGradient::<S>::simple_shear(1.0).into(),
    };
    let instant = solve(&configuration, &InstantContacts::None, tables).unwrap();
    let stress = instant.stress.unwrap();
    let difference = stress.viscosity - 1.0 - stress.dissipation;
    assert!(difference.abs() < 1e-8 * stress.viscosity, "{difference:e}");
    stress.viscosity
}

#[test]
fn many_sizes_go_over_into_a_few_as_they_come_together() {
    // Three sizes have tables of their own; as many sizes as spheres, each within 1e-9 of these,
    // have one table of all size ratios.
    let sizes = "1:0.4 1.3:0.3 1.9:0.3";
    let tables = NearFields::default();
    let check = |params: &Params| {
        let of = |change| match params.volume_fraction {
            None => viscosity::<Layer>(params, change, &tables),
            Some(_) => viscosity::<Bulk>(params, change, &tables),
        };
        let (few, many) = (of(0.0), of(1e-11));
        let difference = (few / many - 1.0).abs();
        println!(
            "{:?} {} {difference:.1e}",
            params.hydrodynamics, params.spheres
        );
        assert!(
            difference > 0.0 && difference < 1e-7,
            "{params:?}: {difference:e}"
        );
    };
    for hydrodynamics in [
        Hydrodynamics::BallMelrose,
        Hydrodynamics::StokesianDynamics,
        Hydrodynamics::Lubrication(LeadingOrder::DEFAULT),
    ] {
        // The far field of the larger layer and suspension is iterated.
        for spheres in [50, 150] {
            let params = Params {
                hydrodynamics,
                ..layer(spheres, 0.6, sizes)
            };
            check(&params);
        }
        let params = Params {
            hydrodynamics,
            ..suspension(120, 0.3, sizes)
        };
        check(&params);
    }
}

/// Makes two runs of twelve steps, one of them interrupted, and compares bits.
fn check_interrupted<S: RunSpace>(params: &Params) {
    params.validate().unwrap();
    let tables = NearFields::default();
    let mut whole = Simulation::<S>::new(params, 3, &tables).unwrap();
    let whole_samples: Vec<_> = (0..12).map(|_| whole.step().unwrap()).collect();
    let mut first = Simulation::<S>::new(params, 3, &tables).unwrap();
    let mut samples: Vec<_> = (0..5).map(|_| first.step().unwrap()).collect();
    // As in another process, with new tables.
    let mut second =
        Simulation::<S>::from_snapshot(params, first.snapshot(), &NearFields::default()).unwrap();
    samples.extend((0..7).map(|_| second.step().unwrap()));
    assert_eq!(samples, whole_samples);
    assert_eq!(second.snapshot(), whole.snapshot());
}

#[test]
fn interrupted_runs_of_many_sizes_resume_with_the_same_bits() {
    check_interrupted::<Layer>(&layer(60, 0.7, "lognormal 0.2"));
    check_interrupted::<Bulk>(&suspension(140, 0.4, "schulz 0.15"));
}

#[test]
fn a_seed_decides_where_spheres_are_and_not_how_large() {
    let sorted = |params: &Params, seed| {
        let mut radii = match params.volume_fraction {
            None => Snapshot::<Layer>::start(params, seed).unwrap().radii,
            Some(_) => Snapshot::<Bulk>::start(params, seed).unwrap().radii,
        };
        radii.sort_by(f64::total_cmp);
        radii
    };
    for params in [
        layer(60, 0.7, "uniform 0.3"),
        layer(1_200, 0.5, "lognormal 0.1"),
        suspension(190, 0.4, "lognormal 0.15"),
    ] {
        assert_eq!(sorted(&params, 1), sorted(&params, 2));
    }
    let params = layer(60, 0.7, "uniform 0.3");
    let centres = |seed| Snapshot::<Layer>::start(&params, seed).unwrap().centres;
    assert_ne!(centres(1), centres(2));
}
