//! Laws of the normal force, the repulsive contact force as a function of the overlap `d = h − g`.
//!
//! ```text
//! F(d) ≥ 0,   F = 0 for d ≤ 0
//! ```

use super::quantity::Range;
use super::{CustomNormalLaw, Quantity};

/// Lists the laws: each line has the name of a law and of its file, which declares the rest.
macro_rules! normal_laws {
    ($($law:ident: $file:ident,)+) => {
        $(pub mod $file;)+

        super::words! {
            /// Law of the normal contact force; d = h − g.
            #[non_exhaustive]
            NormalLaw {
                $(#[doc = concat!("The law of [`", stringify!($file), "`].")] $law = $file::KEYWORD, $file::MEANING;)+
            }
        }

        impl NormalLaw {
            /// The declarations of its parameters.
            pub fn parameters(self) -> &'static [&'static Quantity] {
                match self {
                    $(Self::$law => $file::PARAMETERS,)+
                }
            }

            /// Whether surfaces can touch under it, which friction requires.
            pub fn touches(self) -> bool {
                match self {
                    $(Self::$law => $file::TOUCHES,)+
                }
            }
        }

        impl CustomNormalLaw for NormalLaw {
            fn force(&self, overlap: f64, stiffness: f64) -> f64 {
                match self {
                    $(Self::$law => $file::force(overlap, stiffness),)+
                }
            }

            fn slope(&self, overlap: f64, stiffness: f64) -> f64 {
                match self {
                    $(Self::$law => $file::slope(overlap, stiffness),)+
                }
            }

            fn overlap(&self, force: f64, stiffness: f64) -> f64 {
                match self {
                    $(Self::$law => $file::overlap(force, stiffness),)+
                }
            }
        }
    };
}

normal_laws! {
    Rigid: rigid,
    LinearSpring: linear_spring,
    Hertz: hertz,
    ExponentialRepulsion: exponential_repulsion,
}

impl NormalLaw {
    /// Whether it is a spring, which has a stiffness.
    ///
    /// ```
    /// use sd_core::NormalLaw;
    /// use sd_core::law::CustomNormalLaw;
    ///
    /// assert!(NormalLaw::Hertz.is_spring() && !NormalLaw::Rigid.is_spring());
    /// // An overlap of 0.01 a under k = 1e4 mu·rate.
    /// assert_eq!(NormalLaw::LinearSpring.force(0.01, 1e4), 100.0);
    /// ```
    pub fn is_spring(self) -> bool {
        self.parameters()
            .iter()
            .any(|quantity| quantity.key == STIFFNESS.key)
    }
}

/// Stiffness k of springs, in units chosen by [`super::StiffnessUnit`].
pub static STIFFNESS: Quantity = Quantity {
    key: "stiffness",
    unit: "F/a",
    meaning: "stiffness k of contacts; inf is rigid",
    range: Range::above(0.0),
    note: "in F/a, under `hertz` F/a^(3/2), where F is F_crit, or 6 pi mu a^2 rate if `stiffness_unit` = \"flow\"; inf is rigid",
};

/// Dashpot ζ of springs: the force `−ζ v_n` that is added while the surfaces overlap, and never
/// pulls.
pub static DASHPOT: Quantity = Quantity {
    key: "dashpot",
    unit: "mu a",
    meaning: "dashpot of contacts",
    range: Range::from_to(0.0, 1e6),
    note: "in mu a",
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Keywords;

    #[test]
    fn slope_and_overlap_belong_to_the_force() {
        for law in NormalLaw::ALL.iter().filter(|law| law.is_spring()) {
            assert_eq!(law.force(-0.01, 500.0), 0.0, "{law:?}");
            for d in [1e-4, 0.01, 0.1] {
                let e = 1e-6 * d;
                let difference = (law.force(d + e, 500.0) - law.force(d - e, 500.0)) / (2.0 * e);
                assert!(
                    (law.slope(d, 500.0) / difference - 1.0).abs() < 1e-8,
                    "{law:?}"
                );
                let back = law.overlap(law.force(d, 500.0), 500.0);
                assert!((back / d - 1.0).abs() < 1e-14, "{law:?}");
            }
        }
    }

    #[test]
    fn words_are_those_of_serde() {
        for law in NormalLaw::ALL {
            let written = serde_json::to_value(law).unwrap();
            assert_eq!(written, law.word());
            assert_eq!(serde_json::from_value::<NormalLaw>(written).unwrap(), *law);
        }
        let error = serde_json::from_str::<NormalLaw>("\"soft\"")
            .unwrap_err()
            .to_string();
        assert!(error.contains("hertz"), "{error}");
    }
}
