//! The axes of a grid that choose the contact laws, put together to schemes.

use super::error::Problem;
use super::reader::{Axis, Distinct, Located, Table, number, word};
use crate::report::{contact as contact_word, onset as onset_word, tangential as tangential_word};
use sd_core::params::{LUBRICATION_SHARE, TANGENTIAL_STIFFNESS};
use sd_core::{ContactLaws, ContactScheme, FrictionOnset, NormalLaw, TangentialLaw};
use std::ops::Range;

/// Keys of a grid that are read here.
pub(super) const KEYS: [&str; 9] = [
    "contact",
    "tangential",
    "friction_onset",
    "stiffness",
    "tangential_stiffness",
    "dashpot",
    "lubrication_gap",
    "repulsion",
    "repulsion_length",
];
/// F0 where nothing else holds the spheres apart, in `F_crit`, unless said otherwise.
const REPULSION: f64 = 1.0;
/// l, in a, unless said otherwise: Mari et al., J. Rheol. 58, 1693 (2014).
const REPULSION_LENGTH: f64 = 0.02;

/// What `contact` names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Normal {
    /// The paper's steps.
    Procedure,
    /// A law of its own.
    Law(NormalLaw),
}

impl Normal {
    /// Whether it is a spring.
    fn is_spring(self) -> bool {
        matches!(self, Self::Law(law) if law.is_spring())
    }
}

/// Words of `contact`.
const CONTACT: [(&str, Normal); 5] = [
    ("rigid", Normal::Law(NormalLaw::Rigid)),
    ("procedure", Normal::Procedure),
    ("linear-spring", Normal::Law(NormalLaw::LinearSpring)),
    ("hertz", Normal::Law(NormalLaw::Hertz)),
    (
        "exponential-repulsion",
        Normal::Law(NormalLaw::ExponentialRepulsion),
    ),
];
/// Words of `tangential`; none is no friction.
const TANGENTIAL: [(&str, Option<TangentialLaw>); 5] = [
    ("roll-slip", Some(TangentialLaw::RollSlip)),
    ("stick-slide", Some(TangentialLaw::StickSlide)),
    ("coulomb", Some(TangentialLaw::Coulomb)),
    ("stick-rotate", Some(TangentialLaw::StickRotate)),
    ("none", None),
];
/// Words of `friction_onset`.
const ONSET: [(&str, FrictionOnset); 2] = [
    ("critical-load", FrictionOnset::CriticalLoad),
    ("reduced", FrictionOnset::Reduced),
];

impl Distinct for Normal {
    fn identity(&self) -> u64 {
        match self {
            Self::Procedure => 0,
            Self::Law(law) => 1 + *law as u64,
        }
    }
    fn written(&self) -> String {
        match self {
            Self::Procedure => contact_word(&ContactScheme::Procedure).into(),
            Self::Law(normal) => contact_word(&ContactScheme::Laws(ContactLaws {
                normal: *normal,
                ..ContactLaws::PAPER
            }))
            .into(),
        }
    }
}

impl Distinct for Option<TangentialLaw> {
    fn identity(&self) -> u64 {
        self.map_or(0, |law| 1 + law as u64)
    }
    fn written(&self) -> String {
        self.map_or("none", tangential_word).into()
    }
}

impl Distinct for FrictionOnset {
    fn identity(&self) -> u64 {
        *self as u64
    }
    fn written(&self) -> String {
        onset_word(*self).into()
    }
}

/// The axes of one grid; those of numbers are empty where the grid says nothing.
#[derive(Debug)]
pub(super) struct Contact {
    /// What presses.
    normal: Axis<Normal>,
    /// What rubs.
    tangential: Axis<Option<TangentialLaw>>,
    /// How friction begins.
    onset: Axis<FrictionOnset>,
    /// k.
    stiffness: Option<Axis<f64>>,
    /// `k_t` over k.
    tangential_stiffness: Option<Axis<f64>>,
    /// c.
    dashpot: Option<Axis<f64>>,
    /// Gap below which lubrication is held constant.
    lubrication_gap: Option<Axis<f64>>,
    /// F0.
    repulsion: Option<Axis<f64>>,
    /// l.
    repulsion_length: Option<Axis<f64>>,
}

