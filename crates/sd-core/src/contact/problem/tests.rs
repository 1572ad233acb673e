//! The conditions of the contact problem on random networks, under every law.

use super::ProblemSolver;
use super::newton::FrictionActivation;
use super::statement::{
    Forces, FrictionState, Normal, Problem, RoundoffThresholds, States, System, Tangential, largest,
};
use crate::contact::row::Row;
use crate::contact::{Quality, Status};
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

/// Mobility of the contacts in a synthetic network: Gram matrices of random columns.
struct Network {
    normal: DMatrix<f64>,
    coupling: DMatrix<f64>,
    tangential: DMatrix<f64>,
}

impl Network {
    /// `columns`: those of the normal forces, then those of friction, contact by contact.
    fn new(columns: &[Vec<f64>], law: Law) -> Self {
        let (rows, isolated) = (law.rows(), law.isolated);
        let count = columns.len() / (1 + rows);
        let matrix = |part: &[Vec<f64>]| DMatrix::from_fn(24, part.len(), |row, k| part[k][row]);
        let (normal, tangential) = columns.split_at(count);
        let (n, t) = (matrix(normal), matrix(&tangential[..count * rows]));
        Self {
            normal: n.transpose() * &n,
            coupling: t.transpose() * &n,
            tangential: if isolated {
                DMatrix::zeros(count * rows, count * rows)
            } else {
                t.transpose() * &t
            },
        }
    }

