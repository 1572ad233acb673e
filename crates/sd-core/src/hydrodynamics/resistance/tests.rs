//! Forms of the resistance beside each other.

use super::*;

/// Four spheres, each near another, in a cell.
fn layer() -> (Cell, Vec<Vec2>, Vec<f64>) {
    let cell = Cell::periodic(12.0, 11.0, 1.5).unwrap();
    let centres = [[1.0, 1.0], [3.1, 1.3], [3.9, 3.2], [11.5, 10.2]];
    (cell, centres.map(Vec2::from).to_vec(), vec![1.0; 4])
}

#[test]
fn a_spring_pulls_its_two_spheres_whichever_way_the_resistance_is_held() {
    let (cell, centres, radii) = layer();
    let tables = NearFields::default();
    let ball_melrose = Hydrodynamics::BallMelrose;
    let mut factored = Resistance::new(ball_melrose, &cell, &radii, &tables).unwrap();
    let mut pairwise = Resistance::new_pairwise(ball_melrose, &cell, &radii, &tables, &[]).unwrap();
    let forces: Vec<f64> = (0..12).map(|k| (1.3 * f64::from(k)).sin()).collect();
    factored.assemble(&cell, &centres).unwrap();
    pairwise.assemble(&cell, &centres).unwrap();
    let springs = factored.neighbours().to_vec();
    assert!(springs.len() >= 4, "{}", springs.len());
    for (k, pair) in springs.iter().enumerate() {
        let slope = 50.0 + 10.0 * k as f64;
        factored.add_spring(pair, slope);
        pairwise.add_spring(pair, slope);
    }
    factored.factor().unwrap();
    let (mut rows, mut velocities) = (Vec::new(), vec![0.0; 12]);
    factored.to_rows(&forces, &mut rows);
    factored.solver().solve(&mut rows);
    factored.from_rows(&rows, &mut velocities);
    let mut found = vec![0.0; 12];
    pairwise.pairwise().unwrap().apply(&velocities, &mut found);
    for (force, found) in forces.iter().zip(&found) {
        assert!((force - found).abs() < 1e-12, "{force} {found}");
    }
}
