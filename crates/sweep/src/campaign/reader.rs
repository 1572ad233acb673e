//! Tables and values of a TOML document with their places.
//!
//! A fault does not end the reading: it is recorded and the next value is read, so that all faults
//! are shown at once.

use super::error::Problem;
use crate::data::Value;
use crate::model::axes::Axis;
use sd_core::model::Range;
use std::cell::RefCell;
use std::collections::HashMap;
use std::ops;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value of the document.
pub(super) type Entry<'t> = &'t Spanned<DeValue<'t>>;

/// The faults found so far.
#[derive(Debug, Default)]
pub(super) struct Faults(RefCell<Vec<Problem>>);

impl Faults {
    pub(super) fn push(&self, problem: Problem) {
        self.0.borrow_mut().push(problem);
    }

    /// The value that was read; a fault is recorded.
    pub(super) fn ok<T>(&self, read: Result<T, Problem>) -> Option<T> {
        read.map_err(|problem| self.push(problem)).ok()
    }

    pub(super) fn count(&self) -> usize {
        self.0.borrow().len()
    }

    pub(super) fn all(self) -> Vec<Problem> {
        self.0.into_inner()
    }
}

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

/// Reads a table of the document. Missing and invalid values are recorded as faults.
#[derive(Debug, Clone)]
pub(super) struct Reader<'t> {
    /// `None` for a table that is not in the document.
    entries: Option<&'t DeTable<'t>>,
    /// Its place: the header.
    pub(super) span: ops::Range<usize>,
    /// Its name, for errors.
    name: &'static str,
    known: Vec<&'static str>,
    pub(super) faults: &'t Faults,
    /// Number of faults before this table was read.
    before: usize,
}

impl<'t> Reader<'t> {
    /// A reader of a table; its unknown keys are recorded as faults.
    pub(super) fn new(
        entries: &'t DeTable<'t>,
        span: ops::Range<usize>,
        name: &'static str,
        known: &[&'static str],
        faults: &'t Faults,
    ) -> Self {
        let before = faults.count();
        for key in entries.keys() {
            let written = key.get_ref().as_ref();
            if !known.contains(&written) {
                faults.push(unknown_key(written, &key.span(), name, known));
            }
        }
        Self {
            entries: Some(entries),
            before,
            ..Self::empty(span, name, known, faults)
        }
    }

    /// A reader of a table that is not in the document; its faults are shown at `span`.
    pub(super) fn empty(
        span: ops::Range<usize>,
        name: &'static str,
        known: &[&'static str],
        faults: &'t Faults,
    ) -> Self {
        Self {
            entries: None,
            span,
            name,
            known: known.to_vec(),
            faults,
            before: faults.count(),
        }
    }

    /// Whether no fault was found since it began.
    pub(super) fn is_whole(&self) -> bool {
        self.faults.count() == self.before
    }

    /// The value of a key, if present.
    pub(super) fn get(&self, key: &str) -> Option<Entry<'t>> {
        self.entries?.get(key)
    }

    /// The value of a key that must be present.
    pub(super) fn need(&self, key: &str, example: &str) -> Option<Entry<'t>> {
        let found = self.get(key);
        if found.is_none() {
            self.note_missing(key, &format!("add for example `{key} = {example}`"));
        }
        found
    }

    /// Place of a value, or of the table.
    pub(super) fn place(&self, key: &str) -> ops::Range<usize> {
        self.get(key)
            .map_or_else(|| self.span.clone(), Spanned::span)
    }

    /// A number, if present; `note` explains its range.
    pub(super) fn number(&self, key: &str, range: &Range, note: &str) -> Option<f64> {
        let read = number(self.get(key)?, key, range, &format!("{range}{note}"));
        self.faults.ok(read)
    }

    /// A whole number, if present; `note` explains its range.
    pub(super) fn whole(&self, key: &str, range: &Range, note: &str) -> Option<u64> {
        let read = whole(self.get(key)?, key, range, &format!("{range}{note}"));
        self.faults.ok(read)
    }

