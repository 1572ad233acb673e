//! The tidy table as a Parquet file.

use super::columns::point_table;
use super::error::ReportError;
use super::points::Report;
use crate::data::ParquetFile;

/// The points as a Parquet file: one row each, the columns of the CSV. The file's metadata say `campaign`, and of every column
/// `NAME.unit` and `NAME.meaning`.
///
/// # Errors
/// None that is known: it is written to memory.
pub fn parquet(report: &Report) -> Result<Vec<u8>, ReportError> {
    let (table, mut bytes) = (point_table(report), Vec::new());
    let about = [("campaign", report.campaign.as_str())];
    let mut file = ParquetFile::begin(&mut bytes, "points", &table, &about)?;
    file.append(&table)?;
    file.finish()?;
    Ok(bytes)
}
