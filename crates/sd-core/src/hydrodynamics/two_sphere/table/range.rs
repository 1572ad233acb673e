//! Near-field terms at any size ratio up to a largest, for spheres of many sizes.
//!
//! ```text
//! f(t) = singular terms + h(t),   t = ln λ,   h interpolated between the nodes ±t_k, t_k = L cos(π (k + ½)/2M), k < M
//! ```
//! The two labellings of a table are h at t_k and at −t_k. The coefficients of the singular terms
//! are known at every λ. h is analytic for
//! |Im t| < π, so that the interpolation converges as `(ρ + √(ρ² + 1))^−2M` with `ρ = π/L`. The evaluated form is a polynomial in ln λ and ln ξ on every cell of a uniform grid.

use super::{
    BLOCK, BLOCKS, INTERVALS, LANES, NODES, NearField, SLIP, SPLIT, cell_of, evaluate,
    fit_intervals, lanes_of, locate, node_xi, positions, singular_lanes,
};
use crate::error::Error;
use crate::hydrodynamics::two_sphere::near_contact::{self, singular, singular_part};
use crate::hydrodynamics::two_sphere::pair_frame;
use crate::hydrodynamics::two_sphere::pair_term::PairTerm;
use crate::hydrodynamics::two_sphere::{Scalars, check_size_ratio};
use crate::linalg::polynomial::{horner, horner_of_two, interpolate};
use crate::linalg::whole;
use std::f64::consts::PI;
use std::sync::Arc;

/// Largest size ratios of the ranges, and their nodes M: within 6e-9 of solutions, tests
/// `range_meets_solutions_at_random_size_ratios_and_gaps` and
/// `range_meets_solutions_at_extreme_size_ratios` (1e-8 asserted).
pub(crate) const RANGES: [(f64, usize); 4] = [(4.0, 10), (12.0, 17), (26.0, 22), (100.0, 28)];
/// Widest cell in ln λ.
const WIDEST: f64 = 0.25;
/// Nodes of a cell in ln λ.
const COARSE: usize = 7;
/// Nodes of a cell in ln λ for the coefficients of the singular terms, which must be exact to
/// rounding.
const FINE: usize = 10;

/// Pair terms of the grand resistance at any gap and any size ratio up to a largest.
///
/// # Accuracy
/// As [`NearField`]: within 1e-8 of solutions, test
/// `range_meets_solutions_at_random_size_ratios_and_gaps`.
///
/// # Cost
/// 0.25 µs per evaluation, ten times that of [`NearField`]. Solving its tables takes 1, 3 and 6 s
/// up to size ratios 4, 12 and 26; combining them 0.1 s; the memory is 4, 7 and 10 MB.
#[derive(Debug)]
pub(crate) struct NearFieldRange {
    cells: Cells,
    /// Coefficients of the singular terms: by cell in ln λ, block, term and power.
    singular: Vec<[[[[f64; BLOCK]; FINE]; 3]; BLOCKS]>,
    /// Coefficients of the regular part: by cell in ln λ and in ln ξ, block, power of ln ξ and of
    /// ln λ.
    regular: Vec<[[[[f64; BLOCK]; COARSE]; NODES]; BLOCKS]>,
}

/// The index of the range of a size ratio ≥ 1.
///
/// # Errors
/// [`Error::OutOfRange`] unless the size ratio is within 0.01..=100.
pub(crate) fn range_of(size_ratio: f64) -> Result<usize, Error> {
    let size_ratio = check_size_ratio(size_ratio)?;
    let found = RANGES
        .iter()
        .position(|(largest, _)| size_ratio <= *largest);
    Ok(found.expect("the last range ends where size ratios do"))
}

/// ln λ at the nodes of a range, all above 0, descending.
fn nodes((largest, count): (f64, usize)) -> impl Iterator<Item = f64> {
    let angle = move |k: usize| PI * (k as f64 + 0.5) / (2 * count) as f64;
    (0..count).map(move |k| largest.ln() * angle(k).cos())
}

/// The weights of the values at the nodes and at their negatives for the value at t, as pairs.
fn weights((largest, count): (f64, usize), t: f64) -> Vec<[f64; 2]> {
    let all = 2 * count;
    let terms: Vec<f64> = (0..all)
        .map(|k| {
            let angle = PI * (k as f64 + 0.5) / all as f64;
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            sign * angle.sin() / (t / largest.ln() - angle.cos())
        })
        .collect();
    let total: f64 = terms.iter().sum();
    (0..count)
        .map(|k| [terms[k] / total, terms[all - 1 - k] / total])
        .collect()
}

