//! The parameters and choices of a run, declared once in [`PARAMETERS`].
//!
//! Reading, checking and printing of parameters, here and in the programs that use this crate,
//! follow from that table.

mod builder;
mod contact_laws;
mod flow_type;
mod hydrodynamics;
pub(crate) mod parameters;
mod pressure;
mod published_units;
mod segments;
mod settings;
mod sizes;
mod start_layer;
mod surface;

pub use crate::error::Refusal;
pub use crate::law::{
    ColloidUnit, FrictionOnset, Keyword, Keywords, NormalLaw, Quantity, Range, StiffnessUnit,
    TangentialLaw,
};
pub use builder::ParamsBuilder;
pub use contact_laws::{ContactLaws, DEEPEST_OVERLAP};
pub use flow_type::FlowType;
pub use hydrodynamics::{Hydrodynamics, LeadingOrder};
pub use parameters::{Choice, Form, Number, PARAMETERS, Parameter};
pub use pressure::PressureKind;
pub use published_units::PublishedUnits;
pub use segments::{CrossShear, CrossStrain, Imposed, Segment, phase};
pub use settings::SolverSettings;
pub use sizes::{Distribution, Sizes};
pub use start_layer::{StartFrom, StartLayer};
pub use surface::Surface;

use crate::error::Error;
use serde::{Deserialize, Serialize};

/// Contact scheme.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ContactScheme {
    /// Complementarity solved at every stage: gaps stay at the roughness height.
    Rigid,
    /// The paper's steps 1-6.
    Procedure,
    /// Laws chosen individually.
    Laws(ContactLaws),
}

impl From<ContactLaws> for ContactScheme {
    fn from(laws: ContactLaws) -> Self {
        Self::Laws(laws)
    }
}

impl ContactScheme {
    /// Its laws; those of the paper for [`ContactScheme::Rigid`] and [`ContactScheme::Procedure`].
    ///
    /// ```
    /// use sd_core::{ContactLaws, ContactScheme};
    ///
    /// assert_eq!(ContactScheme::Rigid.laws(), &ContactLaws::PAPER);
    /// ```
    pub fn laws(&self) -> &ContactLaws {
        match self {
            Self::Rigid | Self::Procedure => &ContactLaws::PAPER,
            Self::Laws(laws) => laws,
        }
    }

    /// The laws, if chosen individually.
    fn chosen_laws(&mut self) -> Option<&mut ContactLaws> {
        match self {
            Self::Rigid | Self::Procedure => None,
            Self::Laws(laws) => Some(laws),
        }
    }
}

