//! Known results, recomputed: what a user checks before trusting a machine and a build. Seconds in all.

use crate::cell::Cell;
use crate::contact::{Contact, Surface};
use crate::error::Error;
use crate::far_field::{FarField, FarResistance};
use crate::instant::{Configuration, ContactRequest, Instant, solve};
use crate::integrate::{RungeKutta, State};
use crate::linalg::dense::Matrix;
use crate::modes::{Background, Vec2};
use crate::motion::{ContactLaw, Motion};
use crate::pair::{Passed, Passing, pass};
use crate::params::{ContactScheme, Hydrodynamics, Params};
use crate::resistance::{NearFields, Resistance};
use crate::simulation::{Simulation, Snapshot};
use crate::start;
use crate::two_sphere::scalars;
use serde::Serialize;
use std::f64::consts::PI;

/// One known result beside ours.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// What is compared.
    pub quantity: String,
    /// Our value.
    pub value: f64,
    /// Least value that passes.
    pub least: f64,
    /// Largest value that passes.
    pub most: f64,
    /// Where the known value comes from.
    pub source: &'static str,
}

impl Check {
    /// Ours against a number, to a tolerance in the same unit.
    fn near(
        quantity: impl Into<String>,
        value: f64,
        known: f64,
        tolerance: f64,
        source: &'static str,
    ) -> Self {
        Self::within(
            quantity,
            value,
            known - tolerance,
            known + tolerance,
            source,
        )
    }

    /// Ours against a range.
    fn within(
        quantity: impl Into<String>,
        value: f64,
        least: f64,
        most: f64,
        source: &'static str,
    ) -> Self {
        Self {
            quantity: quantity.into(),
            value,
            least,
            most,
            source,
        }
    }

    /// Whether ours lies where it must; what is not a number does not.
    pub fn passes(&self) -> bool {
        self.value >= self.least && self.value <= self.most
    }
}

/// All checks, in the order of the chain from two spheres to a layer.
///
/// # Errors
/// A computation that could not be finished at all.
pub fn checks() -> Result<Vec<Check>, Error> {
    let mut all = Vec::new();
    resistance_functions(&mut all)?;
    isolated_sphere(&mut all)?;
    two_sphere_mobilities(&mut all)?;
    dilute_layer(&mut all)?;
    ewald(&mut all)?;
    frictional_layer(&mut all)?;
    reversibility(&mut all)?;
    figure_8(&mut all)?;
    Ok(all)
}

