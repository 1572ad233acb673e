//! Pressure moments: the trace of the first moment of the traction on each of two spheres, which
//! the pressure of a suspension needs beside the stresslets.
//!
//! ```text
//! T = −∫ x·σ·n dS = a ∫ p dS = 4π a³ p'      p': the pressure of the rest of the flow at the centre
//! T_1 = 4π a_1² [X11P U_1·d + X12P U_2·d] + 4π a_1³ [X11Q d·E_1·d + X12Q d·E_2·d]
//! ```
//! with motions `(U − u∞, −E∞)` as in the resistance, and d from sphere 1 to sphere 2. On a rigid
//! sphere the viscous normal stress has no mean. The own multipoles of a sphere have no mean
//! pressure on it, and the mean of a harmonic function on a sphere is its value at the centre, so
//! that T follows from the multipoles of the other sphere. Only motions along the line of centres
//! and axial strains cause it. Near contact
//!
//! ```text
//! X = g1/ξ + g2 ln(1/ξ) + …
//! ```
//! with g1 that of the force times the radius: the lubrication pressure acts at the end of the line
//! of centres.
//!
//! # Source
//! Jeffrey, Morris & Brady, Phys. Fluids A 5, 2317 (1993), for the moments and the law for the
//! pressure at the centre; g2 from lubrication theory (P) and from solved values (Q).

use super::pair_frame::{axial, far_field_entries};
use super::table::{RANGES, range_of};
use super::{check_size_ratio, ordered, series};
use crate::error::Error;
use crate::linalg::dense::Matrix;
use crate::linalg::lu;
use crate::model::LeadingOrder;
use std::f64::consts::PI;

/// T of i, from `(U_i·n, n·E_i·n, U_j·n, n·E_j·n)` with n from i to j; then T of j from the same.
/// In mu·a² and mu·a³.
pub(crate) type PressureEntries = [f64; 8];

/// Gap over the smaller radius that separates the two forms of a table.
const SWITCH: f64 = 0.2;
/// Range of the gaps fitted near contact, over the smaller radius.
const FITTED: [f64; 2] = [0.015, 0.25];
/// Fitted terms near contact.
const TERMS: usize = 13;
/// Nodes beyond the switch, in the logarithm of the gap.
const NODES: usize = 26;
/// Gap over the smaller radius beyond which moments are those of the far field.
const LAST: f64 = 60.0;
/// Multipoles solved for, over those that give 1e-11.
const EFFORT: f64 = 0.8;
/// Nodes in ln λ of each of the ranges of size ratios.
const RATIOS: [usize; RANGES.len()] = [12, 16, 19, 24];

/// Coefficients of `1/ξ` and `ln(1/ξ)` in `[X11P, X11Q, X12P, X12Q]`, with λ = a2/a1.
fn singular(l: f64) -> [[f64; 4]; 2] {
    let d = 1.0 + l;
    let inverse = 3.0 * l * l / d.powi(3);
    let logarithm = 0.3 / d.powi(3);
    let of_p = logarithm * l * d * (1.0 - 4.0 * l);
    [
        [inverse, inverse, -inverse, l * inverse],
        [
            of_p,
            logarithm * l * (1.0 + 2.0 * l - 9.0 * l * l),
            -of_p,
            logarithm * l * l * (-4.0 + 2.0 * l - 4.0 * l * l),
        ],
    ]
}

/// The entries of functions in both labellings.
fn entries(functions: &[[f64; 4]; 2], radii: [f64; 2]) -> PressureEntries {
    let mut all = [0.0; 8];
    for (one, [p_own, q_own, p_other, q_other]) in functions.iter().enumerate() {
        let a = radii[one];
        let (area, sign) = (4.0 * PI * a * a, if one == 0 { 1.0 } else { -1.0 });
        let (own, other) = (4 * one + 2 * one, 4 * one + 2 * (1 - one));
        all[own] = sign * area * p_own;
        all[own + 1] = area * a * q_own;
        all[other] = sign * area * p_other;
        all[other + 1] = area * a * q_other;
    }
    all
}

