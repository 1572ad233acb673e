//! The near-field table: correction of a pair to the far field, at one size ratio.
//!
//! ```text
//! R2B − R2B∞ = g1/ξ + g2 ln(1/ξ) + g3 ξ ln(1/ξ) + p(ln ξ)
//! ```
//! for each of the 34 entries of the pair frame; p is a polynomial on every interval of a uniform
//! grid in ln ξ. R2B∞ is the inverse of the far-field mobility of the two spheres alone. Beyond ξ =
//! 1 the singular terms are included in p.

mod range;

pub(super) use range::Cells;
pub(crate) use range::{NearFieldRange, RANGES, range_of};

use super::near_contact::{self, NearContact, singular_functions};
use super::pair_frame::{self, ENTRIES, EXCHANGED, LENGTH_POWER};
use super::pair_term::PairTerm;
use super::{Scalars, check_size_ratio, equal_spheres, series};
use crate::error::Error;
use crate::linalg::polynomial::{chebyshev_points, horner, interpolate};
use crate::linalg::whole;
use serde::{Deserialize, Serialize};

/// Version of the stored form; others are refused.
pub const NEAR_FIELD_VERSION: u32 = 1;

/// ln ξ at the lower end of the grid (ξ = 9.2e-9).
const FIRST: f64 = -18.5;
/// Width of an interval.
const WIDTH: f64 = 0.5;
/// Number of intervals; the last ends at ln ξ = 4 (ξ = 54.6).
pub(super) const INTERVALS: usize = 45;
/// ln ξ at the upper end of the grid.
pub(super) const LAST: f64 = FIRST + WIDTH * INTERVALS as f64;
/// Intervals below ξ = 1, in which the singular terms are split off.
const SPLIT: usize = 37;
/// Nodes of an interval; the polynomials have one degree less.
pub(super) const NODES: usize = 8;
/// The entries, the slip resistance, and one unused.
const LANES: usize = ENTRIES + 2;
/// Lanes summed together, few enough to stay in registers.
const BLOCK: usize = 12;
/// Blocks of lanes.
const BLOCKS: usize = LANES / BLOCK;
/// Index of the slip resistance.
const SLIP: usize = ENTRIES;

/// Pair terms of the grand resistance for spheres of one size ratio, at any gap.
///
/// Evaluating allocates nothing.
///
/// # Accuracy
/// Within 1e-9 of [`super::two_sphere_resistance`] at the same gap, relative to each entry or, if
/// larger, the geometric mean of the two isolated drags it joins: tests `table_meets_solutions`
/// (1e-8 asserted). Beyond ξ = 54 the term is zero; it is below 1e-9 of those drags, test
/// `correction_beyond_the_table_is_negligible`.
///
/// # Cost
/// 0.2 µs per evaluation. [`NearField::new`] takes 0.2 s at size ratio 1, 0.3 s at 2, 0.9 s at 10
/// and 5 s at 100; reading a stored table 2 ms.
///
/// ```
/// use sd_core::two_sphere::NearField;
///
/// let table = NearField::equal_spheres();
/// let slip = |gap| table.slip_resistance(1.0, 1.0, gap);
/// assert!(slip(1e-4) > slip(1e-2) && slip(1e-2) > slip(1.0));
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct NearField {
    /// Larger over smaller radius.
    size_ratio: f64,
    /// Its source values.
    solved: Solved,
    /// Coefficients of the singular terms, by block and term.
    singular: [[[f64; BLOCK]; 3]; BLOCKS],
    /// Coefficients by interval, block, and power of the local variable in [−1, 1].
    regular: Vec<[[[f64; BLOCK]; NODES]; BLOCKS]>,
}

/// The solved values.
#[derive(Debug, Clone, PartialEq)]
struct Solved {
    /// All functions at small gaps.
    near_contact: NearContact,
    /// Values at the other nodes, both labellings.
    nodes: Vec<[Scalars; 2]>,
}

