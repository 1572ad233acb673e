//! Choices whose keywords set more than one field of the parameters: the contact scheme and
//! friction.

use crate::error::Refusal;
use crate::law::tangential::stick_slide::DEFAULT_STIFFNESS;
use crate::law::{Keyword, Keywords, NormalLaw, TangentialLaw, rolling_friction};
use crate::model::{ContactLaws, ContactScheme, Hydrodynamics, Params, Sizes};
use std::borrow::Cow;

/// Keyword of the paper's steps, in place of a normal law.
const PROCEDURE: Keyword = Keyword {
    word: "procedure",
    meaning: "The paper's steps 1-6, to the letter.",
};
/// Keyword of a friction coefficient of 0, in place of a tangential law.
const FRICTIONLESS: Keyword = Keyword {
    word: "none",
    meaning: "No friction, whatever its coefficient.",
};

/// Keywords of `contact`: those of the normal laws, with the paper's steps after the first.
pub(super) fn contact_words() -> Vec<Keyword> {
    let mut words = NormalLaw::KEYWORDS.to_vec();
    words.insert(1, PROCEDURE);
    words
}

/// Keywords of `tangential`: those of the tangential laws, and none.
pub(super) fn tangential_words() -> Vec<Keyword> {
    let mut words = TangentialLaw::KEYWORDS.to_vec();
    words.push(FRICTIONLESS);
    words
}

pub(super) fn contact_word(params: &Params) -> Cow<'static, str> {
    let word = match params.contact {
        ContactScheme::Procedure => PROCEDURE.word,
        ContactScheme::Rigid | ContactScheme::Laws(_) => params.contact.laws().normal.word(),
    };
    word.into()
}

/// Reads a choice by its keyword.
pub(super) fn read<T: Keywords>(
    choice: &mut T,
    key: &'static str,
    word: &str,
) -> Result<(), Refusal> {
    *choice = T::of_word(word).ok_or_else(|| unknown(key, word, T::KEYWORDS))?;
    Ok(())
}

