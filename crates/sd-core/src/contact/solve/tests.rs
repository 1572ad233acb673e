//! The conditions of the contact problem on random networks, under every law.

mod cones;
mod effort;

use super::newton::{BoxSolver, Deciding, Onset, Outcome};
use super::path::Effort;
use super::problem::{Forces, Grip, Noise, Normal, Problem, States, System, Tangential, largest};
use super::tableau::Tableau;
use crate::contact::row::Row;
use crate::linalg::dense::Matrix;
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

/// How contacts move each other in a made-up network: the Gram matrices of random columns.
struct Network {
    normal: DMatrix<f64>,
    coupling: DMatrix<f64>,
    tangential: DMatrix<f64>,
}

impl Network {
    /// `columns`: of the normal forces, then of friction. `isolated`: whether friction moves no contact along its tangent.
    fn new(columns: &[Vec<f64>], isolated: bool) -> Self {
        let count = columns.len() / 2;
        let matrix = |part: &[Vec<f64>]| DMatrix::from_fn(24, count, |row, k| part[k][row]);
        let (n, t) = (matrix(&columns[..count]), matrix(&columns[count..]));
        Self {
            normal: n.transpose() * &n,
            coupling: t.transpose() * &n,
            tangential: if isolated {
                DMatrix::zeros(count, count)
            } else {
                t.transpose() * &t
            },
        }
    }

    /// w and z of forces, both of one vector.
    fn velocities(&self, problem: &Problem, forces: &Forces) -> [DVector<f64>; 2] {
        let f = DVector::from_column_slice(&forces.normal);
        let t = DVector::from_column_slice(&forces.tangential);
        let mut w = &self.normal * &f - self.coupling.transpose() * &t;
        let mut z = &self.coupling * &f - &self.tangential * &t;
        for (k, entry) in problem.normal.iter().enumerate() {
            w[k] += entry.bias + entry.compliance * f[k];
        }
        for (m, entry) in problem.tangential.iter().enumerate() {
            z[m] += entry.shift - entry.compliance * t[m];
        }
        [w, z]
    }
}

impl System for Network {
    fn solve(
        &mut self,
        problem: &Problem,
        states: &States,
        _: bool,
        forces: &mut Forces,
    ) -> Option<Noise> {
        let count = problem.normal.len();
        let mut matrix = DMatrix::identity(2 * count, 2 * count);
        let mut rhs = DVector::zeros(2 * count);
        for k in 0..count {
            if states.closed[k] {
                matrix[(k, k)] = 0.0;
                for l in 0..count {
                    matrix[(k, l)] += self.normal[(k, l)];
                    matrix[(k, count + l)] = -self.coupling[(l, k)];
                }
                matrix[(k, k)] += problem.normal[k].compliance;
                rhs[k] = -problem.normal[k].bias;
            }
            let row = count + k;
            match states.grip[k] {
                Grip::Stick => {
                    matrix[(row, row)] = 0.0;
                    for l in 0..count {
                        matrix[(row, l)] = self.coupling[(k, l)];
                        matrix[(row, count + l)] -= self.tangential[(k, l)];
                    }
                    matrix[(row, row)] -= problem.tangential[k].compliance;
                    rhs[row] = -problem.tangential[k].shift;
                }
                grip if states.closed[k] => {
                    let slope = grip.sign() * problem.friction;
                    if grip != Grip::Off {
                        matrix[(row, k)] = -slope;
                        rhs[row] = -slope * problem.offset;
                    }
                }
                _ => {}
            }
        }
        let solution = matrix.lu().solve(&rhs)?;
        if !solution.iter().all(|x| x.is_finite()) {
            return None;
        }
        forces.normal = solution.as_slice()[..count].to_vec();
        forces.tangential = solution.as_slice()[count..].to_vec();
        self.measure(problem, forces);
        Some(Noise {
            force: 1e-13 * solution.amax(),
            velocity: 1e-12,
            exact: true,
        })
    }

