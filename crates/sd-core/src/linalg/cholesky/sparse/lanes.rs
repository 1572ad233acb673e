//! Eight numbers that are computed in parallel.

/// Number of lanes.
pub(super) const LANES: usize = 8;
/// One number of each.
pub(super) type Lanes = [f32; LANES];
