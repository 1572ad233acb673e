//! Brownian motion: diffusion of a sphere, the equilibrium of pairs and of suspensions, and bits.

use crate::common::schemes::{rigid, spring};
use nalgebra::Vector3;
use sd_core::cell::Cell;
use sd_core::instant::{Configuration, InstantContacts, solve};
use sd_core::law::repulsion::ExponentialRepulsion;
use sd_core::law::van_der_waals::VanDerWaals;
use sd_core::model::{ColloidUnit, FlowType, Segment, StartFrom};
use sd_core::modes::Vec2;
use sd_core::{
    Bulk, ContactLaws, ContactScheme, Hydrodynamics, Layer, LeadingOrder, NearFields, NormalLaw,
    Params, RunSpace, Simulation, Snapshot, Space, TangentialLaw, VelocityGradient,
};
use std::f64::consts::PI;

const NEAR: Hydrodynamics = Hydrodynamics::BallMelrose;
const LUBRICATION: Hydrodynamics = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);

/// Spheres in fluid at rest, whose unit of time is a²/D0, with the longest step.
fn at_rest(spheres: usize, roughness: f64) -> sd_core::model::ParamsBuilder {
    Params::builder()
        .spheres(spheres)
        .roughness(roughness)
        .friction(0.0)
        .shear_rate(0.0)
        .hydrodynamics(LUBRICATION)
        .contact(ContactScheme::Rigid)
        .time_step(roughness / 80.0)
        .at_rest()
        .peclet(0.0)
}

#[test]
fn a_sphere_diffuses_by_stokes_and_einstein() {
    // D0 = kT/6πa is the unit; the rotation has kT/8πa³ = 0.75.
    let params = at_rest(1, 0.4).area_fraction(0.02).build().unwrap();
    let mut layer = Simulation::<Layer>::new(&params, 1, &NearFields::default()).unwrap();
    let steps = 20_000;
    let (mut square, mut turned, mut mean) = (0.0, 0.0, 0.0);
    for _ in 0..steps {
        layer.step().unwrap();
        let [x, y, spin] = layer.velocities()[0];
        let share = params.time_step / (2.0 * f64::from(steps));
        square += (x * x + y * y) * 0.5 * share;
        turned += spin * spin * share;
        mean += x / f64::from(steps);
    }
    // Four standard deviations of means of squares: 4 √(2/n).
    assert!((square - 1.0).abs() < 0.03, "{square}");
    assert!((turned / 0.75 - 1.0).abs() < 0.04, "{turned}");
    let deviation = (2.0 / (params.time_step * f64::from(steps))).sqrt();
    assert!(mean.abs() < 4.0 * deviation, "{mean}");
}

/// Two spheres in a box, whose places are uniform whatever their mobility.
fn check_places_of_two(params: &Params, steps: u32) {
    let width = 0.025;
    let mut pair = Simulation::<Bulk>::new(params, 1, &NearFields::default()).unwrap();
    let (side, least) = (pair.side(), 2.0 + params.roughness);
    let mut counts = [0_u32; 20];
    for _ in 0..steps {
        pair.step().unwrap();
        let cell = pair.cell_at(pair.time()).unwrap();
        let (apart, _) = cell.nearest(pair.centres()[0] - pair.centres()[1]);
        let apart = apart.norm();
        if let Some(bin) = (0..20_u8).rfind(|bin| apart >= least + width * f64::from(*bin))
            && apart < least + 20.0 * width
        {
            counts[usize::from(bin)] += 1;
        }
    }
    let density: Vec<f64> = (0..20)
        .zip(counts)
        .map(|(bin, count)| {
            let [inner, outer] = [bin, bin + 1].map(|k| least + width * f64::from(k));
            f64::from(count) / (outer.powi(3) - inner.powi(3))
        })
        .collect();
    // Pairs diffuse a tenth as fast in the first bin as in the last. Without the drift they collect
    // there, and contacts that only stop hold them.
    let (near, far) = (density[0], density[1..].iter().sum::<f64>() / 19.0);
    assert!((near / far - 1.0).abs() < 0.1, "{near} {far}");
    let halves = [&density[1..10], &density[10..]].map(|part| part.iter().sum::<f64>());
    assert!(
        (halves[0] / 9.0 / (halves[1] / 10.0) - 1.0).abs() < 0.1,
        "{density:?}"
    );
    let free = side.powi(3) - 4.0 / 3.0 * PI * least.powi(3);
    let share = far * free / (4.0 / 3.0 * PI * f64::from(steps));
    assert!((share - 1.0).abs() < 0.2, "{share}");
}

