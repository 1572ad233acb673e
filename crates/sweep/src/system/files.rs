//! Reading of whole files and atomic writing.

use super::process::ProcessIdentity;
use rustix::fs::OFlags;
use std::fs::{File, Permissions};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::{OpenOptionsExt as _, PermissionsExt as _};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::NamedTempFile;

/// First bytes of every SQLite file.
const SQLITE: &[u8] = b"SQLite format 3\0";
/// Endings of the files that SQLite keeps beside a store.
const LOGS: [&str; 3] = ["-wal", "-shm", "-journal"];

/// First letters of the names of all temporary files.
const TEMPORARY: &str = ".sweep-part-";
/// Age at which a temporary file of another machine is taken for left behind.
const LEFT_BEHIND: Duration = Duration::from_hours(24);

/// The folder of the user's cache; `None` without a home.
pub(crate) fn cache_folder() -> Option<PathBuf> {
    let cache = std::env::var_os("XDG_CACHE_HOME")
        .map(PathBuf::from)
        .filter(|path| path.is_absolute())
        .or_else(|| Some(std::env::home_dir()?.join(".cache")))?;
    Some(cache.join("sweep"))
}

/// The folder of a file; the working directory for a bare name.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

/// A path with a suffix.
pub(crate) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}

/// Reads a whole file. Every file named by a user is read by this, without blocking and with
/// limited memory.
///
/// # Errors
/// System errors; a non-regular file, such as a pipe or a device; more bytes than the limit.
pub(crate) fn read_whole(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    // Opening a pipe does not block without a writer.
    let flags = OFlags::NONBLOCK.bits().cast_signed();
    let file = File::options().read(true).custom_flags(flags).open(path)?;
    let there = file.metadata()?;
    if there.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    if !there.is_file() {
        return Err(io::Error::other("it is a pipe or a device, and not a file"));
    }
    read_limited(file, limit)
}

/// Reads a whole file as text.
///
/// # Errors
/// As [`read_whole`], and invalid UTF-8.
pub(crate) fn read_text(path: &Path, limit: u64) -> io::Result<String> {
    let bytes = read_whole(path, limit)?;
    String::from_utf8(bytes).map_err(|error| io::Error::other(error.utf8_error()))
}

/// Reads up to a number of bytes.
///
/// # Errors
/// System errors, and more bytes than the limit.
pub(crate) fn read_limited(from: impl io::Read, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    from.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        let problem = format!("it is larger than {limit} bytes, the maximum for such a file");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, problem));
    }
    Ok(bytes)
}

/// Writes a file under a temporary name, syncs it, and renames it: readers never see a partial
/// file, and the old one stays until then.
///
/// # Errors
/// System errors. No temporary file is left.
pub(crate) fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> io::Result<()> {
    // Devices and pipes are written directly, and links are followed.
    if std::fs::metadata(path).is_ok_and(|there| !there.is_file()) {
        return write(&mut File::options().write(true).open(path)?);
    }
    let followed = std::fs::canonicalize(path);
    let path = followed.as_deref().unwrap_or(path);
    let folder = folder_of(path);
    if !folder.is_dir() {
        let message = format!("there is no folder {}", folder.display());
        return Err(io::Error::new(io::ErrorKind::NotFound, message));
    }
    // The name of the temporary file would not help the user.
    let mut file = temporary_file(folder).map_err(|error| error.kind())?;
    write(file.as_file_mut())?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|error| error.error)?;
    // The name itself must be on the disk too. Not every shared file system lets a folder be
    // synced.
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
    Ok(())
}

/// A temporary file in a folder, with the usual permissions within the user's mask. Those that
/// killed processes left there are deleted first.
///
/// # Errors
/// System errors.
pub(crate) fn temporary_file(folder: &Path) -> io::Result<NamedTempFile> {
    let me = ProcessIdentity::of_this_process();
    clear_temporary_files(folder, &me);
    tempfile::Builder::new()
        .prefix(&format!(
            "{TEMPORARY}{}-{}-{}-",
            machine(&me),
            me.pid,
            me.start
        ))
        .permissions(Permissions::from_mode(0o666))
        .tempfile_in(folder)
}

/// Deletes the temporary files that killed processes left in a folder. What cannot be read or
/// deleted stays.
fn clear_temporary_files(folder: &Path, me: &ProcessIdentity) {
    for path in left_behind(folder, me) {
        let _ = std::fs::remove_file(path);
    }
}

/// Whether a killed process left a temporary file in a folder.
pub(crate) fn is_left_behind(folder: &Path) -> bool {
    !left_behind(folder, &ProcessIdentity::of_this_process()).is_empty()
}

