//! What the index of a log says of its length.
//!
//! `SQLite` keeps an index beside the log, `NAME.sqlite-shm`. A process that is killed leaves it there with the number of pages
//! that the log then had, and the first connection afterwards makes it anew. So whoever looks before that can tell a log whose
//! end was cut off from one that was never longer, at no cost to those who write. After a power cut the index may be of any
//! moment: it then says nothing, or that less was kept than was written, which is true.

use super::Sum;
use std::io::Read;
use std::path::Path;

/// Bytes of one of the two copies of its header.
const HEADER: usize = 48;
/// Bytes of the header before its checksum.
const SUMMED: usize = 40;
/// The version that `SQLite` writes.
const VERSION: u32 = 3_007_000;

/// What an index says, as <https://www.sqlite.org/walformat.html#the_wal_index_header> describes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Index {
    /// What sets this generation of the log apart from others.
    pub(super) salt: [u8; 8],
    /// Pages of whole transactions in the log.
    pub(super) pages: u32,
    /// How many of them are in the store itself as well.
    pub(super) moved: u32,
}

impl Index {
    /// Of the log of a store, if it is there and whole.
    pub(super) fn of(path: &Path) -> Option<Self> {
        let mut bytes = [0; 2 * HEADER + 4];
        std::fs::File::open(crate::store::place::with_suffix(path, "-shm"))
            .and_then(|mut file| file.read_exact(&mut bytes))
            .ok()?;
        Self::parse(&bytes)
    }

    /// From its first bytes, which are in the order of this machine.
    fn parse(bytes: &[u8; 2 * HEADER + 4]) -> Option<Self> {
        let word = |at: usize| {
            u32::from_ne_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
        };
        let mut sum = Sum(0, 0, cfg!(target_endian = "big"));
        sum.add(&bytes[..SUMMED]);
        // Whoever is killed while writing it leaves two copies that differ.
        let is_whole = bytes[..HEADER] == bytes[HEADER..2 * HEADER]
            && word(0) == VERSION
            && (sum.0, sum.1) == (word(SUMMED), word(SUMMED + 4));
        let (pages, moved) = (word(16), word(2 * HEADER));
        let mut salt = [0; 8];
        salt.copy_from_slice(&bytes[32..40]);
        (is_whole && moved <= pages).then_some(Self { salt, pages, moved })
    }

    /// Pages that the log no longer has, nor the store, if it now has so many of a generation; without one if nothing is left
    /// of it.
    pub(super) fn missing(&self, salt: Option<[u8; 8]>, pages: u32) -> u32 {
        if salt.is_none_or(|salt| salt == self.salt) {
            self.pages.saturating_sub(pages.max(self.moved))
        } else {
            0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rusqlite::Connection;

    #[test]
    fn index_says_how_long_the_log_is_and_nothing_once_it_is_torn() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.sqlite");
        let connection = Connection::open(&path).unwrap();
        connection
            .execute_batch(
                "PRAGMA journal_mode = WAL; CREATE TABLE t (x); INSERT INTO t VALUES (1)",
            )
            .unwrap();
        let log = std::fs::read(crate::store::place::log_of(&path)).unwrap();
        let index = Index::of(&path).unwrap();
        let pages = u32::try_from((log.len() - 32) / (24 + 4096)).unwrap();
        assert_eq!((index.pages, index.moved), (pages, 0));
        assert_eq!(index.salt, log[16..24]);
        connection
            .execute_batch("PRAGMA wal_checkpoint(PASSIVE)")
            .unwrap();
        let index = Index::of(&path).unwrap();
        assert_eq!((index.pages, index.missing(None, 0)), (pages, 0));
        let whole = std::fs::read(path.with_extension("sqlite-shm")).unwrap();
        for at in 0..2 * HEADER {
            let mut bytes = *whole.first_chunk().unwrap();
            bytes[at] ^= 1;
            assert_eq!(Index::parse(&bytes), None, "byte {at}");
        }
    }
}
