//! Loops compiled for the instruction set of the machine they run on.

/// Runs a closure whose inlined code may use all vector instructions of this processor.
///
/// Only functions inlined into the closure benefit. The same processor always runs the same
/// instructions, so results repeat bit for bit.
pub fn vectorised<R>(operation: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(operation)
}
