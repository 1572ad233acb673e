//! The tidy table as a Parquet file.

use super::columns::point_table;
use super::error::ReportError;
use super::points::Report;
use crate::data::ParquetFile;

/// Writes the points as a Parquet file: one row each, the columns of the CSV. The file's metadata say `campaign`, and of every column
/// `NAME.unit` and `NAME.meaning`.
pub(crate) fn parquet(report: &Report, out: &mut Vec<u8>) -> Result<(), ReportError> {
    let table = point_table(report);
    let about = [("campaign", report.campaign.as_str())];
    let mut file = ParquetFile::begin(out, "points", &table, &about)?;
    file.append(&table)?;
    Ok(file.finish()?)
}
