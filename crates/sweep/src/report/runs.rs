//! Runs one by one, and their samples: tables for other programs.

mod meanings;

use super::{ReportError, Selection, selected_runs};
use crate::axes::{AXES, Axis, Kind, Value};
use crate::csv_rows;
use crate::data::{Cells, DataColumn, ParquetFile, numbered, write_csv, write_csv_rows};
use crate::store::{PointRun, Store};
use crate::stresses::STRESSES;
use meanings::{OF_RUNS, OF_SAMPLES, explain};
use sd_core::Sample;
use std::collections::HashSet;
use std::io::Write;

/// Rows of samples that are held at a time, so that the largest campaign fits into little memory.
const ROWS: usize = 50_000;

/// How a table is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableFormat {
    /// Comma-separated values.
    Csv,
    /// Parquet.
    Parquet,
}

impl TableFormat {
    /// The format of files with this ending.
    pub fn of_ending(ending: &str) -> Option<Self> {
        match ending.to_ascii_lowercase().as_str() {
            "csv" => Some(Self::Csv),
            "parquet" => Some(Self::Parquet),
            _ => None,
        }
    }
}

/// The runs of the points selected, a row each: key, state, axes, seed, and all that the store knows of their results.
///
/// # Errors
/// Trouble with the store.
pub fn run_table(store: &Store, selection: &Selection) -> Result<Vec<DataColumn>, ReportError> {
    let wanted: HashSet<String> = selected_runs(store, selection)?
        .into_iter()
        .map(|run| run.key)
        .collect();
    let mut table = store.runs()?;
    // Numbers by which the tables of the store find each other.
    table.retain(|column| !["case_id", "process"].contains(&column.name.as_ref()));
    let keys = table.iter().find(|column| column.name == "key");
    let Some(Cells::Word(keys)) = keys.map(|column| &column.cells) else {
        return Ok(table);
    };
    let is_wanted: Vec<bool> = keys
        .iter()
        .map(|key| {
            key.as_ref()
                .is_some_and(|key| wanted.contains(key.as_ref()))
        })
        .collect();
    for column in &mut table {
        column.cells.keep(&is_wanted);
        explain(column, OF_RUNS);
    }
    Ok(table)
}

/// Writes the runs of the points selected.
///
/// # Errors
/// Trouble with the store, or output that cannot be written.
pub fn write_runs(
    store: &Store,
    selection: &Selection,
    format: TableFormat,
    out: &mut (dyn Write + Send),
) -> Result<(), ReportError> {
    let table = run_table(store, selection)?;
    match format {
        TableFormat::Csv => write_csv(&table, out)?,
        TableFormat::Parquet => {
            let campaign = store.campaign_name()?;
            let about = [("campaign", campaign.as_str())];
            let mut file = ParquetFile::begin(out, "runs", &table, &about)?;
            file.append(&table)?;
            file.finish()?;
        }
    }
    Ok(())
}

/// Writes the samples of all runs of the points selected, in the order of the campaign: key, seed, the axes that vary, then what was
/// sampled, step by step.
///
/// # Errors
/// Trouble with the store, or output that cannot be written.
pub fn write_samples(
    store: &Store,
    selection: &Selection,
    format: TableFormat,
    out: &mut (dyn Write + Send),
) -> Result<(), ReportError> {
    let runs = selected_runs(store, selection)?;
    let axes = axes_of_samples(&runs);
    let mut batch = Batch::of(&axes)?;
    let campaign = store.campaign_name()?;
    let about = [("campaign", campaign.as_str())];
    let mut file = match format {
        TableFormat::Csv => {
            write_csv(&batch.table, out)?;
            Samples::Csv(out)
        }
        TableFormat::Parquet => {
            Samples::Parquet(ParquetFile::begin(out, "samples", &batch.table, &about)?)
        }
    };
    for run in &runs {
        batch.add(run, &axes, &store.samples(&run.key)?)?;
        if batch.rows() >= ROWS {
            file.append(&batch.table)?;
            batch = Batch::of(&axes)?;
        }
    }
    file.append(&batch.table)?;
    file.finish()
}

/// A table of samples that is being written.
enum Samples<'w> {
    Csv(&'w mut (dyn Write + Send)),
    Parquet(ParquetFile<&'w mut (dyn Write + Send)>),
}

impl Samples<'_> {
    fn append(&mut self, table: &[DataColumn]) -> Result<(), ReportError> {
        match self {
            Self::Csv(out) => write_csv_rows(table, out)?,
            Self::Parquet(file) => file.append(table)?,
        }
        Ok(())
    }

    fn finish(self) -> Result<(), ReportError> {
        match self {
            Self::Csv(_) => {}
            Self::Parquet(file) => file.finish()?,
        }
        Ok(())
    }
}

