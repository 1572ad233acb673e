//! Recomputation of known results, to verify a machine and a build within seconds.

mod layers;
mod spheres;
mod suspensions;

use sd_core::Error;
use serde::Serialize;

/// One known result and our value.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub(crate) struct Check {
    /// The quantity.
    pub quantity: String,
    /// Our value.
    pub value: f64,
    /// Smallest value that passes.
    pub least: f64,
    /// Largest value that passes.
    pub most: f64,
    /// Source of the known value.
    pub source: &'static str,
}

impl Check {
    /// Our value against a number, to a tolerance in the same unit.
    fn near(
        quantity: impl Into<String>,
        value: f64,
        known: f64,
        tolerance: f64,
        source: &'static str,
    ) -> Self {
        Self::within(
            quantity,
            value,
            known - tolerance,
            known + tolerance,
            source,
        )
    }

    /// Our value against a range.
    fn within(
        quantity: impl Into<String>,
        value: f64,
        least: f64,
        most: f64,
        source: &'static str,
    ) -> Self {
        Self {
            quantity: quantity.into(),
            value,
            least,
            most,
            source,
        }
    }

    /// Whether our value lies within its range; NaN does not.
    pub(crate) fn passes(&self) -> bool {
        self.value >= self.least && self.value <= self.most
    }
}

/// All checks, in the order of the chain from two spheres to layers and suspensions.
///
/// # Errors
/// A failed computation.
pub(crate) fn checks() -> Result<Vec<Check>, Error> {
    let mut all = Vec::new();
    spheres::resistance_functions(&mut all)?;
    spheres::isolated_sphere(&mut all)?;
    spheres::two_sphere_mobilities(&mut all)?;
    layers::dilute_layer(&mut all)?;
    layers::ewald(&mut all)?;
    layers::frictional_layer(&mut all)?;
    layers::reversibility(&mut all)?;
    suspensions::twisting_pair(&mut all)?;
    suspensions::cubic_lattice(&mut all)?;
    suspensions::frictional_suspension(&mut all)?;
    spheres::figure_8(&mut all)?;
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_known_results_are_met() {
        for check in checks().unwrap() {
            assert!(check.passes(), "{check:?}");
        }
    }

    #[test]
    fn nan_does_not_pass() {
        assert!(!Check::near("x", f64::NAN, 1.0, 1.0, "").passes());
        assert!(!Check::near("x", 2.1, 1.0, 1.0, "").passes());
    }
}
