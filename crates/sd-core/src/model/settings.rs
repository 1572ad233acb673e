//! How exactly a run is computed.

use crate::error::{Error, Refusal};

/// How exactly a run is computed. Published results are those of the defaults, which leave errors
/// of at most 1e-4 of viscosity and forces where the far field is iterated; [`Self::precise`] is
/// for single numbers.
///
/// Results with other settings differ within the errors that these allow; a snapshot continues with
/// the same bits only under the same settings.
///
/// ```
/// use sd_core::model::SolverSettings;
///
/// let mut settings = SolverSettings::default();
/// settings.far_field_residual = 1e-3;
/// settings.validate()?;
///
/// settings.held_share = 2.0;
/// assert_eq!(
///     settings.validate().unwrap_err().to_string(),
///     "held_share = 2 is out of range: 0.5 to 0.999"
/// );
/// # Ok::<(), sd_core::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SolverSettings {
    /// Error of the periodic sums of a dense far field, over the largest entry of the mobility,
    /// 1e-14 to 1e-3; `None` is 1e-8 in a layer and 1e-9 in a suspension.
    pub far_field_tolerance: Option<f64>,
    /// Relative residual of an iterated far field, 1e-7 to 1e-2; 3e-5 by default. Its sums are ten
    /// times as exact.
    pub far_field_residual: f64,
    /// Relative difference between the imposed stress and that of a stage, 1e-12 to 1e-4; 1e-10 by
    /// default.
    pub stress_tolerance: f64,
    /// Rate, over the shear rate, 0.1 to 100, at which the volume shrinks under an imposed pressure
    /// that nothing bears; 5 by default. Mean volumes do not depend on it.
    pub volume_rate: f64,
    /// Share of the roughness height, 0.5 to 0.999, that a gap of rigid contacts keeps: steps in
    /// which it falls below are divided; 0.95 by default.
    pub held_share: f64,
    /// Friction error over the largest force, 1e-6 to 1, above which a stage counts as inexact and
    /// its step is divided; 1e-3 by default.
    pub inexact_friction: f64,
    /// Most bisections of a step, at most 20, in which a gap becomes too small; 6 by default.
    pub halvings: u32,
    /// Most bisections of a step, at most 20, with a stage of inexact friction or without
    /// admissible motion; 2 by default.
    pub halvings_in_doubt: u32,
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self {
            far_field_tolerance: None,
            far_field_residual: 3e-5,
            stress_tolerance: 1e-10,
            volume_rate: 5.0,
            held_share: 0.95,
            inexact_friction: 1e-3,
            halvings: 6,
            halvings_in_doubt: 2,
        }
    }
}

impl SolverSettings {
    /// The defaults, with an iterated far field of a relative residual of 1e-7: for single instants
    /// and products, whose numbers are compared.
    pub fn precise() -> Self {
        Self {
            far_field_residual: 1e-7,
            ..Self::default()
        }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// [`Error::Refused`] names the first value refused and what is allowed.
    pub fn validate(&self) -> Result<(), Error> {
        let least = 1e-14;
        let tolerance = self.far_field_tolerance.unwrap_or(least);
        for (key, value, [low, high]) in [
            ("far_field_tolerance", tolerance, [least, 1e-3]),
            ("far_field_residual", self.far_field_residual, [1e-7, 1e-2]),
            ("stress_tolerance", self.stress_tolerance, [1e-12, 1e-4]),
            ("volume_rate", self.volume_rate, [0.1, 100.0]),
            ("held_share", self.held_share, [0.5, 0.999]),
            ("inexact_friction", self.inexact_friction, [1e-6, 1.0]),
            ("halvings", self.halvings.into(), [0.0, 20.0]),
            (
                "halvings_in_doubt",
                self.halvings_in_doubt.into(),
                [0.0, 20.0],
            ),
        ] {
            if !(low..=high).contains(&value) {
                return Err(Refusal {
                    key,
                    value: value.to_string(),
                    problem: "is out of range".into(),
                    allowed: format!("{low} to {high}"),
                    because: None,
                }
                .into());
            }
        }
        Ok(())
    }
}
