//! Eight numbers that are computed side by side.

/// How many.
pub(super) const LANES: usize = 8;
/// One number of each.
pub(super) type Lanes = [f32; LANES];
