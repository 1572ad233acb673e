//! The unit of times in a file: strain, or the time a²/D0 of diffusion over a radius.

use super::axis_values::axis_values;
use super::error::Problem;
use super::protocol::TIME_UNIT;
use super::reader::{Entry, Faults, Located, Reader};
use super::segments::SEGMENT;
use crate::data::Value;
use crate::model::axes::Axis;
use std::ops::Range;
use toml::de::DeTable;

/// Its words, the default first.
const WORDS: [&str; 2] = ["strain", "diffusion"];
/// The axis that relates both.
pub(super) const PECLET: &str = "peclet";

/// Strain in one unit of time of the file; at a Péclet number of 0, where nothing is sheared, times
/// stay times.
pub(super) fn in_strain(
    protocol: &Reader<'_>,
    grids: &[(Range<usize>, &DeTable<'_>)],
    faults: &Faults,
) -> f64 {
    let is_diffusion = protocol.word(TIME_UNIT, &WORDS) == Some(WORDS[1]);
    let numbers = grids.iter().map(|(_, grid)| peclets(grid.get(PECLET)));
    let numbers: Vec<Option<Vec<Located<Value>>>> = numbers.collect();
    let given = || numbers.iter().flatten().flatten();
    if !is_diffusion {
        if let Some(zero) = given().find(|number| is_rest(number)) {
            let problem = "`peclet` = 0 is fluid at rest, whose times are no strains";
            let allowed = "`time_unit = \"diffusion\"` in [protocol]: times are then in a²/D0";
            faults.push(Problem::at(&zero.span, problem, allowed).of_key(PECLET));
        }
        return 1.0;
    }
    let place = protocol.place(TIME_UNIT);
    if protocol.get(SEGMENT).is_some() {
        let problem = "segments have strains, and `time_unit` = \"diffusion\" has none";
        let allowed = "`time_unit` = \"strain\", or no segments";
        faults.push(Problem::at(&place, problem, allowed).of_key(TIME_UNIT));
    }
    let mut values = given().map(|number| number.value);
    let first = values.next();
    let is_one = numbers.iter().all(Option::is_some) && values.all(|other| Some(other) == first);
    match first {
        Some(Value::Number(peclet)) if is_one && peclet.is_finite() => {
            if peclet > 0.0 {
                peclet
            } else {
                1.0
            }
        }
        _ => {
            let problem = "`time_unit` = \"diffusion\" in a campaign without one Péclet number";
            let allowed = "the same finite `peclet` in every grid, by which a time t in a²/D0 is a \
                           strain of Pe t; give other numbers a campaign of their own";
            faults.push(Problem::at(&place, problem, allowed).of_key(TIME_UNIT));
            1.0
        }
    }
}

/// Whether a grid with these Péclet numbers has fluid at rest.
pub(super) fn has_rest(written: Option<Entry<'_>>) -> bool {
    peclets(written).is_some_and(|numbers| numbers.iter().any(is_rest))
}

fn is_rest(number: &Located<Value>) -> bool {
    number.value == Value::Number(0.0)
}

/// The Péclet numbers of a grid, whose faults are recorded where it is read.
fn peclets(written: Option<Entry<'_>>) -> Option<Vec<Located<Value>>> {
    let values = axis_values(written?, Axis::of_key(PECLET)?, &Faults::default())?;
    Some(values.all)
}
