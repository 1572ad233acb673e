//! Lattices with known structure, also across the border of the sheared cell; a random gas.

use super::pairs::{ANGLES, Distances, Pairs, pairs};
use super::*;
use rand::{RngExt as _, SeedableRng as _};
use sd_core::cell::{Cell, Lattice};
use sd_core::contact::ContactState;
use sd_core::simulation::StructureSample;
use sd_core::{Bulk, Layer, Space};
use std::f64::consts::PI;

/// All pairs closer than this, in contact, with equal forces and states.
fn touching<S: Space>(
    cell: Cell<S>,
    centres: Vec<S::Vector>,
    nearer_than: f64,
    state: ContactState,
) -> Network<S> {
    let mut found = Vec::new();
    for i in 0..centres.len() {
        for j in i + 1..centres.len() {
            let (separation, _) = cell.nearest(centres[j] - centres[i]);
            if S::norm_squared(&separation) < nearer_than * nearer_than {
                found.push((i, j, 2.0, 0.5, state));
            }
        }
    }
    let radii = vec![1.0; centres.len()];
    Network::new(cell, centres, radii, found)
}

/// A hexagonal layer of spheres that touch: rows along x, as many as fill the cell, which is
/// wrapped with an offset of whole spacings.
fn hexagonal(columns: u32, rows: u32, cells_over: f64) -> Network<Layer> {
    let height = 3.0_f64.sqrt();
    let sides = [2.0 * f64::from(columns), height * f64::from(rows)];
    let cell = Cell::<Layer>::periodic(sides.into(), 2.0 * cells_over).unwrap();
    let places = (0..rows).flat_map(|row| {
        (0..columns).map(move |column| {
            let shift = f64::from(row % 2);
            [2.0 * f64::from(column) + shift, height * f64::from(row)]
        })
    });
    // Shifted, so that the border of the cell cuts spheres.
    let centres = places
        .map(|[x, y]| cell.wrap([x + 0.7, y + 0.3].into()))
        .collect();
    touching(cell, centres, 2.01, ContactState::Sticking)
}

/// The pairs of a network as far as it reaches, and the bins of their distances.
fn own_pairs<S: Space>(network: &Network<S>) -> (Pairs, Distances) {
    let distances = Distances::within(reach(&network.cell));
    (pairs(network, &distances), distances)
}

fn of<S: Space>(network: &Network<S>) -> Structure {
    let mut run = RunStructure::new(network, reach(&network.cell));
    run.add(network, &StructureSample::NONE);
    run.add(network, &StructureSample::NONE);
    Structure::of(&[run.clone(), run]).unwrap()
}

#[test]
fn hexagonal_layer_has_six_contacts_no_preferred_direction_and_is_one_rigid_body() {
    for cells_over in [0.0, 1.0, -3.0] {
        let network = hexagonal(12, 12, cells_over);
        let structure = of(&network);
        assert_eq!((structure.runs, structure.frames), (2, 4));
        let is = |name: &str, wanted: f64| {
            let band = structure.scalar(name).unwrap();
            assert!((band.mean - wanted).abs() < 1e-12, "{name}: {band:?}");
            assert!(band.ci95.unwrap() < 1e-12, "{name}");
        };
        is("coordination", 6.0);
        is("coordination_without_rattlers", 6.0);
        is("rattlers", 0.0);
        is("frictional_coordination", 6.0);
        is("sticking", 1.0);
        is("sliding", 0.0);
        is("largest_cluster", 1.0);
        is("percolating_x", 1.0);
        is("percolating_y", 1.0);
        is("core_fraction", 1.0);
        is("rigid_fraction", 1.0);
        is("largest_rigid_cluster", 1.0);
        // 6 constraints a sphere, of which all but three of 3 a sphere are implied.
        let n = 144.0;
        is(
            "redundant_constraints",
            (6.0 * n - (3.0 * n - 3.0)) / (6.0 * n),
        );
        assert_eq!(structure.scalar("percolating_z"), None);
        assert!(structure.fabric_deviator.unwrap().mean < 1e-12);
        for (a, row) in structure.fabric.iter().enumerate() {
            for (b, band) in row.iter().enumerate() {
                let wanted = if a == b { 0.5 } else { 0.0 };
                assert!((band.unwrap().mean - wanted).abs() < 1e-12);
            }
        }
        // Contacts at 0, 60 and 120 degrees.
        let taken: Vec<usize> = (0..ANGLES)
            .filter(|&k| structure.contact_angle.y[k].unwrap().mean > 0.0)
            .collect();
        let sum: f64 = structure
            .contact_angle
            .y
            .iter()
            .map(|b| b.unwrap().mean)
            .sum();
        assert!((sum - 1.0).abs() < 1e-12);
        assert!(taken.len() <= 6, "{taken:?}");
        assert_eq!(structure.contact_angle, structure.force_angle);
        // All forces are the mean.
        let place = structure
            .normal_force
            .x
            .iter()
            .position(|f| (f - 1.05).abs() < 1e-9);
        let density = structure.normal_force.y[place.unwrap()].unwrap().mean;
        assert!((density - 10.0).abs() < 1e-9, "{density}");
    }
}

