//! Known results about layers.

use super::Check;
use sd_core::cell::Cell;
use sd_core::contact::{Contact, Laws, Surface};
use sd_core::instant::{Configuration, InstantContacts, solve};
use sd_core::internals::{FarField, FarResistance, Matrix};
use sd_core::modes::Vec2;
use sd_core::{
    Error, Hydrodynamics, Layer, NearFields, Params, Simulation, Snapshot, VelocityGradient, start,
};

fn params(hydrodynamics: Hydrodynamics) -> Result<Params, Error> {
    Params::builder()
        .spheres(40)
        .area_fraction(0.693)
        .roughness(0.01)
        .friction(0.3)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(hydrodynamics)
        .time_step(0.005)
        .build()
}

/// A dilute layer: η → 1 + 5c/3.
pub(super) fn dilute_layer(all: &mut Vec<Check>) -> Result<(), Error> {
    for (name, hydrodynamics) in [
        ("Ball-Melrose", Hydrodynamics::BallMelrose),
        ("Stokesian Dynamics", Hydrodynamics::StokesianDynamics),
    ] {
        let dilute = Params {
            spheres: 1,
            area_fraction: 1e-4,
            ..params(hydrodynamics)?
        };
        let sample = Simulation::<Layer>::new(&dilute, 1, &NearFields::default())?.step()?;
        all.push(Check::near(
            format!("(η − 1)/c, one sphere, c = 10⁻⁴, {name}"),
            (sample.viscosity - 1.0) / 1e-4,
            5.0 / 3.0,
            1e-5,
            "(23)",
        ));
    }
    Ok(())
}

/// Checks that R_far does not depend on the splitting of the lattice sum.
pub(super) fn ewald(all: &mut Vec<Check>) -> Result<(), Error> {
    let start = start::layer(&params(Hydrodynamics::StokesianDynamics)?, 1)?;
    let cell = Cell::equal_sides(start.side, 0.0)?;
    let with = |alpha: f64| -> Result<Vec<f64>, Error> {
        let far_field = FarField::with_splitting(&cell, &start.radii, 1e-13, alpha)?;
        let mut far = FarResistance::new(far_field);
        let mut block = Matrix::default();
        far.update(&cell, &start.centres, &mut block)?;
        let n = start.radii.len();
        Ok((0..3 * n)
            .flat_map(|j| block.column(j)[j..].iter().copied())
            .collect())
    };
    let (a, b) = (with(0.3)?, with(0.55)?);
    let largest = a.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let difference = a
        .iter()
        .zip(&b)
        .map(|(x, y)| (x - y).abs() / largest)
        .fold(0.0, f64::max);
    all.push(Check::within(
        "change of R_far between Ewald parameters 0.3 and 0.55",
        difference,
        0.0,
        1e-10,
        "identity",
    ));
    Ok(())
}

/// Checks gaps, energy and friction of a sheared layer.
pub(super) fn frictional_layer(all: &mut Vec<Check>) -> Result<(), Error> {
    let params = params(Hydrodynamics::BallMelrose)?;
    let mut simulation = Simulation::<Layer>::new(&params, 2, &NearFields::default())?;
    for _ in 0..300 {
        simulation.step()?;
    }
    let counters = *simulation.counters();
    all.push(Check::within(
        "smallest gap over h, rigid contacts, c = 0.693, 1.5 strains",
        counters.minimum_gap / params.roughness,
        0.98,
        f64::INFINITY,
        "rigid asperities",
    ));
    all.push(Check::within(
        "worst residual of the contact problem",
        counters.worst_residual,
        0.0,
        1e-8,
        "optimality",
    ));
    for (name, hydrodynamics) in [
        ("Ball-Melrose", Hydrodynamics::BallMelrose),
        ("Stokesian Dynamics", Hydrodynamics::StokesianDynamics),
    ] {
        let (imbalance, power) = energy(&simulation.snapshot(), hydrodynamics)?;
        all.push(Check::within(
            format!("energy imbalance over the power, with friction, {name}"),
            imbalance,
            0.0,
            1e-10,
            "identity",
        ));
        all.push(Check::within(
            format!("power dissipated by friction, {name}"),
            power,
            f64::MIN_POSITIVE,
            f64::INFINITY,
            "friction dissipates",
        ));
    }
    Ok(())
}

