//! Tables of single runs and of their samples, for other programs.

mod meanings;

use super::error::ReportError;
use super::points::selected_runs;
use super::selection::Excerpt;
use super::units::{At, Units};
use crate::data::csv_rows;
use crate::data::{Cells, DataColumn, ParquetFile, write_csv_rows};
use crate::data::{Kind, Value};
use crate::measure::sampled::numbered;
use crate::measure::sampled::sample_fields;
use crate::model::axes::{AXES, Axis};
use crate::store::PointRun;
use meanings::{explain_of_runs, explain_of_samples};
use sd_core::Sample;
use std::collections::HashMap;
use std::f64::consts::PI;
use std::io::Write;

/// Rows of samples held in memory at the same time, so that large campaigns need little.
const ROWS: usize = 50_000;

/// Format of a table, by the ending of its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableFormat {
    /// Comma-separated values.
    Csv,
    /// Parquet.
    Parquet,
}

impl Excerpt<'_> {
    /// One row per run: key, state, axes, seed, and all its stored results.
    ///
    /// # Errors
    /// An I/O or SQLite error.
    pub fn runs(&self) -> Result<Vec<DataColumn>, ReportError> {
        let wanted: HashMap<String, At> = selected_runs(self.store, self.selection)?
            .into_iter()
            .map(|run| (run.key.clone(), at(&run)))
            .collect();
        let mut table = self.store.runs()?;
        // Row numbers that link the tables of the store.
        table.retain(|column| !["case_id", "process"].contains(&column.name.as_ref()));
        let keys = table.iter().find(|column| column.name == "key");
        let Some(Cells::Word(keys)) = keys.map(|column| &column.cells) else {
            return Ok(table);
        };
        let places: Vec<Option<At>> = keys
            .iter()
            .map(|key| wanted.get(key.as_deref()?).copied())
            .collect();
        let is_wanted: Vec<bool> = places.iter().map(Option::is_some).collect();
        let places: Vec<At> = places.into_iter().flatten().collect();
        for column in &mut table {
            column.cells.keep(&is_wanted);
            explain_of_runs(column);
            convert(column, self.units, |row| places[row]);
        }
        Ok(table)
    }

    /// Writes the runs.
    pub(crate) fn write_runs(
        &self,
        format: TableFormat,
        out: &mut (dyn Write + Send),
    ) -> Result<(), ReportError> {
        let table = self.runs()?;
        let mut file = TableFile::begin(format, out, "runs", &table, self)?;
        file.append(&table)?;
        file.finish()
    }

    /// Writes the samples of all runs, in the order of the campaign: key, seed, the axes that vary,
    /// then the samples step by step.
    pub(crate) fn write_samples(
        &self,
        format: TableFormat,
        out: &mut (dyn Write + Send),
    ) -> Result<(), ReportError> {
        let runs = selected_runs(self.store, self.selection)?;
        let axes = axes_of_samples(&runs);
        let mut table = table_of(None, &axes, self.units)?;
        let mut file = TableFile::begin(format, out, "samples", &table, self)?;
        for run in &runs {
            let samples = self.store.samples(&run.key)?;
            let more = table_of(Some((run, &samples)), &axes, self.units)?;
            for (column, more) in table.iter_mut().zip(more) {
                column.cells.append(more.cells);
            }
            if table[0].cells.len() >= ROWS {
                file.append(&table)?;
                table = table_of(None, &axes, self.units)?;
            }
        }
        file.append(&table)?;
        file.finish()
    }

    /// Writes name, unit and meaning of each column of the runs.
    pub(crate) fn write_run_units(&self, out: &mut dyn Write) -> Result<(), ReportError> {
        about(&self.runs()?, out)
    }

    /// Writes name, unit and meaning of each column of the samples.
    pub(crate) fn write_sample_units(&self, out: &mut dyn Write) -> Result<(), ReportError> {
        let runs = selected_runs(self.store, self.selection)?;
        about(&table_of(None, &axes_of_samples(&runs), self.units)?, out)
    }
}

/// The input for converting the numbers of a run to physical units. Under an imposed stress its
/// rate is that of its mean viscosity.
fn at(run: &PointRun) -> At {
    let rate = match run.params.last_shear() {
        (rate, None) => Some(rate),
        (_, Some(stress)) => run.viscosity.map(|eta| 6.0 * PI * stress / eta),
    };
    At::new(&run.params, rate)
}

/// Converts the numbers of a column to physical units.
fn convert(column: &mut DataColumn, units: Units, at: impl Fn(usize) -> At) {
    let Cells::Number(cells) = &mut column.cells else {
        return;
    };
    if !units.are_requested() {
        return;
    }
    if let Some(axis) = AXES.iter().find(|axis| axis.key == column.name) {
        for (row, cell) in cells.iter_mut().enumerate() {
            let number = cell.map(|number| units.along(axis, at(row), number));
            *cell = number.filter(|number| !number.is_nan());
        }
        column.unit = units.of_axis(axis).unwrap_or(column.unit);
    } else {
        for (row, cell) in cells.iter_mut().enumerate() {
            let factor = units.factor(column.unit, at(row));
            *cell = cell.zip(factor).map(|(number, factor)| factor * number);
        }
        column.unit = units.word(column.unit);
    }
}