/// Rows of samples.
struct Batch {
    table: Vec<DataColumn>,
}

impl Batch {
    /// None yet, with the columns of all.
    fn of(axes: &[&Axis]) -> Result<Self, ReportError> {
        let mut table = vec![
            DataColumn::named("key", Kind::Word, 0),
            DataColumn::named("seed", Kind::Count, 0),
        ];
        let of_axis = |axis: &&Axis| DataColumn::named(axis.key, axis.kind(), 0);
        table.extend(axes.iter().map(of_axis));
        table.extend(sample_table(&[])?);
        for column in &mut table {
            explain(column, OF_SAMPLES);
        }
        Ok(Self { table })
    }

    fn rows(&self) -> usize {
        self.table[0].cells.len()
    }

    /// Adds the samples of a run.
    fn add(
        &mut self,
        run: &PointRun,
        axes: &[&Axis],
        sampled: &[(u64, Sample)],
    ) -> Result<(), ReportError> {
        let number = sampled.len();
        let (head, body) = self.table.split_at_mut(2 + axes.len());
        if let Cells::Word(keys) = &mut head[0].cells {
            keys.extend(std::iter::repeat_n(Some(run.key.clone().into()), number));
        }
        let seed = Value::Count(run.seed);
        let values = axes.iter().map(|axis| axis.value(&run.params));
        for (column, value) in head[1..]
            .iter_mut()
            .zip(std::iter::once(seed).chain(values))
        {
            for _ in 0..number {
                column.cells.push(Some(value));
            }
        }
        for (column, new) in body.iter_mut().zip(sample_table(sampled)?) {
            column.cells.append(new.cells);
        }
        Ok(())
    }
}

/// Samples as columns: what each holds, and the components of the stress whose parts it holds.
///
/// # Errors
/// None is known: the fields of a sample are numbers.
pub fn sample_table(sampled: &[(u64, Sample)]) -> Result<Vec<DataColumn>, ReportError> {
    let mut table = numbered("step", sampled, &Sample::default())
        .map_err(|error| ReportError::Output(std::io::Error::other(error)))?;
    let stresses = STRESSES.iter().filter(|stress| !stress.is_part());
    let totals = stresses.map(|stress| {
        let mut column = DataColumn::named(stress.name, Kind::Number, sampled.len());
        for (_, sample) in sampled {
            column.cells.push(Some(Value::Number(stress.read(sample))));
        }
        column
    });
    let before = table
        .iter()
        .position(|column| column.name == "normal_stress_difference");
    let place = before.map_or(table.len(), |place| place + 1);
    table.splice(place..place, totals);
    for column in &mut table {
        explain(column, OF_SAMPLES);
    }
    Ok(table)
}

/// Writes name, unit and meaning of each column of the runs.
///
/// # Errors
/// Trouble with the store, or output that cannot be written.
pub fn write_run_units(
    store: &Store,
    selection: &Selection,
    out: &mut dyn Write,
) -> Result<(), ReportError> {
    about(&run_table(store, selection)?, out)
}

/// Writes name, unit and meaning of each column of the samples.
///
/// # Errors
/// Trouble with the store, or output that cannot be written.
pub fn write_sample_units(
    store: &Store,
    selection: &Selection,
    out: &mut dyn Write,
) -> Result<(), ReportError> {
    let runs = selected_runs(store, selection)?;
    about(&Batch::of(&axes_of_samples(&runs))?.table, out)
}

/// Writes what is known of each column.
fn about(table: &[DataColumn], out: &mut dyn Write) -> Result<(), ReportError> {
    let rows = table
        .iter()
        .map(|column| [column.name.as_ref(), column.unit, column.meaning]);
    Ok(csv_rows::write(["column", "unit", "meaning"], rows, out)?)
}

/// The axes that set runs apart, besides what is sampled.
fn axes_of_samples(runs: &[PointRun]) -> Vec<&'static Axis> {
    AXES.iter()
        // The rate is sampled: under an imposed stress it is no axis.
        .filter(|axis| !axis.is_shear_rate())
        .filter(|axis| axis.varies(runs.iter().map(|run| &run.params)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_of_samples_has_a_unit_and_a_meaning() {
        let axes: Vec<&Axis> = AXES.iter().collect();
        for column in Batch::of(&axes).unwrap().table {
            assert!(!column.meaning.is_empty(), "{}", column.name);
            let is_word = matches!(column.cells, Cells::Word(_));
            assert_eq!(column.unit.is_empty(), is_word, "{}", column.name);
        }
    }
}
