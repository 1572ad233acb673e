//! All components of the stress by cause: each against a separate calculation, and against
//! symmetries.

use sd_core::Space as _;
use sd_core::cell::Cell;
use sd_core::contact::{Contact, Laws, Surface};
use sd_core::instant::{Configuration, InstantContacts, SolvedConfiguration, solve};
use sd_core::modes::Vec2;
use sd_core::{
    Bulk, ContactLaws, ContactScheme, Hydrodynamics, NearFields, Params, Simulation,
    StressComponents, StressParts, TangentialLaw, VelocityGradient,
};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Sliding springs with a repulsion: every part of the stress occurs.
fn params() -> Params {
    Params::builder()
        .spheres(40)
        .area_fraction(0.66)
        .roughness(0.01)
        .friction(0.3)
        .shear_rate(10.0)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(ContactScheme::Laws(ContactLaws {
            repulsion: 2.0,
            repulsion_length: 0.02,
            ..ContactLaws::linear_spring(1e4, TangentialLaw::Coulomb, 0.01)
        }))
        .time_step(0.005)
        .two_sizes(1.4, 0.5)
        .build()
        .unwrap()
}

fn tables() -> NearFields {
    let mut tables = NearFields::default();
    tables.insert(sd_core::two_sphere::NearField::new(1.4).unwrap());
    tables
}

/// A layer after some shear, in a cell without offset.
fn layer(tables: &NearFields) -> Configuration {
    let params = params();
    let mut simulation = Simulation::<sd_core::Layer>::new(&params, 5, tables).unwrap();
    // At a strain of 1 the cell is square again.
    for _ in 0..200 {
        simulation.step().unwrap();
    }
    let snapshot = simulation.snapshot();
    Configuration {
        centres: snapshot
            .centres
            .iter()
            .map(|x| Vec2::new(x[0], x[1]))
            .collect(),
        radii: snapshot.radii,
        cell: Cell::equal_sides(snapshot.side, 0.0).unwrap(),
        hydrodynamics: Hydrodynamics::BallMelrose,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vec2::zeros(); params.spheres],
        torques: vec![0.0; params.spheres],
    }
}

fn solved(configuration: &Configuration, tables: &NearFields) -> SolvedConfiguration {
    let request = InstantContacts::of_run(&params(), 0.001);
    solve(configuration, &request, tables).unwrap()
}

/// The volume that stresses are divided by.
fn volume(configuration: &Configuration) -> f64 {
    let mean = configuration.radii.iter().sum::<f64>() / configuration.radii.len() as f64;
    2.0 * mean * configuration.cell.content().unwrap()
}

/// Stress `[xx, yy, zz, xy]` of forces on the second sphere of pairs, by `−r ⊗ F`, its symmetric
/// part.
fn moment(pairs: &[Contact], force: impl Fn(&Contact) -> Vec2) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for c in pairs {
        let (r, f) = (c.pair.normal * c.pair.distance, force(c));
        sum[0] -= r.x * f.x;
        sum[1] -= r.y * f.y;
        sum[3] -= 0.5 * (r.x * f.y + r.y * f.x);
    }
    sum
}

fn close(found: f64, expected: f64, scale: f64) {
    assert!(
        (found - expected).abs() < 1e-10 * scale,
        "{found} and not {expected}"
    );
}

