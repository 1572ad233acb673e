//! Disks and file systems: free space and write access.

use super::files::folder_of;
use std::path::Path;

/// With less free space than this, in bytes, a failed write counts as caused by a full disk.
const ROOM: u64 = 256 << 10;

/// The system error of a file that cannot be created or opened for writing.
pub(crate) fn reason_against(path: &Path) -> Option<std::io::Error> {
    let existed = path.exists();
    let opened = std::fs::OpenOptions::new()
        .append(true)
        .create(true)
        .open(path);
    match opened {
        Err(_) if !takes_files(path) => Some(std::io::Error::other(
            "the file system there accepts no user files",
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

/// Whether a file is on a disk and not in a kernel file system such as /proc.
fn takes_files(path: &Path) -> bool {
    let folder = path.parent().unwrap_or(Path::new("."));
    rustix::fs::statvfs(folder).is_ok_and(|disk| disk.f_blocks > 0)
}

/// Whether the disk of a file, or the user's quota on it, is full.
pub(crate) fn is_full(path: &Path) -> bool {
    let place = folder_of(path);
    rustix::fs::statvfs(place)
        // Kernel file systems have no space at all, but are not full.
        .is_ok_and(|disk| {
            disk.f_blocks > 0
                && (disk.f_bavail.saturating_mul(disk.f_frsize) < ROOM || disk.f_favail == 0)
        })
        || takes_no_more(place)
        || has_largest_size(path)
}

/// Whether a file, or the log beside it, has almost the largest size that the system allows this
/// process (`ulimit -f`).
fn has_largest_size(path: &Path) -> bool {
    let limit = rustix::process::getrlimit(rustix::process::Resource::Fsize).current;
    let size = |path: &Path| std::fs::metadata(path).map_or(0, |file| file.len());
    let largest = size(path).max(size(&super::files::with_suffix(path, "-wal")));
    limit.is_some_and(|limit| largest + ROOM > limit)
}

/// Whether the system refuses a small file as for a full disk: quotas are not reported otherwise.
fn takes_no_more(place: &Path) -> bool {
    use std::io::{ErrorKind, Write as _};
    let written = super::files::temporary_file(place).and_then(|mut file| {
        file.write_all(&vec![0; 64 << 10])?;
        file.as_file().sync_all()
    });
    written.is_err_and(|error| {
        matches!(
            error.kind(),
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded
        )
    })
}

/// The name of the network file system of a file, if it is on one, where several machines cannot
/// share a store.
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
}
