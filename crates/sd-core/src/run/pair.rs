//! Two spheres moving past each other in unbounded fluid: the paper's Fig. 8.

use crate::contact::laws::{Laws, Span};
use crate::contact::{ContactMemory, SolvePass, Surface};
use crate::error::Error;
use crate::hydrodynamics::resistance::{NearFields, Resistance};
use crate::hydrodynamics::two_sphere::check_size_ratio;
use crate::model::Hydrodynamics;
use crate::model::parameters::{FRICTION, ROUGHNESS};
use crate::run::steppers::{RungeKutta, State};
use crate::space::VelocityGradient;
use crate::space::cell::Cell;
use crate::space::modes::Vec2;
use crate::stage::{StageContacts, StageSolver};
use serde::Serialize;

/// Maximum number of steps for the spheres to pass.
const MAX_STEPS: u64 = 1_000_000;
/// Longest time step, in which a sphere of radius 1 alone moves by a quarter of its radius.
const LONGEST_STEP: f64 = 5.0;

/// The scenario: radii 1 and L, forces +1 and −1 along x, from (−X, Y) and (X, −Y); critical
/// load 0. An example is at [`pass`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairScenario {
    /// Radius L of the second sphere, in a, in [0.01, 100].
    pub size_ratio: f64,
    /// Roughness height h, in a, and friction coefficient ν; `None` without contact.
    pub contact: Option<(f64, f64)>,
    /// Y, in a.
    pub offset: f64,
    /// X, in a, positive.
    pub start: f64,
    /// Time step, in mu·a²/force, at most 5.
    pub time_step: f64,
}

/// The trajectories of the spheres.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PairTrajectory {
    /// y of the first sphere at the end, in a.
    pub final_offset: f64,
    /// Rotation of each sphere, in degrees, anticlockwise.
    pub rotation_degrees: [f64; 2],
    /// Smallest gap, in a.
    pub minimum_gap: f64,
    /// Time taken, in mu·a²/force.
    pub time: f64,
    /// `[t, x1, y1, θ1, x2, y2, θ2]` at each step, θ in radians.
    pub path: Vec<[f64; 7]>,
}

/// Moves the spheres by Stokesian Dynamics, exact for two, until x1 − x2 = 2X; the last step is
/// shortened to end there.
///
/// The coordinates integrated are the centre of the first sphere and, for the second, ln g and the
/// angle of the line of centres: smooth spheres approach to gaps much smaller than the sagitta of a
/// step around each other.
///
/// # Errors
/// Parameters out of range; spheres that overlap at the start or do not pass.
///
/// ```
/// use sd_core::NearFields;
/// use sd_core::pair::{PairScenario, pass};
///
/// let smooth = PairScenario {
///     size_ratio: 1.0,
///     contact: None,
///     offset: 0.25,
///     start: 5.0,
///     time_step: 0.2,
/// };
/// let rough = PairScenario { contact: Some((0.05, 0.5)), ..smooth };
/// let tables = NearFields::default();
/// // The flow is reversible, so smooth spheres return to their paths; rough ones do not.
/// assert!((pass(&smooth, &tables)?.final_offset - 0.25).abs() < 1e-3);
/// assert!(pass(&rough, &tables)?.final_offset > 0.4);
/// # Ok::<(), sd_core::Error>(())
/// ```
#[expect(
    clippy::missing_panics_doc,
    reason = "the computation never stops early"
)]
pub fn pass(scenario: &PairScenario, tables: &NearFields) -> Result<PairTrajectory, Error> {
    let passed = pass_while(scenario, tables, || true)?;
    Ok(passed.expect("the computation never stops early"))
}

