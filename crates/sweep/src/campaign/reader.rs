//! Values of a TOML document with their places.
//!
//! A fault does not end the reading: it is recorded and the next value is read, so that all faults
//! are shown at once.

use super::error::Problem;
use super::sizes;
use crate::data::Value;
use crate::model::axes::Axis;
use sd_core::model::{Form, Range};
use std::collections::HashMap;
use std::ops;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value and its place in the text.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Located<T> {
    pub(super) value: T,
    pub(super) span: ops::Range<usize>,
}

/// The values of one key: a single value or a list.
#[derive(Debug, Clone)]
pub(super) struct Values {
    /// The values, at least one, all different.
    pub(super) all: Vec<Located<Value>>,
    pub(super) span: ops::Range<usize>,
}

/// A table of the document.
pub(super) struct Table<'t> {
    entries: &'t DeTable<'t>,
    /// Its place: the header.
    pub(super) span: ops::Range<usize>,
    /// Its name, for errors.
    name: &'static str,
    known: Vec<&'static str>,
    /// Whether all its keys are known.
    pub(super) is_known: bool,
}

impl<'t> Table<'t> {
    /// A table; its unknown keys are recorded as faults.
    pub(super) fn new(
        entries: &'t DeTable<'t>,
        span: ops::Range<usize>,
        name: &'static str,
        known: &[&'static str],
        problems: &mut Vec<Problem>,
    ) -> Self {
        let before = problems.len();
        for key in entries.keys() {
            let written = key.get_ref().as_ref();
            if !known.contains(&written) {
                problems.push(unknown_key(written, &key.span(), name, known));
            }
        }
        Self {
            entries,
            span,
            name,
            known: known.to_vec(),
            is_known: problems.len() == before,
        }
    }

    /// The value of a key, if present.
    pub(super) fn get(&self, key: &str) -> Option<&'t Spanned<DeValue<'t>>> {
        self.entries.get(key)
    }

    /// The fault of a missing key; none where an unknown key looks like a misspelling of it.
    pub(super) fn missing(&self, key: &str, example: &str) -> Option<Problem> {
        let known = || self.known.iter().copied();
        let unknown = self.entries.keys().map(|key| key.get_ref().as_ref());
        let meant = unknown
            .filter(|written| !known().any(|known| known == *written))
            .any(|written| nearest(written, known()) == Some(key));
        let problem = Problem::at(
            &self.span,
            format!("{} has no `{key}`", self.name),
            format!("add for example `{key} = {example}`"),
        )
        .labelled(format!("needs `{key}`"))
        .of_key(key);
        (!meant).then_some(problem)
    }
}

/// The fault of an unknown key, with a suggestion.
fn unknown_key(written: &str, span: &ops::Range<usize>, name: &str, known: &[&str]) -> Problem {
    let written = shortened(written);
    let mut allowed = format!("keys of {name}: {}", known.join(", "));
    if ["dimension", "dimensions", "dim"].contains(&written) {
        allowed = format!(
            "a layer is chosen by its `area_fraction`, a suspension by its `volume_fraction`; {allowed}"
        );
    }
    let meant = nearest(written, known.iter().copied()).map(|name| format!("`{name}`"));
    Problem::at(span, format!("unknown key `{written}` in {name}"), allowed)
        .labelled("not a key of this table")
        .of_key(written)
        .suggesting(meant.as_deref())
}

/// The key suggested for an unknown one.
pub(crate) fn nearest<'k>(written: &str, known: impl Iterator<Item = &'k str>) -> Option<&'k str> {
    let known: Vec<&str> = known.collect();
    // Names used elsewhere match exactly only: short ones resemble many keys.
    if let Some(axis) = Axis::named(written)
        && let Some(place) = known.iter().position(|name| *name == axis.key)
    {
        return Some(known[place]);
    }
    let written = shortened(written);
    // By a word that no other key has.
    let mut with_it = known
        .iter()
        .filter(|name| name.split(['_', '-']).any(|part| part == written));
    if let (Some(name), None) = (with_it.next(), with_it.next()) {
        return Some(name);
    }
    known
        .into_iter()
        .map(|name| (strsim::damerau_levenshtein(name, written), name))
        .min()
        .filter(|(distance, _)| *distance <= 3)
        .map(|(_, name)| name)
}

/// All valid values of a key; invalid ones are recorded. `None` if none is valid.
pub(super) fn values(
    written: &Spanned<DeValue<'_>>,
    key: &str,
    problems: &mut Vec<Problem>,
    read: impl Fn(&Spanned<DeValue<'_>>) -> Result<Value, Problem>,
) -> Option<Values> {
    let span = written.span();
    let single = std::slice::from_ref(written);
    let list: Vec<&Spanned<DeValue<'_>>> = match written.get_ref() {
        list @ DeValue::Array(_) if sizes::is_list_of_species(list) => single.iter().collect(),
        DeValue::Array(list) => list.iter().collect(),
        _ => single.iter().collect(),
    };
    if list.is_empty() {
        problems.push(
            Problem::at(
                &span,
                format!("`{key}` is empty"),
                "give at least one value",
            )
            .labelled("no value"),
        );
    }
    let mut seen = HashMap::with_capacity(list.len());
    let mut all: Vec<Located<Value>> = Vec::with_capacity(list.len());
    for written in list {
        let span = written.span();
        match read(written) {
            Err(problem) => problems.push(problem),
            Ok(value) => {
                if let Some(first) = seen.insert(value.tag(), span.clone()) {
                    problems.push(
                        Problem::at(
                            &span,
                            format!("`{key}` has the value {value} twice"),
                            "each value may occur once: a case is never run twice",
                        )
                        .labelled("again here")
                        .also(&first, "first here"),
                    );
                } else {
                    all.push(Located { value, span });
                }
            }
        }
    }
    (!all.is_empty()).then_some(Values { all, span })
}

