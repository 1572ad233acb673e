//! The table of parameters: each declared once, by what people read of it, what it may be, and where it is in [`Params`].

use super::contact_laws::{ContactLaws, LUBRICATION_SHARE};
use super::{ContactScheme, Hydrodynamics, Params};
use crate::error::Error;
use crate::law::normal::{DASHPOT, STIFFNESS};
use crate::law::repulsion::{REPULSION, REPULSION_ALONE, REPULSION_LENGTH, USUAL_LENGTH};
use crate::law::tangential::stick_slide::{TANGENTIAL_STIFFNESS, USUAL_STIFFNESS};
use crate::law::{FrictionOnset, NormalLaw, Quantity, Range, TangentialLaw, Word, Words};
use std::fmt;

/// A parameter of a run: what people read of it, what it may be, where it is in [`Params`].
#[derive(Debug)]
pub struct Parameter {
    /// Its key in files, tables and JSON.
    pub key: &'static str,
    /// Its symbol, the heading of a column.
    pub symbol: &'static str,
    /// Its unit; `1` where there is none, nothing for words.
    pub unit: &'static str,
    /// What it is; up to a semicolon the label of an axis.
    pub meaning: &'static str,
    /// A value to show as an example, as a file has it.
    pub example: &'static str,
    /// Whether it says anything beside the other choices; its value there is of no account.
    pub has_meaning: fn(&Params) -> bool,
    /// What to choose for it to have a meaning, where it is a mistake to write it without one.
    pub needs: Option<&'static str>,
    /// Whether tables name it even where all points have the same value of it.
    pub is_shown: fn(&Params) -> bool,
    /// What kind of value it has.
    pub form: Form,
}

/// What kind of value a parameter has.
#[derive(Debug)]
pub enum Form {
    /// One of several words.
    Choice(Choice),
    /// A number.
    Number(Number),
}

/// A parameter that is one of several words.
#[derive(Debug)]
pub struct Choice {
    /// The words there are.
    pub words: fn() -> Vec<Word>,
    /// The word that is meant where none is written.
    pub default: &'static str,
    /// Its word.
    pub get: fn(&Params) -> &'static str,
    /// Makes the choice with this word.
    pub put: fn(&mut Params, &str) -> Result<(), Refusal>,
}

/// A parameter that is a number.
#[derive(Debug)]
pub struct Number {
    /// Its range and what to say of it.
    pub quantity: &'static Quantity,
    /// Whether it is a whole number.
    pub whole: bool,
    /// The value that is meant where none is written; `None` where one must be.
    pub default: Option<fn(&Params) -> f64>,
    /// Its value.
    pub get: fn(&Params) -> f64,
    /// Gives it a value.
    pub put: fn(&mut Params, f64),
    /// The value it has where it has no meaning.
    pub without: Option<f64>,
}

/// A value that is out of its range, or does not go with the others.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Key of the parameter.
    pub key: &'static str,
    /// Its value, as it is written.
    pub value: String,
    /// What is wrong with it.
    pub problem: String,
    /// What is allowed.
    pub allowed: String,
    /// Key of the other parameter it does not go with.
    pub because: Option<&'static str>,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            key,
            value,
            problem,
            allowed,
            ..
        } = self;
        write!(f, "{key} = {value} {problem}: {allowed}")
    }
}

impl std::error::Error for Refusal {}

impl From<Refusal> for Error {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(Box::new(refusal))
    }
}