#[test]
fn pair_distribution_counts_the_neighbours_of_lattices() {
    // Neighbours within the first shells, by integration of g(r).
    let within = |network: &Network<Layer>, far: f64| {
        let n = network.spheres() as f64;
        let density = (n - 1.0) / network.cell.content().unwrap();
        let (found, distances) = own_pairs(network);
        let shells = distances
            .radial
            .ends()
            .zip(found.radial)
            .filter(|((_, high), _)| *high <= far);
        shells
            .map(|((low, high), g)| g * density * PI * (high * high - low * low))
            .sum::<f64>()
    };
    let network = hexagonal(12, 12, -3.0);
    for (far, neighbours) in [
        (1.9, 0.0),
        (2.1, 6.0),
        (3.5, 12.0),
        (4.1, 18.0),
        (5.4, 30.0),
    ] {
        let found = within(&network, far);
        assert!((found - neighbours).abs() < 1e-9, "{far}: {found}");
    }
    // The first peak is where spheres touch, to 1e-3 a.
    let (found, distances) = own_pairs(&network);
    let peak = found.radial.iter().position(|g| *g > 0.0).unwrap();
    assert!((distances.radial.middles()[peak] - 2.0).abs() < 1e-3);
    // A square layer: 4, 8, 12 neighbours, a core of the same, and directions 0 and 90 degrees.
    let cell = Cell::<Layer>::equal_sides(20.0, 4.0).unwrap();
    let square = (0..10).flat_map(|row| (0..10).map(move |column| (row, column)));
    let centres = square.map(|(row, column)| {
        cell.wrap([2.0 * f64::from(column) + 0.9, 2.0 * f64::from(row) + 0.2].into())
    });
    let square = touching(cell, centres.collect(), 2.01, ContactState::Slipping);
    for (far, neighbours) in [(2.1, 4.0), (2.9, 8.0), (4.1, 12.0)] {
        assert!((within(&square, far) - neighbours).abs() < 1e-9, "{far}");
    }
    let structure = of(&square);
    assert_eq!(structure.scalar("core_fraction").unwrap().mean, 1.0);
    assert_eq!(structure.scalar("sliding").unwrap().mean, 1.0);
    assert_eq!(
        structure.scalar("frictional_coordination").unwrap().mean,
        4.0
    );
    // Contacts that slide are two constraints a sphere, too few for three degrees of freedom.
    assert_eq!(structure.scalar("rigid_fraction").unwrap().mean, 0.0);
}

#[test]
fn a_random_gas_has_no_structure() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    let cell = Cell::<Layer>::equal_sides(30.0, -7.0).unwrap();
    let gases: Vec<RunStructure> = (0..40)
        .map(|_| {
            let centres = (0..200)
                .map(|_| {
                    [
                        random.random_range(0.0..30.0),
                        random.random_range(0.0..30.0),
                    ]
                    .into()
                })
                .collect();
            let gas = Network::<Layer>::new(cell, centres, vec![1.0; 200], []);
            let mut run = RunStructure::new(&gas, reach(&gas.cell));
            run.add(&gas, &StructureSample::NONE);
            run
        })
        .collect();
    let structure = Structure::of(&gases).unwrap();
    // Beyond the fine bins each mean lies within four of its own errors, and most within one
    // interval.
    let far = structure
        .radial
        .x
        .iter()
        .zip(&structure.radial.y)
        .filter(|(r, _)| **r > 2.1);
    let (mut inside, mut all) = (0, 0);
    for (r, band) in far {
        let (mean, ci95) = (band.unwrap().mean, band.unwrap().ci95.unwrap());
        assert!((mean - 1.0).abs() < 2.5 * ci95, "{r}: {mean} ± {ci95}");
        inside += u32::from((mean - 1.0).abs() < ci95);
        all += 1;
    }
    assert!(
        f64::from(inside) > 0.9 * f64::from(all),
        "{inside} of {all}"
    );
    let (_, angles, rows) = &structure.with_angle;
    assert_eq!(angles.len(), ANGLES);
    let outer = rows.last().unwrap();
    let mean = outer.iter().sum::<f64>() / outer.len() as f64;
    assert!((mean - 1.0).abs() < 0.1, "{mean}");
    assert_eq!(structure.scalar("coordination").unwrap().mean, 0.0);
    assert_eq!(structure.scalar("coordination_without_rattlers"), None);
    assert_eq!(structure.fabric_deviator, None);
    assert_eq!(structure.scalar("largest_cluster").unwrap().mean, 0.0);
    let alone = structure.cluster_size.y[0].unwrap().mean;
    assert!((alone - 1.0).abs() < 1e-12);
}