/// The stored form: values that take seconds to solve, without those derived in a millisecond.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    /// [`NEAR_FIELD_VERSION`].
    version: u32,
    /// Larger over smaller radius.
    size_ratio: f64,
    /// ξ at which the near-contact variable is 1.
    scale: f64,
    /// Near-contact coefficients: smaller sphere as 1, then the larger; the functions in their
    /// order.
    fitted: Vec<Vec<f64>>,
    /// Values at the nodes: all with the smaller sphere as 1, then all with the larger.
    nodes: Vec<Vec<f64>>,
}

/// ξ at a node of an interval.
pub(super) fn node_xi(interval: usize, node: usize) -> f64 {
    (FIRST + WIDTH * (interval as f64 + 0.5 + 0.5 * node_position(node))).exp()
}

/// A Chebyshev node of [−1, 1] among [`NODES`], ascending.
fn node_position(node: usize) -> f64 {
    positions::<NODES>()[node]
}

/// Chebyshev nodes of [−1, 1], ascending.
fn positions<const N: usize>() -> [f64; N] {
    chebyshev_points().map(|point: f64| -point)
}

/// All nodes with solved values, at a size ratio ≥ 1.
fn solved_nodes(size_ratio: f64) -> impl Iterator<Item = (usize, usize)> {
    let least = near_contact::switch(size_ratio);
    (0..INTERVALS)
        .flat_map(|interval| (0..NODES).map(move |node| (interval, node)))
        .filter(move |&(interval, node)| node_xi(interval, node) >= least)
}

/// The interval of `ln ξ` and the position in it, clamped to the ends.
#[inline(always)]
pub(super) fn locate(logarithm: f64) -> (usize, f64) {
    cell_of((logarithm - FIRST) / WIDTH, INTERVALS)
}

/// The cell at a number of cells from the first one, and the position in it, clamped to the ends.
#[inline(always)]
fn cell_of(cells: f64, count: usize) -> (usize, f64) {
    let cells = cells.clamp(0.0, count as f64);
    let cell = whole(cells).min(count - 1);
    (cell, 2.0 * (cells - cell as f64) - 1.0)
}

/// Coefficients of powers on each interval of the polynomials with these values at its nodes.
pub(super) fn fit_intervals<const L: usize>(
    mut values: impl FnMut(usize, usize) -> [f64; L],
) -> Vec<[[f64; L]; NODES]> {
    let fit = |interval| {
        let values = std::array::from_fn(|node| values(interval, node));
        interpolate(&positions(), values)
    };
    (0..INTERVALS).map(fit).collect()
}

/// The lanes of one block.
fn lanes_of(block: usize, lanes: &[f64; LANES]) -> [f64; BLOCK] {
    std::array::from_fn(|lane| lanes[block * BLOCK + lane])
}

/// The coefficients of the singular terms; the smaller sphere is i, of radius 1.
fn singular_lanes(size_ratio: f64) -> [[f64; LANES]; 3] {
    let both = [size_ratio, 1.0 / size_ratio].map(near_contact::singular);
    std::array::from_fn(|k| {
        let entries = pair_frame::resistance_entries(&[both[0][k], both[1][k]], [1.0, size_ratio]);
        let mut lanes = [0.0; LANES];
        lanes[..ENTRIES].copy_from_slice(&entries);
        lanes
    })
}

/// The term of a pair, summed block by block.
///
/// `regular`: p of a block at a position in an interval; `singular`: g1, g2 and g3 of a block.
#[inline(always)]
fn evaluate(
    [radius_i, radius_j]: [f64; 2],
    gap: f64,
    regular: impl Fn(usize, f64, usize) -> [f64; BLOCK],
    singular: impl Fn(usize) -> [[f64; BLOCK]; 3],
) -> PairTerm {
    let xi = 2.0 * gap / (radius_i + radius_j);
    let logarithm = xi.ln();
    if logarithm > LAST {
        return PairTerm::new(&[0.0; ENTRIES]);
    }
    let (interval, x) = locate(logarithm);
    let mut sums = [0.0_f64; LANES];
    for block in 0..BLOCKS {
        let mut sum = regular(interval, x, block);
        if interval < SPLIT {
            let functions = [1.0 / xi, -logarithm, -xi * logarithm];
            for (g, f) in singular(block).iter().zip(functions) {
                for lane in 0..BLOCK {
                    sum[lane] = g[lane].mul_add(f, sum[lane]);
                }
            }
        }
        sums[block * BLOCK..(block + 1) * BLOCK].copy_from_slice(&sum);
    }
    scaled(&sums, radius_i, radius_j)
}

