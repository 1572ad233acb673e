//! What is done for problems that the usual effort leaves unsolved.

use super::*;

/// A network whose linear systems come to no end, as iterated ones of nearly rigid layers do, and whose matrix is a little wrong.
struct Iterated {
    network: Network,
    wrong: f64,
}

impl System for Iterated {
    fn solve(&mut self, _: &Problem, _: &States, _: bool, _: &mut Forces) -> Option<Noise> {
        None
    }

    fn has_matrix(&self, _: &Problem) -> bool {
        true
    }

    fn fill_matrix(&mut self, problem: &Problem, matrix: &mut Matrix) -> bool {
        self.network.fill_matrix(problem, matrix);
        for (k, entry) in matrix.values_mut().iter_mut().enumerate() {
            *entry *= 1.0 + self.wrong * (k as f64).cos();
        }
        true
    }

    fn measure(&mut self, problem: &Problem, forces: &mut Forces) {
        self.network.measure(problem, forces);
    }

    fn mobility(&self, candidate: usize) -> f64 {
        self.network.mobility(candidate)
    }
}

/// How well the problem of a law is solved with that effort.
fn residual(law: Law, system: &mut Iterated, given: &[f64], effort: Effort) -> f64 {
    let problem = problem_of(law, system.network.normal.nrows(), given);
    let (_, _, residual, jammed) = solve_system(problem, system, HELD, effort);
    assert!(!jammed);
    residual
}

proptest! {
    /// The ends of paths are solutions, whatever iterated systems make of them.
    #[test]
    fn the_last_effort_takes_what_rounding_left_off(
        columns in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 24), 4..20),
        given in prop::collection::vec(-1.0..-0.1f64, 20),
    ) {
        for law in laws() {
            let network = Network::new(&columns, law.isolated);
            let mut system = Iterated { network, wrong: 1e-7 };
            let last = residual(law, &mut system, &given, Effort::Last);
            prop_assert!(last < 1e-8, "{law:?}: residual {last}");
        }
    }
}

#[test]
fn the_usual_effort_needs_systems() {
    let column = |row| (0..24).map(|k| f64::from(u8::from(k == row))).collect();
    let mut given = vec![0.0; 20];
    (given[0], given[10]) = (-2.0, 1.0);
    let mut system = Iterated {
        network: Network::new(&[column(0), column(1)], false),
        wrong: 1e-4,
    };
    let law = rigid_coulomb(0.2);
    assert!(residual(law, &mut system, &given, Effort::Usual) > 1e-5);
    assert!(residual(law, &mut system, &given, Effort::Last) < 1e-8);
}
