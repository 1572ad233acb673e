//! The write-ahead log beside a store, and whether it is the store's own.
//!
//! `SQLite` replays whatever log has the right name. One that was left behind by another store of that name, or by the same
//! store before a copy was put in its place, would write its pages over those of the file. So every change to a store adds a
//! link to a chain, in the same transaction: the link names itself and the one before. A log is the store's own exactly if
//! the last link in the file is one of those in the log, or the one its first link goes on from.

mod index;

use super::place::log_of;
use super::{StoreError, guard};
use index::Index;
use rusqlite::{Connection, OpenFlags, OptionalExtension};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;
use std::time::Duration;

/// First bytes of every link.
const MARK: &[u8; 16] = b"link of sweep 1\0";
/// How often a log that seems to be a stranger's is looked at again: others may be writing to it.
const LOOKS: u32 = 12;
/// Time from one look to the next.
const LOOK: Duration = Duration::from_millis(50);
/// Bytes before the first frame of a log.
const HEADER: usize = 32;
/// Bytes before the page of each frame.
const FRAME: usize = 24;

/// The name of a link; all zeros before the first.
type Name = [u8; 8];

/// A link of the chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Link {
    before: Name,
    own: Name,
}

impl Link {
    /// From the bytes of its row.
    fn of(bytes: &[u8]) -> Option<Self> {
        let (before, own) = bytes.strip_prefix(MARK)?.split_first_chunk::<8>()?;
        Some(Self {
            before: *before,
            own: *own.first_chunk()?,
        })
    }
}

/// Begins the chain of a new store.
pub(super) fn begin(connection: &Connection) -> Result<(), rusqlite::Error> {
    connection.execute(
        "INSERT INTO log (id, link) VALUES (1, CAST(?1 || zeroblob(8) || randomblob(8) AS BLOB))",
        [&MARK[..]],
    )?;
    Ok(())
}

/// Adds a link; every transaction that changes a store does so.
pub(super) fn go_on(connection: &Connection) -> Result<(), rusqlite::Error> {
    connection
        .prepare_cached(
            "UPDATE log SET link = CAST(?1 || substr(link, 25, 8) || randomblob(8) AS BLOB)",
        )?
        .execute([&MARK[..]])?;
    Ok(())
}

/// What a log holds.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Content {
    /// What sets it apart from other generations of itself, if it has got so far.
    salt: Option<[u8; 8]>,
    /// Links of whole transactions, in their order.
    links: Vec<Link>,
    /// Whole transactions.
    transactions: u64,
    /// Pages in them.
    pages: u32,
    /// Transactions that were written after a place that cannot be read, which is where `SQLite` stops.
    lost: u64,
}

/// What is wrong with the log of a store that it belongs to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Fault {
    /// Changes that come after a place that cannot be read.
    Damaged(String),
    /// Its end, or all of it, is not there any more. Only the index beside it knows, until `SQLite` makes that anew.
    Cut(String),
}

impl Fault {
    /// What is said of it.
    pub(super) fn into_words(self) -> String {
        match self {
            Self::Damaged(words) | Self::Cut(words) => words,
        }
    }
}

/// Makes sure that the log beside a store is its own, before `SQLite` replays it. Says what is wrong with it otherwise, if
/// anything is.
///
/// # Errors
/// [`StoreError::ForeignLog`].
pub(super) fn check(path: &Path) -> Result<Option<Fault>, StoreError> {
    let log = log_of(path);
    let mut before: Option<(Content, u32)> = None;
    for _ in 0..LOOKS {
        // Read before the log, which only becomes longer.
        let index = Index::of(path);
        if !log.exists() {
            return Ok(without_log(path, &log, index));
        }
        let found = own(path, &log).map(|content| {
            let missing = index.map_or(0, |index| index.missing(content.salt, content.pages));
            (content, missing)
        });
        match found {
            Some((content, missing)) if content.lost == 0 && missing == 0 => return Ok(None),
            // Others may have begun it anew while it was read: damage stays as it is.
            Some((content, missing)) if before.as_ref() == Some(&(content.clone(), missing)) => {
                return Ok(Some(if content.lost > 0 {
                    Fault::Damaged(format!(
                        "the log {} is damaged: {} changes in it that were written last cannot be read, and are lost",
                        log.display(),
                        content.lost
                    ))
                } else {
                    Fault::Cut(format!(
                        "the end of the log {} was cut off: {missing} pages of changes that were written last are lost",
                        log.display()
                    ))
                }));
            }
            found => before = found,
        }
        std::thread::sleep(LOOK);
    }
    if before.is_some() {
        // It changes all the time, so somebody is using it.
        return Ok(None);
    }
    Err(StoreError::ForeignLog {
        path: path.to_owned(),
        log,
    })
}

