//! Values of axes: numbers, words, and the sizes of the spheres, which are species or a
//! distribution with its spread.

use super::error::Problem;
use super::reader::{
    Entry, Faults, Reader, Values, listed, number, values, whole, word, wrong_type,
};
use crate::data::Value;
use crate::model::axes::{Axis, interned};
use sd_core::model::{Distribution, FlowType, Form, Keywords as _, Range, Refusal, Sizes};
use std::ops;
use toml::Spanned;
use toml::de::DeValue;

/// The key of sizes.
pub(super) const SIZES: &str = "sizes";
/// The key of the type of flow.
pub(super) const FLOW: &str = "flow";
/// What is allowed of it.
const FLOWS: &str = "\"shear\", \"planar-extension\", \"uniaxial\", \"biaxial\" or a mixture such as { shear = 1.0, extension = 0.5 }";
/// The key of a radius, which distinguishes a list of species from a list of values.
const RADIUS: &str = "radius";
/// Keys of fractions: of number, of area and of volume, with the power of the radius in them.
const FRACTIONS: [(&str, i32); 3] = [("fraction", 0), ("area", 2), ("volume", 3)];
/// What is allowed.
const ALLOWED: &str = "`sizes` is { lognormal = 0.2 }, with schulz or uniform in its place, or a list of species \
                       [{ radius = 1.0, fraction = 0.5 }, { radius = 1.4, fraction = 0.5 }]";
/// Any number: the owner of the value checks its range.
const ANY: Range = Range::from_to(f64::NEG_INFINITY, f64::INFINITY);

/// All valid values of an axis; invalid ones are recorded.
pub(super) fn axis_values(written: Entry<'_>, axis: &Axis, faults: &Faults) -> Option<Values> {
    let list = if is_list_of_species(written) {
        vec![written]
    } else {
        listed(written)
    };
    values(&list, written.span(), axis.key, faults, |one| {
        of_axis(one, axis)
    })
}

/// Reads a type of flow: its keyword, the text of a mixture as tables have it, or its two rates.
pub(super) fn flow(written: Entry<'_>) -> Result<FlowType, Problem> {
    let refused = |refusal: Refusal| {
        let problem = format!("`{FLOW}` = {} {}", refusal.value, refusal.problem);
        Problem::at(&written.span(), problem, refusal.allowed).of_value(FLOW, &refusal.value)
    };
    match written.get_ref() {
        DeValue::String(text) => text.parse().map_err(refused),
        DeValue::Table(_) => with_keys(
            written,
            [FLOW, "`flow`"],
            FLOWS,
            &["shear", "extension"],
            |table| {
                let rate = |key: &'static str| {
                    let Some(written) = table.get(key) else {
                        return Ok(0.0);
                    };
                    number(written, key, &ANY, "from 0")
                };
                FlowType::mixture(rate("shear")?, rate("extension")?).map_err(refused)
            },
        ),
        _ => Err(wrong_type(written, FLOW, FLOWS)),
    }
}

/// A value of an axis.
pub(super) fn of_axis(written: Entry<'_>, axis: &Axis) -> Result<Value, Problem> {
    match &axis.form {
        Form::Choice(_) if axis.key == SIZES => sizes(written),
        Form::Choice(_) if axis.key == FLOW => {
            flow(written).map(|flow| interned(&flow.to_string()))
        }
        Form::Choice(choice) => {
            let words: Vec<&str> = (choice.words)().iter().map(|word| word.word).collect();
            word(written, axis.key, &words).map(Value::Word)
        }
        Form::Number(of) => {
            let (range, allowed) = (&of.quantity.range, of.quantity.allowed());
            if of.whole {
                whole(written, axis.key, range, &allowed).map(Value::Count)
            } else {
                number(written, axis.key, range, &allowed).map(Value::Number)
            }
        }
    }
}

/// Whether a list is a single value: a list of species.
fn is_list_of_species(written: Entry<'_>) -> bool {
    let is_species = |one: &Spanned<DeValue<'_>>| matches!(one.get_ref(), DeValue::Table(table) if table.contains_key(RADIUS));
    matches!(written.get_ref(), DeValue::Array(list) if list.iter().any(is_species))
}