    /// w and z of given forces.
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
    ) -> Option<RoundoffThresholds> {
        let (count, rows) = (problem.normal.len(), problem.tangential.len());
        let mut matrix = DMatrix::identity(count + rows, count + rows);
        let mut rhs = DVector::zeros(count + rows);
        for k in 0..count {
            if states.closed[k] {
                matrix[(k, k)] = 0.0;
                for l in 0..count {
                    matrix[(k, l)] += self.normal[(k, l)];
                }
                for m in 0..rows {
                    matrix[(k, count + m)] = -self.coupling[(m, k)];
                }
                matrix[(k, k)] += problem.normal[k].compliance;
                rhs[k] = -problem.normal[k].bias;
            }
        }
        for (m, entry) in problem.tangential.iter().enumerate() {
            let row = count + m;
            match states.friction[m] {
                FrictionState::Stick => {
                    matrix[(row, row)] = 0.0;
                    for l in 0..count {
                        matrix[(row, l)] = self.coupling[(m, l)];
                    }
                    for l in 0..rows {
                        matrix[(row, count + l)] -= self.tangential[(m, l)];
                    }
                    matrix[(row, row)] -= entry.compliance;
                    rhs[row] = -entry.shift;
                }
                state => {
                    if entry.follows_load() && states.closed[entry.contact] {
                        matrix[(row, entry.contact)] = -state.sign() * entry.coefficient;
                    }
                    rhs[row] = state.sign() * entry.intercept;
                }
            }
        }
        let solution = matrix.lu().solve(&rhs)?;
        if !solution.iter().all(|x| x.is_finite()) {
            return None;
        }
        forces.normal = solution.as_slice()[..count].to_vec();
        forces.tangential = solution.as_slice()[count..].to_vec();
        self.measure(problem, forces);
        Some(RoundoffThresholds {
            force: 1e-13 * solution.amax(),
            velocity: 1e-12,
            exact: true,
        })
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

/// Scale of the columns at which contacts have the mobility of a layer, about 1e-3 a·rate per unit
/// of force, for which the limits on forces are meant.
const SCALE: f64 = 0.03;

/// A law, as coefficients of the problem.
#[derive(Debug, Clone, Copy)]
struct Law {
    compliance: f64,
    tangential_compliance: f64,
    friction: f64,
    /// Coefficient of a second row, for rolling friction; 0 without it.
    rolling: f64,
    offset: f64,
    isolated: bool,
}

impl Law {
    /// Number of friction rows of a contact.
    fn rows(self) -> usize {
        1 + usize::from(self.rolling > 0.0)
    }
}

/// Every kind of bounded law: rigid and soft contacts with roll-slip, Coulomb or spring friction,
/// each with and without rolling friction. Without a bound, friction that opens contacts need not
/// have a solution.
fn laws() -> Vec<Law> {
    let mut all = Vec::new();
    for compliance in [1e-3, 0.3] {
        for (tangential_compliance, isolated) in [(1e-3, false), (0.5, false), (20.0, true)] {
            for (friction, offset) in [(0.1, 0.0), (0.5, 0.05), (1.0, 0.0)] {
                let law = Law {
                    compliance,
                    tangential_compliance,
                    friction,
                    rolling: 0.0,
                    offset,
                    isolated,
                };
                all.push(law);
                if !isolated {
                    all.push(Law {
                        rolling: 0.2,
                        ..law
                    });
                }
            }
        }
    }
    all
}

/// Rigid contacts with Coulomb friction.
fn rigid_coulomb(friction: f64) -> Law {
    Law {
        compliance: 1e-10,
        tangential_compliance: 1e-10,
        friction,
        rolling: 0.0,
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
        uses_frictionless_slip: law.isolated,
        ..Problem::default()
    };
    for k in 0..count {
        problem.normal.push(Normal {
            row,
            bias: given[k],
            compliance: law.compliance,
        });
        let coefficients = [law.friction, law.rolling];
        for (which, coefficient) in coefficients.into_iter().take(law.rows()).enumerate() {
            problem.tangential.push(Tangential {
                contact: k,
                row,
                shift: given[10 + (k + which) % 10],
                compliance: law.tangential_compliance,
                coefficient,
                intercept: -coefficient * law.offset,
                active: k % 4 != 3,
                was_deactivated: false,
            });
        }
    }
    problem
}

/// Friction whose activation is fixed.
const FIXED_ACTIVATION: FrictionActivation = FrictionActivation {
    critical_load: 0.0,
    updates: false,
};

/// Solves the problem of a law, starting with all contacts closed.
fn solve(
    law: Law,
    network: &mut Network,
    given: &[f64],
    activation: FrictionActivation,
) -> (Problem, ProblemSolver, Quality) {
    let count = network.normal.nrows();
    let mut problem = problem_of(law, count, given);
    let mut solver = ProblemSolver::default();
    solver.states.closed.resize(count, true);
    let rows = problem.tangential.len();
    solver.states.friction.resize(rows, FrictionState::Stick);
    solver.forces.normal.resize(count, 0.0);
    solver.forces.tangential.resize(rows, 0.0);
    let outcome = solver.solve(&mut problem, network, activation, None, |_, _| 0);
    (problem, solver, outcome)
}

proptest! {
    /// High friction on rigid contacts, where Newton's method fails most often and some networks
    /// are jammed.
    #[test]
    fn gaps_hold_under_high_friction_or_no_motion_is_admissible(
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
            let mut network = Network::new(&columns, law);
            let (_, _, outcome) = solve(law, &mut network, &given, FIXED_ACTIVATION);
            prop_assert!(outcome.status != Status::Failed, "ν = {friction}: {outcome:?}");
            let jammed = outcome.status == Status::NoAdmissibleMotion;
            let residual = outcome.residual;
            prop_assert!(jammed || residual <= Quality::RESIDUAL_LIMIT, "ν = {friction}: {outcome:?}");
        }
    }

    #[test]
    fn friction_is_active_above_the_critical_load(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 4..20),
        given in prop::collection::vec(-1.0..1.0f64, 20),
    ) {
        for law in laws().into_iter().filter(|law| law.offset == 0.0) {
            let mut network = Network::new(&columns, law);
            let activation = FrictionActivation { critical_load: 0.05, updates: true };
            let (problem, solver, outcome) = solve(law, &mut network, &given, activation);
            prop_assert!(outcome.status == Status::Solved, "{law:?}: {outcome:?}");
            for row in &problem.tangential {
                let loaded = solver.forces.normal[row.contact] > activation.critical_load;
                // Friction that was deactivated once and reactivated stays active.
                prop_assert!(row.active == loaded || row.was_deactivated, "{law:?}: {row:?}");
            }
        }
    }

    #[test]
    fn conditions_hold_for_random_networks_under_every_law(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 4..20),
        given in prop::collection::vec(-1.0..1.0f64, 20),
    ) {
        for law in laws() {
            let mut network = Network::new(&columns, law);
            let (mut problem, mut solver, outcome) =
                solve(law, &mut network, &given, FIXED_ACTIVATION);
            prop_assert!(outcome.status == Status::Solved, "{law:?}: {outcome:?}");
            // The conditions are evaluated independently of the solver.
            let forces = &solver.forces;
            let [w, z] = network.velocities(&problem, forces);
            for (m, row) in problem.tangential.iter().enumerate() {
                let (f, w, t) = (forces.normal[row.contact], w[row.contact], forces.tangential[m]);
                prop_assert!(f >= 0.0 && w > -1e-9 && f * w < 1e-8, "{law:?}: {f} {w}");
                let acts = row.active && f > law.offset;
                let bound = if acts { row.coefficient * (f - law.offset) } else { 0.0 };
                // Tolerance of friction, relative to the largest force.
                let exact = Quality::FRICTION_LIMIT * largest(&forces.normal);
                prop_assert!(t.abs() <= bound + exact, "{law:?}: {t} of {bound}");
                if bound <= exact {
                    continue;
                }
                if t.abs() < bound - exact {
                    prop_assert!(z[m].abs() < 1e-8, "{law:?}: {} inside the bound", z[m]);
                } else {
                    prop_assert!(z[m] * t > -1e-8, "{law:?}: {} at the bound", z[m]);
                }
            }
            if problem.tangential.iter().any(|row| row.coefficient.is_infinite()) {
                continue;
            }
            // With friction bounds held at the loads of the solution it is found from zero forces.
            let (normal, tangential) = (forces.normal.clone(), forces.tangential.clone());
            solver.forces.normal.fill(0.0);
            solver.forces.tangential.fill(0.0);
            let held = Some(&normal[..]);
            let again = solver.solve(&mut problem, &mut network, FIXED_ACTIVATION, held, |_, _| 0);
            prop_assert!(again.status == Status::Solved, "{law:?}: {again:?}");
            let exact = 1e-6 * (1.0 + largest(&normal));
            let pairs = [(&normal, &solver.forces.normal), (&tangential, &solver.forces.tangential)];
            for (expected, found) in pairs {
                for (a, b) in expected.iter().zip(found) {
                    prop_assert!((a - b).abs() < exact, "{law:?}: {a} {b}");
                }
            }
        }
    }
}

#[test]
fn isolated_contact_has_the_solution_by_hand() {
    // One contact with G = 1 in both directions, compressed at the rate 2 and sheared at the rate
    // 1.
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
        rolling: 0.0,
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
        let mut network = Network::new(&columns, law);
        let (_, solver, outcome) = solve(law, &mut network, &given, FIXED_ACTIVATION);
        let violation = outcome;
        let (f, t) = (solver.forces.normal[0], solver.forces.tangential[0]);
        assert!(violation.residual < 1e-14 && violation.friction_error < 1e-14);
        assert!((f - force).abs() < 1e-14 && (t - friction).abs() < 1e-14);
    }
}
