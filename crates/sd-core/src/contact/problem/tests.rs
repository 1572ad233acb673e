//! The conditions of the contact problem on random networks, in layers and suspensions, under every
//! law; and the solution by an interior-point method.

use super::ProblemSolver;
use super::statement::{
    Forces, Friction, FrictionState, Normal, Problem, RoundoffThresholds, States, System, largest,
};
use crate::contact::row::Row;
use crate::contact::{Quality, Status};
use crate::space::{Bulk, Layer, Space};
use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{NonnegativeConeT, SecondOrderConeT};
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver as _, SolverStatus};
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

/// Mobility of the contacts in a synthetic network: Gram matrices of random columns.
struct Network {
    normal: DMatrix<f64>,
    coupling: DMatrix<f64>,
    tangential: DMatrix<f64>,
}

impl Network {
    /// `columns`: those of the normal forces, then those of the components of friction, contact by
    /// contact.
    fn new<S: Space>(columns: &[Vec<f64>], law: Law) -> Self {
        let (rows, isolated) = (S::TANGENTS * law.forces(), law.isolated);
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

    /// w, and the components of z, of given forces.
    fn velocities<S: Space>(&self, problem: &Problem<S>, forces: &Forces<S>) -> [DVector<f64>; 2] {
        let f = DVector::from_column_slice(&forces.normal);
        let t = DVector::from_column_slice(S::components(&forces.tangential));
        let mut w = &self.normal * &f - self.coupling.transpose() * &t;
        let mut z = &self.coupling * &f - &self.tangential * &t;
        for (k, entry) in problem.normal.iter().enumerate() {
            w[k] += entry.bias + entry.compliance * f[k];
        }
        for (k, entry) in problem.friction.iter().enumerate() {
            for d in 0..S::TANGENTS {
                let m = S::TANGENTS * k + d;
                z[m] += entry.shift[d] - entry.compliance * t[m];
            }
        }
        [w, z]
    }
}

impl<S: Space> System<S> for Network {
    fn solve(
        &mut self,
        problem: &Problem<S>,
        states: &States<S>,
        _: bool,
        forces: &mut Forces<S>,
    ) -> Option<RoundoffThresholds> {
        let (count, rows) = (problem.normal.len(), problem.friction_rows());
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
        for (k, (entry, state)) in problem.friction.iter().zip(&states.friction).enumerate() {
            let first = S::TANGENTS * k;
            for d in 0..S::TANGENTS {
                let row = count + first + d;
                let (axis, compliance) = match state {
                    FrictionState::Inactive => continue,
                    FrictionState::Stick => {
                        let mut axis = S::each_tangent(0.0);
                        axis[d] = 1.0;
                        (axis, entry.compliance)
                    }
                    FrictionState::Slip(slide) => {
                        (slide.axis(d), entry.compliance + slide.compliance)
                    }
                };
                matrix[(row, row)] = 0.0;
                let slips = d == 0 && matches!(state, FrictionState::Slip(_));
                if slips {
                    if entry.follows_load() && states.closed[entry.contact] {
                        matrix[(row, entry.contact)] = -entry.coefficient;
                    }
                    rhs[row] = entry.intercept;
                }
                for (e, &x) in axis.as_ref().iter().enumerate() {
                    if slips {
                        matrix[(row, count + first + e)] = x;
                        continue;
                    }
                    for l in 0..count {
                        matrix[(row, l)] += x * self.coupling[(first + e, l)];
                    }
                    for l in 0..rows {
                        matrix[(row, count + l)] -= x * self.tangential[(first + e, l)];
                    }
                    matrix[(row, count + first + e)] -= x * compliance;
                    rhs[row] -= x * entry.shift[e];
                }
            }
        }
        let solution = matrix.lu().solve(&rhs)?;
        if !solution.iter().all(|x| x.is_finite()) {
            return None;
        }
        forces.reset(problem);
        forces.normal.copy_from_slice(&solution.as_slice()[..count]);
        S::components_mut(&mut forces.tangential).copy_from_slice(&solution.as_slice()[count..]);
        self.measure(problem, forces);
        Some(RoundoffThresholds {
            force: 1e-13 * solution.amax(),
            velocity: 1e-12,
            exact: true,
        })
    }