/// Power of λ in the drags joined by the `12` of each function, over the scale of the function, in
/// the order of [`Scalars`]: the interpolation uses functions in units of those drags.
const POWERS: [f64; 10] = [0.5, 0.5, 0.5, 1.5, 0.5, 0.5, 1.5, 1.5, 1.5, 1.5];

/// The functions, at the size ratio e^t, in units of the drags that they join.
fn in_drags(values: &mut [f64; 20], t: f64) {
    for (pair, power) in values.chunks_exact_mut(2).zip(POWERS) {
        pair[1] *= (-power * t).exp();
    }
}

/// What is interpolated at a node and at its negative: the functions, without the singular terms
/// where they are split off.
///
/// `beyond`: the solved values of the table in order, of which one is taken where it has no other.
fn remainders<'t>(
    table: &'t NearField,
    beyond: &mut impl Iterator<Item = &'t [Scalars; 2]>,
    interval: usize,
    xi: f64,
) -> [[f64; 20]; 2] {
    let ratio = table.size_ratio;
    let mut both = if xi < near_contact::switch(ratio) {
        table.solved.near_contact.regular(xi)
    } else {
        let values = beyond.next().expect("one value for every node beyond");
        let mut both = values.map(Scalars::to_array);
        if interval < SPLIT {
            for (values, ratio) in both.iter_mut().zip([ratio, 1.0 / ratio]) {
                for (value, known) in values.iter_mut().zip(singular_part(&singular(ratio), xi)) {
                    *value -= known;
                }
            }
        }
        both
    };
    in_drags(&mut both[0], ratio.ln());
    in_drags(&mut both[1], -ratio.ln());
    both
}

/// The positions of cells in ln λ up to a largest size ratio.
#[derive(Debug, Clone, Copy)]
pub(in crate::hydrodynamics::two_sphere) struct Cells {
    count: usize,
    width: f64,
}

impl Cells {
    /// Cells of equal width.
    pub(in crate::hydrodynamics::two_sphere) fn new(largest: f64) -> Self {
        let count = whole((largest.ln() / WIDEST).ceil());
        Self {
            count,
            width: largest.ln() / count as f64,
        }
    }

    /// Coefficients of powers of ln λ on each cell of the polynomials with these values at its
    /// nodes: of a list of functions for the first cell, then for the next.
    pub(in crate::hydrodynamics::two_sphere) fn fit<const N: usize, const L: usize>(
        self,
        mut values: impl FnMut(f64) -> Vec<[f64; L]>,
    ) -> Vec<[[f64; L]; N]> {
        let (nodes, mut powers) = (positions::<N>(), Vec::new());
        for cell in 0..self.count {
            let at_nodes = nodes.map(|node| values(self.width * (cell as f64 + 0.5 + 0.5 * node)));
            powers.extend(
                (0..at_nodes[0].len())
                    .map(|k| interpolate(&nodes, at_nodes.each_ref().map(|values| values[k]))),
            );
        }
        powers
    }

    /// The cell of a size ratio ≥ 1, and the position in it, clamped to the ends.
    #[inline(always)]
    pub(in crate::hydrodynamics::two_sphere) fn locate(self, size_ratio: f64) -> (usize, f64) {
        cell_of(size_ratio.ln() / self.width, self.count)
    }
}

impl NearFieldRange {
    /// The size ratios of its tables, for spheres of size ratios up to `largest`.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] unless the size ratio is within 0.01..=100.
    pub(crate) fn ratios(largest: f64) -> Result<Vec<f64>, Error> {
        Ok(nodes(RANGES[range_of(largest)?]).map(f64::exp).collect())
    }

    /// Combines the tables of [`NearFieldRange::ratios`], in that order.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] unless the size ratio is within 0.01..=100.
    pub(crate) fn new(largest: f64, tables: &[Arc<NearField>]) -> Result<Self, Error> {
        let range = RANGES[range_of(largest)?];
        let cells = Cells::new(range.0);
        let values = values_at_nodes(tables);
        let regular = cells.fit::<COARSE, LANES>(|t| {
            let weights = weights(range, t);
            let fitted = fit_intervals(|interval, node| {
                let values = &values[interval * NODES + node];
                lanes(t, interval, node_xi(interval, node), &weights, values)
            });
            fitted.into_flattened()
        });
        let singular = cells.fit::<FINE, LANES>(|t| singular_lanes(t.exp()).to_vec());
        Ok(Self {
            cells,
            singular: singular.as_chunks().0.iter().map(in_blocks).collect(),
            regular: regular.as_chunks().0.iter().map(in_blocks).collect(),
        })
    }