#[test]
fn places_of_two_spheres_are_uniform_whatever_their_mobility() {
    let params = at_rest(2, 0.05).volume_fraction(0.06).build().unwrap();
    check_places_of_two(&params, 300_000);
}

#[test]
fn places_are_uniform_also_where_strain_diffuses() {
    // The stress is a small one. The viscosity, and with it the drift of the strain, depends on the
    // gap, and the strain moves the spheres as much as their own forces do.
    let (peclet, roughness) = (1e-3, 0.1);
    let params = under_stress(2, peclet)
        .volume_fraction(0.06)
        .roughness(roughness)
        .time_step(0.5 * peclet * roughness / 80.0)
        .build()
        .unwrap();
    check_places_of_two(&params, 300_000);
}

#[test]
fn gaps_of_a_colloidal_pair_have_a_boltzmann_distribution() {
    // Charged spheres with a well of 2 kT; forces of pairs end at the cutoff of lubrication.
    let laws = ContactLaws {
        normal: NormalLaw::ExponentialRepulsion,
        colloid_unit: ColloidUnit::Thermal,
        repulsion: 240.0,
        repulsion_length: 0.05,
        van_der_waals: 15.0,
        van_der_waals_length: 0.1,
        lubrication_gap: 0.0,
        ..ContactLaws::PAPER
    };
    let params = at_rest(2, 0.0)
        .volume_fraction(0.06)
        .contact(ContactScheme::Laws(laws))
        .time_step(5e-4)
        .build()
        .unwrap();
    let mut pair = Simulation::<Bulk>::new(&params, 1, &NearFields::default()).unwrap();
    let (steps, bins, width) = (800_000, 6_u8, 0.1);
    let mut counts = vec![0_u32; usize::from(bins)];
    let side = pair.side();
    for _ in 0..steps {
        pair.step().unwrap();
        let [a, b] = [pair.centres()[0], pair.centres()[1]];
        let gap = (a - b).map(|x| x - side * (x / side).round()).norm() - 2.0;
        if let Some(bin) = (0..bins).rfind(|bin| gap >= width * f64::from(*bin))
            && gap < width * f64::from(bins)
        {
            counts[usize::from(bin)] += 1;
        }
    }
    let repulsion = ExponentialRepulsion {
        force: 240.0,
        length: 0.05,
    };
    let attraction = VanDerWaals {
        energy: 15.0,
        length: 0.1,
    };
    let potential = |gap: f64| repulsion.energy(gap, 1.0) + attraction.energy(gap, 1.0);
    let cutoff = LeadingOrder::DEFAULT.cutoff;
    let weight = |bin: u8| -> f64 {
        let points = (0..50).map(|k| width * (f64::from(bin) + (f64::from(k) + 0.5) / 50.0));
        points
            .map(|gap| {
                let energy = potential(gap.min(cutoff)) - potential(cutoff);
                (2.0 + gap).powi(2) * (-energy).exp()
            })
            .sum()
    };
    let weights: Vec<f64> = (0..bins).map(weight).collect();
    let [all, whole] = [
        counts.iter().map(|count| f64::from(*count)).sum::<f64>(),
        weights.iter().sum::<f64>(),
    ];
    for (bin, (count, weight)) in counts.iter().zip(&weights).enumerate() {
        let (found, expected) = (f64::from(*count) / all, weight / whole);
        assert!((found - expected).abs() < 0.1 * expected + 0.002, "{bin}");
    }
}