/// A table during writing.
enum TableFile<'w> {
    Csv(&'w mut (dyn Write + Send)),
    Parquet(ParquetFile<&'w mut (dyn Write + Send)>),
}

impl<'w> TableFile<'w> {
    /// Begins a table with these columns, without their rows.
    fn begin(
        format: TableFormat,
        out: &'w mut (dyn Write + Send),
        name: &str,
        like: &[DataColumn],
        of: &Excerpt<'_>,
    ) -> Result<Self, ReportError> {
        if format == TableFormat::Parquet {
            let campaign = of.store.campaign_name()?;
            let about = [("campaign", campaign.as_str())];
            return Ok(Self::Parquet(ParquetFile::begin(out, name, like, &about)?));
        }
        let names = like.iter().map(|column| column.name.as_ref());
        csv_rows::write(names, std::iter::empty::<[&str; 0]>(), out)?;
        Ok(Self::Csv(out))
    }

    fn append(&mut self, table: &[DataColumn]) -> Result<(), ReportError> {
        match self {
            Self::Csv(out) => write_csv_rows(table, out)?,
            Self::Parquet(file) => file.append(table)?,
        }
        Ok(())
    }

    fn finish(self) -> Result<(), ReportError> {
        match self {
            Self::Csv(_) => Ok(()),
            Self::Parquet(file) => Ok(file.finish()?),
        }
    }
}

/// The samples of a run as a table: each row has its key, seed and values on these axes. Without a
/// run, only the columns.
fn table_of(
    run: Option<(&PointRun, &[(u64, Sample)])>,
    axes: &[&Axis],
    units: Units,
) -> Result<Vec<DataColumn>, ReportError> {
    let sampled = run.map_or(&[][..], |(_, sampled)| sampled);
    let mut keys = DataColumn::named("key", Kind::Word, sampled.len());
    let mut seeds = DataColumn::named("seed", Kind::Count, sampled.len());
    let mut values: Vec<DataColumn> = axes
        .iter()
        .map(|axis| DataColumn::named(axis.key, axis.kind(), sampled.len()))
        .collect();
    if let (Some((run, _)), Cells::Word(keys)) = (run, &mut keys.cells) {
        for _ in sampled {
            keys.push(Some(run.key.clone().into()));
            seeds.cells.push(Some(Value::Count(run.seed)));
            for (column, axis) in values.iter_mut().zip(axes) {
                column.cells.push(Some(axis.value(&run.params)));
            }
        }
    }
    let mut table = vec![keys, seeds];
    table.append(&mut values);
    table.append(&mut sample_table(sampled)?);
    for column in &mut table {
        explain_of_samples(column);
        convert(column, units, |row| match run {
            // The rate of every sample is its own.
            Some((run, _)) => At::new(&run.params, Some(sampled[row].1.shear_rate)),
            None => At::rate(None),
        });
    }
    Ok(table)
}

/// Samples as columns, of the fields of [`sample_fields`].
///
/// # Errors
/// Not expected: the fields of a sample are numbers.
pub fn sample_table(sampled: &[(u64, Sample)]) -> Result<Vec<DataColumn>, ReportError> {
    let mut table = numbered(sampled, sample_fields);
    for column in &mut table {
        explain_of_samples(column);
    }
    Ok(table)
}

/// Writes name, unit and meaning of each column.
pub(crate) fn about(table: &[DataColumn], out: &mut dyn Write) -> Result<(), ReportError> {
    let rows = table
        .iter()
        .map(|column| [column.name.as_ref(), column.unit, column.meaning]);
    Ok(csv_rows::write(["column", "unit", "meaning"], rows, out)?)
}

/// The axes that distinguish runs, without sampled quantities.
fn axes_of_samples(runs: &[PointRun]) -> Vec<&'static Axis> {
    AXES.iter()
        // The rate is sampled, so under an imposed stress it is not an axis.
        .filter(|axis| !axis.is_shear_rate())
        .filter(|axis| axis.varies(runs.iter().map(|run| run.params.as_ref())))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_of_samples_has_a_unit_and_a_meaning() {
        let axes: Vec<&Axis> = AXES.iter().collect();
        for column in table_of(None, &axes, Units::default()).unwrap() {
            assert!(!column.meaning.is_empty(), "{}", column.name);
            let is_word = matches!(column.cells, Cells::Word(_));
            assert_eq!(column.unit.is_empty(), is_word, "{}", column.name);
        }
    }
}
