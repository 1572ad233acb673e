//! Services of the system: clocks, processes, files, disks, exit codes.

pub(crate) mod clock;
pub mod disk;
pub mod exit;
pub mod files;
pub(crate) mod process;

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks a mutex whose data stays valid after a panic of another thread.
pub(crate) fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
