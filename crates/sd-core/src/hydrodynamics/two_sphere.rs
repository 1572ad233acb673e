//! Two spheres alone in unbounded fluid: resistance functions, the pair matrix, the near-field
//! table.
//!
//! ```text
//! R = R_far + Σ over near pairs of [R2B − R2B∞]
//! ```
//! `R2B` is the exact two-sphere resistance at any gap and size ratio, `R2B∞` the inverse of the
//! pair's far-field mobility.
//!
//! - `series`: the functions at one separation, from coupled multipoles; 1e-11, with rounding 1e-9
//!   at ξ = 1e-3
//! - `near_contact`: singular terms and fitted remainder, for smaller gaps
//! - `leading_order`: the singular terms alone, regularized: leading-order lubrication
//! - `pair_frame`: the 34 independent entries of a pair matrix
//! - `table`: [`NearField`], 25 ns per pair, and of all size ratios `NearFieldRange`, 0.25 µs
//! - `far_pair`: `R2B∞` near contact
//! - `pair_term`: [`PairTerm`], its result in the frame of the layer
//! - `pressure`: the trace of the first moment of the traction, which no stresslet has
//! - `twist`: X^C, which only a suspension needs, in closed form and tabulated
//! - `pair_couplings`: a pair matrix in three dimensions, as the fifteen numbers of each block

mod equal_spheres;
mod far_pair;
mod leading_order;
mod near_contact;
mod pair_couplings;
mod pair_frame;
mod pair_term;
mod pressure;
mod series;
mod table;
mod twist;

pub(crate) use far_pair::FarPair;
pub(crate) use leading_order::LeadingOrderPair;
pub use pair_frame::PairMatrix;
pub use pair_term::PairTerm;
pub use pressure::pressure_moments;
pub(crate) use pressure::{PressureEntries, PressureRange, PressureTable, leading_order_pressure};
pub use table::{NEAR_FIELD_VERSION, NearField};
pub(crate) use table::{NearFieldRange, RANGES, range_of};
pub use twist::twist;
pub(crate) use twist::{TwistRange, TwistTable};

use crate::error::Error;
use near_contact::NearContact;

/// Least ξ at which [`scalars`] solves at any size ratio.
const ALWAYS_SOLVED: f64 = 2e-3;
/// Gap over the smaller radius from which [`scalars`] solves, if ξ is smaller.
const SOLVED: f64 = 1e-2;

/// The resistance functions of the planar problem (all but X^C, see [`twist()`]), each `[11, 12]`,
/// dimensionless.
///
/// Scaled as Kim & Karrila do: A by `6π mu a_1`, B and G by `4π mu a_1²`, C and H by `8π mu a_1³`,
/// M by `(20/3)π mu a_1³`; d points from sphere 1 to sphere 2.
///
/// ```text
/// A_ij = X^A d_i d_j + Y^A (δ_ij − d_i d_j),   T = B U: B_ij = Y^B ε_ijk d_k,   C = X^C dd + Y^C (δ − dd)
/// S~ = G U: X^G (d_i d_j − δ_ij/3) d_k + Y^G (d_i δ_jk + d_j δ_ik − 2 d_i d_j d_k)
/// S~ = H Ω: Y^H (ε_ikl d_l d_j + ε_jkl d_l d_i),   M: X^M axial, Y^M shear, Z^M transverse
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Scalars {
    /// Force along the line of centres from velocity along it; → 1, 0 far apart.
    pub x_a: [f64; 2],
    /// Force across from velocity across; → 1, 0.
    pub y_a: [f64; 2],
    /// Torque from velocity across; → 0.
    pub y_b: [f64; 2],
    /// Torque from angular velocity; → 1, 0.
    pub y_c: [f64; 2],
    /// Axial stresslet from velocity along; → 0.
    pub x_g: [f64; 2],
    /// Shear stresslet from velocity across; → 0.
    pub y_g: [f64; 2],
    /// Shear stresslet from angular velocity; → 0.
    pub y_h: [f64; 2],
    /// Axial stresslet from axial strain; → 1, 0.
    pub x_m: [f64; 2],
    /// Shear stresslet from shear strain; → 1, 0.
    pub y_m: [f64; 2],
    /// Transverse stresslet from transverse strain; → 1, 0.
    pub z_m: [f64; 2],
}

impl Scalars {
    /// All values in the order of the fields.
    pub(crate) fn to_array(self) -> [f64; 20] {
        let mut all = [0.0; 20];
        for (to, from) in all.chunks_exact_mut(2).zip([
            self.x_a, self.y_a, self.y_b, self.y_c, self.x_g, self.y_g, self.y_h, self.x_m,
            self.y_m, self.z_m,
        ]) {
            to.copy_from_slice(&from);
        }
        all
    }

    /// The functions from values in the order of the fields.
    pub(crate) fn from_array(all: &[f64; 20]) -> Self {
        let at = |k: usize| [all[2 * k], all[2 * k + 1]];
        Self {
            x_a: at(0),
            y_a: at(1),
            y_b: at(2),
            y_c: at(3),
            x_g: at(4),
            y_g: at(5),
            y_h: at(6),
            x_m: at(7),
            y_m: at(8),
            z_m: at(9),
        }
    }
}