/// The term with these entries of the smaller sphere as i and of radius 1, for spheres of these
/// radii.
#[inline(always)]
pub(super) fn scaled(sums: &[f64], radius_i: f64, radius_j: f64) -> PairTerm {
    let mut entries = [0.0; ENTRIES];
    let length = radius_i.min(radius_j);
    let scales = [length, length * length, length * length * length];
    if radius_i > radius_j {
        for (k, entry) in entries.iter_mut().enumerate() {
            let (from, sign) = EXCHANGED[k];
            *entry = sign * scales[LENGTH_POWER[k]] * sums[from];
        }
    } else if length.to_bits() == 1.0_f64.to_bits() {
        entries.copy_from_slice(&sums[..ENTRIES]);
    } else {
        for (k, entry) in entries.iter_mut().enumerate() {
            *entry = scales[LENGTH_POWER[k]] * sums[k];
        }
    }
    PairTerm::new(&entries)
}

/// The value of a polynomial at the position x of an interval of ln ξ; below the grid it is
/// continued linearly.
fn with_tail(powers: &[f64; NODES], logarithm: f64, x: f64) -> f64 {
    let (mut sum, mut slope) = (0.0, 0.0);
    for power in powers.iter().rev() {
        slope = slope * x + sum;
        sum = sum * x + power;
    }
    let below = (logarithm - FIRST).min(0.0) * 2.0 / WIDTH;
    sum + slope * below
}

impl NearField {
    /// Solves for the table of one size ratio; λ and 1/λ give the same table.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] unless the size ratio is within 0.01..=100.
    pub fn new(size_ratio: f64) -> Result<Self, Error> {
        let ratio = super::ordered(check_size_ratio(size_ratio)?).0;
        let solved = Solved {
            near_contact: NearContact::solve(ratio),
            nodes: solved_nodes(ratio)
                .map(|(interval, node)| series::solve(ratio, node_xi(interval, node), 1.0))
                .collect(),
        };
        Ok(Self::assemble(ratio, solved))
    }

