//! Whether forces within the cones of friction balance, and the convex problems on the way to a solution.

use super::super::cone::Cones;
use super::super::path::{Begin, PathEnd};
use super::*;

/// A disc that two walls push along the bisector of the wedge between them, whose half angle has this tangent: friction holds it where ν is
/// above that, and otherwise it slips out. Columns, and what the walls do.
fn wedge(tangent: f64) -> (Vec<Vec<f64>>, Vec<f64>) {
    let (s, c) = tangent.atan().sin_cos();
    let column = |x: f64, y: f64| {
        let mut column = vec![0.0; 24];
        (column[0], column[1]) = (SCALE * x, SCALE * y);
        column
    };
    let columns = vec![column(s, c), column(s, -c), column(-c, s), column(c, s)];
    let mut given = vec![0.0; 20];
    // At nearly the same rate: where one wall outruns the other, it can push the disc alone.
    (given[0], given[1]) = (-1.0, -1.01);
    (columns, given)
}

#[test]
fn a_wedge_jams_where_friction_holds_the_disc() {
    for tangent in [0.05, 0.5, 1.0, 3.0, 8.0] {
        let (columns, given) = wedge(tangent);
        let mut network = Network::new(&columns, false);
        for (friction, holds) in [(0.9 * tangent, false), (1.1 * tangent, true)] {
            let law = rigid_coulomb(friction);
            let problem = problem_of(law, 2, &given);
            let mut cones = Cones::default();
            let found = cones.jam(&problem, &mut network, Effort::Usual);
            assert_eq!(found, Some(holds), "tan = {tangent}, ν = {friction}");
            if holds {
                let forces = cones.forces();
                for (f, t) in forces.normal.iter().zip(&forces.tangential) {
                    assert!(*f >= 0.0 && t.abs() <= friction * f * (1.0 + 1e-12));
                }
            }
            let (_, _, residual, jammed) = solve_or_jam(law, &mut network, &given);
            assert_eq!(jammed, holds, "tan = {tangent}, ν = {friction}");
            assert!(jammed || residual < 1e-9);
        }
    }
}

#[test]
fn an_open_wedge_or_friction_that_is_no_reaction_jams_nothing() {
    let (columns, given) = wedge(0.5);
    let mut network = Network::new(&columns, false);
    let law = rigid_coulomb(1.0);
    let mut cones = Cones::default();
    let parting: Vec<f64> = given.iter().map(|b| -b).collect();
    let problem = problem_of(law, 2, &parting);
    assert_eq!(
        cones.jam(&problem, &mut network, Effort::Usual),
        Some(false)
    );
    let mut without_friction = problem_of(law, 2, &given);
    for row in &mut without_friction.tangential {
        row.acts = false;
    }
    assert_eq!(
        cones.jam(&without_friction, &mut network, Effort::Usual),
        Some(false)
    );
    let isolated = Law {
        isolated: true,
        ..law
    };
    let problem = problem_of(isolated, 2, &given);
    assert_eq!(cones.jam(&problem, &mut network, Effort::Usual), None);
}

#[test]
fn convex_problems_lead_to_the_solution() {
    // One contact as below, which slides: x₊ opens it at ν z, and presses by 2.2/1.04.
    let column = |row| (0..24).map(|k| f64::from(u8::from(k == row))).collect();
    let mut network = Network::new(&[column(0), column(1)], false);
    let mut given = vec![0.0; 20];
    (given[0], given[10]) = (-2.0, 1.0);
    let problem = problem_of(rigid_coulomb(0.2), 1, &given);
    let mut cones = Cones::default();
    assert_eq!(
        cones.jam(&problem, &mut network, Effort::Usual),
        Some(false)
    );
    let off = |cones: &Cones| {
        let forces = cones.forces();
        assert!((forces.tangential[0] - 0.2 * forces.normal[0]).abs() < 1e-12);
        forces.normal[0] - 2.0
    };
    let first = 2.2 / 1.04 - 2.0;
    // Each problem takes back all but 0.04/1.04 of what presses too much.
    for count in 0..5 {
        assert!(cones.approach(&problem, &mut network));
        let expected = first * (0.04 / 1.04_f64).powi(count + 1);
        assert!(
            (off(&cones) - expected).abs() < 1e-9,
            "{count}: {}",
            off(&cones)
        );
    }
}

#[test]
fn where_friction_is_steep_a_leap_leads_to_the_solution() {
    // The same contact under friction that would take back 1/101 with each problem: fifteen hundred of them come as near as one leap.
    let column = |row| (0..24).map(|k| f64::from(u8::from(k == row))).collect();
    let mut network = Network::new(&[column(0), column(1)], false);
    let mut given = vec![0.0; 20];
    (given[0], given[10]) = (-2.0, 25.0);
    let off = |friction: f64, approaches: u32, network: &mut Network| {
        let problem = problem_of(rigid_coulomb(friction), 1, &given);
        let mut cones = Cones::default();
        assert_eq!(cones.jam(&problem, network, Effort::Usual), Some(false));
        let mut arrived = Vec::new();
        for _ in 0..approaches {
            assert!(cones.approach(&problem, network));
            arrived.push(cones.have_arrived());
        }
        (cones.forces().normal[0] - 2.0, arrived)
    };
    let square = 10.0 * 10.0_f64;
    let first = (2.0 + 250.0) / (1.0 + square) - 2.0;
    for plain in 1..=2 {
        let (off, _) = off(10.0, plain, &mut network);
        let expected = first * (square / (1.0 + square)).powi(i32::try_from(plain).unwrap());
        assert!((off - expected).abs() < 1e-7, "{plain}: {off}, {expected}");
    }
    let (leapt, arrived) = off(10.0, 4, &mut network);
    assert!(leapt.abs() < 1e-7, "{leapt}");
    assert_eq!(arrived, [false, false, false, true]);
    // Friction that is not steep never leaps: half of what is too much is left each time.
    let first = 13.5 - 2.0;
    let (plain, arrived) = off(1.0, 12, &mut network);
    assert!((plain - first * 0.5_f64.powi(12)).abs() < 1e-7, "{plain}");
    assert!(arrived.iter().all(|arrived| !arrived));
}

#[test]
fn a_shift_ends_where_a_contact_changes_what_it_does() {
    let column = |row| (0..24).map(|k| f64::from(u8::from(k == row))).collect();
    let mut network = Network::new(&[column(0), column(1)], false);
    let mut given = vec![0.0; 20];
    given[0] = -2.0;
    for (change, share, left) in [(1.0, 1.0, 1.0), (4.0, 0.5, 0.0), (-3.0, 1.0, 5.0)] {
        let mut problem = problem_of(rigid_coulomb(0.0), 1, &given);
        let mut solver = BoxSolver::default();
        solver.forces.normal.push(0.0);
        solver.forces.tangential.push(0.0);
        let (end, _) = solver.follow_path(&mut problem, &mut network, Begin::Open);
        assert_eq!(end, PathEnd::Solved);
        assert!((solver.forces.normal[0] - 2.0).abs() < 1e-9);
        // Added to its slack, the contact presses less; it opens when that is 2.
        let gone = solver.shift_to_boundary(&problem, &[change, 0.0]).unwrap();
        assert!((gone - share).abs() < 1e-9, "{change}: {gone}");
        assert!((solver.forces.normal[0] - left).abs() < 1e-9, "{change}");
    }
}
