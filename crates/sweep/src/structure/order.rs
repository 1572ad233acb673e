//! Order of the spheres at an instant: lanes along the flow, and the directions of bonds.
//!
//! ```text
//! layering = max_m |Σ_j exp(2πi m y_j/L)|/N,     m = 2 … L/a
//! Ψ₆ = |Σ_j ψ_j|/N,     ψ_j = Σ_k exp(6iθ_jk)/n_j
//! Q₆ = ((4π/13) Σ_m |Σ_b Y_6m(r_b)|²/n²)^½
//! ```
//! θ is the angle of a bond from the flow, n_j the number of bonds of a sphere and n that of all.
//! A bond joins two spheres with `r < 1.4 (a_i + a_j)`: in a dense hexagonal layer these are the
//! six nearest, and in an fcc or hcp lattice the twelve. A sphere without bonds has ψ = 0.
//!
//! Q₆: P. J. Steinhardt, D. R. Nelson and M. Ronchetti, Phys. Rev. B 28, 784 (1983).

use super::network::Network;
use sd_core::Space;
use std::f64::consts::TAU;

/// Length of the longest bond over the sum of the two radii.
const BOND: f64 = 1.4;
/// Longest period of lanes in the cell is half its side: one period is a density wave.
const FEWEST_LANES: usize = 2;

/// A complex number.
type Complex = [f64; 2];

fn times([a, b]: Complex, [c, d]: Complex) -> Complex {
    [a * c - b * d, a * d + b * c]
}

fn square([a, b]: Complex) -> f64 {
    a * a + b * b
}

/// exp(2πi x).
fn phase(x: f64) -> Complex {
    let (sin, cos) = (TAU * x).sin_cos();
    [cos, sin]
}

/// Lanes along the flow at equal distances in a cell of that side.
pub(super) fn layering<S: Space>(network: &Network<S>, side: f64) -> f64 {
    let most = crate::text::format::count(side.floor());
    let mut sums = vec![[0.0; 2]; most.max(FEWEST_LANES) + 1];
    for x in &network.centres {
        let first = phase(x[1] / side);
        let mut power = first;
        for sum in &mut sums[FEWEST_LANES..] {
            power = times(power, first);
            sum[0] += power[0];
            sum[1] += power[1];
        }
    }
    let largest = sums.into_iter().map(square).fold(0.0, f64::max);
    largest.sqrt() / network.spheres() as f64
}

/// Calls `each` with all bonds: the two spheres, and the unit vector between them.
fn bonds<S: Space>(network: &Network<S>, side: f64, mut each: impl FnMut(usize, usize, S::Vector)) {
    let (centres, radii) = (&network.centres, &network.radii);
    let largest = radii.iter().copied().fold(0.0, f64::max);
    // Rows of the cell along the flow, each at least as high as the longest bond.
    let rows = crate::text::format::count((side / (2.0 * BOND * largest)).floor());
    let rows = if rows < 3 || !network.is_sheared() {
        1
    } else {
        rows
    };
    let mut of_row = vec![Vec::new(); rows];
    for (sphere, x) in centres.iter().enumerate() {
        let row = crate::text::format::count(((x[1] / side).rem_euclid(1.0) * rows as f64).floor());
        of_row[row.min(rows - 1)].push(sphere);
    }
    // Coordinates along the flow in a sheared cell, over its side: most pairs are too far apart in
    // them for a bond and need no nearest image. A sample of 200 spheres takes 0.26 ms in place of
    // 0.35.
    let (coordinates, widest): (Vec<f64>, f64) = match network.cell.lattice() {
        Some(cell) if cell.is_sheared_cell() => {
            let slope = cell.offset() / cell.lengths()[1];
            let along = |x: &S::Vector| ((x[0] - slope * x[1]) / cell.lengths()[0]).rem_euclid(1.0);
            let longest = 2.0 * BOND * largest * (1.0 + slope.abs());
            (
                centres.iter().map(along).collect(),
                longest / cell.lengths()[0],
            )
        }
        _ => (vec![0.0; centres.len()], 1.0),
    };
    let mut visit = |i: usize, j: usize| {
        let apart: f64 = (coordinates[i] - coordinates[j]).abs();
        if apart.min(1.0 - apart) > widest {
            return;
        }
        let (separation, _) = network.cell.nearest(centres[j] - centres[i]);
        let reach = BOND * (radii[i] + radii[j]);
        let distance = S::norm_squared(&separation);
        if distance < reach * reach {
            each(i, j, separation / distance.sqrt());
        }
    };
    for (row, spheres) in of_row.iter().enumerate() {
        for (place, &i) in spheres.iter().enumerate() {
            spheres[place + 1..].iter().for_each(|&j| visit(i, j));
            if rows > 1 {
                of_row[(row + 1) % rows].iter().for_each(|&j| visit(i, j));
            }
        }
    }
}