/// Spheres under a stress, whose unit of time is mu/σ; Pe = 6π a³ σ/kT.
fn under_stress(spheres: usize, peclet: f64) -> sd_core::model::ParamsBuilder {
    Params::builder()
        .spheres(spheres)
        .friction(0.0)
        .shear_stress(1.0)
        .peclet(peclet)
        .hydrodynamics(LUBRICATION)
        .contact(ContactScheme::Rigid)
}

#[test]
fn strain_under_a_stress_is_a_thermal_coordinate() {
    // Of one sphere the viscosity is 1 + 2.5 φ, without images.
    let (peclet, fraction, steps) = (10.0, 0.03, 20_000_u32);
    let params = under_stress(1, peclet)
        .volume_fraction(fraction)
        .roughness(0.1)
        .time_step(0.01)
        .build()
        .unwrap();
    let mut run = Simulation::<Bulk>::new(&params, 1, &NearFields::default()).unwrap();
    let viscosity = 1.0 + 2.5 * fraction;
    let (mut strain, mut square) = (0.0, 0.0);
    for _ in 0..steps {
        let sample = run.step().unwrap();
        let gained = run.strain() - strain;
        // Γ of the step is 6π σ* times the rate.
        let rate = sample.shear_rate / (6.0 * PI);
        assert!((gained - rate * params.time_step).abs() < 1e-12);
        strain = run.strain();
        square += (gained - params.time_step / viscosity).powi(2) / f64::from(steps);
    }
    let volume = 4.0 / 3.0 * PI / fraction;
    let variance = 2.0 * 6.0 * PI / peclet / (viscosity * volume);
    assert!((square / (variance * params.time_step) - 1.0).abs() < 0.04);
    let time = params.time_step * f64::from(steps);
    let missing = strain - time / viscosity;
    assert!(missing.abs() < 4.0 * (variance * time).sqrt(), "{missing}");
}

/// Mean and error of a number of samples over four runs to this time in steps of a length.
fn mean_of_runs(
    builder: sd_core::model::ParamsBuilder,
    [time, step]: [f64; 2],
    of: fn(&sd_core::Sample) -> f64,
) -> [f64; 2] {
    let params = builder
        .volume_fraction(0.35)
        .roughness(0.2)
        .time_step(step)
        .build()
        .unwrap();
    let (mut runs, tables) = (Vec::new(), NearFields::default());
    for seed in 1..=4 {
        let mut run = Simulation::<Bulk>::new(&params, seed, &tables).unwrap();
        let (mut sum, mut number) = (0.0, 0.0);
        while run.time() < time {
            let value = of(&run.step().unwrap());
            if run.time() > 0.1 * time {
                sum += value;
                number += 1.0;
            }
        }
        runs.push(sum / number);
    }
    let mean = runs.iter().sum::<f64>() / 4.0;
    let square: f64 = runs.iter().map(|x| (x - mean).powi(2)).sum();
    [mean, (square / 12.0).sqrt()]
}

#[test]
fn the_stress_of_a_rate_leaves_that_rate() {
    let peclet = 20.0;
    let at_rate = Params::builder()
        .spheres(20)
        .friction(0.0)
        .shear_rate(0.0)
        .peclet(peclet)
        .hydrodynamics(LUBRICATION)
        .contact(ContactScheme::Rigid);
    let [viscosity, error] = mean_of_runs(at_rate, [25.0, 0.05], |sample| sample.viscosity);
    // In units of the stress it is larger by the viscosity.
    let free = under_stress(20, peclet * viscosity);
    let [rate, of_rate] = mean_of_runs(free, [100.0, 0.1], |sample| sample.shear_rate / (6.0 * PI));
    let allowed = 4.0 * (error / viscosity).hypot(of_rate / rate);
    assert!(allowed < 0.3, "{viscosity} {error}, {rate} {of_rate}");
    let found = rate * viscosity;
    assert!((found - 1.0).abs() < allowed, "{found} {allowed}");
}