/// Parameters of one run without its seed; their ranges are in [`PARAMETERS`]. Lengths in a, times
/// in inverse shear rates, forces in mu·a²·rate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Number of spheres N.
    pub spheres: usize,
    /// Area fraction c = Σ π a_i² / A; 0 in a suspension.
    pub area_fraction: f64,
    /// Volume fraction φ = Σ (4/3)π a_i³ / V of a suspension; `None` in a layer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume_fraction: Option<f64>,
    /// Roughness height h.
    pub roughness: f64,
    /// Friction coefficient ν.
    pub friction: f64,
    /// Dimensionless shear rate Γ = 6π/F_crit: 0 means friction never acts, ∞ that it always does.
    /// 0 where the stress is imposed.
    #[serde(with = "infinite")]
    pub shear_rate: f64,
    /// Radius of the large spheres over that of the small; 1 is monodisperse.
    #[serde(default = "one")]
    pub size_ratio: f64,
    /// Number of large spheres over all spheres; without meaning at size ratio 1.
    #[serde(default = "half")]
    pub large_fraction: f64,
    /// Sizes other than one or two; the size ratio and the share of large spheres are then without
    /// meaning.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sizes: Option<Sizes>,
    /// Hydrodynamics.
    pub hydrodynamics: Hydrodynamics,
    /// Contact scheme.
    pub contact: ContactScheme,
    /// Time step, in strain, [at rest](Params::at_rest) in the unit of time, and where the
    /// [rate is free](Params::has_free_rate) in mu/σ.
    pub time_step: f64,
    /// Imposed shear stress σ* = σ a²/F_crit, above 0; `None` where the rate is imposed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shear_stress: Option<f64>,
    /// Péclet number Pe = 6π mu a³ rate/kT of Brownian motion; ∞: none. Under an imposed stress σ
    /// 6π a³ σ/kT. In fluid [at rest](Params::at_rest) 0, and the unit of time is then
    /// a²/D0 = 6π mu a³/kT.
    #[serde(
        default = "infinity",
        skip_serializing_if = "is_infinity",
        with = "infinite"
    )]
    pub peclet: f64,
    /// `F_crit a/kT` of Brownian motion, in place of the Péclet number, which is then Γ times this,
    /// under an imposed stress 6π σ* times this; 0: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub thermal_load: f64,
    /// Imposed viscous number J = mu·rate/P, above 0, which imposes the particle pressure P; the
    /// fraction is then that of the start. `None` where the fraction is imposed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscous_number: Option<f64>,
    /// Imposed ratio σ/P of the shear stress and the particle pressure, above 0, in place of the
    /// viscous number: the pressure then follows from the stress, which is imposed or that of the
    /// imposed rate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub macroscopic_friction: Option<f64>,
    /// The normal stress that an imposed pressure is.
    #[serde(default, skip_serializing_if = "is_default")]
    pub pressure: PressureKind,
    /// Type of the imposed flow. Rates are then √(2 E:E), of which strains are the integral.
    #[serde(default, skip_serializing_if = "is_default")]
    pub flow: FlowType,
    /// Sense of the flow: 1, or −1 for the opposite direction.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub direction: f64,
    /// Whether no shear is imposed, and the fluid is at rest but for the spheres. The unit of time
    /// is then free: with forces in units of F0 it is mu·a²/F0. Lengths are in a, the time step is
    /// in that unit and F_crit = 6π/Γ in mu·a² over it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at_rest: bool,
    /// What the run begins with; `None` for the packing that the seed makes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<StartFrom>,
    /// Segments of the run, starting at strain 0; empty for steady shear.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub segments: Vec<Segment>,
}

/// Default of [`Params::size_ratio`].
fn one() -> f64 {
    1.0
}

/// Default of [`Params::peclet`].
fn infinity() -> f64 {
    f64::INFINITY
}

/// Whether there is no Brownian motion.
#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature that serde requires"
)]
fn is_infinity(value: &f64) -> bool {
    *value == f64::INFINITY
}

/// Whether a value is the default, which is omitted so that older cases keep their keys.
#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature that serde requires"
)]
fn is_one(value: &f64) -> bool {
    *value == one()
}

/// Whether a value is the default of its type, which is omitted for the same reason.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Default of [`Params::large_fraction`].
fn half() -> f64 {
    0.5
}

