//! Text for people: formatted numbers, times and sizes, without control sequences of terminals.

pub(crate) mod choices;
pub mod format;
pub(crate) mod table;
pub(crate) mod visible;