#[test]
fn a_stress_on_brownian_spheres_has_limits() {
    let stressed = || under_stress(80, 10.0).volume_fraction(0.3).roughness(0.1);
    let refused = |builder: sd_core::model::ParamsBuilder, key: &str| {
        let error = builder.build().unwrap_err().to_string();
        assert!(error.contains(key), "{error}");
    };
    stressed().build().unwrap();
    refused(stressed().flow(FlowType::PlanarExtension), "is of shear");
    let segment = |start, stress| Segment {
        start,
        shear_stress: Some(stress),
        ..Segment::default()
    };
    let segments = vec![segment(0.0, 1.0), segment(1.0, 2.0)];
    refused(stressed().segments(segments), "random times");
    refused(stressed().time_step(0.02), "roughness Pe/80");
    refused(stressed().peclet(0.0), "leaves no flow");
    refused(stressed().thermal_load(2.0), "beside `peclet`");
    // The critical load follows from the stress.
    let loaded = stressed().peclet(f64::INFINITY).thermal_load(2.0);
    let energy = loaded.time_step(0.001).build().unwrap().thermal_energy();
    assert!((energy.unwrap() - 0.5).abs() < 1e-12);
    // Without friction, too, the temperature is in units of the load and keeps the rate.
    let smooth = Params::builder()
        .spheres(40)
        .area_fraction(0.4)
        .roughness(0.1)
        .friction(0.0);
    let smooth = smooth.shear_rate(0.5).thermal_load(20.0).time_step(0.001);
    let smooth = smooth.hydrodynamics(LUBRICATION).build().unwrap();
    assert_eq!(smooth.shear_rate, 0.5);
    let energy = smooth.thermal_energy().unwrap();
    assert!((energy / (6.0 * PI / 10.0) - 1.0).abs() < 1e-12, "{energy}");
}

#[test]
fn a_layer_under_a_stress_leaves_the_offset_of_its_strain() {
    let params = under_stress(40, 10.0)
        .area_fraction(0.4)
        .roughness(0.1)
        .time_step(0.01)
        .build()
        .unwrap();
    let mut run = Simulation::<Layer>::new(&params, 3, &NearFields::default()).unwrap();
    for _ in 0..100 {
        run.step().unwrap();
    }
    let layer = run.snapshot().layer(&params).unwrap();
    let offset = run.strain() * layer.side;
    let wrapped = offset - layer.side * (offset / layer.side + 0.5).floor();
    assert!((layer.offset - wrapped).abs() < 1e-9, "{}", layer.offset);
    // The time is another number.
    assert!((run.strain() - 1.0).abs() > 0.1, "{}", run.strain());
}

#[test]
fn stresses_of_spheres_under_a_stress_add_up_to_it() {
    let params = under_stress(20, 10.0)
        .volume_fraction(0.35)
        .roughness(0.1)
        .time_step(0.0125)
        .build()
        .unwrap();
    let mut run = Simulation::<Bulk>::new(&params, 2, &NearFields::default()).unwrap();
    let (mut sum, mut square, steps) = (0.0, 0.0, 4000_u32);
    for _ in 0..steps {
        let sample = run.step().unwrap();
        let stress = sample.shear_rate / (6.0 * PI) + sample.stress.shear.total();
        sum += stress / f64::from(steps);
        square += stress * stress / f64::from(steps);
        assert!(sample.viscosity.is_nan());
    }
    let deviation = ((square - sum * sum) / f64::from(steps)).sqrt();
    assert!(deviation < 0.1, "{deviation}");
    assert!((sum - 1.0).abs() < 4.0 * deviation, "{sum} {deviation}");
}