/// The entries of the singular terms; the smaller sphere is i, of radius 1.
fn singular_entries(size_ratio: f64) -> [PressureEntries; 2] {
    let both = [size_ratio, 1.0 / size_ratio].map(singular);
    [0, 1].map(|k| entries(&[both[0][k], both[1][k]], [1.0, size_ratio]))
}

/// The pressure of the point forces and stresslets of the far field of two spheres alone, at the
/// centre of the other one.
///
/// ```text
/// p(x) = F·x/(4π r³) + 3 x·S·x/(4π r⁵)
/// ```
fn far_entries(radii: [f64; 2], distance: f64) -> PressureEntries {
    let resistance = far_field_entries(radii, distance);
    let root = 1.5_f64.sqrt();
    let (force, stresslet) = (
        1.0 / (4.0 * PI * distance * distance),
        root / (2.0 * PI * distance.powi(3)),
    );
    let mut all = [0.0; 8];
    for (sphere, radius) in radii.into_iter().enumerate() {
        let other = 1 - sphere;
        // The other sphere is ahead of i and behind j.
        let sign = if sphere == 0 { -1.0 } else { 1.0 };
        for mode in 0..4 {
            let pressure = sign * force * resistance[axial(2 * other, mode)]
                + stresslet * resistance[axial(2 * other + 1, mode)];
            let scale = if mode % 2 == 0 { 1.0 } else { root };
            all[4 * sphere + mode] = 4.0 * PI * radius.powi(3) * scale * pressure;
        }
    }
    all
}

/// The entries of two spheres less those of their far field, at ξ.
fn near_entries(size_ratio: f64, xi: f64) -> PressureEntries {
    let (radii, distance) = ([1.0, size_ratio], 0.5 * (1.0 + size_ratio) * (2.0 + xi));
    let exact = entries(&series::pressure_moments(size_ratio, xi, EFFORT), radii);
    let far = far_entries(radii, distance);
    std::array::from_fn(|k| exact[k] - far[k])
}

/// Adds `factor` times other entries.
fn add(entries: &mut PressureEntries, other: &PressureEntries, factor: f64) {
    for (entry, other) in entries.iter_mut().zip(other) {
        *entry += factor * other;
    }
}

/// The entries of spheres of these radii, of which the smaller one is i and has radius 1.
fn scaled(unit: &PressureEntries, radius_i: f64, radius_j: f64) -> PressureEntries {
    let length = radius_i.min(radius_j);
    std::array::from_fn(|k| {
        let power = if k.is_multiple_of(2) {
            length.powi(2)
        } else {
            length.powi(3)
        };
        if radius_i > radius_j {
            // Exchanging the spheres reverses n.
            let sign = if k.is_multiple_of(2) { -1.0 } else { 1.0 };
            sign * power * unit[(k / 4 * 4 + 4) % 8 + (k + 2) % 4]
        } else {
            power * unit[k]
        }
    })
}

/// `1, x ln x, x, x² ln x, x², …`
fn terms(x: f64) -> [f64; TERMS] {
    let (logarithm, mut power, mut all) = (x.ln(), 1.0, [1.0; TERMS]);
    for pair in all[1..].chunks_exact_mut(2) {
        power *= x;
        pair[0] = power * logarithm;
        pair[1] = power;
    }
    all
}

/// Position in [0, 1] and weight of each of as many Chebyshev points.
fn chebyshev(count: usize) -> Vec<[f64; 2]> {
    let point = |k: usize| {
        let (sine, cosine) = (PI * (k as f64 + 0.5) / count as f64).sin_cos();
        [
            0.5 + 0.5 * cosine,
            if k.is_multiple_of(2) { sine } else { -sine },
        ]
    };
    (0..count).map(point).collect()
}

