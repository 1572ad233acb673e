//! Two spheres driven past each other in unbounded fluid: the paper's Fig. 8.

use crate::cell::Cell;
use crate::contact::Surface;
use crate::contact::rigid::Memory;
use crate::error::Error;
use crate::integrate::{RungeKutta, State};
use crate::modes::{Background, Vec2};
use crate::motion::{ContactLaw, Motion};
use crate::params::Hydrodynamics;
use crate::resistance::{NearFields, Resistance};
use serde::Serialize;

/// Steps after which spheres that have not passed are given up.
const MOST_STEPS: u64 = 10_000_000;

/// The scenario: radii 1 and L, forces +1 and −1 along x, from (−X, Y) and (X, −Y); critical load 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Passing {
    /// Radius L of the second sphere, in a, in [0.01, 100].
    pub size_ratio: f64,
    /// Roughness height h, in a, and friction coefficient ν; `None` without contact.
    pub contact: Option<(f64, f64)>,
    /// Y, in a.
    pub offset: f64,
    /// X, in a, positive.
    pub start: f64,
    /// Time step, in mu·a²/force, positive.
    pub time_step: f64,
}

/// How they passed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Passed {
    /// y of the first sphere at the end, in a.
    pub final_offset: f64,
    /// Rotation of each sphere, in degrees, anticlockwise.
    pub rotation_degrees: [f64; 2],
    /// Smallest gap met, in a.
    pub minimum_gap: f64,
    /// Time taken, in mu·a²/force.
    pub time: f64,
    /// `[t, x1, y1, θ1, x2, y2, θ2]` at each step, θ in radians.
    pub path: Vec<[f64; 7]>,
}

/// Moves the spheres by Stokesian Dynamics, exact for two, until x1 − x2 = 2X; the last step is cut to end there.
///
/// # Errors
/// Parameters out of range; spheres that overlap at the start or do not pass.
pub fn pass(passing: &Passing, tables: &NearFields) -> Result<Passed, Error> {
    check(passing)?;
    let radii = [1.0, passing.size_ratio];
    let cell = Cell::Unbounded;
    let resistance = Resistance::new(Hydrodynamics::StokesianDynamics, &cell, &radii, tables)?;
    let mut motion = Motion::new(resistance);
    let mut memory = Memory::default();
    let mut integrator = RungeKutta::default();
    let mut state = State {
        centres: vec![
            Vec2::new(-passing.start, passing.offset),
            Vec2::new(passing.start, -passing.offset),
        ],
        orientations: vec![0.0; 2],
    };
    let external = [1.0, 0.0, 0.0, -1.0, 0.0, 0.0];
    let goal = 2.0 * passing.start;
    let mut time = 0.0;
    let mut path = vec![row(time, &state)];
    let mut minimum_gap = f64::INFINITY;
    for step in 0..MOST_STEPS {
        let mut advance = |state: &mut State, dt: f64| {
            integrator.step(state, time, dt, |stage, centres, velocities| {
                let law = match passing.contact {
                    None => ContactLaw::None,
                    Some((roughness, friction)) => ContactLaw::Rigid {
                        surface: Surface {
                            roughness,
                            friction,
                            critical_load: 0.0,
                        },
                        time_span: stage.span,
                        memory: &mut memory,
                    },
                };
                motion.solve(&cell, centres, &Background::QUIESCENT, &external, law)?;
                for pair in motion.resistance.neighbours() {
                    minimum_gap = minimum_gap.min(pair.gap);
                }
                velocities.copy_from_slice(motion.velocities());
                Ok::<(), Error>(())
            })
        };
        let located = |source| Error::Step {
            step,
            strain: time,
            source: Box::new(source),
        };
        let before = state.clone();
        let mut dt = passing.time_step;
        advance(&mut state, dt).map_err(located)?;
        let mut along = state.centres[0].x - state.centres[1].x;
        let last = along >= goal;
        // The end lies within this step: shorten it by secants, each a whole RK4 step from the same start.
        for _ in 0..8 {
            if !last || (along - goal).abs() < 1e-12 * goal {
                break;
            }
            let start = before.centres[0].x - before.centres[1].x;
            dt *= (goal - start) / (along - start);
            state.clone_from(&before);
            advance(&mut state, dt).map_err(located)?;
            along = state.centres[0].x - state.centres[1].x;
        }
        time += dt;
        path.push(row(time, &state));
        if last {
            return Ok(Passed {
                final_offset: state.centres[0].y,
                rotation_degrees: [0, 1].map(|i| state.orientations[i].to_degrees()),
                minimum_gap,
                time,
                path,
            });
        }
    }
    Err(Error::OutOfRange {
        field: "offset",
        value: passing.offset,
        allowed: "one at which the spheres pass each other within ten million steps",
    })
}

/// One row of the path.
fn row(time: f64, state: &State) -> [f64; 7] {
    let [a, b] = [0, 1].map(|i| (state.centres[i], state.orientations[i]));
    [time, a.0.x, a.0.y, a.1, b.0.x, b.0.y, b.1]
}

/// Ranges of the scenario.
fn check(passing: &Passing) -> Result<(), Error> {
    let refuse = |field, value, allowed| {
        Err(Error::OutOfRange {
            field,
            value,
            allowed,
        })
    };
    let Passing {
        size_ratio,
        contact,
        offset,
        start,
        time_step,
    } = *passing;
    if !(0.01..=100.0).contains(&size_ratio) {
        return refuse("size_ratio", size_ratio, "0.01 to 100");
    }
    if let Some((roughness, friction)) = contact {
        if !(roughness > 0.0 && roughness < 0.5) {
            return refuse("roughness", roughness, "above 0 and below 0.5");
        }
        if !(0.0..=10.0).contains(&friction) {
            return refuse("friction", friction, "0 to 10");
        }
    }
    if !(offset != 0.0 && offset.is_finite()) {
        return refuse(
            "offset",
            offset,
            "finite and not 0: head-on spheres never pass",
        );
    }
    if !(start > 0.0 && start <= 1000.0) {
        return refuse("start", start, "above 0 and at most 1000");
    }
    if !(time_step > 0.0 && time_step.is_finite()) {
        return refuse("time_step", time_step, "positive and finite");
    }
    Ok(())
}