    /// The term of one pair: as [`NearField::evaluate`], at any size ratio of the range.
    #[inline(always)]
    pub(crate) fn evaluate(&self, radius_i: f64, radius_j: f64, gap: f64) -> PairTerm {
        let ratio = radius_i.max(radius_j) / radius_i.min(radius_j);
        let (cell, y) = self.cells.locate(ratio);
        let regular = &self.regular[cell * INTERVALS..];
        evaluate(
            [radius_i, radius_j],
            gap,
            #[inline(always)]
            |interval, x, block| horner_of_two(&regular[interval][block], x, y),
            #[inline(always)]
            |block| {
                let powers = &self.singular[cell][block];
                powers.each_ref().map(|powers| horner(powers, y))
            },
        )
    }

    /// Resistance to slip of a free pair: as [`NearField::slip_resistance`].
    pub(crate) fn slip_resistance(&self, radius_i: f64, radius_j: f64, gap: f64) -> f64 {
        let logarithm = (2.0 * gap / (radius_i + radius_j)).ln();
        let (interval, x) = locate(logarithm);
        let (cell, y) = self
            .cells
            .locate(radius_i.max(radius_j) / radius_i.min(radius_j));
        let powers = &self.regular[cell * INTERVALS + interval][SLIP / BLOCK];
        let coefficients = powers
            .each_ref()
            .map(|powers| horner(powers, y)[SLIP % BLOCK]);
        radius_i.min(radius_j) * super::with_tail(&coefficients, logarithm, x)
    }
}

/// The lanes of coefficients by block.
fn in_blocks<const A: usize, const B: usize>(
    powers: &[[[f64; LANES]; B]; A],
) -> [[[[f64; BLOCK]; B]; A]; BLOCKS] {
    std::array::from_fn(|block| {
        powers
            .each_ref()
            .map(|powers| powers.each_ref().map(|power| lanes_of(block, power)))
    })
}

/// h at the nodes and at their negatives, by gap and table.
fn values_at_nodes(tables: &[Arc<NearField>]) -> Vec<Vec<[[f64; 20]; 2]>> {
    let mut beyond: Vec<_> = tables
        .iter()
        .map(|table| table.solved.nodes.iter())
        .collect();
    (0..INTERVALS * NODES)
        .map(|gap| {
            let (interval, node) = (gap / NODES, gap % NODES);
            let xi = node_xi(interval, node);
            let tables = tables.iter().zip(&mut beyond);
            tables
                .map(|(table, beyond)| remainders(table, beyond, interval, xi))
                .collect()
        })
        .collect()
}

/// The regular part at a size ratio and a gap, and the slip resistance.
///
/// `weights`, `values`: those at the nodes of the range.
fn lanes(
    t: f64,
    interval: usize,
    xi: f64,
    weights: &[[f64; 2]],
    values: &[[[f64; 20]; 2]],
) -> [f64; LANES] {
    let ratio = t.exp();
    let (radii, mean) = ([1.0, ratio], 0.5 * (1.0 + ratio));
    let mut both = [[0.0; 20]; 2];
    for ([at, opposite], [value, negative]) in weights.iter().zip(values) {
        for k in 0..20 {
            both[0][k] += at * value[k] + opposite * negative[k];
            both[1][k] += at * negative[k] + opposite * value[k];
        }
    }
    in_drags(&mut both[0], -t);
    in_drags(&mut both[1], t);
    let entries = |both: &[[f64; 20]; 2]| {
        let functions = both.each_ref().map(Scalars::from_array);
        pair_frame::resistance_entries(&functions, radii)
    };
    let (rest, far) = (
        entries(&both),
        pair_frame::far_field_entries(radii, mean * (2.0 + xi)),
    );
    if interval < SPLIT {
        for (values, ratio) in both.iter_mut().zip([ratio, 1.0 / ratio]) {
            for (value, known) in values.iter_mut().zip(singular_part(&singular(ratio), xi)) {
                *value += known;
            }
        }
    }
    let mut lanes = [0.0; LANES];
    for (lane, (rest, far)) in lanes.iter_mut().zip(rest.iter().zip(far)) {
        *lane = rest - far;
    }
    lanes[SLIP] = pair_frame::slip_resistance(&entries(&both), radii, mean * xi);
    lanes
}