    fn has_matrix(&self, _: &Problem) -> bool {
        true
    }

    fn fill_matrix(&mut self, problem: &Problem, matrix: &mut Matrix) -> bool {
        let count = problem.normal.len();
        matrix.reset(2 * count, 2 * count);
        for l in 0..count {
            for k in 0..count {
                matrix[(k, l)] = self.normal[(k, l)];
                matrix[(count + k, l)] = self.coupling[(k, l)];
                matrix[(k, count + l)] = -self.coupling[(l, k)];
                matrix[(count + k, count + l)] = -self.tangential[(k, l)];
            }
        }
        true
    }

    fn measure(&mut self, problem: &Problem, forces: &mut Forces) {
        let [w, z] = self.velocities(problem, forces);
        forces.slack = w.as_slice().to_vec();
        forces.slip = z.as_slice().to_vec();
    }

    fn mobility(&self, candidate: usize) -> f64 {
        self.normal[(candidate, candidate)]
    }
}

/// Columns of contacts that forces move as slowly as in a layer, at about 1e-3 a·rate for a unit: bounds on forces are for these.
const SCALE: f64 = 0.03;

/// A law, in the entries of the problem.
#[derive(Debug, Clone, Copy)]
struct Law {
    compliance: f64,
    tangential_compliance: f64,
    friction: f64,
    offset: f64,
    isolated: bool,
}

/// Every kind of law with a bound: rigid and soft, each with friction that rolls, sticks or has a spring. Without a bound friction that
/// lifts contacts need not have a solution.
fn laws() -> Vec<Law> {
    let mut all = Vec::new();
    for compliance in [1e-3, 0.3] {
        for (tangential_compliance, isolated) in [(1e-3, false), (0.5, false), (20.0, true)] {
            for (friction, offset) in [(0.1, 0.0), (0.5, 0.05), (1.0, 0.0)] {
                all.push(Law {
                    compliance,
                    tangential_compliance,
                    friction,
                    offset,
                    isolated,
                });
            }
        }
    }
    all
}

/// Rigid contacts with friction that halts slip, as a layer has them.
fn rigid_coulomb(friction: f64) -> Law {
    Law {
        compliance: 1e-10,
        tangential_compliance: 1e-10,
        friction,
        offset: 0.0,
        isolated: false,
    }
}

/// The problem of a law.
fn problem_of(law: Law, count: usize, given: &[f64]) -> Problem {
    let row = Row {
        spheres: [0, 1],
        weights: [0.0; 6],
    };
    let mut problem = Problem {
        friction: law.friction,
        offset: law.offset,
        isolated: law.isolated,
        ..Problem::default()
    };
    for k in 0..count {
        problem.normal.push(Normal {
            row,
            bias: given[k],
            compliance: law.compliance,
        });
        problem.tangential.push(Tangential {
            contact: k,
            row,
            shift: given[10 + k],
            compliance: law.tangential_compliance,
            acts: k % 4 != 3,
            ceased: false,
        });
    }
    problem
}

/// The problem of a law, and its solution from all contacts closed.
fn solve(law: Law, network: &mut Network, given: &[f64]) -> (Problem, BoxSolver, f64) {
    let (problem, solver, residual, jammed) = solve_or_jam(law, network, given);
    assert!(!jammed);
    (problem, solver, residual)
}

/// Friction that acts where the problem says.
const HELD: Onset = Onset {
    critical_load: 0.0,
    smooth: false,
    admits: false,
    deciding: Deciding::Held,
};

/// The same, with whether there is no solution.
fn solve_or_jam(law: Law, network: &mut Network, given: &[f64]) -> (Problem, BoxSolver, f64, bool) {
    solve_from(law, network, given, HELD)
}

/// The same, with friction that begins as `onset` has it.
fn solve_from(
    law: Law,
    network: &mut Network,
    given: &[f64],
    onset: Onset,
) -> (Problem, BoxSolver, f64, bool) {
    let count = network.normal.nrows();
    solve_system(problem_of(law, count, given), network, onset, Effort::Usual)
}

