//! What a run is and which runs a campaign has: the words that all other rooms share.

pub mod axes;
pub(crate) mod campaign;
pub mod case;
pub(crate) mod checkpoint;
pub(crate) mod order;
pub mod protocol;
pub(crate) mod replay;
pub(crate) mod sampled;
pub mod spaces;
