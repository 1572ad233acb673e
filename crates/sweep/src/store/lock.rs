//! Waiting for the lock of a store.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Time to wait for a lock before its owner is determined.
const WAIT: Duration = if cfg!(test) {
    Duration::from_millis(500)
} else {
    Duration::from_secs(5)
};
/// Number of such waits, where no owner is known to live.
pub(super) const WAITS: u32 = if cfg!(test) { 4 } else { 12 };
/// Number of further waits between notes to the user.
pub(super) const WAITS_BETWEEN_NOTES: u32 = 60;
/// Time to wait for a lock once a stop was requested.
const WAIT_WHEN_STOPPING: Duration = Duration::from_millis(500);
/// Interval between checks of a lock.
const LOOK: Duration = Duration::from_millis(5);
/// Whether a stop was requested.
static STOP_REQUESTED: AtomicBool = AtomicBool::new(false);

/// Shortens the wait for locks, after a stop request.
pub(crate) fn shorten_lock_wait() {
    STOP_REQUESTED.store(true, Ordering::Relaxed);
}

/// Whether a stop was requested.
pub(super) fn is_stopping() -> bool {
    STOP_REQUESTED.load(Ordering::Relaxed)
}

/// Waits a moment for a lock; returns whether to continue.
pub(super) fn wait_for_lock(looks: i32) -> bool {
    let patience = if is_stopping() {
        WAIT_WHEN_STOPPING
    } else {
        WAIT
    };
    if LOOK.saturating_mul(looks.unsigned_abs()) >= patience {
        return false;
    }
    std::thread::sleep(LOOK);
    true
}
