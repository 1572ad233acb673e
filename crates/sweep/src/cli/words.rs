//! Keywords as values of options.

use crate::model::axes::{AXES, Axis};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use sd_core::model::Keywords;

/// Reads one of the keywords of a choice.
pub(super) fn choice<T: Keywords + Send + Sync>() -> impl TypedValueParser<Value = T> {
    let words = T::KEYWORDS.iter();
    let words = words.map(|word| PossibleValue::new(word.word).help(word.meaning));
    PossibleValuesParser::new(words).try_map(|word| T::of_word(&word).ok_or("not a keyword"))
}

/// Reads the key of one of some axes, or its symbol.
pub(super) fn axis_among(
    is_meant: fn(&Axis) -> bool,
) -> impl TypedValueParser<Value = &'static Axis> {
    let names = AXES.iter().filter(|axis| is_meant(axis));
    let names = names.map(|axis| PossibleValue::new(axis.key).aliases(axis.other_names()));
    PossibleValuesParser::new(names)
        .try_map(|name| Axis::named(&name).ok_or("not an axis of a campaign"))
}
