//! Where a store lies: whether its file is still the one that was opened, whether there is room, on what it is stored.

use super::StoreError;
use crate::files::folder_of;
use std::cell::Cell;
use std::fs::Metadata;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

/// Less room than this on the disk, in bytes, and a write that failed counts as failed for want of it.
const ROOM: u64 = 256 << 10;

/// What tells one file from every other one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FileIdentity {
    device: u64,
    /// Its number there.
    number: u64,
}

impl FileIdentity {
    /// Of the file that now has this name.
    pub(super) fn of(path: &Path) -> Option<Self> {
        std::fs::metadata(path)
            .ok()
            .map(|file| Self::of_file(&file))
    }

    /// Of a file that was looked at.
    pub(super) fn of_file(file: &Metadata) -> Self {
        Self {
            device: file.dev(),
            number: file.ino(),
        }
    }
}

/// The files of a store as they were when it was opened for writing.
#[derive(Debug)]
pub(super) struct Files {
    path: PathBuf,
    database: Option<FileIdentity>,
    log: Option<FileIdentity>,
    /// The largest log seen: while somebody has it open a log never becomes shorter.
    log_size: Cell<u64>,
}

/// What became of the files of an open store.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Loss {
    /// There is no file of its name any more.
    Deleted,
    /// Another file has its name.
    Replaced,
    /// Its log was deleted.
    LogDeleted,
    /// Another log has the name of its own.
    LogReplaced,
    /// The end of its log was cut off.
    LogCut,
}

impl Loss {
    /// What was done to the store, to go with "it was".
    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::Deleted => "deleted",
            Self::Replaced => "replaced",
            Self::LogDeleted => "robbed of its log",
            Self::LogReplaced => "given another log",
            Self::LogCut => "robbed of the end of its log",
        }
    }
}

impl Files {
    /// Of a store that was just opened.
    pub(super) fn of(path: &Path) -> Self {
        let log = log_of(path);
        Self {
            database: FileIdentity::of(path),
            log: FileIdentity::of(&log),
            log_size: Cell::new(size(&log)),
            path: path.to_owned(),
        }
    }

    /// Whether the log is still the one that was opened.
    pub(super) fn has_own_log(&self) -> bool {
        self.log.is_some() && FileIdentity::of(&log_of(&self.path)) == self.log
    }

    /// What became of them, if they are not what they were. What is written after that would be lost.
    pub(super) fn loss(&self) -> Option<Loss> {
        match FileIdentity::of(&self.path) {
            None => return Some(Loss::Deleted),
            found if found != self.database => return Some(Loss::Replaced),
            Some(_) => {}
        }
        let log = log_of(&self.path);
        match FileIdentity::of(&log) {
            _ if self.log.is_none() => return None,
            None => return Some(Loss::LogDeleted),
            found if found != self.log => return Some(Loss::LogReplaced),
            Some(_) => {}
        }
        let size = size(&log);
        if size < self.log_size.get() {
            return Some(Loss::LogCut);
        }
        self.log_size.set(size);
        None
    }
}

/// The length of a file, 0 if there is none.
fn size(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |file| file.len())
}

/// Moves what lies beside the name of a store, such as a log, out of the way of a file that is to have that name; nothing is
/// deleted.
pub(super) fn set_aside(path: &Path) -> std::io::Result<()> {
    let index = with_suffix(path, "-shm");
    for beside in [log_of(path), with_suffix(path, "-journal")] {
        if beside.exists() {
            let mut name = beside.clone().into_os_string();
            name.push(format!(".set-aside-{}", std::process::id()));
            std::fs::rename(&beside, name)?;
        }
    }
    // The index of a log is made anew from the log.
    match std::fs::remove_file(index) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// A path with something after it.
pub(super) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}

/// Gives a file a name that no other file has.
pub(super) fn name_new(from: &Path, to: &Path) -> std::io::Result<()> {
    // A link is made only if the name is free; not every file system has links.
    match std::fs::hard_link(from, to) {
        Ok(()) => std::fs::remove_file(from),
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => Err(error),
        Err(_) if to.exists() => Err(std::io::ErrorKind::AlreadyExists.into()),
        Err(_) => std::fs::rename(from, to),
    }
}

/// Refuses a folder where a store is meant.
pub(super) fn refuse_folder(path: &Path) -> Result<(), StoreError> {
    if path.is_dir() {
        return Err(StoreError::Folder {
            path: path.to_owned(),
        });
    }
    Ok(())
}