impl Params {
    /// Number of large spheres, of two sizes.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a fraction of n, rounded"
    )]
    pub(crate) fn number_of_large(&self) -> usize {
        if self.size_ratio == 1.0 {
            0
        } else {
            (self.large_fraction * self.spheres as f64).round() as usize
        }
    }

    /// Most spheres of a run or of a configuration.
    pub const MAX_SPHERES: usize = parameters::MAX_SPHERES;
    /// The spheres of a start layer with more than this number are numbered row by row, so that the
    /// factors of its sparse matrices are small.
    pub const LARGE_ABOVE: usize = 1000;

    /// Parameters before any is set: choices under which all numbers are valid, and numbers of NaN.
    pub(crate) const UNSET: Self = Self {
        spheres: 0,
        area_fraction: f64::NAN,
        volume_fraction: None,
        roughness: f64::NAN,
        friction: f64::NAN,
        shear_rate: f64::NAN,
        size_ratio: 1.0,
        large_fraction: 0.5,
        sizes: None,
        hydrodynamics: Hydrodynamics::Lubrication(LeadingOrder::DEFAULT),
        contact: ContactScheme::Laws(ContactLaws::PAPER),
        time_step: f64::NAN,
        shear_stress: None,
        viscous_number: None,
        macroscopic_friction: None,
        pressure: PressureKind::Isotropic,
        flow: FlowType::Shear,
        peclet: f64::INFINITY,
        thermal_load: 0.0,
        direction: 1.0,
        at_rest: false,
        start: None,
        segments: Vec::new(),
    };

    /// The layer of another run or program that the run begins with.
    pub fn given_layer(&self) -> Option<&StartLayer> {
        self.start.as_ref()?.layer()
    }

    /// Whether friction can act in the run: its coefficient is not 0, and it begins with contact or
    /// the rate is not 0.
    pub fn has_friction(&self) -> bool {
        let has_load = self.shear_stress.is_some() || self.shear_rate != 0.0;
        let begins_with_contact = self.contact.laws().onset == FrictionOnset::Contact;
        self.friction != 0.0 && (has_load || begins_with_contact)
    }

    /// Whether a pressure is imposed, by the viscous number or by the ratio of stress and pressure:
    /// the cell then dilates, and the fraction is that of the start.
    pub fn imposes_pressure(&self) -> bool {
        self.viscous_number.is_some() || self.macroscopic_friction.is_some()
    }

    /// Whether a stress is imposed on Brownian spheres: the rate of an instant may then have either
    /// sign, and times are in mu/σ.
    pub fn has_free_rate(&self) -> bool {
        self.shear_stress.is_some() && self.thermal_energy().is_some()
    }

    /// Thermal energy kT of Brownian motion, 6π/Pe in mu·a³·rate, under an imposed stress in a³ σ;
    /// `None` without. In fluid [at rest](Params::at_rest) it is 6π, with the diffusivity D0 of a
    /// sphere as unit.
    ///
    /// ```
    /// # use sd_core::{Hydrodynamics, Params};
    /// let params = Params::builder()
    ///     .spheres(40)
    ///     .area_fraction(0.6)
    ///     .roughness(0.01)
    ///     .friction(0.5)
    ///     .shear_rate(2.0)
    ///     .hydrodynamics(Hydrodynamics::BallMelrose)
    ///     .time_step(0.001)
    ///     .thermal_load(50.0)
    ///     .build()?;
    /// let peclet = 100.0; // Γ F_crit a/kT
    /// assert_eq!(params.thermal_energy(), Some(6.0 * std::f64::consts::PI / peclet));
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn thermal_energy(&self) -> Option<f64> {
        let peclet = if self.thermal_load > 0.0 {
            let of_stress = |stress| 6.0 * std::f64::consts::PI * stress;
            self.shear_stress.map_or(self.shear_rate, of_stress) * self.thermal_load
        } else {
            self.peclet
        };
        let divisor = if self.at_rest { 1.0 } else { peclet };
        peclet
            .is_finite()
            .then(|| 6.0 * std::f64::consts::PI / divisor)
    }

    /// Critical load F_crit = 6π/Γ below which a contact is frictionless, in mu·a²·rate; infinite
    /// at Γ = 0. Under imposed stress it is determined at every stage, and this value is
    /// meaningless.
    ///
    /// ```
    /// # use sd_core::{Hydrodynamics, Params};
    /// # let params = Params::builder()
    /// #     .spheres(40)
    /// #     .area_fraction(0.6)
    /// #     .roughness(0.01)
    /// #     .friction(0.5)
    /// #     .shear_rate(2.0)
    /// #     .hydrodynamics(Hydrodynamics::BallMelrose)
    /// #     .build()?;
    /// assert_eq!(params.critical_load(), 3.0 * std::f64::consts::PI); // Γ = 2
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn critical_load(&self) -> f64 {
        6.0 * std::f64::consts::PI / self.shear_rate.abs()
    }

    /// Whether the spheres are of several sizes.
    pub fn is_mixed(&self) -> bool {
        self.size_ratio > 1.0 || self.sizes.is_some()
    }

    /// Roughness, friction and critical load.
    pub fn surface(&self) -> Surface {
        Surface {
            roughness: self.roughness,
            friction: self.friction,
            critical_load: self.critical_load(),
        }
    }

    /// Checks every value and their consistency.
    ///
    /// # Errors
    /// [`Error::Refused`] names the first value refused and what is allowed.
    ///
    /// ```
    /// use sd_core::Error;
    /// # use sd_core::{Hydrodynamics, Params};
    /// # let params = Params::builder()
    /// #     .spheres(40)
    /// #     .area_fraction(0.6)
    /// #     .roughness(0.01)
    /// #     .friction(0.5)
    /// #     .shear_rate(2.0)
    /// #     .hydrodynamics(Hydrodynamics::BallMelrose)
    /// #     .build()?;
    ///
    /// let changed = Params { roughness: 0.7, ..params };
    /// let Err(Error::Refused(refusal)) = changed.validate() else {
    ///     panic!("a roughness height of 0.7 radii");
    /// };
    /// assert_eq!(refusal.key, "roughness");
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn validate(&self) -> Result<(), Error> {
        Ok(parameters::check(self)?)
    }

    /// Brings the parameters to a canonical form, in which equal physics has equal numbers.
    ///
    /// Values without effect under the other choices get a fixed value, zeros lose their sign,
    /// springs of infinite stiffness are rigid contacts and tangential springs on rigid contacts
    /// are Coulomb's law.
    ///
    /// ```
    /// # use sd_core::{Hydrodynamics, Params};
    /// # let params = Params::builder()
    /// #     .spheres(40)
    /// #     .area_fraction(0.6)
    /// #     .roughness(0.01)
    /// #     .friction(0.5)
    /// #     .shear_rate(2.0)
    /// #     .hydrodynamics(Hydrodynamics::BallMelrose)
    /// #     .build()?;
    ///
    /// // At Γ = 0 friction never acts, so its coefficient has no effect.
    /// let mut plateau = Params { shear_rate: 0.0, ..params };
    /// plateau.canonicalise();
    /// assert_eq!(plateau.friction, 0.0);
    /// # Ok::<(), sd_core::Error>(())
    /// ```
    pub fn canonicalise(&mut self) {
        parameters::canonicalise(self);
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
        reason = "the signature that serde requires"
    )]
    pub(super) fn serialize<S: Serializer>(value: &f64, s: S) -> Result<S::Ok, S::Error> {
        if value.is_infinite() {
            s.serialize_str("inf")
        } else {
            s.serialize_f64(*value)
        }
    }

    /// Reads either form.
    pub(super) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
        match Form::deserialize(d)? {
            Form::Number(value) => Ok(value),
            Form::Text(text) if text == "inf" => Ok(f64::INFINITY),
            Form::Text(text) => Err(serde::de::Error::custom(format!(
                "expected a number or \"inf\", found {text:?}"
            ))),
        }
    }

    /// Infinite numbers of an optional value.
    pub(super) mod optional {
        use serde::{Deserializer, Serializer};

        /// Infinity becomes text.
        #[expect(clippy::ref_option, reason = "the signature that serde requires")]
        pub(in crate::model) fn serialize<S: Serializer>(
            value: &Option<f64>,
            s: S,
        ) -> Result<S::Ok, S::Error> {
            match value {
                Some(value) => super::serialize(value, s),
                None => s.serialize_none(),
            }
        }

        /// Reads either form.
        pub(in crate::model) fn deserialize<'de, D: Deserializer<'de>>(
            d: D,
        ) -> Result<Option<f64>, D::Error> {
            super::deserialize(d).map(Some)
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
            ..Params::UNSET
        }
    }

    #[test]
    fn infinite_shear_rate_survives_json() {
        let text = serde_json::to_string(&params()).unwrap();
        assert_eq!(serde_json::from_str::<Params>(&text).unwrap(), params());
    }

    #[test]
    fn a_step_over_which_contacts_cannot_be_followed_is_refused() {
        let with = |roughness, time_step| Params {
            roughness,
            time_step,
            ..params()
        };
        for (roughness, time_step) in [(0.01, 0.1), (1e-4, 0.02), (1e-6, 0.002)] {
            with(roughness, time_step).validate().unwrap();
        }
        for (roughness, time_step) in [(1e-4, 0.05), (1e-6, 0.005), (1e-3, 0.1)] {
            let error = with(roughness, time_step).validate().unwrap_err();
            assert!(error.to_string().contains("too long"), "{error}");
        }
        let soft = |time_step| Params {
            contact: ContactScheme::Laws(ContactLaws {
                normal: crate::law::NormalLaw::LinearSpring,
                stiffness: 1e4,
                lubrication_gap: 1e-3,
                ..ContactLaws::PAPER
            }),
            shear_rate: 1.0,
            ..with(0.01, time_step)
        };
        soft(0.025).validate().unwrap();
        let error = soft(0.05).validate().unwrap_err();
        assert!(error.to_string().contains("soft contacts"), "{error}");
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
