//! Laws of the normal force that are implemented outside this crate.

use std::fmt::Debug;

/// A law of the normal force `F(d)` of springs, d = h − g, implemented by the user of this crate.
///
/// It takes the place of the listed spring law of a run: stiffness, dashpot, tangential law and
/// onset of friction remain those of its parameters.
///
/// ```
/// use sd_core::law::CustomNormalLaw;
///
/// /// Asperities that are cones: F = k d².
/// #[derive(Debug)]
/// struct Cone;
///
/// impl CustomNormalLaw for Cone {
///     fn force(&self, overlap: f64, stiffness: f64) -> f64 {
///         stiffness * overlap.max(0.0).powi(2)
///     }
///     fn slope(&self, overlap: f64, stiffness: f64) -> f64 {
///         2.0 * stiffness * overlap.max(0.0)
///     }
///     fn overlap(&self, force: f64, stiffness: f64) -> f64 {
///         (force / stiffness).sqrt()
///     }
/// }
/// assert!((Cone.overlap(Cone.force(0.02, 5e3), 5e3) - 0.02).abs() < 1e-15);
/// ```
pub trait CustomNormalLaw: Debug + Sync {
    /// Force at an overlap d in a, of a contact at rest, in mu·a²·rate. It is 0 for d ≤ 0 and never
    /// falls as d grows.
    ///
    /// `stiffness`: the k of the run times its unit of force, in mu·a²·rate per unit of overlap.
    fn force(&self, overlap: f64, stiffness: f64) -> f64;

    /// Slope dF/dd at an overlap d. The contact problem is solved with the tangent of the law,
    /// which is updated until the forces lie on the curve.
    fn slope(&self, overlap: f64, stiffness: f64) -> f64;

    /// Overlap at which the contact has a given force, from 0: the inverse of `force`.
    fn overlap(&self, force: f64, stiffness: f64) -> f64;
}