/// Why a file cannot be made or opened for writing, as the system says it.
pub(super) fn reason_against(path: &Path) -> Option<std::io::Error> {
    let existed = path.exists();
    let opened = std::fs::OpenOptions::new()
        .append(true)
        .create(true)
        .open(path);
    match opened {
        Err(_) if !takes_files(path) => Some(std::io::Error::other(
            "the file system there takes no files of users",
        )),
        Err(error) => Some(error),
        Ok(_) => {
            if !existed {
                let _ = std::fs::remove_file(path);
            }
            None
        }
    }
}

/// Whether a file lies on a disk, and not in what the kernel shows of itself.
fn takes_files(path: &Path) -> bool {
    let folder = path.parent().unwrap_or(Path::new("."));
    rustix::fs::statvfs(folder).is_ok_and(|disk| disk.f_blocks > 0)
}

/// Whether the disk of a file has next to no room left, or the quota of the user on it is used up.
pub(crate) fn is_full(path: &Path) -> bool {
    let place = folder_of(path);
    rustix::fs::statvfs(place)
        // What the kernel shows of itself has no room at all, and is not full.
        .is_ok_and(|disk| {
            disk.f_blocks > 0
                && (disk.f_bavail.saturating_mul(disk.f_frsize) < ROOM || disk.f_favail == 0)
        })
        || takes_no_more(place)
}

/// Whether the system refuses a small file for want of room: of a quota it says nothing before.
fn takes_no_more(place: &Path) -> bool {
    use std::io::{ErrorKind, Write as _};
    let path = place.join(format!(".sweep-room-{}", std::process::id()));
    let written = std::fs::File::create_new(&path).and_then(|mut file| {
        file.write_all(&vec![0; 64 << 10])?;
        file.sync_all()
    });
    let refused = written.is_err_and(|error| {
        matches!(
            error.kind(),
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded
        )
    });
    let _ = std::fs::remove_file(&path);
    refused
}

/// The name of the network file system a file lies on, if it does: several machines cannot share a store there.
pub fn network_file_system(path: &Path) -> Option<&'static str> {
    #[cfg(target_os = "linux")]
    {
        let place = path.ancestors().find(|place| place.exists());
        let disk = rustix::fs::statfs(place.unwrap_or(Path::new("."))).ok()?;
        u32::try_from(disk.f_type).ok().and_then(network_name)
    }
    #[cfg(not(target_os = "linux"))]
    {
        let _ = path;
        None
    }
}

/// Name of a network file system by the number it has in Linux (`man 2 statfs`, `linux/magic.h`).
#[cfg_attr(
    not(target_os = "linux"),
    allow(dead_code, reason = "numbers of Linux")
)]
fn network_name(magic: u32) -> Option<&'static str> {
    Some(match magic {
        0x6969 => "NFS",
        0x517b | 0xff53_4d42 | 0xfe53_4d42 => "SMB",
        0x0bd0_0bd0 => "Lustre",
        0x4750_4653 => "GPFS",
        0x00c3_6400 => "Ceph",
        0x1983_0326 => "BeeGFS",
        0x5346_414f | 0x6b41_4653 => "AFS",
        0x0102_1997 => "9P",
        0xaad7_aaea => "PanFS",
        0x7461_636f => "OCFS2",
        0x0116_1970 => "GFS2",
        0x2003_0528 => "OrangeFS",
        _ => return None,
    })
}

/// The address of a file with options, as `SQLite` reads it.
pub(super) fn address(path: &Path, options: &str) -> String {
    let escaped = path
        .to_string_lossy()
        .replace('%', "%25")
        .replace('?', "%3f")
        .replace('#', "%23");
    format!("file:{escaped}?{options}")
}

/// The write-ahead log beside a database.
pub(super) fn log_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push("-wal");
    PathBuf::from(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn network_file_systems_are_known_by_their_numbers() {
        assert_eq!(network_name(0x6969), Some("NFS"));
        assert_eq!(network_name(0xff53_4d42), Some("SMB"));
        assert_eq!(network_name(0xef53), None, "ext4");
        assert_eq!(network_name(0x0102_1994), None, "tmpfs");
    }

    #[test]
    fn a_replaced_file_is_another_file() {
        let directory = tempfile::tempdir().unwrap();
        let (one, two) = (directory.path().join("one"), directory.path().join("two"));
        std::fs::write(&one, "1").unwrap();
        std::fs::write(&two, "2").unwrap();
        let before = FileIdentity::of(&one);
        assert_eq!(before, FileIdentity::of(&one));
        std::fs::rename(&two, &one).unwrap();
        assert_ne!(before, FileIdentity::of(&one));
        assert_eq!(FileIdentity::of(&two), None);
    }
}