/// The value at a position in [0, 1] of the polynomial with these values at Chebyshev points.
fn interpolated(
    position: f64,
    points: &[[f64; 2]],
    value: impl Fn(usize) -> PressureEntries,
) -> PressureEntries {
    let (mut sum, mut total) = ([0.0; 8], 0.0);
    for (k, [point, weight]) in points.iter().enumerate() {
        let distance = position - point;
        if distance == 0.0 {
            return value(k);
        }
        let weight = weight / distance;
        total += weight;
        add(&mut sum, &value(k), weight);
    }
    sum.map(|entry| entry / total)
}

/// The pressure entries of a pair less those of its far field, at one size ratio and any gap.
///
/// # Accuracy
/// 5e-7 of the largest entry, test `tables_meet_solutions`.
#[derive(Debug)]
pub(crate) struct PressureTable {
    /// Larger over smaller radius.
    size_ratio: f64,
    singular: [PressureEntries; 2],
    /// Coefficients near contact.
    near: [PressureEntries; TERMS],
    /// Points beyond, in the logarithm of the gap, and values there.
    points: Vec<[f64; 2]>,
    beyond: Vec<PressureEntries>,
}

impl PressureTable {
    /// Solves for the table of one size ratio ≥ 1; takes 10 ms up to 2, and 0.1 s at 10.
    pub(crate) fn new(size_ratio: f64) -> Self {
        let per_gap = 2.0 / (1.0 + size_ratio);
        let singular = singular_entries(size_ratio);
        let mut matrix = Matrix::zeros(TERMS, TERMS);
        let mut values = Matrix::zeros(TERMS, 8);
        for row in 0..TERMS {
            let angle = (row as f64 + 0.5) / TERMS as f64 * PI;
            let [low, high] = FITTED.map(f64::sqrt);
            let y = (low + 0.5 * (1.0 - angle.cos()) * (high - low)).powi(2);
            let xi = y * per_gap;
            let mut regular = near_entries(size_ratio, xi);
            add(&mut regular, &singular[0], -1.0 / xi);
            add(&mut regular, &singular[1], xi.ln());
            for (k, value) in regular.into_iter().enumerate() {
                values[(row, k)] = value;
            }
            for (k, term) in terms(y / FITTED[1]).into_iter().enumerate() {
                matrix[(row, k)] = term;
            }
        }
        lu::solve_once(&mut matrix, &mut values).expect("the fitted terms are independent");
        let points = chebyshev(NODES);
        let at_point = |[position, _]: &[f64; 2]| {
            let y = SWITCH * (position * (LAST / SWITCH).ln()).exp();
            near_entries(size_ratio, y * per_gap)
        };
        Self {
            size_ratio,
            singular,
            near: std::array::from_fn(|row| std::array::from_fn(|k| values[(row, k)])),
            beyond: points.iter().map(at_point).collect(),
            points,
        }
    }

    /// Larger over smaller radius.
    pub(crate) fn size_ratio(&self) -> f64 {
        self.size_ratio
    }

    /// The entries without singular terms, at a gap over the smaller radius.
    fn regular(&self, y: f64) -> PressureEntries {
        if y > LAST {
            return [0.0; 8];
        }
        if y >= SWITCH {
            let position = (y / SWITCH).ln() / (LAST / SWITCH).ln();
            return interpolated(position, &self.points, |k| self.beyond[k]);
        }
        let mut sum = [0.0; 8];
        for (term, coefficients) in terms(y / FITTED[1]).iter().zip(&self.near) {
            add(&mut sum, coefficients, *term);
        }
        sum
    }

    /// The entries at a gap, in a; positive. The ratio of the radii is that of the table or its
    /// inverse.
    pub(crate) fn evaluate(&self, radius_i: f64, radius_j: f64, gap: f64) -> PressureEntries {
        let regular = |y| self.regular(y);
        evaluate(regular, &self.singular, [radius_i, radius_j], gap)
    }
}

