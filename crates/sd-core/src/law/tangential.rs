//! Laws of the tangential force: what resists the sliding and rolling of spheres that touch.
//!
//! ```text
//! |F_t| ≤ ρ(f),   and inside the bound the law halts something: a slip, a spring, a rotation
//! ```
//!
//! f is the load that counts, after the [onset](super::onset) of friction. Without friction (`friction = 0`) none of them acts.

use super::Quantity;

/// What a law brings to rest while its force is inside the bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Halt {
    /// The slip that the two spheres would have by themselves, as if no other sphere were near.
    IsolatedSlip,
    /// The slip of the pair in its layer.
    Slip,
    /// The slip of the pair beyond what a tangential spring gives way.
    SpringSlip,
    /// The slip of the pair, and the rotation of one sphere against the other.
    SlipAndRotation,
}

impl Halt {
    /// How many motions of a pair that is.
    pub fn motions(self) -> usize {
        match self {
            Self::IsolatedSlip | Self::Slip | Self::SpringSlip => 1,
            Self::SlipAndRotation => 2,
        }
    }
}

/// Lists the laws: a line has the name of the law and of its file, which declares all else.
macro_rules! tangential_laws {
    ($($law:ident: $file:ident,)+) => {
        $(pub mod $file;)+

        super::words! {
            /// What resists sliding and rolling of spheres that touch. Without friction (`friction = 0`) none of them acts.
            TangentialLaw {
                $(#[doc = concat!("The law of [`", stringify!($file), "`].")] $law = $file::WORD, $file::MEANING;)+
            }
        }

        impl TangentialLaw {
            /// The parameters it has, by their declarations.
            pub fn parameters(self) -> &'static [&'static Quantity] {
                match self {
                    $(Self::$law => $file::PARAMETERS,)+
                }
            }

            /// What it brings to rest while its force is inside the bound.
            pub fn halts(self) -> Halt {
                match self {
                    $(Self::$law => $file::HALTS,)+
                }
            }

            /// Bound ρ on the tangential force at a load that counts; infinite for laws without one.
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
    /// Whether it has a tangential spring, which needs a spring along the line of centres as well.
    pub fn has_spring(self) -> bool {
        self.halts() == Halt::SpringSlip
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Words;

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