/// The size ratio as ≥ 1, and whether it was inverted.
fn ordered(size_ratio: f64) -> (f64, bool) {
    if size_ratio < 1.0 {
        (1.0 / size_ratio, true)
    } else {
        (size_ratio, false)
    }
}

/// The size ratio, if it is within range.
pub(crate) fn check_size_ratio(size_ratio: f64) -> Result<f64, Error> {
    if (0.01..=100.0).contains(&size_ratio) {
        Ok(size_ratio)
    } else {
        Err(Error::OutOfRange {
            field: "size_ratio",
            value: size_ratio,
            allowed: "0.01 to 100",
        })
    }
}

/// Refuses a separation of touching spheres, or NaN.
fn check_s_prime(s_prime: f64) -> Result<(), Error> {
    if s_prime > 2.0 && s_prime.is_finite() {
        return Ok(());
    }
    Err(Error::OutOfRange {
        field: "s_prime",
        value: s_prime,
        allowed: "above 2 and finite",
    })
}

/// Both labellings at ξ, in range.
fn both_labellings(size_ratio: f64, xi: f64) -> [Scalars; 2] {
    if xi >= ALWAYS_SOLVED || xi >= SOLVED * near_contact::xi_per_smaller_radius(size_ratio) {
        series::solve(size_ratio, xi, 1.0)
    } else {
        NearContact::solve(size_ratio).evaluate(xi)
    }
}

/// The resistance functions of two spheres in unbounded fluid.
///
/// # Arguments
/// - `size_ratio`: `λ = a_2/a_1`, within 0.01..=100.
/// - `s_prime`: `s' = 2r/(a_1 + a_2)`, above 2.
///
/// # Accuracy
/// 1e-8 relative at s' ≥ 2.002, where it solves at the given separation; below, 1e-8 of the value
/// or of 0.1, whichever is larger. Digits of s' − 2 lost in forming s' are lost. Tests
/// `agrees_with_reference`, `fit_meets_solutions_inside_the_switch`. Costs 0.1 ms at s' = 4, 20 ms
/// at 2.01, up to 0.5 s nearer, and 2 s for very unequal spheres near contact: for many gaps use
/// [`NearField`].
///
/// # Errors
/// [`Error::OutOfRange`] if an argument is, or is not a number.
///
/// # Source
/// Jeffrey & Onishi (1984), Jeffrey (1992), solved instead of expanded; scaled as in [`Scalars`].
///
/// ```
/// use sd_core::two_sphere::scalars;
///
/// // Far apart the force on a sphere is Stokes' drag; near contact it is that of lubrication.
/// assert!((scalars(1.0, 200.0)?.x_a[0] - 1.0).abs() < 1e-3);
/// assert!((scalars(1.0, 2.01)?.x_a[0] / (0.25 / 0.01) - 1.0).abs() < 0.1);
/// # Ok::<(), sd_core::Error>(())
/// ```
pub fn scalars(size_ratio: f64, s_prime: f64) -> Result<Scalars, Error> {
    let size_ratio = check_size_ratio(size_ratio)?;
    check_s_prime(s_prime)?;
    Ok(both_labellings(size_ratio, s_prime - 2.0)[0])
}

/// The exact resistance of two spheres alone, in the frame of their line of centres.
///
/// ```text
/// (F, T, S~) = R2B (U − u∞, Ω − Ω∞, −E∞),   x̂ from i to j
/// ```
///
/// # Arguments
/// - `radius_i`, `radius_j`: in a; their ratio within 0.01..=100.
/// - `distance`: of the centres, in a.
///
/// # Returns
/// The matrix of the modes `(U_x, U_y, Ω, e1, e2, e3)` of i, then of j, in mu·a, mu·a² and mu·a³:
/// symmetric and positive definite.
///
/// # Accuracy
/// As [`scalars`]; for tests and single pairs, not for loops.
///
/// # Errors
/// [`Error::OutOfRange`] for the size ratio, radii that are not positive, or spheres that touch.
///
/// ```
/// use sd_core::two_sphere::two_sphere_resistance;
///
/// let resistance = two_sphere_resistance(1.0, 1.0, 1e3)?;
/// let drag = 6.0 * std::f64::consts::PI;
/// assert!((resistance[(0, 0)] / drag - 1.0).abs() < 1e-4);
/// # Ok::<(), sd_core::Error>(())
/// ```
pub fn two_sphere_resistance(
    radius_i: f64,
    radius_j: f64,
    distance: f64,
) -> Result<PairMatrix, Error> {
    for (field, value) in [("radius_i", radius_i), ("radius_j", radius_j)] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(Error::OutOfRange {
                field,
                value,
                allowed: "positive and finite",
            });
        }
    }
    let gap = distance - radius_i - radius_j;
    if !(gap > 0.0 && gap.is_finite()) {
        return Err(Error::OutOfRange {
            field: "distance",
            value: distance,
            allowed: "above the sum of the radii and finite",
        });
    }
    let size_ratio = check_size_ratio(radius_j / radius_i)?;
    let scalars = both_labellings(size_ratio, 2.0 * gap / (radius_i + radius_j));
    let entries = pair_frame::resistance_entries(&scalars, [radius_i, radius_j]);
    Ok(pair_frame::expand(&entries))
}

#[cfg(test)]
mod tests;
