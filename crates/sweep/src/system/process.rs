//! ProcessIdentity of processes, and whether another one still lives.

use serde::Deserialize;
use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// A process on another host counts as dead once its heartbeat is this old.
pub(crate) const HEARTBEAT_LIMIT: Duration = Duration::from_mins(2);

/// ProcessIdentity of a process.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub(crate) struct ProcessIdentity {
    /// Name of the host.
    pub(crate) host: String,
    /// Its boot id, which changes at a restart. Empty where the system does not report it.
    pub(crate) boot: String,
    /// Namespace in which the pid has meaning: two containers may share host and boot.
    pub(crate) namespace: String,
    /// Process id.
    pub(crate) pid: u32,
    /// Start of the process in clock ticks since boot: differs if the pid is used again.
    pub(crate) start: String,
}

/// State of another process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ProcessState {
    /// It runs, or had a recent heartbeat.
    Alive,
    /// It is dead.
    Dead,
}

impl ProcessIdentity {
    /// This process.
    pub(crate) fn of_this_process() -> Self {
        let pid = std::process::id();
        Self {
            host: rustix::system::uname()
                .nodename()
                .to_string_lossy()
                .into_owned(),
            boot: read("/proc/sys/kernel/random/boot_id"),
            namespace: std::fs::read_link("/proc/self/ns/pid")
                .map(|link| link.to_string_lossy().into_owned())
                .unwrap_or_default(),
            pid,
            start: start_of(pid).unwrap_or_default(),
        }
    }

    /// Whether the process `other`, with its last heartbeat `silence` ago, still lives, as far as
    /// this process can determine.
    pub(crate) fn judge(&self, other: &Self, silence: Duration) -> ProcessState {
        if self.host == other.host && self.boot == other.boot && self.namespace == other.namespace {
            return if other.runs() {
                ProcessState::Alive
            } else {
                ProcessState::Dead
            };
        }
        let restarted = self.host == other.host
            && !self.boot.is_empty()
            && !other.boot.is_empty()
            && self.boot != other.boot;
        if restarted || silence > HEARTBEAT_LIMIT {
            ProcessState::Dead
        } else {
            ProcessState::Alive
        }
    }

    /// Whether this process of our host and namespace runs, and is not a later one with the same
    /// pid.
    pub(super) fn runs(&self) -> bool {
        if Path::new("/proc/self/stat").exists() {
            return start_of(self.pid).is_some_and(|start| start == self.start);
        }
        i32::try_from(self.pid)
            .ok()
            .and_then(rustix::process::Pid::from_raw)
            .is_some_and(|pid| {
                !matches!(
                    rustix::process::test_kill_process(pid),
                    Err(rustix::io::Errno::SRCH)
                )
            })
    }
}

/// Start of a process in clock ticks since boot, unless it is dead or a zombie.
fn start_of(pid: u32) -> Option<String> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name, in parentheses, may contain any characters; the fields after it are plain.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let state = *fields.first()?;
    (state != "Z" && state != "X").then(|| fields.get(19).map(|start| (*start).to_owned()))?
}

/// The content of a small file without its line end, empty if it cannot be read.
fn read(path: &str) -> String {
    std::fs::read_to_string(path)
        .map(|text| text.trim().to_owned())
        .unwrap_or_default()
}

/// Age of a heartbeat. One so far ahead of the clock that it would keep its process alive
/// indefinitely is ignored.
pub(crate) fn silence(heartbeat: i64) -> Duration {
    let since = now().saturating_sub(heartbeat);
    let ahead = Duration::from_millis(since.min(0).unsigned_abs());
    if ahead > HEARTBEAT_LIMIT {
        return Duration::MAX;
    }
    Duration::from_millis(u64::try_from(since).unwrap_or(0))
}

/// Milliseconds since 1970.
pub(crate) fn now() -> i64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| {
            i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
        })
}

/// Hash of the executable: processes with equal hashes compute the same bits on the same machine.
pub(crate) fn build() -> String {
    // Read once, in chunks.
    static BUILD: LazyLock<String> = LazyLock::new(|| {
        let hash = || {
            let mut hasher = blake3::Hasher::new();
            // The system keeps the file of a running program even after its name was removed by an
            // update.
            let program = std::fs::File::open("/proc/self/exe")
                .or_else(|_| std::fs::File::open(std::env::current_exe()?))?;
            hasher.update_reader(program)?;
            Ok::<_, std::io::Error>(hasher.finalize().to_hex()[..16].to_owned())
        };
        hash().unwrap_or_default()
    });
    BUILD.clone()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_is_alive_and_its_pid_reused_is_dead() {
        let me = ProcessIdentity::of_this_process();
        assert_eq!(me.judge(&me, Duration::ZERO), ProcessState::Alive);
        assert_eq!(me.judge(&me, HEARTBEAT_LIMIT * 2), ProcessState::Alive);
        if !me.start.is_empty() {
            let earlier = ProcessIdentity {
                start: "1".into(),
                ..me.clone()
            };
            assert_eq!(me.judge(&earlier, Duration::ZERO), ProcessState::Dead);
        }
    }

    #[test]
    fn a_heartbeat_from_the_future_is_ignored() {
        let hours = |hours: i64| now() + 3_600_000 * hours;
        assert!(silence(hours(24)) > HEARTBEAT_LIMIT);
        assert!(silence(i64::MAX) > HEARTBEAT_LIMIT);
        assert!(silence(hours(-1)) > HEARTBEAT_LIMIT);
        assert!(silence(i64::MIN) > HEARTBEAT_LIMIT);
        // Clocks of two machines may differ by seconds.
        assert_eq!(silence(now() + 5000), Duration::ZERO);
    }

    #[test]
    fn another_host_is_judged_by_its_heartbeat() {
        let me = ProcessIdentity::of_this_process();
        let other = ProcessIdentity {
            host: "elsewhere".into(),
            ..me.clone()
        };
        assert_eq!(
            me.judge(&other, Duration::from_secs(5)),
            ProcessState::Alive
        );
        assert_eq!(
            me.judge(&other, HEARTBEAT_LIMIT + Duration::from_secs(1)),
            ProcessState::Dead
        );
    }

    #[test]
    fn a_container_of_the_same_host_is_judged_by_its_heartbeat() {
        let me = ProcessIdentity::of_this_process();
        let other = ProcessIdentity {
            namespace: "pid:[1]".into(),
            pid: 1,
            ..me.clone()
        };
        assert_eq!(
            me.judge(&other, Duration::from_secs(5)),
            ProcessState::Alive
        );
    }

    #[test]
    fn a_restarted_host_has_no_old_processes() {
        let me = ProcessIdentity {
            boot: "now".into(),
            ..ProcessIdentity::of_this_process()
        };
        let other = ProcessIdentity {
            boot: "before".into(),
            ..me.clone()
        };
        assert_eq!(me.judge(&other, Duration::ZERO), ProcessState::Dead);
    }
}