fn unknown(key: &'static str, word: &str, known: &[Keyword]) -> Refusal {
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

/// The paper's steps have their own laws: others chosen before are refused.
pub(super) fn set_contact(params: &mut Params, word: &str) -> Result<(), Refusal> {
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
            problem: "conflicts with `contact` = \"procedure\"".into(),
            allowed: "the procedure has the paper's laws only: \"roll-slip\" or \"none\", \"critical-load\", no repulsion, \
                      attraction, rolling friction or adhesion; give it a grid of its own"
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
    if laws.van_der_waals > 0.0 {
        return refuse("van_der_waals", laws.van_der_waals.to_string());
    }
    if laws.rolling_friction > 0.0 {
        return refuse("rolling_friction", laws.rolling_friction.to_string());
    }
    if laws.adhesion > 0.0 {
        return refuse("adhesion", laws.adhesion.to_string());
    }
    params.contact = ContactScheme::Procedure;
    Ok(())
}

pub(super) fn set_hydrodynamics(params: &mut Params, word: &str) -> Result<(), Refusal> {
    let mut chosen = params.hydrodynamics;
    read(&mut chosen, "hydrodynamics", word)?;
    // The parameters of a choice may have been set before its keyword.
    if chosen.index() != params.hydrodynamics.index() {
        params.hydrodynamics = chosen;
    }
    Ok(())
}

pub(super) fn set_tangential(params: &mut Params, word: &str) -> Result<(), Refusal> {
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
pub(super) fn set_spheres(params: &mut Params, value: f64) {
    params.spheres = value as usize;
}

/// Sets a volume fraction, 0 for none. An area fraction that was not given is then 0.
pub(in crate::model) fn set_volume_fraction(params: &mut Params, value: f64) {
    params.volume_fraction = (value != 0.0).then_some(value);
    // One that is given beside it stays, and is refused.
    if params.volume_fraction.is_some() && params.area_fraction.is_nan() {
        params.area_fraction = 0.0;
    }
}

/// Changes the laws, if they are chosen individually.
pub(super) fn set_law(params: &mut Params, change: impl FnOnce(&mut ContactLaws)) {
    if let Some(laws) = params.contact.chosen_laws() {
        change(laws);
    }
}

/// Whether friction can act.
pub(super) fn has_friction(params: &Params) -> bool {
    params.contact.laws().normal.touches() && params.has_friction()
}

/// Whether rolling friction can act: with friction, and a law that leaves pairs free to roll.
pub(super) fn resists_rolling(params: &Params) -> bool {
    has_friction(params) && rolling_friction::can_combine(params.contact.laws().tangential)
}

/// Whether contacts have laws, which the paper's steps have not.
pub(super) fn has_laws(params: &Params) -> bool {
    params.contact != ContactScheme::Procedure
}

/// Whether surfaces touch and may adhere.
pub(super) fn may_adhere(params: &Params) -> bool {
    params.contact.laws().normal.touches() && has_laws(params)
}

/// Whether there are two sizes.
pub(super) fn has_two_sizes(params: &Params) -> bool {
    params.size_ratio > 1.0 && params.sizes.is_none()
}

/// The keyword for sizes given by `size_ratio` and `large_fraction`.
pub(super) const ONE_OR_TWO: &str = "by size_ratio";

/// Sets these sizes: one or two by their ratio and fraction.
pub(super) fn set_sizes(params: &mut Params, word: &str) -> Result<(), Refusal> {
    if word == ONE_OR_TWO {
        params.sizes = None;
        return Ok(());
    }
    let sizes: Sizes = word.parse()?;
    params.sizes = None;
    match sizes.to_two() {
        Some([size_ratio, large_fraction]) => {
            params.size_ratio = size_ratio;
            params.large_fraction = large_fraction;
        }
        None => params.sizes = Some(sizes),
    }
    Ok(())
}

pub(super) fn is_soft(params: &Params) -> bool {
    params.contact.laws().is_soft()
}

/// Whether lubrication is constant below a gap, which keeps it finite for touching soft surfaces.
pub(super) fn has_lubrication_gap(params: &Params) -> bool {
    is_soft(params) && !params.hydrodynamics.admits_overlap()
}

pub(super) fn has_leading_order(params: &Params) -> bool {
    params.hydrodynamics.leading_order().is_some()
}

pub(super) fn has_spring(params: &Params) -> bool {
    params.contact.laws().normal.is_spring()
}

/// Whether there is a stiffness, of contacts or of tangential springs alone.
pub(super) fn has_stiffness(params: &Params) -> bool {
    params.contact.laws().has_stiffness()
}

pub(super) fn has_tangential_spring(params: &Params) -> bool {
    let laws = params.contact.laws();
    laws.normal.touches() && laws.tangential.has_spring()
}

/// k_t over k of springs. Of rigid contacts it is infinite, which is Coulomb's law.
pub(super) fn usual_tangential_stiffness(params: &Params) -> f64 {
    if has_spring(params) {
        DEFAULT_STIFFNESS
    } else {
        f64::INFINITY
    }
}

/// Whether only the repulsion separates the spheres.
pub(super) fn alone(params: &Params) -> bool {
    !params.contact.laws().normal.touches()
}

/// Whether surfaces repel or attract each other without contact.
pub(super) fn has_colloids(params: &Params) -> bool {
    params.contact.laws().has_colloids()
}

pub(super) fn attracts(params: &Params) -> bool {
    params.contact.laws().van_der_waals > 0.0
}

pub(super) fn repels(params: &Params) -> bool {
    params.contact.laws().repulsion > 0.0
}

/// The keywords of the choices that meet a condition.
fn keywords_where<T: Keywords>(holds: impl Fn(T) -> bool) -> String {
    let choices = T::ALL.iter().copied().filter(|choice| holds(*choice));
    let words: Vec<String> = choices
        .map(|choice| format!("{:?}", choice.word()))
        .collect();
    words.join(" or ")
}

pub(super) fn needs_spring() -> String {
    format!(
        "a spring: `contact` = {}",
        keywords_where(NormalLaw::is_spring)
    )
}

pub(super) fn needs_laws() -> String {
    "another `contact` than \"procedure\"".into()
}

pub(super) fn needs_stiffness() -> String {
    let laws = keywords_where(TangentialLaw::has_spring);
    format!("{}; or `tangential` = {laws}", needs_spring())
}

pub(super) fn needs_leading_order() -> String {
    let choice = keywords_where(|choice: Hydrodynamics| choice.leading_order().is_some());
    format!("`hydrodynamics` = {choice}")
}

pub(super) fn needs_lubrication_gap() -> String {
    let others = keywords_where(|choice: Hydrodynamics| !choice.admits_overlap());
    format!("a soft law (a spring or a repulsion) and `hydrodynamics` = {others}")
}

pub(super) fn needs_tangential_spring() -> String {
    format!(
        "`tangential` = {} on springs or rigid contacts",
        keywords_where(TangentialLaw::has_spring)
    )
}

pub(super) fn needs_rolling() -> String {
    let laws = rolling_friction::combinable_words();
    format!("`friction` above 0 and `tangential` = {laws}, which leave pairs free to roll")
}

pub(super) fn needs_touch() -> String {
    let touching = keywords_where(NormalLaw::touches);
    format!("surfaces that touch: `contact` = {touching}")
}

pub(super) fn needs_colloids() -> String {
    format!("{}, or `van_der_waals` above 0", needs_repulsion())
}

pub(super) fn needs_repulsion() -> String {
    let alone = keywords_where(|law: NormalLaw| !law.touches());
    format!("a repulsion: `repulsion` above 0 or `contact` = {alone}")
}
