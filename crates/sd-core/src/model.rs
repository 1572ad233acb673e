//! What decides a run: typed, ranged, validated.

mod contact_laws;

pub use contact_laws::{
    ContactLaws, DEEPEST_OVERLAP, FrictionOnset, LUBRICATION_SHARE, NormalLaw,
    TANGENTIAL_STIFFNESS, TangentialLaw,
};

use crate::contact::Surface;
use crate::contact::rigid::Memory;
use crate::error::Error;
use crate::instant::ContactRequest;
use serde::{Deserialize, Serialize};

/// How the grand resistance matrix is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hydrodynamics {
    /// Far-field mobility of the periodic layer plus near-field pair terms.
    StokesianDynamics,
    /// Isolated drag plus near-field pair terms.
    BallMelrose,
}

/// How touching spheres are kept apart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ContactScheme {
    /// Complementarity solved at every stage: gaps stay at the roughness height.
    Rigid,
    /// The paper's steps 1-6, to the letter.
    Procedure,
    /// Other laws, each chosen by itself.
    Laws(ContactLaws),
}

impl ContactScheme {
    /// Its laws; those of the paper for [`ContactScheme::Rigid`] and [`ContactScheme::Procedure`].
    pub fn laws(&self) -> &ContactLaws {
        match self {
            Self::Rigid | Self::Procedure => &ContactLaws::PAPER,
            Self::Laws(laws) => laws,
        }
    }

    /// The contact problem of a single instant of a run with these parameters: forces look ahead by `time_span`, in strain.
    pub fn request(&self, params: &Params, time_span: f64) -> ContactRequest {
        let surface = params.surface();
        match self {
            Self::Rigid => ContactRequest::Rigid { surface, time_span },
            Self::Procedure => ContactRequest::Procedure { surface },
            Self::Laws(laws) => ContactRequest::Laws {
                laws: laws.in_solver_units(surface),
                lubrication_gap: laws.lubrication_gap,
                time_span,
                springs: Memory::default(),
            },
        }
    }
}

/// Parameters of one run, but for its seed. Lengths in a, times in inverse shear rates, forces in mu·a²·rate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Number of spheres, at least 1.
    pub spheres: usize,
    /// Area fraction c = Σ π a_i² / A, in (0, 0.84].
    pub area_fraction: f64,
    /// Roughness height h, in (0, 0.5).
    pub roughness: f64,
    /// Friction coefficient ν, in [0, 10].
    pub friction: f64,
    /// Dimensionless shear rate Γ = 6π/F_crit, in [0, ∞]: 0 means friction never acts, ∞ that it always does.
    #[serde(with = "infinite")]
    pub shear_rate: f64,
    /// Radius of the large spheres over that of the small, in [1, 10]; 1 is monodisperse.
    #[serde(default = "one")]
    pub size_ratio: f64,
    /// Number of large spheres over all spheres, in [0, 1]; without meaning at size ratio 1.
    #[serde(default = "half")]
    pub large_fraction: f64,
    /// Hydrodynamics.
    pub hydrodynamics: Hydrodynamics,
    /// Contact scheme.
    pub contact: ContactScheme,
    /// Time step in strain, in (0, 0.1].
    pub time_step: f64,
}

/// Default of [`Params::size_ratio`].
fn one() -> f64 {
    1.0
}

/// Default of [`Params::large_fraction`].
fn half() -> f64 {
    0.5
}

impl Params {
    /// Critical load F_crit = 6π/Γ below which a contact is frictionless, in mu·a²·rate; infinite at Γ = 0.
    pub fn critical_load(&self) -> f64 {
        6.0 * std::f64::consts::PI / self.shear_rate.abs()
    }