#[test]
fn a_random_gas_has_no_structure_where_its_cell_changes() {
    // Sheared cells that change their size and inclined ones that change their shape, whose sides
    // differ between the runs too.
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(8);
    let mut least = f64::INFINITY;
    let runs: Vec<Vec<Network<Layer>>> = (0..2)
        .map(|run| {
            let mut of_frame = |frame: u32| {
                let side = 20.0 - f64::from(run) - f64::from(frame % 7);
                let skew = 0.1 * f64::from(frame % 4);
                let vectors = [[side, skew * side].into(), [skew * side, side].into()];
                let cell = if frame.is_multiple_of(2) {
                    Cell::equal_sides(side, skew * side).unwrap()
                } else {
                    Lattice::new(&vectors).unwrap().into()
                };
                least = least.min(reach(&cell));
                let vectors = cell.lattice().unwrap().vectors();
                let mut of_axis = |k: usize| vectors[k] * random.random_range(0.0..1.0);
                let centres = (0..150).map(|_| of_axis(0) + of_axis(1)).collect();
                Network::new(cell, centres, vec![1.0; 150], [])
            };
            (0..200).map(&mut of_frame).collect()
        })
        .collect();
    let distances = Distances::within(least);
    // Pairs that are expected in a shell of unit content, in all frames.
    let density = |network: &Network<Layer>| 0.5 * 150.0 * 149.0 / network.cell.content().unwrap();
    let density: f64 = runs.iter().flatten().map(density).sum();
    let sums = runs.iter().map(|frames| {
        let mut sums = RunStructure::new(&frames[0], least);
        for gas in frames {
            sums.add(gas, &StructureSample::NONE);
        }
        sums
    });
    let structure = Structure::of(&sums.collect::<Vec<_>>()).unwrap();
    let is_one = |g: f64, [low, high]: [f64; 2]| {
        let expected = density * PI * (high * high - low * low);
        let error = (g - 1.0) * expected.sqrt();
        assert!(error.abs() < 5.0, "g = {g} from {low} to {high}");
    };
    assert_eq!(structure.radial.y.len(), distances.radial.len());
    for (band, (low, high)) in structure.radial.y.iter().zip(distances.radial.ends()) {
        is_one(band.unwrap().mean, [low, high]);
    }
    // The bins of the angle begin below contact of the smallest sphere.
    let rows = structure.with_angle.2.iter().rev();
    let ends: Vec<_> = distances.with_angle.ends().collect();
    for (row, (low, high)) in rows.zip(ends.into_iter().rev()) {
        is_one(row.iter().sum::<f64>() / ANGLES as f64, [low, high]);
    }
}

#[test]
fn pairs_are_counted_at_their_distance_where_the_cell_changes() {
    let networks = [20.0, 14.0, 17.0].map(|side| {
        let cell = Cell::<Layer>::equal_sides(side, 0.0).unwrap();
        let centres = vec![[1.0, 1.0].into(), [6.03, 1.0].into()];
        Network::<Layer>::new(cell, centres, vec![1.0; 2], [])
    });
    let mut run = RunStructure::new(&networks[0], 7.0);
    for network in &networks {
        run.add(network, &StructureSample::NONE);
    }
    let structure = Structure::of(&[run]).unwrap();
    let (distances, _, rows) = &structure.with_angle;
    assert!(structure.radial.x.last().unwrap() < &7.0 && distances.last().unwrap() < &6.0);
    for (r, g) in structure.radial.x.iter().zip(&structure.radial.y) {
        assert_eq!(g.unwrap().mean > 0.0, (r - 5.03).abs() < 0.01, "{r}");
    }
    for (r, row) in distances.iter().zip(rows) {
        assert_eq!(
            row.iter().any(|g| *g > 0.0),
            (r - 5.03).abs() < 0.025,
            "{r}"
        );
    }
}

