//! The type of the imposed flow: its velocity gradient but for rate and direction.

use crate::error::Refusal;
use crate::law::Keyword;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Type of a homogeneous flow.
///
/// ```text
/// shear              u = (y, 0, 0)
/// planar extension   u = (x, −y, 0)
/// uniaxial           u = (x, −y/2, −z/2)
/// biaxial            u = (x/2, y/2, −z)
/// mixture k          u = (y + k x, −k y, 0)
/// ```
/// times the number that gives it the rate √(2 E:E) that is imposed. As text a mixture is
/// `mixture k`.
///
/// ```
/// use sd_core::model::FlowType;
///
/// assert_eq!("planar-extension".parse::<FlowType>()?, FlowType::PlanarExtension);
/// assert_eq!(FlowType::mixture(2.0, 1.0)?, "mixture 0.5".parse()?);
/// # Ok::<(), sd_core::model::Refusal>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub enum FlowType {
    /// Simple shear along x, with the gradient along y.
    #[default]
    Shear,
    /// Stretched along x, compressed along y.
    PlanarExtension,
    /// Stretched along x, compressed alike along y and z; in suspensions.
    Uniaxial,
    /// Stretched alike along x and y, compressed along z; in suspensions.
    Biaxial,
    /// Shear and planar extension at once: the rate of extension over the shear rate, above 0.
    Mixture(f64),
}

/// Keywords of the types.
const KEYWORDS: [Keyword; 5] = [
    Keyword {
        word: "shear",
        meaning: "simple shear along x, with the gradient along y",
    },
    Keyword {
        word: "planar-extension",
        meaning: "stretched along x, compressed along y",
    },
    Keyword {
        word: "uniaxial",
        meaning: "stretched along x, compressed alike along y and z; in suspensions",
    },
    Keyword {
        word: "biaxial",
        meaning: "stretched alike along x and y, compressed along z; in suspensions",
    },
    Keyword {
        word: "mixture",
        meaning: "shear and planar extension at once: `{ shear = 1.0, extension = 0.5 }`",
    },
];

/// What is allowed.
const ALLOWED: &str = "\"shear\", \"planar-extension\", in suspensions \"uniaxial\" or \"biaxial\", or a mixture such as \
                       { shear = 1.0, extension = 0.5 }";

impl FlowType {
    /// All types but mixtures, in the order of their keywords.
    const SINGLE: [Self; 4] = [
        Self::Shear,
        Self::PlanarExtension,
        Self::Uniaxial,
        Self::Biaxial,
    ];

    /// Keywords of all types.
    pub fn keywords() -> &'static [Keyword] {
        &KEYWORDS
    }

    /// Its keyword.
    pub fn word(self) -> &'static str {
        let place = Self::SINGLE.iter().position(|single| *single == self);
        KEYWORDS[place.unwrap_or(Self::SINGLE.len())].word
    }

    /// Shear and planar extension at these rates, of which only the ratio matters; shear or
    /// extension alone where the other rate is 0.
    ///
    /// # Errors
    /// [`Refusal`] of rates that are negative, not finite, or both 0.
    pub fn mixture(shear: f64, extension: f64) -> Result<Self, Refusal> {
        let valid = |rate: f64| rate >= 0.0 && rate.is_finite();
        let ratio = extension / shear;
        let refuse = |problem: &str, allowed: &str| {
            Err(Refusal {
                key: "flow",
                value: format!("{{ shear = {shear}, extension = {extension} }}"),
                problem: problem.into(),
                allowed: allowed.into(),
                because: None,
            })
        };
        if !(valid(shear) && valid(extension)) {
            return refuse(
                "has a rate that is negative or not finite",
                "rates from 0; `direction` = -1 reverses the flow",
            );
        }
        match (shear > 0.0, extension > 0.0) {
            (false, false) => refuse(
                "is neither shear nor extension",
                "rates of which one is above 0; only their ratio matters",
            ),
            (true, false) => Ok(Self::Shear),
            (false, true) => Ok(Self::PlanarExtension),
            // Beyond, one of the two would be lost to rounding.
            (true, true) if !(1e-6..=1e6).contains(&ratio) => refuse(
                "has rates that differ too much",
                "rates whose ratio is from 1e-6 to 1e6",
            ),
            (true, true) => Ok(Self::Mixture(ratio)),
        }
    }

    /// Whether a layer has it: whether nothing is stretched or compressed across its plane.
    pub fn is_planar(self) -> bool {
        !matches!(self, Self::Uniaxial | Self::Biaxial)
    }
}

impl fmt::Display for FlowType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mixture(ratio) => write!(f, "{} {ratio}", self.word()),
            single => f.write_str(single.word()),
        }
    }
}

impl FromStr for FlowType {
    type Err = Refusal;

    fn from_str(text: &str) -> Result<Self, Refusal> {
        if let Some(single) = Self::SINGLE.iter().find(|single| single.word() == text) {
            return Ok(*single);
        }
        if let Some(("mixture", ratio)) = text.split_once(' ')
            && let Ok(ratio) = ratio.parse()
        {
            return Self::mixture(1.0, ratio);
        }
        Err(Refusal {
            key: "flow",
            value: format!("{text:?}"),
            problem: "is not known".into(),
            allowed: ALLOWED.into(),
            because: None,
        })
    }
}

impl Serialize for FlowType {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for FlowType {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse()
            .map_err(|refusal: Refusal| serde::de::Error::custom(refusal))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_come_back_from_their_text() {
        for flow in [
            FlowType::Shear,
            FlowType::PlanarExtension,
            FlowType::Uniaxial,
            FlowType::Biaxial,
            FlowType::Mixture(0.1 + 0.2),
        ] {
            assert_eq!(flow.to_string().parse::<FlowType>().unwrap(), flow);
            let json = serde_json::to_string(&flow).unwrap();
            assert_eq!(serde_json::from_str::<FlowType>(&json).unwrap(), flow);
        }
        assert_eq!(FlowType::mixture(2.0, 0.0).unwrap(), FlowType::Shear);
        assert_eq!(
            FlowType::mixture(0.0, 2.0).unwrap(),
            FlowType::PlanarExtension
        );
    }

    #[test]
    fn what_is_no_flow_is_refused_with_what_is_allowed() {
        let text = |text: &str| text.parse::<FlowType>().unwrap_err().to_string();
        assert!(text("extension").contains("planar-extension"));
        assert!(text("mixture").contains("is not known"));
        assert!(text("mixture -1").contains("negative"));
        assert!(text("shear 2").contains("is not known"));
        let neither = FlowType::mixture(0.0, 0.0).unwrap_err().to_string();
        assert!(neither.contains("neither shear nor extension"), "{neither}");
    }
}