/// After some steps, and the same without samples and with an interruption in the middle.
fn interrupted<S: RunSpace>(params: &Params) -> [Snapshot<S>; 2] {
    let tables = NearFields::default();
    [false, true].map(|stops| {
        let mut run = Simulation::<S>::new(params, 3, &tables).unwrap();
        for step in 0..8 {
            if stops {
                run.step_unmeasured().unwrap();
            } else {
                run.step().unwrap();
            }
            if stops && step == 3 {
                run = Simulation::from_snapshot(params, run.snapshot(), &tables).unwrap();
            }
        }
        run.snapshot()
    })
}

#[test]
fn interrupted_runs_have_the_same_bits() {
    for contact in [
        ContactScheme::Rigid,
        rigid(TangentialLaw::Coulomb),
        spring(1e4, TangentialLaw::StickSlide),
    ] {
        let run = |builder: sd_core::model::ParamsBuilder, spheres: usize| {
            let builder = builder
                .spheres(spheres)
                .roughness(0.01)
                .friction(0.5)
                .shear_rate(20.0)
                .hydrodynamics(NEAR)
                .contact(contact)
                .time_step(0.001);
            // Pe = 10 at the rate of the grid.
            let builder = if spheres == 31 {
                builder.thermal_load(0.5)
            } else {
                builder.peclet(10.0)
            };
            builder.build().unwrap()
        };
        for spheres in [30, 80] {
            let layer = run(Params::builder().area_fraction(0.65), spheres);
            let [whole, resumed] = interrupted::<Layer>(&layer);
            assert_eq!(whole, resumed, "{contact:?} {spheres}");
            let still = Params {
                peclet: f64::INFINITY,
                ..layer
            };
            let [without, _] = interrupted::<Layer>(&still);
            assert_ne!(whole.centres, without.centres);
        }
        // At another rate the same material has another Péclet number.
        let segment = |start, rate| Segment {
            start,
            shear_rate: Some(rate),
            ..Segment::default()
        };
        let layer = Params::builder()
            .area_fraction(0.65)
            .segments(vec![segment(0.0, 20.0), segment(0.002, 40.0)]);
        let params = run(layer, 31);
        let [whole, resumed] = interrupted::<Layer>(&params);
        assert_eq!(whole, resumed, "{contact:?}, segments");
        let suspension = run(Params::builder().volume_fraction(0.45), 80);
        let [whole, resumed] = interrupted::<Bulk>(&suspension);
        assert_eq!(whole, resumed, "{contact:?}");
        // The strain is a part of the state.
        let stressed = |params: &Params| Params {
            shear_rate: 0.0,
            shear_stress: Some(1.0),
            ..params.clone()
        };
        let [whole, resumed] = interrupted::<Bulk>(&stressed(&suspension));
        assert_eq!(whole, resumed, "{contact:?}, stress");
        assert!(whole.travelled[0] != 0.0);
        // With a far field in full matrices, iterated, and in a suspension.
        let full = |params: Params| Params {
            hydrodynamics: Hydrodynamics::StokesianDynamics,
            ..params
        };
        for spheres in [32, 130] {
            let layer = full(run(Params::builder().area_fraction(0.6), spheres));
            let [whole, resumed] = interrupted::<Layer>(&layer);
            assert_eq!(whole, resumed, "{contact:?} {spheres}");
        }
        let suspension = full(run(Params::builder().volume_fraction(0.4), 64));
        let [whole, resumed] = interrupted::<Bulk>(&suspension);
        assert_eq!(whole, resumed, "{contact:?}");
    }
}

/// Pairs of spheres with a gap below `limit`.
fn close_pairs(centres: &[Vector3<f64>], side: f64, limit: f64) -> f64 {
    let mut pairs = 0;
    for (i, x) in centres.iter().enumerate() {
        for y in &centres[..i] {
            let apart = (x - y).map(|x| x - side * (x / side).round());
            pairs += u32::from(apart.norm() < 2.0 + limit);
        }
    }
    f64::from(pairs)
}