    /// Roughness, friction and critical load.
    pub fn surface(&self) -> Surface {
        Surface {
            roughness: self.roughness,
            friction: self.friction,
            critical_load: self.critical_load(),
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] names the first field out of range, its value and what is allowed.
    pub fn validate(&self) -> Result<(), Error> {
        let check = |ok: bool, field, value, allowed| {
            if ok {
                Ok(())
            } else {
                Err(Error::OutOfRange {
                    field,
                    value,
                    allowed,
                })
            }
        };
        check(
            self.spheres >= 1,
            "spheres",
            self.spheres as f64,
            "at least 1",
        )?;
        check(
            self.area_fraction > 0.0 && self.area_fraction <= 0.84,
            "area_fraction",
            self.area_fraction,
            "above 0 and at most 0.84",
        )?;
        check(
            self.roughness > 0.0 && self.roughness < 0.5,
            "roughness",
            self.roughness,
            "above 0 and below 0.5",
        )?;
        check(
            (0.0..=10.0).contains(&self.friction),
            "friction",
            self.friction,
            "0 to 10",
        )?;
        check(
            self.shear_rate >= 0.0,
            "shear_rate",
            self.shear_rate,
            "0, positive or inf",
        )?;
        check(
            (1.0..=10.0).contains(&self.size_ratio),
            "size_ratio",
            self.size_ratio,
            "1 to 10",
        )?;
        check(
            (0.0..=1.0).contains(&self.large_fraction),
            "large_fraction",
            self.large_fraction,
            "0 to 1",
        )?;
        check(
            self.time_step > 0.0 && self.time_step <= 0.1,
            "time_step",
            self.time_step,
            "above 0 and at most 0.1",
        )?;
        match &self.contact {
            ContactScheme::Rigid | ContactScheme::Procedure => Ok(()),
            ContactScheme::Laws(laws)
                if laws.is_soft() && (self.shear_rate == 0.0 || self.shear_rate.is_infinite()) =>
            {
                Err(Error::OutOfRange {
                    field: "shear_rate",
                    value: self.shear_rate,
                    allowed: "above 0 and finite under soft laws, whose stiffness is in units of F_crit = 6 pi/shear_rate",
                })
            }
            ContactScheme::Laws(laws) => laws.validate(&self.surface()),
        }
    }
}

/// Infinity as `"inf"`, since JSON has no number for it.
mod infinite {
    use serde::{Deserialize, Deserializer, Serializer};

    /// Either form of the value.
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Form {
        /// Finite, or TOML's `inf`.
        Number(f64),
        /// JSON's `"inf"`.
        Text(String),
    }

    /// Infinity becomes text.
    #[expect(
        clippy::trivially_copy_pass_by_ref,
        reason = "the signature serde asks for"
    )]
    pub(super) fn serialize<S: Serializer>(value: &f64, s: S) -> Result<S::Ok, S::Error> {
        if value.is_infinite() {
            s.serialize_str("inf")
        } else {
            s.serialize_f64(*value)
        }
    }

    /// Either form is read.
    pub(super) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
        match Form::deserialize(d)? {
            Form::Number(value) => Ok(value),
            Form::Text(text) if text == "inf" => Ok(f64::INFINITY),
            Form::Text(text) => Err(serde::de::Error::custom(format!(
                "expected a number or \"inf\", found {text:?}"
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn params() -> Params {
        Params {
            spheres: 90,
            area_fraction: 0.693,
            roughness: 0.01,
            friction: 0.3,
            shear_rate: f64::INFINITY,
            size_ratio: 1.0,
            large_fraction: 0.5,
            hydrodynamics: Hydrodynamics::BallMelrose,
            contact: ContactScheme::Rigid,
            time_step: 0.005,
        }
    }

    #[test]
    fn infinite_shear_rate_survives_json() {
        let text = serde_json::to_string(&params()).unwrap();
        assert_eq!(serde_json::from_str::<Params>(&text).unwrap(), params());
    }

    #[test]
    fn nan_is_refused_everywhere() {
        let nan = f64::NAN;
        for bad in [
            Params {
                area_fraction: nan,
                ..params()
            },
            Params {
                roughness: nan,
                ..params()
            },
            Params {
                friction: nan,
                ..params()
            },
            Params {
                shear_rate: nan,
                ..params()
            },
            Params {
                size_ratio: nan,
                ..params()
            },
            Params {
                large_fraction: nan,
                ..params()
            },
            Params {
                time_step: nan,
                ..params()
            },
        ] {
            assert!(bad.validate().is_err());
        }
        params().validate().unwrap();
    }

    #[test]
    fn plateaus_of_the_critical_load() {
        assert_eq!(params().critical_load(), 0.0);
        let zero = Params {
            shear_rate: 0.0,
            ..params()
        };
        assert_eq!(zero.critical_load(), f64::INFINITY);
    }
}
