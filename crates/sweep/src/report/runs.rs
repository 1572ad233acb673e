//! Tables of single runs and of their samples, for other programs.

use super::error::ReportError;
use super::points::selected_runs;
use super::selection::Excerpt;
use super::units::{At, Units};
use crate::data::{DataColumn, ParquetFile, write_csv_header, write_csv_rows};
use crate::measure::{PointRun, axis_column, key_column, run_table, sample_table, seed_column};
use crate::model::axes::{AXES, Axis};
use sd_core::Sample;
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
        let runs = selected_runs(self.store, self.selection)?;
        let mut table = run_table(&runs.iter().collect::<Vec<_>>());
        for column in &mut table {
            self.units.convert(column, runs.iter().map(at));
        }
        Ok(table)
    }

    /// Writes the runs; returns the columns.
    pub(crate) fn write_runs(
        &self,
        format: TableFormat,
        out: &mut (dyn Write + Send),
    ) -> Result<Vec<DataColumn>, ReportError> {
        let table = self.runs()?;
        let mut file = TableFile::begin(format, out, "runs", &table, self)?;
        file.append(&table)?;
        file.finish()?;
        Ok(table)
    }

    /// Writes the samples of all runs, in the order of the campaign: key, seed, the axes that vary,
    /// then the samples step by step; returns the columns without cells.
    pub(crate) fn write_samples(
        &self,
        format: TableFormat,
        out: &mut (dyn Write + Send),
    ) -> Result<Vec<DataColumn>, ReportError> {
        let runs = selected_runs(self.store, self.selection)?;
        let axes = axes_of_samples(&runs);
        let empty = table_of(None, &axes, self.units);
        let mut table = empty.clone();
        let mut file = TableFile::begin(format, out, "samples", &table, self)?;
        for run in &runs {
            let samples = self.store.samples(&run.key)?;
            let more = table_of(Some((run, &samples)), &axes, self.units);
            for (column, more) in table.iter_mut().zip(more) {
                column.cells.append(more.cells);
            }
            if table[0].cells.len() >= ROWS {
                file.append(&table)?;
                table.clone_from(&empty);
            }
        }
        file.append(&table)?;
        file.finish()?;
        Ok(empty)
    }
}

/// The input for converting the numbers of a run to physical units. Under an imposed stress its
/// rate is that of its mean viscosity.
fn at(run: &PointRun) -> At {
    let rate = match run.params.last_shear() {
        (rate, None) => Some(rate),
        (_, Some(stress)) => run.number("viscosity").map(|eta| 6.0 * PI * stress / eta),
    };
    At::new(&run.params, rate)
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
        write_csv_header(like, out)?;
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
) -> Vec<DataColumn> {
    let sampled = run.map_or(&[][..], |(_, sampled)| sampled);
    let of_rows = || {
        let run = run.map(|(run, _)| run);
        sampled.iter().filter_map(move |_| run)
    };
    let mut table = vec![
        key_column(of_rows().map(|run| run.key.as_str())),
        seed_column(of_rows().map(|run| run.seed)),
    ];
    table.extend(axes.iter().map(|axis| axis_column(axis, of_rows())));
    table.append(&mut sample_table(sampled));
    if let Some((run, _)) = run {
        // The rate of every sample is its own; stresses of Brownian spheres under a stress are in
        // units of that.
        let stress = run.params.shear_stress;
        let stress = stress.filter(|_| run.params.has_free_rate());
        let of_stress = stress.map(|stress| 6.0 * PI * stress);
        let rates = sampled
            .iter()
            .map(|(_, sample)| of_stress.or(Some(sample.shear_rate)));
        let rows = rates.map(|rate| At::new(&run.params, rate));
        for column in &mut table {
            units.convert(column, rows.clone());
        }
    } else {
        for column in &mut table {
            units.convert(column, std::iter::empty());
        }
    }
    table
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
    use crate::data::Cells;

    #[test]
    fn every_column_of_samples_has_a_unit_and_a_meaning() {
        let axes: Vec<&Axis> = AXES.iter().collect();
        for column in table_of(None, &axes, Units::default()) {
            assert!(!column.meaning.is_empty(), "{}", column.name);
            let is_word = matches!(column.cells, Cells::Word(_));
            assert_eq!(column.unit.is_empty(), is_word, "{}", column.name);
        }
    }
}
