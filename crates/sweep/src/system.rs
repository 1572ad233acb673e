//! What the machine gives: clocks, processes, files, disks, exit codes, tables kept in the user's cache.

pub(crate) mod clock;
pub mod disk;
pub mod exit;
pub(crate) mod files;
pub(crate) mod process;
pub mod tables;

use std::sync::{Mutex, MutexGuard, PoisonError};

/// What a mutex guards, which a panic of another thread leaves whole.
pub(crate) fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
