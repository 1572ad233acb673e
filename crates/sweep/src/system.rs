//! What the machine gives: clocks, processes, files, disks, exit codes, tables kept in the user's cache.

pub(crate) mod clock;
pub mod disk;
pub mod exit;
pub(crate) mod files;
pub(crate) mod process;
pub mod tables;
