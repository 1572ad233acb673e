//! Runs and campaigns: the types that all other modules share.

pub mod axes;
pub mod campaign;
pub mod case;
pub(crate) mod checkpoint;
pub mod order;
pub mod precision;
pub mod protocol;
pub(crate) mod replay;
pub mod spaces;