/// The entries at a gap from their regular part and the singular terms.
fn evaluate(
    regular: impl Fn(f64) -> PressureEntries,
    singular: &[PressureEntries; 2],
    [a, b]: [f64; 2],
    gap: f64,
) -> PressureEntries {
    let y = gap / a.min(b);
    let mut sum = regular(y);
    if y < SWITCH {
        let xi = 2.0 * gap / (a + b);
        add(&mut sum, &singular[0], 1.0 / xi);
        add(&mut sum, &singular[1], -xi.ln());
    }
    scaled(&sum, a, b)
}

/// As [`PressureTable`], at any size ratio up to a largest.
#[derive(Debug)]
pub(crate) struct PressureRange {
    /// ln of the largest size ratio.
    last: f64,
    /// Points in ln λ over it, and tables there.
    points: Vec<[f64; 2]>,
    tables: Vec<PressureTable>,
}

impl PressureRange {
    /// Solves for its tables; takes 0.1 s up to size ratio 4, and seconds up to 100.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] unless the size ratio is within 0.01..=100.
    pub(crate) fn new(largest: f64) -> Result<Self, Error> {
        let range = range_of(largest)?;
        let (last, points) = (RANGES[range].0.ln(), chebyshev(RATIOS[range]));
        let table = |[position, _]: &[f64; 2]| PressureTable::new((position * last).exp());
        Ok(Self {
            last,
            tables: points.iter().map(table).collect(),
            points,
        })
    }

    /// The entries of spheres of two radii at a gap, in a; positive.
    pub(crate) fn evaluate(&self, radius_i: f64, radius_j: f64, gap: f64) -> PressureEntries {
        let ratio = ordered(radius_i / radius_j).0;
        let position = ratio.ln() / self.last;
        let regular = |y| interpolated(position, &self.points, |k| self.tables[k].regular(y));
        evaluate(regular, &singular_entries(ratio), [radius_i, radius_j], gap)
    }
}

/// The entries of leading-order lubrication at a gap, in a, which may be negative: the force along
/// the line of centres times the radius. See [`super::leading_order`].
pub(crate) fn leading_order_pressure(
    radii: [f64; 2],
    numbers: &LeadingOrder,
    gap: f64,
) -> PressureEntries {
    let xi = 2.0 * gap / (radii[0] + radii[1]);
    if xi >= numbers.cutoff {
        return [0.0; 8];
    }
    let ratio = radii[1] / radii[0];
    let inverse = [ratio, 1.0 / ratio].map(|ratio| singular(ratio)[0]);
    let x = xi.max(0.0) + numbers.regularisation;
    entries(&inverse, radii).map(|entry| entry / x)
}

/// Pressure moments of two spheres in unbounded fluid, `[X11P, X12P]` and `[X11Q, X12Q]`: the trace
/// of the first moment of the traction on sphere 1, times −1, over `4π mu a_1²` from velocity along
/// the line of centres, and over `4π mu a_1³` from axial strain.
///
/// # Arguments
/// - `size_ratio`: `λ = a_2/a_1`, within 0.01..=100.
/// - `s_prime`: `s' = 2r/(a_1 + a_2)`, above 2; below 2.002 solving takes seconds.
///
/// # Accuracy
/// 1e-8, tests `moments_are_those_of_the_traction` and `tables_meet_solutions`.
///
/// # Errors
/// [`Error::OutOfRange`] if an argument is, or is not a number.
///
/// ```
/// use sd_core::two_sphere::pressure_moments;
///
/// // Far apart: the pressure of a point force at the other centre.
/// let [[_, other], _] = pressure_moments(1.0, 100.0)?;
/// assert!((other * 100.0_f64.powi(2) / -1.5 - 1.0).abs() < 0.03);
/// # Ok::<(), sd_core::Error>(())
/// ```
pub fn pressure_moments(size_ratio: f64, s_prime: f64) -> Result<[[f64; 2]; 2], Error> {
    let size_ratio = check_size_ratio(size_ratio)?;
    super::check_s_prime(s_prime)?;
    let [p_own, q_own, p_other, q_other] =
        series::pressure_moments(size_ratio, s_prime - 2.0, 1.0)[0];
    Ok([[p_own, p_other], [q_own, q_other]])
}

#[cfg(test)]
mod tests;
