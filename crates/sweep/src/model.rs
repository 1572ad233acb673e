//! Runs and campaigns: the types that all other modules share.

pub mod axes;
pub(crate) mod campaign;
pub mod case;
pub(crate) mod checkpoint;
pub(crate) mod order;
pub mod protocol;
pub(crate) mod replay;
pub(crate) mod sampled;
pub mod spaces;