#[test]
fn every_part_is_the_moment_of_its_forces_and_the_parts_add_up_to_the_viscosity() {
    let tables = tables();
    let configuration = layer(&tables);
    let instant = solved(&configuration, &tables);
    let (stress, volume) = (instant.stress.unwrap(), volume(&configuration));
    let mut hydrodynamic = [0.0; 4];
    for sphere in 0..configuration.radii.len() {
        let (xx, yy, xy) = instant.stresslet(sphere);
        for (sum, value) in hydrodynamic.iter_mut().zip([xx, yy, -xx - yy, xy]) {
            *sum += value;
        }
    }
    let normal = moment(&instant.contacts, |c| c.pair.normal * c.normal_force);
    let tangential = moment(&instant.contacts, |c| {
        -sd_core::Layer::tangents(&c.pair.normal)[0] * c.tangential_force
    });
    let repulsion = moment(&instant.repulsive, |c| c.pair.normal * c.normal_force);
    let parts = |of: StressParts| {
        [
            of.hydrodynamic,
            of.normal_contact,
            of.tangential_contact,
            of.repulsion,
        ]
    };
    let c = stress.components;
    let [shear, n1, n2, pressure] = [c.shear, c.n1, c.n2, c.particle_pressure].map(parts);
    let tensors = [hydrodynamic, normal, tangential, repulsion];
    for (cause, [xx, yy, zz, xy]) in tensors.into_iter().enumerate() {
        assert!(
            xy.abs() > 1e-2 * volume * f64::from(cause != 3),
            "cause {cause} acts"
        );
        close(shear[cause], xy / volume, 1.0);
        close(n1[cause], (xx - yy) / volume, 1.0);
        close(n2[cause], (yy - zz) / volume, 1.0);
        // Traceless stresslets have none.
        close(pressure[cause], -(xx + yy + zz) / (3.0 * volume), 1.0);
        let components = [c.xx(), c.yy(), c.zz(), c.xy].map(|of| parts(of)[cause]);
        for (found, expected) in components.into_iter().zip([xx, yy, zz, xy]) {
            close(found, expected / volume, 1.0);
        }
        assert_eq!([parts(c.xz)[cause], parts(c.yz)[cause]], [0.0; 2]);
    }
    assert!(instant.repulsive.iter().any(|c| c.normal_force > 0.0));
    let sum: f64 = tensors.iter().map(|tensor| tensor[3]).sum();
    close(stress.viscosity, 1.0 + sum / volume, 1.0);
    assert_eq!(stress.viscosity, 1.0 + c.shear.total());
    assert_eq!(stress.viscosity_stresslet, 1.0 + c.shear.hydrodynamic);
    // The power of the stress equals the dissipation by friction, contacts and fluid.
    let taken = stress.dissipation + instant.contact_power() / volume;
    close(c.shear.total(), taken, c.shear.total());
}

#[test]
fn pair_on_the_compression_axis_has_the_stress_found_by_hand() {
    // Two spheres in contact at 45°, far from their images: n = (1, -1)/sqrt 2.
    let gap = 0.01;
    let n = Vec2::new(FRAC_1_SQRT_2, -FRAC_1_SQRT_2);
    let configuration: Configuration = Configuration {
        centres: vec![Vec2::zeros(), n * (2.0 + gap)],
        radii: vec![1.0; 2],
        cell: Cell::equal_sides(40.0, 0.0).unwrap(),
        hydrodynamics: Hydrodynamics::BallMelrose,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vec2::zeros(); 2],
        torques: vec![0.0; 2],
    };
    let surface = Surface {
        roughness: 0.01,
        friction: 0.3,
        critical_load: 0.0,
    };
    let request = InstantContacts::under(Laws::rigid(surface), 0.005);
    let instant = solve(&configuration, &request, &NearFields::default()).unwrap();
    let contact = instant.contacts[0];
    assert!(contact.normal_force > 1.0 && contact.normal_velocity.abs() < 1e-8);
    // By symmetry nothing slides: the pair turns as the fluid does.
    assert!(contact.tangential_force.abs() < 1e-9);
    let per_force = (2.0 + gap) * contact.normal_force / (2.0 * 1600.0);
    let StressComponents {
        shear,
        n1,
        n2,
        particle_pressure,
        ..
    } = instant.stress.unwrap().components;
    close(shear.normal_contact, 0.5 * per_force, per_force);
    close(n1.normal_contact, 0.0, per_force);
    close(n2.normal_contact, -0.5 * per_force, per_force);
    close(particle_pressure.normal_contact, per_force / 3.0, per_force);
    close(particle_pressure.total(), per_force / 3.0, per_force);
    // Two spheres apart have the stresslet (20/3) pi E each; nothing dissipates less than spheres
    // that move freely.
    let isolated = 2.0 * 20.0 / 3.0 * PI * 0.5 / 3200.0;
    assert!(shear.total() > isolated);
    // Mirrored on the line of centres the pair is itself: its stresslets have no e1.
    close(n1.hydrodynamic, 0.0, isolated);
}

#[test]
fn mirror_image_resists_its_mirrored_flow_as_much() {
    let tables = tables();
    let configuration = layer(&tables);
    let mirrored = Configuration {
        centres: configuration
            .centres
            .iter()
            .map(|x| Vec2::new(-x.x, x.y))
            .collect(),
        background: VelocityGradient::simple_shear(-1.0).into(),
        ..configuration.clone()
    };
    let [one, two] = [&configuration, &mirrored]
        .map(|configuration| solved(configuration, &tables).stress.unwrap().components);
    for (a, b) in [
        (one.shear, two.shear),
        (one.n1, two.n1),
        (one.n2, two.n2),
        (one.particle_pressure, two.particle_pressure),
        (one.yy(), two.yy()),
        (
            one.xy,
            StressParts {
                brownian: two.xy.brownian,
                hydrodynamic: -two.xy.hydrodynamic,
                normal_contact: -two.xy.normal_contact,
                tangential_contact: -two.xy.tangential_contact,
                repulsion: -two.xy.repulsion,
            },
        ),
    ] {
        let scale = 1e3 * (1.0 + one.shear.total().abs());
        close(b.hydrodynamic, a.hydrodynamic, scale);
        close(b.normal_contact, a.normal_contact, scale);
        close(b.tangential_contact, a.tangential_contact, scale);
        close(b.repulsion, a.repulsion, scale);
    }
}

