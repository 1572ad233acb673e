//! Tests of the program by users, clusters and browsers: one module per subject, with common
//! helpers in `harness`.
//!
//! No test asserts how long something takes. Where a test waits for another process it gives up
//! after two minutes, so that a process that never ends fails the test instead of blocking it.
#![cfg(unix)]
#![expect(
    clippy::unwrap_used,
    reason = "tests: a panic is the failure, and names state the fact"
)]
#![expect(clippy::print_stderr, reason = "names the tests that are skipped")]

mod attacks;
mod browser;
mod campaign;
mod command_line;
mod documentation;
mod draw;
mod extreme;
mod fit;
mod flows;
mod folded;
mod harness;
mod interruptions;
mod layers;
mod precision;
mod pressure;
mod progress;
mod published;
mod reference;
mod report;
mod scripts;
mod segments;
mod slurm;
mod structure;
mod suspensions;
mod torture;
mod versions;