/// Reads sizes.
fn sizes(written: Entry<'_>) -> Result<Value, Problem> {
    let sizes = match written.get_ref() {
        DeValue::Table(_) => distribution(written)?,
        DeValue::Array(list) => species(list, &written.span())?,
        // Their form in tables.
        DeValue::String(text) => {
            let sizes: Result<Sizes, Refusal> = text.parse();
            sizes.map_err(|refusal| refused(refusal, &written.span()))?
        }
        _ => return Err(wrong_type(written, SIZES, ALLOWED)),
    };
    Ok(interned(&sizes.to_string()))
}

/// A distribution: its name and its spread.
fn distribution(written: Entry<'_>) -> Result<Sizes, Problem> {
    let names: Vec<&'static str> = Distribution::KEYWORDS
        .iter()
        .map(|word| word.word)
        .collect();
    with_keys(written, [SIZES, "`sizes`"], ALLOWED, &names, |table| {
        let mut given = Distribution::ALL
            .iter()
            .filter_map(|distribution| Some((*distribution, table.get(distribution.word())?)));
        let (Some((distribution, spread)), None) = (given.next(), given.next()) else {
            let problem = "`sizes` needs one distribution";
            return Err(Problem::at(&written.span(), problem, ALLOWED).of_key(SIZES));
        };
        let allowed = "above 0: the standard deviation of the radius over its mean; several are a list, as in \
                       sizes = [{ lognormal = 0.1 }, { lognormal = 0.3 }]";
        let value = number(spread, distribution.word(), &ANY, allowed)?;
        Sizes::distribution(distribution, value).map_err(|refusal| refused(refusal, &spread.span()))
    })
}

/// Species: radii in any one unit, each with its fraction of the number, the area or the volume.
fn species(list: &[Spanned<DeValue<'_>>], span: &ops::Range<usize>) -> Result<Sizes, Problem> {
    let [number_key, area, volume] = FRACTIONS.map(|(key, _)| key);
    let known = [RADIUS, number_key, area, volume];
    let mut all = Vec::with_capacity(list.len());
    let mut power = None;
    for written in list {
        let one = with_keys(written, [SIZES, "`sizes`"], ALLOWED, &known, |table| {
            let mut fractions = FRACTIONS
                .iter()
                .filter_map(|(key, power)| Some((*key, *power, table.get(key)?)));
            let (Some(radius), Some((key, of, fraction)), None) =
                (table.get(RADIUS), fractions.next(), fractions.next())
            else {
                let problem = "a species needs a radius and one fraction";
                let allowed = "{ radius = 1.4, fraction = 0.5 }: `fraction` of the number, or in its place `area` or `volume`";
                return Err(Problem::at(&written.span(), problem, allowed).of_key(SIZES));
            };
            if *power.get_or_insert(of) != of {
                let problem = "species give different kinds of fractions";
                let allowed = "one kind for all: `fraction` of the number, `area` or `volume`";
                return Err(Problem::at(&fraction.span(), problem, allowed).of_key(SIZES));
            }
            let one = [
                number(radius, RADIUS, &ANY, "above 0")?,
                number(fraction, key, &ANY, "above 0")?,
            ];
            // One species is no complete list, but its own faults have its own place.
            Sizes::species(&[[one[0], 1.0]], 0)
                .map_err(|refusal| refused(refusal, &radius.span()))?;
            Ok(one)
        })?;
        all.push(one);
    }
    Sizes::species(&all, power.unwrap_or(0)).map_err(|refusal| refused(refusal, span))
}

/// Reads a table with these keys alone.
fn with_keys<T>(
    written: Entry<'_>,
    [key, name]: [&'static str; 2],
    allowed: &str,
    known: &[&'static str],
    read: impl FnOnce(&Reader<'_>) -> Result<T, Problem>,
) -> Result<T, Problem> {
    let DeValue::Table(entries) = written.get_ref() else {
        return Err(wrong_type(written, key, allowed));
    };
    let faults = Faults::default();
    let found = read(&Reader::new(entries, written.span(), name, known, &faults));
    match faults.all().into_iter().next() {
        Some(problem) => Err(problem),
        None => found,
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
