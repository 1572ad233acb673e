//! Known results about one sphere and two.

use super::Check;
use sd_core::cell::Cell;
use sd_core::instant::{Configuration, InstantContacts, SolvedConfiguration, solve};
use sd_core::modes::Vec2;
use sd_core::pair::{PairScenario, PairTrajectory, pass};
use sd_core::two_sphere::scalars;
use sd_core::{Error, Hydrodynamics, NearFields, VelocityGradient};
use std::f64::consts::PI;

pub(super) fn resistance_functions(all: &mut Vec<Check>) -> Result<(), Error> {
    let source = "independent multipole solution, tests/data/two_sphere_scalars.json";
    let touching = scalars(1.0, 2.01)?;
    for (name, value, known) in [
        (
            "X11A, equal spheres, s' = 2.01",
            touching.x_a[0],
            27.0340078652,
        ),
        (
            "Y12B, equal spheres, s' = 2.01",
            touching.y_b[1],
            1.1567742779,
        ),
        (
            "X11G, equal spheres, s' = 2.01",
            touching.x_g[0],
            38.598144454,
        ),
        (
            "Y12H, equal spheres, s' = 2.01",
            touching.y_h[1],
            0.43410541815,
        ),
        (
            "Z12M, equal spheres, s' = 2.01",
            touching.z_m[1],
            -0.068500780661,
        ),
    ] {
        all.push(Check::near(name, value, known, 1e-8 * known.abs(), source));
    }
    // Point forces: X12A → −(3/2) (a/r) far apart, first reflection.
    let far = scalars(1.0, 2000.0)?;
    all.push(Check::near(
        "r X12A / a → −3/2, s' = 2000",
        2000.0 * far.x_a[1],
        -1.5,
        2e-3,
        "Stokeslet",
    ));
    Ok(())
}

/// Solves for one sphere, or two, in unbounded fluid.
fn unbounded(
    centres: Vec<Vec2>,
    radii: Vec<f64>,
    background: VelocityGradient,
    force: Vec2,
) -> Result<SolvedConfiguration, Error> {
    let n = radii.len();
    let mut forces = vec![Vec2::zeros(); n];
    forces[0] = force;
    solve(
        &Configuration {
            centres,
            radii,
            cell: Cell::Unbounded,
            hydrodynamics: Hydrodynamics::StokesianDynamics,
            background: background.into(),
            forces,
            torques: vec![0.0; n],
        },
        &InstantContacts::None,
        &NearFields::default(),
    )
}

/// Drag and stresslet of one sphere.
pub(super) fn isolated_sphere(all: &mut Vec<Check>) -> Result<(), Error> {
    let one = vec![Vec2::zeros()];
    let dragged = unbounded(
        one.clone(),
        vec![1.0],
        VelocityGradient::at_rest(),
        Vec2::x(),
    )?;
    let velocity = dragged.disturbances[0][0];
    all.push(Check::near(
        "6π × velocity of one sphere under unit force",
        6.0 * PI * velocity,
        1.0,
        1e-12,
        "Stokes 1851",
    ));
    let sheared = unbounded(
        one,
        vec![1.0],
        VelocityGradient::simple_shear(1.0),
        Vec2::zeros(),
    )?;
    all.push(Check::near(
        "S_xy of one sphere in shear",
        sheared.stresslet(0).2,
        10.0 / 3.0 * PI,
        1e-11,
        "(21)",
    ));
    Ok(())
}

pub(super) fn two_sphere_mobilities(all: &mut Vec<Check>) -> Result<(), Error> {
    let source = "published multipole solutions, tests/data/two_sphere_exact.json";
    for (radius, separation, force, sphere, component, known) in [
        (1.0, 2.1, Vec2::x(), 0, 0, 0.04433067),
        (1.0, 2.1, Vec2::x(), 1, 0, 0.03717438),
        (1.0, 2.1, Vec2::y(), 0, 1, 0.05167573),
        (1.0, 2.1, Vec2::y(), 1, 2, -0.009225618),
        (1.0, 3.9, Vec2::x(), 1, 0, 0.01957931),
    ] {
        let centres = vec![Vec2::zeros(), Vec2::new(separation, 0.0)];
        let pair = unbounded(
            centres,
            vec![1.0, radius],
            VelocityGradient::at_rest(),
            force,
        )?;
        let direction = if force.x == 1.0 { "x" } else { "y" };
        all.push(Check::near(
            format!(
                "{} of sphere {} under unit force along {direction} on sphere 1, r = {separation}",
                ["U_x", "U_y", "Ω"][component],
                sphere + 1
            ),
            pair.disturbances[sphere][component],
            known,
            1e-8,
            source,
        ));
    }
    Ok(())
}

/// The four cases of the paper's Fig. 8.
pub(super) fn figure_8(all: &mut Vec<Check>) -> Result<(), Error> {
    let case = |contact| -> Result<PairTrajectory, Error> {
        let scenario = PairScenario {
            size_ratio: 1.0,
            contact,
            offset: 0.25,
            start: 5.0,
            time_step: 0.2,
        };
        pass(&scenario, &NearFields::default())
    };
    let turn = |passed: &PairTrajectory| passed.rotation_degrees[0].abs();
    let free = case(None)?;
    let smooth = case(Some((0.05, 0.0)))?;
    let little = case(Some((0.05, 0.1)))?;
    let much = case(Some((0.05, 0.5)))?;
    let source = "Fig. 8";
    all.push(Check::near(
        "8a no contact: final offset, fore-aft symmetric",
        free.final_offset,
        0.25,
        1e-4,
        source,
    ));
    all.push(Check::near(
        "8a no contact: rotation, almost 90°",
        turn(&free),
        90.0,
        10.0,
        source,
    ));
    all.push(Check::within(
        "8b contact: offset over that without",
        smooth.final_offset / free.final_offset,
        1.2,
        f64::INFINITY,
        source,
    ));
    all.push(Check::within(
        "8b contact: rotation over that without, less",
        turn(&smooth) / turn(&free),
        0.0,
        0.95,
        source,
    ));
    all.push(Check::within(
        "8b contact: time over that without, faster",
        smooth.time / free.time,
        0.0,
        1.0,
        source,
    ));
    let back =
        |passed: &PairTrajectory| (turn(passed) - turn(&smooth)) / (turn(&free) - turn(&smooth));
    all.push(Check::within(
        "8c friction 0.1: share of the lost rotation regained, little",
        back(&little),
        0.0,
        0.3,
        source,
    ));
    all.push(Check::within(
        "8d friction 0.5: share of the lost rotation regained, most",
        back(&much),
        0.5,
        1.0,
        source,
    ));
    Ok(())
}