    /// The table of equal spheres, from constants in this crate; takes 1 ms.
    #[expect(
        clippy::missing_panics_doc,
        reason = "the constants are complete, as tests verify"
    )]
    pub fn equal_spheres() -> Self {
        let twice = |rows: &[[f64; 20]]| [rows, rows].concat();
        Self::from_values(
            1.0,
            equal_spheres::SCALE,
            twice(&equal_spheres::FITTED),
            &twice(&equal_spheres::NODES),
        )
        .expect("the constants are complete")
    }

    /// The table from its stored form; `None` if the number of values is wrong.
    fn from_values(
        size_ratio: f64,
        scale: f64,
        fitted: Vec<[f64; 20]>,
        nodes: &[[f64; 20]],
    ) -> Option<Self> {
        let near_contact = NearContact::from_fitted(size_ratio, scale, fitted)?;
        let count = solved_nodes(size_ratio).count();
        if nodes.len() != 2 * count {
            return None;
        }
        let nodes = (0..count)
            .map(|k| [&nodes[k], &nodes[k + count]].map(Scalars::from_array))
            .collect();
        Some(Self::assemble(
            size_ratio,
            Solved {
                near_contact,
                nodes,
            },
        ))
    }

    /// Computes the polynomials; the smaller sphere is i, of radius 1.
    fn assemble(size_ratio: f64, solved: Solved) -> Self {
        let radii = [1.0, size_ratio];
        let mean = 0.5 * (1.0 + size_ratio);
        let singular = singular_lanes(size_ratio);
        let mut beyond = solved.nodes.iter();
        let least = near_contact::switch(size_ratio);
        let fitted = fit_intervals::<LANES>(|interval, node| {
            let xi = node_xi(interval, node);
            let scalars = if xi < least {
                solved.near_contact.evaluate(xi)
            } else {
                *beyond.next().expect("one value for every node beyond")
            };
            let resistance = pair_frame::resistance_entries(&scalars, radii);
            let far = pair_frame::far_field_entries(radii, mean * (2.0 + xi));
            let functions = if interval < SPLIT {
                singular_functions(xi)
            } else {
                [0.0; 3]
            };
            let mut values = [0.0; LANES];
            for lane in 0..ENTRIES {
                let known: f64 = (0..3).map(|k| singular[k][lane] * functions[k]).sum();
                values[lane] = resistance[lane] - known - far[lane];
            }
            values[SLIP] = pair_frame::slip_resistance(&resistance, radii, mean * xi);
            values
        });
        let in_blocks = |powers: [[f64; LANES]; NODES]| {
            std::array::from_fn(|block| powers.each_ref().map(|power| lanes_of(block, power)))
        };
        Self {
            size_ratio,
            solved,
            singular: std::array::from_fn(|block| {
                singular.each_ref().map(|lanes| lanes_of(block, lanes))
            }),
            regular: fitted.into_iter().map(in_blocks).collect(),
        }
    }

    /// Larger over smaller radius.
    pub fn size_ratio(&self) -> f64 {
        self.size_ratio
    }

    /// The term of one pair.
    ///
    /// # Arguments
    /// - `radius_i`, `radius_j`: in a; their ratio is that of the table or its inverse.
    /// - `gap`: surface to surface, in a; positive. Below ξ = 1e-8 the regular part is that of
    ///   1e-8.
    #[inline(always)]
    pub fn evaluate(&self, radius_i: f64, radius_j: f64, gap: f64) -> PairTerm {
        evaluate(
            [radius_i, radius_j],
            gap,
            #[inline(always)]
            |interval, x, block| horner(&self.regular[interval][block], x),
            #[inline(always)]
            |block| self.singular[block],
        )
    }

    /// Resistance K to slip at the contact of a free pair, from the whole two-sphere resistance.
    ///
    /// ```text
    /// F_t = K u_t,   u_t = t·(U_j − U_i) − (l_i Ω_i + l_j Ω_j),   l = a + g/2
    /// ```
    /// for friction `F_t t` on i, `−F_t t` on j, torques `l F_t` on both, and no strain.
    ///
    /// # Arguments
    /// As for [`NearField::evaluate`].
    ///
    /// # Returns
    /// K in mu·a, positive; below ξ = 1e-8 continued linearly in `ln ξ`, beyond 54 constant.
    pub fn slip_resistance(&self, radius_i: f64, radius_j: f64, gap: f64) -> f64 {
        let logarithm = (2.0 * gap / (radius_i + radius_j)).ln();
        let (interval, x) = locate(logarithm);
        let powers = self.regular[interval][SLIP / BLOCK].map(|power| power[SLIP % BLOCK]);
        radius_i.min(radius_j) * with_tail(&powers, logarithm, x)
    }
}

impl From<NearField> for Stored {
    fn from(table: NearField) -> Self {
        let nodes = &table.solved.nodes;
        Self {
            version: NEAR_FIELD_VERSION,
            size_ratio: table.size_ratio,
            scale: table.solved.near_contact.scale(),
            fitted: table
                .solved
                .near_contact
                .fitted()
                .iter()
                .map(|row| row.to_vec())
                .collect(),
            nodes: (0..2)
                .flat_map(|label| {
                    nodes
                        .iter()
                        .map(move |both| both[label].to_array().to_vec())
                })
                .collect(),
        }
    }
}

impl TryFrom<Stored> for NearField {
    type Error = &'static str;

    fn try_from(stored: Stored) -> Result<Self, Self::Error> {
        if stored.version != NEAR_FIELD_VERSION {
            return Err("near-field table of another version");
        }
        if !(1.0..=100.0).contains(&stored.size_ratio) {
            return Err("near-field table of a size ratio out of range");
        }
        let rows = |rows: Vec<Vec<f64>>| -> Result<Vec<[f64; 20]>, &'static str> {
            rows.into_iter()
                .map(|row| {
                    row.try_into()
                        .map_err(|_| "near-field table with a torn row")
                })
                .collect()
        };
        Self::from_values(
            stored.size_ratio,
            stored.scale,
            rows(stored.fitted)?,
            &rows(stored.nodes)?,
        )
        .ok_or("near-field table with missing rows")
    }
}
