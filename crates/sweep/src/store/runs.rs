//! The runs of a campaign as a table, with all their results.

use super::{Store, StoreError};
use crate::data::DataColumn;
use crate::measure::{PointRun, run_table};

impl Store {
    /// All runs of the campaign in its order, one row each. Pending runs have no results.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], and I/O or SQLite errors.
    pub fn runs(&self) -> Result<Vec<DataColumn>, StoreError> {
        let runs = self.point_runs()?;
        let runs: Vec<&PointRun> = runs.iter().collect();
        Ok(run_table(&runs))
    }
}
