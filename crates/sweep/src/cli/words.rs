//! Keywords as values of options.

use crate::model::axes::{AXES, Axis};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue};
use sd_core::model::Keywords;
use std::ffi::OsStr;

/// Reads one of the keywords of a choice.
pub(super) fn choice<T: Keywords + Send + Sync>() -> impl TypedValueParser<Value = T> {
    let words = T::KEYWORDS.iter();
    let words = words.map(|word| PossibleValue::new(word.word).help(word.meaning));
    PossibleValuesParser::new(words).try_map(|word| T::of_word(&word).ok_or("not a keyword"))
}

/// Reads one of the keywords of a choice whose command shares the option with another command: a
/// keyword of the other names that one.
pub(super) fn choice_beside<T: Keywords + Send + Sync, Other: Keywords>(
    other: &'static str,
) -> impl TypedValueParser<Value = T> {
    let words = Other::KEYWORDS.iter().map(|word| word.word);
    Beside {
        own: choice::<T>(),
        words: words.collect(),
        other,
    }
}

#[derive(Clone)]
struct Beside<P> {
    own: P,
    words: Vec<&'static str>,
    other: &'static str,
}

impl<P: TypedValueParser> TypedValueParser for Beside<P> {
    type Value = P::Value;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &OsStr,
    ) -> Result<P::Value, clap::Error> {
        self.own
            .parse_ref(command, argument, value)
            .map_err(|mut error| {
                let written = value.to_string_lossy().replace('_', "-").to_lowercase();
                let meant = match written.as_str() {
                    "g-r" | "g(r)" | "gr" | "rdf" => "pair-distribution",
                    written => written,
                };
                if self.words.contains(&meant) {
                    let other = self.other;
                    let hint = format!("`sweep {other} --figure FILE.svg --kind {meant}` draws it");
                    let hint = ContextValue::StyledStrs(vec![hint.into()]);
                    error.remove(ContextKind::SuggestedValue);
                    error.insert(ContextKind::Suggested, hint);
                }
                error
            })
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        self.own.possible_values()
    }
}

/// Reads the key of one of some axes, or its symbol.
pub(super) fn axis_among(
    is_meant: fn(&Axis) -> bool,
) -> impl TypedValueParser<Value = &'static Axis> {
    let names = AXES.iter().filter(|axis| is_meant(axis));
    let names = names.map(|axis| PossibleValue::new(axis.key).aliases(axis.other_names()));
    let own = PossibleValuesParser::new(names)
        .try_map(|name| Axis::named(&name).ok_or("not an axis of a campaign"));
    OfAxis(own)
}

/// Adds to its errors that symbols are names too.
#[derive(Clone)]
struct OfAxis<P>(P);

impl<P: TypedValueParser> TypedValueParser for OfAxis<P> {
    type Value = P::Value;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &OsStr,
    ) -> Result<P::Value, clap::Error> {
        self.0
            .parse_ref(command, argument, value)
            .map_err(|mut error| {
                let hint = "their symbols name them too, such as φ, ν and Γ, or phi, nu and Gamma";
                let hint = ContextValue::StyledStrs(vec![hint.into()]);
                error.insert(ContextKind::Suggested, hint);
                error
            })
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        self.0.possible_values()
    }
}