/// What the index of a log says where there is no log.
fn without_log(path: &Path, log: &Path, index: Option<Index>) -> Option<Fault> {
    let lost = index.map_or(0, |index| index.missing(None, 0));
    // Whoever closes a store takes its log away before the index, with all of it moved by then; looked at again for that.
    (lost > 0 && path.exists() && !log.exists() && Index::of(path) == index).then(|| {
        Fault::Cut(format!(
            "the log {} is not there any more: {lost} pages of changes that were written last are lost",
            log.display()
        ))
    })
}

/// What a log holds, if it goes on from what the file holds now: then it is the store's own.
fn own(path: &Path, log: &Path) -> Option<Content> {
    // Something that cannot be read is complained about when it is opened.
    let content = File::open(log)
        .and_then(|file| read(BufReader::with_capacity(1 << 16, file)))
        .unwrap_or_default();
    if content.transactions == 0 && content.lost == 0 {
        return Some(content);
    }
    let fits = match last_link(path) {
        // A file that cannot be read without its log: whatever it is, it is not told by this.
        Err(_) => true,
        // No store yet, or one of a program that made no links: the chain begins in the log, if there is one.
        Ok(None) => content
            .links
            .first()
            .is_none_or(|first| first.before == Name::default()),
        Ok(Some(last)) => {
            content
            .links
            .first()
            .is_some_and(|first| first.before == last.own)
            || content.links.iter().any(|link| link.own == last.own)
            // Nothing of it was ever whole.
            || content.transactions == 0
        }
    };
    fits.then_some(content)
}

/// The last link in the file itself, without its log.
fn last_link(path: &Path) -> Result<Option<Link>, rusqlite::Error> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY
        | OpenFlags::SQLITE_OPEN_NO_MUTEX
        | OpenFlags::SQLITE_OPEN_URI;
    let file = Connection::open_with_flags(super::place::address(path, "immutable=1"), flags)?;
    guard::distrust(&file)?;
    let made: bool = file
        .prepare("SELECT 1 FROM sqlite_schema WHERE type = 'table' AND name = 'log'")?
        .exists([])?;
    if !made {
        return Ok(None);
    }
    let link: Option<Vec<u8>> = file
        .query_row("SELECT link FROM log WHERE id = 1", [], |row| row.get(0))
        .optional()?;
    Ok(link.and_then(|link| Link::of(&link)))
}

/// Reads a log, as <https://www.sqlite.org/fileformat2.html#the_write_ahead_log> describes it.
fn read(mut file: impl Read) -> io::Result<Content> {
    let mut header = [0; HEADER];
    if !fill(&mut file, &mut header)? {
        return Ok(Content::default());
    }
    let word = |bytes: &[u8], at: usize| {
        u32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
    };
    let is_big_endian = match word(&header, 0) {
        0x377f_0682 => false,
        0x377f_0683 => true,
        _ => return unreadable(&mut file),
    };
    let page_size = word(&header, 8) as usize;
    if !page_size.is_power_of_two() || !(512..=65536).contains(&page_size) {
        return unreadable(&mut file);
    }
    let mut sum = Sum(0, 0, is_big_endian);
    sum.add(&header[..24]);
    if (sum.0, sum.1) != (word(&header, 24), word(&header, 28)) {
        return unreadable(&mut file);
    }
    let mut content = Content::default();
    let salt = header[16..].first_chunk().copied();
    content.salt = salt;
    // Links of the transaction under way.
    let mut pending = Vec::new();
    let (mut frame, mut broken) = (vec![0; FRAME + page_size], false);
    let mut pages = 0;
    while fill(&mut file, &mut frame)? {
        let is_last = word(&frame, 4) != 0;
        sum.add(&frame[..8]);
        sum.add(&frame[FRAME..]);
        let is_of_this_log = frame[8..].first_chunk() == salt.as_ref();
        let agrees = (sum.0, sum.1) == (word(&frame, 16), word(&frame, 20));
        if broken || !is_of_this_log || !agrees {
            // What is neither of this generation nor goes on from what came before is left over from an earlier one.
            let was_written = is_of_this_log || (agrees && !broken);
            content.lost += u64::from(was_written && is_last);
            broken = true;
            continue;
        }
        pages += 1;
        pending.extend(link_on(&frame[FRAME..]));
        if is_last {
            content.pages = pages;
            content.transactions += 1;
            content.links.append(&mut pending);
        }
    }
    Ok(content)
}