/// A problem solved from all contacts closed, with that effort.
fn solve_system(
    mut problem: Problem,
    system: &mut impl System,
    onset: Onset,
    effort: Effort,
) -> (Problem, BoxSolver, f64, bool) {
    let count = problem.normal.len();
    let mut solver = BoxSolver::default();
    solver.states.closed.resize(count, true);
    solver.states.grip.resize(count, Grip::Stick);
    solver.forces.normal.resize(count, 0.0);
    solver.forces.tangential.resize(count, 0.0);
    solver.effort = effort;
    let outcome = solver.solve(&mut problem, system, onset, |_, _| 0);
    let Outcome::Solved { merit, jammed, .. } = outcome else {
        panic!("every candidate has a row");
    };
    (problem, solver, merit.residual, jammed)
}

/// States that number says: any of the five that a contact and its row can be in.
fn states_of(number: u64, count: usize) -> States {
    let mut states = States::default();
    let mut left = number;
    for _ in 0..count {
        let grip = [Grip::Off, Grip::Off, Grip::Stick, Grip::Plus, Grip::Minus];
        let which = usize::try_from(left % 5).unwrap();
        left /= 5;
        states.closed.push(which > 0);
        states.grip.push(grip[which]);
    }
    states
}

proptest! {
    #[test]
    fn tableau_gives_what_systems_give(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 4..20),
        given in prop::collection::vec(-1.0..1.0f64, 20),
        visited in prop::collection::vec(any::<u64>(), 1..12),
    ) {
        for law in laws() {
            let mut network = Network::new(&columns, law.isolated);
            let count = network.normal.nrows();
            let problem = problem_of(law, count, &given);
            let mut tableau = Tableau::default();
            prop_assert!(tableau.begin(&problem, &mut network));
            let (mut expected, mut found) = (Forces::default(), Forces::default());
            for &number in &visited {
                let states = states_of(number, count);
                // States whose forces are rounding errors of a system that hardly has a solution say nothing.
                let solved = network.solve(&problem, &states, true, &mut expected);
                let largest = largest(&expected.normal).max(largest(&expected.tangential));
                if solved.is_none() || largest > 1e4 {
                    continue;
                }
                prop_assert!(tableau.begin(&problem, &mut network));
                if !tableau.solve(&problem, &states, &mut found) {
                    continue;
                }
                for (found, expected) in [
                    (&found.normal, &expected.normal),
                    (&found.tangential, &expected.tangential),
                    (&found.slack, &expected.slack),
                    (&found.slip, &expected.slip),
                ] {
                    for (x, y) in found.iter().zip(expected) {
                        prop_assert!((x - y).abs() < 1e-7 * (1.0 + largest), "{law:?}: {x} {y}");
                    }
                }
            }
        }
    }

    /// Steep friction on rigid contacts, where Newton's method fails most and some networks are jammed.
    #[test]
    fn networks_with_steep_friction_are_solved_or_jammed(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 6), 12..20),
        given in prop::collection::vec(-1.0..1.0f64, 20),
    ) {
        let columns: Vec<Vec<f64>> = columns
            .into_iter()
            .map(|mut column| {
                column.resize(24, 0.0);
                for x in &mut column {
                    *x *= SCALE;
                }
                column
            })
            .collect();
        for friction in [1.0, 10.0] {
            let law = rigid_coulomb(friction);
            let mut network = Network::new(&columns, false);
            let (_, _, residual, jammed) = solve_or_jam(law, &mut network, &given);
            // Unsolved ones have 0.1; forces are up to 1e8 here, and their rounding errors 1e-8.
            prop_assert!(jammed || residual < 1e-6, "ν = {friction}: residual {residual}");
        }
    }

    #[test]
    fn friction_acts_where_loads_say_however_early_it_is_decided(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 4..20),
        given in prop::collection::vec(-1.0..1.0f64, 20),
    ) {
        for law in laws().into_iter().filter(|law| law.offset == 0.0 && law.friction.is_finite()) {
            for deciding in [Deciding::Late, Deciding::Early] {
                let mut network = Network::new(&columns, law.isolated);
                let onset = Onset {
                    critical_load: 0.05,
                    smooth: false,
                    admits: false,
                    deciding,
                };
                let (problem, solver, residual, _) = solve_from(law, &mut network, &given, onset);
                prop_assert!(residual < 1e-9, "{law:?}, {deciding:?}: residual {residual}");
                for row in &problem.tangential {
                    let loaded = solver.forces.normal[row.contact] > onset.critical_load;
                    // One that ceased has got its friction back, and keeps it.
                    prop_assert!(row.acts == loaded || row.ceased, "{law:?}, {deciding:?}: {row:?}");
                }
            }
        }
    }

    #[test]
    fn conditions_hold_for_random_networks_under_every_law(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 4..20),
        given in prop::collection::vec(-1.0..1.0f64, 20),
    ) {
        for law in laws() {
            let mut network = Network::new(&columns, law.isolated);
            let (problem, solver, residual) = solve(law, &mut network, &given);
            prop_assert!(residual < 1e-9, "{law:?}: residual {residual}");
            // The conditions themselves, whatever the merit says.
            let forces = &solver.forces;
            let [w, z] = network.velocities(&problem, forces);
            for (m, row) in problem.tangential.iter().enumerate() {
                let (f, t) = (forces.normal[m], forces.tangential[m]);
                prop_assert!(f >= 0.0 && w[m] > -1e-9 && f * w[m] < 1e-8, "{law:?}: {f} {}", w[m]);
                let acts = row.acts && f > law.offset;
                let bound = if acts { law.friction * (f - law.offset) } else { 0.0 };
                prop_assert!(t.abs() <= bound * (1.0 + 1e-12), "{law:?}: {t} of {bound}");
                // Loads that are rounding have a bound that is rounding.
                if t.abs() < bound * (1.0 - 1e-9) - 1e-12 {
                    prop_assert!(z[m].abs() < 1e-8, "{law:?}: {} inside the bound", z[m]);
                } else if bound > 1e-12 {
                    prop_assert!(z[m] * t > -1e-8, "{law:?}: {} at the bound", z[m]);
                }
            }
        }
    }
}

