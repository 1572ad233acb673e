//! How long the lock of a store is waited for.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How long a lock is waited for before its owner is looked for.
const WAIT: Duration = if cfg!(test) {
    Duration::from_millis(500)
} else {
    Duration::from_secs(5)
};
/// How often, where no owner is known to live.
pub(super) const WAITS: u32 = if cfg!(test) { 4 } else { 12 };
/// After so many more the user is told again.
pub(super) const WAITS_BETWEEN_NOTES: u32 = 60;
/// How long a lock is waited for once a stop was requested.
const WAIT_WHEN_STOPPING: Duration = Duration::from_millis(500);
/// Time from one look at a lock to the next.
const LOOK: Duration = Duration::from_millis(5);
/// Whether a stop was requested.
static STOP_REQUESTED: AtomicBool = AtomicBool::new(false);

/// No lock is waited for much longer: a stop was requested.
pub(crate) fn shorten_lock_wait() {
    STOP_REQUESTED.store(true, Ordering::Relaxed);
}

/// Whether a stop was requested.
pub(super) fn is_stopping() -> bool {
    STOP_REQUESTED.load(Ordering::Relaxed)
}

/// Waits a moment for a lock, or says that it was enough.
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