/// Ψ₆ of a layer.
pub(super) fn psi_6<S: Space>(network: &Network<S>, side: f64) -> f64 {
    let mut of_spheres = vec![([0.0; 2], 0.0); network.spheres()];
    bonds(network, side, |i, j, normal| {
        let second = times([normal[0], normal[1]], [normal[0], normal[1]]);
        let sixth = times(second, times(second, second));
        for sphere in [i, j] {
            let (sum, number) = &mut of_spheres[sphere];
            *number += 1.0;
            // The opposite direction has the same sixth power.
            sum[0] += sixth[0];
            sum[1] += sixth[1];
        }
    });
    let mut total = [0.0; 2];
    for (sum, number) in of_spheres.iter().filter(|(_, number)| *number > 0.0) {
        total[0] += sum[0] / number;
        total[1] += sum[1] / number;
    }
    square(total).sqrt() / network.spheres() as f64
}

/// Q₆ of a suspension; NaN without bonds.
pub(super) fn q_6<S: Space>(network: &Network<S>, side: f64) -> f64 {
    // (4π/13) of the squares of the constants of Y_60 to Y_66, those of m > 0 also for −m.
    const WEIGHTS: [f64; 7] = [
        1.0 / 256.0,
        21.0 / 64.0,
        105.0 / 512.0,
        105.0 / 128.0,
        63.0 / 256.0,
        693.0 / 128.0,
        231.0 / 512.0,
    ];
    let (mut sums, mut number) = ([[0.0; 2]; 7], 0.0_f64);
    bonds(network, side, |_, _, n| {
        number += 1.0;
        let (z, zz) = (n[2], n[2] * n[2]);
        let of_z = [
            ((231.0 * zz - 315.0) * zz + 105.0) * zz - 5.0,
            ((33.0 * zz - 30.0) * zz + 5.0) * z,
            (33.0 * zz - 18.0) * zz + 1.0,
            (11.0 * zz - 3.0) * z,
            11.0 * zz - 1.0,
            z,
            1.0,
        ];
        let mut power = [1.0, 0.0];
        for (sum, of_z) in sums.iter_mut().zip(of_z) {
            sum[0] += of_z * power[0];
            sum[1] += of_z * power[1];
            power = times(power, [n[0], n[1]]);
        }
    });
    let squares = sums.into_iter().map(square).zip(WEIGHTS);
    squares
        .map(|(sum, weight)| weight * sum)
        .sum::<f64>()
        .sqrt()
        / number
}

/// Amplitude of the first harmonic of the number density along an axis of the cell, over the mean.
pub(super) fn concentration<S: Space>(network: &Network<S>, side: f64, axis: usize) -> f64 {
    let phases = network.centres.iter().map(|x| phase(x[axis] / side));
    let sum = phases.fold([0.0; 2], |sum, z| [sum[0] + z[0], sum[1] + z[1]]);
    2.0 * square(sum).sqrt() / network.spheres() as f64
}