/// All parameters of a run, in the order of columns and of nested loops.
///
/// A choice stands above the numbers that have a meaning under it. Values are therefore put into [`Params`] from the last
/// entry to the first.
pub static PARAMETERS: [Parameter; 18] = [
    Parameter {
        key: "hydrodynamics",
        symbol: "hydrodynamics",
        meaning: "how the grand resistance is made",
        form: Form::Choice(Choice {
            words: || Hydrodynamics::WORDS.to_vec(),
            default: "stokesian-dynamics",
            get: |p| p.hydrodynamics.word(),
            put: |p, word| read(&mut p.hydrodynamics, "hydrodynamics", word),
        }),
        ..CHOICE
    },
    Parameter {
        key: "contact",
        symbol: "contact",
        meaning: "contact scheme",
        form: Form::Choice(Choice {
            words: contact_words,
            default: "rigid",
            get: contact_word,
            put: put_contact,
        }),
        ..CHOICE
    },
    Parameter {
        key: "tangential",
        symbol: "tangential",
        meaning: "tangential law",
        has_meaning: rubs,
        is_shown: has_chosen_laws,
        form: Form::Choice(Choice {
            words: tangential_words,
            default: "roll-slip",
            get: |p| p.contact.laws().tangential.word(),
            put: put_tangential,
        }),
        ..CHOICE
    },
    Parameter {
        key: "friction_onset",
        symbol: "onset",
        meaning: "how friction begins with the load",
        has_meaning: |p| rubs(p) && p.shear_rate.is_finite(),
        is_shown: has_chosen_laws,
        form: Form::Choice(Choice {
            words: || FrictionOnset::WORDS.to_vec(),
            default: "critical-load",
            get: |p| p.contact.laws().onset.word(),
            put: |p, word| match p.contact.chosen_laws() {
                Some(laws) => read(&mut laws.onset, "friction_onset", word),
                None => Ok(()),
            },
        }),
        ..CHOICE
    },
    Parameter {
        form: Form::Number(Number {
            whole: true,
            get: |p| p.spheres as f64,
            put: put_spheres,
            ..NEEDED
        }),
        ..number(&SPHERES)
    },
    Parameter {
        form: Form::Number(Number {
            quantity: &AREA_FRACTION,
            get: |p| p.area_fraction,
            put: |p, value| p.area_fraction = value,
            ..NEEDED
        }),
        ..number(&AREA_FRACTION)
    },
    Parameter {
        is_shown: is_mixed,
        form: Form::Number(Number {
            quantity: &SIZE_RATIO,
            default: Some(|_| 1.0),
            get: |p| p.size_ratio,
            put: |p, value| p.size_ratio = value,
            ..NEEDED
        }),
        ..number(&SIZE_RATIO)
    },
    Parameter {
        has_meaning: is_mixed,
        is_shown: is_mixed,
        form: Form::Number(Number {
            quantity: &LARGE_FRACTION,
            default: Some(|_| 0.5),
            get: |p| p.large_fraction,
            put: |p, value| p.large_fraction = value,
            without: Some(0.5),
            ..NEEDED
        }),
        ..number(&LARGE_FRACTION)
    },
    Parameter {
        form: Form::Number(Number {
            quantity: &ROUGHNESS,
            get: |p| p.roughness,
            put: |p, value| p.roughness = value,
            ..NEEDED
        }),
        ..number(&ROUGHNESS)
    },
    Parameter {
        has_meaning: |p| p.contact.laws().normal.touches(),
        is_shown: |_| true,
        form: Form::Number(Number {
            quantity: &FRICTION,
            get: |p| p.friction,
            put: |p, value| p.friction = value,
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&FRICTION)
    },
    Parameter {
        has_meaning: has_spring,
        needs: Some("a spring: `contact` = \"linear-spring\" or \"hertz\""),
        is_shown: has_spring,
        form: Form::Number(Number {
            quantity: &STIFFNESS,
            get: |p| p.contact.laws().stiffness,
            put: |p, value| put_law(p, |laws| laws.stiffness = value),
            without: Some(f64::INFINITY),
            ..NEEDED
        }),
        ..number(&STIFFNESS)
    },
    Parameter {
        has_meaning: has_tangential_spring,
        needs: Some("`tangential` = \"stick-slide\" with a spring"),
        is_shown: has_tangential_spring,
        form: Form::Number(Number {
            quantity: &TANGENTIAL_STIFFNESS,
            default: Some(|_| USUAL_STIFFNESS),
            get: |p| p.contact.laws().tangential_stiffness,
            put: |p, value| put_law(p, |laws| laws.tangential_stiffness = value),
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&TANGENTIAL_STIFFNESS)
    },
    Parameter {
        has_meaning: has_spring,
        needs: Some("a spring: `contact` = \"linear-spring\" or \"hertz\" of finite stiffness"),
        is_shown: |p| p.contact.laws().dashpot > 0.0,
        form: Form::Number(Number {
            quantity: &DASHPOT,
            default: Some(|_| 0.0),
            get: |p| p.contact.laws().dashpot,
            put: |p, value| put_law(p, |laws| laws.dashpot = value),
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&DASHPOT)
    },
    Parameter {
        has_meaning: is_soft,
        needs: Some("a soft law: a spring or a repulsion"),
        is_shown: is_soft,
        form: Form::Number(Number {
            quantity: &LUBRICATION_GAP,
            default: Some(|p| LUBRICATION_SHARE * p.roughness),
            get: |p| p.contact.laws().lubrication_gap,
            put: |p, value| put_law(p, |laws| laws.lubrication_gap = value),
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&LUBRICATION_GAP)
    },
    Parameter {
        has_meaning: |p| !matches!(p.contact, ContactScheme::Procedure),
        is_shown: repels,
        form: Form::Number(Number {
            quantity: &REPULSION,
            default: Some(|p| if alone(p) { REPULSION_ALONE } else { 0.0 }),
            get: |p| p.contact.laws().repulsion,
            put: |p, value| put_law(p, |laws| laws.repulsion = value),
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&REPULSION)
    },
    Parameter {
        has_meaning: repels,
        needs: Some("a repulsion: `repulsion` above 0 or `contact` = \"exponential-repulsion\""),
        is_shown: repels,
        form: Form::Number(Number {
            quantity: &REPULSION_LENGTH,
            default: Some(|_| USUAL_LENGTH),
            get: |p| p.contact.laws().repulsion_length,
            put: |p, value| put_law(p, |laws| laws.repulsion_length = value),
            without: Some(0.0),
            ..NEEDED
        }),
        ..number(&REPULSION_LENGTH)
    },
    Parameter {
        form: Form::Number(Number {
            quantity: &TIME_STEP,
            default: Some(|_| USUAL_TIME_STEP),
            get: |p| p.time_step,
            put: |p, value| p.time_step = value,
            ..NEEDED
        }),
        ..number(&TIME_STEP)
    },
    Parameter {
        form: Form::Number(Number {
            quantity: &SHEAR_RATE,
            get: |p| p.shear_rate,
            put: |p, value| p.shear_rate = value,
            ..NEEDED
        }),
        ..number(&SHEAR_RATE)
    },
];

/// Time step unless said otherwise, in strain.
const USUAL_TIME_STEP: f64 = 0.005;

/// What most choices have in common.
const CHOICE: Parameter = Parameter {
    key: "",
    symbol: "",
    unit: "",
    meaning: "",
    example: "",
    has_meaning: |_| true,
    needs: None,
    is_shown: |_| true,
    form: Form::Number(NEEDED),
};

/// What most numbers have in common: one must be written.
const NEEDED: Number = Number {
    quantity: &SPHERES,
    whole: false,
    default: None,
    get: |_| f64::NAN,
    put: |_, _| (),
    without: None,
};

/// What a parameter has of its quantity.
const fn number(quantity: &'static Quantity) -> Parameter {
    Parameter {
        key: quantity.key,
        symbol: quantity.symbol,
        unit: quantity.unit,
        meaning: quantity.meaning,
        example: quantity.example,
        ..CHOICE
    }
}

/// N.
static SPHERES: Quantity = Quantity {
    key: "spheres",
    symbol: "N",
    unit: "1",
    meaning: "number of spheres N",
    range: Range::from_to(1.0, 10_000.0),
    note: "",
    example: "90",
    logarithmic: false,
};

/// c.
static AREA_FRACTION: Quantity = Quantity {
    key: "area_fraction",
    symbol: "c",
    unit: "1",
    meaning: "area fraction c",
    range: Range::above_to(0.0, 0.84),
    note: "",
    example: "0.693",
    logarithmic: false,
};

/// Sizes of mixtures.
static SIZE_RATIO: Quantity = Quantity {
    key: "size_ratio",
    symbol: "size ratio",
    unit: "1",
    meaning: "radius of large over small spheres",
    range: Range::from_to(1.0, 10.0),
    note: "",
    example: "1.4",
    logarithmic: false,
};

/// Numbers of mixtures.
static LARGE_FRACTION: Quantity = Quantity {
    key: "large_fraction",
    symbol: "large",
    unit: "1",
    meaning: "large spheres over all",
    range: Range::from_to(0.0, 1.0),
    note: "",
    example: "0.5",
    logarithmic: false,
};

/// h.
static ROUGHNESS: Quantity = Quantity {
    key: "roughness",
    symbol: "h",
    unit: "a",
    meaning: "roughness height h",
    range: Range::between(0.0, 0.5),
    note: "",
    example: "0.01",
    logarithmic: false,
};

/// ν.
static FRICTION: Quantity = Quantity {
    key: "friction",
    symbol: "ν",
    unit: "1",
    meaning: "friction coefficient ν",
    range: Range::from_to(0.0, 10.0),
    note: "",
    example: "0.3",
    logarithmic: false,
};

/// g_min.
static LUBRICATION_GAP: Quantity = Quantity {
    key: "lubrication_gap",
    symbol: "g_min",
    unit: "a",
    meaning: "gap below which lubrication is constant",
    range: Range::between(0.0, 0.5),
    note: "in a, at most the roughness",
    example: "0.001",
    logarithmic: false,
};

/// Δt.
static TIME_STEP: Quantity = Quantity {
    key: "time_step",
    symbol: "Δt",
    unit: "strain",
    meaning: "time step Δt",
    range: Range::from_to(1e-7, 0.1),
    note: "a strain; shorter steps lose their motion to rounding",
    example: "0.01",
    logarithmic: false,
};

/// Γ.
static SHEAR_RATE: Quantity = Quantity {
    key: "shear_rate",
    symbol: "Γ",
    unit: "1",
    meaning: "shear rate Γ; inf is the upper plateau",
    range: Range::from_to(0.0, f64::INFINITY),
    note: "0 and inf are the plateaus",
    example: "[0.1, 1.0, 10.0, inf]",
    logarithmic: true,
};

/// Word for the paper's steps in the place of a normal law.
const PROCEDURE: Word = Word {
    word: "procedure",
    meaning: "The paper's steps 1-6, to the letter.",
};
/// Word for a coefficient of friction of 0 in the place of a tangential law.
const FRICTIONLESS: Word = Word {
    word: "none",
    meaning: "No friction, whatever its coefficient.",
};

/// Words of `contact`: those of the normal laws, the paper's steps after the first.
fn contact_words() -> Vec<Word> {
    let mut words = NormalLaw::WORDS.to_vec();
    words.insert(1, PROCEDURE);
    words
}

/// Words of `tangential`: those of the tangential laws, and none.
fn tangential_words() -> Vec<Word> {
    let mut words = TangentialLaw::WORDS.to_vec();
    words.push(FRICTIONLESS);
    words
}

fn contact_word(params: &Params) -> &'static str {
    match params.contact {
        ContactScheme::Procedure => PROCEDURE.word,
        ContactScheme::Rigid | ContactScheme::Laws(_) => params.contact.laws().normal.word(),
    }
}

/// Reads a choice by its word.
fn read<T: Words>(choice: &mut T, key: &'static str, word: &str) -> Result<(), Refusal> {
    *choice = T::of_word(word).ok_or_else(|| unknown(key, word, T::WORDS))?;
    Ok(())
}

fn unknown(key: &'static str, word: &str, known: &[Word]) -> Refusal {
    let words: Vec<String> = known
        .iter()
        .map(|word| format!("{:?}", word.word))
        .collect();
    Refusal {
        key,
        value: format!("{word:?}"),
        problem: "is not known".into(),
        allowed: words.join(" or "),
        because: None,
    }
}

/// The paper's steps have laws of their own: others that were chosen before are refused.
fn put_contact(params: &mut Params, word: &str) -> Result<(), Refusal> {
    if word != PROCEDURE.word {
        return match params.contact.chosen_laws() {
            Some(laws) => read(&mut laws.normal, "contact", word),
            None => Ok(()),
        };
    }
    let laws = params.contact.laws();
    let paper = ContactLaws::PAPER;
    let refuse = |key, value: String| {
        Err(Refusal {
            key,
            value,
            problem: "does not go with `contact` = \"procedure\"".into(),
            allowed: "the procedure has the paper's laws only: \"roll-slip\" or \"none\", \"critical-load\", no repulsion; \
                      give it a grid of its own"
                .into(),
            because: Some("contact"),
        })
    };
    if laws.tangential != paper.tangential {
        return refuse("tangential", format!("{:?}", laws.tangential.word()));
    }
    if laws.onset != paper.onset {
        return refuse("friction_onset", format!("{:?}", laws.onset.word()));
    }
    if laws.repulsion > 0.0 {
        return refuse("repulsion", laws.repulsion.to_string());
    }
    params.contact = ContactScheme::Procedure;
    Ok(())
}

fn put_tangential(params: &mut Params, word: &str) -> Result<(), Refusal> {
    if word == FRICTIONLESS.word {
        params.friction = 0.0;
        return Ok(());
    }
    match params.contact.chosen_laws() {
        Some(laws) => read(&mut laws.tangential, "tangential", word),
        None => Ok(()),
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a whole number within the range of the table"
)]
fn put_spheres(params: &mut Params, value: f64) {
    params.spheres = value as usize;
}

/// Changes the laws, where they are chosen one by one.
fn put_law(params: &mut Params, change: impl FnOnce(&mut ContactLaws)) {
    if let Some(laws) = params.contact.chosen_laws() {
        change(laws);
    }
}

/// Whether friction ever acts.
fn rubs(params: &Params) -> bool {
    params.contact.laws().normal.touches() && params.friction != 0.0 && params.shear_rate != 0.0
}

/// Whether the laws are other than the paper's.
fn has_chosen_laws(params: &Params) -> bool {
    *params.contact.laws() != ContactLaws::PAPER
}

fn is_mixed(params: &Params) -> bool {
    params.size_ratio > 1.0
}

fn is_soft(params: &Params) -> bool {
    params.contact.laws().is_soft()
}

fn has_spring(params: &Params) -> bool {
    params.contact.laws().normal.is_spring()
}

fn has_tangential_spring(params: &Params) -> bool {
    has_spring(params) && params.contact.laws().tangential.has_spring()
}

/// Whether nothing but the repulsion holds the spheres apart.
fn alone(params: &Params) -> bool {
    !params.contact.laws().normal.touches()
}

fn repels(params: &Params) -> bool {
    params.contact.laws().repulsion > 0.0
}

impl Parameter {
    /// Checks its value.
    fn check(&self, params: &Params) -> Result<(), Refusal> {
        let Form::Number(number) = &self.form else {
            return Ok(());
        };
        let value = (number.get)(params);
        let refuse = |problem: &str, allowed| {
            Err(Refusal {
                key: self.key,
                value: value.to_string(),
                problem: problem.into(),
                allowed,
                because: None,
            })
        };
        let meaningless = !(self.has_meaning)(params);
        match (number.without, self.needs) {
            (Some(without), Some(needs)) if meaningless => {
                if value == without {
                    return Ok(());
                }
                refuse("has no meaning", format!("{without}, or choose {needs}"))
            }
            _ if number.quantity.range.contains(value) => Ok(()),
            _ => refuse("is out of range", number.quantity.allowed()),
        }
    }
}

/// Checks every value, and that they go together.
pub(super) fn check(params: &Params) -> Result<(), Refusal> {
    for parameter in &PARAMETERS {
        parameter.check(params)?;
    }
    check_together(params)
}

/// Checks the numbers of the contact laws, and that they go together.
pub(super) fn check_contact(params: &Params) -> Result<(), Refusal> {
    let of_laws = [
        &STIFFNESS,
        &TANGENTIAL_STIFFNESS,
        &DASHPOT,
        &LUBRICATION_GAP,
        &REPULSION,
        &REPULSION_LENGTH,
    ];
    for parameter in &PARAMETERS {
        if of_laws.iter().any(|quantity| quantity.key == parameter.key) {
            parameter.check(params)?;
        }
    }
    check_together(params)
}

/// Checks that values which are right by themselves go together.
fn check_together(params: &Params) -> Result<(), Refusal> {
    let laws = params.contact.laws();
    let refuse = |key, value: String, problem: &str, allowed: String, because| {
        Err(Refusal {
            key,
            value,
            problem: problem.into(),
            allowed,
            because: Some(because),
        })
    };
    if laws.is_soft() && (params.shear_rate == 0.0 || params.shear_rate.is_infinite()) {
        return refuse(
            "shear_rate",
            params.shear_rate.to_string(),
            "has no meaning under soft laws",
            "above 0 and finite: stiffness and repulsion are in units of F_crit = 6 pi/shear_rate, which is infinite at 0 \
             and zero at inf; give rigid contacts a grid of their own there"
                .into(),
            "contact",
        );
    }
    if laws.tangential.has_spring() && !laws.normal.is_spring() {
        return refuse(
            "tangential",
            format!("{:?}", laws.tangential.word()),
            "does not go with a contact that is no spring",
            "\"coulomb\" there, which is its rigid limit".into(),
            "contact",
        );
    }
    if laws.lubrication_gap > params.roughness {
        return refuse(
            "lubrication_gap",
            laws.lubrication_gap.to_string(),
            "is above the roughness",
            format!("above 0 and at most {}", params.roughness),
            "roughness",
        );
    }
    if alone(params) && laws.repulsion == 0.0 {
        return refuse(
            "repulsion",
            "0".into(),
            "leaves nothing that holds the spheres apart",
            format!("above 0 with `contact` = {:?}", laws.normal.word()),
            "contact",
        );
    }
    Ok(())
}

/// Brings parameters into the form in which equal physics has equal numbers.
pub(super) fn settle(params: &mut Params) {
    if let ContactScheme::Laws(laws) = &mut params.contact {
        if laws.normal.is_spring() && laws.stiffness.is_infinite() {
            laws.normal = NormalLaw::Rigid;
        }
        if laws.tangential.has_spring() && !laws.normal.is_spring() {
            laws.tangential = TangentialLaw::Coulomb;
        }
    }
    // Friction first: whether tangential laws act depends on it, and they stand above it.
    let friction = PARAMETERS
        .iter()
        .filter(|parameter| parameter.key == FRICTION.key);
    for parameter in friction.chain(&PARAMETERS) {
        let meaningless = !(parameter.has_meaning)(params);
        match &parameter.form {
            Form::Choice(choice) if meaningless => {
                (choice.put)(params, choice.default).expect("a default is one of the words");
            }
            Form::Choice(_) => {}
            Form::Number(number) => {
                let value = number.without.filter(|_| meaningless);
                // A zero loses its sign.
                let value = value.unwrap_or_else(|| (number.get)(params)) + 0.0;
                (number.put)(params, value);
            }
        }
    }
    if params.contact == ContactScheme::Laws(ContactLaws::PAPER) {
        params.contact = ContactScheme::Rigid;
    }
}