/// A log whose beginning cannot be read, if there is anything in it.
fn unreadable(file: &mut impl Read) -> io::Result<Content> {
    let is_anything = io::copy(file, &mut io::sink())? > 0;
    Ok(Content {
        lost: u64::from(is_anything),
        ..Content::default()
    })
}

/// Fills a buffer; `false` at the end of the file.
fn fill(file: &mut impl Read, buffer: &mut [u8]) -> io::Result<bool> {
    match file.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

/// The link on a page, if it is that of the table of links: a leaf of one row.
fn link_on(page: &[u8]) -> Option<Link> {
    let (kind, rows) = (page[0], u16::from_be_bytes([page[3], page[4]]));
    if kind != 0x0d || rows != 1 {
        return None;
    }
    let row = page.get(usize::from(u16::from_be_bytes([page[8], page[9]]))..)?;
    // After the sizes and types of the row, which take a few bytes.
    (2..16).find_map(|at| Link::of(row.get(at..at + 32)?))
}

/// The running checksum of a log.
struct Sum(u32, u32, bool);

impl Sum {
    fn add(&mut self, bytes: &[u8]) {
        for pair in bytes.chunks_exact(8) {
            let word = |at: usize| {
                let bytes = [pair[at], pair[at + 1], pair[at + 2], pair[at + 3]];
                if self.2 {
                    u32::from_be_bytes(bytes)
                } else {
                    u32::from_le_bytes(bytes)
                }
            };
            let (one, two) = (word(0), word(4));
            self.0 = self.0.wrapping_add(one).wrapping_add(self.1);
            self.1 = self.1.wrapping_add(two).wrapping_add(self.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::sync::LazyLock;

    /// A log with some links.
    static LOG: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.sqlite");
        let connection = Connection::open(&path).unwrap();
        connection
            .execute_batch(
                "PRAGMA journal_mode = WAL; CREATE TABLE log (id INTEGER PRIMARY KEY, link BLOB NOT NULL)",
            )
            .unwrap();
        begin(&connection).unwrap();
        for _ in 0..3 {
            go_on(&connection).unwrap();
        }
        std::fs::read(log_of(&path)).unwrap()
    });

    #[test]
    fn links_are_read_in_their_order() {
        let content = read(LOG.as_slice()).unwrap();
        assert_eq!((content.links.len(), content.lost), (4, 0));
        assert_eq!(content.links[0].before, Name::default());
        for pair in content.links.windows(2) {
            assert_eq!(pair[1].before, pair[0].own);
        }
    }

    #[test]
    fn transactions_after_damage_are_counted_as_lost() {
        let mut bytes = LOG.clone();
        // In the frame of the second link from the end.
        let frame = FRAME + 4096;
        let at = bytes.len() - 2 * frame + 300;
        bytes[at] ^= 1;
        let content = read(bytes.as_slice()).unwrap();
        assert_eq!((content.links.len(), content.lost), (2, 2));
        // A tail that was cut off is one that was never written.
        let content = read(&LOG[..LOG.len() - 10]).unwrap();
        assert_eq!((content.links.len(), content.lost), (3, 0));
    }

    proptest! {
        #[test]
        fn no_log_crashes_its_reader(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = read(bytes.as_slice());
        }

        #[test]
        fn no_damaged_log_crashes_its_reader_or_has_other_links(
            at in any::<usize>(), put in proptest::collection::vec(any::<u8>(), 1..9),
        ) {
            let whole = read(LOG.as_slice()).unwrap();
            let mut bytes = LOG.clone();
            let at = at % bytes.len();
            for (place, byte) in bytes[at..].iter_mut().zip(put) {
                *place = byte;
            }
            let content = read(bytes.as_slice()).unwrap();
            prop_assert!(whole.links.starts_with(&content.links));
            // Without the mark that ends it the last change cannot be told from one that was never finished, and without both its salt
            // and its checksum, which stand side by side, from what an earlier generation left.
            let last = bytes.len() - FRAME - 4096;
            let hit = |from: usize, to: usize| at < last + to && at + 8 > last + from;
            let is_nameless = hit(4, 8) || hit(8, 16) && hit(16, 24);
            prop_assert!(content.lost > 0 || content == whole || is_nameless);
        }
    }
}