/// Amplitude of the first harmonic of the local shear rate along the gradient, over the rate, from
/// velocities along the flow less those of the linear profile.
///
/// ```text
/// (2π/L) (2/N) |Σ_j u′_j exp(2πi y_j/L)|
/// ```
pub(super) fn localisation<S: Space>(
    network: &Network<S>,
    side: f64,
    disturbances: impl Iterator<Item = f64>,
) -> f64 {
    let waves = network.centres.iter().map(|x| phase(x[1] / side));
    let sum = waves.zip(disturbances).fold([0.0; 2], |sum, (z, u)| {
        [sum[0] + u * z[0], sum[1] + u * z[1]]
    });
    TAU / side * 2.0 * square(sum).sqrt() / network.spheres() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use sd_core::cell::Cell;
    use sd_core::{Bulk, Layer};

    fn spheres<S: Space>(cell: Cell<S>, centres: Vec<S::Vector>) -> Network<S> {
        let radii = vec![1.0; centres.len()];
        Network::new(cell, centres, radii, [])
    }

    fn close(found: f64, wanted: f64) {
        assert!((found - wanted).abs() < 1e-9, "{found} and not {wanted}");
    }

    /// Thirty rows along x of 26 spheres in a square cell: a hexagonal lattice, but for a
    /// compression along x by less than 0.1 per cent.
    fn rows() -> (Network<Layer>, f64) {
        let side = 30.0 * 3.0_f64.sqrt();
        let cell = Cell::<Layer>::equal_sides(side, 0.0).unwrap();
        let places = (0..30 * 26).map(|k| {
            let (row, column) = (f64::from(k / 26), f64::from(k % 26));
            let x = side / 26.0 * (column + 0.5 * (row % 2.0));
            cell.wrap([x + 0.3, side / 30.0 * row + 0.9].into())
        });
        (spheres(cell, places.collect()), side)
    }

    #[test]
    fn a_hexagonal_layer_with_rows_along_the_flow_has_full_order_wherever_it_lies() {
        let (network, side) = rows();
        close(layering(&network, side), 1.0);
        assert!(psi_6(&network, side) > 0.999);
        for shift in [0.1, 0.77, 5.3] {
            let moved = network
                .centres
                .iter()
                .map(|x| network.cell.wrap([x[0] - shift, x[1] + 1.7 * shift].into()));
            let moved = spheres(network.cell, moved.collect());
            close(layering(&moved, side), layering(&network, side));
            close(psi_6(&moved, side), psi_6(&network, side));
        }
        // An exact lattice, whose cell need not be square for the directions of bonds.
        let sides = [16.0, 10.0 * 3.0_f64.sqrt()];
        let cell = Cell::<Layer>::periodic(sides.into(), 4.0).unwrap();
        let places = (0..80).map(|k| {
            let (row, column) = (f64::from(k / 8), f64::from(k % 8));
            cell.wrap([2.0 * column + row, 3.0_f64.sqrt() * row].into())
        });
        close(psi_6(&spheres(cell, places.collect()), sides[1]), 1.0);
    }

    #[test]
    fn a_square_layer_has_layers_but_no_hexagonal_order() {
        let cell = Cell::<Layer>::equal_sides(24.0, 0.0).unwrap();
        let places = (0..100).map(|k| [2.4 * f64::from(k % 10), 2.4 * f64::from(k / 10)].into());
        let network = spheres(cell, places.collect());
        close(layering(&network, 24.0), 1.0);
        // Bonds along the axes: sixth powers 1 and −1.
        close(psi_6(&network, 24.0), 0.0);
    }

    /// A cubic lattice with this basis.
    fn cubic(basis: &[[f64; 3]], edge: f64, cells: u32) -> (Network<Bulk>, f64) {
        let side = edge * f64::from(cells);
        let cell = Cell::<Bulk>::equal_sides(side, 0.0).unwrap();
        let mut centres = Vec::new();
        for k in 0..cells.pow(3) {
            let corner = [k % cells, k / cells % cells, k / cells.pow(2)].map(f64::from);
            for place in basis {
                let x: [f64; 3] = std::array::from_fn(|k| edge * (corner[k] + place[k]) + 0.4);
                centres.push(cell.wrap(x.into()));
            }
        }
        (spheres(cell, centres), side)
    }

    #[test]
    fn cubic_lattices_have_the_known_bond_orientation() {
        const FCC: [[f64; 3]; 4] = [[0.0; 3], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]];
        // Nearest neighbours at 2.2 a, the next at 3.11 a, beyond the longest bond.
        let (fcc, side) = cubic(&FCC, 2.2 * 2.0_f64.sqrt(), 3);
        assert!(
            (q_6(&fcc, side) - 0.57452).abs() < 1e-5,
            "{}",
            q_6(&fcc, side)
        );
        let (simple, side) = cubic(&[[0.0; 3]], 2.2, 5);
        assert!(
            (q_6(&simple, side) - 0.35355).abs() < 1e-5,
            "{}",
            q_6(&simple, side)
        );
        // Eight and six neighbours, all within 1.4 of contact.
        let (centred, side) = cubic(&[[0.0; 3], [0.5; 3]], 2.1 * 2.0 / 3.0_f64.sqrt(), 4);
        assert!(
            (q_6(&centred, side) - 0.51069).abs() < 1e-5,
            "{}",
            q_6(&centred, side)
        );
    }

    #[test]
    fn bond_orientation_does_not_depend_on_the_axes() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let cell = Cell::<Bulk>::Unbounded;
        let mut place = || [0; 3].map(|_: i32| random.random_range(0.0..9.0_f64));
        let centres: Vec<[f64; 3]> = (0..60).map(|_| place()).collect();
        let of = |turn: fn([f64; 3]) -> [f64; 3]| {
            let centres = centres.iter().map(|&x| turn(x).into());
            q_6(&spheres(cell, centres.collect()), 1e3)
        };
        let wanted = of(|x| x);
        assert!(wanted > 0.01 && wanted < 0.5);
        close(of(|[x, y, z]| [y, z, x]), wanted);
        close(
            of(|[x, y, z]| [0.6 * x - 0.8 * z, y, 0.8 * x + 0.6 * z]),
            wanted,
        );
        close(of(|[x, y, z]| [-x, y, -z]), wanted);
    }

    #[test]
    fn no_bond_of_a_sheared_cell_is_missed() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        for offset in [-19.0, 0.0, 3.0, 20.0, 33.0] {
            let cell = Cell::<Layer>::equal_sides(40.0, offset).unwrap();
            let mut place = || [0; 2].map(|_: i32| random.random_range(0.0..40.0_f64));
            let centres = (0..300).map(|_| cell.wrap(place().into())).collect();
            let network = spheres(cell, centres);
            let mut found = Vec::new();
            bonds(&network, 40.0, |i, j, _| found.push([i.min(j), i.max(j)]));
            found.sort_unstable();
            let pairs = (0..300).flat_map(|i| (i + 1..300).map(move |j| [i, j]));
            let wanted = pairs.filter(|&[i, j]| {
                let between = network.centres[j] - network.centres[i];
                cell.nearest(between).0.norm() < 2.0 * BOND
            });
            assert_eq!(found, wanted.collect::<Vec<_>>(), "{offset}");
        }
    }

    #[test]
    fn random_spheres_have_little_order() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let (mut lanes, mut bonded) = (Vec::new(), Vec::new());
        let n = 400;
        for _ in 0..50 {
            let cell = Cell::<Layer>::equal_sides(40.0, 7.0).unwrap();
            let mut place = || {
                [0; 2]
                    .map(|_: i32| random.random_range(0.0..40.0_f64))
                    .into()
            };
            let gas = spheres(cell, (0..n).map(|_| place()).collect());
            lanes.push(layering(&gas, 40.0) * f64::from(n).sqrt());
            bonded.push(psi_6(&gas, 40.0) * f64::from(n).sqrt());
        }
        // The largest of 39 moduli whose squares have an exponential distribution of mean 1/N:
        // the square is on average Σ 1/k over k = 1 … 39, 4.25.
        let squares: Vec<f64> = lanes.iter().map(|x| x * x).collect();
        let found = crate::measure::mean(&squares).unwrap();
        assert!((found - 4.25).abs() < 0.6, "{found}");
        assert!(crate::measure::mean(&bonded).unwrap() < 1.0);
    }

    #[test]
    fn waves_of_number_and_shear_rate_have_the_amplitudes_put_in() {
        // A dense row of spheres along y, displaced by a small wave: n(y) = 1 + c cos(2πy/L).
        let side = 20.0;
        let cell = Cell::<Layer>::equal_sides(side, 0.0).unwrap();
        let even = (0..1000).map(|k| side * (f64::from(k) + 0.5) / 1000.0);
        let displaced = even.clone().map(|y| {
            let c = 0.3;
            y - c * side / TAU * (TAU * y / side).sin()
        });
        let network = spheres(cell, displaced.map(|y| [3.0, y].into()).collect());
        // J_1 of the displacement, 0.3 to third order: 2 J_1(0.3) = 0.2966.
        assert!((concentration(&network, side, 1) - 0.2966).abs() < 1e-3);
        let network = spheres(cell, even.clone().map(|y| [3.0, y].into()).collect());
        assert!(concentration(&network, side, 1) < 1e-9);
        // The local rate 1 + 0.4 cos(2πy/L) has this disturbance.
        let wave = even
            .clone()
            .map(|y| 0.4 * side / TAU * (TAU * y / side).sin());
        close(localisation(&network, side, wave), 0.4);
        // All shear in one plane: u′ = −y but for a jump, whose first harmonic is twice the rate.
        let plug = even.map(|y| 0.5 * side - y);
        assert!((localisation(&network, side, plug) - 2.0).abs() < 1e-4);
    }
}
