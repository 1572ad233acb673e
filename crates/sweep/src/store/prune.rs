//! Taking runs out of a store that its campaign does not ask for.

use super::check::OF_CASES;
use super::inventory::ORPHANED;
use super::statements::Statements;
use super::{Store, StoreError};

impl Store {
    /// Removes all runs that are not in the grid, with all they have, and gives the disk back what they took. Says how many of
    /// them something had been computed of.
    pub(crate) fn prune(&mut self) -> Result<u64, StoreError> {
        let removed = self.write(|connection| {
            let removed = format!("SELECT count(*) FROM cases c WHERE {ORPHANED}");
            let removed = connection.one(&removed, [], |row| row.get(0))?;
            let orphans = "SELECT id FROM cases WHERE NOT counts AND state != 'running'";
            for table in OF_CASES.iter().chain(&["slices", "disagreements"]) {
                connection.execute(
                    &format!("DELETE FROM {table} WHERE case_id IN ({orphans})"),
                    [],
                )?;
            }
            // Seeds that a precision may still take keep their place.
            connection.execute(
                "UPDATE cases SET state = 'pending', steps_done = 0, attempts = 0, deaths = 0,
                     samples_digest = NULL
                 WHERE NOT counts AND state != 'running'",
                [],
            )?;
            connection.execute(
                "DELETE FROM cases WHERE position IS NULL AND state != 'running'",
                [],
            )?;
            connection.execute(
                "DELETE FROM points WHERE id NOT IN (SELECT point FROM cases)",
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
