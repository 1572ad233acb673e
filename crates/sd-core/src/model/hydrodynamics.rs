//! The choice of hydrodynamics, with the parameters of leading-order lubrication.

use crate::error::Refusal;
use crate::law::{Keyword, Keywords, Quantity, Range};
use serde::{Deserialize, Serialize};

/// Model of the grand resistance matrix.
///
/// ```
/// use sd_core::{Hydrodynamics, LeadingOrder};
///
/// // Lubrication between surfaces that may overlap, as in published simulations.
/// let lubrication = Hydrodynamics::Lubrication(LeadingOrder::DEFAULT);
/// assert!(lubrication.admits_overlap() && !Hydrodynamics::BallMelrose.admits_overlap());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hydrodynamics {
    /// Far-field mobility of the periodic layer plus near-field pair terms.
    StokesianDynamics,
    /// Isolated drag plus near-field pair terms.
    BallMelrose,
    /// Isolated drag plus the leading singular terms of near pairs.
    Lubrication(LeadingOrder),
}

impl From<LeadingOrder> for Hydrodynamics {
    fn from(numbers: LeadingOrder) -> Self {
        Self::Lubrication(numbers)
    }
}

/// Parameters of [`Hydrodynamics::Lubrication`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeadingOrder {
    /// ξ below which a pair has a term, above 0; with δ at most 1, where the logarithm ends.
    #[serde(default = "usual_cutoff")]
    pub cutoff: f64,
    /// δ, added to ξ in the terms, above 0.
    #[serde(default = "usual_regularisation")]
    pub regularisation: f64,
}

impl Default for LeadingOrder {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl LeadingOrder {
    /// Values of published simulations.
    pub const DEFAULT: Self = Self {
        cutoff: 0.5,
        regularisation: 1e-3,
    };

    /// Checks ranges and consistency of both numbers.
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        CUTOFF.check(CUTOFF.key, self.cutoff)?;
        REGULARISATION.check(REGULARISATION.key, self.regularisation)?;
        if self.cutoff + self.regularisation > 1.0 {
            return Err(Refusal {
                key: CUTOFF.key,
                value: self.cutoff.to_string(),
                problem: "is too far with the regularisation added".into(),
                allowed: format!(
                    "at most {}, as logarithms are negative beyond",
                    1.0 - self.regularisation
                ),
                because: Some(REGULARISATION.key),
            });
        }
        Ok(())
    }
}

/// Default of [`LeadingOrder::cutoff`].
fn usual_cutoff() -> f64 {
    LeadingOrder::DEFAULT.cutoff
}

/// Default of [`LeadingOrder::regularisation`].
fn usual_regularisation() -> f64 {
    LeadingOrder::DEFAULT.regularisation
}

/// ξ of the farthest pairs that have a term.
pub(super) static CUTOFF: Quantity = Quantity {
    key: "lubrication_cutoff",
    unit: "1",
    meaning: "cutoff of lubrication; ξ = 2g/(a_i + a_j)",
    range: Range::above_to(0.0, 1.0),
    note: "in ξ = 2g/(a_i + a_j): beyond 1 the logarithms are negative, and beyond 2 a cell may be too small for it",
};

/// δ.
pub(super) static REGULARISATION: Quantity = Quantity {
    key: "lubrication_regularisation",
    unit: "1",
    meaning: "regularisation of lubrication; δ is added to ξ",
    range: Range::above_to(0.0, 0.5),
    note: "added to ξ = 2g/(a_i + a_j)",
};

impl Keywords for Hydrodynamics {
    /// Leading-order lubrication with default parameters.
    const ALL: &'static [Self] = &[
        Self::StokesianDynamics,
        Self::BallMelrose,
        Self::Lubrication(LeadingOrder::DEFAULT),
    ];
    const KEYWORDS: &'static [Keyword] = &[
        Keyword {
            word: "stokesian-dynamics",
            meaning: "Far-field mobility of the periodic layer plus near-field pair terms.",
        },
        Keyword {
            word: "ball-melrose",
            meaning: "Isolated drag plus near-field pair terms.",
        },
        Keyword {
            word: "lubrication",
            meaning: "Isolated drag plus the leading singular terms of near pairs.",
        },
    ];

    fn index(self) -> usize {
        match self {
            Self::StokesianDynamics => 0,
            Self::BallMelrose => 1,
            Self::Lubrication(_) => 2,
        }
    }
}

impl Hydrodynamics {
    /// The parameters of leading-order lubrication.
    pub const fn leading_order(&self) -> Option<&LeadingOrder> {
        match self {
            Self::StokesianDynamics | Self::BallMelrose => None,
            Self::Lubrication(numbers) => Some(numbers),
        }
    }

    /// Changes the parameters of leading-order lubrication; no effect under other hydrodynamics.
    pub(super) fn change(&mut self, change: impl FnOnce(&mut LeadingOrder)) {
        if let Self::Lubrication(numbers) = self {
            change(numbers);
        }
    }

    /// Whether the resistance stays finite where surfaces overlap.
    pub const fn admits_overlap(&self) -> bool {
        self.leading_order().is_some()
    }

    /// Whether pair terms are read from tables, which take a second for every size ratio.
    pub const fn needs_tables(&self) -> bool {
        self.leading_order().is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_json_belong_together() {
        for (choice, word) in Hydrodynamics::ALL.iter().zip(Hydrodynamics::KEYWORDS) {
            assert_eq!(choice.word(), word.word);
            assert_eq!(Hydrodynamics::of_word(word.word), Some(*choice));
            let json = serde_json::to_value(choice).unwrap();
            let written = match choice {
                Hydrodynamics::Lubrication(numbers) => {
                    serde_json::json!({ word.word: {"cutoff": numbers.cutoff, "regularisation": 0.001} })
                }
                _ => word.word.into(),
            };
            assert_eq!(json, written);
            assert_eq!(
                serde_json::from_value::<Hydrodynamics>(json).unwrap(),
                *choice
            );
        }
    }

    #[test]
    fn another_cutoff_is_the_same_word() {
        let other = Hydrodynamics::Lubrication(LeadingOrder {
            cutoff: 0.2,
            ..LeadingOrder::DEFAULT
        });
        assert_eq!(other.word(), "lubrication");
    }
}