/// Computes a passage while `go_on`, called before every step, returns true; `None` otherwise.
///
/// # Errors
/// Those of [`pass`].
pub fn pass_while(
    scenario: &PairScenario,
    tables: &NearFields,
    mut go_on: impl FnMut() -> bool,
) -> Result<Option<PairTrajectory>, Error> {
    check(scenario)?;
    let radii = [1.0, scenario.size_ratio];
    let cell: Cell = Cell::Unbounded;
    let resistance = Resistance::new(Hydrodynamics::StokesianDynamics, &cell, &radii, tables)?;
    let mut motion = StageSolver::new(resistance);
    let laws = scenario.contact.map(|(roughness, friction)| {
        Laws::rigid(Surface {
            roughness,
            friction,
            critical_load: 0.0,
        })
    });
    let mut memory = ContactMemory::default();
    let mut integrator = RungeKutta::default();
    let contact = radii[0] + radii[1];
    let mut state = at_start(scenario, contact)?;
    let external = [1.0, 0.0, 0.0, -1.0, 0.0, 0.0];
    let goal = 2.0 * scenario.start;
    let along = |state: &State| {
        let [first, second] = centres(&state.centres, contact);
        first.x - second.x
    };
    let mut time = 0.0;
    let mut path = vec![row(time, &state, contact)];
    let mut minimum_gap = state.centres[1].x.exp();
    for step in 0..MAX_STEPS {
        if !go_on() {
            return Ok(None);
        }
        let mut advance = |from: &State, dt: f64| {
            let mut to = from.clone();
            let mut memory_after = memory.clone();
            let done = integrator.step(&mut to, time, dt, |stage, coordinates, rates| {
                let contact_law = match &laws {
                    None => StageContacts::None,
                    Some(laws) => StageContacts::Laws {
                        laws,
                        span: Span::single(stage.span),
                        memory: &mut memory_after,
                    },
                };
                let positions = centres(coordinates, contact);
                motion.assemble(&cell, &positions)?;
                motion.solve(
                    &VelocityGradient::at_rest().into(),
                    &external,
                    contact_law,
                    SolvePass::First,
                )?;
                let v = motion.velocities();
                let relative = Vec2::new(v[3] - v[0], v[4] - v[1]);
                let gap = coordinates[1].x.exp();
                let (sine, cosine) = coordinates[1].y.sin_cos();
                rates.copy_from_slice(v);
                rates[3] = relative.dot(&Vec2::new(cosine, sine)) / gap;
                rates[4] = relative.dot(&Vec2::new(-sine, cosine)) / (contact + gap);
                Ok::<(), Error>(())
            });
            done.map(|()| (to, memory_after))
                .map_err(|source| Error::Step {
                    step,
                    strain: time,
                    source: Box::new(source),
                })
        };
        let mut dt = scenario.time_step;
        let (mut next, mut next_memory) = advance(&state, dt)?;
        let last = along(&next) >= goal;
        // The end lies within this step: shorten it by secants, each a whole RK4 step from the same
        // start.
        for _ in 0..8 {
            if !last || (along(&next) - goal).abs() < 1e-12 * goal {
                break;
            }
            dt *= (goal - along(&state)) / (along(&next) - along(&state));
            (next, next_memory) = advance(&state, dt)?;
        }
        (state, memory) = (next, next_memory);
        time += dt;
        minimum_gap = minimum_gap.min(state.centres[1].x.exp());
        path.push(row(time, &state, contact));
        if last {
            return Ok(Some(PairTrajectory {
                final_offset: state.centres[0].y,
                rotation_degrees: [0, 1].map(|i| state.orientations[i].to_degrees()),
                minimum_gap,
                time,
                path,
            }));
        }
    }
    Err(Error::OutOfRange {
        field: "offset",
        value: scenario.offset,
        allowed: "one at which the spheres pass each other within 1,000,000 steps",
    })
}

fn at_start(scenario: &PairScenario, contact: f64) -> Result<State, Error> {
    let first = Vec2::new(-scenario.start, scenario.offset);
    let line = -2.0 * first;
    let gap = line.norm() - contact;
    if gap <= 0.0 {
        return Err(Error::Overlap {
            i: 0,
            j: 1,
            gap,
            separation: line.norm(),
        });
    }
    Ok(State {
        centres: vec![first, Vec2::new(gap.ln(), line.y.atan2(line.x))],
        orientations: vec![0.0; 2],
    })
}

/// Centres of both spheres from the coordinates `x1` and `(ln g, angle)`; `contact` is a1 + a2.
fn centres(coordinates: &[Vec2], contact: f64) -> [Vec2; 2] {
    let (sine, cosine) = coordinates[1].y.sin_cos();
    let distance = contact + coordinates[1].x.exp();
    let first = coordinates[0];
    [first, first + Vec2::new(cosine, sine) * distance]
}

fn row(time: f64, state: &State, contact: f64) -> [f64; 7] {
    let [a, b] = centres(&state.centres, contact);
    let turned = &state.orientations;
    [time, a.x, a.y, turned[0], b.x, b.y, turned[1]]
}

/// Refuses a scenario with a value out of range.
fn check(scenario: &PairScenario) -> Result<(), Error> {
    let refuse = |field, value, allowed| {
        Err(Error::OutOfRange {
            field,
            value,
            allowed,
        })
    };
    let PairScenario {
        size_ratio,
        contact,
        offset,
        start,
        time_step,
    } = *scenario;
    check_size_ratio(size_ratio)?;
    if let Some((roughness, friction)) = contact {
        ROUGHNESS.check(ROUGHNESS.key, roughness)?;
        if roughness == 0.0 {
            return refuse("roughness", roughness, "above 0 and below 0.5");
        }
        FRICTION.check(FRICTION.key, friction)?;
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
    if !(time_step > 0.0 && time_step <= LONGEST_STEP) {
        return refuse("time_step", time_step, "above 0 and at most 5");
    }
    // Alone, a sphere of radius r moves by 1/(6π r) in a unit of time, together they are slower.
    let speed = (1.0 + 1.0 / size_ratio) / (6.0 * std::f64::consts::PI);
    if 4.0 * start / (speed * time_step) > MAX_STEPS as f64 {
        let allowed = "so large that the spheres pass within 1,000,000 steps";
        return refuse("time_step", time_step, allowed);
    }
    Ok(())
}