/// One combination of values; `None`: the default of its law.
#[derive(Debug, Clone, Copy)]
pub(super) struct Choice {
    /// What presses.
    normal: Normal,
    /// What rubs.
    tangential: Option<TangentialLaw>,
    /// How friction begins.
    onset: FrictionOnset,
    /// k.
    stiffness: Option<f64>,
    /// `k_t` over k.
    tangential_stiffness: Option<f64>,
    /// c.
    dashpot: Option<f64>,
    /// Gap below which lubrication is held constant.
    lubrication_gap: Option<f64>,
    /// F0.
    repulsion: Option<f64>,
    /// l.
    repulsion_length: Option<f64>,
}

impl Contact {
    /// Reads the axes.
    pub(super) fn read(table: &Table<'_>, span: &Range<usize>) -> Result<Self, Problem> {
        let numbers = |key, range, inside: fn(f64) -> bool| {
            table.axis(key, |written, key| number(written, key, range, inside))
        };
        Ok(Self {
            normal: table
                .axis("contact", |written, key| word(written, key, &CONTACT))?
                .unwrap_or_else(|| Axis::default_value(Normal::Law(NormalLaw::Rigid), span)),
            tangential: table
                .axis("tangential", |written, key| word(written, key, &TANGENTIAL))?
                .unwrap_or_else(|| Axis::default_value(Some(TangentialLaw::RollSlip), span)),
            onset: table
                .axis("friction_onset", |written, key| word(written, key, &ONSET))?
                .unwrap_or_else(|| Axis::default_value(FrictionOnset::CriticalLoad, span)),
            stiffness: numbers(
                "stiffness",
                "above 0, in F_crit/a (inf is rigid)",
                |value| value > 0.0,
            )?,
            tangential_stiffness: numbers(
                "tangential_stiffness",
                "above 0 and at most 100 (over the normal stiffness)",
                |value| value > 0.0 && value <= 100.0,
            )?,
            dashpot: numbers("dashpot", "from 0 to 1e6 (in mu a)", |value| {
                (0.0..=1e6).contains(&value)
            })?,
            lubrication_gap: numbers(
                "lubrication_gap",
                "above 0 and at most the roughness (in a)",
                |value| value > 0.0 && value < 0.5,
            )?,
            repulsion: numbers("repulsion", "from 0 to 1e6 (in F_crit)", |value| {
                (0.0..=1e6).contains(&value)
            })?,
            repulsion_length: numbers(
                "repulsion_length",
                "above 0 and at most 0.5 (in a)",
                |value| value > 0.0 && value <= 0.5,
            )?,
        })
    }

    /// Number of combinations.
    pub(super) fn len(&self) -> u64 {
        let numbers = [
            &self.stiffness,
            &self.tangential_stiffness,
            &self.dashpot,
            &self.lubrication_gap,
            &self.repulsion,
            &self.repulsion_length,
        ];
        let words = [
            self.normal.values.len(),
            self.tangential.values.len(),
            self.onset.values.len(),
        ];
        numbers
            .into_iter()
            .map(|axis| axis.as_ref().map_or(1, |axis| axis.values.len()))
            .chain(words)
            .fold(1, |product: u64, n| product.saturating_mul(n as u64))
    }

    /// All combinations: of what presses, of what rubs, then of their numbers.
    pub(super) fn choices(&self) -> Vec<Choice> {
        let mut all = Vec::new();
        for normal in &self.normal.values {
            for tangential in &self.tangential.values {
                for onset in &self.onset.values {
                    all.push(Choice {
                        normal: normal.value,
                        tangential: tangential.value,
                        onset: onset.value,
                        stiffness: None,
                        tangential_stiffness: None,
                        dashpot: None,
                        lubrication_gap: None,
                        repulsion: None,
                        repulsion_length: None,
                    });
                }
            }
        }
        let mut multiply = |axis: &Option<Axis<f64>>,
                            place: fn(&mut Choice) -> &mut Option<f64>| {
            let Some(axis) = axis else {
                return;
            };
            all = all
                .iter()
                .flat_map(|choice| {
                    axis.values.iter().map(|value| {
                        let mut choice = *choice;
                        *place(&mut choice) = Some(value.value);
                        choice
                    })
                })
                .collect();
        };
        multiply(&self.stiffness, |c| &mut c.stiffness);
        multiply(&self.tangential_stiffness, |c| &mut c.tangential_stiffness);
        multiply(&self.dashpot, |c| &mut c.dashpot);
        multiply(&self.lubrication_gap, |c| &mut c.lubrication_gap);
        multiply(&self.repulsion, |c| &mut c.repulsion);
        multiply(&self.repulsion_length, |c| &mut c.repulsion_length);
        all
    }