#[test]
fn an_isolated_contact_is_solved_by_hand() {
    // One contact, G = 1 in both directions, pressed at the rate 2 and rubbed at the rate 1.
    let columns = vec![
        (0..24).map(|k| f64::from(u8::from(k == 0))).collect(),
        (0..24).map(|k| f64::from(u8::from(k == 1))).collect(),
    ];
    let mut given = vec![0.0; 20];
    (given[0], given[10]) = (-2.0, 1.0);
    let rigid = Law {
        compliance: 0.0,
        tangential_compliance: 0.0,
        friction: 0.2,
        offset: 0.0,
        isolated: false,
    };
    for (law, force, friction) in [
        (rigid, 2.0, 0.4),
        (
            Law {
                friction: 0.8,
                ..rigid
            },
            2.0,
            1.0,
        ),
        (
            Law {
                offset: 1.0,
                ..rigid
            },
            2.0,
            0.2,
        ),
        (
            Law {
                compliance: 1.0,
                ..rigid
            },
            1.0,
            0.2,
        ),
        (
            Law {
                tangential_compliance: 3.0,
                ..rigid
            },
            2.0,
            0.25,
        ),
        (
            Law {
                tangential_compliance: 4.0,
                isolated: true,
                ..rigid
            },
            2.0,
            0.25,
        ),
    ] {
        let mut network = Network::new(&columns, law.isolated);
        let (_, solver, residual) = solve(law, &mut network, &given);
        let (f, t) = (solver.forces.normal[0], solver.forces.tangential[0]);
        assert!(residual < 1e-14);
        assert!((f - force).abs() < 1e-14 && (t - friction).abs() < 1e-14);
    }
}
