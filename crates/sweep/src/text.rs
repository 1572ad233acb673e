//! Text for people: numbers, times and sizes in words, and nothing in it that a terminal would obey.

pub mod format;
pub(crate) mod visible;