    fn measure(&mut self, problem: &Problem<S>, forces: &mut Forces<S>) {
        let [w, z] = self.velocities(problem, forces);
        forces.slack = w.as_slice().to_vec();
        let zero = S::each_tangent(0.0);
        forces.slip.resize(problem.friction.len(), zero);
        S::components_mut(&mut forces.slip).copy_from_slice(z.as_slice());
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
    /// Coefficient of a second force, for rolling friction; 0 without it.
    rolling: f64,
    offset: f64,
    isolated: bool,
}

impl Law {
    /// Number of friction forces of a contact.
    fn forces(self) -> usize {
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
fn problem_of<S: Space>(law: Law, count: usize, given: &[f64]) -> Problem<S> {
    let row = Row::normal([0, 1], &S::Vector::default());
    let mut problem = Problem {
        uses_frictionless_slip: law.isolated,
        ..Problem::default()
    };
    for k in 0..count {
        problem.normal.push(Normal {
            row,
            bias: given[k % 10],
            compliance: law.compliance,
        });
        let coefficients = [law.friction, law.rolling];
        for (which, coefficient) in coefficients.into_iter().take(law.forces()).enumerate() {
            let mut shift = S::each_tangent(0.0);
            for (d, x) in shift.as_mut().iter_mut().enumerate() {
                *x = given[10 + (k + which + 3 * d) % 10];
            }
            problem.friction.push(Friction {
                contact: k,
                rows: S::each_tangent(row),
                shift,
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

/// Solves the problem of a law, starting with all contacts closed.
fn solve<S: Space>(
    law: Law,
    network: &mut Network,
    given: &[f64],
    critical_load: Option<f64>,
) -> (Problem<S>, ProblemSolver<S>, Quality) {
    let count = network.normal.nrows();
    let mut problem = problem_of(law, count, given);
    problem.critical_load = critical_load;
    let mut solver = ProblemSolver::default();
    solver.states.closed.resize(count, true);
    let frictions = problem.friction.len();
    let states = &mut solver.states.friction;
    states.resize(frictions, FrictionState::Stick);
    solver.forces.reset(&problem);
    let outcome = solver.solve(&mut problem, network, None, |_, _| 0);
    (problem, solver, outcome)
}

/// Solves with every law and evaluates the conditions independently of the solver.
fn conditions_hold<S: Space>(columns: &[Vec<f64>], given: &[f64]) -> Result<(), TestCaseError> {
    for law in laws() {
        let mut network = Network::new::<S>(columns, law);
        let (mut problem, mut solver, outcome) = solve::<S>(law, &mut network, given, None);
        prop_assert!(outcome.status == Status::Solved, "{law:?}: {outcome:?}");
        let forces = &solver.forces;
        let [w, z] = network.velocities(&problem, forces);
        for (k, &f) in forces.normal.iter().enumerate() {
            prop_assert!(
                f >= 0.0 && w[k] > -1e-9 && f * w[k] < 1e-8,
                "{law:?}: {f} {}",
                w[k]
            );
        }
        // Tolerance of friction, relative to the largest force.
        let exact = Quality::FRICTION_LIMIT * largest(&forces.normal);
        for (k, entry) in problem.friction.iter().enumerate() {
            let t = DVector::from_column_slice(forces.tangential[k].as_ref());
            let z = z.rows(S::TANGENTS * k, S::TANGENTS);
            let f = forces.normal[entry.contact];
            let acts = entry.active && f > law.offset;
            let bound = if acts {
                entry.coefficient * (f - law.offset)
            } else {
                0.0
            };
            prop_assert!(t.norm() <= bound + exact, "{law:?}: {t} of {bound}");
            if bound <= exact {
                continue;
            }
            if t.norm() < bound - exact {
                prop_assert!(z.norm() < 1e-8, "{law:?}: {z} inside the bound");
            } else {
                let direction = &t / t.norm();
                let along = z.dot(&direction);
                let across = (z - &direction * along).norm();
                prop_assert!(
                    along > -1e-8 && across < 1e-6,
                    "{law:?}: {z} at {t}, the bound"
                );
            }
        }
        // With friction bounds held at the loads of the solution it is found from zero forces.
        let (normal, tangential) = (forces.normal.clone(), forces.tangential.clone());
        solver.forces.reset(&problem);
        let held = Some(&normal[..]);
        let again = solver.solve(&mut problem, &mut network, held, |_, _| 0);
        prop_assert!(again.status == Status::Solved, "{law:?}: {again:?}");
        let tolerance = 1e-6 * (1.0 + largest(&normal));
        let found = &solver.forces;
        for (expected, found) in [
            (&normal[..], &found.normal[..]),
            (S::components(&tangential), S::components(&found.tangential)),
        ] {
            for (a, b) in expected.iter().zip(found) {
                prop_assert!((a - b).abs() < tolerance, "{law:?}: {a} {b}");
            }
        }
    }
    Ok(())
}

/// Compares the motion with that of an interior-point method, which minimises a convex function of
/// the forces. The bounds of friction are those of the solution:
///
/// ```text
/// minimise   fᵀ (G_nn + κ) f/2 − fᵀ G_nt t + tᵀ (G_tt + μ) t/2 + bᵀ f − dᵀ t
/// subject to f ≥ 0,  |t_k| ≤ ρ_k          its gradient is (w, −z)
/// ```
fn motion_is_the_convex_minimum<S: Space>(
    columns: &[Vec<f64>],
    given: &[f64],
) -> Result<(), TestCaseError> {
    let laws = laws().into_iter().filter(|law| !law.isolated);
    let mut compared = 0;
    for law in laws.chain([rigid_coulomb(0.3)]) {
        let mut network = Network::new::<S>(columns, law);
        let (problem, solver, outcome) = solve::<S>(law, &mut network, given, None);
        if law.compliance < 1e-9 && outcome.jammed() {
            continue;
        }
        prop_assert!(outcome.residual < 1e-9, "{law:?}: {outcome:?}");
        let forces = &solver.forces;
        let (count, size) = (
            problem.normal.len(),
            problem.normal.len() + problem.friction_rows(),
        );
        let mut quadratic = DMatrix::zeros(size, size);
        let mut linear = vec![0.0; size];
        quadratic
            .view_mut((0, 0), (count, count))
            .copy_from(&network.normal);
        let rows = size - count;
        quadratic
            .view_mut((count, count), (rows, rows))
            .copy_from(&network.tangential);
        let coupling = -network.coupling.transpose();
        quadratic
            .view_mut((0, count), (count, rows))
            .copy_from(&coupling);
        for (k, entry) in problem.normal.iter().enumerate() {
            quadratic[(k, k)] += entry.compliance;
            linear[k] = entry.bias;
        }
        let mut b = vec![0.0; count];
        let mut cones = vec![NonnegativeConeT(count)];
        let mut entries: Vec<_> = (0..count).map(|k| (k, k)).collect();
        for (k, entry) in problem.friction.iter().enumerate() {
            b.push(entry.bound(forces.normal[entry.contact]));
            cones.push(SecondOrderConeT(1 + S::TANGENTS));
            for d in 0..S::TANGENTS {
                let m = count + S::TANGENTS * k + d;
                quadratic[(m, m)] += entry.compliance;
                linear[m] = -entry.shift[d];
                entries.push((b.len(), m));
                b.push(0.0);
            }
        }
        let (rows, columns) = entries.iter().copied().unzip();
        let values = vec![-1.0; entries.len()];
        let a = CscMatrix::new_from_triplets(b.len(), size, rows, columns, values);
        let upper: Vec<(usize, usize)> = (0..size)
            .flat_map(|j| (0..=j).map(move |i| (i, j)))
            .collect();
        let values = upper.iter().map(|&at| quadratic[at]).collect();
        let (rows, columns) = upper.iter().copied().unzip();
        let p = CscMatrix::new_from_triplets(size, size, rows, columns, values);
        let settings = DefaultSettings {
            verbose: false,
            tol_gap_abs: 1e-9,
            tol_gap_rel: 1e-9,
            tol_feas: 1e-9,
            ..DefaultSettings::default()
        };
        let mut method = DefaultSolver::new(&p, &linear, &a, &b, &cones, settings).unwrap();
        method.solve();
        match method.solution.status {
            SolverStatus::Solved => compared += 1,
            // The other method did not reach its tolerance, and says nothing.
            SolverStatus::AlmostSolved => continue,
            status => prop_assert!(false, "{law:?}: {status:?}"),
        }
        // The energy of the difference is at most the gap of the method, and so bounds velocities.
        let gap = (method.solution.obj_val - method.solution.obj_val_dual).abs();
        let energy = method.solution.obj_val.abs();
        prop_assert!(gap < 1e-8 * (1.0 + energy), "{law:?}: {gap:e}");
        let exact = 1e-6 + (2.0 * quadratic.norm() * gap).sqrt();
        let mut expected = Forces::<S>::default();
        expected.reset(&problem);
        expected.normal.copy_from_slice(&method.solution.x[..count]);
        S::components_mut(&mut expected.tangential).copy_from_slice(&method.solution.x[count..]);
        let (found, expected) = (
            network.velocities(&problem, forces),
            network.velocities(&problem, &expected),
        );
        for (found, expected) in found.iter().zip(&expected) {
            let error = (found - expected).amax();
            prop_assert!(error < exact * (1.0 + expected.amax()), "{law:?}: {error}");
        }
    }
    prop_assert!(compared > 16, "{compared} of 25 laws were compared");
    Ok(())
}

proptest! {
    /// From zero forces, along whose path each contact closes, slides and sticks by itself.
    #[test]
    fn path_from_zero_forces_ends_at_a_solution(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 4..16),
        given in prop::collection::vec(-1.0..1.0f64, 20),
    ) {
        let rigid_spring = Law {
            tangential_compliance: 1.0,
            ..rigid_coulomb(0.5)
        };
        for law in laws().into_iter().chain([rigid_spring]) {
            let mut network = Network::new::<Layer>(&columns, law);
            let mut problem = problem_of::<Layer>(law, network.normal.nrows(), &given);
            let mut solver = ProblemSolver::<Layer>::default();
            solver.forces.reset(&problem);
            solver.infer_states(&problem);
            network.measure(&problem, &mut solver.forces);
            let (solved, systems) = solver.follow_path(&mut problem, &mut network);
            prop_assert!(solved, "{law:?}: {systems}");
            let quality = solver.forces.quality(&problem);
            prop_assert!(quality.status == Status::Solved, "{law:?}: {quality:?}");
        }
    }

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
            let outcomes = [
                solve::<Layer>(law, &mut Network::new::<Layer>(&columns, law), &given, None).2,
                solve::<Bulk>(law, &mut Network::new::<Bulk>(&columns, law), &given, None).2,
            ];
            for outcome in outcomes {
                prop_assert!(outcome.status != Status::Failed, "ν = {friction}: {outcome:?}");
                let jammed = outcome.status == Status::NoAdmissibleMotion;
                let residual = outcome.residual;
                prop_assert!(
                    jammed || residual <= Quality::RESIDUAL_LIMIT,
                    "ν = {friction}: {outcome:?}"
                );
            }
        }
    }

    #[test]
    fn friction_is_active_above_the_critical_load(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 4..20),
        given in prop::collection::vec(-1.0..1.0f64, 20),
    ) {
        for law in laws().into_iter().filter(|law| law.offset == 0.0) {
            let mut network = Network::new::<Layer>(&columns, law);
            let critical_load = 0.05;
            let (problem, solver, outcome) =
                solve::<Layer>(law, &mut network, &given, Some(critical_load));
            prop_assert!(outcome.status == Status::Solved, "{law:?}: {outcome:?}");
            for entry in &problem.friction {
                let load = solver.forces.normal[entry.contact];
                let loaded = load > critical_load;
                // Friction that was deactivated once and reactivated stays active.
                prop_assert!(entry.active == loaded || entry.was_deactivated, "{law:?}: {load}");
            }
        }
    }

    #[test]
    fn conditions_hold_for_random_layers_under_every_law(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 4..20),
        given in prop::collection::vec(-1.0..1.0f64, 20),
    ) {
        conditions_hold::<Layer>(&columns, &given)?;
    }

    #[test]
    fn conditions_hold_for_random_suspensions_under_every_law(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 5..24),
        given in prop::collection::vec(-1.0..1.0f64, 20),
    ) {
        conditions_hold::<Bulk>(&columns, &given)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn random_layers_move_as_an_interior_point_method_finds(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 4..20),
        given in prop::collection::vec(-1.0..1.0f64, 20),
    ) {
        motion_is_the_convex_minimum::<Layer>(&columns, &given)?;
    }

    #[test]
    fn random_suspensions_move_as_an_interior_point_method_finds(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 5..24),
        given in prop::collection::vec(-1.0..1.0f64, 20),
    ) {
        motion_is_the_convex_minimum::<Bulk>(&columns, &given)?;
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
        let mut network = Network::new::<Layer>(&columns, law);
        let (_, solver, outcome) = solve::<Layer>(law, &mut network, &given, None);
        let (f, [t]) = (solver.forces.normal[0], solver.forces.tangential[0]);
        assert!(outcome.residual < 1e-14 && outcome.friction_error < 1e-14);
        assert!((f - force).abs() < 1e-14 && (t - friction).abs() < 1e-14);
    }
}
