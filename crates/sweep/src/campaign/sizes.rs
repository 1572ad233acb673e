//! Sizes of the spheres in a grid: species, or a distribution with its spread.

use super::error::Problem;
use super::reader::{Table, number, wrong_type};
use crate::data::Value;
use crate::model::axes::interned;
use sd_core::model::{Distribution, Range, Refusal, Sizes, Words as _};
use std::ops;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Their key.
pub(super) const SIZES: &str = "sizes";
/// The key of a radius, which distinguishes a list of species from a list of values.
const RADIUS: &str = "radius";
/// Keys of fractions: of number, of area and of volume, with the power of the radius in them.
const FRACTIONS: [(&str, i32); 3] = [("fraction", 0), ("area", 2), ("volume", 3)];
/// What is allowed.
const ALLOWED: &str = "`sizes` is { lognormal = 0.2 }, with schulz or uniform in its place, or a list of species \
                       [{ radius = 1.0, fraction = 0.5 }, { radius = 1.4, fraction = 0.5 }]";
/// Any number: the owner of the value checks its range.
const ANY: Range = Range::from_to(f64::NEG_INFINITY, f64::INFINITY);

/// Whether a list is a single value: a list of species.
pub(super) fn is_list_of_species(written: &DeValue<'_>) -> bool {
    let is_species = |one: &Spanned<DeValue<'_>>| matches!(one.get_ref(), DeValue::Table(table) if table.contains_key(RADIUS));
    matches!(written, DeValue::Array(list) if list.iter().any(is_species))
}

/// Reads sizes.
pub(super) fn read(written: &Spanned<DeValue<'_>>) -> Result<Value, Problem> {
    let sizes = match written.get_ref() {
        DeValue::Table(entries) => distribution(entries, &written.span())?,
        DeValue::Array(list) => species(list, &written.span())?,
        // Their form in tables.
        DeValue::String(text) => {
            let sizes: Result<Sizes, Refusal> = text.parse();
            return match sizes {
                Ok(sizes) => Ok(interned(&sizes.to_string())),
                Err(refusal) => Err(refused(refusal, &written.span())),
            };
        }
        _ => return Err(wrong_type(written, SIZES, ALLOWED)),
    };
    Ok(interned(&sizes.to_string()))
}

/// A distribution: its name and its spread.
fn distribution(entries: &DeTable<'_>, span: &ops::Range<usize>) -> Result<Sizes, Problem> {
    let names = Distribution::WORDS.iter().map(|word| word.word);
    let names: Vec<&'static str> = names.collect();
    let table = table(entries, span, &names)?;
    let mut written = Distribution::ALL
        .iter()
        .filter_map(|distribution| Some((*distribution, table.get(distribution.word())?)));
    let (Some((distribution, spread)), None) = (written.next(), written.next()) else {
        let problem = "`sizes` needs one distribution";
        return Err(Problem::at(span, problem, ALLOWED).of_key(SIZES));
    };
    let allowed = "above 0: the standard deviation of the radius over its mean";
    let value = number(spread, distribution.word(), &ANY, allowed)?;
    Sizes::distribution(distribution, value).map_err(|refusal| refused(refusal, &spread.span()))
}

/// Species: radii in any one unit, each with its fraction of the number, the area or the volume.
fn species(list: &[Spanned<DeValue<'_>>], span: &ops::Range<usize>) -> Result<Sizes, Problem> {
    let known: Vec<&'static str> = std::iter::once(RADIUS)
        .chain(FRACTIONS.map(|(key, _)| key))
        .collect();
    let mut all = Vec::with_capacity(list.len());
    let mut power = None;
    for written in list {
        let DeValue::Table(entries) = written.get_ref() else {
            return Err(wrong_type(written, SIZES, ALLOWED));
        };
        let table = table(entries, &written.span(), &known)?;
        let radius = table.get(RADIUS);
        let mut fractions = FRACTIONS
            .iter()
            .filter_map(|(key, power)| Some((*key, *power, table.get(key)?)));
        let (Some(radius), Some((key, of, fraction)), None) =
            (radius, fractions.next(), fractions.next())
        else {
            return Err(Problem::at(
                &written.span(),
                "a species needs a radius and one fraction",
                "{ radius = 1.4, fraction = 0.5 }: `fraction` of the number, or in its place `area` or `volume`",
            )
            .of_key(SIZES));
        };
        if *power.get_or_insert(of) != of {
            return Err(Problem::at(
                &fraction.span(),
                "species give different kinds of fractions",
                "one kind for all: `fraction` of the number, `area` or `volume`",
            )
            .of_key(SIZES));
        }
        let one = [
            number(radius, RADIUS, &ANY, "above 0")?,
            number(fraction, key, &ANY, "above 0")?,
        ];
        // One species is no complete list, but its own faults have its own place.
        if let Err(refusal) = Sizes::species(&[[one[0], 1.0]], 0) {
            return Err(refused(refusal, &radius.span()));
        }
        all.push(one);
    }
    Sizes::species(&all, power.unwrap_or(0)).map_err(|refusal| refused(refusal, span))
}

/// A table with these keys alone.
fn table<'t>(
    entries: &'t DeTable<'t>,
    span: &ops::Range<usize>,
    known: &[&'static str],
) -> Result<Table<'t>, Problem> {
    let mut problems = Vec::new();
    let table = Table::new(entries, span.clone(), "`sizes`", known, &mut problems);
    match problems.into_iter().next() {
        Some(problem) => Err(problem),
        None => Ok(table),
    }
}

/// The problem of sizes that are refused.
fn refused(refusal: Refusal, span: &ops::Range<usize>) -> Problem {
    let Refusal {
        value,
        problem,
        allowed,
        ..
    } = refusal;
    Problem::at(span, format!("`{SIZES}`: {value} {problem}"), allowed).of_value(SIZES, &value)
}
