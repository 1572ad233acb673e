//! How finely waves are sampled: points under a window, and points of the grid for a wave number.

use crate::hydrodynamics::far_field::far_space::FarSpace;
use crate::hydrodynamics::far_field::highest;
use crate::linalg::whole;
use crate::space::cell::Lattice;
use std::f64::consts::PI;

/// Points under a window that may be chosen, the largest first.
const WIDTHS: [usize; 3] = [12, 10, 8];

/// How much larger aliasing errors are in dipole entries of M than in others.
const ALIASING_GAIN: f64 = 200.0;

/// How finely waves are sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::hydrodynamics::far_field) struct Sampling {
    /// Points under a window along each coordinate.
    pub(in crate::hydrodynamics::far_field) width: usize,
    /// Grid points over wave numbers, at least.
    pub(in crate::hydrodynamics::far_field) ratio: f64,
}

impl Sampling {
    /// Grid points along a direction with wave numbers up to `highest`.
    pub(in crate::hydrodynamics::far_field) fn points(&self, highest: usize) -> usize {
        let least = whole((self.ratio * (2 * highest + 1) as f64).ceil());
        regular(least.max(2 * self.width))
    }
}

/// The cheapest sampling of waves up to a cut-off whose errors stay below a tolerance of M, and its
/// cost in an application, in nanoseconds.
///
/// The window leaves exp(−π W √(1 − 1/ratio)) of each wave; derivatives of aliases on the smallest
/// wave vectors weigh about a hundred times more. Test `operator_is_the_dense_mobility`.
pub(in crate::hydrodynamics::far_field) fn sampling<S: FarSpace>(
    lattice: &Lattice<S>,
    spheres: usize,
    cut_off: f64,
    tolerance: f64,
) -> (Sampling, f64) {
    let lengths = lattice.wave_lengths();
    let [of_window, of_point] = S::GRID_COSTS;
    let all = WIDTHS.map(|width| {
        let root = (ALIASING_GAIN / tolerance).ln() / (PI * width as f64);
        let ratio = (1.0 - root * root).max(0.1).recip().max(1.25);
        let sampling = Sampling { width, ratio };
        let points = lengths[..S::DIMENSIONS]
            .iter()
            .map(|&length| sampling.points(highest(length, cut_off)) as f64)
            .product::<f64>();
        let under = width.pow(if S::DIMENSIONS < 3 { 2 } else { 3 }) as f64;
        (
            sampling,
            of_window * under * spheres as f64 + of_point * points,
        )
    });
    all.into_iter()
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or(all[0])
}

/// The least even number, at least `least`, without prime factors above 5.
fn regular(least: usize) -> usize {
    let smooth = |mut n: usize| {
        for factor in [2, 3, 5] {
            while n.is_multiple_of(factor) {
                n /= factor;
            }
        }
        n == 1
    };
    let mut n = least.next_multiple_of(2);
    while !smooth(n) {
        n += 2;
    }
    n
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regular_numbers_are_even_and_smooth() {
        assert_eq!([1, 2, 7, 11, 131].map(regular), [2, 2, 8, 12, 144]);
    }
}