/// Pairs close to contact over those of Monte Carlo starts, and `Z − 1` of the contact forces over
/// that of Carnahan & Starling, of spheres in equilibrium with steps of this share of the longest.
fn equilibrium(share: f64, steps: u32) -> [f64; 2] {
    let roughness = 0.05;
    let mut params = at_rest(108, roughness)
        .volume_fraction(0.3)
        .start(StartFrom::Equilibrium)
        .build()
        .unwrap();
    params.time_step *= share;
    let limit = roughness + 0.025;
    let starts = 40_u32;
    let mut expected = 0.0;
    for seed in 1..=starts {
        // Monte Carlo moves know neither mobility nor contact forces.
        let start = Snapshot::<Bulk>::start(&params, seed.into()).unwrap();
        let centres: Vec<_> = start.centres.iter().map(|x| Vector3::from(*x)).collect();
        expected += close_pairs(&centres, start.side, limit) / f64::from(starts);
    }
    let mut run = Simulation::<Bulk>::new(&params, 1, &NearFields::default()).unwrap();
    let (mut found, mut pressure) = (0.0, 0.0);
    for _ in 0..steps {
        let sample = run.step().unwrap();
        found += close_pairs(run.centres(), run.side(), limit) / f64::from(steps);
        pressure += sample.stress.particle_pressure.normal_contact / f64::from(steps);
    }
    let density = 108.0 / run.side().powi(3);
    // Contacts make them spheres of radius a + h/2.
    let f = 0.3 * (1.0 + 0.5 * roughness).powi(3);
    let compressibility = (1.0 + f + f * f - f.powi(3)) / (1.0 - f).powi(3);
    let excess = pressure / (density * 6.0 * PI);
    [found / expected, excess / (compressibility - 1.0)]
}

#[test]
fn spheres_in_equilibrium_stay_there() {
    let [pairs, pressure] = equilibrium(1.0, 1000);
    // Four standard deviations of the mean of 40 starts, and of the collisions of the run.
    assert!((pairs - 1.0).abs() < 0.2, "{pairs}");
    assert!((pressure - 1.0).abs() < 0.1, "{pressure}");
}

#[test]
#[ignore = "minutes: the time-step study of docs/brownian.md"]
fn times_of_steps_in_equilibrium() {
    for (share, steps) in [(1.0, 10_000), (0.5, 20_000), (0.25, 40_000)] {
        let [pairs, pressure] = equilibrium(share, steps);
        eprintln!("{share} of the longest step: pairs {pairs:.3}, Z - 1 {pressure:.3}");
    }
}

/// Three spheres away from contact, in a suspension.
const PLACES: [[f64; 3]; 3] = [[2.0, 2.0, 2.0], [3.7, 3.2, 2.6], [2.2, 3.9, 0.9]];

/// `kT Σ_k ∂S(F = e_k)/∂x_k` over the coordinates of all spheres, as xx, xy and yy of the summed
/// stresslets: the Brownian stress `−kT ∇·(R_SU R_FU⁻¹)`, by central differences of instants.
fn divergence(side: f64) -> [f64; 3] {
    let sums = |moved: usize, by: f64| {
        let mut centres = PLACES.map(Vector3::from).to_vec();
        centres[moved / 3][moved % 3] += by;
        let mut forces = vec![Vector3::zeros(); 3];
        forces[moved / 3][moved % 3] = 1.0;
        let instant = Configuration::<Bulk> {
            centres,
            radii: vec![1.0; 3],
            cell: Cell::equal_sides(side, 0.0).unwrap(),
            hydrodynamics: LUBRICATION,
            background: VelocityGradient::at_rest().into(),
            forces,
            torques: vec![Vector3::zeros(); 3],
        };
        let solved = solve(&instant, &InstantContacts::None, &NearFields::default()).unwrap();
        let mut sum = [0.0; 3];
        for stresslet in &solved.stresslets {
            let tensor = Bulk::full_tensor(stresslet);
            for (sum, k) in sum.iter_mut().zip([0, 3, 1]) {
                *sum += tensor[k];
            }
        }
        sum
    };
    let (mut total, by) = ([0.0; 3], 1e-5);
    for moved in 0..9 {
        let [ahead, behind] = [by, -by].map(|by| sums(moved, by));
        for k in 0..3 {
            total[k] += (ahead[k] - behind[k]) / (2.0 * by) * 6.0 * PI;
        }
    }
    total
}

