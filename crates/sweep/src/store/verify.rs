//! Whether a store is what was written, as far as tables and figures are made of it.

use super::checksum::{Altered, Kind, check_all, seal_all};
use super::schema::CaseRow;
use super::{Store, StoreError, count, integer, log};
use crate::case::State;
use rusqlite::{Connection, TransactionBehavior};
use std::path::Path;

/// Largest file that is read from beginning to end for a look at its structure, in bytes: this takes less than half a second.
const CHEAP: i64 = 64 << 20;
/// Largest file whose indices are compared with their tables as well.
const CHEAPER: i64 = 16 << 20;

impl Store {
    /// Makes sure that the grid, the results in it and what else is shown of them are what was written.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], and trouble with the file.
    pub(super) fn verify(&self) -> Result<(), StoreError> {
        let begins = self.connection.is_autocommit();
        // All of it is of one moment: others may write meanwhile.
        let begun = if begins {
            self.connection.execute_batch("BEGIN")
        } else {
            Ok(())
        };
        let result = begun.and_then(|()| {
            structure(&self.connection)?;
            let finished = cases(&self.connection)?;
            rows(&self.connection, finished)
        });
        let ended = if begins {
            self.connection.execute_batch("ROLLBACK")
        } else {
            Ok(())
        };
        self.read(result.and(ended))
    }
}

/// Takes what a store holds now for what was written: for whoever changed it by other means than this program, and means it.
///
/// # Errors
/// Trouble with the file.
pub fn accept_changes(path: &Path) -> Result<(), StoreError> {
    let accepted = || -> Result<(), rusqlite::Error> {
        let mut connection = Connection::open(path)?;
        let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
        transaction.execute("DELETE FROM checksums", [])?;
        seal_all(&transaction)?;
        log::go_on(&transaction)?;
        transaction.commit()
    };
    accepted().map_err(|error| StoreError::sqlite(path, error, false))
}

/// That no page is out of its place, where a look at all of them is cheap.
fn structure(connection: &Connection) -> Result<(), rusqlite::Error> {
    let size: i64 = connection.query_row(
        "SELECT page_count * page_size FROM pragma_page_count, pragma_page_size",
        [],
        |row| row.get(0),
    )?;
    if size > CHEAP {
        return Ok(());
    }
    let check = if size > CHEAPER {
        "PRAGMA main.quick_check(1)"
    } else {
        "PRAGMA main.integrity_check(1)"
    };
    let found: String = connection.query_row(check, [], |row| row.get(0))?;
    if found == "ok" {
        Ok(())
    } else {
        Err(Altered::error(found.trim().replace('\n', " ")))
    }
}

/// That every case has its key and a state there is, that the grid has no holes, that whoever owns a case is there, and that a
/// failed one says why. Says how many are finished.
fn cases(connection: &Connection) -> Result<u64, rusqlite::Error> {
    // Seeds that a precision may still take have their place, but no position yet. No store before schema 9 has any.
    let position = if connection
        .prepare("SELECT 1 FROM pragma_table_info('cases') WHERE name = 'reserve'")?
        .exists([])?
    {
        "coalesce(c.reserve, c.position)"
    } else {
        "c.position"
    };
    let mut query = connection.prepare(&format!(
        "SELECT c.key, c.params, c.seed, c.steps, c.sample_stride, c.state, {position},
             c.state = 'running' AND NOT EXISTS (SELECT 1 FROM processes p WHERE p.id = c.owner),
             c.state = 'failed' AND NOT EXISTS (SELECT 1 FROM failures f WHERE f.case_id = c.id) FROM cases c"
    ))?;
    let mut rows = query.query([])?;
    let mut positions = Vec::new();
    let mut finished = 0;
    while let Some(row) = rows.next()? {
        let case = CaseRow {
            key: row.get_ref(0)?.as_str()?,
            params: row.get_ref(1)?.as_str()?,
            seed: count(row.get(2)?),
            steps: count(row.get(3)?),
            sample_stride: count(row.get(4)?),
        };
        let key = case.key;
        if !case.has_its_key() {
            return Err(Altered::error(format!(
                "the parameters of case {key} are not those it was named for"
            )));
        }
        let state = row.get_ref(5)?.as_str()?;
        match State::of(state) {
            Some(State::Done | State::Jammed) => finished += 1,
            Some(_) => {}
            None => {
                return Err(Altered::error(format!(
                    "case {key} is in the state {state:?}, which there is not"
                )));
            }
        }
        if row.get(7)? {
            return Err(Altered::error(format!(
                "case {key} is owned by a process that is not there"
            )));
        }
        if row.get(8)? {
            return Err(Altered::error("a case has failed, and does not say why"));
        }
        positions.extend(row.get::<_, Option<i64>>(6)?);
    }
    positions.sort_unstable();
    if positions
        .iter()
        .copied()
        .eq(0..integer(positions.len() as u64))
    {
        Ok(finished)
    } else {
        Err(Altered::error("a case of the grid is missing"))
    }
}

/// That rows are what was written, and that there is a result for every case that is finished.
fn rows(connection: &Connection, finished: u64) -> Result<(), rusqlite::Error> {
    check_all(connection, Kind::Campaign)?;
    let results = check_all(connection, Kind::Result)?;
    check_all(connection, Kind::Process)?;
    check_all(connection, Kind::Failure)?;
    let nobody: bool = connection
        .prepare("SELECT 1 FROM results WHERE process NOT IN (SELECT id FROM processes)")?
        .exists([])?;
    if nobody {
        return Err(Altered::error("a result of a process that is not there"));
    }
    if finished != results {
        return Err(Altered::error("a case is finished, and has no result"));
    }
    Ok(())
}