    /// Refuses values that do not go together, and values that have no meaning under any law of the grid.
    pub(super) fn check(
        &self,
        span: &Range<usize>,
        roughness: &Axis<f64>,
        shear_rate: &Axis<f64>,
    ) -> Result<(), Problem> {
        self.check_procedure()?;
        let spring = self.normal.values.iter().find(|n| n.value.is_spring());
        if let (Some(normal), None) = (spring, &self.stiffness) {
            let name = normal.value.written();
            return Err(Problem::at(
                span,
                format!("`contact` = {name:?} has no `stiffness`"),
                "add for example `stiffness = 1e4`, in F_crit/a; inf is rigid",
            )
            .labelled("needs `stiffness`")
            .also(&normal.span, "for this law"));
        }
        self.check_meaning()?;
        let soft = self.choices().into_iter().any(|choice| choice.is_soft());
        let plateau = |rate: &&Located<f64>| rate.value == 0.0 || rate.value.is_infinite();
        if let Some(rate) = shear_rate.values.iter().find(plateau).filter(|_| soft) {
            return Err(Problem::at(
                &rate.span,
                format!("`shear_rate` = {} has no meaning under soft laws", rate.value),
                "above 0 and finite: stiffness and repulsion are in units of F_crit = 6 pi/shear_rate, which is infinite at 0 \
                 and zero at inf; give rigid contacts a grid of their own there",
            )
            .labelled("a plateau"));
        }
        for gap in self.lubrication_gap.iter().flat_map(|axis| &axis.values) {
            if let Some(height) = roughness.values.iter().find(|h| h.value < gap.value) {
                return Err(Problem::at(
                    &gap.span,
                    format!("`lubrication_gap` = {} is above the roughness", gap.value),
                    format!("`lubrication_gap` is above 0 and at most {}", height.value),
                )
                .also(&height.span, "the roughness"));
            }
        }
        Ok(())
    }

    /// Refuses other laws for the paper's steps than its own.
    fn check_procedure(&self) -> Result<(), Problem> {
        let mut normals = self.normal.values.iter();
        let Some(procedure) = normals.find(|n| n.value == Normal::Procedure) else {
            return Ok(());
        };
        let other = [
            self.tangential
                .values
                .iter()
                .find(|t| !matches!(t.value, None | Some(TangentialLaw::RollSlip)))
                .map(|t| (&t.span, format!("`tangential` = {:?}", t.value.written()))),
            self.onset
                .values
                .iter()
                .find(|o| o.value != FrictionOnset::CriticalLoad)
                .map(|o| {
                    (
                        &o.span,
                        format!("`friction_onset` = {:?}", o.value.written()),
                    )
                }),
            self.repulsion
                .iter()
                .flat_map(|axis| &axis.values)
                .find(|r| r.value > 0.0)
                .map(|r| (&r.span, format!("`repulsion` = {}", r.value))),
        ];
        match other.into_iter().flatten().next() {
            None => Ok(()),
            Some((span, what)) => Err(Problem::at(
                span,
                format!("{what} does not go with `contact` = \"procedure\""),
                "the procedure has the paper's laws only: \"roll-slip\" or \"none\", \"critical-load\", no repulsion; \
                 give it a grid of its own",
            )
            .also(&procedure.span, "the paper's steps")),
        }
    }

