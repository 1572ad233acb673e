//! Laws of the tangential force, which resists sliding and rolling of touching spheres.
//!
//! ```text
//! |F_t| ≤ ρ(f),   and inside the bound the law constrains a motion: a slip, a spring, a rotation
//! ```
//!
//! f is the effective load, after the [onset](super::onset) of friction. Without friction
//! (`friction = 0`) none of them acts.

use super::Quantity;

/// The motion that a law constrains to zero while its force is inside the bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FrictionConstraint {
    /// The slip of the pair in isolation, without other spheres.
    IsolatedSlip,
    /// The slip of the pair where it is, among other spheres.
    Slip,
    /// The slip of the pair minus the deformation of a tangential spring.
    SpringSlip,
    /// The slip of the pair, and the rotation of one sphere against the other.
    SlipAndRotation,
}

impl FrictionConstraint {
    /// Number of constrained motions of a pair.
    pub fn motions(self) -> usize {
        match self {
            Self::IsolatedSlip | Self::Slip | Self::SpringSlip => 1,
            Self::SlipAndRotation => 2,
        }
    }
}

/// Lists the laws: each line has the name of a law and of its file, which declares the rest.
macro_rules! tangential_laws {
    ($($law:ident: $file:ident,)+) => {
        $(pub mod $file;)+

        super::words! {
            /// Law of the tangential contact force. Without friction (`friction = 0`) none of them
            /// acts.
            #[non_exhaustive]
            TangentialLaw {
                $(#[doc = concat!("The law of [`", stringify!($file), "`].")] $law = $file::KEYWORD, $file::MEANING;)+
            }
        }

        impl TangentialLaw {
            /// The declarations of its parameters.
            pub fn parameters(self) -> &'static [&'static Quantity] {
                match self {
                    $(Self::$law => $file::PARAMETERS,)+
                }
            }

            /// The motion that it constrains to zero while its force is inside the bound.
            pub fn constraint(self) -> FrictionConstraint {
                match self {
                    $(Self::$law => $file::CONSTRAINT,)+
                }
            }

            /// Bound ρ on the tangential force at an effective load; infinite for laws without one.
            pub fn bound(self, friction: f64, load: f64) -> f64 {
                match self {
                    $(Self::$law => $file::bound(friction, load),)+
                }
            }
        }
    };
}

tangential_laws! {
    RollSlip: roll_slip,
    StickSlide: stick_slide,
    Coulomb: coulomb,
    StickRotate: stick_rotate,
}

impl TangentialLaw {
    /// Whether it has a tangential spring, which requires a normal spring too.
    ///
    /// ```
    /// use sd_core::TangentialLaw;
    ///
    /// assert!(TangentialLaw::StickSlide.has_spring());
    /// // The bound of friction at ν = 0.5 under a load of 3.
    /// assert_eq!(TangentialLaw::Coulomb.bound(0.5, 3.0), 1.5);
    /// ```
    pub fn has_spring(self) -> bool {
        self.constraint() == FrictionConstraint::SpringSlip
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Keywords;

    #[test]
    fn bounds_grow_with_the_load_and_are_nothing_without_it() {
        for law in TangentialLaw::ALL {
            assert_eq!(law.bound(0.3, 0.0), 0.0, "{law:?}");
            assert!(law.bound(0.3, 2.0) >= 0.6, "{law:?}");
            assert_eq!(
                law.has_spring(),
                law.parameters()
                    .iter()
                    .any(|quantity| quantity.key == "tangential_stiffness"),
                "{law:?}"
            );
        }
    }
}
