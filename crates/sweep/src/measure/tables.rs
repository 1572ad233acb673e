//! Samples and runs as tables, with a column for each of their numbers.

use super::doubt::Doubt;
use super::numbers::{Level, Number, columns};
use super::point_run::PointRun;
use crate::data::{Cells, DataColumn, Kind, Value, Word};
use crate::model::axes::{AXES, Axis};
use sd_core::Sample;

/// Samples with their steps, one row each.
pub fn sample_table(samples: &[(u64, Sample)]) -> Vec<DataColumn> {
    let steps = samples.iter().map(|(step, _)| Some(Value::Count(*step)));
    let meaning = "steps from the start of the run";
    let mut table = vec![DataColumn::of("step", Kind::Count, meaning, steps)];
    table.extend(columns(Level::Samples).map(|number| {
        let cells = samples
            .iter()
            .map(|(_, sample)| Some(number.of_sample(sample)));
        column(number, Level::Samples, cells)
    }));
    table
}

/// Runs with their results, one row each: key, number, state, axes, seed, numbers.
pub(crate) fn run_table(runs: &[&PointRun]) -> Vec<DataColumn> {
    let mut table = vec![key_column(runs.iter().map(|run| run.key.as_str()))];
    let numbers = runs.iter().map(|run| Some(Value::Count(run.position + 1)));
    let meaning = "number of the run in the campaign file, from 1";
    table.push(DataColumn::of("case", Kind::Count, meaning, numbers));
    let states = runs.iter().map(|run| Some(run.state.name().into()));
    let meaning = "pending, running, done, jammed or failed";
    table.push(words("state", meaning, states));
    table.extend(
        AXES.iter()
            .map(|axis| axis_column(axis, runs.iter().copied())),
    );
    table.push(seed_column(runs.iter().map(|run| run.seed)));
    for number in columns(Level::Runs) {
        let is_count = number.kind(Level::Runs) == Kind::Count;
        let cells = runs.iter().map(|run| {
            let value = run.number(number.name)?;
            Some(if is_count {
                Value::Count(crate::text::format::count(value) as u64)
            } else {
                Value::Number(value)
            })
        });
        table.push(column(number, Level::Runs, cells));
    }
    let doubts = runs.iter().map(|run| {
        let has_result = !run.numbers.is_empty();
        has_result.then(|| Doubt::write(&run.doubts).into())
    });
    table.push(words("doubts", "why its numbers are doubtful", doubts));
    table
}

/// Keys of runs.
pub(crate) fn key_column<'k>(keys: impl Iterator<Item = &'k str>) -> DataColumn {
    let meaning = "the run: a hash of all that determines its result";
    words("key", meaning, keys.map(|key| Some(key.to_owned().into())))
}

/// Seeds of runs.
pub(crate) fn seed_column(seeds: impl Iterator<Item = u64>) -> DataColumn {
    let seeds = seeds.map(|seed| Some(Value::Count(seed)));
    DataColumn::of("seed", Kind::Count, "seed of its random numbers", seeds)
}

/// Values of runs on an axis, without those of an alternative that is not imposed.
pub(crate) fn axis_column<'r>(axis: &Axis, runs: impl Iterator<Item = &'r PointRun>) -> DataColumn {
    let value = |run: &PointRun| {
        let is_absent = axis.is_alternative() && !axis.means_something(&run.params);
        (!is_absent).then(|| axis.value(&run.params))
    };
    DataColumn {
        unit: if axis.is_numeric() { axis.unit } else { "" },
        ..DataColumn::of(axis.key, axis.kind(), axis.meaning, runs.map(value))
    }
}

fn column(number: &Number, level: Level, cells: impl Iterator<Item = Option<Value>>) -> DataColumn {
    DataColumn {
        unit: number.unit,
        ..DataColumn::of(
            number.name,
            number.kind(level),
            number.meaning(level).unwrap_or_default(),
            cells,
        )
    }
}

fn words(
    name: &'static str,
    meaning: &'static str,
    cells: impl Iterator<Item = Option<Word>>,
) -> DataColumn {
    DataColumn {
        meaning,
        cells: Cells::Word(cells.collect()),
        ..DataColumn::named(name, Kind::Word, 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_a_table_with_a_unit_and_a_meaning_of_each_column() {
        let sample = Sample {
            viscosity: f64::NAN,
            minimum_gap: f64::INFINITY,
            contacts: 7,
            ..Sample::default()
        };
        let table = sample_table(&[(40, sample)]);
        let cells = |name: &str| &table.iter().find(|c| c.name == name).unwrap().cells;
        assert_eq!(*cells("step"), Cells::Count(vec![Some(40)]));
        assert_eq!(*cells("contacts"), Cells::Count(vec![Some(7)]));
        assert_eq!(*cells("viscosity"), Cells::Number(vec![None]));
        let infinite = Cells::Number(vec![Some(f64::INFINITY)]);
        assert_eq!(*cells("minimum_gap"), infinite);
        assert_eq!(*cells("minimum_gap_so_far"), infinite);
        assert!(
            sample_table(&[])
                .iter()
                .all(|column| column.cells.is_empty())
        );
        for column in table {
            assert!(
                !column.meaning.is_empty() && !column.unit.is_empty(),
                "{}",
                column.name
            );
        }
    }
}
