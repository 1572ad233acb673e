//! Typed values of a TOML document, each with the place it was written at.

use super::error::Problem;
use std::collections::HashMap;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value and its place in the text.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Located<T> {
    /// The value.
    pub(super) value: T,
    /// Its place.
    pub(super) span: Range<usize>,
}

/// The values of one key: a single value or a list.
#[derive(Debug, Clone)]
pub(super) struct Axis<T> {
    /// The values, at least one, all different.
    pub(super) values: Vec<Located<T>>,
    /// The place of the whole.
    pub(super) span: Range<usize>,
}

impl<T> Axis<T> {
    /// One value that is not written in the file; errors about it point at `span`.
    pub(super) fn default_value(value: T, span: &Range<usize>) -> Self {
        Self {
            values: vec![Located {
                value,
                span: span.clone(),
            }],
            span: span.clone(),
        }
    }
}

/// A table of the document.
pub(super) struct Table<'t> {
    /// Its entries.
    entries: &'t DeTable<'t>,
    /// Its place: the header.
    pub(super) span: Range<usize>,
    /// Its name, for errors.
    name: &'static str,
}

impl<'t> Table<'t> {
    /// A table none of whose keys is unknown.
    pub(super) fn new(
        entries: &'t DeTable<'t>,
        span: Range<usize>,
        name: &'static str,
        known: &[&str],
    ) -> Result<Self, Problem> {
        // Tables do not keep their order; the first wrong key in the file is the one to show.
        let unknown = entries
            .keys()
            .filter(|key| !known.contains(&key.get_ref().as_ref()))
            .min_by_key(|key| key.span().start);
        if let Some(key) = unknown {
            let written = key.get_ref().as_ref();
            let close = known
                .iter()
                .map(|name| (strsim::damerau_levenshtein(name, shortened(written)), name))
                .min()
                .filter(|(distance, _)| *distance <= 3);
            let mut allowed = format!("keys of {name}: {}", known.join(", "));
            if let Some((_, name)) = close {
                allowed = format!("did you mean `{name}`? {allowed}");
            }
            return Err(Problem::at(
                &key.span(),
                format!("unknown key `{}` in {name}", shortened(written)),
                allowed,
            )
            .labelled("not a key of this table"));
        }
        Ok(Self {
            entries,
            span,
            name,
        })
    }

    /// The value of a key, if it is there.
    pub(super) fn get(&self, key: &str) -> Option<&'t Spanned<DeValue<'t>>> {
        self.entries.get(key)
    }

    /// The value of a key that must be there.
    pub(super) fn need(
        &self,
        key: &str,
        example: &str,
    ) -> Result<&'t Spanned<DeValue<'t>>, Problem> {
        self.get(key).ok_or_else(|| {
            Problem::at(
                &self.span,
                format!("{} has no `{key}`", self.name),
                format!("add for example `{key} = {example}`"),
            )
            .labelled(format!("needs `{key}`"))
        })
    }

    /// All values of a key, or nothing if it is not there.
    pub(super) fn axis<T: Distinct>(
        &self,
        key: &'static str,
        read: impl Fn(&Spanned<DeValue<'_>>, &str) -> Result<Located<T>, Problem>,
    ) -> Result<Option<Axis<T>>, Problem> {
        let Some(written) = self.get(key) else {
            return Ok(None);
        };
        let span = written.span();
        let values = match written.get_ref() {
            DeValue::Array(list) => list
                .iter()
                .map(|value| read(value, key))
                .collect::<Result<Vec<_>, _>>()?,
            _ => vec![read(written, key)?],
        };
        if values.is_empty() {
            return Err(Problem::at(
                &span,
                format!("`{key}` is empty"),
                "give at least one value",
            )
            .labelled("no value"));
        }
        let mut seen = HashMap::with_capacity(values.len());
        for located in &values {
            if let Some(first) = seen.insert(located.value.identity(), &located.span) {
                return Err(Problem::at(
                    &located.span,
                    format!("`{key}` has the value {} twice", located.value.written()),
                    "each value once: the same case is never run twice",
                )
                .labelled("again here")
                .also(first, "first here"));
            }
        }
        Ok(Some(Axis { values, span }))
    }
}

/// Values that can be told apart.
pub(super) trait Distinct {
    /// Equal exactly for equal values.
    fn identity(&self) -> u64;
    /// As a person would write it.
    fn written(&self) -> String;
}

impl Distinct for f64 {
    fn identity(&self) -> u64 {
        (self + 0.0).to_bits()
    }
    fn written(&self) -> String {
        self.to_string()
    }
}

impl Distinct for u64 {
    fn identity(&self) -> u64 {
        *self
    }
    fn written(&self) -> String {
        self.to_string()
    }
}

/// One of several words.
pub(super) fn word<T: Copy>(
    written: &Spanned<DeValue<'_>>,
    key: &str,
    choices: &[(&str, T)],
) -> Result<Located<T>, Problem> {
    let allowed = || {
        let names: Vec<_> = choices
            .iter()
            .map(|(name, _)| format!("{name:?}"))
            .collect();
        format!("`{key}` is {}", names.join(" or "))
    };
    let DeValue::String(text) = written.get_ref() else {
        return Err(wrong_type(written, key, allowed()));
    };
    choices
        .iter()
        .find(|(name, _)| *name == text.as_ref())
        .map(|(_, value)| Located {
            value: *value,
            span: written.span(),
        })
        .ok_or_else(|| {
            Problem::at(
                &written.span(),
                format!("`{key}` cannot be {:?}", shortened(text)),
                allowed(),
            )
        })
}

/// A number in a range given in words and as a test.
pub(super) fn number(
    written: &Spanned<DeValue<'_>>,
    key: &str,
    range: &str,
    inside: impl Fn(f64) -> bool,
) -> Result<Located<f64>, Problem> {
    let allowed = format!("`{key}` is a number {range}");
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
                format!("`{key}` is text, not a number"),
                format!("write inf without quotes; {allowed}"),
            ));
        }
        _ => return Err(wrong_type(written, key, allowed)),
    };
    match value {
        // A number too large for a float would otherwise pass as infinity.
        Some(value) if inside(value) && (value.is_finite() || digits.contains("inf")) => {
            Ok(Located {
                value,
                span: written.span(),
            })
        }
        _ => Err(Problem::at(
            &written.span(),
            format!("`{key}` = {} is out of range", shortened(digits)),
            allowed,
        )),
    }
}

/// A whole number in a range.
pub(super) fn whole(
    written: &Spanned<DeValue<'_>>,
    key: &str,
    range: std::ops::RangeInclusive<u64>,
) -> Result<Located<u64>, Problem> {
    let allowed = format!(
        "`{key}` is a whole number from {} to {}",
        range.start(),
        range.end()
    );
    let DeValue::Integer(digits) = written.get_ref() else {
        return Err(wrong_type(written, key, allowed));
    };
    u64::from_str_radix(digits.as_str(), digits.radix())
        .ok()
        .filter(|value| range.contains(value))
        .map(|value| Located {
            value,
            span: written.span(),
        })
        .ok_or_else(|| {
            Problem::at(
                &written.span(),
                format!("`{key}` = {} is out of range", shortened(digits.as_str())),
                allowed,
            )
        })
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
}

/// At most the first 40 characters, so that a hostile value cannot fill the screen.
fn shortened(text: &str) -> &str {
    text.char_indices()
        .nth(40)
        .map_or(text, |(end, _)| &text[..end])
}