/// Temporary files of processes that no longer run, and the old ones of other machines.
fn left_behind(folder: &Path, me: &ProcessIdentity) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in names {
        let name = entry.file_name();
        let Some(owner) = name.to_str().and_then(|name| name.strip_prefix(TEMPORARY)) else {
            continue;
        };
        let mut parts = owner.split('-');
        let is_here = parts.next() == Some(machine(me).as_str());
        let pid = parts.next().and_then(|pid| pid.parse().ok());
        let owner = pid.filter(|_| is_here).map(|pid| ProcessIdentity {
            pid,
            start: parts.next().unwrap_or_default().to_owned(),
            ..me.clone()
        });
        let is_dead = if let Some(owner) = owner {
            !owner.runs()
        } else {
            let changed = entry.metadata().and_then(|file| file.modified());
            let age = changed.ok().and_then(|changed| changed.elapsed().ok());
            age.is_some_and(|age| age > LEFT_BEHIND)
        };
        if is_dead {
            found.push(entry.path());
        }
    }
    found
}

/// A short name of the machine, its boot and the namespace in which a pid has meaning.
fn machine(process: &ProcessIdentity) -> String {
    let parts = [&process.host, &process.boot, &process.namespace];
    let all = parts.map(String::as_str).join("\n");
    blake3::hash(all.as_bytes()).to_hex()[..8].to_owned()
}

/// Why an existing file must not be replaced by an output, if so: it is a store, a file of one, or
/// a campaign file.
pub fn reason_to_stay(path: &Path) -> Option<String> {
    let followed = std::fs::canonicalize(path);
    let path = followed.as_deref().unwrap_or(path);
    if is_sqlite(path) {
        return Some("it is a store, or another SQLite file".into());
    }
    let name = path.to_string_lossy();
    let mut stores = LOGS.iter().filter_map(|ending| name.strip_suffix(ending));
    if let Some(store) = stores.find(|store| is_sqlite(Path::new(store))) {
        return Some(format!("it belongs to the store {store}"));
    }
    let is_campaign = path.extension().is_some_and(|ending| ending == "toml") && path.is_file();
    is_campaign.then(|| "it is a campaign file".into())
}

/// Whether a file is an SQLite file.
fn is_sqlite(path: &Path) -> bool {
    let mut start = [0; SQLITE.len()];
    // A pipe would block.
    path.is_file()
        && std::fs::File::open(path).is_ok_and(|mut file| file.read_exact(&mut start).is_ok())
        && start == SQLITE
}

/// Writes a whole file, under a temporary name until it is complete.
///
/// # Errors
/// An I/O error, also for a file that must not be replaced: see [`reason_to_stay`].
pub fn write_output(path: &Path, bytes: &[u8]) -> io::Result<()> {
    match reason_to_stay(path) {
        Some(reason) => Err(io::Error::other(reason)),
        None => write_whole(path, |file| file.write_all(bytes)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn temporary_files_of_dead_processes_are_deleted_and_those_of_others_stay() {
        let directory = tempfile::tempdir().unwrap();
        let me = ProcessIdentity::of_this_process();
        let mine = temporary_file(directory.path()).unwrap();
        let left = |machine: &str, pid: u32| {
            let path = directory
                .path()
                .join(format!("{TEMPORARY}{machine}-{pid}-1-abcdef"));
            std::fs::write(&path, "part").unwrap();
            path
        };
        // No process has this number and started with the machine.
        let (dead, elsewhere) = (left(&machine(&me), me.pid), left("00000000", me.pid));
        let old = left("11111111", 1);
        let long_ago = std::time::SystemTime::now() - 2 * LEFT_BEHIND;
        File::options()
            .write(true)
            .open(&old)
            .unwrap()
            .set_modified(long_ago)
            .unwrap();
        let other = directory.path().join("kept");
        std::fs::write(&other, "kept").unwrap();
        write_whole(&directory.path().join("a"), |file| file.write_all(b"a")).unwrap();
        assert!(!dead.exists() && !old.exists());
        assert!(elsewhere.exists() && other.exists() && mine.path().exists());
    }

    #[test]
    fn a_file_that_fails_half_way_leaves_the_old_one_and_nothing_else() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a");
        write_whole(&path, |file| file.write_all(b"old")).unwrap();
        let failed = write_whole(&path, |file| {
            file.write_all(b"ne")?;
            Err(io::Error::other("no more"))
        });
        assert_eq!(failed.unwrap_err().to_string(), "no more");
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
        let link = directory.path().join("link");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        write_whole(&link, |file| file.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert!(link.is_symlink());
    }

    #[test]
    fn a_folder_that_is_missing_is_named_and_not_the_file_that_was_to_be_there() {
        let error = write_whole(Path::new("/none/of/it"), |_| Ok(())).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
        assert_eq!(error.to_string(), "there is no folder /none/of");
    }

    #[test]
    fn a_device_stays_a_device() {
        write_whole(Path::new("/dev/null"), |file| file.write_all(b"new")).unwrap();
        assert!(!std::fs::metadata("/dev/null").unwrap().is_file());
    }
}
