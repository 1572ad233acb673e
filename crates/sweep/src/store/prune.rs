//! Taking runs out of a store that its campaign does not ask for.

use super::asked::ORPHANED;
use super::{Store, StoreError, count};

/// Tables with rows of a case, in an order in which they can be emptied, and the column that names the case.
const TABLES: [&str; 8] = [
    "samples",
    "frames",
    "checkpoints",
    "results",
    "ends",
    "failures",
    "slices",
    "disagreements",
];

impl Store {
    /// Removes all runs that are not in the grid, with all they have, and gives the disk back what they took. Says how many of
    /// them something had been computed of.
    ///
    /// # Errors
    /// Trouble with the file. Nothing is removed then.
    pub fn prune(&mut self) -> Result<u64, StoreError> {
        let removed = self.write(|transaction| {
            let removed = transaction.query_row(
                &format!("SELECT count(*) FROM cases WHERE {ORPHANED}"),
                [],
                |row| row.get(0).map(count),
            )?;
            let orphans = "position IS NULL AND state != 'running'";
            let of_orphans = format!("case_id IN (SELECT id FROM cases WHERE {orphans})");
            transaction.execute(
                &format!(
                    "DELETE FROM checksums WHERE kind IN ('result', 'end', 'samples') AND id IN
                         (SELECT id FROM cases WHERE {orphans})
                         OR kind = 'failure' AND id IN (SELECT id FROM failures WHERE {of_orphans})"
                ),
                [],
            )?;
            for table in TABLES {
                transaction.execute(&format!("DELETE FROM {table} WHERE {of_orphans}"), [])?;
            }
            // Seeds that a precision may still take keep their place.
            transaction.execute(
                &format!(
                    "UPDATE cases SET state = 'pending', steps_done = 0, attempts = 0, deaths = 0
                         WHERE {orphans} AND reserve IS NOT NULL"
                ),
                [],
            )?;
            transaction.execute(
                &format!("DELETE FROM cases WHERE {orphans} AND reserve IS NULL"),
                [],
            )?;
            Ok(removed)
        })?;
        self.read(
            self.connection
                .execute_batch("VACUUM; PRAGMA wal_checkpoint(RESTART)"),
        )?;
        Ok(removed)
    }
}
