//! Known results about suspensions.

use super::Check;
use nalgebra::Vector3;
use sd_core::cell::Cell;
use sd_core::instant::{Configuration, InstantContacts, SolvedConfiguration, solve};
use sd_core::two_sphere::twist;
use sd_core::{
    Bulk, ContactLaws, ContactScheme, Error, Hydrodynamics, NearFields, Params, Simulation,
    TangentialLaw, VelocityGradient,
};
use std::f64::consts::PI;

/// ζ(3).
const APERY: f64 = 1.202_056_903_159_594;

/// Spheres of radius 1 in a cubic cell, in simple shear, with the same force along x on all.
fn sheared(
    hydrodynamics: Hydrodynamics,
    (side, offset): (f64, f64),
    centres: Vec<Vector3<f64>>,
    force: f64,
    contact: &InstantContacts<Bulk>,
) -> Result<SolvedConfiguration<Bulk>, Error> {
    let n = centres.len();
    let configuration = Configuration {
        centres,
        radii: vec![1.0; n],
        cell: Cell::equal_sides(side, offset)?,
        hydrodynamics,
        background: VelocityGradient::simple_shear(1.0).into(),
        forces: vec![Vector3::x() * force; n],
        torques: vec![Vector3::zeros(); n],
    };
    solve(&configuration, contact, &NearFields::default())
}

/// Spheres that rotate about their line of centres, near contact.
pub(super) fn twisting_pair(all: &mut Vec<Check>) -> Result<(), Error> {
    let [own, other] = twist(1.0, 2.0 + 1e-8)?;
    for (name, value, known) in [
        ("X11C, equal spheres that touch", own, 7.0 / 8.0 * APERY),
        ("X12C, equal spheres that touch", other, -APERY / 8.0),
    ] {
        all.push(Check::near(name, value, known, 1e-6, "Jeffery 1915"));
    }
    Ok(())
}

/// A simple cubic lattice dilute enough for closed forms of the far field to be exact.
pub(super) fn cubic_lattice(all: &mut Vec<Check>) -> Result<(), Error> {
    let volume_fraction = 0.008;
    let side = (4.0 / 3.0 * PI / volume_fraction).cbrt();
    let solved = sheared(
        Hydrodynamics::StokesianDynamics,
        (side, 0.0),
        vec![Vector3::zeros()],
        1.0,
        &InstantContacts::None,
    )?;
    let mobility = 6.0 * PI * solved.disturbances[0][0];
    all.push(Check::near(
        "6π × velocity of a simple cubic lattice under unit forces, φ = 0.008",
        mobility,
        1.0 - 1.7601 * volume_fraction.cbrt() + volume_fraction,
        2e-5,
        "Hasimoto 1959",
    ));
    let (a, b) = (0.28556, -0.04645);
    let known = 2.5
        / (1.0 - (1.0 + 40.0 * b) * volume_fraction - 8.0 * a * volume_fraction.powf(5.0 / 3.0));
    let viscosity = solved.stress.map_or(f64::NAN, |stress| stress.viscosity);
    all.push(Check::near(
        "(η − 1)/φ of that lattice, sheared along its axes",
        (viscosity - 1.0) / volume_fraction,
        known,
        2e-5,
        "Zuzovsky, Adler & Brenner 1983",
    ));
    Ok(())
}

/// Checks gaps, energy and friction of a sheared suspension.
pub(super) fn frictional_suspension(all: &mut Vec<Check>) -> Result<(), Error> {
    let params = Params::builder()
        .spheres(62)
        .volume_fraction(0.5)
        .roughness(0.01)
        .friction(0.3)
        .shear_rate(f64::INFINITY)
        .hydrodynamics(Hydrodynamics::BallMelrose)
        .contact(ContactScheme::Laws(ContactLaws {
            tangential: TangentialLaw::Coulomb,
            ..ContactLaws::PAPER
        }))
        .time_step(0.01)
        .build()?;
    let mut simulation = Simulation::<Bulk>::new(&params, 2, &NearFields::default())?;
    for _ in 0..40 {
        simulation.step()?;
    }
    let counters = *simulation.counters();
    all.push(Check::within(
        "smallest gap over h, suspension with φ = 0.5, 0.4 strains",
        counters.minimum_gap / params.roughness,
        0.95,
        f64::INFINITY,
        "rigid asperities",
    ));
    let (side, offset) = (simulation.side(), simulation.offset_at(simulation.strain()));
    for (name, hydrodynamics) in [
        ("Ball-Melrose", Hydrodynamics::BallMelrose),
        ("Stokesian Dynamics", Hydrodynamics::StokesianDynamics),
    ] {
        let contact = InstantContacts::of_run(&params, 0.01);
        let centres = simulation.centres().to_vec();
        let solved = sheared(hydrodynamics, (side, offset), centres, 0.0, &contact)?;
        let Some(stress) = solved.stress else {
            continue;
        };
        let power = stress.viscosity - 1.0;
        let balance = stress.dissipation + solved.contact_power() / side.powi(3);
        all.push(Check::within(
            format!("energy imbalance over the power, suspension, {name}"),
            (power - balance).abs() / power,
            0.0,
            1e-10,
            "identity",
        ));
        let friction = solved.contacts.iter();
        let friction = friction.map(|c| c.tangential_force.dot(&c.slip_velocity));
        all.push(Check::within(
            format!("power dissipated by friction, suspension, {name}"),
            friction.sum(),
            f64::MIN_POSITIVE,
            f64::INFINITY,
            "friction dissipates",
        ));
    }
    Ok(())
}