#[test]
fn a_simple_cubic_suspension_has_six_contacts_and_percolates_along_all_axes() {
    let cell = Cell::<Bulk>::equal_sides(10.0, 4.0).unwrap();
    let places = (0..125).map(|k| [k % 5, (k / 5) % 5, k / 25].map(|x| 2.0 * f64::from(x) + 0.4));
    let centres: Vec<_> = places.map(|x| cell.wrap(x.into())).collect();
    let network = touching(cell, centres, 2.01, ContactState::Sticking);
    let structure = of(&network);
    for name in [
        "percolating_x",
        "percolating_y",
        "percolating_z",
        "core_fraction",
    ] {
        assert_eq!(structure.scalar(name).unwrap().mean, 1.0, "{name}");
    }
    assert_eq!(structure.scalar("coordination").unwrap().mean, 6.0);
    assert_eq!(structure.scalar("rigid_fraction"), None);
    assert!(structure.fabric_deviator.unwrap().mean < 1e-12);
    let n = 125.0;
    let (found, distances) = own_pairs(&network);
    let shells = distances
        .radial
        .ends()
        .zip(found.radial)
        .filter(|((_, high), _)| *high <= 2.1);
    let density = (n - 1.0) / 1000.0;
    let neighbours: f64 = shells
        .map(|((low, high), g)| g * density * 4.0 / 3.0 * PI * (high.powi(3) - low.powi(3)))
        .sum();
    assert!((neighbours - 6.0).abs() < 1e-9, "{neighbours}");
}

#[test]
fn contacts_along_the_compression_axis_are_at_three_quarters_of_a_half_turn() {
    // Under simple shear u = y the axis of compression runs from upper left to lower right.
    let cell = Cell::<Layer>::equal_sides(20.0, 0.0).unwrap();
    let pair = vec![
        [5.0, 5.0].into(),
        [5.0 - 2.0_f64.sqrt(), 5.0 + 2.0_f64.sqrt()].into(),
    ];
    let structure = of(&touching(cell, pair, 2.01, ContactState::Frictionless));
    let place = (0..ANGLES)
        .find(|&k| structure.contact_angle.y[k].unwrap().mean > 0.5)
        .unwrap();
    let middle = structure.contact_angle.x[place];
    assert!((middle - 0.75 * PI).abs() < PI / 36.0, "{middle}");
    assert!((structure.fabric[0][1].unwrap().mean + 0.5).abs() < 1e-12);
    assert!((structure.fabric_deviator.unwrap().mean - 1.0).abs() < 1e-12);
    assert_eq!(
        structure.scalar("frictional_coordination").unwrap().mean,
        0.0
    );
}

#[test]
fn pair_distributions_begin_below_contact_of_the_smallest_spheres() {
    // Radii 0.75 and 1: pairs at 1.5, 1.75 and 2.
    let cell = Cell::<Layer>::equal_sides(20.0, 0.0).unwrap();
    let centres = [2.0, 3.51, 8.0, 9.76, 14.0, 16.01].map(|x| [x, 5.0].into());
    let radii = vec![0.75, 0.75, 0.75, 1.0, 1.0, 1.0];
    let structure = of(&Network::<Layer>::new(cell, centres.to_vec(), radii, []));
    let (distances, _, rows) = &structure.with_angle;
    assert!((distances[0] - 1.425).abs() < 1e-9, "{}", distances[0]);
    let is_peak = |row: &&Vec<f64>| row.iter().any(|g| *g > 0.0);
    let near = rows.iter().zip(distances).filter(|(_, r)| **r < 2.1);
    assert_eq!(near.filter(|(row, _)| is_peak(row)).count(), 3);
    let radial = structure.radial.x.iter().zip(&structure.radial.y);
    let peaks = radial.filter(|(r, g)| **r < 2.1 && g.unwrap().mean > 0.0);
    let peaks: Vec<f64> = peaks.map(|(r, _)| *r).collect();
    for (found, wanted) in peaks.iter().zip([1.51, 1.76, 2.01]) {
        assert!((found - wanted).abs() <= 0.011, "{peaks:?}");
    }
    assert_eq!(peaks.len(), 3);
    // Equal spheres: from a little below 2.
    let equal = of(&hexagonal(12, 12, 0.0));
    assert!((equal.with_angle.0[0] - 1.925).abs() < 1e-9);
}
