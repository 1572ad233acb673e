//! The write-ahead log beside a store, and the check that it belongs to the store.
//!
//! `SQLite` replays any log with the right name. A log left by another store of that name, or by
//! the same store before it was replaced by a copy, would overwrite pages of the file. So every
//! store has a random id, and every change updates a mark with the id and the number of the change.
//! A log belongs to the store if its marks have the id of the file and continue from the number in
//! the file. The marks are found by a search of the bytes, without parsing the log.

use super::StoreError;
use super::place::{address, log_of};
use super::statements::{Statements, harden};
use crate::system::files::read_whole;
use rusqlite::{Connection, OpenFlags};
use std::path::Path;
use std::time::Duration;

/// First bytes of every mark.
const MAGIC: &[u8; 16] = b"mark of sweep 1\0";
/// Number of retries for a log that seems foreign: other processes may be writing to it.
const LOOKS: u32 = 12;
/// Interval between retries.
const LOOK: Duration = Duration::from_millis(50);

/// A mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Mark {
    /// Id of the store.
    pub(super) id: [u8; 8],
    /// Number of the change.
    pub(super) number: u64,
}

impl Mark {
    /// The mark at the beginning of some bytes.
    fn of(bytes: &[u8]) -> Option<Self> {
        let (id, rest) = bytes.strip_prefix(MAGIC)?.split_first_chunk::<8>()?;
        Some(Self {
            id: *id,
            number: u64::from_be_bytes(*rest.first_chunk()?),
        })
    }

    fn bytes(self) -> Vec<u8> {
        [&MAGIC[..], &self.id, &self.number.to_be_bytes()].concat()
    }

    /// The mark of an open store, as of its last change.
    pub(super) fn in_store(connection: &Connection) -> rusqlite::Result<Self> {
        let bytes: Vec<u8> =
            connection.one("SELECT mark FROM log WHERE id = 1", [], |row| row.get(0))?;
        Self::of(&bytes).ok_or_else(|| super::digest::DigestMismatch::error("its mark was changed"))
    }

    /// The mark in the file at a path, without its log.
    fn in_file(path: &Path) -> rusqlite::Result<Self> {
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY
            | OpenFlags::SQLITE_OPEN_NO_MUTEX
            | OpenFlags::SQLITE_OPEN_URI;
        let file = Connection::open_with_flags(address(path, "immutable=1"), flags)?;
        harden(&file)?;
        Self::in_store(&file)
    }

    /// Updates the mark of a store, in every transaction that changes it.
    pub(super) fn renew(connection: &Connection) -> rusqlite::Result<()> {
        let mark = Self::in_store(connection)?;
        let next = Self {
            number: mark.number + 1,
            ..mark
        };
        connection.run("UPDATE log SET mark = ?1 WHERE id = 1", [next.bytes()])
    }

    /// Gives a new store its id.
    pub(super) fn begin(connection: &Connection) -> rusqlite::Result<()> {
        let id = connection.query_row("SELECT randomblob(8)", [], |row| row.get(0))?;
        connection.run(
            "INSERT INTO log VALUES (1, ?1)",
            [Self { id, number: 0 }.bytes()],
        )
    }
}

/// Whether there is a non-empty log beside a store.
pub(super) fn is_there(path: &Path) -> bool {
    std::fs::metadata(log_of(path)).is_ok_and(|log| log.len() > 0)
}

/// Checks that the log beside a store belongs to it, before `SQLite` replays it. Returns the number
/// of the last change in it.
///
/// # Errors
/// [`StoreError::ForeignLog`].
pub(super) fn check(path: &Path) -> Result<Option<u64>, StoreError> {
    let log = log_of(path);
    for _ in 0..LOOKS {
        let Ok(bytes) = read_whole(&log, u64::MAX) else {
            return Ok(None);
        };
        let mut marks = marks(&bytes);
        let Some(first) = marks.next() else {
            // The log never held a complete change.
            return Ok(None);
        };
        let last = marks.fold(first.number, |last, mark| last.max(mark.number));
        let is_own = match Mark::in_file(path) {
            Ok(mark) => {
                mark.id == first.id && (first.number..=last + 1).contains(&(mark.number + 1))
            }
            // The file cannot be read without its log: opening it reports why.
            Err(_) => true,
        };
        if is_own {
            return Ok(Some(last));
        }
        // Other processes may have restarted it while it was read.
        std::thread::sleep(LOOK);
    }
    Err(StoreError::ForeignLog {
        path: path.to_owned(),
        log,
    })
}

/// Whether changes up to number `last` in the log are lost: the store, opened since, ends before.
pub(super) fn is_cut(connection: &Connection, last: Option<u64>) -> bool {
    let mark = Mark::in_store(connection);
    last.is_some_and(|last| mark.is_ok_and(|mark| mark.number < last))
}

/// All marks in some bytes, in their order.
fn marks(bytes: &[u8]) -> impl Iterator<Item = Mark> {
    let mut rest = bytes;
    std::iter::from_fn(move || {
        loop {
            let at = rest.iter().position(|byte| *byte == MAGIC[0])?;
            let found = Mark::of(&rest[at..]);
            rest = &rest[at + 1..];
            if found.is_some() {
                return found;
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn marks_are_found_in_their_order() {
        let mark = |number| Mark {
            id: *b"12345678",
            number,
        };
        let bytes = [
            b"mark of".to_vec(),
            mark(3).bytes(),
            vec![b'm'; 9],
            mark(4).bytes(),
        ]
        .concat();
        assert_eq!(marks(&bytes).collect::<Vec<_>>(), [mark(3), mark(4)]);
    }

    proptest! {
        #[test]
        fn no_log_crashes_its_reader(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = marks(&[&MAGIC[..], &bytes].concat()).count();
        }
    }
}
