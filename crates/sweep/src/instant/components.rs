//! Vectors in JSON: two components in a layer, three in a suspension.

use sd_core::RunSpace;
use sd_core::{Bulk, Layer, VelocityGradient};
use serde::de::{DeserializeOwned, Error, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;

/// A vector of so many components.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Components<const N: usize>(pub [f64; N]);

impl<'de, const N: usize> Deserialize<'de> for Components<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Sequence<const N: usize>;
        impl<'de, const N: usize> Visitor<'de> for Sequence<N> {
            type Value = Components<N>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a vector of {N} components")
            }

            fn visit_seq<A: SeqAccess<'de>>(
                self,
                mut numbers: A,
            ) -> Result<Components<N>, A::Error> {
                let mut all = [0.0; N];
                let mut found = 0;
                for number in &mut all {
                    let Some(next) = numbers.next_element()? else {
                        break;
                    };
                    *number = next;
                    found += 1;
                }
                while found >= N && numbers.next_element::<IgnoredAny>()?.is_some() {
                    found += 1;
                }
                if found == N {
                    return Ok(Components(all));
                }
                let space = if N == 2 { "layer" } else { "suspension" };
                Err(A::Error::custom(format!(
                    "a vector of {found} components, where the first of `centres` has {N} and makes a {space}: give all vectors {N}, or \
                     all of them two for a layer or three for a suspension"
                )))
            }
        }
        deserializer.deserialize_seq(Sequence)
    }
}

/// How many components the first of the centres has, if the input has any.
#[derive(Deserialize)]
pub(super) struct FirstCentre {
    #[serde(default)]
    centres: Vec<Vec<IgnoredAny>>,
}

impl FirstCentre {
    /// Whether the input is a suspension.
    pub(super) fn is_suspended(&self) -> bool {
        self.centres.first().is_some_and(|first| first.len() == 3)
    }
}

/// A number, or in a suspension a vector.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub(crate) enum Amount {
    /// Of a layer.
    Number(f64),
    /// Of a suspension.
    Vector([f64; 3]),
}

impl Amount {
    /// Of one number or of three.
    pub(super) fn of(numbers: &[f64]) -> Self {
        match *numbers {
            [x, y, z] => Self::Vector([x, y, z]),
            _ => Self::Number(numbers[0]),
        }
    }

    /// Its numbers.
    pub(crate) fn numbers(&self) -> &[f64] {
        match self {
            Self::Number(number) => std::slice::from_ref(number),
            Self::Vector(vector) => vector,
        }
    }
}

/// A space whose configurations have a JSON form.
pub trait Written: RunSpace {
    /// A vector.
    type Components: DeserializeOwned + fmt::Debug;
    /// An angular velocity or a torque.
    type Turning: DeserializeOwned + fmt::Debug;
    /// A rate of strain.
    type Rates: DeserializeOwned + fmt::Debug;

    /// The vector.
    fn vector_of(written: Self::Components) -> Self::Vector;

    /// The angular velocity or torque.
    fn spin_of(written: Self::Turning) -> Self::Spin;

    /// The numbers of an angular velocity.
    fn turning(spin: &Self::Spin) -> Vec<f64>;

    /// The flow.
    ///
    /// # Errors
    /// What is wrong with its rate of strain.
    fn flow_of(
        strain: Self::Rates,
        turning: Self::Turning,
    ) -> Result<VelocityGradient<Self>, String>;
}

/// Rate of strain of a layer in JSON.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanarStrain {
    xx: f64,
    yy: f64,
    xy: f64,
}

/// Rate of strain of a suspension in JSON; its trace is zero, whether zz is given or not.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Strain {
    xx: f64,
    yy: f64,
    zz: Option<f64>,
    xy: f64,
    #[serde(default)]
    xz: f64,
    #[serde(default)]
    yz: f64,
}

/// Relative trace that is taken for rounding.
const TRACE_TOLERANCE: f64 = 1e-12;

impl Written for Layer {
    type Components = Components<2>;
    type Turning = f64;
    type Rates = PlanarStrain;

    fn vector_of(Components(written): Components<2>) -> Self::Vector {
        written.into()
    }

    fn spin_of(written: f64) -> f64 {
        written
    }

    fn turning(spin: &f64) -> Vec<f64> {
        vec![*spin]
    }

    fn flow_of(
        PlanarStrain { xx, yy, xy }: PlanarStrain,
        turning: f64,
    ) -> Result<VelocityGradient<Self>, String> {
        Ok(VelocityGradient::from_parts(&[xx, yy, xy], &turning))
    }
}

impl Written for Bulk {
    type Components = Components<3>;
    type Turning = Components<3>;
    type Rates = Strain;

    fn vector_of(Components(written): Components<3>) -> Self::Vector {
        written.into()
    }

    fn spin_of(Components(written): Components<3>) -> Self::Spin {
        written.into()
    }

    fn turning(spin: &Self::Spin) -> Vec<f64> {
        spin.as_slice().to_vec()
    }

    fn flow_of(strain: Strain, turning: Components<3>) -> Result<VelocityGradient<Self>, String> {
        let Strain {
            xx,
            yy,
            zz,
            xy,
            xz,
            yz,
        } = strain;
        let trace = zz.map_or(0.0, |zz| xx + yy + zz);
        if trace.abs() > TRACE_TOLERANCE * (xx.abs() + yy.abs()) {
            return Err(format!(
                "its trace xx + yy + zz is {trace}, must be 0: the fluid is incompressible"
            ));
        }
        let spin = <Self as Written>::spin_of(turning);
        Ok(VelocityGradient::from_parts(&[xx, yy, xy, xz, yz], &spin))
    }
}