    /// Refuses numbers that none of the laws has.
    fn check_meaning(&self) -> Result<(), Problem> {
        let choices = self.choices();
        let any = |has: fn(&Choice) -> bool| choices.iter().any(has);
        let spring = "a spring: `contact` = \"linear-spring\" or \"hertz\" of finite stiffness";
        let numbers: [(&str, &Option<Axis<f64>>, bool, &str); 5] = [
            (
                "stiffness",
                &self.stiffness,
                self.normal.values.iter().any(|n| n.value.is_spring()),
                "a spring: `contact` = \"linear-spring\" or \"hertz\"",
            ),
            (
                "tangential_stiffness",
                &self.tangential_stiffness,
                any(|c| c.is_spring() && c.tangential == Some(TangentialLaw::StickSlide)),
                "`tangential` = \"stick-slide\" with a spring",
            ),
            ("dashpot", &self.dashpot, any(Choice::is_spring), spring),
            (
                "lubrication_gap",
                &self.lubrication_gap,
                any(Choice::is_soft),
                "a soft law: a spring or a repulsion",
            ),
            (
                "repulsion_length",
                &self.repulsion_length,
                any(|c| c.repulsion() > 0.0),
                "a repulsion: `repulsion` above 0 or `contact` = \"exponential-repulsion\"",
            ),
        ];
        for (key, axis, has_meaning, needs) in numbers {
            if let Some(axis) = axis.as_ref().filter(|_| !has_meaning) {
                return Err(Problem::at(
                    &axis.span,
                    format!("`{key}` has no meaning in this grid"),
                    format!("take it out, or choose {needs}"),
                ));
            }
        }
        let alone = |n: &&Located<Normal>| n.value == Normal::Law(NormalLaw::ExponentialRepulsion);
        let mut zeros = self.repulsion.iter().flat_map(|axis| &axis.values);
        if let (Some(normal), Some(zero)) = (
            self.normal.values.iter().find(alone),
            zeros.find(|r| r.value == 0.0),
        ) {
            return Err(Problem::at(
                &zero.span,
                "`repulsion` = 0 leaves nothing that holds the spheres apart",
                "above 0 with `contact` = \"exponential-repulsion\"",
            )
            .also(&normal.span, "the only force"));
        }
        Ok(())
    }
}

impl Choice {
    /// Whether it has a spring.
    fn is_spring(&self) -> bool {
        self.normal.is_spring() && self.stiffness.is_some_and(f64::is_finite)
    }

    /// F0, in `F_crit`.
    fn repulsion(&self) -> f64 {
        let alone = self.normal == Normal::Law(NormalLaw::ExponentialRepulsion);
        self.repulsion
            .unwrap_or(if alone { REPULSION } else { 0.0 })
    }

    /// Whether forces depend on gaps.
    fn is_soft(&self) -> bool {
        self.is_spring() || self.repulsion() > 0.0
    }

    /// The scheme at a roughness, and the friction coefficient under it.
    ///
    /// Values without meaning under a law are dropped. Springs of infinite stiffness are rigid, and stick-slide is Coulomb's law
    /// there; without friction, or with nothing to touch, the coefficient is 0.
    pub(super) fn scheme(&self, roughness: f64, friction: f64) -> (ContactScheme, f64) {
        let friction = if self.tangential.is_none() {
            0.0
        } else {
            friction
        };
        let normal = match self.normal {
            Normal::Procedure => return (ContactScheme::Procedure, friction),
            Normal::Law(law) if law.is_spring() && !self.is_spring() => NormalLaw::Rigid,
            Normal::Law(law) => law,
        };
        let spring = normal.is_spring();
        let friction = if normal == NormalLaw::ExponentialRepulsion {
            0.0
        } else {
            friction
        };
        let tangential = match self.tangential.unwrap_or(TangentialLaw::RollSlip) {
            TangentialLaw::StickSlide if !spring => TangentialLaw::Coulomb,
            law => law,
        };
        let repulsion = self.repulsion();
        let or_zero = |has: bool, value: f64| if has { value } else { 0.0 };
        let laws = ContactLaws {
            normal,
            tangential,
            onset: self.onset,
            stiffness: self.stiffness.filter(|_| spring).unwrap_or(f64::INFINITY),
            tangential_stiffness: or_zero(
                tangential == TangentialLaw::StickSlide,
                self.tangential_stiffness.unwrap_or(TANGENTIAL_STIFFNESS),
            ),
            dashpot: or_zero(spring, self.dashpot.unwrap_or(0.0) + 0.0),
            lubrication_gap: or_zero(
                self.is_soft(),
                self.lubrication_gap
                    .unwrap_or(LUBRICATION_SHARE * roughness),
            ),
            repulsion: repulsion + 0.0,
            repulsion_length: or_zero(
                repulsion > 0.0,
                self.repulsion_length.unwrap_or(REPULSION_LENGTH),
            ),
        };
        (ContactScheme::Laws(laws), friction)
    }
}