/// Relative imbalance of the energy identity at a snapshot, and Σ F_t u_t.
fn energy(snapshot: &Snapshot, hydrodynamics: Hydrodynamics) -> Result<(f64, f64), Error> {
    let n = snapshot.radii.len();
    let strain = snapshot.steps as f64 * 0.005;
    let configuration = Configuration {
        centres: snapshot
            .centres
            .iter()
            .map(|&[x, y]| Vec2::new(x, y))
            .collect(),
        radii: snapshot.radii.clone(),
        cell: Cell::equal_sides(snapshot.side, strain * snapshot.side)?,
        hydrodynamics,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vec2::zeros(); n],
        torques: vec![0.0; n],
    };
    let surface = Surface {
        roughness: 0.01,
        friction: 0.3,
        critical_load: 0.0,
    };
    let request = InstantContacts::under(Laws::rigid(surface), 0.005);
    let instant = solve(&configuration, &request, &NearFields::default())?;
    let Some(stress) = instant.stress else {
        return Ok((f64::NAN, f64::NAN));
    };
    let volume = 2.0 * snapshot.side * snapshot.side;
    let dissipates = |c: &Contact| c.tangential_force * c.slip_velocity;
    let friction: f64 = instant.contacts.iter().map(dissipates).sum();
    let power = stress.viscosity - 1.0;
    let balance = stress.dissipation + instant.contact_power() / volume;
    Ok(((power - balance).abs() / power, friction))
}

/// Shears a layer by five strains and back, without contacts.
pub(super) fn reversibility(all: &mut Vec<Check>) -> Result<(), Error> {
    let dilute = Params {
        spheres: 12,
        area_fraction: 0.3,
        ..params(Hydrodynamics::BallMelrose)?
    };
    let start = start::layer(&dilute, 1)?;
    let mut centres = start.centres.clone();
    let tables = NearFields::default();
    for (from, dt) in [(0.0, 0.005), (5.0, -0.005)] {
        for k in 0..1000 {
            let time = from + f64::from(k) * dt;
            let moved = |velocities: &[Vec2], by: f64| -> Vec<Vec2> {
                let moves = centres.iter().zip(velocities);
                moves.map(|(x, u)| x + u * by).collect()
            };
            // The classical method of Runge and Kutta, of order four.
            let velocities = |centres, time| velocities(&start, centres, time, &tables);
            let first = velocities(centres.clone(), time)?;
            let second = velocities(moved(&first, 0.5 * dt), time + 0.5 * dt)?;
            let third = velocities(moved(&second, 0.5 * dt), time + 0.5 * dt)?;
            let fourth = velocities(moved(&third, dt), time + dt)?;
            for (i, x) in centres.iter_mut().enumerate() {
                *x += (first[i] + (second[i] + third[i]) * 2.0 + fourth[i]) * (dt / 6.0);
            }
        }
    }
    let distance = centres
        .iter()
        .zip(&start.centres)
        .map(|(x, y)| (x - y).norm())
        .fold(0.0, f64::max);
    all.push(Check::within(
        "distance from the start after five strains and back, no contacts",
        distance,
        0.0,
        1e-6,
        "reversibility of Stokes flow",
    ));
    Ok(())
}

/// Velocities of the spheres of a layer without contacts, at a strain.
fn velocities(
    start: &start::Start,
    centres: Vec<Vec2>,
    strain: f64,
    tables: &NearFields,
) -> Result<Vec<Vec2>, Error> {
    let n = centres.len();
    let configuration = Configuration::<Layer> {
        centres,
        radii: start.radii.clone(),
        cell: Cell::equal_sides(start.side, strain * start.side)?,
        hydrodynamics: Hydrodynamics::BallMelrose,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vec2::zeros(); n],
        torques: vec![0.0; n],
    };
    let solved = solve(&configuration, &InstantContacts::None, tables)?;
    let motions = solved.disturbances.iter().zip(&configuration.centres);
    Ok(motions
        .map(|(u, x)| Vec2::new(u[0], u[1]) + configuration.background.linear().velocity(x))
        .collect())
}