    /// One of several words, if present.
    pub(super) fn word(&self, key: &str, words: &[&'static str]) -> Option<&'static str> {
        self.faults.ok(word(self.get(key)?, key, words))
    }

    /// A table, if present.
    pub(super) fn table(
        &self,
        key: &'static str,
        name: &'static str,
        known: &[&'static str],
        example: &str,
    ) -> Option<Self> {
        let written = self.get(key)?;
        let DeValue::Table(entries) = written.get_ref() else {
            let allowed = format!("write a table: {example}");
            self.faults.push(wrong_type(written, key, allowed));
            return None;
        };
        Some(Self::new(entries, written.span(), name, known, self.faults))
    }

    /// Tables of one key, each with its place.
    pub(super) fn tables(
        &self,
        key: &str,
        name: &str,
    ) -> Vec<(ops::Range<usize>, &'t DeTable<'t>)> {
        let Some(written) = self.get(key) else {
            return Vec::new();
        };
        let list = listed(written);
        if list.is_empty() {
            let allowed = format!("give at least one table {name}");
            let empty = Problem::at(&written.span(), format!("`{key}` is empty"), allowed);
            self.faults.push(empty);
        }
        let table = |one: Entry<'t>| {
            if let DeValue::Table(entries) = one.get_ref() {
                return Some((one.span(), entries));
            }
            let allowed = format!("write tables: {name}");
            self.faults.push(wrong_type(one, key, allowed));
            None
        };
        list.into_iter().filter_map(table).collect()
    }

    /// Records the fault of a missing key, unless an unknown key looks like a misspelling of it.
    pub(super) fn note_missing(&self, key: &str, allowed: &str) {
        if !self.is_misspelt(key) {
            self.faults.push(self.missing(key, allowed));
        }
    }

    /// The fault of a missing key.
    pub(super) fn missing(&self, key: &str, allowed: &str) -> Problem {
        Problem::at(&self.span, format!("{} has no `{key}`", self.name), allowed)
            .labelled(format!("needs `{key}`"))
            .of_key(key)
    }

    fn is_misspelt(&self, key: &str) -> bool {
        let known = || self.known.iter().copied();
        let keys = self.entries.into_iter().flat_map(|entries| entries.keys());
        keys.map(|key| key.get_ref().as_ref())
            .filter(|written| !known().any(|known| known == *written))
            .any(|written| nearest(written, known()) == Some(key))
    }
}

/// What the program does not have, by keys that users of other programs try.
const ABSENT: [(&[&str], &str); 3] = [
    (&["wall", "walls"], "wall"),
    (&["gravity", "buoyancy", "weight"], "gravity"),
    (
        &[
            "stokes_number",
            "stokes",
            "reynolds",
            "reynolds_number",
            "inertia",
        ],
        "inertia",
    ),
];

/// The fault of an unknown key, with a suggestion.
fn unknown_key(written: &str, span: &ops::Range<usize>, name: &str, known: &[&str]) -> Problem {
    let written = shortened(written);
    // Of two names of a key that in files.
    let is_column =
        |key: &&&str| Axis::of_key(key).is_some_and(|axis| axis.written_key().is_some());
    let listed: Vec<&str> = known
        .iter()
        .filter(|key| !is_column(key))
        .copied()
        .collect();
    let mut allowed = format!("keys of {name}: {}", listed.join(", "));
    if ["dimension", "dimensions", "dim"].contains(&written) {
        allowed = format!(
            "a layer is chosen by its `area_fraction`, a suspension by its `volume_fraction`; {allowed}"
        );
    }
    if let Some((_, what)) = ABSENT.iter().find(|(keys, _)| keys.contains(&written)) {
        allowed = format!("there is no {what} in this version; {allowed}");
    }
    if ["temperature", "brownian", "kt"].contains(&written) {
        allowed = format!("Brownian motion has a `peclet` or a `thermal_load`; {allowed}");
    }
    if ["particle_pressure", "normal_stress", "confining_pressure"].contains(&written) {
        allowed = format!(
            "an imposed pressure has a `viscous_number` or a `macroscopic_friction`; {allowed}"
        );
    }
    if ["lognormal", "uniform", "species"].contains(&written) && known.contains(&"sizes") {
        allowed = format!(
            "distributions are values of `sizes`, as in sizes = {{ lognormal = 0.2 }}; {allowed}"
        );
    }
    let is_of_grids = Axis::of_key(written).is_some();
    if is_of_grids {
        allowed = format!("a key of grids: write it below a line [[grid]]; {allowed}");
    }
    let meant = nearest(written, known.iter().copied()).filter(|_| !is_of_grids);
    let meant = meant.map(|name| format!("`{name}`"));
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
        // More than half of a word must agree: `n1` is not a slip for `n2`.
        .filter(|(distance, _)| *distance <= 3 && 2 * distance < written.chars().count())
        .map(|(_, name)| name)
}

/// The values of a list, or a single value.
pub(super) fn listed(written: Entry<'_>) -> Vec<Entry<'_>> {
    match written.get_ref() {
        DeValue::Array(list) => list.iter().collect(),
        _ => vec![written],
    }
}

/// All valid values of a key, given as a list; invalid ones are recorded. `None` if none is valid.
pub(super) fn values<'t>(
    list: &[Entry<'t>],
    span: ops::Range<usize>,
    key: &str,
    faults: &Faults,
    read: impl Fn(Entry<'t>) -> Result<Value, Problem>,
) -> Option<Values> {
    if list.is_empty() {
        let empty = format!("`{key}` is empty");
        let problem = Problem::at(&span, empty, "give at least one value");
        faults.push(problem.labelled("no value"));
    }
    let mut seen = HashMap::with_capacity(list.len());
    let mut all: Vec<Located<Value>> = Vec::with_capacity(list.len());
    for written in list {
        let span = written.span();
        let Some(value) = faults.ok(read(written)) else {
            continue;
        };
        match seen.insert(value.tag(), span.clone()) {
            Some(first) => faults.push(
                Problem::at(
                    &span,
                    format!("`{key}` has the value {value} twice"),
                    "each value may occur once: a case is never run twice",
                )
                .labelled("again here")
                .also(&first, "first here"),
            ),
            None => all.push(Located { value, span }),
        }
    }
    (!all.is_empty()).then_some(Values { all, span })
}

/// One of several words.
pub(super) fn word(
    written: Entry<'_>,
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
    written: Entry<'_>,
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
    written: Entry<'_>,
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

fn out_of_range(written: Entry<'_>, key: &str, digits: &str, allowed: String) -> Problem {
    Problem::at(
        &written.span(),
        format!("`{key}` = {} is out of range", shortened(digits)),
        allowed,
    )
    .of_value(key, shortened(digits))
}

/// A value of the wrong type.
pub(super) fn wrong_type(written: Entry<'_>, key: &str, allowed: impl Into<String>) -> Problem {
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