/// A value of an axis.
pub(super) fn of_axis(written: &Spanned<DeValue<'_>>, axis: &Axis) -> Result<Value, Problem> {
    match &axis.form {
        Form::Choice(_) if axis.key == sizes::SIZES => sizes::read(written),
        Form::Choice(choice) => {
            let words: Vec<&str> = (choice.words)().iter().map(|word| word.word).collect();
            word(written, axis.key, &words).map(Value::Word)
        }
        Form::Number(of) => {
            let allowed = of.quantity.allowed();
            let range = &of.quantity.range;
            if of.whole {
                whole(written, axis.key, range, &allowed).map(Value::Count)
            } else {
                number(written, axis.key, range, &allowed).map(Value::Number)
            }
        }
    }
}

/// One of several words.
pub(super) fn word(
    written: &Spanned<DeValue<'_>>,
    key: &str,
    words: &[&'static str],
) -> Result<&'static str, Problem> {
    let allowed = || {
        let names: Vec<_> = words.iter().map(|name| format!("{name:?}")).collect();
        format!("`{key}` is {}", names.join(" or "))
    };
    let DeValue::String(text) = written.get_ref() else {
        return Err(wrong_type(written, key, allowed()));
    };
    words
        .iter()
        .copied()
        .find(|name| *name == text.as_ref())
        .ok_or_else(|| {
            let as_words = text.to_lowercase().replace(['_', ' '], "-");
            let meant = nearest(&as_words, words.iter().copied());
            let meant = meant.map(|word| format!("{word:?}"));
            Problem::at(
                &written.span(),
                format!("`{key}` cannot be {:?}", shortened(text)),
                allowed(),
            )
            .of_value(key, shortened(text))
            .suggesting(meant.as_deref())
        })
}

/// A number in a range; `allowed` describes the range.
pub(super) fn number(
    written: &Spanned<DeValue<'_>>,
    key: &str,
    range: &Range,
    allowed: &str,
) -> Result<f64, Problem> {
    let allowed = format!("`{key}` is a number {allowed}");
    let (value, digits) = match written.get_ref() {
        DeValue::Float(float) => (float.as_str().parse::<f64>().ok(), float.as_str()),
        DeValue::Integer(whole) => (
            i64::from_str_radix(whole.as_str(), whole.radix())
                .ok()
                .map(|whole| whole as f64),
            whole.as_str(),
        ),
        DeValue::String(text) if text.as_ref() == "inf" => {
            return Err(Problem::at(
                &written.span(),
                format!("`{key}` is a string, not a number"),
                format!("write inf without quotes; {allowed}"),
            )
            .of_value(key, text));
        }
        _ => return Err(wrong_type(written, key, allowed)),
    };
    match value {
        // A number too large for a float would otherwise pass as infinity.
        Some(value) if range.contains(value) && (value.is_finite() || digits.contains("inf")) => {
            Ok(value)
        }
        _ => Err(out_of_range(written, key, digits, allowed)),
    }
}

/// A whole number in a range; `allowed` describes the range.
pub(super) fn whole(
    written: &Spanned<DeValue<'_>>,
    key: &str,
    range: &Range,
    allowed: &str,
) -> Result<u64, Problem> {
    let allowed = format!("`{key}` is a whole number {allowed}");
    let DeValue::Integer(digits) = written.get_ref() else {
        return Err(wrong_type(written, key, allowed));
    };
    u64::from_str_radix(digits.as_str(), digits.radix())
        .ok()
        .filter(|value| range.contains(*value as f64))
        .ok_or_else(|| out_of_range(written, key, digits.as_str(), allowed))
}

fn out_of_range(
    written: &Spanned<DeValue<'_>>,
    key: &str,
    digits: &str,
    allowed: String,
) -> Problem {
    Problem::at(
        &written.span(),
        format!("`{key}` = {} is out of range", shortened(digits)),
        allowed,
    )
    .of_value(key, shortened(digits))
}

/// A value of the wrong type.
pub(super) fn wrong_type(
    written: &Spanned<DeValue<'_>>,
    key: &str,
    allowed: impl Into<String>,
) -> Problem {
    Problem::at(
        &written.span(),
        format!("`{key}` cannot be of type {}", written.get_ref().type_str()),
        allowed,
    )
    .of_key(key)
}

/// At most the first 40 characters, so that a hostile value cannot fill the screen.
fn shortened(text: &str) -> &str {
    text.char_indices()
        .nth(40)
        .map_or(text, |(end, _)| &text[..end])
}