/// Two-sphere scalars.
fn resistance_functions(all: &mut Vec<Check>) -> Result<(), Error> {
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

/// One sphere, or two, in unbounded fluid.
fn unbounded(
    centres: Vec<Vec2>,
    radii: Vec<f64>,
    background: Background,
    force: Vec2,
) -> Result<Instant, Error> {
    let n = radii.len();
    let mut forces = vec![Vec2::zeros(); n];
    forces[0] = force;
    solve(
        &Configuration {
            centres,
            radii,
            cell: Cell::Unbounded,
            hydrodynamics: Hydrodynamics::StokesianDynamics,
            background,
            forces,
            torques: vec![0.0; n],
        },
        &ContactRequest::None,
        &NearFields::default(),
    )
}

/// Drag and stresslet of one sphere.
fn isolated_sphere(all: &mut Vec<Check>) -> Result<(), Error> {
    let one = vec![Vec2::zeros()];
    let dragged = unbounded(one.clone(), vec![1.0], Background::QUIESCENT, Vec2::x())?;
    let velocity = dragged.disturbances[0][0];
    all.push(Check::near(
        "6π × velocity of one sphere under unit force",
        6.0 * PI * velocity,
        1.0,
        1e-12,
        "Stokes 1851",
    ));
    let sheared = unbounded(one, vec![1.0], Background::SHEAR, Vec2::zeros())?;
    all.push(Check::near(
        "S_xy of one sphere in shear",
        sheared.stresslet(0).2,
        10.0 / 3.0 * PI,
        1e-11,
        "(21)",
    ));
    Ok(())
}

/// Published mobilities of pairs.
fn two_sphere_mobilities(all: &mut Vec<Check>) -> Result<(), Error> {
    let source = "published multipole solutions, tests/data/two_sphere_exact.json";
    for (radius, separation, force, sphere, component, known) in [
        (1.0, 2.1, Vec2::x(), 0, 0, 0.04433067),
        (1.0, 2.1, Vec2::x(), 1, 0, 0.03717438),
        (1.0, 2.1, Vec2::y(), 0, 1, 0.05167573),
        (1.0, 2.1, Vec2::y(), 1, 2, -0.009225618),
        (1.0, 3.9, Vec2::x(), 1, 0, 0.01957931),
    ] {
        let centres = vec![Vec2::zeros(), Vec2::new(separation, 0.0)];
        let pair = unbounded(centres, vec![1.0, radius], Background::QUIESCENT, force)?;
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

/// A layer for the checks.
fn params(hydrodynamics: Hydrodynamics) -> Params {
    Params {
        spheres: 40,
        area_fraction: 0.693,
        roughness: 0.01,
        friction: 0.3,
        shear_rate: f64::INFINITY,
        size_ratio: 1.0,
        large_fraction: 0.5,
        hydrodynamics,
        contact: ContactScheme::Rigid,
        time_step: 0.005,
    }
}

/// η → 1 + 5c/3.
fn dilute_layer(all: &mut Vec<Check>) -> Result<(), Error> {
    for (name, hydrodynamics) in [
        ("Ball-Melrose", Hydrodynamics::BallMelrose),
        ("Stokesian Dynamics", Hydrodynamics::StokesianDynamics),
    ] {
        let dilute = Params {
            spheres: 1,
            area_fraction: 1e-4,
            ..params(hydrodynamics)
        };
        let sample = Simulation::new(&dilute, 1, &NearFields::default())?.step()?;
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

/// R_far must not know how the lattice sum was split.
fn ewald(all: &mut Vec<Check>) -> Result<(), Error> {
    let start = start::layer(&params(Hydrodynamics::StokesianDynamics), 1)?;
    let cell = Cell::periodic(start.side, start.side, 0.0)?;
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

/// Gaps, energy and friction of a sheared layer.
fn frictional_layer(all: &mut Vec<Check>) -> Result<(), Error> {
    let params = params(Hydrodynamics::BallMelrose);
    let mut simulation = Simulation::new(&params, 2, &NearFields::default())?;
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
        cell: Cell::periodic(snapshot.side, snapshot.side, strain * snapshot.side)?,
        hydrodynamics,
        background: Background::SHEAR,
        forces: vec![Vec2::zeros(); n],
        torques: vec![0.0; n],
    };
    let surface = Surface {
        roughness: 0.01,
        friction: 0.3,
        critical_load: 0.0,
    };
    let request = ContactRequest::Rigid {
        surface,
        time_span: 0.005,
    };
    let instant = solve(&configuration, &request, &NearFields::default())?;
    let Some(stress) = instant.stress else {
        return Ok((f64::NAN, f64::NAN));
    };
    let volume = 2.0 * snapshot.side * snapshot.side;
    let sum = |power: fn(&Contact) -> f64| instant.contacts.iter().map(power).sum::<f64>();
    let friction = sum(|c| c.tangential_force * c.slip_velocity);
    let normal = sum(|c| c.normal_force * c.normal_velocity);
    let power = stress.viscosity - 1.0;
    let balance = stress.dissipation + (friction - normal) / volume;
    Ok(((power - balance).abs() / power, friction))
}

/// Five strains forward and back without contacts.
fn reversibility(all: &mut Vec<Check>) -> Result<(), Error> {
    let dilute = Params {
        spheres: 12,
        area_fraction: 0.3,
        ..params(Hydrodynamics::BallMelrose)
    };
    let start = start::layer(&dilute, 1)?;
    let begin = State {
        centres: start.centres.clone(),
        orientations: vec![0.0; start.radii.len()],
    };
    let mut state = begin.clone();
    for (from, dt) in [(0.0, 0.005), (5.0, -0.005)] {
        shear(&start, &mut state, from, dt, 1000)?;
    }
    let distance = state
        .centres
        .iter()
        .zip(&begin.centres)
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

/// Shears a layer without contacts for some steps of either sign.
fn shear(
    start: &start::Start,
    state: &mut State,
    from: f64,
    dt: f64,
    steps: u32,
) -> Result<(), Error> {
    let cell = |strain: f64| Cell::periodic(start.side, start.side, strain * start.side);
    let tables = NearFields::default();
    let resistance = Resistance::new(
        Hydrodynamics::BallMelrose,
        &cell(0.0)?,
        &start.radii,
        &tables,
    )?;
    let mut motion = Motion::new(resistance);
    let mut integrator = RungeKutta::default();
    let background = Background::SHEAR;
    for k in 0..steps {
        let time = from + f64::from(k) * dt;
        integrator.step(state, time, dt, |stage, centres, velocities| {
            let cell = cell(stage.time)?;
            motion.solve(&cell, centres, &background, &[], ContactLaw::None)?;
            velocities.copy_from_slice(motion.velocities());
            for (u, &x) in velocities.chunks_exact_mut(3).zip(centres) {
                u[0] += background.velocity(x).x;
                u[2] += background.angular_velocity;
            }
            Ok::<(), Error>(())
        })?;
    }
    Ok(())
}

/// The four cases of the paper's Fig. 8.
fn figure_8(all: &mut Vec<Check>) -> Result<(), Error> {
    let case = |contact| -> Result<Passed, Error> {
        let passing = Passing {
            size_ratio: 1.0,
            contact,
            offset: 0.25,
            start: 5.0,
            time_step: 0.2,
        };
        pass(&passing, &NearFields::default())
    };
    let turn = |passed: &Passed| passed.rotation_degrees[0].abs();
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
    let back = |passed: &Passed| (turn(passed) - turn(&smooth)) / (turn(&free) - turn(&smooth));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_known_results_are_met() {
        for check in checks().unwrap() {
            assert!(check.passes(), "{check:?}");
        }
    }

    #[test]
    fn a_number_that_is_none_does_not_pass() {
        assert!(!Check::near("x", f64::NAN, 1.0, 1.0, "").passes());
        assert!(!Check::near("x", 2.1, 1.0, 1.0, "").passes());
    }
}