#[test]
fn quarter_turn_exchanges_flow_and_gradient() {
    let tables = tables();
    let strained = Configuration {
        // Strain without rotation, at an angle to the axes.
        background: VelocityGradient::from_parts(&[0.3, -0.3, 0.4], &0.0).into(),
        ..layer(&tables)
    };
    let turned = Configuration {
        centres: strained
            .centres
            .iter()
            .map(|x| Vec2::new(-x.y, x.x))
            .collect(),
        background: VelocityGradient::from_parts(&[-0.3, 0.3, -0.4], &0.0).into(),
        ..strained.clone()
    };
    let [one, two] = [&strained, &turned]
        .map(|configuration| solved(configuration, &tables).stress.unwrap().components);
    let scale = 1e3 * (1.0 + one.shear.total().abs());
    close(two.shear.total(), one.shear.total(), scale);
    close(two.n1.total(), -one.n1.total(), scale);
    close(two.n2.total(), one.n1.total() + one.n2.total(), scale);
    close(
        two.particle_pressure.total(),
        one.particle_pressure.total(),
        scale,
    );
    assert!(one.n1.total().abs() > 0.01 && one.n2.total().abs() > 0.01);
}

#[test]
fn samples_of_a_run_have_the_parts_of_their_viscosity() {
    let tables = tables();
    let mut simulation = Simulation::<sd_core::Layer>::new(&params(), 2, &tables).unwrap();
    let mut touched = false;
    for _ in 0..100 {
        let sample = simulation.step().unwrap();
        assert_eq!(sample.viscosity, 1.0 + sample.stress.shear.total());
        assert_eq!(sample.normal_stress_difference, sample.stress.n1.total());
        let pressure = sample.stress.particle_pressure;
        assert_eq!(pressure.hydrodynamic, 0.0);
        assert!(pressure.normal_contact >= 0.0);
        touched |= pressure.normal_contact > 0.0 && sample.stress.shear.tangential_contact != 0.0;
    }
    assert!(touched);
}

#[test]
fn all_six_components_of_a_suspension_are_the_moments_of_its_frame() {
    let params = Params::builder()
        .spheres(60)
        .volume_fraction(0.45)
        .roughness(0.01)
        .friction(0.5)
        .shear_rate(10.0)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(ContactScheme::Laws(ContactLaws::linear_spring(
            1e4,
            TangentialLaw::Coulomb,
            0.01,
        )))
        .time_step(0.01)
        .build()
        .unwrap();
    let mut suspension = Simulation::<Bulk>::new(&params, 4, &NearFields::default()).unwrap();
    let (mut sample, mut frame) = suspension.step_with_frame().unwrap();
    while sample.contacts < 40 {
        (sample, frame) = suspension.step_with_frame().unwrap();
    }
    let volume = frame.side.powi(3);
    let (mut hydrodynamic, mut normal, mut tangential) = ([0.0; 6], [0.0; 6], [0.0; 6]);
    for &[xx, yy, xy, xz, yz] in &frame.stresslets {
        for (sum, value) in hydrodynamic.iter_mut().zip([xx, yy, -xx - yy, xy, xz, yz]) {
            *sum += value;
        }
    }
    // −r ⊗ F of the force F on the second sphere, its symmetric part.
    let add = |sums: &mut [f64; 6], r: [f64; 3], f: [f64; 3]| {
        for (sum, (a, b)) in sums
            .iter_mut()
            .zip([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)])
        {
            *sum -= 0.5 * (r[a] * f[b] + r[b] * f[a]);
        }
    };
    for c in &frame.contacts {
        let r = c.normal.map(|n| n * (2.0 + c.gap));
        add(&mut normal, r, c.normal.map(|n| n * c.normal_force));
        add(&mut tangential, r, (-c.tangential_force).into());
    }
    let s = sample.stress;
    let components = [s.xx(), s.yy(), s.zz(), s.xy, s.xz, s.yz];
    for (place, found) in components.into_iter().enumerate() {
        close(found.hydrodynamic, hydrodynamic[place] / volume, 1.0);
        close(found.normal_contact, normal[place] / volume, 1.0);
        close(found.tangential_contact, tangential[place] / volume, 1.0);
        assert!(found.hydrodynamic != 0.0 && found.tangential_contact != 0.0);
    }
    assert_eq!(s.xy, s.shear);
}