#[test]
fn brownian_stress_is_a_divergence() {
    let mut params = at_rest(3, 0.01).volume_fraction(0.04).build().unwrap();
    params.time_step = 1e-6;
    let mut start = Snapshot::<Bulk>::start(&params, 1).unwrap();
    start.centres = PLACES.to_vec();
    let tables = NearFields::default();
    let draws = 20_000_u32;
    let (mut mean, mut square) = ([0.0; 2], [0.0; 2]);
    let volume = start.side.powi(3);
    for seed in 0..draws {
        start.noise_seed = Some(seed.into());
        let mut run = Simulation::from_snapshot(&params, start.clone(), &tables).unwrap();
        let stress = run.step().unwrap().stress;
        let found = [stress.n1.brownian, stress.xy.brownian].map(|x| x * volume);
        for k in 0..2 {
            mean[k] += found[k] / f64::from(draws);
            square[k] += found[k] * found[k] / f64::from(draws);
        }
    }
    let [xx, xy, yy] = divergence(start.side);
    for (k, expected) in [xx - yy, xy].into_iter().enumerate() {
        let deviation = ((square[k] - mean[k] * mean[k]) / f64::from(draws)).sqrt();
        assert!(deviation < 0.1 * expected.abs(), "{expected} {deviation}");
        assert!(
            (mean[k] - expected).abs() < 4.0 * deviation,
            "{mean:?} {expected} {deviation}"
        );
    }
}

/// Two spheres at a distance r along x in unbounded fluid, in units of mu and a: the mobilities G
/// and H of their relative motion along and across that line, over 1/3π; the shares A and B of
/// the strain by which they follow it less than fluid; the sums s and t of their stresslets under
/// opposite forces F along it, s F (n n − I/3), and across it, t (n F + F n).
fn pair_functions(r: f64, tables: &NearFields) -> [f64; 6] {
    let solved = |force: [f64; 2], background: VelocityGradient<Layer>| {
        let force = Vec2::new(force[0], force[1]);
        let instant = Configuration::<Layer> {
            centres: vec![Vec2::zeros(), Vec2::new(r, 0.0)],
            radii: vec![1.0; 2],
            cell: Cell::Unbounded,
            hydrodynamics: Hydrodynamics::StokesianDynamics,
            background: background.into(),
            forces: vec![-force, force],
            torques: vec![0.0; 2],
        };
        let solved = solve(&instant, &InstantContacts::None, tables).unwrap();
        let [first, second] = [0, 1].map(|sphere| solved.disturbances[sphere]);
        let [(xx, _, xy), (other_xx, _, other_xy)] = [0, 1].map(|sphere| solved.stresslet(sphere));
        let relative = [second[0] - first[0], second[1] - first[1]];
        (relative, [xx + other_xx, xy + other_xy])
    };
    let at_rest = VelocityGradient::at_rest();
    let ([along, _], [xx, _]) = solved([1.0, 0.0], at_rest);
    let ([_, across], [_, xy]) = solved([0.0, 1.0], at_rest);
    let ([stretched, _], _) = solved([0.0; 2], VelocityGradient::planar_extension(1.0));
    let ([_, turned], _) = solved([0.0; 2], VelocityGradient::simple_shear(2.0));
    [
        3.0 * PI * along,
        3.0 * PI * across,
        -stretched / r,
        -turned / r,
        1.5 * xx,
        xy,
    ]
}

/// The Brownian viscosity of a dilute suspension at Pe → 0, over φ² mu, by pairs alone (Batchelor,
/// J. Fluid Mech. 83, 97, 1977):
///
/// ```text
/// g = 1 + (6π mu a³ rate/kT) ψ(r) n·E·n/rate
/// (r² G ψ')' − 6 H ψ = −(3π r³ A)' + 9π r² B,   r² G ψ' = 3π r³ (1 − A) at contact    (kT = 1)
/// η_B = (n²/4) (8π/15) ∫ ψ [(r² s)' − 6 r t] dr
/// ```
fn pair_viscosity(contact: f64, intervals: u32) -> f64 {
    let tables = NearFields::default();
    // The functions vary with the logarithm of the gap u.
    let [least, most] = [contact - 2.0, 28.0].map(f64::ln);
    let du = (most - least) / f64::from(intervals);
    let gaps: Vec<f64> = (0..=intervals)
        .map(|k| (least + f64::from(k) * du).exp())
        .collect();
    let all: Vec<[f64; 6]> = gaps
        .iter()
        .map(|gap| pair_functions(2.0 + gap, &tables))
        .collect();
    let carried = |k: usize| 3.0 * PI * (2.0 + gaps[k]).powi(3) * all[k][2];
    let conductance = |k: usize| {
        let middle = 2.0 + 0.5 * (gaps[k] + gaps[k + 1]);
        middle * middle * (all[k][0] * all[k + 1][0] / (gaps[k] * gaps[k + 1])).sqrt() / du
    };
    // Volumes about the points, from contact outwards, where ψ ends at 0.
    let last = gaps.len() - 1;
    let (mut pivots, mut sums) = (vec![0.0; last], vec![0.0; last]);
    for k in 0..last {
        let r = 2.0 + gaps[k];
        let width = if k == 0 { 0.5 * du } else { du } * gaps[k];
        let outward = 0.5 * (carried(k) + carried(k + 1));
        let inward = match k {
            0 => 3.0 * PI * r.powi(3),
            _ => 0.5 * (carried(k - 1) + carried(k)),
        };
        pivots[k] = -conductance(k) - 6.0 * all[k][1] * width;
        sums[k] = inward - outward + 9.0 * PI * r * r * all[k][3] * width;
        if k > 0 {
            let c = conductance(k - 1);
            pivots[k] -= c + c * c / pivots[k - 1];
            sums[k] -= c * sums[k - 1] / pivots[k - 1];
        }
    }
    let mut psi = vec![0.0; last + 1];
    for k in (0..last).rev() {
        psi[k] = (sums[k] - conductance(k) * psi[k + 1]) / pivots[k];
    }
    let along = |k: usize| (2.0 + gaps[k]).powi(2) * all[k][4];
    let across = |k: usize| 6.0 * (2.0 + gaps[k]) * all[k][5] * gaps[k] * psi[k];
    let integral: f64 = (0..last)
        .map(|k| {
            let moved = 0.5 * (psi[k] + psi[k + 1]) * (along(k + 1) - along(k));
            moved - 0.5 * du * (across(k) + across(k + 1))
        })
        .sum();
    let density = 3.0 / (4.0 * PI);
    0.25 * density * density * 8.0 * PI / 15.0 * integral
}

#[test]
fn brownian_viscosity_of_pairs_is_that_of_the_dilute_limit() {
    // The zero-shear viscosity is 1 + 2.5 φ + 5.91 φ², that at high frequency 1 + 2.5 φ + 5.00 φ²
    // (Cichocki & Felderhof, J. Chem. Phys. 89, 1049, 1988; 93, 4427, 1990).
    let found = pair_viscosity(2.0001, 80);
    assert!((found - 0.91).abs() < 0.005, "{found}");
}
